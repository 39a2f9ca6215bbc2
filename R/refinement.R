#' Calibrate, check by runs and refine
#'
#' Trains the emulator, calibrates, and lets the simulator check the emulator where the posterior lies. Where the check fails, its
#' runs join the ensemble and all is done again, up to a number of rounds: a design spread over the priors has few runs where the
#' posterior lies, and in a corner of the priors the emulator can be off by more than it knows.
#'
#' @param ensemble An ensemble: [simulate_design()], [refine_ensemble()], [ensemble()] (which can be checked, but not refined).
#' @param rounds Greatest number of refinements; 0 for the check alone.
#' @param control List of two lists, `emulator` and `calibration`, as [train_emulator()] and [calibrate()] take them.
#' @inheritParams calibrate
#' @return A calibration as [calibrate()] gives; its `rounds` says how often the ensemble was refined, `runs_made` how many
#'   runs of the simulator were made here, those of the checks included.
#' @export
calibrate_refined <- function(ensemble, measurements, rounds = 2, control = NULL, seed = NULL, threads = 1) {
  check_input(checkmate::check_class(ensemble, "amiss_ensemble"), "ensemble")
  check_input(checkmate::check_count(rounds), "rounds")
  control <- merge_control(list(emulator = list(), calibration = list()), control)
  seed <- pick_seed(seed)
  made_runs <- 0
  for (round in 0:rounds) {
    emulator <- train_emulator(ensemble, measurements, control$emulator, threads = threads)
    calibrated <- calibrate_with_runs(emulator, measurements, control$calibration, seed, threads)
    fit <- calibrated$fit
    made_runs <- made_runs + length(calibrated$made$draws) + sum(calibrated$made$failed)
    if (is.null(calibrated$made) || isTRUE(fit$check$passed) || round == rounds) break
    ensemble <- join_runs(ensemble, fit, calibrated$made)
  }
  fit$rounds <- round
  fit$runs_made <- made_runs
  fit
}

# The ensemble with as many of the runs at posterior draws as the check asks for.
join_runs <- function(ensemble, fit, made) {
  n <- ncol(made$runs)
  kept <- unique(round(seq(1, n, length.out = min(n, max(1, fit$control$check)))))
  draws <- made$draws[kept]
  unit <- posterior_unit(fit)[draws, , drop = FALSE]
  new_ensemble(ensemble$parameters, rbind(ensemble$unit, unit), rbind(ensemble$values, fit$values[draws, , drop = FALSE]),
               cbind(ensemble$outputs, made$runs[, kept, drop = FALSE]), ensemble$simulator, ensemble$seed)
}
