#' Calibrate, check by runs and refine
#'
#' Trains the emulator, calibrates, and lets the simulator check the emulator where the posterior lies. Where the check fails,
#' runs are made in the region of that posterior ([refine_ensemble()]; those of the check join them), an emulator is
#' trained for this region, and all is done again, up to a number of rounds. Where the emulator was surer than it was right, the error that
#' the check saw is added to the noise before the region is drawn, so that the region is as wide as the emulator deserves.
#'
#' @param ensemble An ensemble: [simulate_design()], [refine_ensemble()], [ensemble()] (which can be checked, but not refined).
#' @param rounds Greatest number of refinements; 0 for the check alone.
#' @param runs Runs made in each round; by default 40 or, if more, five for each parameter.
#' @param control List of two lists, `emulator` and `calibration`, as [train_emulator()] and [calibrate()] take them.
#' @inheritParams calibrate
#' @return A calibration as [calibrate()] gives; its `rounds` says how often the ensemble was refined, `runs_made` how many
#'   runs of the simulator were made here, those of the checks included.
#' @export
calibrate_refined <- function(ensemble, measurements, rounds = 4, runs = NULL, control = NULL, seed = NULL, threads = 1) {
  check_input(checkmate::check_class(ensemble, "amiss_ensemble"), "ensemble")
  check_input(checkmate::check_count(rounds), "rounds")
  check_input(checkmate::check_count(runs, positive = TRUE, null.ok = TRUE), "runs")
  control <- merge_control(list(emulator = list(), calibration = list()), control)
  refine_until_checked(ensemble, measurements, rounds, control, pick_seed(seed), threads, runs = runs)$fit
}

# list(ensemble, fit, made): the last calibration, the ensemble it was made with, and the runs of its check. `first`: such a
# list for the ensemble, if there is one already.
refine_until_checked <- function(ensemble, measurements, rounds, control, seed, threads, runs = NULL, first = NULL) {
  runs <- max(runs, 40, 10 * length(ensemble$parameters))
  runs_made <- 0
  calibrated <- function(ensemble, calibration) {
    emulator <- train_emulator(ensemble, measurements, control$emulator, threads = threads)
    own <- calibrate_with_runs(emulator, measurements, calibration, seed, threads)
    runs_made <<- runs_made + length(own$made$draws) + sum(own$made$failed)
    c(list(ensemble = ensemble), own)
  }
  result <- first %||% calibrated(ensemble, control$calibration)
  coarse <- FALSE
  round <- 0L
  repeat {
    settled <- is.null(result$made) || isTRUE(result$fit$check$passed)
    if (!settled && round < rounds) {
      # A coarse sampler is enough to see where the posterior lies, until the check passes.
      round <- round + 1L
      runs_made <- runs_made + runs
      result <- calibrated(surrounding(result, runs, control$calibration, seed, threads), coarsely(control$calibration))
      coarse <- TRUE
    } else if (coarse) {
      result <- calibrated(with_checked_runs(result), control$calibration)
      coarse <- FALSE
    } else break
  }
  result$fit$rounds <- round
  result$fit$runs_made <- runs_made
  result
}

refining_ais <- list(pilot_chains = 128, groups = 2, max_groups = 2, max_sweeps = 6, precision = 1, importance_draws = 300)

coarsely <- function(calibration, ...) {
  calibration <- utils::modifyList(as.list(calibration), list(exact = 0, ...))
  calibration$ais <- utils::modifyList(as.list(calibration$ais), refining_ais)
  calibration
}

# The ensemble of the region where the posterior lies, the runs of its check among it.
surrounding <- function(result, runs, calibration, seed, threads) {
  ensemble <- with_checked_runs(result)
  fit <- result$fit
  if (fit$check$ratio <= 1) return(refine_ensemble(ensemble, fit, runs, threads))
  z <- to_normal(posterior_unit(fit))
  nearest <- which.min(colMeans((ensemble$outputs - fit$measurements$y[fit$rows])^2))
  starts <- list(numeric(ncol(z)), colSums(fit$weights * z), to_normal(ensemble$unit[nearest, ]))
  region <- region_of_modes(lapply(starts, function(start) search_mode(fit, start, threads)))
  regional_ensemble(ensemble, region, fit, runs, threads)
}

# The ensemble with as many of the runs at posterior draws as the check asks for.
with_checked_runs <- function(result) {
  fit <- result$fit
  made <- result$made
  if (is.null(made)) return(result$ensemble)
  n <- ncol(made$runs)
  kept <- unique(round(seq(1, n, length.out = min(n, max(1, fit$control$check)))))
  draws <- made$draws[kept]
  join_runs(result$ensemble, posterior_unit(fit)[draws, , drop = FALSE], fit$values[draws, , drop = FALSE], made$runs[, kept, drop = FALSE])
}
