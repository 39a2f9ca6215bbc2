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

# n draws of the same distribution, by hit and run from the most probable point: along the axes, so that it leaves a
# corner of the limits, and along random directions, equal in all of them once the covariance is taken out, so that a
# narrow ridge does not slow it.
draws_within <- function(mean, covariance, limit, n, seed) {
  p <- length(mean)
  root <- t(chol(covariance))
  z <- within_limits(mean, solve(covariance), limit)
  white <- forwardsolve(root, z - mean)
  axes <- forwardsolve(root, diag(p))
  moves <- (n + burn_in) * 2 * p
  random <- with_seed(seed, list(direction = matrix(stats::rnorm(moves * p / 2), p), u = stats::runif(moves)))
  draws <- matrix(0, n + burn_in, p)
  for (i in seq_len(moves)) {
    direction <- if (i %% 2) axes[, (i %/% 2) %% p + 1] else random$direction[, i / 2]
    direction <- direction / sqrt(sum(direction^2))
    way <- as.numeric(root %*% direction)
    ends <- rbind((-limit - z) / way, (limit - z) / way)
    lower <- max(pmin(ends[1, ], ends[2, ]), -Inf, na.rm = TRUE)
    upper <- min(pmax(ends[1, ], ends[2, ]), Inf, na.rm = TRUE)
    step <- truncated_quantile(random$u[i], -sum(white * direction), 1, min(lower, 0), max(upper, 0))
    z <- pmin(pmax(z + step * way, -limit), limit)
    white <- white + step * direction
    if (i %% (2 * p) == 0) draws[i / (2 * p), ] <- z
  }
  draws[-seq_len(burn_in), , drop = FALSE]
}

burn_in <- 50  # draws that the first point is forgotten in

# Quantile of N(centre, sd^2) between two ends: by logarithms of probabilities outside them, and where R's quantile of
# those is exact to few digits, by the exponential that the density there is.
truncated_quantile <- function(u, centre, sd, lower, upper) {
  ends <- stats::pnorm(c(lower, upper), centre, sd)
  if (diff(ends) > 1e-10) {
    return(min(max(stats::qnorm(ends[1] + u * diff(ends), centre, sd), lower), upper))
  }
  if (centre < lower) return(-truncated_quantile(1 - u, -centre, sd, -upper, -lower))
  beyond <- (centre - upper) / sd
  if (beyond < 30) {
    log_p <- stats::pnorm(c(lower, upper), centre, sd, log.p = TRUE)
    within <- log_p[2] + log(u + (1 - u) * exp(log_p[1] - log_p[2]))
    return(min(max(stats::qnorm(within, centre, sd, log.p = TRUE), lower), upper))
  }
  inwards <- -log1p(-(1 - u) * (1 - exp(-(upper - lower) * beyond / sd))) * sd / beyond
  max(upper - inwards, lower)
}
