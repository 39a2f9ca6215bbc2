# The noise of the averages and how it came about: given, standard error or bootstrap; RMS over the
# calibration steps.
noise_level <- function(noise_sd, coarse, y, call = rlang::caller_env()) {
  if (identical(noise_sd, "bootstrap")) noise_sd <- bootstrap_noise()
  if (is.numeric(noise_sd)) {
    check_input(checkmate::check_number(noise_sd, finite = TRUE), "noise_sd", call = call)
    if (noise_sd <= 0) abort_input("{.arg noise_sd} must be positive; got {noise_sd}.", call = call)
    if (noise_sd < 1e-75 || noise_sd > 1e75) {
      abort_input(c("{.arg noise_sd} is {noise_sd}: only 1e-75 to 1e75 can be computed with.",
                    i = "Give the target in another unit."), call = call)
    }
    return(list(sd = as.numeric(noise_sd), method = "given"))
  }
  if (!is.null(noise_sd) && !inherits(noise_sd, "amiss_bootstrap_noise")) {
    quoted <- if (is.character(noise_sd)) paste0(" ", dQuote(noise_sd[1], FALSE))
    abort_input(c(paste("{.arg noise_sd} is neither a number nor a way to estimate one; got",
                        "{.cls {class(noise_sd)}}{quoted}."),
                  i = "Give a number, {.val bootstrap} or {.fun bootstrap_noise}."), call = call)
  }
  needed <- if (is.null(noise_sd) || noise_sd$detrend) 3 else 2
  if (coarse$per_step < needed) {
    few <- if (coarse$per_step == 1) "the data are not averaged"
           else paste("an average is of", coarse$per_step, "readings only")
    abort_input(c(paste("{.arg noise_sd} is needed as a number: {few}, so that their scatter",
                        "within a step is unknown."),
                  i = paste("Give the standard deviation of the measurement error in the target's",
                            "unit, or an {.arg average} over at least {needed} readings.")),
                call = call)
  }
  noise <- if (is.null(noise_sd)) list(method = "standard error", per_step = coarse$standard_error)
           else bootstrap_averages(y, coarse, noise_sd)
  sd <- sqrt(mean(noise$per_step[coarse$use == "calibrate"]^2, na.rm = TRUE))
  if (!is.finite(sd) || sd <= 0) {
    abort_input(c(paste("The readings do not scatter within the averages ({noise$method}:",
                        "{signif(sd, 3)}), so that {.arg noise_sd} cannot be estimated from them."),
                  i = "Give the standard deviation of the measurement error."), call = call)
  }
  c(list(sd = sd), noise)
}

#' Noise of averages, by bootstrapping the readings
#'
#' Estimates the noise of averages, as `noise_sd` of [measurements()], which must `average`.
#'
#' The readings inside each averaging window are drawn again with replacement. The standard
#' deviation of the means of these draws is the noise of that average. The RMS over the calibration
#' steps is the noise of the record. As the number of replicates grows, the plain bootstrap tends to
#' `sqrt((n - 1) / n) * s / sqrt(n)` for n readings of standard deviation `s`.
#'
#' # What is taken for noise
#'
#' What changes inside a window counts as noise: a trend of `d` per reading adds `d^2 (n^2 - 1) /
#' 12` to `s^2 (n - 1) / n`. `detrend` takes a straight line off each window first and bootstraps
#' the residuals. They are raised by `sqrt(n / (n - 2))` for the two degrees of freedom that the
#' line uses. Neither a trend nor the line then biases the variance.
#'
#' Either way the readings' errors are taken as independent. What they have in common over a window,
#' like an offset of the sensor, is not seen. The noise is then larger than the estimate.
#'
#' @param replicates Number of bootstrap draws of each window.
#' @param detrend Take a straight line off each window first; the paper does not.
#' @param seed Seed of the draws.
#' @return An object of class `amiss_bootstrap_noise`.
#' @examples
#' table <- data.frame(hour = seq(0.1, 24, 0.1), Te = 5 + sin(1:240 / 20))
#' table$Ti <- 20 + sin(1:240 / 20) + 0.1 * sin(61 * (1:240)^2)
#' measurements(table, time = "hour", target = "Ti", boundary = ~Te, average = 1,
#'              noise_sd = bootstrap_noise(detrend = TRUE))
#' @source Efron (1979), Bootstrap methods: another look at the jackknife, Annals of Statistics 7,
#'   1-26; for averages of raw data in this method: Monari (2022). Residuals: Davison and Hinkley
#'   (1997), Bootstrap methods and their application.
#' @export
bootstrap_noise <- function(replicates = 1000, detrend = FALSE, seed = 1) {
  check_arguments()
  check_input(checkmate::check_int(replicates, lower = 0, upper = 1e6), "replicates")
  if (replicates < 50) abort_input(paste("{.arg replicates} = {replicates} is too few for a",
                                         "standard deviation; give at least 50."))
  check_input(checkmate::check_flag(detrend), "detrend")
  structure(list(replicates = as.integer(replicates), detrend = detrend, seed = pick_seed(seed)),
            class = "amiss_bootstrap_noise")
}

# Standard deviation of the bootstrapped mean of each window; NA where a reading is missing.
bootstrap_averages <- function(y, coarse, options) {
  windows <- matrix(y[!is.na(coarse$block)], coarse$per_step)
  n <- nrow(windows)
  if (options$detrend) {
    line <- qr(cbind(1, seq_len(n)))
    complete <- !is.na(colSums(windows))
    windows[, complete] <- qr.resid(line, windows[, complete, drop = FALSE]) * sqrt(n / (n - 2))
  }
  per_step <- with_seed(options$seed, apply(windows, 2, function(readings) {
    drawn <- sample.int(n, n * options$replicates, replace = TRUE)
    if (anyNA(readings)) NA else stats::sd(colMeans(matrix(readings[drawn], n)))
  }))
  c(list(method = if (options$detrend) "bootstrap of detrended readings"
                  else "bootstrap of readings", per_step = per_step, readings = n),
    unclass(options))
}
