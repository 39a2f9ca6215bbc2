# Coordinates z of the parameters in which a simulator is most nearly linear: of a flat prior the
# place between its ends, from -sqrt(3) to sqrt(3), so that its variance is 1; of any other the
# normal quantile of the distribution before it is cut at its limits, where z ends too. A prior with
# ends seen in normal quantiles of its own bends every simulator there: the last thousandth of its
# range would be as long as all the rest.

flat_limit <- sqrt(3)

# Uniform, or so wide that its limits are all that is left of it.
is_flat <- function(prior) {
  if (prior$family == "uniform") return(TRUE)
  if (!is.finite(prior$lower) || !is.finite(prior$upper)) return(FALSE)
  switch(prior$family, normal = (prior$upper - prior$lower) < prior$parameters$sd,
         lognormal = prior$lower > 0 && log(prior$upper / prior$lower) < prior$parameters$sdlog,
         FALSE)
}

are_flat <- function(parameters) {
  vapply(parameters, function(p) is_flat(p$prior), NA, USE.NAMES = FALSE)
}

# The coordinates of parameters, one a row: whether the prior is `flat`; of any other the
# probability `below` and `within` its limits before it was cut; and where z ends, `lower` and
# `upper`.
coordinates_of <- function(parameters) {
  flat <- are_flat(parameters)
  cut <- vapply(parameters, function(p) untruncated_cdf(p$prior, c(p$prior$lower, p$prior$upper)),
                numeric(2))
  space <- data.frame(flat, below = ifelse(flat, 0, cut[1, ]),
                      within = ifelse(flat, 1, cut[2, ] - cut[1, ]))
  ends <- stats::pnorm(c(-1, 1) * rules$farthest)
  space$lower <- ifelse(flat, -flat_limit, stats::qnorm(space$below + ends[1] * space$within))
  space$upper <- ifelse(flat, flat_limit, stats::qnorm(space$below + ends[2] * space$within))
  space
}

# Points in the unit cube (one a row) in these coordinates, and back.
from_unit <- function(unit, space) {
  n <- nrow(unit)
  z <- to_normal(rep(space$below, each = n) +
                   rep(space$within, each = n) * pmin(pmax(unit, 1e-15), 1 - 1e-15))
  dim(z) <- dim(unit)
  z[, space$flat] <- 2 * flat_limit * (unit[, space$flat] - 0.5)
  z
}

to_unit <- function(z, space) {
  n <- nrow(z)
  unit <- (stats::pnorm(z) - rep(space$below, each = n)) / rep(space$within, each = n)
  unit[, space$flat] <- z[, space$flat] / (2 * flat_limit) + 0.5
  pmin(pmax(unit, 0), 1)
}

# dz/dx, x the normal quantile in a prior with its limits: 0 at its ends, beyond which nothing can
# move. `z`: one of each parameter, or several of one.
per_normal <- function(z, space) {
  space <- space[rep_len(seq_len(nrow(space)), length(z)), ]
  x <- stats::qnorm(as.numeric(to_unit(rbind(z), space)))
  ifelse(space$flat, 2 * flat_limit * stats::dnorm(x),
         ifelse(is.finite(x), space$within * exp((z^2 - x^2) / 2), 0))
}

# The most probable point of N(mean, precision^-1) between `lower` and `upper`, by an active set: of
# the coordinates held at an end that one is let go from which the density rises fastest inwards;
# the others go to their best, or to the first end in their way.
within_limits <- function(mean, precision, space) {
  lower <- space$lower
  upper <- space$upper
  z <- pmin(pmax(mean, lower), upper)
  held <- z <= lower | z >= upper
  for (try in seq_len(20 * length(z))) {
    if (any(!held)) {
      pull <- -as.numeric(precision[!held, , drop = FALSE] %*% (z - mean))
      step <- solve(precision[!held, !held, drop = FALSE], pull)
      end <- lower
      end[!held][step > 0] <- upper[!held][step > 0]
      room <- (end[!held] - z[!held]) / step
      room[step == 0] <- Inf
      z[!held] <- z[!held] + min(1, room) * step
      if (min(room) < 1) {
        held[which(!held)[which.min(room)]] <- TRUE
        next
      }
    }
    outwards <- 2 * (z >= upper) - 1
    inwards <- held * as.numeric(precision %*% (z - mean)) * outwards
    if (max(inwards) < 1e-9) break
    held[which.max(inwards)] <- FALSE
  }
  pmin(pmax(z, lower), upper)
}

# n draws of the same distribution, from its most probable point.
draws_within <- function(mean, covariance, space, n, seed) {
  start <- within_limits(mean, solve(conditioned(covariance)), space)
  draws_within_(mean, covariance, space$lower, space$upper, start, n, seed)
}

# A covariance that double precision can invert. A record of little noise may know one direction ten
# million times better than another.
conditioned <- function(covariance) {
  if (rcond(covariance) >= 1e-14) return(covariance)
  covariance + diag(1e-13 * max(diag(covariance)), nrow(covariance))
}

log_mean_exp <- function(x) {
  top <- max(x)
  if (is.finite(top)) top + log(mean(exp(x - top))) else top
}
