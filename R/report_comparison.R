#' Comparison in words
#'
#' Says in plain sentences and tables which model the evidence chooses and how clearly. They also
#' say what its discrepancy responds to, whether criteria of practice would choose otherwise, and
#' what cannot be trusted. [report()] lays it out.
#'
#' @param object A comparison ([compare_models()]).
#' @param x The summary.
#' @param ... Not used.
#' @return A list:
#'   * `title`, `headline`.
#'   * `evidence`, `remains`, `practice`, `doubts`: sentences.
#'   * `inspect`: sentences that say what to inspect next, what could overturn the verdict first.
#'     `print()` shows three.
#'   * `models`, `attribution`: the paper's table 3a.
#'   * `parameters`: table 3b.
#'   * `criteria`, `errors`: tables 4 and 5.
#'   * `heat_loss`: a table for zones.
#'   * `method`: a table.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' steep <- function_simulator(function(values, drivers) 20 + values[["gain"]]^2 * drivers[, "Te"],
#'                             free("gain", uniform(0, 1)), boundary = "Te")
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)))
#' comparison <- compare_models(list(linear = linear, steep = steep), room, runs = 20,
#'                              control = quick, seed = 1, quiet = TRUE)
#' summary(comparison)
#' @export
summary.amiss_comparison <- function(object, ...) {
  check_whole(object, "object")
  object <- labelled(object)
  no_doubt <- paste("The sampler passed its own checks for every model; bases and emulators are",
                    "fine beside the noise; no parameter is at the edge of its range.")
  structure(list(title = object$title %||% object$study %||% object$measurements$name,
                 headline = comparison_headline(object),
                 evidence = c(evidence_sentences(object), probability_sentences(object)),
                 remains = remains_sentences(object), practice = practice_sentences(object),
                 doubts = doubt_sentences(object) %||% no_doubt,
                 inspect = comparison_inspections(object), models = models_words(object),
                 attribution = attribution_table_words(object),
                 parameters = compared_parameters_words(object), criteria = criteria_words(object),
                 errors = errors_words(object), heat_loss = heat_loss_words(object),
                 method = comparison_method_table(object), seed = object$seed),
            class = "summary.amiss_comparison")
}

#' @rdname summary.amiss_comparison
#' @export
print.summary.amiss_comparison <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong {x$title}}: {x$headline}")
  parts <- list("Evidence" = x$evidence, "What remains" = x$remains,
                "What practice would do" = x$practice, "Doubts" = x$doubts)
  say_parts(parts)
  say_inspections(x$inspect)
})

comparison_headline <- function(comparison) {
  table <- comparison$tables$evidence
  best <- table[which.min(table$rank), ]
  if (nrow(table) < 2) return(sprintf("One model, %s, and nothing to compare it with.", best$model))
  rough <- if (!all(table$trusted[table$rank <= 2])) ", though the numbers are rough" else ""
  if (best$log10_bf >= 2 && best$bf_lower95 > 0)
    return(sprintf("The record is decisively for %s among %d models%s.", best$model, nrow(table),
                   rough))
  sprintf("%s leads among %d models, but not decisively: %s %s.", best$model, nrow(table),
          best$against, if (best$bf_lower95 <= 0) "cannot be distinguished from it"
                        else paste("is only", power_of_ten(best$log10_bf), "times less probable"))
}

probability_sentences <- function(comparison) {
  table <- comparison$tables$evidence
  if (nrow(table) < 2) return(NULL)
  table <- table[order(table$rank), ]
  near <- table[-1, ][table$probability[-1] >= 0.01, ]
  if (nrow(near)) sprintf(paste("All models were equally likely beforehand; besides the best, some",
                                "probability is left to %s."),
                          listed(paste0(near$model, " (", percent(near$probability), ")")))
  else paste("All models were equally likely beforehand; none but the best keeps one per cent of",
             "the probability.")
}

remains_sentences <- function(comparison) {
  table <- comparison$tables$attribution
  vapply(names(comparison$models), function(name) {
    driving <- table[table$model == name & table$significant, ]
    sprintf("%s: the discrepancy responds to %s.", name,
            listed(driving$boundary, none = "no boundary condition"))
  }, "", USE.NAMES = FALSE)
}

practice_sentences <- function(comparison) {
  criteria <- comparison$tables$criteria
  disagree <- disagreement_sentences(comparison)
  correlated <- criteria[abs(criteria$autocorrelation) > 0.3, ]
  noted <- criteria[nzchar(criteria$lr_note) & !is.na(criteria$nested), ]
  c(if (!length(disagreements(comparison)))
      "Every criterion chooses the model that the evidence chooses.",
    disagree,
    if (nrow(correlated)) {
      sprintf(paste("Likelihood, AIC, BIC and the likelihood ratio count errors as independent;",
                    "those of %s are correlated from one step to the next (%s), so that these",
                    "criteria overstate every difference."),
              listed(correlated$model), listed(sprintf("%.2f", correlated$autocorrelation)))
    },
    if (nrow(noted))
      sprintf("Likelihood ratio of %s against %s: %s.", noted$model, noted$nested, noted$lr_note))
}

bracketed <- function(lower, upper) paste0("[", interval_words(lower, upper, 3, ", "), "]")

# Table 3a of the paper, in two: evidence, and attribution with a column for each condition.
models_words <- function(comparison) {
  evidence <- comparison$tables$evidence
  factor <- paste(with_limits(evidence$log10_bf, evidence$bf_lower95, evidence$bf_upper95, "+"),
                  "against", evidence$against)
  data.frame(model = evidence$model,
             "log10 L [95 %]" = with_limits(evidence$log10_evidence, evidence$lower95,
                                               evidence$upper95),
             estimate = ifelse(evidence$trusted, "sound", "rough"),
             "log10 Bayes factor" = ifelse(is.na(evidence$log10_bf), "", factor),
             evidence = ifelse(is.na(evidence$word), "", evidence$word),
             "log10 B against the first" = signed(evidence$log10_bf_first),
             probability = percent(evidence$probability), check.names = FALSE)
}

attribution_table_words <- function(comparison) {
  table <- comparison$tables$attribution
  cell <- if (comparison$method == "paper") {
    sprintf("%.3f [%.3f, %.3f]%s, rank %d", table$difference, table$lower95, table$upper95,
            ifelse(table$significant, " *", ""), table$rank)
  } else {
    sprintf("%s, p = %s%s", signed(table$log10_bf_dropped), format(round(table$p_value, 3)),
            ifelse(table$significant, " *", ""))
  }
  models <- names(comparison$models)
  columns <- sapply(comparison$measurements$conditions, function(condition)
    cell[match(paste(models, condition), paste(table$model, table$boundary))], simplify = FALSE)
  data.frame(model = models, columns, check.names = FALSE)
}

# Table 3b: the parameters of every model, with the true value where it is known.
compared_parameters_words <- function(comparison) {
  rows <- comparison$tables$parameters
  true <- true_values(comparison, rows$name)
  mean <- mapply(function(model, name) with(comparison$models[[model]]$fit,
                                            sum(weights * values[, name]) / sum(weights)),
                 rows$model, rows$name)
  holds <- ifelse(rows$lower95 <= true & true <= rows$upper95, "holds the truth",
                  "misses the truth")
  table <- data.frame(model = rows$model, parameter = rows$label, unit = pretty_unit(rows$unit),
                      prior = bracketed(rows$prior_lower, rows$prior_upper),
                      true = short(true, 3), mean = short(mean, 3), median = short(rows$median, 3),
                      "95 % interval" = bracketed(rows$lower95, rows$upper95),
                      note = paste0(ifelse(is.na(true), "", holds),
                                    ifelse(rows$at_edge, ", at the edge", "")),
                      check.names = FALSE, row.names = NULL)
  table$note <- sub("^, ", "", table$note)
  if (all(is.na(true))) table[names(table) != "true"] else table
}

criteria_words <- function(comparison) {
  table <- comparison$tables$criteria
  p_value <- ifelse(is.na(table$lr_p_value), "not defined",
                    format.pval(table$lr_p_value, 2, eps = 1e-4))
  note <- ifelse(nzchar(table$lr_note), paste0(" (", table$lr_note, ")"), "")
  ratio <- ifelse(is.na(table$lr), table$lr_note,
                  paste0(sprintf("%.1f against %s, p ", table$lr, table$nested), p_value, note))
  data.frame(model = table$model, k = table$k, "RMSE of the best fit" = short(table$rmse_best, 3),
             "log likelihood" = sprintf("%.1f", table$log_likelihood),
             AIC = sprintf("%.1f", table$aic), BIC = sprintf("%.1f", table$bic),
             "likelihood ratio" = ratio,
             "correlation of errors at one step" = sprintf("%.2f", table$autocorrelation),
             check.names = FALSE)
}

# Tables 4 and 5: errors in calibration and held out.
errors_words <- function(comparison) {
  unit <- comparison$measurements$unit
  score <- function(use, which) vapply(comparison$models, function(m) m$scores[[use]][[which]], 0)
  inside <- function(use)
    ifelse(is.na(score(use, "coverage95")), "", paste(round(100 * score(use, "coverage95")), "%"))
  table <- data.frame(model = names(comparison$models),
                      calibration = short(score("calibrate", "rmse"), 3),
                      inside = inside("calibrate"), row.names = NULL)
  names(table)[2:3] <- c(axis_label("RMSE, calibration", unit), "in its 95 % band")
  if (validates(comparison)) {
    table[[axis_label("RMSE, held out", unit)]] <- short(score("validate", "rmse"), 3)
    table[["in the band, held out"]] <- inside("validate")
  }
  table
}

heat_loss_words <- function(comparison) {
  losses <- Filter(length, lapply(comparison$models, `[[`, "heat_loss"))
  if (!length(losses)) return(NULL)
  limits <- vapply(losses, stats::quantile, c(0, 0), c(0.025, 0.975))
  table <- data.frame(
    model = names(losses), "heat loss coefficient [W/K]" = short(vapply(losses, mean, 0), 3),
    "95 % interval" = bracketed(limits[1, ], limits[2, ]), check.names = FALSE, row.names = NULL)
  true <- true_heat_loss(comparison)
  if (is.na(true)) table else cbind(table, true = short(true, 3))
}

comparison_method_table <- function(comparison) {
  unit <- comparison$measurements$unit
  value <- function(model) {
    fit <- model$fit
    c(length(fit$rows), ncol(fit$emulator$basis$vectors), nrow(fit$emulator$processes$inputs),
      with_unit(short(c(fit$measurements$noise_sd, fit$emulator$basis$discarded_rms,
                        fit$emulator$diagnostics$series_rmse)), unit),
      fit$trust$verdict)
  }
  cbind(quantity = c("calibration steps, N", "vectors of the simulation space, Q",
                     "runs of the simulator, M", "stated measurement noise",
                     "part of the runs that the Q vectors leave out (RMS)",
                     "error of the emulator (leave-one-out RMS)", "sampler"),
        as.data.frame(lapply(comparison$models, value), optional = TRUE))
}

#' @export
result_list.amiss_comparison <- function(x) {
  evidence <- x$tables$evidence
  model_list <- function(i) {
    model <- x$models[[i]]
    fit <- model$fit
    row <- evidence[i, ]
    rows_of <- function(table)
      table_rows(table[table$model == model$name, setdiff(names(table), "model")])
    loss <- model$heat_loss
    list(name = model$name, Q = ncol(fit$emulator$basis$vectors), N = length(fit$rows),
         M = nrow(fit$emulator$processes$inputs), noise_sd = fit$measurements$noise_sd,
         discarded_rms = fit$emulator$basis$discarded_rms, log10_evidence = row$log10_evidence,
         log10_evidence_interval = c(row$lower95, row$upper95), trusted = row$trusted,
         verdict = fit$trust$verdict, rank = row$rank,
         probability = row$probability, log10_bf = row$log10_bf,
         log10_bf_interval = c(row$bf_lower95, row$bf_upper95), against = row$against,
         word = row$word, log10_bf_first = row$log10_bf_first,
         criteria = rows_of(x$tables$criteria)[[1]],
         coverage95_validation = model$scores$validate[["coverage95"]],
         parameters = rows_of(x$tables$parameters), attribution = rows_of(x$tables$attribution),
         heat_loss = if (length(loss))
                       list(mean = mean(loss),
                            interval = unname(stats::quantile(loss, c(0.025, 0.975)))))
  }
  true_loss <- true_heat_loss(x)
  list(schema = 1L, study = x$study %||% x$measurements$name, seed = x$seed, wall_s = x$wall_s,
       method = x$method, best = best_model(x),
       headline = comparison_headline(x), models = lapply(seq_along(x$models), model_list),
       disagreements = as.list(disagreements(x)),
       doubts = as.list(doubt_sentences(x)),
       truth = if (!is.null(x$truth)) list(values = as.list(x$truth$values),
                                           heat_loss = if (!is.na(true_loss)) true_loss))
}

#' @export
report_content.amiss_comparison <- function(x) {
  x <- labelled(x)
  table <- generics::tidy(x)
  list(comparison = x, told = summary(x), paper = x$method == "paper", table = table,
       best = table[which.min(table$rank), ], figures = figures_of(x))
}
