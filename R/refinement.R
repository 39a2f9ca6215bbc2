#' Calibrate, check by runs and refine
#'
#' Trains the emulator, calibrates, and lets the simulator check the emulator where the posterior lies. Where the check fails, its
#' runs join the ensemble and all is done again, up to a number of rounds: a design spread over the priors has few runs where the
#' posterior lies, and in a corner of the priors the emulator can be off by more than it knows. In these rounds the error that the check saw
#' is added to the noise, so that the posterior is as wide as the emulator deserves and the runs surround what they are to decide; it narrows
#' as the error falls.
#'
#' @param ensemble An ensemble: [simulate_design()], [refine_ensemble()], [ensemble()] (which can be checked, but not refined).
#' @param rounds Greatest number of refinements; 0 for the check alone.
#' @param control List of two lists, `emulator` and `calibration`, as [train_emulator()] and [calibrate()] take them.
#' @inheritParams calibrate
#' @return A calibration as [calibrate()] gives; its `rounds` says how often the ensemble was refined, `runs_made` how many
#'   runs of the simulator were made here, those of the checks included.
#' @export
calibrate_refined <- function(ensemble, measurements, rounds = 3, control = NULL, seed = NULL, threads = 1) {
  check_input(checkmate::check_class(ensemble, "amiss_ensemble"), "ensemble")
  check_input(checkmate::check_count(rounds), "rounds")
  control <- merge_control(list(emulator = list(), calibration = list()), control)
  refine_until_checked(ensemble, NULL, measurements, rounds, control, pick_seed(seed), threads)$fit
}

# list(ensemble, fit, made): the last calibration, the ensemble it was made with, and the runs of its check. `result`: a calibration on
# the ensemble with its runs, if there is one already.
refine_until_checked <- function(ensemble, result, measurements, rounds, control, seed, threads) {
  runs_made <- 0
  calibrated <- function(calibration) {
    emulator <- train_emulator(ensemble, measurements, control$emulator, threads = threads)
    own <- calibrate_with_runs(emulator, measurements, calibration, seed, threads)
    runs_made <<- runs_made + length(own$made$draws) + sum(own$made$failed)
    own
  }
  settled <- function() is.null(result$made) || isTRUE(result$fit$check$passed)
  if (is.null(result)) result <- calibrated(control$calibration)
  full <- NULL
  round <- 0L
  while (!settled() && round < rounds) {
    # A coarse sampler is enough to see where the runs are needed, until the check passes.
    while (!settled() && round < rounds) {
      round <- round + 1L
      ensemble <- join_runs(ensemble, result$fit, result$made)
      result <- calibrated(coarsely(control$calibration, result$fit$check$error))
    }
    ensemble <- join_runs(ensemble, result$fit, result$made)
    result <- full <- calibrated(control$calibration)
  }
  result <- full %||% result
  result$fit$rounds <- round
  result$fit$runs_made <- runs_made
  c(list(ensemble = ensemble), result[c("fit", "made")])
}

refining_ais <- list(pilot_chains = 128, groups = 2, max_groups = 2, max_sweeps = 6, precision = 1, importance_draws = 300)

coarsely <- function(calibration, emulator_sd) {
  calibration <- as.list(calibration)
  calibration$ais <- utils::modifyList(as.list(calibration$ais), refining_ais)
  calibration$exact <- 0
  calibration$emulator_sd <- emulator_sd
  calibration
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
