#' Slopes that a simulator can give itself
#'
#' Gives the slopes of the output with respect to the parameters, which a search needs. By
#' differences they cost a run for each parameter. A simulator that knows them (by its adjoint, by
#' forward differentiation) gives them by a method of this generic. Its searches then need no runs
#' for them. The default gives none.
#'
#' @inheritParams simulate_runs
#' @param values A matrix of one row, its columns the free parameters.
#' @return A matrix with a row for each row of the drivers and a column for each free parameter, or
#'   `NULL`. Slopes are in units of the output for a unit of the parameter.
#' @examples
#' slopes.my_linear <- function(simulator, values, drivers, step_h, hold = NULL, ...) {
#'   cbind(gain = drivers[, "Te"])
#' }
#' drivers <- cbind(Te = c(2, 3, 5))
#' slopes(structure(list(), class = "my_linear"), cbind(gain = 0.4), drivers, 1)
#' @export
slopes <- function(simulator, values, drivers, step_h, hold = NULL, ...) UseMethod("slopes")

#' @export
slopes.default <- function(simulator, values, drivers, step_h, hold = NULL, ...) NULL

# At the rows used in calibration (rows x parameters), averaged like the measurements; NULL if the
# simulator gives none.
measured_slopes <- function(simulator, values, measurements) {
  rows <- used_rows(measurements, "calibrate")
  out <- matrix(0, length(measurements$y), ncol(values), dimnames = list(NULL, colnames(values)))
  raw <- measurements$raw
  for (within in simulated_rows(measurements, rows)) {
    needed <- named_drivers(simulator)
    hold <- ifelse(raw$use[within] == "warmup", raw$y[within], NA_real_)
    fine <- slopes(simulator, values, raw$drivers[within, needed, drop = FALSE], raw$step_h, hold,
                   time = raw$time[within], segment = raw$segment[within[1]])
    if (is.null(fine)) return(NULL)
    check_named_columns(fine, "slopes", colnames(values))
    averaged <- block_means(fine[, colnames(values), drop = FALSE], measurements$block[within],
                            measurements$per_step)
    out[as.integer(rownames(averaged)), ] <- averaged
  }
  out[rows, , drop = FALSE]
}
