# Whether the numbers can be trusted: the emulator's errors on runs left out, and how the annealing
# went.

left_out_table <- function(fit) {
  z <- sort(as.numeric(fit$emulator$left_out$error / sqrt(fit$emulator$left_out$variance)))
  u <- stats::ppoints(length(z))
  kept <- unique(round(seq(1, length(z), length.out = min(length(z), 400))))
  data.frame(expected = stats::qnorm(u)[kept], seen = z[kept])
}

# Numbers with the stage that they are of, unless there is only one.
by_stage <- function(told, stage) trimws(paste(told, ifelse(stage == "the model", "", stage)))

left_out_title <- function(fits) {
  beyond <- vapply(fits, function(fit) {
    with(fit$emulator$left_out, mean(abs(error) > 2 * sqrt(variance)))
  }, 0)
  sprintf("Errors on runs left out beyond two standard deviations: %s; 5 %% are expected",
          listed(by_stage(percent(beyond), names(fits))))
}

check_words <- function(fits) {
  checks <- Filter(Negate(is.null), lapply(fits, `[[`, "check"))
  ratio <- vapply(checks, `[[`, 0, "ratio")
  if (!length(ratio)) return("The emulator was not checked by runs where the posterior lies")
  sprintf("Where the posterior lies, its error by runs, divided by the noise, is %s: %s",
          listed(by_stage(short(ratio), names(ratio))),
          if (all(ratio <= rules$error_ratio)) "good enough" else "too much, more runs are needed")
}

figure_emulator <- function(fits) {
  table <- stage_table(fits, left_out_table)
  figure <- ggplot2::ggplot(
    table, ggplot2::aes(.data$expected, .data$seen, colour = .data$stage, shape = .data$stage)) +
    ggplot2::geom_abline(colour = "grey40") +
    ggplot2::geom_point(size = 1.8) +
    ggplot2::scale_shape_manual(values = c("before" = 4, "after" = 19, "the model" = 19)) +
    stage_scales() +
    figure_titles(left_out_title(fits),
                  paste0("On the line, the emulator knows its errors. Ends steeper than the line: ",
                         "a few runs, mostly far from the posterior, are worse than it says. ",
                         check_words(fits), "."),
                  x = "expected (standard normal)", y = "error seen / its stated sd") +
    figure_theme()
  with_height(figure, 5.4)
}

ladder_table <- function(result) {
  panels <- c("accepted moves [%]", "effective share of the chains [%]")
  ladder <- result$ladder
  rbind(data.frame(beta = ladder$beta, value = 100 * ladder$acceptance, panel = panels[1]),
        data.frame(beta = ladder$beta, value = 100 * ladder$ess, panel = panels[2]))
}

estimate_words <- function(results) {
  told <- function(e) sprintf("%s \u00b1 %s", format(round(e[1], 1), nsmall = 1), short(e[2]))
  words <- vapply(names(results), function(name) {
    r <- results[[name]]
    second <- if (length(r$second) == 2 && all(is.finite(r$second)))
      paste0(", ", told(r$second), " by the second estimator")
    paste0(name, ", ", told(r$annealed), " by annealing", second)
  }, "")
  paste0("Log evidence: ", paste(words, collapse = "; "), ".")
}

figure_sampler <- function(results) {
  table <- stage_table(results, ladder_table)
  table$panel <- factor(table$panel, unique(table$panel))
  trusted <- vapply(results, function(r) isTRUE(r$trusted), TRUE)
  title <- if (all(trusted)) "The sampler passed its own checks"
           else paste("The sampler is not to be trusted:",
                      results[[which(!trusted)[1]]]$why)
  figure <- ggplot2::ggplot(
    table, ggplot2::aes(.data$beta, .data$value, colour = .data$stage, shape = .data$stage)) +
    ggplot2::geom_line(ggplot2::aes(linetype = .data$stage), linewidth = 0.8) +
    ggplot2::geom_point(size = 3) +
    ggplot2::scale_shape_manual(values = c("before" = 17, "after" = 19, "the model" = 19)) +
    ggplot2::scale_y_continuous(limits = c(0, 100)) +
    ggplot2::scale_x_continuous(trans = "sqrt", limits = c(0, 1), breaks = c(0, 0.05, 0.25, 0.5, 1),
                                guide = apart) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 2, labeller = wrap_strips(2)) +
    stage_scales() + stage_lines() +
    figure_titles(title, paste("From where the chains start (0) to the posterior (1). Low values:",
                               "chains that stand still, or few that carry the weight; more chains",
                               "or moves would help.",
                               estimate_words(results)),
                  x = "inverse temperature, axis compressed") +
    figure_theme() + wide_keys()
  with_height(figure, 4.8)
}
