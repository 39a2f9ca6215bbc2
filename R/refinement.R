#' Calibrate, check by runs and refine
#'
#' Trains the emulator, calibrates, and lets the simulator check the emulator where the posterior lies. Where the check
#' fails, fewer than a third of its runs are effective, or more than a hundredth of the posterior lies in the outer
#' tenth of the emulator's region, runs are made in the region of that posterior ([refine_ensemble()]; those of the
#' check join them), an emulator is trained for this region, and all is done again, up to a number of rounds. Of rounds
#' that all leave something to ask for, that with the best check stays.
#'
#' @param ensemble An ensemble: [simulate_design()], [refine_ensemble()], [ensemble()] (which can be checked, but not
#'   refined).
#' @param rounds Greatest number of refinements; 0 for the check alone.
#' @param runs Runs made in the first round, beside those of searches and checks, by default 40 or, if more, ten for
#'   each parameter; each further round makes 1.3 times as many.
#' @param control List of two lists, `emulator` and `calibration`, as [train_emulator()] and [calibrate()] take them.
#' @inheritParams calibrate
#' @inheritParams simulate_design
#' @return A calibration as [calibrate()] gives; its `rounds` says how often the ensemble was refined, `runs_made` how
#'   many runs of the simulator were made here, those of the checks included.
#' @source `vignette("algorithm", "amiss")`, *The simulator has the last word*.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4), Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)))  # coarse, for speed
#' fit <- calibrate_refined(runs, room, control = quick, seed = 1)
#' c(fit$rounds, fit$runs_made)
#' @export
calibrate_refined <- function(ensemble, measurements, rounds = 8, runs = NULL, control = NULL, seed = NULL,
                              threads = 1, quiet = FALSE) {
  hush(quiet)
  check_object(ensemble, "amiss_ensemble", "ensemble")
  check_input(checkmate::check_count(rounds), "rounds")
  check_object(measurements, "amiss_measurements", "measurements")
  check_input(checkmate::check_count(runs, positive = TRUE, null.ok = TRUE), "runs")
  check_runs_asked(runs %||% 40, measurements)
  check_training_size((runs %||% 40) * 1.3^rounds, "rounds", rounds)
  control <- merge_control(list(emulator = list(), calibration = list()), control)
  fill_emulator_control(control$emulator, "control$emulator")
  n <- length(used_rows(measurements, "calibrate"))
  fill_calibration_control(control$calibration, measurements, n, "control$calibration")
  fit <- refine_records(list(ensemble), list(measurements), rounds, control, pick_seed(seed), check_threads(threads),
                        runs)$fits[[1]]
  warn_coarse_basis(fit$emulator, "control$emulator$max_vectors")
  fit
}

# From where no more is refined: effective share of the runs at posterior draws, and share of the posterior in the outer
# tenth of the region (a normal one has a tenth of `for_intervals` there). The evidence asks for no more than the check
# does; the intervals of parameters, which their tails decide, do.
for_evidence <- list(effective = least_effective, border = largest_border_share)
for_intervals <- list(effective = 1 / 3, border = 0.01)

lost <- 3  # error over noise from which an emulator does not even tell where the posterior lies

# Of one record, or of several that share parameters: list(ensembles, fits, made), one of each for each record: the last
# calibration, the ensemble it was made with, and the runs of its check. `first`: such a list for the ensembles, if one
# is there already. `hopeless`: a function of coarse fits that tells that no more is wanted of them. `purpose`: what the
# calibration is for. `present`: joint_centre() of the model that this one extends, if it does. All fits say in `rounds`
# and `runs_made` what was spent on all. Where the last round is no better than one before it, that one stays.
refine_records <- function(ensembles, measurements, rounds, control, seed, threads, runs = NULL, first = NULL,
                           hopeless = function(fits) FALSE, purpose = for_intervals, present = NULL) {
  runs <- runs %||% max(vapply(ensembles, function(e) regional_runs(e$parameters), 0))
  runs_made <- 0
  round <- 0L
  # A round that did not do has shown that the simulator asks for more runs.
  next_round <- function() {
    if (round > 0) runs <<- ceiling(1.3 * runs)
    round <<- round + 1L
  }
  in_round <- function(code) {
    if (round > 0) staged(sprintf("round %d of at most %d", round, rounds), code) else code
  }
  trained <- function(ensembles) {
    train <- function(ensemble, m) in_round(train_emulator(ensemble, m, control$emulator, threads = threads))
    without_basis_warnings(Map(train, ensembles, measurements))
  }
  settings <- function(emulators, calibration) {
    Map(function(emulator, m) calibration_setting(emulator, m, calibration, seed), emulators, measurements)
  }
  has_region <- function(ensembles) !any(vapply(ensembles, function(e) is.null(e$region), NA))
  calibrated <- function(ensembles, calibration, emulators = trained(ensembles)) {
    force(emulators)
    found <- tryCatch(in_round(calibrate_sets(settings(emulators, calibration), threads)),
                      amiss_error_numerical = function(e) {
      if (!has_region(ensembles) || round >= rounds) rlang::cnd_signal(e)
    })
    if (is.null(found)) {  # the posterior lies at the very end of the region
      next_round()
      runs_made <<- runs_made + runs * length(ensembles)
      wider <- Map(function(ensemble, emulator, m) {
        in_round(regional_ensemble(ensemble, wider_region(ensemble$region), emulator, m, runs, threads))
      }, ensembles, emulators, measurements)
      return(calibrated(wider, calibration))
    }
    for (made in found$made) runs_made <<- runs_made + length(made$draws) + sum(made$failed)
    c(list(ensembles = ensembles), found)
  }
  searched <- function(ensembles, sets, centre = NULL) {
    starts <- c(list(centre), if (!has_region(ensembles)) starts_over_priors(ensembles, sets, present))
    found <- in_round(staged("search by the simulator", searched_ensembles(ensembles, sets, starts, runs, threads)))
    runs_made <<- runs_made + found$runs
    calibrated(found$ensembles, coarsely(control$calibration))
  }
  coarse <- FALSE
  from_posterior <- FALSE  # whether a search has begun there: another would end where it did
  result <- first
  if (is.null(result)) {
    emulators <- trained(ensembles)
    if (rounds > 0 && can_be_run(ensembles) && any(mapply(too_coarse, emulators, measurements))) {
      next_round()
      coarse <- TRUE
      result <- searched(ensembles, settings(emulators, control$calibration))
    } else {
      result <- calibrated(ensembles, control$calibration, emulators)
    }
  }
  best <- NULL
  repeat {
    enough <- all(mapply(settled, result$fits, result$made, list(purpose)))
    if (!coarse && (enough || is.null(best) || !better_checked(best$fits, result$fits))) best <- result
    if (!enough && round < rounds) {
      if (hopeless(result$fits)) break
      # A coarse sampler is enough to see where the posterior lies, until the check passes.
      next_round()
      wider <- Map(with_checked_runs, result$ensembles, result$fits, result$made)
      result <- if (!from_posterior && any(vapply(result$fits, function(fit) fit$check$ratio > lost, NA))) {
        from_posterior <- TRUE
        searched(wider, result$fits, joint_centre(result$fits))
      } else {
        runs_made <- runs_made + runs * length(wider)
        calibrated(Map(function(e, fit) in_round(refine_ensemble(e, fit, runs, threads)), wider, result$fits),
                   coarsely(control$calibration))
      }
      coarse <- TRUE
    } else if (coarse) {
      result <- calibrated(Map(with_checked_runs, result$ensembles, result$fits, result$made), control$calibration)
      coarse <- FALSE
    } else break
  }
  if (!coarse) result <- best
  result$fits <- lapply(result$fits, function(fit) {
    fit$rounds <- round
    fit$runs_made <- runs_made
    fit
  })
  result
}

# Whether a record asks for no more runs: its check passed with enough to spare for the purpose, or nothing can be run.
settled <- function(fit, made, purpose) {
  check <- fit$check
  exact <- !is.null(check) && !is.na(check$effective)
  is.null(made) || (isTRUE(check$passed) && check$border <= purpose$border &&
                      !(exact && (check$effective < purpose$effective || fit$standard_error > largest_error)))
}

# Whether the checks of calibrations speak for them more than those of others do for theirs.
better_checked <- function(fits, others) {
  score <- function(fits) min(vapply(fits, check_score, 0))
  score(fits) > score(others)
}

# Passed ones first, among them by the effective share of the runs or, where it was not asked for, by their error.
check_score <- function(fit) {
  check <- fit$check
  if (is.null(check)) return(0)
  isTRUE(check$passed) + (if (is.na(check$effective)) 1 / (1 + check$ratio) else check$effective)
}

can_be_run <- function(ensembles) !any(vapply(ensembles, function(e) is.null(e$simulator), NA))

# The centre of a posterior of several records, by the names of their parameters.
joint_centre <- function(fits) {
  all <- do.call(c, lapply(fits, function(fit) stats::setNames(posterior_centre(fit), names(fit$emulator$parameters))))
  all[!duplicated(names(all))]
}

# By the runs left out, an emulator over the priors is too coarse to sample from: the search on the simulator is
# cheaper.
too_coarse <- function(emulator, measurements) {
  is.null(emulator$processes$region) && isTRUE(emulator$diagnostics$series_rmse > measurements$noise_sd)
}

regional_runs <- function(parameters, least = 0) max(least, 40, 10 * length(parameters))

refining_ais <- list(pilot_chains = 128, groups = 2, max_groups = 2, max_sweeps = 6, precision = 1, gradient = FALSE,
                     importance_draws = 0)

coarsely <- function(calibration) {
  calibration <- utils::modifyList(as.list(calibration), list(exact = 0))
  calibration$ais <- utils::modifyList(as.list(calibration$ais), refining_ais)
  calibration
}

# Where searches over the priors start, in the coordinates of joint_parameters(): at the posterior of the model that
# this one extends, `present`, if it does, with the middle of the prior for what is new; at the run nearest to each
# record and, of a single one, at the nearest of the half of the runs that lie farther from that; in the middle of the
# priors. An extension often lies near the model that it extends, where a design over the priors has no run; and of
# several modes one search finds one.
starts_over_priors <- function(ensembles, sets, present = NULL) {
  all <- names(joint_parameters(sets))
  middle <- stats::setNames(numeric(length(all)), all)
  at <- function(values) replace(middle, names(values), values)
  nearest <- Map(function(ensemble, set) {
    x <- to_normal(ensemble$unit)
    colnames(x) <- names(ensemble$parameters)
    misfit <- colMeans((ensemble$outputs - set$measurements$y[set$rows])^2)
    first <- which.min(misfit)
    if (length(sets) > 1) return(list(at(x[first, ])))
    apart <- colSums((t(x) - x[first, ])^2)
    misfit[apart < stats::median(apart)] <- NA
    lapply(unique(c(first, which.min(misfit))), function(run) at(x[run, ]))
  }, ensembles, sets)
  extended <- if (!is.null(present)) list(at(present[intersect(names(present), all)]))
  c(extended, unlist(unname(nearest), recursive = FALSE), list(middle))
}

# list(ensembles, runs): the ensembles of the region to which searches on the simulator lead from `starts`, and the runs
# that they and it took. Where none gets anywhere, as error and discrepancy could not be sampled so far from the
# records, the ensembles as they were.
searched_ensembles <- function(ensembles, sets, starts, runs, threads) {
  all <- names(joint_parameters(sets))
  found <- search_modes(sets, Filter(Negate(is.null), starts), threads)
  if (!length(found$modes)) return(list(ensembles = ensembles, runs = found$runs))
  regional <- Map(function(ensemble, set) {
    region <- region_of_modes(found$modes, ensemble$parameters, match(names(ensemble$parameters), all))
    regional_ensemble(ensemble, region, set$emulator, set$measurements, runs, threads)
  }, ensembles, sets)
  list(ensembles = regional, runs = runs * length(ensembles) + found$runs)
}

# The ensemble with as many of the runs at posterior draws as the check asks for.
with_checked_runs <- function(ensemble, fit, made) {
  if (is.null(made)) return(ensemble)
  n <- ncol(made$runs)
  kept <- unique(round(seq(1, n, length.out = min(n, max(1, fit$control$check)))))
  draws <- made$draws[kept]
  join_runs(ensemble, posterior_unit(fit)[draws, , drop = FALSE], fit$values[draws, , drop = FALSE],
            made$runs[, kept, drop = FALSE])
}

#' More runs where they matter
#'
#' A design spread over the priors has few runs where the posterior lies, the fewer the more the data say, and an
#' emulator of it can be off there by more than it knows. This makes an ensemble of the region where a first posterior
#' lies: the ellipsoid that holds it, in the coordinates in which the priors are standard normal, half as wide again
#' where the posterior came near the end of the region before or the check by runs found the emulator surer than it was
#' right. Its runs follow the axes of the ellipsoid, at all distances from its centre alike; runs of `ensemble` that lie
#' inside join them, the last 40. An emulator of them holds in the region alone, and there a few dozen runs do what
#' hundreds spread over the priors cannot. Parameters outside count as impossible; if the posterior comes near the end
#' of the region, the check of [calibrate()] says so.
#'
#' @param ensemble An ensemble made by [simulate_design()], or by this.
#' @param fit A calibration with the emulator trained on it ([calibrate()]).
#' @param runs Number of runs to add.
#' @inheritParams simulate_design
#' @return An ensemble with a `region`. Train and calibrate anew.
#' @source `vignette("algorithm", "amiss")`, *The simulator has the last word* (regions).
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4), Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(ais = list(pilot_chains = 48, groups = 4))  # a coarse sampler, for speed
#' fit <- calibrate(train_emulator(runs, room), room, quick, seed = 1)
#' near <- refine_ensemble(runs, fit, runs = 20)
#' calibrate(train_emulator(near, room), room, quick, seed = 1)
#' @export
refine_ensemble <- function(ensemble, fit, runs = 40, threads = 1, quiet = FALSE) {
  hush(quiet)
  check_object(ensemble, "amiss_ensemble", "ensemble")
  check_object(fit, "amiss_calibration", "fit")
  check_input(checkmate::check_count(runs, positive = TRUE), "runs")
  check_run_number(runs, length(fit$measurements$raw$hours))
  threads <- check_threads(threads)
  if (is.null(ensemble$simulator)) {
    abort_input(c("The runs of this ensemble were made elsewhere, and so must more of them be.",
                  i = "Run the simulator at draws of {.code fit$values} and give all runs to {.fun ensemble}."))
  }
  if (!identical(names(ensemble$parameters), names(fit$emulator$parameters))) {
    abort_input(paste("{.arg fit} has the parameters {.val {names(fit$emulator$parameters)}}, the ensemble",
                      "{.val {names(ensemble$parameters)}}."))
  }
  if (nrow(ensemble$outputs) != length(fit$rows)) {
    abort_input(
      c("{.arg fit} was made on {length(fit$rows)} rows, the runs of {.arg ensemble} have {nrow(ensemble$outputs)}.",
                  i = "Give the ensemble and the calibration of the same measurements."))
  }
  check_same_rows(ensemble$hours, fit$measurements)
  # Where the posterior reached the end of its region, or the emulator was surer than it was right, it lies elsewhere in
  # part. An emulator that knows how far it is off has widened the posterior already.
  astray <- isTRUE(fit$check$border > largest_border_share || fit$check$z2 > 1)
  region <- posterior_region(fit, growth = if (astray) 1.5 else 1)
  regional_ensemble(ensemble, region, fit$emulator, fit$measurements, runs, threads)
}

# The ensemble of a region of the parameters' space; `emulator` knows that over the priors.
regional_ensemble <- function(ensemble, region, emulator, measurements, runs, threads) {
  unit <- region_design(region, runs, ensemble$seed)
  values <- unit_to_values(unit, ensemble$parameters)
  outputs <- simulate_measured(ensemble$simulator, values, measurements, "calibrate", threads)
  # The last of the runs that lie inside: those of checks, where the posterior was seen last.
  inside <- utils::tail(which(in_region(region, ensemble$unit)), 40)
  new_ensemble(ensemble$parameters, rbind(ensemble$unit[inside, , drop = FALSE], unit),
               rbind(ensemble$values[inside, , drop = FALSE], values),
               cbind(ensemble$outputs[, inside, drop = FALSE], outputs), ensemble$simulator, ensemble$seed, region,
               without_simulator(emulator_over_priors(emulator)), hours = ensemble$hours)
}

# The ensemble with more runs, of its own region.
join_runs <- function(ensemble, unit, values, outputs) {
  new_ensemble(ensemble$parameters, rbind(ensemble$unit, unit), rbind(ensemble$values, values),
               cbind(ensemble$outputs, outputs),
               ensemble$simulator, ensemble$seed, ensemble$region, ensemble$over_priors, hours = ensemble$hours)
}

# The simulator is kept once.
without_simulator <- function(emulator) {
  emulator["simulator"] <- list(NULL)
  emulator
}
