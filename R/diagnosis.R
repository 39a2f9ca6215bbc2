#' Diagnosis in words
#'
#' Says in plain sentences and tables what is wrong and how sure that is, what would change, what it
#' brings and what remains. [report()] lays it out.
#'
#' @param object An upgrade ([upgrade_model()]).
#' @param x The summary.
#' @param ... Not used.
#' @return A list:
#'   * `title`, `tag`, `headline`.
#'   * `verdict`: `"named"`, `"likely"`, `"unexplained"` or `"nothing"`.
#'   * `record`, `note`, `sure`, `change`, `gain`, `remains`: sentences. `record` has the faults of
#'     the record.
#'   * `inspect`: sentences that say what to inspect next. First is what could overturn the verdict,
#'     then what decides between causes, then what narrows parameters. `print()` shows three.
#'   * `mechanisms`: for each mechanism adopted, its `verdict`, what it `brought`, what speaks
#'     `against` it, what fits `also`, and what to `inspect`.
#'   * `scores`, `changes`, `candidates`, `parameters`, `attribution`, `method`: tables.
#'   * `stopped_because`, `seed`: as in the upgrade.
#'
#'   If there are several records, the sentences and `scores` are in units of each record's noise.
#'   `records` and `of_records` then have the scores of each in its own unit.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' brighter <- function(values, drivers, base) base(values) + values[["sun"]] * drivers[, "Gv"]
#' sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters that the model leaves out.",
#'                  edit = function(model) {
#'   with_parameters(model, free("sun", uniform(0, 0.1), "K m2/W"), boundary = "Gv", f = brighter)
#' })
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)),
#'               attribution = list(surrogates = 19))
#' upgrade <- upgrade_model(linear, room, catalogue(sun), runs = 20, control = quick, seed = 1,
#'                          quiet = TRUE)
#' summary(upgrade)
#' @export
summary.amiss_upgrade <- function(object, ...) {
  check_whole(object, "object")
  object <- labelled(object)
  verdict <- diagnosis_verdict(object)
  last <- object$models[[length(object$models)]]
  structure(c(list(title = object$title %||% object$study %||% object$measurements$name), verdict,
              list(record = record_faults(object), note = size_note(object),
                   sure = sure_sentences(object), change = change_sentences(object),
                   gain = gain_sentences(object), remains = remaining_sentences(object),
                   inspect = upgrade_inspections(object),
                   mechanisms = lapply(adopted_models(object), mechanism_words, object),
                   scores = scores_table(object), changes = changes_table(object),
                   candidates = candidates_words(object), parameters = parameters_words(last$fit),
                   attribution = last$attribution$table, method = method_table(object),
                   stopped_because = object$stopped_because, seed = object$seed),
              if (is_several(object$measurements))
                list(of_records = record_sentences(object), records = record_scores(object))),
            class = "summary.amiss_upgrade")
}

#' @rdname summary.amiss_upgrade
#' @export
print.summary.amiss_upgrade <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong {x$title}}: {x$tag}")
  cli::cli_text("{x$headline}")
  parts <- list("Faults of the record" = x$record, "How sure" = x$sure,
                "What would change" = x$change, "What it brings" = c(x$gain, x$of_records),
                "What remains" = x$remains)
  say_parts(parts[lengths(parts) > 0])
  say_inspections(x$inspect)
})

# The verdict on the whole, after what the record itself has.
diagnosis_verdict <- function(upgrade) {
  verdict <- mechanism_verdict(upgrade)
  ids <- names(record_faults(upgrade))
  faults <- record_doubt_words(ids)
  if (is.null(faults)) return(verdict)
  if (verdict$verdict != "likely") verdict$tag <- paste0(verdict$tag, "; ", faults)
  verdict$headline <- paste0("Correct the record first: ", record_doubt_words(ids, "it"), ". ",
                             verdict$headline)
  verdict
}

# What of the mechanisms adopted is named, or what stays open.
mechanism_verdict <- function(upgrade) {
  adopted <- adopted_models(upgrade)
  if (!length(adopted)) return(open_verdict(upgrade))
  of <- function(verdict) Filter(function(m) m$verdict == verdict, adopted)
  headline <- cause_headline(upgrade)
  if (length(of("named"))) {
    tag <- paste0(if (length(of("named")) > 1) "Causes named" else "Cause named",
                  if (length(of("likely")) > 1) "; others are likely"
                  else if (length(of("likely"))) "; another is likely")
    return(list(verdict = "named", tag = tag, headline = headline))
  }
  likely <- of("likely")
  if (length(likely)) {
    tag <- if (describes(upgrade$catalogue[[likely[[1]]$mechanism]])) "Described, not explained"
           else if (is_one_of(likely[[1]]))
             paste0("The cause is ", listed(c(likely[[1]]$mechanism, likely[[1]]$rivals), "or"),
                    "; this record does not distinguish them")
           else paste("Likely cause, but",
                      paste(c(utils::head(likely[[1]]$doubts, 2),
                              if (length(likely[[1]]$doubts) > 2) "more speaks against it"),
                            collapse = "; "))
    return(list(verdict = "likely", tag = tag, headline = headline))
  }
  list(verdict = "unexplained", tag = "Unexplained; a stand-in fits", headline = headline)
}

# Whether nothing speaks against a mechanism but others that would do as well: then they are named
# together.
is_one_of <- function(model) length(model$rivals) && identical(names(model$doubts), "rivals")

open_verdict <- function(upgrade) {
  explained <- if (is.null(upgrade$candidates)) "no mechanism was tried"
               else if (unjudged(upgrade))
                 "whether a mechanism of the catalogue explains it cannot be decided"
               else "no mechanism of the catalogue explains it"
  tag <- if (unjudged(upgrade)) "Unexplained; the emulator is not good enough to judge mechanisms"
         else "Unexplained"
  unexplained <- function(headline) list(verdict = "unexplained", tag = tag, headline = headline)
  base <- upgrade$models[[1]]
  answers <- significant_conditions(base$attribution$table)
  remainder <- remaining_error(base, upgrade$measurements)
  if (unjudged(upgrade) && remainder$large) {
    return(unexplained(sprintf(
      paste("The error is %s times the stated noise%s. The model's emulator is not good enough to",
            "decide whether something is missing from the model or its parameters were not found."),
      short(remainder$ratio),
      if (length(answers)) paste(" and responds to", listed(answers)) else "")))
  }
  if (length(answers) && !remainder$large) {
    return(unexplained(sprintf(paste("The error is of the size of the stated noise (%s times), but",
                                     "a part of it responds to %s: something small is missing from",
                                     "the model, or its state at the start is off, and %s."),
                               short(remainder$ratio), listed(answers), explained)))
  }
  if (length(answers)) {
    return(unexplained(sprintf("Something that responds to %s is missing from the model, but %s.",
                               listed(answers), explained)))
  }
  if (remainder$large) {
    return(unexplained(sprintf(
      paste("Something is missing from the model, and %s: its error is %s times the stated noise;",
            "%s."), explained, short(remainder$ratio),
      remainder$pattern$what %||% "no response to a boundary condition was found in it")))
  }
  if (!base$fit$trust$trusted) {
    return(list(verdict = "nothing", tag = "Nothing decisive, but the numbers are not trusted",
                headline = paste0("No mechanism is called for, but the numbers behind this are ",
                                  "not to be trusted: ", base$fit$trust$verdict, ".")))
  }
  if (identical(upgrade$stopped_id, "none_computed")) {
    return(list(verdict = "nothing", tag = "No mechanism could be tried",
                headline = paste("No mechanism of the catalogue could be tried: mend them first.",
                                 "The remaining error responds to no boundary condition.")))
  }
  nothing <- paste("no mechanism is called for, and the remaining error responds to no boundary",
                   "condition")
  held_out <- held_out_excess(base, upgrade$measurements)
  if (!is.null(held_out)) {
    return(list(verdict = "nothing",
                tag = "Nothing decisive in calibration; the error on held-out data is larger",
                headline = sprintf(paste("In calibration %s. But on held-out data the error is %s",
                                         "times as large."), nothing, short(held_out))))
  }
  list(verdict = "nothing", tag = "Nothing decisive",
       headline = sprintf("Nothing decisive is wrong: %s.", nothing))
}

# The sentences of all mechanisms adopted, each as firmly as its verdict allows.
cause_headline <- function(upgrade) {
  adopted <- adopted_models(upgrade)
  sentence <- function(m) upgrade$catalogue[[m$mechanism]]$sentence
  adopted <- adopted[order(match(vapply(adopted, `[[`, "", "verdict"),
                                 c("named", "likely", "stand-in")))]
  told <- vapply(seq_along(adopted), function(k) {
    m <- adopted[[k]]
    switch(m$verdict, named = paste0(if (k > 1) "Also: ", sentence(m)),
           likely = paste0(likely_word(m, k), sentence(m)),
           paste0("\"", m$mechanism, "\" fits", if (k > 1) " too", ", but held-out data do not ",
                  "improve with it: take it as a stand-in for something else."))
  }, "")
  paste(told, collapse = " ")
}

likely_word <- function(model, k) {
  if (k > 1) "Likely as well: "
  else if ("remains" %in% names(model$doubts)) "Likely a part of it: "
  else "Most likely: "
}

#' @export
print.amiss_upgrade <- function(x, ...) on_stdout(x, {
  x <- labelled(x)
  adopted <- adopted_models(x)
  cli::cli_text(
    "{.strong Upgrade} of {.val {x$measurements$name}}: {length(adopted)} mechanism{?s} adopted")
  cli::cli_bullets(c("*" = "{diagnosis_verdict(x)$tag}"))
  listed_alone <- if (length(adopted) > 8) 7 else length(adopted)
  for (model in adopted[seq_len(listed_alone)]) {
    row <- candidate_row(model, x)
    boundary <- x$catalogue[[model$mechanism]]$boundary
    driven <- driver_words(model$mechanism, boundary)
    evidence <- if (is_sound(row, x)) sprintf("log10 Bayes factor %.1f", row$log10_bf)
                else "its numbers are not trusted"
    cli::cli_bullets(c("*" = paste("{model$verdict}: {.strong {model$mechanism}}{driven},",
                                   "{evidence}")))
  }
  others <- vapply(adopted[-seq_len(listed_alone)],
                   function(model) paste(model$verdict, model$mechanism), "")
  if (length(others)) cli::cli_bullets(c("*" = "{others}"))
  told <- unlist(lapply(x$catalogue[vapply(adopted, `[[`, "", "mechanism")], description_sentence,
                        last_fit(x)))
  for (sentence in told) cli::cli_bullets(c("*" = "{sentence}"))
  for (fault in utils::head(record_faults(x), 3)) cli::cli_bullets(c("!" = "{fault}"))
  g <- x$gain
  found <- if (isTRUE(x$runs_found > 0)) ", {x$runs_found} of them found in its cache"
  errors <- function(rmse)
    if (length(adopted)) paste(signif(rmse, 3), collapse = " -> ") else signif(rmse[1], 3)
  cli::cli_bullets(c("*" = paste0("RMSE {errors(g$rmse_calibration)} in calibration, ",
                                  if (has_validation(x)) "{errors(g$rmse_validation)} held out"
                                  else "no data held out",
                                  if (is_several(x$measurements)) paste(",", noise_unit)),
                     "*" = if (x$runs_total) paste0("{x$runs_total} runs of the simulator", found),
                     "*" = "stopped because {x$stopped_because}",
                     ">" = "next: {.fun summary}, {.fun plot} or {.fun report}"))
})
