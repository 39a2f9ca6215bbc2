upgrade_control <- list(max_steps = 3, decisive = 2, runs_total = NULL, refine = refining_control$refine,
                        rounds = refining_control$rounds, emulator = list(), calibration = list(),
                        attribution = list(), margin = 1.5, screening = refining_control$screening)

#' The loop: show, name the cause, extend, measure
#'
#' The model is calibrated and its discrepancy attributed; every mechanism of the catalogue is tried as a real extension
#' (simulated, trained, calibrated); the one of highest evidence is adopted if its log10 Bayes factor is at least
#' `decisive` (2) with its interval above zero (the word *decisive* asks for an interval above 2); and the loop begins
#' again with the extended model. A mechanism with which the simulation's own error in calibration rises (by more than 2
#' %) is not adopted, whatever its evidence: what it gains, the discrepancy gains. Held-out rows decide nothing of what
#' is adopted; whether it is called named, likely or a stand-in hangs on them too.
#'
#' A few runs of every mechanism, its own parameters over their priors and the others where the posterior of the present
#' model lies, first show the responses that it adds: four, and two more for each further parameter. The evidence for
#' these responses, in amounts that are free, says in which order mechanisms are calibrated, and is all that is known of
#' those that a budget (`runs_total`) leaves no runs for: `candidates$judged_by` is `"response"` for them. It is no
#' verdict: where a simulator is far from linear, a mechanism may do elsewhere in the parameters' space what it does not
#' do there.
#'
#' Each mechanism is first calibrated coarsely (`screening`), on two thirds of the runs, and compared with the present
#' model calibrated in the same way. Those that could still win are then calibrated in full, with the other runs made
#' where the coarse posterior lies ([refine_ensemble()]), checked by runs of the simulator and refined
#' ([calibrate_refined()]): those whose coarse number lies below the best, and below `decisive`, by no more than
#' `margin` (a third of it where runs have confirmed it), three standard errors and what annealing lags behind its
#' second estimator. The others keep their coarse number: `candidates$judged_by` is `"screening"` for them, and
#' `"calibration"` for those calibrated in full. What is to be adopted, or the present model if it stays, is refined
#' further, until the intervals of its parameters hold, and must lead after that too. Where the present model's evidence
#' is not known, as runs refute its emulator to the end, an interval that reaches below zero is enough if the numbers
#' are trusted and the simulation's error falls by a third; what is adopted so is likely at most.
#'
#' *Given runs.* The base model may be an [ensemble()] of runs that were made elsewhere, and mechanisms others: see
#' [mechanism()]. Then nothing is run: `runs` and refinement do not count, the emulators are checked by runs left out,
#' and held-out rows are predicted by emulators of the runs given there.
#'
#' *Several records.* Two or more series that share parameters ([calibrate_jointly()]) go through the same loop: give
#' named lists of simulators and measurements. The `edit` of a mechanism is applied to the simulator of each record in
#' turn; one of two arguments gets the record's name as the second, so that it may act on some of them only
#' ([mechanism()]). Every model is calibrated on all records, and what is compared is the evidence of all. Scores, the
#' error in calibration and the gain held out are those of all records together, each in units of its noise; a
#' mechanism with which the error of one record rises is likely at most. Runs count for each record.
#'
#' @param simulator The base model: a simulator, or an [ensemble()] of given runs; of several records a named list.
#' @param measurements The [measurements()]; of several records a list with the same names.
#' @param catalogue A [catalogue()] of mechanisms.
#' @param runs Runs with which each model begins: two thirds of them fill the space of its parameters (`refine`; give
#'   ten for each, below five a warning says so), the others lie where the posterior does. Searches, rounds of
#'   refinement and checks come on top: with eight mechanisms two to ten thousand runs in all are usual, and fewer first
#'   runs cost more in the end. The budget is `control$runs_total`; a base model that is hard to emulate may spend all
#'   of it.
#' @param control List of options: `max_steps` (3), `refine` (share of the runs that is made where the posterior lies;
#'   1/3, 0 for none), `rounds` (of refinement of a model where the check by runs asks for it; 8), `decisive` (log10
#'   Bayes factor that a mechanism must earn, with its interval above zero; 2), `runs_total` (budget: once so many runs
#'   of the simulator have been made, no further mechanism is calibrated than those begun; `NULL`: none), lists
#'   `emulator`, `calibration` and `attribution` for the stages, `screening` (sampler of the first calibration of a
#'   mechanism, as `ais` in [calibrate()]; `NULL`: full calibrations only) and `margin` (1.5, in decades).
#' @param quiet No progress messages.
#' @param checkpoint A folder in which every finished model is kept (and the seed, if none is given), so that an
#'   interrupted loop, called again with the same arguments, goes on where it stopped; `NULL` keeps nothing. Delete it
#'   when the loop is done.
#' @inheritParams calibrate
#' @return An object of class `amiss_upgrade`: the `models` adopted (first the base model), all `candidates` tried (a
#'   row each: the model that it extends, `from`, the `mechanism`, `log10_bf` with `lower95` and `upper95` and its
#'   `word`, its `probability`, the simulation's error in calibration over that before, `error_ratio`, `trusted`,
#'   `judged_by`, and the estimates of its `parameters`), the `named_cause`, the `gain`, why the loop stopped
#'   (`stopped_because`) and how many runs of the simulator it took (`runs_total`). Each model that adopted a mechanism
#'   has a `verdict` of its own: `"named"`; `"likely"`, where something of its `doubts` speaks against it; or
#'   `"stand-in"`, where data held out do not gain by it (`held_out_gain`, with its standard error), nor beside what was
#'   adopted later (`gain_beside_later`): then it takes the place of something else.
#'   `steps` has, of each record, what shorter steps of the simulator change: the RMS (`error`, in the target's unit) of
#'   what the parameters cannot take up, and by how many of its standard deviations each would move (`moved`); `NULL`
#'   where that is not known ([function_simulator()]). `held_out_rivals` names mechanisms that could have been adopted
#'   in its place and with which data held out are met better. `confounded_with` names parameters that are correlated
#'   beyond 0.4 with those that it brought: other parts of the model that could do the same. Of several records `fit` is
#'   what [calibrate_jointly()] gives, and `records` of a model has `prediction`, `scores` and `held_out_gain` of each
#'   in its own unit.
#' @source Monari (2022) for the loop; how a mechanism is judged is the package's own: `vignette("algorithm", "amiss")`,
#'   *Naming*.
#' @examples
#' \donttest{
#' table <- data.frame(hour = 1:120, Te = 5 + 3 * sin(1:120 / 4), Gv = pmax(0, 100 * cos(1:120 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.02 * table$Gv + 0.1 * sin(61 * (1:120)^2)
#' house <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                       validate = table$hour > 90)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' brighter <- function(values, drivers, base) base(values) + values[["sun"]] * drivers[, "Gv"]
#' sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters that the model leaves out.",
#'                  edit = function(model) {
#'   with_parameters(model, free("sun", uniform(0, 0.1), "K m2/W"), boundary = "Gv", f = brighter)
#' })
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)),
#'               attribution = list(surrogates = 19))
#' upgrade_model(linear, house, catalogue(sun), runs = 30, control = quick, seed = 1, quiet = TRUE)
#'
#' # The same of runs that were made elsewhere, over all rows.
#' design <- cbind(gain = lhs::randomLHS(40, 1)[, 1], sun = 0.1 * lhs::randomLHS(40, 1)[, 1])
#' runs <- 20 + tcrossprod(table$Te, design[, "gain"])
#' sunny <- runs + tcrossprod(table$Gv, design[, "sun"])
#' parameters <- list(free("gain", uniform(0, 1)), free("sun", uniform(0, 0.1)))
#' given <- ensemble(design[, "gain", drop = FALSE], runs, parameters[1], measurements = house)
#' with_sun <- ensemble(design, sunny, parameters, measurements = house)
#' other <- mechanism("sun", with_sun, "Gv", "Sun enters.")
#' upgrade_model(given, house, catalogue(other), control = quick, seed = 1, quiet = TRUE)
#' }
#' @export
upgrade_model <- function(simulator, measurements, catalogue, runs = 150, control = NULL, seed = NULL, threads = 1,
                          quiet = FALSE,
                          checkpoint = NULL) {
  started <- upgrade_start(simulator, measurements)
  simulator <- started$simulator
  measurements <- started$measurements
  for (m in each_record(measurements)) check_target_varies(m, used_rows(m, "calibrate"))
  check_object(catalogue, "amiss_catalogue", "catalogue", "Make it with {.fun catalogue}.")
  check_given_models(simulator, catalogue, measurements)
  control <- fill_upgrade_control(control, measurements)
  for (m in each_record(measurements)) check_runs_asked(runs, m, control$rounds, control$refine)
  if (!is_given(simulator)) {
    parameters <- unique(unlist(lapply(in_list(simulator), function(s) names(free_parameters(s)))))
    first <- runs - round(control$refine * runs)
    check_enough_runs(first, length(parameters), of = runs)
    warn_few_runs(first, length(parameters))
  }
  seed <- kept_seed(seed, checkpoint)
  threads <- check_threads(threads)
  say <- progress(quiet)
  settings <- list(calibrate = calibrate, measurements = measurements, runs = runs, control = control, seed = seed,
                   threads = threads)
  before <- runs_so_far()
  settings$record <- started$record
  settings$spent <- function() !is.null(control$runs_total) && runs_so_far() - before >= control$runs_total
  settings$keep <- checkpoint_keeper(checkpoint, settings[c("measurements", "runs", "control", "seed")])
  warn_absent_drivers(catalogue, measurements)
  say("Calibrating the base model")
  current <- staged("base", {
    full <- fit_fully(simulator, "base", settings)
    c(measured_model(full$fit, "base", NULL, NULL, settings), full = list(full))
  })
  report_model(current, say)
  models <- list(current)
  candidates <- NULL
  repeat {
    left <- setdiff(names(catalogue), unlist(lapply(models, `[[`, "mechanism")))
    if (!length(left)) {
      stopped <- if (length(catalogue)) "every mechanism of the catalogue has been adopted"
                 else "the catalogue is empty"
      break
    }
    settings$adopted <- setdiff(names(drawn_parameters(current$fit)), names(drawn_parameters(models[[1]]$fit)))
    left <- left[vapply(catalogue[left], applies, NA, settings$adopted)]
    if (!length(left)) {
      stopped <- "no runs that are left hold what has been adopted"
      break
    }
    if (settings$spent()) {
      stopped <- sprintf("the budget of %d runs of the simulator was spent", control$runs_total)
      break
    }
    if (length(models) > control$max_steps) {
      stopped <- sprintf("the limit of %d step%s was reached", control$max_steps,
                         if (control$max_steps == 1) "" else "s")
      break
    }
    left <- left[vapply(catalogue[left], can_extend, NA, model_of(current$fit), settings)]
    if (!length(left)) {
      stopped <- "no mechanism that is left can be applied on top of what has been adopted"
      break
    }
    ordered <- trial_order(catalogue[left], current$attribution)
    trials <- staged(paste("step", length(models)), try_mechanisms(current, catalogue[ordered], settings, say))
    candidates <- rbind(candidates, trials$table)
    current <- models[[length(models)]] <- trials$current
    best <- best_trial(trials$table)
    if (!may_be_adopted(best, current$fit, control)) {
      stopped <- stop_reason(trials$table, current$attribution, control$decisive)
      break
    }
    chosen <- best$mechanism
    say("Adopted {.strong {chosen}}: {adoption_words(best)}")
    current <- measured_model(trials$fits[[chosen]], paste(current$name, "+", chosen), current$name, chosen, settings)
    current$held_out_rivals <- held_out_rivals(current, trials, settings)
    report_model(current, say)
    models <- c(models, list(current))
  }
  say("Stopped: {stopped}")
  if (length(models) == 1) models[[1]] <- settled_model(current, settings)
  models[[1]]$full <- NULL
  models <- with_gains_beside_later(models, catalogue, settings)
  models <- judge_models(models, candidates, catalogue, measurements, control, threads)
  structure(list(format_version = format_version, models = models, candidates = candidates, catalogue = catalogue,
                 named_cause = named_cause(models, candidates, catalogue), gain = upgrade_gain(models),
                 stopped_because = stopped,
                 runs_total = runs_so_far() - before,
                 measurements = measurements, seed = seed, control = control), class = "amiss_upgrade")
}

# list(simulator, measurements, record): of one record as they are, with its name; of several a list of simulators and
# their measurements together (new_records()).
upgrade_start <- function(simulator, measurements, call = rlang::caller_env()) {
  check_model <- function(x) if (!inherits(x, "amiss_ensemble")) check_simulator(x, call)
  if (!rlang::is_bare_list(simulator) && !rlang::is_bare_list(measurements)) {
    check_model(simulator)
    check_object(measurements, "amiss_measurements", "measurements", call = call)
    return(list(simulator = simulator, measurements = measurements, record = measurements$name))
  }
  for (name in c("simulator", "measurements")) {
    check_input(if (rlang::is_bare_list(get(name))) TRUE else "it is no list", name,
                "Of several records give named lists of both, one element for each record.", call = call)
  }
  check_records(simulator, measurements, "simulator", check_model, least = 1, call = call)
  names <- names(simulator)
  if (length(names) == 1) {
    return(list(simulator = simulator[[1]], measurements = measurements[[1]], record = names))
  }
  given <- vapply(simulator, inherits, NA, "amiss_ensemble")
  if (any(given) && !all(given)) {
    abort_input(c("Of the records {.val {names[given]}} runs are given, of {.val {names[!given]}} simulators.",
                  i = "Give simulators of all records, or an {.fun ensemble} of each."), call = call)
  }
  check_one_prior(lapply(simulator, free_parameters), call)
  list(simulator = simulator, measurements = new_records(measurements[names]), record = names)
}

# Ensembles among the models, base and mechanisms, stand at the rows of their record.
check_given_models <- function(simulator, catalogue, measurements, call = rlang::caller_env()) {
  edits <- Filter(function(edit) inherits(edit, "amiss_ensemble"), lapply(catalogue, `[[`, "edit"))
  if (!is_several(measurements)) {
    return(check_given(c(if (is_given(simulator)) list(base = simulator), edits), measurements, call))
  }
  if (length(edits)) {
    abort_input(c("The mechanism {.val {names(edits)}} is one set of runs, and there are several records.",
                  i = "Let its {.code edit} be a function of the model and the record's name that returns the runs."),
                call = call)
  }
  for (name in names(simulator)) check_given(simulator[name], measurements$records[[name]], call)
}

fill_upgrade_control <- function(control, measurements, call = rlang::caller_env()) {
  control <- merge_control(upgrade_control, control, call = call)
  check_input(checkmate::check_count(control$max_steps), "control$max_steps", call = call)
  check_input(checkmate::check_number(control$decisive, lower = 0, finite = TRUE), "control$decisive", call = call)
  check_input(checkmate::check_number(control$refine, lower = 0, upper = 0.8), "control$refine", call = call)
  check_input(checkmate::check_count(control$rounds), "control$rounds", call = call)
  check_input(checkmate::check_count(control$runs_total, positive = TRUE, null.ok = TRUE), "control$runs_total",
              call = call)
  check_input(checkmate::check_number(control$margin, lower = 0, finite = TRUE), "control$margin", call = call)
  if (!is.null(control$screening)) fill_ais_control(control$screening, "control$screening", call)
  check_stage_controls(control, measurements, call = call)
  control
}

report_model <- function(model, say) {
  fits <- record_fits(model$fit)
  for (k in seq_along(fits)) {
    warn_coarse_basis(fits[[k]]$emulator, "control$emulator$max_vectors", paste(c(model$name, names(fits)[k]),
                                                                                 collapse = ", "))
  }
  first <- utils::head(model$attribution$table[model$attribution$table$significant, ], 1)
  say(paste("{.strong {model$name}}: RMSE {signif(model$scores$calibrate[['rmse']], 3)} in calibration,",
            "{signif(model$scores$validate[['rmse']], 3)} held out; discrepancy",
            if (nrow(first)) paste("answers most to {.field {first$boundary}}",
                                   "(log10 Bayes factor {round(first$log10_bf_dropped, 1)})")
            else "shows no response to a boundary condition"))
}

adoption_words <- function(row) {
  found <- sprintf("log10 Bayes factor %.1f", row$log10_bf)
  if (row$lower95 > 0) return(found)
  sprintf("%s [%.1f, %.1f] is too uncertain, but the error falls to %s of what it was", found, row$lower95, row$upper95,
          percent(row$error_ratio))
}

stop_reason <- function(table, attribution, decisive) {
  significant <- significant_conditions(attribution$table)
  best <- best_trial(table)
  highest <- table[which.max(table$log10_bf), ]
  if (!nrow(best) || highest$log10_bf < decisive) best <- highest
  # As many digits as it takes to see that it is less than what is needed.
  digits <- if (best$log10_bf < decisive && round(best$log10_bf, 1) >= decisive) 2 else 1
  found <- sprintf("best: %s, log10 Bayes factor %.*f%s", best$mechanism, digits, best$log10_bf,
                   if (raises_error(best)) ", though the error rises with it" else "")
  why <- if (raises_error(highest) && highest$log10_bf >= decisive) {
    sprintf("no mechanism lowers the error decisively (%s has a log10 Bayes factor of %.1f, but raises it)",
            highest$mechanism, highest$log10_bf)
  } else if (best$log10_bf < decisive) {
    sprintf("no mechanism is decisive (%s; %s or more and an interval above zero are needed)", found, format(decisive))
  } else {
    sprintf("the evidence for the best mechanism is too uncertain (%s)",
            if (best$upper95 - best$lower95 > too_rough) paste0("best: ", best$mechanism)
            else sprintf("%s, interval from %.1f to %.1f", found, best$lower95, best$upper95))
  }
  if (length(significant)) paste0(why, "; what answers to ", paste(significant, collapse = ", "),
                                  " remains unexplained") else paste0(why, " and no boundary condition is significant")
}

# The first mechanism that is named or, if none is, likely; a stand-in is no cause, nor is a description.
named_cause <- function(models, candidates, catalogue) {
  adopted <- Filter(function(model) !describes(catalogue[[model$mechanism]]), models[-1])
  verdicts <- vapply(adopted, `[[`, "", "verdict")
  first <- which(verdicts == if (any(verdicts == "named")) "named" else "likely")
  if (!length(first)) return(NULL)
  model <- adopted[[first[1]]]
  trial <- candidates[candidates$from == model$parent & candidates$mechanism == model$mechanism, ]
  entry <- catalogue[[model$mechanism]]
  list(mechanism = model$mechanism, boundary = entry$boundary, log10_bf = trial$log10_bf, sentence = entry$sentence)
}

upgrade_gain <- function(models) {
  before <- models[[1]]
  after <- models[[length(models)]]
  bf <- bayes_factor(after$fit, before$fit)
  both <- function(use, score) c(before$scores[[use]][[score]], after$scores[[use]][[score]])
  list(log10_bf = bf$log10_bf, interval = c(bf$lower95, bf$upper95), rmse_calibration = both("calibrate", "rmse"),
       rmse_validation = both("validate", "rmse"), coverage95_validation = both("validate", "coverage95"),
       crps_calibration = both("calibrate", "crps"), crps_validation = both("validate", "crps"))
}

adopted_models <- function(upgrade) upgrade$models[-1]

# Where runs of the simulator refute the emulator of the model from which all others start, evidence compares
# emulators, not simulators.
unjudged <- function(upgrade) isFALSE(upgrade$models[[1]]$fit$check$passed)

# Mechanisms not adopted whose last trial is a coarse calibration that runs refute, of which the interval reaches beyond
# what was adopted at its step, or beyond what adoption asks for. Where nothing is left to explain, none.
open_trials <- function(upgrade) {
  if (is.null(upgrade$candidates)) return(NULL)
  adopted <- vapply(adopted_models(upgrade), `[[`, "", "mechanism")
  trials <- upgrade$candidates
  needed <- vapply(trials$from, function(from) {
    max(upgrade$control$decisive, trials$log10_bf[trials$from == from & trials$mechanism %in% adopted])
  }, 0)
  last <- upgrade$models[[length(upgrade$models)]]
  explained <- !remaining_error(last, upgrade$measurements)$large && !any(last$attribution$table$significant)
  open <- trials$judged_by == "screening" & !trials$trusted & trials$upper95 >= needed &
    !(explained & trials$from == last$name)
  trials[open & !trials$mechanism %in% adopted & !duplicated(trials$mechanism, fromLast = TRUE), ]
}
