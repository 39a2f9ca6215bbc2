#' Calibrate with few runs, checked by the simulator
#'
#' Searches for the mode by runs of the simulator and trains an emulator in the region of the mode.
#' The posterior is sampled, and the simulator checks the emulator at draws of it. The
#' runs of a check also train the emulator of the next round. The rounds end when a check passes
#' with enough to spare, after two rounds without progress, or after `rounds`.
#'
#' # Search
#'
#' Steps start from the run that is nearest to the record, and from others far from it. Each step
#' leads to the posterior under the line that touches the simulator. Each run corrects the slopes of
#' that line. The search ends when two starts lead to one mode. If no two do, the result is not
#' trusted and says so.
#'
#' # Region
#'
#' About thirty runs in the ellipsoid that holds the posterior train an emulator. Its mean is the
#' simulator's tangent. The discrepancy keeps out of what the parameters do there, as far as its
#' reach says ([calibrate()]). It therefore does not depend on the runs with which the search began.
#'
#' @param ensemble An ensemble: [simulate_design()] (twice as many runs as parameters, and two, are
#'   enough), [refine_ensemble()] or [ensemble()]. The last can be checked, but not refined.
#' @param rounds Most checks before the result is left as not trusted; 0 calibrates the ensemble as
#'   it is.
#' @param runs Runs in the region of the mode, by default 25 or, if more, two for each parameter.
#' @param control List of two lists, `emulator` and `calibration`, as [train_emulator()] and
#'   [calibrate()] take them.
#' @inheritParams calibrate
#' @inheritParams simulate_design
#' @return A calibration as from [calibrate()], with
#'   * `rounds`: how many checks were made.
#'   * `runs_made`: how many runs of the simulator were made here.
#'   * `modes`: how many searches there were (`searches`) and whether two of them agreed (`agree`).
#'     `points` are the parameters where searches ended, `heights` the log posterior there.
#' @source `vignette("algorithm", "amiss")`, *The simulator first*. The search follows Powell
#'   (2004), Least Frobenius norm updating of quadratic models that satisfy interpolation
#'   conditions, Mathematical Programming 100, 183-215. It also follows Moré (1978), The
#'   Levenberg-Marquardt algorithm, Lecture Notes in Mathematics 630, 105-116.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 8, seed = 1)
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)))  # coarse, for speed
#' fit <- calibrate_refined(runs, room, control = quick, seed = 1)
#' c(fit$rounds, fit$runs_made)
#' @export
calibrate_refined <- function(ensemble, measurements, rounds = rules$verify_rounds, runs = NULL,
                              control = NULL, seed = NULL, threads = 1, quiet = FALSE) {
  check_arguments()
  hush(quiet)
  check_object(ensemble, "amiss_ensemble", "ensemble")
  check_object(measurements, "amiss_measurements", "measurements")
  control <- check_refining(list(measurements), rounds, runs, control)
  calibrate_ensembles(list(ensemble), list(measurements), rounds, runs, control, pick_seed(seed),
                      check_threads(threads))
}

# The options of calibrations that make runs.
check_refining <- function(measurements, rounds, runs, control, call = rlang::caller_env()) {
  check_input(checkmate::check_count(rounds), "rounds", call = call)
  check_input(checkmate::check_count(runs, positive = TRUE, null.ok = TRUE), "runs", call = call)
  for (m in measurements)
    check_run_number(runs %||% rules$local_runs, length(m$raw$hours), "runs", call)
  check_training_size((runs %||% rules$local_runs) + rules$more_runs * rounds, "rounds",
                      rounds, call)
  control <- merge_control(list(emulator = list(), calibration = list()), control, call = call)
  for (m in measurements) check_controls_of(control, m, "history", call, attribution = FALSE)
  control
}

# One calibration of all ensembles: by a search if they know their simulators and rounds are asked
# for.
calibrate_ensembles <- function(ensembles, measurements, rounds, runs, control, seed, threads) {
  context <- new_context(seed, threads, c(control, list(rounds = rounds)))
  searched <- rounds > 0 && all(vapply(ensembles, can_be_run, NA))
  fit <- if (searched) searched_fit(ensembles, measurements, runs, control, context)
         else given_model(ensembles, measurements, "the model", context)$fit
  for (one in record_fits(fit)) {
    warn_coarse_basis(one$emulator, "control$emulator$max_vectors",
                      if (length(ensembles) > 1) one$measurements$name)
  }
  fit
}

searched_fit <- function(ensembles, measurements, runs, control, context) {
  for (k in seq_along(ensembles)) check_ensemble_rows(ensembles[[k]], measurements[[k]])
  simulators <- lapply(ensembles, `[[`, "simulator")
  model <- new_model(simulators, lapply(measurements, loop_record, control$calibration))
  model$local <- runs
  calibrate_model(with_known_runs(model, ensembles), context)$fit
}

can_be_run <- function(ensemble) !is.null(ensemble$simulator)

# The runs of ensembles that were made at the same points of all parameters. Held-out rows were not
# run then.
with_known_runs <- function(model, ensembles) {
  n <- unique(vapply(ensembles, function(e) ncol(e$outputs), 0L))
  if (length(n) > 1) return(model)  # of some records runs failed
  unit <- matrix(0.5, n, length(model$parameters))
  for (k in seq_along(ensembles)) unit[, model$own[[k]]] <- ensembles[[k]]$unit
  z <- from_unit(unit, model$space)
  colnames(z) <- names(model$parameters)
  held <- matrix(NaN, nrow(model$runs$held), n)
  outputs <- do.call(rbind, lapply(unname(ensembles), `[[`, "outputs"))
  model$runs <- new_runs(model, z, outputs, held)
  model
}

#' More runs near the posterior
#'
#' Makes an ensemble of the region of a first posterior. A design spread over the priors has
#' few runs there, and fewer the more informative the data are. Its emulator can be wrong there by
#' more than it knows. In the region, a few dozen runs do what hundreds spread over the priors
#' cannot.
#'
#' # Region
#'
#' The region is the ellipsoid that holds the posterior, in the coordinates in which the priors are
#' standard normal. It is half as wide again if the posterior came near the end of the region
#' before. It is also wider if the check by runs showed that the emulator was surer than it was
#' right.
#'
#' The runs follow the axes of the ellipsoid and are spread evenly over the distances from its
#' centre. Runs of `ensemble` that lie inside join them, the last 40 at most.
#'
#' An emulator of these runs holds in the region alone. Parameters outside count as impossible. If
#' the posterior comes near the end of the region, the check of [calibrate()] says so.
#'
#' @param ensemble An ensemble made by [simulate_design()] or by this function.
#' @param fit A calibration with the emulator trained on it ([calibrate()]).
#' @param runs Number of runs to add.
#' @inheritParams simulate_design
#' @return An ensemble with a `region`. Train and calibrate anew.
#' @source `vignette("algorithm", "amiss")`, *The simulator has the last word* (regions).
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
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
  check_arguments()
  hush(quiet)
  check_object(ensemble, "amiss_ensemble", "ensemble")
  check_object(fit, "amiss_calibration", "fit")
  check_input(checkmate::check_count(runs, positive = TRUE), "runs")
  check_run_number(runs, length(fit$measurements$raw$hours))
  threads <- check_threads(threads)
  if (is.null(ensemble$simulator)) {
    abort_input(c("The runs of this ensemble were made elsewhere, and so must more of them be.",
                  i = paste("Run the simulator at draws of {.code fit$values} and give all runs to",
                            "{.fun ensemble}.")))
  }
  if (!identical(names(ensemble$parameters), names(fit$emulator$parameters))) {
    abort_input(paste("{.arg fit} has the parameters {.val {names(fit$emulator$parameters)}}, the",
                      "ensemble {.val {names(ensemble$parameters)}}."))
  }
  if (nrow(ensemble$outputs) != length(fit$rows)) {
    abort_input(c(paste("{.arg fit} was made on {length(fit$rows)} rows, the runs of",
                        "{.arg ensemble} have {nrow(ensemble$outputs)}."),
                  i = "Give the ensemble and the calibration of the same measurements."))
  }
  check_same_rows(ensemble$hours, fit$measurements)
  # Where the posterior reached the end of its region, or the emulator was surer than it was right,
  # it lies elsewhere in part. An emulator that knows how far it is off has widened the posterior
  # already.
  astray <- isTRUE(fit$check$border > rules$border || fit$check$z2 > 1)
  region <- posterior_region(fit, growth = if (astray) rules$astray_growth else 1)
  regional_ensemble(ensemble, region, fit$emulator, fit$measurements, runs, threads)
}

# The ensemble of a region of the parameters' space; `emulator` knows that over the priors.
regional_ensemble <- function(ensemble, region, emulator, measurements, runs, threads) {
  unit <- region_design(region, runs, pick_seed(ensemble$seed))
  values <- unit_to_values(unit, ensemble$parameters)
  outputs <- simulate_measured(ensemble$simulator, values, measurements, "calibrate", threads)
  # The last of the runs that lie inside: those of checks, where the posterior was seen last.
  inside <- utils::tail(which(in_region(region, ensemble$unit)), rules$inside_runs)
  new_ensemble(ensemble$parameters, rbind(ensemble$unit[inside, , drop = FALSE], unit),
               rbind(ensemble$values[inside, , drop = FALSE], values),
               cbind(ensemble$outputs[, inside, drop = FALSE], outputs), ensemble$simulator,
               ensemble$seed, region, without_simulator(emulator_over_priors(emulator)),
               hours = ensemble$hours)
}

# The simulator is kept once.
without_simulator <- function(emulator) {
  emulator["simulator"] <- list(NULL)
  emulator
}
