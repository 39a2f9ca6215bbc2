calibration_control <- list(confidence = NULL, inclusion = 0.2, amplitude = NULL, time_constants = NULL, error_times = NULL,
                            error_ratios = c(0, 0.3, 1, 3, 10, 30, 100), error_draws = 32, ais = list())

#' Calibrate a simulator on measurements
#'
#' Two posteriors are sampled by annealed importance sampling. The first is that of the discrepancy and the error,
#' on the part of the record outside the simulation space, which no parameter can reach. The second joins the
#' parameters to it, on the whole record; its normalising constant is the evidence of the model, as a density of the
#' calibration record.
#'
#' @param emulator A trained emulator ([train_emulator()]).
#' @param measurements The [measurements()].
#' @param control List of options: `confidence` (c in `[2/N, 1]`: how firmly `noise_sd` is believed; default 2/N),
#'   `inclusion` (prior probability that a condition drives the discrepancy at all, 0.2), `amplitude` (scale of the
#'   half-Cauchy prior of the discrepancy's standard deviation if it does, in the target's unit; default the noise), `time_constants` (hours) of the filter bank, `error_times` (hours) and `error_ratios`
#'   (variance beside the white noise) of the autocorrelated error, `error_draws` (posterior draws kept
#'   for the discrepancy over time), and `ais`, a list for the sampler (`pilot_chains`, `groups`, `chains`, `sweeps`,
#'   `ess_drop`, `resample`, `importance_draws`, `max_components`).
#' @param seed Seed; if `NULL`, R's generator gives one.
#' @param threads Number of threads; the result does not depend on it.
#' @return An object of class `amiss_calibration`. Its `misfit` says how far the record lies from what any parameters give inside
#'   the simulation space, measured against the error seen in the part outside: `chi_squared`, the misfit at the best parameters,
#'   which has about `df` degrees of freedom if the model holds, one for each basis vector, or less, and `p`, the probability of
#'   such a misfit (both means over errors drawn from their posterior; `p` is `misfit_p` in `glance()`). Where `p` is small, the
#'   model lacks something or its emulator is off; then the parameters have taken values that partly hide it, and the evidence
#'   hangs on how many vectors the basis has. `print()` and reports say so below 0.001.
#' @export
calibrate <- function(emulator, measurements, control = NULL, seed = NULL, threads = 1) {
  rows <- emulated_rows(emulator, measurements)
  seed <- pick_seed(seed)
  threads <- check_threads(threads)
  control <- fill_calibration_control(control, measurements, length(rows))
  data <- history_data(emulator, measurements, rows, control)
  priors <- list(noise_sd = measurements$noise_sd, noise_shape = length(rows) * control$confidence,
                 inclusion = control$inclusion, amplitude = control$amplitude, correlation_times = control$error_times, ratios = control$error_ratios)

  result <- call_engine(calibrate_(data, priors, emulator$processes, control$ais, engine_context(seed, threads)))
  history <- result$history
  posterior <- result$posterior
  picked <- systematic_draws(posterior$weights, control$error_draws)
  errors <- list(setting = posterior$setting[picked], variance = posterior$variance[picked], t = posterior$t[picked, , drop = FALSE])
  structure(list(format_version = format_version, emulator = emulator, measurements = measurements, control = control,
                 seed = seed, rows = rows, values = unit_to_values(posterior$unit, emulator$parameters),
                 weights = posterior$weights, history = history, posterior = posterior, errors = errors, priors = priors,
                 coefficients = call_engine(history_coefficients_(data, priors, errors)),
                 centre = result$centre, scale = result$scale, null_setting = result$null_setting,
                 misfit = misfit_inside(result$misfits, ncol(data$basis)),
                 log_evidence = posterior$log_evidence, standard_error = posterior$standard_error,
                 interval = posterior$interval, trust = trust(history, posterior)), class = "amiss_calibration")
}

# The calibration rows, which must be those that the emulator was trained on.
emulated_rows <- function(emulator, measurements, call = rlang::caller_env()) {
  check_input(checkmate::check_class(emulator, "amiss_emulator"), "emulator", call = call)
  check_input(checkmate::check_class(measurements, "amiss_measurements"), "measurements", call = call)
  rows <- used_rows(measurements, "calibrate")
  if (nrow(emulator$basis$vectors) != length(rows)) {
    abort_input(c("The emulator was trained on {nrow(emulator$basis$vectors)} steps and the measurements have {length(rows)} calibration rows.",
                  i = "Train it on runs at exactly these rows."), call = call)
  }
  rows
}

fill_calibration_control <- function(control, measurements, n, call = rlang::caller_env()) {
  control <- merge_control(calibration_control, control, call = call)
  control$ais <- fill_ais_control(control$ais, "control$ais", call = call)
  step <- measurements$step_h
  if (is.null(control$confidence)) control["confidence"] <- 2 / n
  if (is.null(control$amplitude)) control["amplitude"] <- measurements$noise_sd
  if (is.null(control$time_constants)) {
    taus <- step * 2^(1:6)
    control[["time_constants"]] <- c(0, taus[taus <= n * step / 6])
  }
  if (is.null(control$error_times)) control[["error_times"]] <- c(2, 8) * step
  check_input(checkmate::check_number(control$confidence, lower = 2 / n - 1e-12, upper = 1), "control$confidence",
              "It lies between 2/N (hardly believed) and 1 (as firm as N values).", call = call)
  check_input(checkmate::check_number(control$inclusion, lower = 1e-6, upper = 1), "control$inclusion", call = call)
  check_input(checkmate::check_number(control$amplitude, lower = 1e-12, finite = TRUE), "control$amplitude", call = call)
  check_input(checkmate::check_numeric(control$time_constants, lower = 0, finite = TRUE, min.len = 1, any.missing = FALSE), "control$time_constants", call = call)
  check_input(checkmate::check_numeric(control$error_times, lower = 1e-12, finite = TRUE, any.missing = FALSE, max.len = 3), "control$error_times", call = call)
  check_input(checkmate::check_numeric(control$error_ratios, lower = 0, finite = TRUE, min.len = 1, any.missing = FALSE), "control$error_ratios", call = call)
  check_input(checkmate::check_count(control$error_draws, positive = TRUE), "control$error_draws", call = call)
  control
}

# Filter responses over the whole averaged record, so that each calibration row knows its history.
filter_responses <- function(measurements, time_constants) {
  all <- seq_along(measurements$y)
  filter_bank_(measurements$boundary, time_constants, measurements$hours, segment_starts(measurements, all))
}

history_data <- function(emulator, measurements, rows, control) {
  responses <- filter_responses(measurements, control$time_constants)
  list(y = measurements$y[rows], basis = emulator$basis$vectors, responses = responses[rows, , drop = FALSE],
       condition = rep(measurements$condition - 1L, each = length(control$time_constants)),
       time = measurements$hours[rows], new_segment = segment_starts(measurements, rows))
}

# n draws, each with equal weight, from weighted ones; deterministic.
systematic_draws <- function(weights, n) {
  findInterval((seq_len(n) - 0.5) / n, cumsum(weights / sum(weights)), left.open = TRUE) + 1L
}

misfit_inside <- function(misfits, vectors) {
  list(chi_squared = mean(misfits), df = vectors, p = mean(stats::pchisq(misfits, vectors, lower.tail = FALSE)))
}

misses_inside <- function(fit) isTRUE(fit$misfit$p < 0.001)

trust <- function(history, posterior) {
  why <- c(if (!history$trusted) paste("discrepancy:", history$verdict),
           if (!posterior$trusted) paste("parameters:", posterior$verdict))
  list(trusted = is.null(why), verdict = if (is.null(why)) posterior$verdict else paste(why, collapse = "; "))
}

#' @export
print.amiss_calibration <- function(x, ...) {
  cli::cli_text("{.strong Calibration} on {length(x$rows)} rows of {.val {x$measurements$name}}")
  cli::cli_text("log10 evidence {round(x$log_evidence / log(10), 2)} [{round(x$interval[1] / log(10), 2)}, {round(x$interval[2] / log(10), 2)}], {x$trust$verdict}")
  print(parameter_table(x), digits = 3, row.names = FALSE)
  if (misses_inside(x)) {
    cli::cli_bullets(c("!" = "no parameters reproduce the record, even in what the simulator can vary (chi-squared {signif(x$misfit$chi_squared, 2)}, {x$misfit$df} degrees of freedom): the model lacks something, or its emulator is off; do not trust the parameters"))
  }
  cli::cli_bullets(c(">" = "next: {.fun attribute_discrepancy}, {.fun discrepancy} or {.fun upgrade_model}"))
  invisible(x)
}

weighted_quantile <- function(x, w, probs) {
  order <- order(x)
  cumulative <- cumsum(w[order]) / sum(w)
  stats::approx(cumulative, x[order], probs, rule = 2, ties = "ordered")$y
}

parameter_table <- function(fit) {
  rows <- lapply(names(fit$emulator$parameters), function(n) {
    q <- weighted_quantile(fit$values[, n], fit$weights, c(0.5, 0.025, 0.975))
    data.frame(name = n, unit = fit$emulator$parameters[[n]]$unit, median = q[1], lower95 = q[2], upper95 = q[3])
  })
  do.call(rbind, rows)
}

#' @export
coef.amiss_calibration <- function(object, ...) {
  table <- parameter_table(object)
  stats::setNames(table$median, table$name)
}

#' @export
logLik.amiss_calibration <- function(object, ...) {
  structure(object$log_evidence, df = length(object$emulator$parameters), nobs = length(object$rows), class = "logLik")
}

#' @export
tidy.amiss_calibration <- function(x, ...) parameter_table(x)

#' @export
glance.amiss_calibration <- function(x, ...) {
  data.frame(log10_evidence = x$log_evidence / log(10), lower95 = x$interval[1] / log(10), upper95 = x$interval[2] / log(10),
             trusted = x$trust$trusted, misfit_p = x$misfit$p %||% NA_real_, n = length(x$rows), vectors = ncol(x$emulator$basis$vectors),
             runs = nrow(x$emulator$processes$inputs))
}
