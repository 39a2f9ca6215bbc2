# Regions of the parameters' space: where the posterior lies, in the coordinates in which the priors are N(0, I). An
# emulator of runs in such a region, along its axes, needs few of them; NULL stands for everywhere.

# `uniform`: which parameters have uniform priors, in whose probabilities and not in normal coordinates they are linear.
new_region <- function(centre, root, radius, parameters) {
  uniform <- vapply(parameters, function(p) p$prior$family == "uniform", NA, USE.NAMES = FALSE)
  list(centre = centre, root = root, radius = radius, uniform = uniform)
}

# The ellipsoid that holds a posterior. Tails that the draws do not show are allowed for by their number, by the radius,
# and by `growth` where the posterior is not trusted.
posterior_region <- function(fit, growth = 1) {
  z <- to_normal(posterior_unit(fit))
  w <- fit$weights / sum(fit$weights)
  centre <- colSums(w * z)
  apart <- sweep(z, 2, centre)
  covariance <- crossprod(apart * sqrt(w)) / (1 - sum(w^2))
  # Fewer draws know less of the correlations.
  shrinkage <- ncol(z) / (ncol(z) + 1 / sum(w^2))
  covariance <- (1 - shrinkage) * covariance + shrinkage * diag(diag(covariance), ncol(z)) + diag(1e-10, ncol(z))
  root <- growth * t(chol(covariance))
  distance <- sqrt(colSums(forwardsolve(root, t(apart))^2))
  new_region(centre, root, 1.1 * max(sqrt(stats::qchisq(0.999, ncol(z))), weighted_quantile(distance, w, 0.999)),
             fit$emulator$parameters)
}

wider_region <- function(region) {
  region$root <- 1.5 * region$root
  region
}

mode_depth <- 10  # nats below the best mode from which another does not count

# The ellipsoid that holds what search_modes() found from several starts: modes as good as the best, or places along a
# ridge. `parameters`: those that are asked for, at `own` among the coordinates.
region_of_modes <- function(modes, parameters, own) {
  value <- vapply(modes, `[[`, 0, "value")
  modes <- modes[value > max(value) - mode_depth]
  centres <- do.call(rbind, lapply(modes, function(mode) mode$centre[own]))
  centre <- colMeans(centres)
  covariance <- Reduce(`+`, lapply(modes, function(mode) mode$covariance[own, own, drop = FALSE])) / length(modes) +
    crossprod(sweep(centres, 2, centre)) / length(modes)
  new_region(centre, t(chol(covariance)), 1.1 * sqrt(stats::qchisq(0.999, length(centre))), parameters)
}

# Of points of the unit cube (one a row), how far out they lie: 1 is where the region ends.
region_distance <- function(region, unit) {
  if (is.null(region)) return(numeric(nrow(unit)))
  sqrt(colSums(forwardsolve(region$root, t(to_normal(unit)) - region$centre)^2)) / region$radius
}

in_region <- function(region, unit) region_distance(region, unit) <= 1

# n points of the unit cube for the emulator of a region: a Latin hypercube of directions and distances from the centre.
# Spread evenly over the volume they would nearly all lie at its end: of seven parameters one run in a hundred would lie
# as near to the centre as the posterior does.
region_design <- function(region, n, seed) {
  p <- length(region$centre)
  u <- with_seed(seed, lhs::randomLHS(n, p + 1))
  x <- stats::qnorm(u[, seq_len(p), drop = FALSE])
  x <- x * (region$radius * u[, p + 1] / sqrt(rowSums(x^2)))
  stats::pnorm(sweep(tcrossprod(x, region$root), 2, region$centre, "+"))
}
