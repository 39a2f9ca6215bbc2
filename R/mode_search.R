# Where the parameters lie, by the simulator itself: a Gauss-Newton search whose every step is the posterior under the
# line that touches the simulator there (tangent_posterior_), error and discrepancy as uncertain as the record leaves
# them. It needs no emulator, and a few runs for each parameter and step.

search_steps <- 20         # at most
search_gain <- 0.1         # nats, below which a step is the last
search_leaps <- 3          # at most
search_trial <- 4          # steps that each search is given
search_draws <- 8          # of error and discrepancy, by which a step is judged
search_difference <- 0.02  # of slopes, in standard deviations of the prior
search_damping <- c(0, 1, 10, 100, 1000, 1e4)
search_ais <- list(pilot_chains = 64, groups = 2, max_groups = 2, max_sweeps = 4, precision = 1, importance_draws = 300,
                   ess_drop = 0.3)

# list(modes, runs): what searches from several starts lead to, one after the other, their values by the draws of error
# and discrepancy of all of them, and the runs they took. A start at which the simulator fails, or from where error and
# discrepancy cannot be sampled, leads nowhere. `sets`: a calibration_setting() or a calibration of each record.
search_modes <- function(sets, starts, threads) {
  records <- searched_records(sets, threads)
  modes <- list()
  runs <- 0
  for (start in starts) {
    found <- tryCatch(search_mode(records, start, modes), amiss_error_numerical = function(e) NULL)
    if (is.null(found)) next
    runs <- runs + found$runs
    if (!found$given_up) modes <- c(modes, list(found))
  }
  list(modes = with_common_values(modes, records), runs = runs)
}

with_common_values <- function(modes, records) {
  outputs <- lapply(seq_along(records), function(k) {
    do.call(cbind, lapply(modes, function(mode) mode$outputs[[k]]))
  })
  each <- do.call(cbind, lapply(modes, function(mode) log_likelihoods(records, outputs, mode$tangents)))
  Map(function(mode, k) {
    mode$value <- log_mean_exp(each[k, ]) - 0.5 * sum(mode$centre^2)
    mode
  }, modes, seq_along(modes))
}

# The posterior's centre and covariance as the search from `start` sees them, in normal coordinates: list(centre,
# covariance, value, runs, given_up, and of each record the outputs at the centre and the tangent). Coordinates are
# those of joint_parameters(). Given up is what arrives at one of the modes `known` or, in the steps that are left to
# it, would not come near the best of them at the pace of its last.
search_mode <- function(records, start, known = list()) {
  best_known <- max(-Inf, vapply(known, `[[`, 0, "value"))
  # Seen from there and from here: one of the two alone may be vague.
  arrived <- function(x, covariance) {
    any(vapply(known, function(mode) {
      distance <- function(covariance) stats::mahalanobis(x, mode$centre, covariance)
      max(distance(mode$covariance), distance(covariance)) < length(x)
    }, NA))
  }
  made <- 0
  # Points that differ in nothing of a record's own are one run of it.
  runs_at <- function(x) lapply(records, function(record) {
    key <- apply(x[, record$own, drop = FALSE], 1, rlang::hash)
    apart <- !duplicated(key)
    made <<- made + sum(apart)
    record$run_at(x[apart, , drop = FALSE])[, match(key, key[apart]), drop = FALSE]
  })
  x <- as.numeric(start)
  outputs <- runs_at(matrix(x, 1))
  if (!all(is.finite(unlist(outputs)))) abort_numerical("The simulator failed where a search begins.")
  found <- NULL
  given_up <- FALSE
  leaps <- search_leaps
  for (step in seq_len(search_steps)) {
    seen <- tryCatch(search_step(records, x, outputs, runs_at), amiss_error_numerical = function(e) {
      if (is.null(found)) rlang::cnd_signal(e)
    })
    if (is.null(seen)) break
    best <- which.max(seen$values)
    value <- seen$values[best]
    gain <- value - seen$values[1]
    x <- seen$points[best, ]
    outputs <- columns(seen$outputs, best)
    if (is.null(found) || value > found$value) {
      found <- list(centre = x, covariance = seen$covariance, value = value, outputs = outputs,
                    tangents = seen$tangents)
    }
    if (seen$far < 0.5) break
    done <- !isTRUE(gain >= search_gain)
    if (leaps > 0 && seen$far > 2 * length(x) && (done || gain < seen$far / 20)) {
      # Along a curved ridge only short steps are better, or none, though the tangent sees its top: from there the next
      # tangents lead back to the ridge.
      leaps <- leaps - 1
      x <- seen$points[2, ]
      outputs <- columns(seen$outputs, 2)
      if (!all(is.finite(unlist(outputs)))) break
      next
    }
    if (done) break
    given_up <- arrived(x, seen$covariance) ||
      step >= search_trial && isTRUE(value + gain * (search_steps - step) < best_known - mode_depth)
    if (given_up) break
  }
  c(found, list(runs = made, given_up = given_up))
}

columns <- function(outputs, k) lapply(outputs, function(of_record) of_record[, k, drop = FALSE])

# What is seen from x: the points where a step could lead, x first, then the tangent's optimum and steps towards it that
# are damped more and more, with their outputs and values, and how far the optimum is off, in the tangent's covariance.
search_step <- function(records, x, outputs, runs_at) {
  p <- length(x)
  sides <- ifelse(x > 0, -search_difference, search_difference)  # towards the middle of the prior
  around <- runs_at(matrix(x, p, p, byrow = TRUE) + diag(sides, p, p))
  tangents <- Map(function(record, run, beside) record$tangent_at(x, run[, 1], beside, sides), records, outputs, around)
  tangent <- joint_tangent(tangents, lapply(records, `[[`, "own"), p)
  precision <- solve(tangent$covariance)
  move <- tangent$mean - x
  pulled <- precision %*% move
  damped <- lapply(search_damping, function(mu) x + as.numeric(solve(precision + diag(mu, p), pulled)))
  points <- do.call(rbind, c(list(x), damped))
  outputs <- Map(cbind, outputs, runs_at(points[-1, , drop = FALSE]))
  list(points = points, outputs = outputs, tangents = tangents, covariance = tangent$covariance,
       values = log_likelihoods(records, outputs, tangents) - 0.5 * rowSums(points^2), far = sum(move * pulled))
}

# Of points the log-likelihood of all records.
log_likelihoods <- function(records, outputs, tangents) {
  Reduce(`+`, Map(function(record, outputs, tangent) record$log_likelihood(outputs, tangent), records, outputs,
                  tangents))
}

log_mean_exp <- function(x) {
  top <- max(x)
  if (is.finite(top)) top + log(mean(exp(x - top))) else top
}

searched_records <- function(sets, threads) {
  lapply(sets, searched_record, all = names(joint_parameters(sets)), threads = threads)
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
    values[fine] <- apply(matrix(log_l, draws), 2, log_mean_exp)
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
