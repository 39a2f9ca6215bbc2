# The evidences of (5) and (6) against bridge sampling (Meng and Wong 1996; package bridgesampling).
# Its input: draws of equal weight from the package's posterior, in coordinates x ~ N(0, I) before
# the data, and the log posterior written down anew with dense matrices.

log_normal <- function(y, mean, covariance) {
  root <- chol(covariance)
  -sum(log(diag(root))) - 0.5 * sum(backsolve(root, y - mean, transpose = TRUE)^2) -
    0.5 * length(y) * log(2 * pi)
}

# (5): w* = (K'K)^-1 K'y, with |K'K|^(-1/2).
log_posterior_inside <- function(x, data) {
  unit <- seq_along(data$world$emulator$parameters)
  lambda <- stats::qgamma(stats::pnorm(x[-unit]), data$priors$noise_shape,
                          data$priors$noise_shape * data$priors$noise_sd^2)
  w <- coefficients_at(data$world$emulator, stats::pnorm(x[unit]))
  k <- data$world$emulator$basis$vectors
  norms <- colSums(k^2)
  seen <- crossprod(k, data$y) / norms
  sum(stats::dnorm(x, log = TRUE)) - 0.5 * sum(log(norms)) +
    sum(stats::dnorm(seen, w$mean, sqrt(w$variance + 1 / (lambda * norms)), log = TRUE))
}

# (6): H'y ~ N(0, H'AH) with an explicit complement H.
log_posterior_outside <- function(x, data) {
  m <- data$world$measurements
  s <- length(m$conditions) + 1
  u <- stats::pnorm(x)
  lambda <- stats::qgamma(u[s + 2], data$priors$noise_shape,
                          data$priors$noise_shape * data$priors$noise_sd^2)
  zeta <- kernel_covariance(data$x, c(m$condition, s), u[seq_len(s)], u[s + 1])
  sum(stats::dnorm(x, log = TRUE)) +
    log_normal(data$v, 0, crossprod(data$h, (zeta + diag(1 / lambda, nrow(zeta))) %*% data$h))
}

bridge <- function(draws, weights, log_posterior, data, size = 400) {
  draws <- draws[sample(length(weights), size, replace = TRUE, prob = weights), , drop = FALSE]
  colnames(draws) <- paste0("x", seq_len(ncol(draws)))
  limits <- stats::setNames(rep(Inf, ncol(draws)), colnames(draws))
  result <- bridgesampling::bridge_sampler(draws, log_posterior = log_posterior, data = data,
                                           lb = -limits, ub = limits, use_neff = FALSE,
                                           silent = TRUE)
  c(log_evidence = result$logml, standard_error = sqrt(bridgesampling::error_measures(result)$re2))
}

# The package's evidence and bridge sampling's for one record, both parts. alpha is uniform here: of
# Beta(1, 0.1), half lies above 0.999, and a quantity so close to 1 does not come back from R as the
# coordinate it was.
bridge_one <- function(world, seed) {
  control <- list(alpha = c(1, 1), ais = sbc_ais)
  full <- amiss:::fill_paper_control(control, sbc_steps)
  fictitious <- amiss:::fictitious_condition_(sbc_steps, full$fictitious_seed)
  set.seed(seed)
  y <- draw_paper(world, full, fictitious)$y
  m <- observed(world$measurements, y)
  fit <- amiss::calibrate_paper(world$emulator, m, control, seed = seed)
  shape <- fit$priors$noise_shape
  z_lambda <- function(lambda) stats::qnorm(stats::pgamma(lambda, shape, shape * m$noise_sd^2))
  h <- fit$hyperparameters
  complement <- qr.Q(qr(world$emulator$basis$vectors),
                     complete = TRUE)[, -seq_len(ncol(world$emulator$basis$vectors))]
  data <- list(world = world, y = y, priors = fit$priors, h = complement,
               v = crossprod(complement, y), x = cbind(m$boundary, fictitious))
  inside <- bridge(cbind(stats::qnorm(fit$posterior$unit), z_lambda(fit$lambda)), fit$weights,
                   log_posterior_inside, data)
  outside <- bridge(cbind(stats::qnorm(h$alpha), stats::qnorm(h$t2), z_lambda(h$lambda)), h$weights,
                    log_posterior_outside, data)
  own <- fit$evidence[1:2, ]
  data.frame(part = c("posterior (5)", "posterior (6)"), amiss = own$log_evidence,
             amiss_error = own$standard_error, bridge = c(inside[[1]], outside[[1]]),
             bridge_error = c(inside[[2]], outside[[2]]))
}

# Differences over their errors, squared and added over the records: chi-square.
bridge_rows <- function(world, first, records = 10) {
  all <- do.call(rbind,
                 lapply(first + 5e4 + seq_len(records), function(seed) bridge_one(world, seed)))
  z <- (all$amiss - all$bridge) / sqrt(all$amiss_error^2 + all$bridge_error^2)
  rows <- data.frame(case = "evidence against bridge sampling", quantity = unique(all$part),
                     draws = records)
  rows$p_value <- vapply(
    rows$quantity,
    function(part) stats::pchisq(sum(z[all$part == part]^2), records, lower.tail = FALSE), 0)
  rows$largest <- vapply(rows$quantity,
                         function(part) max(abs(all$amiss - all$bridge)[all$part == part]), 0)
  rows$error <- vapply(
    rows$quantity,
    function(part) max(sqrt(all$amiss_error^2 + all$bridge_error^2)[all$part == part]), 0)
  rows
}
