# Regions of the parameters' space: where the posterior lies, in the coordinates in which the priors
# are N(0, I). An emulator of runs in such a region, along its axes, needs few of them; NULL stands
# for everywhere.

# `uniform`: which parameters have flat priors (is_flat()), in whose probabilities and not in normal
# coordinates they are linear.
new_region <- function(centre, root, radius, parameters) {
  list(centre = centre, root = root, radius = radius, uniform = are_flat(parameters))
}

# The straightened coordinates s of the engine's Region in those of coordinates.R: the point z at s
# = c, and dz/ds there. Of a flat prior s is linear in z, of any other it is the normal quantile.
straightened <- function(region, space) {
  spread <- sqrt(1 + rowSums(region$root^2))
  side <- stats::pnorm(region$centre / spread)
  slope <- stats::dnorm(region$centre / spread) / spread
  z <- from_unit(rbind(stats::pnorm(region$centre)), space)[1, ]
  list(z = ifelse(region$uniform, 2 * flat_limit * (side - 0.5), z),
       slope = ifelse(region$uniform, 2 * flat_limit * slope, per_normal(z, space)))
}

# Of points z (one a row), how far they lie from the centre of a region in its straightened
# coordinates, along its axes (one a column).
along_axes <- function(region, space, z) {
  straight <- straightened(region, space)
  apart <- t(to_normal(to_unit(z, space))) - region$centre
  flat <- region$uniform
  apart[flat, ] <- (t(z[, flat, drop = FALSE]) - straight$z[flat]) / straight$slope[flat]
  forwardsolve(region$root, apart)
}

# The ellipsoid that holds a posterior, wider by `growth` if that is not trusted.
posterior_region <- function(fit, growth = 1) {
  region_of_draws(posterior_unit(fit), fit$weights, fit$emulator$parameters, growth)
}

# The ellipsoid that holds weighted draws in the unit cube. Tails that they do not show are allowed
# for by their number and by the radius.
region_of_draws <- function(unit, weights, parameters, growth = 1) {
  z <- to_normal(unit)
  w <- weights / sum(weights)
  centre <- colSums(w * z)
  apart <- sweep(z, 2, centre)
  covariance <- crossprod(apart * sqrt(w)) / (1 - sum(w^2))
  # Fewer draws know less of the correlations.
  shrinkage <- ncol(z) / (ncol(z) + 1 / sum(w^2))
  covariance <- (1 - shrinkage) * covariance + shrinkage * diag(diag(covariance), ncol(z)) +
    diag(1e-10, ncol(z))
  root <- growth * t(chol(covariance))
  distance <- sqrt(colSums(forwardsolve(root, t(apart))^2))
  held <- rules$region_quantile
  farthest <- max(sqrt(stats::qchisq(held, ncol(z))), weighted_quantile(distance, w, held))
  new_region(centre, root, rules$region_margin * farthest, parameters)
}

# The region as the parameters `own` see it.
region_part <- function(region, own) {
  if (identical(own, seq_along(region$centre))) return(region)
  covariance <- tcrossprod(region$root)[own, own, drop = FALSE]
  region$centre <- region$centre[own]
  region$root <- t(chol(covariance))
  region$uniform <- region$uniform[own]
  region
}

# Of points of the unit cube (one a row), how far out they lie: 1 is where the region ends.
region_distance <- function(region, unit) {
  if (is.null(region)) return(numeric(nrow(unit)))
  sqrt(colSums(forwardsolve(region$root, t(to_normal(unit)) - region$centre)^2)) / region$radius
}

in_region <- function(region, unit) region_distance(region, unit) <= 1

in_border <- function(region, unit) region_distance(region, unit) > 1 - rules$border_width

# n points of the unit cube for the emulator of a region: a Latin hypercube of directions and
# distances from the centre. Spread evenly over the volume they would nearly all lie at its end: of
# seven parameters one run in a hundred would lie as near to the centre as the posterior does.
region_design <- function(region, n, seed) {
  p <- length(region$centre)
  u <- with_seed(seed, lhs::randomLHS(n, p + 1))
  x <- stats::qnorm(u[, seq_len(p), drop = FALSE])
  x <- x * (region$radius * u[, p + 1] / sqrt(rowSums(x^2)))
  stats::pnorm(sweep(tcrossprod(x, region$root), 2, region$centre, "+"))
}
