calibration_control <- list(
  confidence = NULL, inclusion = 0.2, amplitude = NULL, reach = c(13, 300, Inf),
  time_constants = NULL, error_times = NULL, error_ratios = c(0, 0.3, 1, 3, 10, 30, 100),
  error_draws = 32, check = 40, exact = NULL,
  ais = list(pilot_chains = 400, groups = 8, max_groups = 16, max_sweeps = 12, precision = 0.2,
             gradient = TRUE))

#' Calibrate a simulator on measurements
#'
#' Samples the joint posterior of the parameters, the error and the discrepancy, given the whole
#' record. The sampler is annealed importance sampling. Its normalising constant is the evidence of
#' the model, a density of the calibration record.
#'
#' # Model
#'
#' The record is the sum of three terms: the simulation, a discrepancy that responds to the history
#' of the boundary conditions, and an autocorrelated error. All have one covariance. Nothing is
#' split off, so the evidence does not depend on the basis of the emulator.
#'
#' The fit learns how far the discrepancy reaches into what the parameters can do. `reach` is a grid
#' of numbers kappa, equally probable beforehand:
#'
#' * With a small kappa the discrepancy keeps out of some directions: those in which the runs differ
#'   by much more than `sqrt(kappa)` times the noise.
#' * With `Inf` the discrepancy is free.
#'
#' If the posterior prefers a free discrepancy, the model is wrong where its parameters could hide
#' the error.
#'
#' # The simulator has the last word
#'
#' If the ensemble knows its simulator, the simulator is run at `check` draws of the posterior, or
#' at `exact` draws if these are more. The check compares the emulator's error there with the
#' measurement error as the likelihood weighs it. That is the autocorrelated error that was seen; if
#' more error was seen than stated, it is the noise stated. The check fails if
#'
#' * the emulator's error is larger than a third of the noise,
#' * fewer than a tenth of the `exact` draws are effective,
#' * the runs change the evidence by more than ten nats, or
#' * more than a twentieth of the posterior lies in the outer tenth of the emulator's region.
#'
#' If the check fails, trust neither the posterior nor the evidence. [calibrate_refined()] then
#' makes an emulator for the region and tries again. The likelihoods of the `exact` runs correct the
#' evidence, so that it is the simulator's own.
#'
#' For an ensemble made elsewhere, the check uses runs left out one by one. It takes the fifth of
#' them (at least 20) that lie nearest to the posterior.
#'
#' @param emulator A trained emulator ([train_emulator()]).
#' @param measurements The [measurements()].
#' @param control List of options, with their defaults:
#'   * `confidence`: how firmly `noise_sd` is believed, c in `[2/N, 1]`. By default (2/N) the noise
#'     may well be three times as large, or as small.
#'   * `inclusion`: prior probability that a condition drives the discrepancy at all (0.2).
#'   * `amplitude`: scale of the half-Cauchy prior of the discrepancy's standard deviation if a
#'     condition drives it, in the target's unit (the noise).
#'   * `reach`: see *Model* (`c(13, 300, Inf)`; in the region of a mode 13).
#'   * `time_constants`: time constants of the filter bank in hours (0, 2, 4, 8, ... 64 steps of the
#'     record, up to a sixth of the calibration rows). Give longer ones if the system is slower.
#'   * `error_times`: time constants of the autocorrelated error in hours (2 and 32 steps).
#'   * `error_ratios`: variance of the autocorrelated error relative to the white noise (`c(0, 0.3,
#'     1, 3, 10, 30, 100)`).
#'   * `error_draws`: posterior draws kept for the discrepancy over time (32).
#'   * `check`: runs of the simulator at posterior draws (40; 0 for none).
#'   * `exact`: runs that correct the evidence (those of the check; 0 for none).
#'   * `ais`: options of [ais()], here with gradients and the defaults `pilot_chains` 400, `groups`
#'     8, `max_groups` 16, `max_sweeps` 12 and `precision` 0.2.
#' @param seed Seed; if `NULL`, R's generator gives one.
#' @param threads Number of threads; the result does not depend on it.
#' @return An object of class `amiss_calibration`:
#'   * `values`, `weights`: the draws of the parameters.
#'   * `log_evidence`, `standard_error`, `interval`: the evidence in natural logarithms. The printed
#'     evidence is in logarithms to the base of 10.
#'   * `trust`: whether the numbers can be believed (`trusted`) and why not (`verdict`).
#'   * `reach`: the posterior probability of each reach.
#'   * `check`: what the runs said about the emulator, see below.
#'
#'   The elements of `check` are
#'
#'   * `error`: the emulator's error, RMS at the record's rows.
#'   * `ratio`: that error divided by the noise.
#'   * `border`: share of the posterior in the outer tenth of the emulator's region.
#'   * `z2`: mean square error in units of the emulator's own standard deviations.
#'   * `effective`: effective share of the draws under the exact weights.
#'   * `passed` and `verdict`: whether the check passed, and the same in words.
#' @source Kennedy and O'Hagan (2001), Bayesian calibration of computer models, Journal of the Royal
#'   Statistical Society B 63, 425-464, for simulation plus discrepancy plus error. The covariance,
#'   its priors and the check are in `vignette("algorithm", "amiss")`, *One covariance*, *The
#'   simulator has the last word* and *History of the boundary conditions*.
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
#' fit
#' fit$check$verdict
#' coef(fit)
#' @export
calibrate <- function(emulator, measurements, control = NULL, seed = NULL, threads = 1) {
  check_arguments()
  calibrate_with_runs(emulator, measurements, control, seed, threads)$fit
}

# The calibration, and the runs of the simulator at its draws.
calibrate_with_runs <- function(emulator, measurements, control, seed, threads,
                                call = rlang::caller_env()) {
  threads <- check_threads(threads)
  found <- calibrate_sets(list(calibration_setting(emulator, measurements, control, seed, call)),
                          threads, call)
  list(fit = found$fits[[1]], made = found$made[[1]])
}

# list(fits, made): calibrations of records that share the parameters of the same name, one for each
# set (calibration_setting()), and the runs of each at its draws. All have the same draws and the
# evidence of all records.
calibrate_sets <- function(sets, threads, call = rlang::caller_env()) {
  records <- engine_records(sets)
  result <- tryCatch(
    staged("sampling the posterior", call_engine(
      calibrate_(records, sets[[1]]$control, engine_context(sets[[1]]$seed, threads)))),
    amiss_error_numerical = function(e) {
      for (set in sets) check_noise_visible(set$emulator, set$measurements$noise_sd, e, call)
      rlang::cnd_signal(e)
    })
  fits <- Map(fit_of_record, sets, records, result$records, MoreArgs = list(result = result))
  checked <- checked_by_runs(unname(fits), threads)
  checked$fits <- lapply(checked$fits, function(fit) {
    fit$trust <- fit_trust(fit)
    fit
  })
  checked
}

fit_of_record <- function(set, record, own, result) {
  posterior <- c(result$posterior, own[c("setting", "variance", "t")])
  posterior$unit <- posterior$unit[, record$parameters, drop = FALSE]
  new_fit("amiss_calibration", set, posterior, posterior, kept = result$kept,
          coefficients = own$coefficients, withheld = own$withheld,
          withheld_covariance = own$withheld_covariance,
          withheld_of_condition = own$withheld_of_condition, tangent = own$tangent,
          centre = own$centre, scale = own$scale,
          reach = stats::setNames(own$reach, format(set$control$reach, trim = TRUE)))
}

# Records as the engine takes them, their parameters numbered over all. `fits`: calibrations, or
# what they are made of.
engine_records <- function(fits) {
  numbered <- unique(unlist(lapply(fits, function(fit) names(fit$emulator$parameters))))
  lapply(unname(fits), function(fit) {
    list(data = history_data(fit$emulator, fit$measurements, fit$rows, fit$control),
         priors = fit$priors, emulator = fit$emulator$processes,
         parameters = match(names(fit$emulator$parameters), numbered))
  })
}

# A noise that is lost in the rounding of what the simulator moves is given as the reason of a
# failure.
check_noise_visible <- function(emulator, noise_sd, parent, call) {
  spread <- sqrt(mean(rowSums(simulator_moves(emulator)^2)))
  if (noise_sd > 1e-5 * spread) return(invisible())
  abort_numerical(c(paste("The noise of {signif(noise_sd, 3)} is lost beside the runs, which",
                          "spread by {signif(spread, 3)}."),
                    x = "{conditionMessage(parent)}",
                    i = paste("Double precision holds a noise of a hundred-thousandth of the",
                              "spread: narrow the priors, or give {.arg noise_sd} of",
                              "{.fun measurements} the instrument's error.")), call = call)
}

# What a calibration is made of before it is made: list(emulator, measurements, rows, control,
# priors, seed).
calibration_setting <- function(emulator, measurements, control, seed, call = rlang::caller_env()) {
  rows <- emulated_rows(emulator, measurements, call)
  check_target_varies(measurements, rows, call)
  control <- fill_calibration_control(control, measurements, length(rows), call = call)
  priors <- history_priors(measurements, control, length(rows), mean(emulator$basis$discarded_sd^2))
  list(emulator = emulator, measurements = measurements, rows = rows, control = control,
       priors = priors, seed = pick_seed(seed))
}

# The calibration rows, which must be those that the emulator was trained on.
emulated_rows <- function(emulator, measurements, call = rlang::caller_env()) {
  check_object(emulator, "amiss_emulator", "emulator", call = call)
  check_object(measurements, "amiss_measurements", "measurements", call = call)
  rows <- used_rows(measurements, "calibrate")
  if (nrow(emulator$basis$vectors) != length(rows)) {
    abort_input(c(paste("The emulator was trained on {nrow(emulator$basis$vectors)} steps and the",
                        "measurements have {length(rows)} calibration rows."),
                  i = "Train it on runs at exactly these rows."), call = call)
  }
  check_same_rows(emulator$hours, measurements, call = call)
  rows
}

fill_calibration_control <- function(control, measurements, n, what = "control",
                                     call = rlang::caller_env()) {
  control <- merge_control(calibration_control, control, what, call = call)
  named <- function(option) paste0(what, "$", option)
  ais <- merge_control(calibration_control$ais, control$ais, named("ais"),
                       names(ais_defaults_()), call)
  control$ais <- fill_ais_control(ais, named("ais"), call = call)
  step <- measurements$step_h
  if (is.null(control$confidence)) control["confidence"] <- 2 / n
  if (is.null(control$amplitude)) control["amplitude"] <- measurements$noise_sd
  if (is.null(control$time_constants)) {
    taus <- step * 2^(1:6)
    control[["time_constants"]] <- c(0, taus[taus <= n * step / 6])
  }
  if (is.null(control$error_times)) {
    control[["error_times"]] <- c(rules$error_short, rules$error_long) * step
  }
  check_input(checkmate::check_number(control$confidence, lower = 2 / n - 1e-12, upper = 1),
              named("confidence"),
              "It lies between 2/N (hardly believed) and 1 (as firm as N values).", call = call)
  check_input(checkmate::check_number(control$inclusion, lower = 1e-6, upper = 1),
              named("inclusion"), call = call)
  check_input(checkmate::check_number(control$amplitude, lower = .Machine$double.xmin,
                                      finite = TRUE), named("amplitude"), call = call)
  check_input(checkmate::check_numeric(control$time_constants, lower = 0, finite = TRUE,
                                       min.len = 1, any.missing = FALSE),
              named("time_constants"), call = call)
  check_input(checkmate::check_numeric(control$error_times, lower = 1e-12, finite = TRUE,
                                       any.missing = FALSE, max.len = 3),
              named("error_times"), call = call)
  check_input(checkmate::check_numeric(control$error_ratios, lower = 0, finite = TRUE, min.len = 1,
                                       any.missing = FALSE), named("error_ratios"), call = call)
  check_input(checkmate::check_numeric(control$reach, lower = 1e-6, min.len = 1,
                                       any.missing = FALSE, unique = TRUE), named("reach"),
              "Give numbers above 0; {.code Inf} is a free discrepancy.", call = call)
  check_input(checkmate::check_count(control$error_draws, positive = TRUE), named("error_draws"),
              call = call)
  check_size(named("error_draws"), control$error_draws,
             matrix_gb(n, control$error_draws, copies = 4), call = call)
  check_input(checkmate::check_count(control$check), named("check"), call = call)
  check_input(checkmate::check_count(control$exact, null.ok = TRUE), named("exact"), call = call)
  for (name in c("check", "exact"))
    check_run_number(control[[name]] %||% 0, length(measurements$raw$hours), named(name), call)
  check_settings_size(control, length(measurements$condition), what, call)
  control
}

# What a person should know before using it.
fit_trust <- function(fit) {
  against <- c(if (!fit$posterior$trusted) fit$posterior$why,
               if (isFALSE(fit$check$passed)) fit$check$verdict,
               if (fit$posterior$trusted && fit$standard_error > rules$evidence_error)
                 paste("corrected by the runs, the evidence has a standard error of more than one",
                       "nat"))
  new_trust(is.null(against), against %||% fit$posterior$why)
}

#' @export
print.amiss_calibration <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong Calibration} on {length(x$rows)} rows of {.val {x$measurements$name}}")
  if (isTRUE(x$part)) {
    cli::cli_text("one of several records that were calibrated together, {x$trust$verdict}")
  } else {
    cli::cli_text("log10 evidence {evidence_words(x)}, {x$trust$verdict}")
  }
  cli::cli_text("{error_sentence(x)}")
  say_parameters(x, 6)
  cli::cli_bullets(finding_bullets(fit_findings(x)$says))
  cli::cli_bullets(c("*" = "{reach_words(x)}", if (!is.null(x$check)) c("*" = "{x$check$verdict}")))
  cli::cli_bullets(
    c(">" = if (isTRUE(x$part)) "next: {.fun discrepancy} or {.fun predict}"
            else "next: {.fun attribute_discrepancy}, {.fun discrepancy} or {.fun upgrade_model}"))
})

evidence_words <- function(fit, sign = "") {
  decades <- c(fit$log_evidence, fit$interval) / log(10)
  with_limits(decades[1], decades[2], decades[3], sign)
}

free_probability <- function(fit) sum(fit$reach[is.infinite(fit$control$reach)])

# What the reach says of the model, in words.
reach_words <- function(fit) {
  free <- free_probability(fit)
  if (length(fit$reach) < 2) {
    return(if (free > 0) "the discrepancy is free"
           else sprintf("the discrepancy keeps out of what the parameters do (reach %s)",
                        names(fit$reach)))
  }
  if (free >= 0.9)
    return(sprintf(paste("the discrepancy reaches into what the parameters can do (probability",
                         "%.2f): the model is wrong where its parameters could hide it"),
                   free))
  if (free <= 0.1)
    return(sprintf("the discrepancy keeps out of what the parameters can do (probability %.2f)",
                   1 - free))
  sprintf(paste("whether the discrepancy reaches into what the parameters can do stays open",
                "(probability %.2f)"), free)
}

# What a discrepancy that reaches that far, in one record at least, says of the parameters; NULL
# where it does not.
reach_sentence <- function(fit) {
  hides <- function(fit) length(fit$reach) > 1 && free_probability(fit) > 0.9
  if (any(vapply(record_fits(fit), hides, NA)))
    paste("What remains resembles what the parameters can do: they may hide a part of it, and",
          "their values may be biased.")
}

#' @export
calibrator.amiss_calibration <- function(fit) calibrate

#' @export
default_control.amiss_calibration <- function(fit) {
  fill_calibration_control(NULL, fit$measurements, length(fit$rows))
}
