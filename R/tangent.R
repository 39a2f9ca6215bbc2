# The posterior under the tangent of a run, of all records together, with error and discrepancy.

search_ais <- list(pilot_chains = 64, groups = 2, max_groups = 2, max_sweeps = 4, precision = 1,
                   importance_draws = 300, ess_drop = 0.3)

# list(mean, covariance, history, moves) of the parameters under the tangent of run `at`: with draws
# of error and discrepancy of each record, which keeps out of `moves`.
tangent_at <- function(model, at, slopes, moves, context) {
  engine <- engine_context(context$seed, context$threads)
  z <- model$runs$z[at, ]
  each <- Map(function(record, own, rows) {
    ais <- fill_ais_control(utils::modifyList(record$control$ais, search_ais))
    steep <- unname(slopes[rows, own, drop = FALSE])
    out <- unname(moves[rows, own, drop = FALSE])
    call_engine(tangent_posterior_(c(record$data, list(moves = out)), record$priors, z[own],
                                   model$runs$outputs[rows, at], steep, rules$search_draws, ais,
                                   engine))
  }, model$records, model$own, model$rows)
  joint <- joint_tangent(each, model$own, length(z))
  list(mean = joint$mean, covariance = joint$covariance,
       history = lapply(unname(each), `[`, c("setting", "variance", "t")), moves = unname(moves))
}

# list(mean, covariance): where a Gauss-Newton step on values_of() leads along a line through z, for
# draws of error and discrepancy that are known, and the inverse of its curvature.
tangent_given <- function(model, z, output, slopes, history, moves, context) {
  engine <- engine_context(context$seed, context$threads)
  each <- Map(function(record, own, rows, history) {
    data <- c(record$data, list(moves = moves[rows, own, drop = FALSE]))
    call_engine(tangent_given_(data, record$priors, history, z[own], output[rows],
                               unname(slopes[rows, own, drop = FALSE]), engine))
  }, model$records, model$own, model$rows, history)
  joint_tangent(unname(each), model$own, length(z))
}

# log posterior density of runs, averaged over draws of error and discrepancy that keeps out of
# `moves`.
values_at <- function(model, at, history, moves, context) {
  values_of(model, model$runs$outputs[, at, drop = FALSE], model$runs$z[at, , drop = FALSE],
            history, moves, context)
}

values_of <- function(model, outputs, z, history, moves, context) {
  fine <- which(colSums(!is.finite(outputs)) == 0)
  values <- rep(-Inf, ncol(outputs))
  if (!length(fine)) return(values)
  each <- lapply(seq_along(model$records), function(k) {
    rows <- model$rows[[k]]
    draws <- length(history[[k]]$setting)
    repeated <- rep(seq_len(draws), length(fine))
    points <- list(setting = history[[k]]$setting[repeated],
                   variance = history[[k]]$variance[repeated],
                   t = history[[k]]$t[repeated, , drop = FALSE])
    data <- c(model$records[[k]]$data, list(moves = moves[rows, model$own[[k]], drop = FALSE]))
    log_l <- call_engine(run_likelihood_(data, model$records[[k]]$priors, points,
                                         outputs[rows, fine, drop = FALSE],
                                         engine_context(context$seed, context$threads)))
    apply(matrix(log_l, draws), 2, log_mean_exp)
  })
  values[fine] <- Reduce(`+`, each) - 0.5 * rowSums(z[fine, , drop = FALSE]^2)
  values
}

# The Gaussian that the tangents of several records make together of p parameters, whose prior N(0,
# I) each of them holds: precisions add up, that of the prior counted once.
joint_tangent <- function(tangents, own, p) {
  if (length(tangents) == 1) return(tangents[[1]])
  precision <- diag(p)
  pulled <- numeric(p)
  for (k in seq_along(tangents)) {
    of_record <- solve(conditioned(tangents[[k]]$covariance))
    at <- own[[k]]
    precision[at, at] <- precision[at, at] + of_record - diag(length(at))
    pulled[at] <- pulled[at] + of_record %*% tangents[[k]]$mean
  }
  covariance <- solve(precision)
  list(mean = as.numeric(covariance %*% pulled), covariance = covariance)
}
