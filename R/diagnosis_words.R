# The sentences of a diagnosis.

# The first step's trials that have a number, best first.
first_trials <- function(upgrade) {
  table <- upgrade$candidates[upgrade$candidates$from == upgrade$models[[1]]$name, ]
  table <- table[!is.na(table$log10_bf), ]
  table[order(-table$log10_bf), ]
}

last_attribution <- function(upgrade) upgrade$models[[length(upgrade$models)]]$attribution$table

# TRUE where no data were held out, or the changes as a whole lower their error by more than its own
# error.
improves_held_out <- function(upgrade) {
  last <- upgrade$models[[length(upgrade$models)]]
  !isFALSE(held_out_gain(upgrade$models[[1]], last)$improves)
}

is_too_rough <- function(row)
  !isTRUE(row$trusted) && row$upper95 - row$lower95 > rules$too_rough

evidence_sentence <- function(row, upgrade) {
  if (is_too_rough(row)) {
    return(sprintf("The numbers for %s are too rough for odds.", row$mechanism))
  }
  if (!is_sound(row, upgrade)) {
    return(sprintf("No odds are given for %s: its numbers are not trusted.", row$mechanism))
  }
  sprintf("The evidence for %s over no change is %s: odds of %s%s.", row$mechanism, row$word,
          odds(row$log10_bf), odds_interval(c(row$lower95, row$upper95)))
}

sure_sentences <- function(upgrade) {
  if (is.null(upgrade$candidates))
    return("No mechanism was tried, so no cause could be found.")
  trials <- first_trials(upgrade)
  if (!nrow(trials)) return(c(missing_sentence(upgrade), "No mechanism could be computed."))
  adopted <- adopted_models(upgrade)
  best <- trials[if (length(adopted)) match(adopted[[1]]$mechanism, trials$mechanism) else 1, ]
  needed <- sprintf(paste("This was the best; to be adopted, a mechanism needs odds of %s and a 95",
                          "%% interval that lies wholly in its favour."),
                    odds_size(upgrade$control$decisive))
  if (!length(adopted)) {
    if (unjudged(upgrade))
      return(c(missing_sentence(upgrade), unjudged_sentence(upgrade$models[[1]]$fit)))
    if (keeps_error(best) && best$log10_bf >= upgrade$control$decisive)
      needed <- raised_sentence(best)
    else if (is_refuted(best)) needed <- refuted_sentence(best)
    else if (is_unverified(best, upgrade))
      needed <- "It was not adopted, because no runs were left to verify it."
    return(c(missing_sentence(upgrade), if (is_sound(best, upgrade)) probability_sentence(trials),
             evidence_sentence(best, upgrade), needed, trust_sentence(upgrade, best)))
  }
  rows <- do.call(rbind, lapply(adopted, candidate_row, upgrade))
  each <- vapply(seq_len(nrow(rows)), function(k) evidence_sentence(rows[k, ], upgrade), "")
  first <- trials[1, ]
  c(each, if (is_sound(best, upgrade)) probability_sentence(trials),
    if (first$mechanism != best$mechanism) {
      if (keeps_error(first)) raised_sentence(first, " first")
      else if (all(is_sound(rbind(first, best), upgrade))) outranked_sentence(first, best)
    },
    trust_sentence(upgrade, rows))
}

raised_sentence <- function(row, when = "") {
  capital(sprintf(
    paste("%s was not adopted%s: with it the simulation's own error in calibration does not fall",
          "by 1 %% (it is %s times as large). Only the discrepancy fits better."),
    row$mechanism, when, short(row$error_ratio, if (row$error_ratio < 1.05) 3 else 2)))
}

# Of two that may be adopted, the one with the larger factor need not rank higher.
outranked_sentence <- function(row, best) {
  if (row$judged_by != "runs" || is_refuted(row) || row$log10_bf <= best$log10_bf) return(NULL)
  capital(sprintf(
    paste("%s has larger odds over no change. But if no model may respond to the conditions in an",
          "unknown way, %s explains the record better: odds of %s."),
    row$mechanism, best$mechanism, odds(best$standing - row$standing)))
}

refuted_sentence <- function(row) {
  factor <- if (row$trusted)
    sprintf(": if both models have such a response, its log10 Bayes factor is %s",
            signed(row$beside_unknown))
  capital(sprintf(
    paste("%s was not adopted, because an unknown response to what drives it explains the error",
          "better%s."),
    row$mechanism, factor %||% ""))
}

unjudged_sentence <- function(fit) {
  remedy <- if (is_given(model_of(fit))) "more runs where the posterior lies, or narrower priors"
            else "more runs, narrower priors or a shorter record"
  sprintf("No odds can be given for or against any mechanism: %s. What would change it: %s.",
          paste(fit$trust$why, collapse = "; "), remedy)
}

# Only where the size of the error itself says that something is missing, and not that the
# parameters were not found.
missing_sentence <- function(upgrade) {
  if (unjudged(upgrade)) return(NULL)
  left <- remaining_error(upgrade$models[[1]], upgrade$measurements)
  if (!left$large) return(NULL)
  sprintf(paste("The error is %s times the stated noise, so something is missing, or the noise is",
                "understated. This record does not show what is missing."), short(left$ratio))
}

probability_sentence <- function(trials) {
  rough <- trials$mechanism[!trials$trusted]
  all <- stats::setNames(c(trials$probability, max(0, 1 - sum(trials$probability))),
                         c(trials$mechanism, "no change"))
  all <- sort(all, decreasing = TRUE)
  near <- all[-1][all[-1] >= 0.01]
  tried <- if (nrow(trials) == 1) "the mechanism" else paste("the", nrow(trials), "mechanisms")
  then <- if (length(near)) paste0("; then ", listed(rival_words(utils::head(near, 3), rough)))
  sprintf("If %s and \"no change\" were equally likely beforehand, the most probable is now %s%s.",
          tried, rival_words(all[1], NULL), then %||% "")
}

candidate_row <- function(model, upgrade) {
  upgrade$candidates[upgrade$candidates$from == model$parent &
                       upgrade$candidates$mechanism == model$mechanism, ]
}

# Whether the numbers behind some trials can be trusted; if not, whose they are and why.
trust_sentence <- function(upgrade, rows) {
  base <- upgrade$models[[1]]$fit$trust
  rough <- rows[!rows$trusted, ]
  if (base$trusted && !nrow(rough)) {
    open <- open_trials(upgrade)
    return(paste0("These numbers can be trusted: they passed all checks.",
                  if (NROW(open))
                    sprintf(paste(" The numbers behind %s, which %s not adopted, are not trusted:",
                                  "see what to inspect next."),
                            listed(open$mechanism), if (NROW(open) > 1) "were" else "was")))
  }
  if (base$trusted && nrow(rows) == 1 && is_too_rough(rows)) return(NULL)
  who <- c(if (!base$trusted) with_reason("the base model", base$why),
           vapply(seq_len(nrow(rough)), function(k) {
             with_reason(rough$mechanism[k], untrusted_why(rough[k, ], upgrade))
           }, ""))
  sprintf(paste("Not trusted: %s. The decision may depend on these numbers: more runs or chains",
                "would settle it."), listed(who))
}

with_reason <- function(name, why)
  if (length(why)) sprintf("%s (%s)", name, paste(why, collapse = "; ")) else name

# Of a model that was adopted, as its fit says.
untrusted_why <- function(row, upgrade) {
  adopted <- Find(function(m) identical(m$mechanism, row$mechanism) &&
                    identical(m$parent, row$from), upgrade$models)
  if (!is.null(adopted)) adopted$fit$trust$why
  else if (row$judged_by == "trial") "it had few runs"
}

# How large the matter is, beside the noise and on data held out.
size_note <- function(upgrade) {
  m <- upgrade$measurements
  seen <- score_of(upgrade, "calibrate", "rmse")
  held <- score_of(upgrade, "validate", "rmse")
  told <- function(x) with_unit(short(x), m$unit)
  noise <- if (is_several(m)) "each record counts in units of its stated noise"
           else sprintf("the stated measurement noise is %s", told(m$noise_sd))
  if (length(seen) < 2) return(sprintf("The model's typical error is %s; %s.", told(seen), noise))
  change <- if (length(upgrade$models) > 2) "changes" else "change"
  if (!improves_held_out(upgrade)) {
    return(sprintf(paste("The %s not clearly improve predictions of data the model has not seen",
                         "(typical error %s before, %s after; %s). Take %s as a hint, not as a",
                         "repair."),
                   if (length(upgrade$models) > 2) "changes do" else "change does", told(held[1]),
                   told(held[2]), noise, if (length(upgrade$models) > 2) "them" else "it"))
  }
  if (anyNA(held))
    sprintf("With the %s the typical error %s; %s.", change, change_words(seen[1], seen[2], m$unit),
            noise)
  else sprintf("With the %s the typical error on data the model has not seen %s; %s.", change,
               change_words(held[1], held[2], m$unit), noise)
}

change_sentences <- function(upgrade) {
  adopted <- adopted_models(upgrade)
  if (!length(adopted)) return("Nothing: the base model stays as it is.")
  trials <- upgrade$candidates
  unlist(lapply(adopted, function(model) {
    row <- candidate_row(model, upgrade)
    entry <- upgrade$catalogue[[model$mechanism]]
    driven <- if (length(entry$boundary)) paste0(", driven by ", listed(entry$boundary)) else ""
    evidence <- if (is_sound(row, upgrade))
      sprintf("Evidence %s, odds of %s.", row$word, odds(row$log10_bf))
    c(paste(c(sprintf("%s (%s)%s: %s", model$mechanism, model$verdict, driven, entry$sentence),
              evidence), collapse = " "),
      description_sentence(entry, last_fit(upgrade)), step_sentence(upgrade, model),
      doubt_sentence(model), confounded_sentence(model))
  }))
}

# All that is reported of one mechanism.
mechanism_words <- function(model, upgrade) {
  row <- candidate_row(model, upgrade)
  entry <- upgrade$catalogue[[model$mechanism]]
  changes <- changes_table(upgrade)
  list(name = model$mechanism, verdict = model$verdict, drivers = entry$boundary,
       sentence = paste(c(entry$sentence, description_sentence(entry, last_fit(upgrade))),
                        collapse = " "), evidence = evidence_sentence(row, upgrade),
       brought = step_sentence(upgrade, model), against = doubt_sentence(model),
       also = c(rival_sentence(upgrade, model), confounded_sentence(model)),
       inspect = mechanism_inspections(upgrade, model),
       changes = changes[changes$mechanism == model$mechanism, ])
}

# What else could have been adopted at the same step.
rival_sentence <- function(upgrade, model) {
  trials <- upgrade$candidates[upgrade$candidates$from == model$parent, ]
  if (!is_sound(trials[trials$mechanism == model$mechanism, ], upgrade)) return(NULL)
  others <- trials[trials$mechanism != model$mechanism, ]
  kept <- stats::setNames(c(others$probability, max(0, 1 - sum(trials$probability))),
                          c(others$mechanism, "no change"))
  kept <- sort(kept[kept >= 0.01], decreasing = TRUE)
  rough <- others$mechanism[!is_sound(others, upgrade)]
  if (!length(kept)) return(paste("Neither another mechanism tried at this step nor \"no change\"",
                                  "keeps one per cent of the probability."))
  sprintf("At this step %s too: %s.",
          if (length(kept) > 1) "others are possible" else "another is possible",
          listed(rival_words(kept, rough)))
}

# What one step brought.
step_sentence <- function(upgrade, model) {
  parent <- Filter(function(m) m$name == model$parent, upgrade$models)[[1]]
  unit <- upgrade$measurements$unit
  told <- function(use)
    change_words(parent$scores[[use]][["rmse"]], model$scores[[use]][["rmse"]], unit)
  gain <- model$held_out_gain
  sprintf("With %s the typical error %s in calibration%s.", model$mechanism, told("calibrate"),
          if (is.na(gain$improves)) ""
          else sprintf("; on held-out data it %s, %s", told("validate"),
                       if (gain$mean > 0) gain_words(gain) else "no gain"))
}

gain_words <- function(gain) {
  if (gain$standard_error == 0) return("a gain")
  errors <- gain$mean / gain$standard_error
  if (errors < 1) return("no clear gain")
  sprintf("a gain of %s standard errors", short(errors))
}

doubt_sentence <- function(model) {
  if (length(model$doubts)) sprintf("Against %s: %s.", model$mechanism, listed(model$doubts))
}

confounded_sentence <- function(model) {
  if (length(model$confounded_with)) {
    sprintf("The estimate of %s is correlated with %s (by more than %s).", model$mechanism,
            listed(parameter_labels(model$fit, model$confounded_with)), short(rules$confounded))
  }
}

gain_sentences <- function(upgrade) {
  unit <- upgrade$measurements$unit
  seen <- score_of(upgrade, "calibrate", "rmse")
  held <- score_of(upgrade, "validate", "rmse")
  inside <- score_of(upgrade, if (anyNA(held)) "calibrate" else "validate", "coverage95")
  inside <- round(100 * inside[length(inside)])
  told <- function(v)
    if (length(v) < 2) paste("is", with_unit(short(v), unit)) else change_words(v[1], v[2], unit)
  c(paste0("The typical error (RMSE) ", told(seen), " in calibration",
           if (!anyNA(held)) paste0(", and ", told(held), " on held-out data"), "."),
    nearest_run_sentence(upgrade),
    if (anyNA(held)) paste("No data were held out, so it is not known how well the model predicts",
                           "what it has not seen."),
    sprintf("%d %% of the %s measurements lie in the band meant for 95 %%%s.", inside,
            if (anyNA(held)) "calibration" else "held-out",
            if (inside < 88) paste0(": ", narrow_words(upgrade))
            else if (inside == 100) ": the band is rather wide"
            else ""))
}

# Where the base model's discrepancy, and not its parameters, follows the record, other values of
# them come nearer.
nearest_run_sentence <- function(upgrade) {
  base <- upgrade$models[[1]]
  if (length(upgrade$models) < 2 || is_several(upgrade$measurements)) return(NULL)
  nearest <- min(vapply(list(base$fit$emulator, emulator_over_priors(base$fit$emulator)),
                        nearest_run, 0, base$fit))
  if (nearest > 0.9 * base$scores$calibrate[["rmse"]]) return(NULL)
  sprintf(paste("Part of this fall is not due to the change: one run of the base model has an",
                "error of only %s in calibration. The calibrated base model has a larger one,",
                "because the discrepancy takes up a part of it."),
          with_unit(short(nearest), upgrade$measurements$unit))
}

# The least RMSE in calibration among the runs that an emulator was trained on.
nearest_run <- function(emulator, fit) {
  runs <- tcrossprod(emulator$basis$vectors, emulator$processes$coefficients)
  sqrt(min(colMeans((runs - fit$measurements$y[fit$rows])^2)))
}

# What each of several records gains, in its own unit.
record_sentences <- function(upgrade) {
  vapply(names(upgrade$measurements$records), function(name) {
    paste0(name, ": ", gain_sentences(record_upgrade(upgrade, name))[1])
  }, "", USE.NAMES = FALSE)
}

# Too few measurements in the band: because the simulation lies to one side of them, or all round.
narrow_words <- function(upgrade) {
  p <- upgrade$models[[length(upgrade$models)]]$prediction
  p <- p[p$use == if (has_validation(upgrade)) "validate" else "calibrate", ]
  bias <- mean(p$observed - p$mean)
  several <- is_several(upgrade$measurements)
  if (several || abs(bias) < 0.5 * sqrt(mean((p$observed - p$mean)^2)))
    return("the band is too narrow")
  sprintf("the simulation is on average %s too %s there",
          with_unit(short(abs(bias)), upgrade$measurements$unit), if (bias > 0) "low" else "high")
}

remaining_sentences <- function(upgrade) {
  answers <- significant_conditions(last_attribution(upgrade))
  model <- upgrade$models[[length(upgrade$models)]]
  moved <- step_moved_words(model)
  last <- remaining_error(model, upgrade$measurements)
  c(if (length(answers)) sprintf("The remaining error responds to %s.", listed(answers))
    else "The remaining error responds to no boundary condition.",
    if (last$large) sprintf(
      "In calibration the remaining error is %s times the stated noise%s", short(last$ratio),
      if (is.null(last$pattern))
        paste0(": either the stated noise is too small, or something ",
               if (length(upgrade$models) > 1) "else ", "is missing",
               if (isFALSE(model$fit$check$passed)) ", or the parameters were not found", ".")
      else paste0("; ", last$pattern$what, ". ", last$pattern$where)),
    reach_sentence(model$fit) %||% if (last$large) bias_sentence(model$fit),
    if (!is.null(moved))
      sprintf("With finer steps of the simulator %s: %s biased by its steps.", moved,
              if (length(step_moved(model)) > 1) "these values are" else "this value is"),
    vapply(group_words(model$attribution), paste0, "", "."),
    mode_words(model$fit),
    failing_sentence(model$fit),
    edge_sentence(model$fit) %||% no_edge,
    sprintf("The loop stopped because %s%s.",
            upgrade$stopped_reason,
            if (upgrade$stopped_id == "steps") "; further causes were not looked for" else ""))
}
