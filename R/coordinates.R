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

# Of normal coordinates x.
from_normal <- function(x, flat) {
  z <- x
  z[, flat] <- 2 * flat_limit * (stats::pnorm(x[, flat]) - 0.5)
  z
}

# The most probable point of N(mean, precision^-1) between -limit and limit: one coordinate after
# the other, each at its best given the others.
within_limits <- function(mean, precision, limit) {
  z <- pmin(pmax(mean, -limit), limit)
  for (sweep in 1:200) {
    before <- z
    for (j in seq_along(z)) {
      step <- sum(precision[j, ] * (z - mean)) / precision[j, j]
      z[j] <- min(max(z[j] - step, -limit[j]), limit[j])
    }
    if (max(abs(z - before)) < 1e-6) break
  }
  z
}

# n draws of the same distribution, by Gibbs sampling from its most probable point.
draws_within <- function(mean, covariance, limit, n, seed) {
  precision <- solve(covariance)
  sd <- 1 / sqrt(diag(precision))
  p <- length(mean)
  burn <- 50
  uniform <- with_seed(seed, matrix(stats::runif((n + burn) * p), n + burn))
  z <- within_limits(mean, precision, limit)
  draws <- matrix(0, n + burn, p)
  for (i in seq_len(n + burn)) {
    for (j in seq_len(p)) {
      centre <- z[j] - sum(precision[j, ] * (z - mean)) / precision[j, j]
      z[j] <- truncated_quantile(uniform[i, j], centre, sd[j], limit[j])
    }
    draws[i, ] <- z
  }
  draws[-seq_len(burn), , drop = FALSE]
}

# Quantile of N(centre, sd^2) between -limit and limit. Far outside, where the normal distribution
# function is lost to rounding, the density falls exponentially from the nearer end.
truncated_quantile <- function(u, centre, sd, limit) {
  ends <- stats::pnorm(c(-limit, limit), centre, sd)
  if (diff(ends) > 1e-10) {
    return(min(max(stats::qnorm(ends[1] + u * diff(ends), centre, sd), -limit), limit))
  }
  beyond <- abs(centre) - limit
  sign(centre) * max(limit + log1p(-u * (1 - exp(-2 * limit * beyond / sd^2))) * sd^2 / beyond, -limit)
}
