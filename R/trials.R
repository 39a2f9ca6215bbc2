# The mechanisms of a catalogue tried as extensions of the present model: by the responses that they show, by a coarse
# calibration and, those that could lead, in full.

# Mechanisms driven by what the attribution names come first.
trial_order <- function(catalogue, attribution) {
  table <- attribution$table
  weight <- vapply(catalogue, function(m) {
    lost <- table$log10_bf_dropped[table$boundary %in% m$boundary & table$significant]
    if (length(lost)) max(lost) else 0
  }, 0)
  names(catalogue)[order(-weight)]
}

# Every mechanism as an extension of the current model: fits of those worth one, and the table of all Bayes factors.
try_mechanisms <- function(current, catalogue, settings, say) {
  trials <- lapply(catalogue, extended_model, model_of(current$fit), settings)
  settings$present <- joint_centre(record_fits(current$fit))
  if (is.null(settings$control$screening)) return(tried_in_full(current, trials, NULL, settings, say))
  responses <- staged("responses of the mechanisms", seen_responses(current, trials, settings))
  if (!is.null(responses)) say("  {sum(responses$runs)} runs show in which order mechanisms are tried")
  screens <- screened_mechanisms(current, trials, responses, settings, say)
  tried_in_full(current, trials, screens, settings, say, responses)
}

# Of several records the simulator of each in turn; what was adopted may act on some of them only.
extended_model <- function(mechanism, model, settings) {
  if (is.object(model)) return(extend(model, mechanism, settings$adopted, settings$record))
  extended <- Map(function(simulator, record) {
    extend(simulator, mechanism, intersect(settings$adopted, names(free_parameters(simulator))), record)
  }, model, names(model))
  check_one_prior(lapply(extended, free_parameters))
  extended
}

# Whether an edit can be made on top of what has been adopted. One that could be made on the base model, as it was tried
# there, may not be: then the loop goes on without it.
can_extend <- function(mechanism, model, settings) {
  if (!length(settings$adopted)) return(TRUE)
  tryCatch({
    extended_model(mechanism, model, settings)
    TRUE
  }, amiss_error_edit = function(e) {
    warn_result(c("Mechanism {.val {mechanism$name}} is left out: it cannot be applied on top of what was adopted.",
                  x = "{conditionMessage(e)}"), class = "amiss_warning_edit")
    FALSE
  })
}

trial_name <- function(current, mechanism) paste(current$name, "+", mechanism)

# Coarse calibrations (screen_model()), those first whose responses promise most: what lies far behind them is refined
# no further. A budget leaves out the last.
screened_mechanisms <- function(current, trials, responses, settings, say) {
  coarse <- as_coarse(current$fit)
  screens <- list()
  ordered <- if (is.null(responses)) names(trials) else names(trials)[order(-responses$log10_bf, na.last = FALSE)]
  turn <- turns("mechanism", length(ordered))
  for (name in ordered) {
    fits <- lapply(screens, `[[`, "fit")
    if (length(fits) && settings$spent()) break
    screens[[name]] <- staged(turn(name), naming_mechanism(name, screen_model(
      trials[[name]], trial_name(current, name), settings, hopeless(fits, coarse, settings$control))))
    report_candidate(name, coarse_factor(screens[[name]]$fit, current$fit), say)
  }
  screens
}

# list(fits, table, current) of the mechanisms, those that could lead calibrated in full. Where the leader falls back by
# its full calibration, others may come near: they are calibrated too, until what leads is known in full. What is to be
# adopted, or the present model if it stays, is settled, and must lead after that too.
tried_in_full <- function(current, trials, screens, settings, say, responses = NULL) {
  fits <- lapply(screens, `[[`, "fit")
  full <- list()
  settled <- character()
  repeat {
    left <- if (is.null(screens)) setdiff(names(trials), names(full))
            else contenders(fits, current$fit, names(full), settings$control)
    if (length(left)) {
      turn <- turns("mechanism in full", length(left))
      for (name in left) {
        full[[name]] <- staged(turn(name), naming_mechanism(name, fit_fully(
          trials[[name]], trial_name(current, name), settings, first = screens[[name]])))
        fits[[name]] <- full[[name]]$fit
        report_candidate(paste(name, "in full"), bayes_factor(fits[[name]], current$fit), say)
      }
      next
    }
    table <- trial_table(fits, current$fit, current$name, names(full), responses)
    best <- best_trial(table)
    if (may_be_adopted(best, current$fit, settings$control)) {
      name <- best$mechanism
      if (name %in% settled) break
      fits[[name]] <- staged(name, naming_mechanism(name, settled_fit(full[[name]], trial_name(current, name),
                                                                      settings)))
      settled <- c(settled, name)
    } else {
      if (is.null(current$full)) break
      current <- settled_model(current, settings)
    }
  }
  list(fits = fits, table = table, current = current)
}

naming_mechanism <- function(name, code) {
  rlang::try_fetch(code, amiss_error = function(e) {
    rlang::abort(paste0("Mechanism \"", name, "\" could not be tried."), parent = e,
                 class = setdiff(class(e), c("rlang_error", "error", "condition")), call = NULL)
  })
}

# What the mechanisms could explain (response_factors()), a row for each; NULL where runs are given and none can be
# made.
seen_responses <- function(current, trials, settings) {
  if (is_given(trials[[1]])) return(NULL)
  settings$keep(list("responses", current$name, lapply(trials, plain)),
                response_factors(current$fit, trials, settings$threads))
}

# Whether a candidate lies so far behind the best before it, or behind what adoption asks for, that no refinement is
# worth its runs: where runs have confirmed it, if it is no contender (uncertainty()); where its check still finds it
# too coarse, if `far` decades and three standard errors would not be enough.
hopeless <- function(fits, reference, control, far = 3) {
  needed <- max(reference$log_evidence + control$decisive * log(10), vapply(fits, `[[`, 0, "log_evidence"))
  function(fit) {
    above <- if (isTRUE(fit$check$passed)) uncertainty(fit, reference, control)
             else 3 * fit$standard_error / log(10) + far
    fit$check$ratio <= 1 && fit$log_evidence + above * log(10) < needed
  }
}

# Other mechanisms that could have been adopted in place of `model`, calibrated in full, with which the error on data
# held out is smaller by more than its own error.
held_out_rivals <- function(model, trials, settings) {
  table <- trials$table
  others <- table$mechanism[table$judged_by == "calibration" & table$mechanism != model$mechanism &
                              table$probability >= rival_probability & !raises_error(table)]
  Filter(function(name) {
    fit <- trials$fits[[name]]
    predicted <- settings$keep(list("rival", model$parent, name, plain(model_of(fit))), predicted_record(fit, settings))
    isTRUE(held_out_gain(model, c(list(fit = fit), predicted))$improves)
  }, others)
}

# A mechanism by which data held out gained nothing when it was adopted may gain beside those adopted after it: then
# `gain_beside_later` is the gain of the last model over the same without the mechanism, calibrated coarsely.
with_gains_beside_later <- function(models, catalogue, settings) {
  last <- models[[length(models)]]
  for (k in seq_along(models)[-c(1, length(models))]) {
    if (!isFALSE(held_out_gain(models[[k - 1]], models[[k]])$improves) || settings$spent()) next
    later <- vapply(models[-seq_len(k)], `[[`, "", "mechanism")
    without <- tryCatch(left_out(models[[k - 1]]$fit, models[[1]]$fit, catalogue[later], settings),
                        amiss_error = function(e) NULL)  # a loop that is done is not lost by this
    if (!is.null(without)) models[[k]]$gain_beside_later <- held_out_gain(without, last)
  }
  models
}

# The model of a fit with mechanisms that were adopted on top of another, as predicted_record() has it; NULL where runs
# are given or those made refute its emulator.
left_out <- function(fit, base, mechanisms, settings) {
  model <- model_of(fit)
  if (is_given(model)) return(NULL)
  own <- names(drawn_parameters(base))
  for (mechanism in mechanisms) {
    settings$adopted <- setdiff(unlist(lapply(in_list(model), function(s) names(free_parameters(s)))), own)
    model <- extended_model(mechanism, model, settings)
  }
  settings$present <- joint_centre(record_fits(fit))
  name <- paste("without, with", listed(names(mechanisms)))
  fit <- staged(name, screen_model(model, name, settings)$fit)
  if (isFALSE(fit$check$passed)) return(NULL)
  c(list(fit = fit), settings$keep(list("left out", name, plain(model)), predicted_record(fit, settings)))
}

report_candidate <- function(what, bf, say) {
  say(
    "  {what}: log10 Bayes factor {round(bf$log10_bf, 1)} [{round(bf$lower95, 1)}, {round(bf$upper95, 1)}], {bf$word}")
}
