# Where the parameters lie, by the simulator itself: a Gauss-Newton search whose every step is the posterior under the
# line that touches the simulator there (tangent_posterior_), error and discrepancy as uncertain as the record leaves
# them. It needs no emulator, and a few runs for each parameter and step.

search_steps <- 20         # at most
search_gain <- 0.1         # nats, below which a step is the last
search_draws <- 8          # of error and discrepancy, by which a step is judged
search_difference <- 0.02  # of slopes, in standard deviations of the prior
search_damping <- c(0, 1, 10, 100, 1000, 1e4)
search_ais <- list(pilot_chains = 64, groups = 2, max_groups = 2, max_sweeps = 4, precision = 1, importance_draws = 300,
                   ess_drop = 0.3)

# The posterior's centre and covariance as the search from `start` sees them, in normal coordinates: list(centre,
# covariance, value, runs). `set`: calibration_setting(), or a calibration.
search_mode <- function(set, start, threads) {
  m <- set$measurements
  data <- history_data(set$emulator, m, set$rows, set$control)
  priors <- set$priors
  priors$discarded_variance <- 0
  ais <- fill_ais_control(utils::modifyList(set$control$ais, search_ais))
  context <- engine_context(set$seed, threads)
  made <- 0
  run_at <- function(x) {
    made <<- made + nrow(x)
    values <- unit_to_values(stats::pnorm(x), set$emulator$parameters)
    suppress_run_warnings(simulate_measured(set$emulator$simulator, values, m, "calibrate", threads))
  }
  # Log posterior density of points with their runs, error and discrepancy averaged over draws.
  value_of <- function(x, outputs, tangent) {
    draws <- length(tangent$setting)
    fine <- which(colSums(!is.finite(outputs)) == 0)
    values <- rep(-Inf, ncol(outputs))
    if (!length(fine)) return(values)
    each <- rep(seq_len(draws), length(fine))
    points <- list(setting = tangent$setting[each], variance = tangent$variance[each],
                   t = tangent$t[each, , drop = FALSE])
    log_l <- call_engine(run_likelihood_(data, priors, points, outputs[, rep(fine, each = draws), drop = FALSE],
                                         context))
    log_l <- matrix(log_l, draws)
    top <- apply(log_l, 2, max)
    values[fine] <- top + log(colMeans(exp(sweep(log_l, 2, top)))) - 0.5 * rowSums(x[fine, , drop = FALSE]^2)
    values
  }
  x <- start
  p <- length(x)
  run <- run_at(matrix(x, 1))[, 1]
  if (!all(is.finite(run))) abort_numerical("The simulator failed where a search begins.")
  for (step in seq_len(search_steps)) {
    sides <- ifelse(x > 0, -search_difference, search_difference)  # towards the middle of the prior
    around <- run_at(matrix(x, p, p, byrow = TRUE) + diag(sides, p, p))
    slopes <- sweep(around - run, 2, sides, "/")
    slopes[, colSums(!is.finite(slopes)) > 0] <- 0
    tangent <- call_engine(tangent_posterior_(data, priors, x, run, slopes, search_draws, ais, context))
    move <- tangent$mean - x
    far <- sum(move * solve(tangent$covariance, move))
    precision <- solve(tangent$covariance)
    pulled <- precision %*% move
    damped <- lapply(search_damping, function(mu) x + as.numeric(solve(precision + diag(mu, p), pulled)))
    points <- do.call(rbind, c(list(x), damped))
    outputs <- cbind(run, run_at(points[-1, , drop = FALSE]))
    values <- value_of(points, outputs, tangent)
    best <- which.max(values)
    gain <- values[best] - values[1]
    if (best == 1) break
    x <- points[best, ]
    run <- outputs[, best]
    if (far < 0.5 || isTRUE(gain < search_gain)) break
  }
  list(centre = x, covariance = tangent$covariance, value = max(values), runs = made)
}
