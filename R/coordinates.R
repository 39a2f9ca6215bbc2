# Coordinates z of the parameters in which a simulator is most nearly linear, each with mean 0 and
# variance 1 before the data: of a flat prior the place between its ends, from -sqrt(3) to sqrt(3);
# of any other the normal quantile. A flat prior seen in normal quantiles bends every simulator at
# its ends.

flat_limit <- sqrt(3)

# Uniform, or so wide in its logarithm that its limits are all that is left of it.
is_flat <- function(prior) {
  prior$family == "uniform" ||
    (prior$family == "lognormal" && is.finite(prior$upper) && prior$lower > 0 &&
       log(prior$upper / prior$lower) < prior$parameters$sdlog)
}

are_flat <- function(parameters) {
  vapply(parameters, function(p) is_flat(p$prior), NA, USE.NAMES = FALSE)
}

# Points in the unit cube (one a row) in these coordinates, and back.
from_unit <- function(unit, flat) {
  z <- to_normal(unit)
  z[, flat] <- 2 * flat_limit * (unit[, flat] - 0.5)
  z
}

to_unit <- function(z, flat) {
  unit <- stats::pnorm(z)
  unit[, flat] <- z[, flat] / (2 * flat_limit) + 0.5
  pmin(pmax(unit, 0), 1)
}

# dz/dx, x the normal quantile: 0 at the ends of a flat prior, beyond which nothing can move.
per_normal <- function(z, flat) {
  slope <- rep(1, length(z))
  side <- pmin(pmax(z[flat] / (2 * flat_limit) + 0.5, 0), 1)
  slope[flat] <- 2 * flat_limit * stats::dnorm(stats::qnorm(side))
  slope
}

# The most probable point of N(mean, precision^-1) between -limit and limit, by an active set: of the coordinates held
# at an end that one is let go from which the density rises fastest inwards; the others go to their best, or to the
# first end in their way.
within_limits <- function(mean, precision, limit) {
  z <- pmin(pmax(mean, -limit), limit)
  held <- abs(z) >= limit
  for (try in seq_len(20 * length(z))) {
    if (any(!held)) {
      pull <- -as.numeric(precision[!held, , drop = FALSE] %*% (z - mean))
      step <- solve(precision[!held, !held, drop = FALSE], pull)
      room <- ifelse(step == 0, Inf, (sign(step) * limit[!held] - z[!held]) / step)
      z[!held] <- z[!held] + min(1, room) * step
      if (min(room) < 1) {
        held[which(!held)[which.min(room)]] <- TRUE
        next
      }
    }
    inwards <- ifelse(held, as.numeric(precision %*% (z - mean)) * sign(z), 0)
    if (max(inwards) < 1e-9) break
    held[which.max(inwards)] <- FALSE
  }
  pmin(pmax(z, -limit), limit)
}

# n draws of the same distribution, from its most probable point.
draws_within <- function(mean, covariance, limit, n, seed) {
  start <- within_limits(mean, solve(covariance), limit)
  draws_within_(mean, covariance, rep_len(limit, length(mean)), start, n, seed)
}

log_mean_exp <- function(x) {
  top <- max(x)
  if (is.finite(top)) top + log(mean(exp(x - top))) else top
}
