# One model taken down the line: its runs, its emulator, its calibration, coarse at first and then in full.

# How runs are spent where a model is calibrated twice.
refining_control <- list(refine = 1 / 3, rounds = 8,
                         screening = list(pilot_chains = 128, groups = 4, max_groups = 16, max_sweeps = 12,
                                          precision = 0.5, gradient = FALSE, importance_draws = 0))

screening_runs <- 20  # that check a coarse calibration
least_rounds <- 3     # of refinement that are left to each calibration of a model, if so many were asked for

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

# A model simulated, trained and calibrated by `settings$calibrate`; calibrate_paper() has no refinements. Every model
# of a study is drawn on the same design seed: differences between models are not the design's.
fit_model <- function(simulator, name, settings) {
  settings$keep(list("fit", name, plain(simulator)), {
    ensemble <- first_runs(simulator, settings$runs, settings)
    if (identical(settings$calibrate, calibrate)) {
      fit_runs(ensemble, settings)$fit
    } else without_basis_warnings({
      emulator <- train_emulator(ensemble, settings$measurements, settings$control$emulator,
                                 threads = settings$threads)
      settings$calibrate(emulator, settings$measurements, settings$control$calibration, seed = settings$seed,
                         threads = settings$threads)
    })
  })
}

# refine_until_checked() as a study asks for it; what was spent on the model `before` counts. Of a coarse basis tells
# who asks for the model.
fit_runs <- function(ensemble, settings, calibration = settings$control$calibration, before = NULL, ...) {
  rounds <- settings$control$rounds %||% refining_control$rounds
  left <- min(rounds, max(least_rounds, rounds - (before$rounds %||% 0)))
  control <- list(emulator = as.list(settings$control$emulator), calibration = as.list(calibration))
  found <- without_basis_warnings(refine_until_checked(
    ensemble, settings$measurements, left, control, settings$seed, settings$threads,
    runs = regional_runs(ensemble$parameters, refined_runs(settings)), ...))
  for (spent in c("rounds", "runs_made")) found$fit[[spent]] <- found$fit[[spent]] + (before[[spent]] %||% 0L)
  found
}

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
    fit_runs(first_runs(simulator, settings$runs - refined_runs(settings), settings), settings, calibration,
             hopeless = hopeless, purpose = for_evidence)
  })
}

refined_runs <- function(settings) round((settings$control$refine %||% refining_control$refine) * settings$runs)

# The full calibration: list(ensemble, fit, made). Where the coarse one did with runs spread over the priors, the
# remaining runs are made where its posterior lies. It keeps the coarse one's evidence, and is for the evidence too:
# settled_fit() asks for the tails.
fit_fully <- function(simulator, name, settings, first = NULL) {
  settings$keep(list("full", name, plain(simulator)), {
    more <- refined_runs(settings)
    if (more == 0 && is.null(settings$control$screening)) {
      full <- fit_runs(first_runs(simulator, settings$runs, settings), settings, purpose = for_evidence)
    } else {
      first <- first %||% screen_model(simulator, name, settings)
      full <- if (is.null(first$ensemble$simulator)) {
        fit_runs(first$ensemble, settings, before = first$fit)
      } else if (!settled(first$fit, first$made, for_evidence)) {
        fit_runs(first$ensemble, settings, before = first$fit, first = first, purpose = for_evidence)
      } else {
        ensemble <- with_checked_runs(first$ensemble, first$fit, first$made)
        if (more > 0 && is.null(ensemble$region))
          ensemble <- refine_ensemble(ensemble, first$fit, more, threads = settings$threads)
        fit_runs(ensemble, settings, before = first$fit, purpose = for_evidence)
      }
      full$fit$coarse <- first$fit[c("log_evidence", "standard_error")]
    }
    full
  })
}

# The fit that fit_fully() gave, refined where tails of the posterior lie at the end of the region: a model that is kept
# needs its parameters' intervals. What its rounds could not mend is left.
settled_fit <- function(full, name, settings) {
  if (isFALSE(full$fit$check$passed) || settled(full$fit, full$made, for_intervals)) return(full$fit)
  settings$keep(list("settled", name, plain(model_of(full$fit))), {
    fit <- fit_runs(full$ensemble, settings, before = full$fit, first = full)$fit
    fit$coarse <- full$fit$coarse
    fit
  })
}
