# One model taken down the line: its runs, its emulator, its calibration, coarse at first and then in full.

# How runs are spent where a model is calibrated twice.
refining_control <- list(refine = 1 / 3, rounds = 8,
                         screening = list(pilot_chains = 128, groups = 4, max_groups = 16, max_sweeps = 12,
                                          precision = 0.5, gradient = FALSE, importance_draws = 0))

screening_runs <- 20  # that check a coarse calibration

# The options of the stages, as these will take them.
check_stage_controls <- function(control, measurements, method = "history", call = rlang::caller_env()) {
  fill_emulator_control(control$emulator, "control$emulator", call)
  n <- length(used_rows(measurements, "calibrate"))
  if (method == "paper") return(fill_paper_control(control$calibration, n, "control$calibration", call))
  calibration <- fill_calibration_control(control$calibration, measurements, n, "control$calibration", call)
  fill_attribution_control(control$attribution, calibration$ais, length(measurements$conditions), "control$attribution",
                           call)
}

first_runs <- function(simulator, runs, settings) {
  if (inherits(simulator, "amiss_ensemble")) return(simulator)
  simulate_design(simulator, settings$measurements, runs, seed = settings$seed, threads = settings$threads)
}

# A model simulated, trained and calibrated by `settings$calibrate`. Every model of a study is drawn on the same design
# seed: differences between models are not the design's.
fit_model <- function(simulator, name, settings) {
  settings$keep(list("fit", name, plain(simulator)), fit_runs(first_runs(simulator, settings$runs, settings), settings))
}

# By calibrate() with refinements where its check by runs fails; calibrate_paper() has none. Of a coarse basis tells
# who asks for the model.
fit_runs <- function(ensemble, settings, calibration = settings$control$calibration,
                     rounds = settings$control$rounds) without_basis_warnings({
  if (identical(settings$calibrate, calibrate)) {
    more <- refined_runs(settings)
    calibrate_refined(ensemble, settings$measurements, rounds %||% refining_control$rounds,
                      regional_runs(ensemble$parameters, more),
                      list(emulator = as.list(settings$control$emulator), calibration = as.list(calibration)),
                      seed = settings$seed, threads = settings$threads)
  } else {
    emulator <- train_emulator(ensemble, settings$measurements, settings$control$emulator,
                               threads = settings$threads)
    settings$calibrate(emulator, settings$measurements, calibration, seed = settings$seed, threads = settings$threads)
  }
})

# The coarse calibration of a model, on the runs that fill its parameters' space; it keeps them. A few runs at posterior
# draws tell how far its evidence is off, correct it, and join them where it is too far. It is for the evidence: tails
# that lie at the end of the region, where parameters' intervals need more runs, it leaves to fit_fully().
screen_model <- function(simulator, name, settings, hopeless = function(fit) FALSE) {
  calibration <- as.list(settings$control$calibration)
  calibration$ais <- utils::modifyList(as.list(calibration$ais),
                                       as.list(settings$control$screening %||% refining_control$screening))
  if (is.null(calibration$check) || calibration$check > screening_runs)
    calibration$check <- calibration$exact <- screening_runs
  settings$keep(list("coarse", name, plain(simulator)), {
    ensemble <- first_runs(simulator, settings$runs - refined_runs(settings), settings)
    control <- list(emulator = settings$control$emulator, calibration = calibration)
    refine_until_checked(ensemble, settings$measurements, settings$control$rounds, control, settings$seed,
                         settings$threads,
                         runs = regional_runs(ensemble$parameters, refined_runs(settings)), hopeless = hopeless,
                         border = largest_border_share)
  })
}

refined_runs <- function(settings) round((settings$control$refine %||% refining_control$refine) * settings$runs)

# The full calibration. Where the coarse one did with runs spread over the priors, the remaining runs are made where
# its posterior lies. It keeps the coarse one's evidence.
fit_fully <- function(simulator, name, settings, first = NULL) {
  more <- refined_runs(settings)
  if (more == 0 && is.null(settings$control$screening)) return(fit_model(simulator, name, settings))
  settings$keep(list("full", name, plain(simulator)), {
    first <- first %||% screen_model(simulator, name, settings)
    fit <- if (is.null(first$ensemble$simulator)) {
      fit_runs(first$ensemble, settings)
    } else if (!settled(first$fit, first$made, good_border)) {
      control <- list(emulator = settings$control$emulator, calibration = settings$control$calibration)
      refine_until_checked(first$ensemble, settings$measurements, settings$control$rounds, control, settings$seed,
                           settings$threads,
                           runs = regional_runs(first$ensemble$parameters, more), first = first)$fit
    } else if (more > 0 && is.null(first$ensemble$region)) {
      fit_runs(refine_ensemble(with_checked_runs(first$ensemble, first$fit, first$made), first$fit, more,
                               threads = settings$threads), settings)
    } else {
      fit_runs(with_checked_runs(first$ensemble, first$fit, first$made), settings)
    }
    fit$coarse <- first$fit[c("log_evidence", "standard_error")]
    fit
  })
}
