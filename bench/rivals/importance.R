# Evidence without an emulator, with 50 (P + 2) runs a model: a search for the mode, then importance
# sampling around it. Parameters and phi of the AR(1) errors (autoregressive.R) have independent
# standard normal coordinates z; s^2 is integrated with the density 1 / s^2, which gives
#   log L(z) = -n / 2 log SS(z) + constant.
# The proposal is a t distribution of five degrees of freedom at the mode, with the inverse of
#   n J'J / SS + I
# as its matrix, J the slopes of the whitened errors.

runs_of_model <- function(p) 50 * (p + 2)

fit_importance <- function(simulator, from, m, seed) {
  errors <- whitened_errors(simulator, m)
  p <- length(errors$parameters)
  d <- p + 1
  at <- function(z) errors$at(stats::pnorm(z))
  log_density <- function(z, error) {
    -errors$n / 2 * log(colSums(error^2)) - rowSums(z^2) / 2 - d / 2 * log(2 * pi)
  }
  phi <- if (is.null(from)) 0.5 else from$phi_unit
  starts <- lapply(starts_from(errors$parameters, from, seed)[1:2], function(start) {
    stats::qnorm(inside_cube(c(start, phi)))
  })
  searched <- lapply(starts, climb, at, log_density, errors, runs_of_model(p) / 4)
  best <- searched[[which.max(vapply(searched, `[[`, 0, "value"))]]
  draws <- max(20, runs_of_model(p) - errors$runs())
  root <- chol(best$precision)
  z <- amiss:::with_seed(seed, {
    normal <- matrix(stats::rnorm(draws * d), d)
    sweep(backsolve(root, normal), 2, sqrt(5 / stats::rchisq(draws, 5)), "*")
  })
  distance <- colSums((root %*% z)^2)
  log_proposal <- lgamma((5 + d) / 2) - lgamma(5 / 2) - d / 2 * log(5 * pi) +
    sum(log(diag(root))) - (5 + d) / 2 * log1p(distance / 5)
  z <- t(z + best$z)
  z[] <- pmin(pmax(z, -8), 8)
  log_weight <- log_density(z, at(z)) - log_proposal
  log_weight[!is.finite(log_weight)] <- -Inf
  top <- max(log_weight)
  weight <- exp(log_weight - top)
  unit <- stats::setNames(stats::pnorm(best$z[seq_len(p)]), names(errors$parameters))
  list(unit = unit, phi_unit = stats::pnorm(best$z[d]),
       values = amiss:::unit_to_values(t(unname(unit)), errors$parameters)[1, ],
       log10_evidence = (top + log(mean(weight))) / log(10),
       effective = sum(weight)^2 / sum(weight^2), runs = errors$runs())
}

# Steps of Gauss and Newton with a damping that grows if they fail, until they gain little or the
# runs are used up.
climb <- function(z, at, log_density, errors, most_runs) {
  begun <- errors$runs()
  d <- length(z)
  error <- at(t(z))
  value <- log_density(t(z), error)
  damping <- 1e-3
  precision <- diag(d)
  repeat {
    step <- ifelse(z > 0, -1e-3, 1e-3)
    slopes <- sweep(at(matrix(z, d, d, byrow = TRUE) + diag(step, d)) - c(error), 2, step, "/")
    precision <- errors$n / sum(error^2) * crossprod(slopes) + diag(d)
    gradient <- -errors$n / sum(error^2) * crossprod(slopes, error)[, 1] - z
    gain <- 0
    while (damping < 1e6) {
      move <- solve(precision + damping * diag(diag(precision)), gradient)
      next_z <- pmin(pmax(z + move, -5), 5)
      next_error <- at(t(next_z))
      next_value <- log_density(t(next_z), next_error)
      if (is.finite(next_value) && next_value > value) {
        gain <- next_value - value
        z <- next_z
        error <- next_error
        value <- next_value
        damping <- damping / 10
        break
      }
      damping <- 10 * max(damping, 1e-4)
    }
    if (gain < 0.01 || errors$runs() - begun + d + 1 > most_runs) break
  }
  list(z = z, value = value, precision = precision)
}

# The mechanism with the highest evidence, if it is decisive.
most_evident <- function(decades = 2) function(fits, present) {
  evidence <- vapply(fits, `[[`, 0, "log10_evidence")
  if (max(evidence) > present$log10_evidence + decades) which.max(evidence)
}
