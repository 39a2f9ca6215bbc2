# Regions of the parameters' space: where the posterior lies, in the coordinates in which the priors are N(0, I). An
# emulator of runs in such a region, along its axes, needs few of them; NULL stands for everywhere.

# The ellipsoid that holds a posterior: list(centre, root, radius). Tails that the draws do not show are allowed for by
# their number, by the radius, and by `growth` where the posterior reached the end of the region it was sought in.
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
  list(centre = centre, root = root,
       radius = 1.1 * max(sqrt(stats::qchisq(0.999, ncol(z))), weighted_quantile(distance, w, 0.999)))
}

wider_region <- function(region) {
  region$root <- 1.5 * region$root
  region
}

# The ellipsoid that holds what search_mode() found from several starts: modes as good as the best, or places along a
# ridge. `own`: the coordinates that are asked for.
region_of_modes <- function(modes, own) {
  value <- vapply(modes, `[[`, 0, "value")
  modes <- modes[value > max(value) - 10]
  centres <- do.call(rbind, lapply(modes, function(mode) mode$centre[own]))
  centre <- colMeans(centres)
  covariance <- Reduce(`+`, lapply(modes, function(mode) mode$covariance[own, own, drop = FALSE])) / length(modes) +
    crossprod(sweep(centres, 2, centre)) / length(modes)
  list(centre = centre, root = t(chol(covariance)), radius = 1.1 * sqrt(stats::qchisq(0.999, length(centre))))
}

# Of points of the unit cube (one a row), how far out they lie: 1 is where the region ends.
region_distance <- function(region, unit) {
  if (is.null(region)) return(numeric(nrow(unit)))
  sqrt(colSums(forwardsolve(region$root, t(to_normal(unit)) - region$centre)^2)) / region$radius
}

in_region <- function(region, unit) region_distance(region, unit) <= 1

# Inputs of the emulator's processes, as the engine has them.
region_inputs <- function(region, unit) {
  if (is.null(region)) return(unit)
  0.5 + t(forwardsolve(region$root, t(to_normal(unit)) - region$centre)) / (2 * region$radius)
}

# n points of the unit cube, spread evenly over the region: a Latin hypercube of directions and distances.
region_design <- function(region, n, seed) {
  p <- length(region$centre)
  u <- with_seed(seed, lhs::randomLHS(n, p + 1))
  x <- stats::qnorm(u[, seq_len(p), drop = FALSE])
  x <- x * (region$radius * u[, p + 1]^(1 / p) / sqrt(rowSums(x^2)))
  stats::pnorm(sweep(tcrossprod(x, region$root), 2, region$centre, "+"))
}
