# Least squares on a simulator itself, over the unit cube of its priors: how far parameters can
# adapt, and the best that a model can do on a record. Gauss-Newton steps within the cube (nlminb),
# from several starts.

inside_cube <- function(unit) pmin(pmax(unit, 1e-4), 1 - 1e-4)

#' @param error_at Function of a matrix of places in the cube, one a row, that returns their errors,
#'   one column each.
#' @param starts List of places in the cube.
#' @return unit, rms: the best place found and the RMS of its error.
least_squares_in_cube <- function(error_at, starts, iterations = 40) {
  search <- function(start) {
    start <- inside_cube(start)
    scale <- sum(error_at(t(start))^2)
    if (!is.finite(scale)) return(list(par = start, objective = Inf))
    if (scale == 0) return(list(par = start, objective = 0, scale = 1))
    seen <- list()
    at <- function(unit) {
      if (!identical(seen$unit, unit)) seen <<- list(unit = unit, error = error_at(t(unit))[, 1])
      seen
    }
    slopes <- function(unit) {
      own <- at(unit)
      if (is.null(own$slopes)) seen$slopes <<- cube_slopes(error_at, unit, own$error)
      seen$slopes
    }
    objective <- function(unit) {
      value <- sum(at(unit)$error^2) / scale
      if (is.finite(value)) value else 1e6
    }
    gradient <- function(unit) 2 * as.numeric(crossprod(slopes(unit), at(unit)$error)) / scale
    hessian <- function(unit) 2 * crossprod(slopes(unit)) / scale
    found <- stats::nlminb(start, objective, gradient, hessian, lower = 1e-4, upper = 1 - 1e-4,
                           control = list(iter.max = iterations, eval.max = 2 * iterations,
                                          rel.tol = 1e-6))
    c(found[c("par", "objective")], scale = scale)
  }
  tried <- lapply(starts, search)
  best <- tried[[which.min(vapply(tried, function(s) s$objective * s$scale, 0))]]
  list(unit = best$par, rms = sqrt(mean(error_at(t(best$par))^2)))
}

# One-sided differences, towards the middle of the cube.
cube_slopes <- function(error_at, unit, error, step = 1e-4) {
  d <- length(unit)
  step <- ifelse(unit > 0.5, -step, step)
  errors <- error_at(matrix(unit, d, d, byrow = TRUE) + diag(step, d))
  sweep(errors - error, 2, step, "/")
}

# Output at places in the cube, one a row; the simulator carries the length of its rows as `step`.
runs_in_cube <- function(simulator, unit, drivers) {
  values <- amiss:::unit_to_values(unit, amiss::free_parameters(simulator))
  amiss::simulate_runs(simulator, values, drivers, simulator$step)
}

# The simulator's parameters fitted to a series without noise at some rows of its drivers.
adapt_to <- function(simulator, series, drivers, rows, starts) {
  error_at <- function(unit)
    runs_in_cube(simulator, unit, drivers)[rows, , drop = FALSE] - series[rows]
  least_squares_in_cube(error_at, starts)
}

# The best RMSE in calibration that a simulator reaches on a record. Beside the middle of the cube
# and places drawn from it, the search starts from a place that is already known, if one is.
best_on_record <- function(simulator, measurements, seed, starts = 5, known = NULL) {
  parameters <- amiss::free_parameters(simulator)
  m <- measurements
  y <- m$y[m$use == "calibrate" & !is.na(m$y)]
  error_at <- function(unit) {
    amiss:::simulate_measured(simulator, amiss:::unit_to_values(unit, parameters), m, "calibrate",
                              1L) - y
  }
  drawn <- amiss:::with_seed(seed, lapply(seq_len(starts),
                                          function(i) stats::runif(length(parameters), 0.1, 0.9)))
  least_squares_in_cube(error_at, c(list(rep(0.5, length(parameters))), known, drawn))
}

# An effect hidden at a given strength: its RMS, once the base model's parameters have adapted by
# least squares, over the noise. As in worlds.R, its size gives way first; where the largest is
# still too small, the noise is lowered, to the least allowed. The noise then takes up what the
# search for the size left over.
#' @param effect_at Function of a size in (0, 1]: what the effect adds to the true output, at the
#'   rows of the drivers.
#' @param base,unit The base model and the place in its cube from which its parameters adapt.
#' @param noise,limits The noise that was drawn, and its least and largest value.
#' @param most RMS of the largest effect, from most_left().
#' @return size, effect, noise, achieved.
hide_effect <- function(effect_at, base, unit, drivers, rows, strength, noise, limits, most) {
  plain <- runs_in_cube(base, t(unit), drivers)[, 1]
  last <- unit
  rms_at <- function(size, starts = list(unit, last)) {
    fit <- adapt_to(base, plain + effect_at(size), drivers, rows, starts)
    last <<- fit$unit
    fit$rms
  }
  centre <- rep(0.5, length(unit))
  noise <- min(noise, max(limits[1], most / strength))
  wanted <- strength * noise
  size <- 1
  if (most > 1.01 * wanted) {
    # The RMS is nearly proportional to the size; a threshold may leave something of the smallest.
    over <- function(s) log(max(rms_at(exp(s)), 1e-12) / wanted)
    least <- log(1e-4)
    lower <- over(least)
    upper <- log(most / wanted)
    search <- function()
      stats::uniroot(over, c(least, 0), f.lower = lower, f.upper = upper, tol = 0.1)$root
    size <- exp(if (lower >= 0) least else search())
  }
  rms <- rms_at(size, list(unit, centre, last))
  noise <- min(max(rms / strength, limits[1]), limits[2])
  list(size = size, effect = effect_at(size), noise = noise, achieved = rms / noise)
}

# What the parameters leave of the largest effect. Worlds in which that is below the least noise
# that the wanted strength allows are drawn again, a few times, as nobody could tell them from
# worlds without an effect.
most_left <- function(effect_at, base, unit, drivers, rows) {
  plain <- runs_in_cube(base, t(unit), drivers)[, 1]
  adapt_to(base, plain + effect_at(1), drivers, rows, list(unit, rep(0.5, length(unit))))$rms
}

# Rows of a fine grid averaged to the models' step.
block_means <- function(x, width) {
  if (!is.null(dim(x))) return(apply(x, 2, block_means, width))
  .colMeans(x, width, length(x) / width)
}
