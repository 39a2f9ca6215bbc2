# The loop: a state that is passed on from step to step. A step tries what is left of the catalogue
# on the present model, verifies what could win, and adopts the winner or says why there is none.

first_state <- function(started, catalogue, runs, context) {
  context$say("Calibrating the base model")
  base <- staged("base", base_model(started, runs, context))
  measured <- staged("base", measured_model(base, context))
  report_model(measured, context)
  list(present = base, models = list(measured), started = started, catalogue = catalogue,
       former = list(), candidates = NULL, responses = NULL, off = list(),
       base = names(base$parameters))
}

next_step <- function(state, context) {
  stopped <- reason_to_stop(state, context)
  left <- if (is.null(stopped)) mechanisms_left(state)
  if (is.null(stopped) && !length(left)) {
    stopped <- list(id = "none_applies",
                    words = "no mechanism that is left can be applied on top of what was adopted")
  }
  if (!is.null(stopped)) return(c(state, list(stopped = stopped)))
  attribution <- last_model(state$models)$attribution
  state$present <- as_present(state$present, state$catalogue[left], attribution, context)
  alone <- tried_alone(state, left, context)
  paired <- staged("pairs", try_pairs(state, alone, context))
  state <- paired$state
  present <- state$present
  trials <- c(alone, paired$trials)
  state$candidates <- rbind(state$candidates,
                            trial_table(trials, present, left, context$control$decisive))
  state$responses <- rbind(state$responses, response_table(trials, present, attribution))
  state$off <- utils::modifyList(state$off, Filter(Negate(is.null), lapply(trials, `[[`, "off")))
  best <- higher_of(to_adopt(alone, present, context),
                    to_adopt(paired$trials, present, paired$context))
  if (is.null(best)) {
    table <- trial_table(alone, present, left, context$control$decisive)
    return(c(state, list(stopped = no_winner(table, last_model(state$models), context))))
  }
  adopted <- trials[[best$mechanism]]
  evidence <- if (best$trusted) sprintf("log10 Bayes factor %.1f", best$log10_bf)
              else "its numbers are not trusted"
  context$say("Adopted {.strong {best$mechanism}}: {evidence}")
  measured <- measured_model(adopted, context)
  measured$may_replace <- staged(paste(best$mechanism, "without others"),
                                 may_replace(adopted, state, context))
  report_model(measured, context)
  state$former <- c(state$former, list(state$present))
  state$present <- adopted
  state$models <- c(state$models, list(measured))
  state
}

# All mechanisms that are left, each by itself: tried, raced, and what is to be adopted confirmed.
tried_alone <- function(state, left, context) {
  present <- state$present
  trials <- staged(paste("step", length(state$models)),
                   try_all(state, left, sparing(context, rules$trials_share, rules$least_trial)))
  trials <- race(present, trials, context)
  if (asks_again(state) && !has_cause(trials, present, context))
    trials <- second_look(present, trials, context)
  confirm_best(trials, present, context)
}

# Of two rows of the table of trials, each NULL if there is none, that of the higher standing.
higher_of <- function(a, b) if (is.null(a) || !is.null(b) && b$standing > a$standing) b else a

# Whether nothing was adopted yet, though so much of the error is left that mechanisms of the
# catalogue may be missed.
asks_again <- function(state) length(state$models) == 1 && leaves_much(state$present)

# Mechanisms that were not adopted and can be applied on top of what was.
mechanisms_left <- function(state) {
  left <- single_names_left(state)
  brought <- setdiff(names(state$present$parameters), state$base)
  left <- left[vapply(state$catalogue[left], applies, NA, brought)]
  left[vapply(state$catalogue[left], can_extend, NA, state, brought)]
}

single_names_left <- function(state) {
  adopted <- unlist(lapply(state$models, `[[`, "mechanism"))
  single <- Filter(is_single, unclass(state$catalogue))
  setdiff(names(single), unlist(lapply(state$catalogue[adopted], single_names)))
}

# list(id, words), or NULL.
reason_to_stop <- function(state, context) {
  stop_for <- function(id, words) list(id = id, words = words)
  control <- context$control
  if (!length(state$catalogue)) return(stop_for("empty", "the catalogue is empty"))
  if (!length(single_names_left(state))) {
    return(stop_for("all", "every mechanism of the catalogue has been adopted"))
  }
  if (is_spent(context)) return(stop_for("budget", budget_words(context)))
  if (length(state$models) > control$max_steps) {
    stop_for("steps", sprintf("the limit of %d step%s was reached", control$max_steps,
                              if (control$max_steps == 1) "" else "s"))
  }
}

budget_words <- function(context) {
  sprintf("the budget of %d runs of the simulator was spent",
          as.integer(context$control$runs_total))
}

# ---- a step backwards

# Mechanisms adopted before that the one adopted now may make needless. Its own trial, without them,
# may have ended at a poor mode. If that trial is not trusted, it is searched from the mode of both;
# if that comes nearer to the record than the earlier mechanism did, the earlier one is needless.
may_replace <- function(adopted, state, context) {
  presents <- c(state$former, list(state$present))
  needless <- vapply(seq_along(state$former), function(k) {
    own <- state$candidates[state$candidates$from == presents[[k]]$name &
                              state$candidates$mechanism == adopted$mechanism, ]
    if (!any(own$trusted %in% FALSE)) return(FALSE)
    alone <- error_alone(adopted, replace(state, "present", presents[k]), context)
    is.na(alone) || alone < left_over_noise(presents[[k + 1]])
  }, NA)
  vapply(presents[-1], `[[`, "", "mechanism")[needless]
}

# The error of the present model of `state` with the mechanism of `full`, at the best that a search
# from the mode of `full` finds; NA if there is no such model, or no run is left.
error_alone <- function(full, state, context) {
  simulators <- tryCatch(extended_simulators(state$catalogue[[full$mechanism]], state),
                         amiss_error_edit = function(e) NULL)
  if (is.null(simulators) || is_given(simulators)) return(NA_real_)
  model <- new_model(simulators, state$present$records)
  kept <- match(names(model$parameters), names(full$parameters))
  if (anyNA(kept)) return(NA_real_)
  made <- with_runs(model, full$runs$z[full$least$at, kept, drop = FALSE], context)
  if (!any(succeeded(made$model))) return(NA_real_)
  search <- begin_search(made$model, made$at, full$least$slopes[, kept, drop = FALSE],
                         rules$trial_stale, rules$trial_steps)
  search <- descend(search, context)
  left_over_noise(replace(search$model, "least", list(search["at"])))
}

# ---- trials

# Those first that the discrepancy speaks for. The first shows what the others must reach, which
# know nothing of one another. Of a budget each leaves to those after it what it does not need.
try_all <- function(state, left, context) {
  ordered <- trial_order(state$catalogue[left], last_model(state$models)$attribution)
  simulators <- lapply(state$catalogue[ordered], extended_simulators, state)
  turn <- turns("mechanism", length(ordered))
  try <- function(name, before, context) {
    bar <- bar_of(before, state$present, context)
    staged(turn(name), try_one(state, name, simulators[[name]], bar, context))
  }
  report <- function(trial) report_trial(trial, state$present, context)
  trials <- list()
  if (is.finite(context$budget)) {
    for (name in ordered) {
      if (is_spent(context)) break
      own <- at_most(context, points_of_turn(context, length(ordered) - length(trials)))
      trials[[name]] <- try(name, trials, own)
      report(trials[[name]])
    }
    return(trials)
  }
  trials[[ordered[1]]] <- try(ordered[1], list(), context)
  report(trials[[1]])
  first <- trials
  trials[ordered[-1]] <- side_by_side(ordered[-1], function(name, context) {
    try(name, first, context)
  }, report, context, simulators)
  trials
}

# Of a budget, those of the next of k trials: about twice an equal share, as what it does not need
# those after it have; but as many for each of them as a trial needs.
points_of_turn <- function(context, k) {
  left <- points_left(context)
  max(rules$least_trial, min(2 / (1 + k) * left, left - (k - 1) * rules$least_trial))
}

# A mechanism that cannot be computed is told as such, and the others go on.
try_one <- function(state, name, simulators, bar, context) {
  present <- state$present
  if (is_given(simulators)) {
    trial <- given_trial(present, name, simulators, context)
    return(with_taken(trial, present, context))
  }
  tryCatch(try_mechanism(present, name, simulators, state$off[[name]], bar, context),
           amiss_error_numerical = function(e) {
    failed <- new_model(simulators, present$records, paste(present$name, "+", name),
                        present$name, name)
    utils::modifyList(failed, list(level = "failed", reason = conditionMessage(e)))
  })
}

# Mechanisms driven by what the attribution names come first.
trial_order <- function(catalogue, attribution) {
  table <- attribution$table
  weight <- vapply(catalogue, function(m) {
    lost <- table$log10_bf_dropped[table$boundary %in% m$boundary & table$significant]
    if (length(lost)) max(lost) else 0
  }, 0)
  names(catalogue)[order(-weight)]
}

# An edit that could be made on the base model may not be possible on top of what was adopted: then
# the loop goes on without it.
can_extend <- function(mechanism, state, brought) {
  if (!length(brought)) return(TRUE)
  tryCatch({
    extended_simulators(mechanism, state)
    TRUE
  }, amiss_error_edit = function(e) {
    warn_result(c(paste("Mechanism {.val {mechanism$name}} is left out: it cannot be applied on",
                        "top of what was adopted."), x = "{conditionMessage(e)}"),
                class = "amiss_warning_edit")
    FALSE
  })
}

# ---- what is said on the way

report_model <- function(model, context) {
  fits <- record_fits(model$fit)
  for (k in seq_along(fits)) {
    warn_coarse_basis(fits[[k]]$emulator, "control$emulator$max_vectors",
                      paste(c(model$name, names(fits)[k]), collapse = ", "))
  }
  table <- told_by_model(model)$table
  first <- utils::head(table[table$significant, ], 1)
  error <- function(use) signif(model$scores[[use]][["rmse"]], 3)
  context$say(paste(
    "{.strong {model$name}}: RMSE {error('calibrate')} in calibration,",
    if (is.na(error("validate"))) "no data held out;" else "{error('validate')} held out;",
    "{runs_spent(context)} runs so far;",
    "discrepancy",
    if (nrow(first)) paste("responds most to {.field {first$boundary}}",
                           "(log10 Bayes factor {round(first$log10_bf_dropped, 1)})")
    else "shows no response to a boundary condition"))
}

# Why no mechanism was adopted: list(id, words).
no_winner <- function(table, present, context) {
  decisive <- context$control$decisive
  reason <- why_not(table, decisive, context)
  significant <- significant_conditions(told_by_model(present)$table)
  open <- if (!length(significant)) " and no boundary condition is significant"
          else paste0("; what responds to ", paste(significant, collapse = ", "),
                      " remains unexplained")
  list(id = reason$id, words = paste0(reason$words, open), reason = reason$words)
}

why_not <- function(table, decisive, context) {
  seen <- table[!is.na(table$log10_bf), ]
  if (is_spent(context) && is_open(table, decisive)) {
    return(list(id = "budget", words = paste0(budget_words(context), best_so_far(seen, decisive))))
  }
  if (!nrow(seen)) return(list(id = "none_computed", words = "no mechanism could be computed"))
  highest <- seen[which.max(seen$log10_bf), ]
  if (keeps_error(highest) && highest$log10_bf >= decisive) {
    return(list(id = "keeps_error", words = sprintf(
      "no mechanism with decisive evidence lowers the error by 1 %% (%s)",
      factor_words(highest))))
  }
  if (is_refuted(highest) && highest$log10_bf >= decisive) {
    return(list(id = "imitated",
                words = sprintf("no mechanism has enough evidence (%s%s)", factor_words(highest),
                                if (isFALSE(highest$trusted)) ""
                                else sprintf(paste(", but one of %.1f beside an unknown response",
                                                   "to what drives it"),
                                             highest$beside_unknown))))
  }
  best <- best_trial(table, decisive)
  if (!nrow(best) || highest$log10_bf < decisive) best <- highest
  found <- found_words(best, decisive)
  if (best$log10_bf < decisive) {
    list(id = "not_decisive", words = sprintf(
      "no mechanism has enough evidence (%s; %s%s or more and an interval above zero are needed)",
      found, if (isFALSE(best$trusted)) "a log10 Bayes factor of " else "", format(decisive)))
  } else {
    list(id = "uncertain",
         words = sprintf("the evidence for the best mechanism is too uncertain (%s)", found))
  }
}

# Whether more runs could make a mechanism decisive.
is_open <- function(table, decisive) {
  any(table$judged_by == "none") ||
    any(table$judged_by == "trial" & !is.na(table$log10_bf) & table$upper95 >= decisive)
}

best_so_far <- function(seen, decisive) {
  if (!nrow(seen)) return("")
  best <- seen[which.max(seen$log10_bf), ]
  sprintf(" (%s%s)", found_words(best, decisive),
          if (best$judged_by == "trial") ", not verified" else "")
}

factor_words <- function(row) {
  if (isFALSE(row$trusted)) sprintf("the numbers of %s are not trusted", row$mechanism)
  else sprintf("%s has a log10 Bayes factor of %.1f", row$mechanism, row$log10_bf)
}

# With as many digits as it takes to see that it is less than what is needed.
found_words <- function(row, decisive) {
  if (isFALSE(row$trusted))
    return(sprintf("best: %s, whose numbers are not trusted", row$mechanism))
  digits <- if (row$log10_bf < decisive && round(row$log10_bf, 1) >= decisive) 2 else 1
  sprintf("best: %s, log10 Bayes factor %.*f", row$mechanism, digits, row$log10_bf)
}
