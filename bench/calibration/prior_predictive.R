# One draw of all unknowns from their priors and of a record given them, from the models as they are
# written down (vignette "What the engine computes"), with explicit N x N matrices: nothing is
# shared with the engine but the emulator's prediction and the seed of the fictitious condition.

draw_precision <- function(n, priors)
  stats::rgamma(n, priors$noise_shape, priors$noise_shape * priors$noise_sd^2)

# sigma^2 of the history model.
draw_variance <- function(n, priors)
  priors$noise_sd^2 * stats::rf(n, 2 * priors$noise_shape, 2 * priors$noise_shape)

# Equations (5) and (6): the noise is drawn for each coefficient (or once for all), and again for
# the rest.
draw_paper <- function(world, control, fictitious) {
  m <- world$measurements
  k <- world$emulator$basis$vectors
  n <- nrow(k)
  priors <- list(noise_sd = m$noise_sd, noise_shape = n * control$confidence)
  unit <- stats::runif(length(world$emulator$parameters))
  w <- coefficients_at(world$emulator, unit)
  lambda <- draw_precision(if (control$shared_lambda) 1 else ncol(k), priors)
  coefficients <- stats::rnorm(ncol(k), w$mean, sqrt(w$variance + 1 / (lambda * colSums(k^2))))

  alpha <- stats::rbeta(length(m$conditions) + 1, control$alpha[1], control$alpha[2])
  t2 <- stats::rbeta(1, control$t2[1], control$t2[2])
  outside_lambda <- draw_precision(1, priors)
  covariance <- kernel_covariance(cbind(m$boundary, fictitious), c(m$condition, length(alpha)),
                                  alpha, t2)
  v <- stats::rnorm(n) %*% chol(covariance + diag(1 / outside_lambda, n))
  outside <- stats::lm.fit(k, as.numeric(v))$residuals
  list(y = as.numeric(k %*% coefficients) + outside,
       inside = c(stats::setNames(unit, names(world$emulator$parameters)),
                  stats::setNames(lambda, lambda_names(lambda))),
       outside = c(stats::setNames(alpha, alpha_names(m)), t2 = t2, lambda = outside_lambda))
}

lambda_names <- function(lambda)
  if (length(lambda) == 1) "lambda*" else sprintf("lambda*_%d", seq_along(lambda))
alpha_names <- function(m) sprintf("alpha(%s)", c(m$conditions, "fictitious"))

# zeta of (6): (1 - t2) / t2 prod_s alpha_s^(4 d_s^2), distances on the condition's own range.
kernel_covariance <- function(x, condition, alpha, t2) {
  zeta <- matrix((1 - t2) / t2, nrow(x), nrow(x))
  for (s in seq_along(alpha)) {
    own <- x[, condition == s, drop = FALSE]
    width <- max(apply(own, 2, function(column) diff(range(column))))
    for (j in seq_len(ncol(own)))
      zeta <- zeta * alpha[s]^(4 * (outer(own[, j], own[, j], "-") / width)^2)
  }
  zeta
}

# The history model: one sigma, one error setting and one reach for the whole record, the
# discrepancy in all directions.
draw_history <- function(world, control) {
  m <- world$measurements
  emulator <- world$emulator
  k <- emulator$basis$vectors
  n <- nrow(k)
  unit <- stats::runif(length(emulator$parameters))
  w <- coefficients_at(emulator, unit)
  variance <-
    draw_variance(1, list(noise_sd = m$noise_sd, noise_shape = n * control$confidence)) +
      mean(emulator$basis$discarded_sd^2)
  level <- sample(length(control$error_ratios), length(control$error_times), replace = TRUE)
  reach <- sample(length(control$reach), 1)
  included <- stats::runif(length(m$conditions)) < control$inclusion
  strength <- ifelse(included, (control$amplitude * stats::rcauchy(length(m$conditions)))^2, 0)

  error <- error_covariance(m$hours[m$use == "calibrate"], control$error_times,
                            control$error_ratios[level])
  phi <- standardised_responses(m, control$time_constants)
  coefficients <- stats::rnorm(ncol(phi$x), 0,
                               sqrt(strength[phi$condition] / length(control$time_constants)))
  response <- phi$x %*% coefficients
  if (is.finite(control$reach[reach])) {
    ratio <- k %*% world$spread %*% t(k) / (control$reach[reach] * m$noise_sd^2)
    response <- solve(diag(n) + ratio %*% ratio, response)
  }
  y <- k %*% stats::rnorm(ncol(k), w$mean, sqrt(w$variance)) + response +
    sqrt(variance) * crossprod(chol(error), stats::rnorm(n))
  truth <- c(variance = variance, stats::setNames(level, ratio_names(control)), reach = reach,
             stats::setNames(strength, t_names(m)))
  list(y = as.numeric(y), joint = c(stats::setNames(unit, names(emulator$parameters)), truth))
}

# Covariance of the emulated coefficients over the priors, by many points: how far the simulator can
# move.
simulator_spread <- function(emulator, points = 20000) {
  set.seed(1)
  w <- amiss:::emulated_coefficients(
    emulator, matrix(stats::runif(points * length(emulator$parameters)), points))
  stats::cov(w$mean) + diag(colMeans(w$variance), ncol(w$mean))
}

ratio_names <- function(control) sprintf("error ratio (%g h)", control$error_times)
t_names <- function(m) sprintf("t(%s)", m$conditions)

error_covariance <- function(hours, times, ratios) {
  distance <- abs(outer(hours, hours, "-"))
  Reduce(`+`, Map(function(time, ratio) ratio * exp(-distance / time), times, ratios),
         diag(length(hours)))
}

# First-order responses r' = (x - r) / tau to a condition that is held over each step, standardised.
standardised_responses <- function(m, time_constants) {
  response <- function(x, tau) {
    if (tau == 0) return(x)
    keep <- exp(-m$step_h / tau)
    as.numeric(stats::filter(x * (1 - keep), keep, method = "recursive", init = x[1]))
  }
  columns <- do.call(cbind, lapply(seq_len(ncol(m$boundary)), function(j) vapply(
    time_constants, function(tau) response(m$boundary[, j], tau), m$boundary[, j])))
  columns <- columns[m$use == "calibrate", , drop = FALSE]
  centred <- sweep(columns, 2, colMeans(columns))
  list(x = sweep(centred, 2, sqrt(colMeans(centred^2)), "/"),
       condition = rep(m$condition, each = length(time_constants)))
}
