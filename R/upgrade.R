upgrade_control <- list(max_steps = 3, decisive = 2, runs_total = NULL, refine = refining_control$refine,
                        rounds = refining_control$rounds, emulator = list(), calibration = list(),
                        attribution = list(), margin = 1.5, screening = refining_control$screening)

#' The loop: show, name the cause, extend, measure
#'
#' The model is calibrated and its discrepancy attributed; every mechanism of the catalogue is tried as a real
#' extension (simulated, trained, calibrated); the one of highest evidence is adopted if its Bayes factor is decisive;
#' and the loop begins again with the extended model. A mechanism with which the simulation's own error in calibration
#' rises (by more than 2 %) is not adopted, whatever its evidence: what it gains, the discrepancy gains. Held-out rows
#' only measure; they decide nothing.
#'
#' A few runs of every mechanism, its own parameters over their priors and the others where the posterior of the present
#' model lies, first show the responses that it adds: four, and two more for each further parameter. The evidence for
#' these responses, in amounts that are free, says in which order mechanisms are calibrated, and is all that is known of
#' those that a budget (`runs_total`) leaves no runs for: `candidates$judged_by` is `"response"` for them. It is no
#' verdict: where a simulator is far from linear, a mechanism may do elsewhere in the parameters' space what it does not
#' do there.
#'
#' Mechanisms are calibrated twice: first with a coarse sampler (`screening`) on runs that fill the space of the
#' parameters, two thirds of all, and compared with the present model calibrated in the same way; then in full, with the
#' other runs made where the coarse posterior lies ([refine_ensemble()]; none where the coarse calibration was refined
#' there already) and the emulator checked by runs of the simulator and refined ([calibrate_refined()]), those that
#' could come within `margin` both of the best and of being decisive: the coarse evidence is taken as uncertain by three
#' standard errors and, if `screening` asks for a second estimator, by what annealing lags behind it. Candidates that
#' stay behind keep their coarse Bayes factor; `candidates$judged_by` is `"screening"` for them, and `"calibration"` for
#' those calibrated in full.
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
#' @param runs Runs of the simulator for each model that is calibrated in full.
#' @param control List of options: `max_steps` (3), `refine` (share of the runs that is made where the posterior lies;
#'   1/3, 0 for none), `rounds` (of refinement where the check by runs asks for it; 8), `decisive` (log10 Bayes factor
#'   that a mechanism must earn, with its interval above zero; 2), `runs_total` (budget: once so many runs of the
#'   simulator have been made, no further mechanism is calibrated than those begun; `NULL`: none), lists `emulator`,
#'   `calibration` and `attribution` for the stages, `screening` (sampler of the first calibration of a mechanism, as
#'   `ais` in [calibrate()]; `NULL`: full calibrations only) and `margin` (1.5, in decades).
#' @param quiet No progress messages.
#' @param checkpoint A folder in which every finished model is kept, so that an interrupted loop, called again with the
#'   same arguments, goes on where it stopped; `NULL` keeps nothing. Delete it when the loop is done.
#' @inheritParams calibrate
#' @return An object of class `amiss_upgrade`: the models adopted (first the base model), all candidates tried (with
#'   the simulation's error in calibration with each over that before, `error_ratio`), the named cause, the gain, why
#'   the loop stopped, and how many runs of the simulator it took (`runs_total`). Each model that adopted a mechanism
#'   has a `verdict` of its own: `"named"`; `"likely"`, where something of its `doubts` speaks against it; or
#'   `"stand-in"`, where data held out do not gain by it (`held_out_gain`, with its standard error): then it takes the
#'   place of something else. `confounded_with` names parameters that are correlated beyond 0.4 with those that it
#'   brought: other parts of the model that could do the same. Of several records `fit` is what [calibrate_jointly()]
#'   gives, and `records` of a model has `prediction`, `scores` and `held_out_gain` of each in its own unit.
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
  check_object(catalogue, "amiss_catalogue", "catalogue")
  check_given_models(simulator, catalogue, measurements)
  control <- fill_upgrade_control(control, measurements)
  for (m in each_record(measurements)) check_runs_asked(runs, m, control$rounds, control$refine)
  if (!is_given(simulator)) {
    parameters <- unique(unlist(lapply(in_list(simulator), function(s) names(free_parameters(s)))))
    check_enough_runs(runs - round(control$refine * runs), length(parameters), of = runs)
  }
  seed <- pick_seed(seed)
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
      stopped <- sprintf("the limit of %d steps was reached", control$max_steps)
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
    say("Adopted {.strong {chosen}}: log10 Bayes factor {round(best$log10_bf, 1)}")
    current <- measured_model(trials$fits[[chosen]], paste(current$name, "+", chosen), current$name, chosen, settings)
    report_model(current, say)
    models <- c(models, list(current))
  }
  say("Stopped: {stopped}")
  if (length(models) == 1) models[[1]] <- settled_model(current, settings)
  models[[1]]$full <- NULL
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

measured_model <- function(fit, name, parent, mechanism, settings,
                           stage = "measured") settings$keep(list(stage, name, plain(model_of(fit))), {
  attribution <- attribute_discrepancy(fit, settings$control$attribution, seed = settings$seed,
                                       threads = settings$threads)
  c(list(name = name, parent = parent, mechanism = mechanism, fit = fit, attribution = attribution),
    predicted_record(fit, settings))
})

# list(prediction, scores), of several records in units of each one's noise, with `records`, the same of each as it is.
predicted_record <- function(fit, settings) {
  each <- lapply(record_fits(fit), function(one) {
    prediction <- stats::predict(one, use = predictable(one), seed = settings$seed, threads = settings$threads)
    list(prediction = prediction, scores = prediction_scores(prediction))
  })
  if (!inherits(fit, "amiss_joint")) return(each[[1]])
  scaled <- c("observed", "mean", "lower95", "upper95", "crps")
  in_noise <- Map(function(name, one) {
    noise_sd <- fit$records[[name]]$measurements$noise_sd
    data.frame(record = name, one$prediction[c("use", "segment")], one$prediction[scaled] / noise_sd)
  }, names(each), each)
  together <- do.call(rbind, unname(in_noise))
  list(prediction = together, scores = prediction_scores(together), records = each)
}

# A model that stays needs its parameters' intervals: settled_fit() of its calibration in full, `full`, if that is
# there.
settled_model <- function(model, settings) {
  if (is.null(model$full)) return(model)
  fit <- settled_fit(model$full, model$name, settings)
  full <- model$full
  model$full <- NULL
  if (identical(fit, full$fit)) return(model)
  staged(model$name, measured_model(fit, model$name, model$parent, model$mechanism, settings, "settled"))
}

report_model <- function(model, say) {
  fits <- record_fits(model$fit)
  for (k in seq_along(fits)) {
    warn_coarse_basis(fits[[k]]$emulator, "control$emulator$max_vectors", paste(c(model$name, names(fits)[k]),
                                                                                 collapse = ", "))
  }
  first <- model$attribution$table[1, ]
  say(paste("{.strong {model$name}}: RMSE {signif(model$scores$calibrate[['rmse']], 3)} in calibration,",
            "{signif(model$scores$validate[['rmse']], 3)} held out; discrepancy answers most to",
            "{.field {first$boundary}} (log10 Bayes factor {round(first$log10_bf_dropped, 1)})"))
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

# Every mechanism as an extension of the current model: fits of those worth one, and the table of all Bayes factors.
try_mechanisms <- function(current, catalogue, settings, say) {
  trials <- lapply(catalogue, extended_model, model_of(current$fit), settings)
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
    report_candidate(name, screens[[name]]$fit, coarse, say)
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
        report_candidate(paste(name, "in full"), fits[[name]], current$fit, say)
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

# The fit with the evidence of its coarse calibration, with which other coarse ones are compared.
as_coarse <- function(fit) {
  fit[names(fit$coarse)] <- fit$coarse
  fit
}

report_candidate <- function(what, fit, reference, say) {
  bf <- bayes_factor(fit, reference)
  say(
    "  {what}: log10 Bayes factor {round(bf$log10_bf, 1)} [{round(bf$lower95, 1)}, {round(bf$upper95, 1)}], {bf$word}")
}

# Bayes factors against the fit `current`: of the candidates calibrated in full (`full`) beside its full calibration, of
# the others beside its coarse one.
standing <- function(fits, current, full) {
  rows <- lapply(names(fits), function(name) {
    bayes_factor(fits[[name]], if (name %in% full) current else as_coarse(current))
  })
  do.call(rbind, rows)
}

# The simulation's own error in calibration over that of the fit `current`.
error_ratio <- function(fit, current) sqrt(mean(left_by_simulation(fit)^2) / mean(left_by_simulation(current)^2))

raises_error <- function(table) !is.na(table$error_ratio) & table$error_ratio > risen_error

# Candidates not calibrated in full whose evidence could come near the best that may be adopted, if any could come near
# adoption.
contenders <- function(fits, current, full, control) {
  if (!length(fits)) return(character())
  bf <- standing(fits, current, full)
  reach <- bf$log10_bf + vapply(fits, uncertainty, 0, as_coarse(current), control)
  barred <- vapply(names(fits), function(name) name %in% full && error_ratio(fits[[name]], current) > risen_error, NA)
  setdiff(names(fits)[reach >= max(bf$log10_bf[!barred], control$decisive)], full)
}

# By how many decades the coarse evidence of a fit, beside that of a reference, may lie too low: three standard errors,
# the nats that annealing lies behind the second estimator (where chains lag, a mode may be missed), and the margin, of
# which a third is enough where runs of the simulator have confirmed the fit.
uncertainty <- function(fit, reference, control) {
  lag <- max(0, fit$posterior$second[[1]] - fit$posterior$annealed[[1]], na.rm = TRUE)
  margin <- if (isTRUE(fit$check$passed)) control$margin / 3 else control$margin
  (3 * sqrt(fit$standard_error^2 + reference$standard_error^2) + lag) / log(10) + margin
}

# Bayes factors of all mechanisms against the current model: in full, by the coarse calibration, or by the responses
# alone.
trial_table <- function(fits, current, from, full, responses = NULL) {
  rows <- lapply(names(fits), function(name) {
    row <- data.frame(from = from, mechanism = name, standing(fits[name], current, full),
                      error_ratio = error_ratio(fits[[name]], current), trusted = fits[[name]]$trust$trusted,
                      judged_by = if (name %in% full) "calibration" else "screening")
    if (!name %in% full) row <- as_far_as_emulated(row, fits[[name]]$check, stats::nobs(current))
    row$parameters <- list(added_parameters(fits[[name]], current))
    row
  })
  by_response <- responses[!rownames(responses) %in% names(fits), ]
  if (NROW(by_response)) {
    seen <- data.frame(from = from, mechanism = rownames(by_response),
                       by_response[names(by_response) != "runs"], error_ratio = NA_real_, trusted = FALSE,
                       judged_by = "response", row.names = NULL)
    seen$parameters <- rep(list(added_parameters(current, current)), nrow(seen))
    rows <- c(rows, list(seen))
  }
  table <- do.call(rbind, rows)
  table$screened <- table$judged_by != "calibration"
  # Equal prior probability for no change and for each mechanism.
  log_odds <- c(0, table$log10_bf) * log(10)
  probability <- exp(log_odds - max(log_odds)) / sum(exp(log_odds - max(log_odds)))
  table$probability <- probability[-1]
  table
}

# The interval of a candidate whose emulator runs refute holds the error e that they saw, in units of the noise: over N
# rows it takes N e^2 / 2 nats from the log-likelihood of what the emulator says, and moves it by sqrt(N) e at random.
as_far_as_emulated <- function(row, check, rows) {
  if (!isFALSE(check$passed)) return(row)
  error <- check$ratio
  row$upper95 <- row$upper95 + (0.5 * rows * error^2 + 1.96 * sqrt(rows) * error) / log(10)
  row$lower95 <- row$lower95 - 1.96 * sqrt(rows) * error / log(10)
  row$word <- evidence_word(row$lower95, row$upper95)
  row
}

# Estimates of the parameters that a mechanism brought with it.
added_parameters <- function(fit, parent) {
  table <- parameter_table(fit)
  table[!table$name %in% names(drawn_parameters(parent)), ]
}

# The row of highest evidence among the mechanisms that may be adopted: they were calibrated (responses alone decide
# nothing), and the simulation's own error does not rise with them. No row if there is none.
best_trial <- function(table) {
  open <- table[table$judged_by != "response" & !raises_error(table), ]
  open[which.max(open$log10_bf), ]
}

# Whether the evidence is decisive or, where that of the present model is not known, as runs refute its emulator to the
# end, runs of the simulator are: the error falls by a third, with numbers that can be trusted.
may_be_adopted <- function(best, current, control) {
  if (!nrow(best) || best$log10_bf < control$decisive) return(FALSE)
  best$lower95 > 0 || (isFALSE(current$check$passed) && best$trusted && isTRUE(best$error_ratio < fallen_error))
}

stop_reason <- function(table, attribution, decisive) {
  significant <- significant_conditions(attribution$table)
  best <- best_trial(table)
  highest <- table[which.max(table$log10_bf), ]
  if (!nrow(best)) best <- highest
  found <- sprintf("best: %s, log10 Bayes factor %.1f", best$mechanism, best$log10_bf)
  why <- if (raises_error(highest) && highest$log10_bf >= decisive) {
    sprintf("no mechanism lowers the error decisively (%s has a log10 Bayes factor of %.1f, but raises it)",
            highest$mechanism, highest$log10_bf)
  } else if (best$log10_bf < decisive) {
    sprintf("no mechanism is decisive (%s; %s or more and an interval above zero are needed)", found, format(decisive))
  } else {
    sprintf("the evidence for the best mechanism is too uncertain (%s, interval from %.1f to %.1f)", found,
            best$lower95, best$upper95)
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
