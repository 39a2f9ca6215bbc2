#' The discrepancy over time
#'
#' What the calibrated simulation leaves: the measurement less the simulation at the posterior mean of the
#' coefficients, and the part of it that answers to the boundary conditions, with a 95 % band.
#'
#' @param fit A calibration ([calibrate()]).
#' @return An object of class `amiss_discrepancy`: `series`, a data frame with the columns `time`, `observed`,
#'   `simulated`, `residual`, `discrepancy`, `lower95` and `upper95`; `responses`, one column for each condition.
#' @export
discrepancy <- function(fit) {
  check_input(checkmate::check_class(fit, "amiss_calibration"), "fit")
  data <- history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  outside <- function(x) as.matrix(stats::lm.fit(data$basis, x)$residuals)
  phi <- sweep(sweep(data$responses, 2, fit$centre), 2, fit$scale, "/")
  draws <- outside(phi %*% fit$coefficients)
  simulated <- simulated_mean(fit)
  responses <- condition_responses(fit, data)
  colnames(responses) <- fit$measurements$conditions
  m <- fit$measurements
  series <- data.frame(time = m$time[fit$rows], observed = m$y[fit$rows], simulated = simulated,
                       residual = m$y[fit$rows] - simulated, discrepancy = rowMeans(draws),
                       lower95 = apply(draws, 1, stats::quantile, 0.025), upper95 = apply(draws, 1, stats::quantile, 0.975))
  structure(list(format_version = format_version, series = series, responses = responses, segment = m$segment[fit$rows],
                 target = m$target, unit = m$unit), class = "amiss_discrepancy")
}

# Simulation at the posterior mean of the basis coefficients.
simulated_mean <- function(fit) {
  w <- predict_emulator_(fit$emulator$processes, fit$posterior$unit)$mean
  as.numeric(fit$emulator$basis$vectors %*% crossprod(w, fit$weights))
}

#' @export
fitted.amiss_calibration <- function(object, ...) simulated_mean(object)

#' @export
residuals.amiss_calibration <- function(object, ...) object$measurements$y[object$rows] - simulated_mean(object)

#' @export
print.amiss_discrepancy <- function(x, ...) {
  cli::cli_text("{.strong Discrepancy} of {.field {x$target}} over {nrow(x$series)} steps: residual RMS {signif(sqrt(mean(x$series$residual^2)), 3)} {x$unit}, of which {signif(sqrt(mean(x$series$discrepancy^2)), 3)} answers to boundary conditions")
  invisible(x)
}
