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
# covariance, value, runs). `sets`: a calibration_setting() or a calibration of each record. Coordinates are those of
# joint_parameters().
search_mode <- function(sets, start, threads) {
  records <- lapply(sets, searched_record, all = names(joint_parameters(sets)), threads = threads)
  made <- 0
  # Points that differ in nothing of a record's own are one run of it.
  runs_at <- function(x) lapply(records, function(record) {
    key <- apply(x[, record$own, drop = FALSE], 1, rlang::hash)
    apart <- !duplicated(key)
    made <<- made + sum(apart)
    record$run_at(x[apart, , drop = FALSE])[, match(key, key[apart]), drop = FALSE]
  })
  x <- as.numeric(start)
  p <- length(x)
  runs <- lapply(runs_at(matrix(x, 1)), function(outputs) outputs[, 1])
  if (!all(is.finite(unlist(runs)))) abort_numerical("The simulator failed where a search begins.")
  for (step in seq_len(search_steps)) {
    sides <- ifelse(x > 0, -search_difference, search_difference)  # towards the middle of the prior
    around <- runs_at(matrix(x, p, p, byrow = TRUE) + diag(sides, p, p))
    tangents <- Map(function(record, run, outputs) record$tangent_at(x, run, outputs, sides), records, runs, around)
    tangent <- joint_tangent(tangents, lapply(records, `[[`, "own"), p)
    move <- tangent$mean - x
    far <- sum(move * solve(tangent$covariance, move))
    precision <- solve(tangent$covariance)
    pulled <- precision %*% move
    damped <- lapply(search_damping, function(mu) x + as.numeric(solve(precision + diag(mu, p), pulled)))
    points <- do.call(rbind, c(list(x), damped))
    outputs <- Map(cbind, runs, runs_at(points[-1, , drop = FALSE]))
    log_l <- Reduce(`+`, Map(function(record, tangent, outputs) record$log_likelihood(outputs, tangent), records,
                             tangents, outputs))
    values <- log_l - 0.5 * rowSums(points^2)
    best <- which.max(values)
    gain <- values[best] - values[1]
    if (best == 1) break
    x <- points[best, ]
    runs <- lapply(outputs, function(outputs) outputs[, best])
    if (far < 0.5 || isTRUE(gain < search_gain)) break
  }
  list(centre = x, covariance = tangent$covariance, value = max(values), runs = made)
}

# One record of a search: which of `all` parameters are its own, its runs at points of all, its tangent there, and its
# log-likelihood of runs, error and discrepancy averaged over the tangent's draws.
searched_record <- function(set, all, threads) {
  m <- set$measurements
  own <- match(names(set$emulator$parameters), all)
  data <- history_data(set$emulator, m, set$rows, set$control)
  priors <- set$priors
  priors$discarded_variance <- 0
  ais <- fill_ais_control(utils::modifyList(set$control$ais, search_ais))
  context <- engine_context(set$seed, threads)
  run_at <- function(x) {
    values <- unit_to_values(stats::pnorm(x[, own, drop = FALSE]), set$emulator$parameters)
    suppress_run_warnings(simulate_measured(set$emulator$simulator, values, m, "calibrate", threads))
  }
  tangent_at <- function(x, run, around, sides) {
    slopes <- sweep(around[, own, drop = FALSE] - run, 2, sides[own], "/")
    slopes[, colSums(!is.finite(slopes)) > 0] <- 0
    call_engine(tangent_posterior_(data, priors, x[own], run, slopes, search_draws, ais, context))
  }
  log_likelihood <- function(outputs, tangent) {
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
    values[fine] <- top + log(colMeans(exp(sweep(log_l, 2, top))))
    values
  }
  list(own = own, run_at = run_at, tangent_at = tangent_at, log_likelihood = log_likelihood)
}

# The Gaussian that the tangents of several records make together of p parameters, whose prior N(0, I) each of them
# holds: precisions add up, that of the prior counted once.
joint_tangent <- function(tangents, own, p) {
  if (length(tangents) == 1) return(tangents[[1]])
  precision <- diag(p)
  pulled <- numeric(p)
  for (k in seq_along(tangents)) {
    of_record <- solve(tangents[[k]]$covariance)
    at <- own[[k]]
    precision[at, at] <- precision[at, at] + of_record - diag(length(at))
    pulled[at] <- pulled[at] + of_record %*% tangents[[k]]$mean
  }
  covariance <- solve(precision)
  list(mean = as.numeric(covariance %*% pulled), covariance = covariance)
}

# The parameters of records that share those of the same name.
joint_parameters <- function(fits) {
  all <- do.call(c, lapply(unname(fits), function(fit) fit$emulator$parameters))
  all[!duplicated(names(all))]
}
