# Where the parameters lie, by the simulator itself. Each step goes to the posterior under the line
# that touches the simulator there; each run corrects the slopes of that line (a secant condition, as
# in Broyden 1965), so that a step costs one run.

search_ais <- list(pilot_chains = 64, groups = 2, max_groups = 2, max_sweeps = 4, precision = 1,
                   importance_draws = 300, ess_drop = 0.3)

# A search from run `at` of a model. `slopes` are right at that run to within what they change over
# `stale` standard deviations of the prior. `off`: the run at which the mechanism of a trial is switched off; the search
# ends if all that it promises beyond that could not make evidence.
begin_search <- function(model, at, slopes, stale, steps = rules$search_steps, off = NULL) {
  search <- list(model = model, at = at, steps = steps, off = off, leaps = rules$leaps, left = integer(), step = 0,
                 damping = 0, failed = 0, small = 0,
                 reference = list(z = model$runs$z[at, ], slopes = slopes, stale = stale),
                 status = "going")
  search$slopes <- secant_slopes(model, at, search$reference)
  search
}

run_search <- function(search, context) {
  while (!finished(search)) {
    search <- propose(search, context)
    if (finished(search)) break
    made <- with_runs(search$model, rbind(search$proposal), context)
    search$model <- made$model
    search <- accept(search, made$at, context)
    if (search$failed == rules$renew_after && !finished(search)) {
      search <- renew_slopes(search, context)
    }
  }
  if (is.null(search$history)) search <- look(search, context)
  return_to_best(search, context)
}

finished <- function(search) search$status != "going"

# The posterior under the tangent, with error and discrepancy sampled anew if they may have changed.
look <- function(search, context) {
  if (is.null(search$history)) {
    search[c("mean", "covariance", "history")] <-
      tangent_at(search$model, search$at, search$slopes, NULL, context)
  } else {
    search[c("mean", "covariance")] <-
      tangent_at(search$model, search$at, search$slopes, search$history, context)[1:2]
  }
  search
}

propose <- function(search, context) {
  search <- look(search, context)
  z <- search$model$runs$z[search$at, ]
  precision <- solve(search$covariance)
  damped <- precision + diag(search$damping, length(z))
  target <- solve(damped, precision %*% search$mean + search$damping * z)[, 1]
  search$proposal <- within_limits(target, damped, search$model$limit)
  gain_of <- function(to) sum((to - z) * (precision %*% (to - z))) / 2
  search$predicted <- gain_of(search$proposal)
  search$promised <- gain_of(within_limits(search$mean, precision, search$model$limit))
  if (is_futile(search, context)) search$status <- "futile"
  if (search$step >= search$steps) search$status <- "steps"
  if (search$promised < rules$search_gain / 5) search$status <- "converged"
  search
}

is_futile <- function(search, context) {
  if (is.null(search$off)) return(FALSE)
  value <- values_at(search$model, c(search$at, search$off), search$history, search$slopes, context)
  isTRUE(value[1] + search$promised - value[2] < rules$futile_gain)
}

# The step is taken if the run is more probable, by the draws of error and discrepancy from before it.
accept <- function(search, made, context) {
  if (!length(made)) {
    search$status <- "budget"
    return(search)
  }
  search$step <- search$step + 1
  value <- values_at(search$model, c(search$at, made), search$history, search$slopes, context)
  gain <- value[2] - value[1]
  better <- isTRUE(gain > 0)
  if (search$leaps > 0 && is_ridge(search, gain)) return(leap(search, made))
  near <- search$promised < rules$search_gain && (!better || gain < rules$search_gain)
  search$small <- if (near) search$small + 1 else 0
  if (better) {
    search$at <- made
    search$failed <- 0
    if (gain > search$predicted / 4) search$damping <- search$damping / 10
    if (search$damping < 1) search$damping <- 0
    if (gain > rules$resample_gain) search["history"] <- list(NULL)
  } else {
    search$failed <- search$failed + 1
    search$damping <- max(1, 10 * search$damping)
  }
  search$slopes <- secant_slopes(search$model, search$at, search$reference)
  search$gains <- c(search$gains, max(0, gain, na.rm = TRUE))
  if (search$small >= 2) search$status <- "converged"
  if (sum(utils::tail(search$gains, rules$pace)) < 1 && length(search$gains) >= rules$pace) search$status <- "slow"
  if (search$failed >= rules$stalled_after) search$status <- "stalled"
  search
}

# Along a curved ridge only short steps are better, or none, though the tangent sees far. Then the search goes
# on from the optimum of the tangent: from there the next ones lead back to the ridge, farther along it.
is_ridge <- function(search, gain) {
  p <- length(search$proposal)
  search$promised > p && search$damping <= rules$ridge_damping && !isTRUE(gain > search$promised / 10)
}

leap <- function(search, made) {
  fine <- succeeded(search$model)[made]
  if (!fine) return(utils::modifyList(search, list(leaps = 0, damping = max(1, 10 * search$damping))))
  search$left <- c(search$left, search$at)
  search$at <- made
  search$leaps <- search$leaps - 1
  search["gains"] <- list(NULL)
  search$damping <- 0
  search$failed <- search$small <- 0
  search["history"] <- list(NULL)
  search$slopes <- secant_slopes(search$model, made, search$reference)
  search
}

# The best of where a search ended and of the places that it leapt from.
return_to_best <- function(search, context) {
  if (!length(search$left)) return(search)
  ends <- c(search$at, search$left)
  value <- values_at(search$model, ends, search$history, search$slopes, context)
  if (which.max(value) == 1) return(search)
  search$at <- ends[which.max(value)]
  search$slopes <- secant_slopes(search$model, search$at, search$reference)
  search["history"] <- list(NULL)
  look(search, context)
}

renew_slopes <- function(search, context) {
  found <- difference_slopes(search$model, search$at, context)
  search$model <- found$model
  if (is.null(found$slopes)) return(search)
  search$reference <- list(z = search$model$runs$z[search$at, ], slopes = found$slopes, stale = 0)
  search$slopes <- found$slopes
  search["history"] <- list(NULL)
  search["gains"] <- list(NULL)
  search$damping <- 0
  search
}

# Slopes by differences, on the same side wherever the priors allow it; where a small one shows nothing, by larger
# ones on both sides: list(model, slopes), no slopes if the budget ends.
difference_slopes <- function(model, at, context) {
  z <- model$runs$z[at, ]
  known <- given_slopes(model, z)
  if (!is.null(known)) return(list(model = model, slopes = known))
  seen <- function(model, step) {
    points <- matrix(z, length(step), length(z), byrow = TRUE)
    points[cbind(seq_along(step), match(names(step), names(z)))] <- z[names(step)] + step
    made <- with_runs(model, points, context)
    if (length(made$at) < length(step)) return(list(model = made$model))
    change <- made$model$runs$outputs[, made$at, drop = FALSE] - made$model$runs$outputs[, at]
    slopes <- sweep(change, 2, step, "/")
    slopes[, colSums(!is.finite(slopes)) > 0] <- 0
    list(model = made$model, slopes = slopes)
  }
  asked <- names(z)
  side <- difference_side(z)
  found <- seen(model, rules$search_difference * side)
  if (is.null(found$slopes)) return(found)
  flat <- asked[colSums(found$slopes^2) == 0]
  if (!length(flat)) return(found)
  up <- seen(found$model, rules$wide_difference * side[flat])
  down <- seen(up$model, -rules$wide_difference * side[flat])
  if (is.null(up$slopes) || is.null(down$slopes)) return(list(model = down$model))
  found$slopes[, match(flat, asked)] <- (up$slopes + down$slopes) / 2
  list(model = down$model, slopes = found$slopes)
}

# Those that the simulators give themselves, for a unit of z; NULL unless all do.
given_slopes <- function(model, z) {
  unit <- to_unit(rbind(z), model$flat)
  by <- 1e-4
  ends <- lapply(c(-by, by), function(step) to_unit(rbind(z + step), model$flat))
  slopes <- matrix(0, length(model$target), length(z), dimnames = list(NULL, names(z)))
  for (k in seq_along(model$simulators)) {
    own <- model$own[[k]]
    parameters <- model$parameters[own]
    value <- function(unit) unit_to_values(unit[, own, drop = FALSE], parameters)
    seen <- measured_slopes(model$simulators[[k]], value(unit), model$records[[k]]$measurements)
    if (is.null(seen)) return(NULL)
    way <- from_unit(ends[[2]], model$flat) - from_unit(ends[[1]], model$flat)
    per_z <- as.numeric(value(ends[[2]]) - value(ends[[1]])) / way[, own]
    slopes[model$rows[[k]], own] <- sweep(seen, 2, per_z, "*")
  }
  slopes
}

difference_side <- function(z) ifelse(z > 1, -1, 1)

# Slopes at a run from reference slopes, corrected by the runs near it. With s_i the way to run i and
# r_i what the reference misses of it,
#     J = J0 + R W S (S'W S + I / d^2)^-1,   w_i = |s_i|^-4.
# A simulator bends by c |s|^2 over a way s, so that run i knows its slope to within c |s_i|, and the
# reference slopes are known to within c d, d the way from where they were right: c cancels.
secant_slopes <- function(model, at, reference) {
  z <- model$runs$z[at, ]
  ways <- sweep(model$runs$z, 2, z)
  squared <- rowSums(ways^2)
  near <- which(succeeded(model) & squared > 1e-8)
  near <- utils::head(near[order(squared[near])], 3 * length(z))
  d2 <- sum((z - reference$z)^2) + reference$stale^2
  if (!length(near) || d2 == 0) return(reference$slopes)
  ways <- ways[near, , drop = FALSE]
  weights <- 1 / pmax(squared[near], 1e-4)^2
  missed <- model$runs$outputs[, near, drop = FALSE] - model$runs$outputs[, at] -
    tcrossprod(reference$slopes, ways)
  reference$slopes +
    missed %*% (weights * ways) %*%
    solve(crossprod(ways * sqrt(weights)) + diag(1 / d2, length(z)))
}

# Slopes about a run by regression on all runs over the priors, nearer ones weighing more.
regression_slopes <- function(model, at) {
  ways <- sweep(model$runs$z, 2, model$runs$z[at, ])
  fine <- succeeded(model)
  x <- cbind(1, ways)[fine, , drop = FALSE]
  weights <- 1 / (0.5 + rowSums(ways^2)[fine])
  penalty <- diag(c(0, rep(0.02, ncol(ways))), ncol(x))
  coefficients <- solve(crossprod(x * sqrt(weights)) + penalty,
                        crossprod(x * weights, t(model$runs$outputs[, fine, drop = FALSE])))
  t(coefficients[-1, , drop = FALSE])
}

# ---- of all records together

# list(mean, covariance, history) of the parameters under the tangent of run `at`; `history`: draws of
# error and discrepancy of each record, sampled if they are not given.
tangent_at <- function(model, at, slopes, history, context) {
  z <- model$runs$z[at, ]
  engine <- engine_context(context$seed, context$threads)
  each <- lapply(seq_along(model$records), function(k) {
    record <- model$records[[k]]
    own <- model$own[[k]]
    run <- model$runs$outputs[model$rows[[k]], at]
    steep <- unname(slopes[model$rows[[k]], own, drop = FALSE])
    data <- c(record$data, list(moves = steep))
    if (!is.null(history)) {
      return(call_engine(tangent_given_(data, record$priors, history[[k]], z[own], run, steep, engine)))
    }
    ais <- fill_ais_control(utils::modifyList(record$control$ais, search_ais))
    call_engine(tangent_posterior_(data, record$priors, z[own], run, steep, rules$search_draws, ais,
                                   engine))
  })
  joint <- joint_tangent(each, model$own, length(z))
  list(mean = joint$mean, covariance = joint$covariance,
       history = history %||% lapply(each, `[`, c("setting", "variance", "t")))
}

# log posterior density of runs, averaged over draws of error and discrepancy.
values_at <- function(model, at, history, slopes, context) {
  values_of(model, model$runs$outputs[, at, drop = FALSE], model$runs$z[at, , drop = FALSE], history,
            slopes, context)
}

values_of <- function(model, outputs, z, history, slopes, context) {
  fine <- which(colSums(!is.finite(outputs)) == 0)
  values <- rep(-Inf, ncol(outputs))
  if (!length(fine)) return(values)
  each <- lapply(seq_along(model$records), function(k) {
    rows <- model$rows[[k]]
    draws <- length(history[[k]]$setting)
    repeated <- rep(seq_len(draws), length(fine))
    points <- list(setting = history[[k]]$setting[repeated], variance = history[[k]]$variance[repeated],
                   t = history[[k]]$t[repeated, , drop = FALSE])
    data <- c(model$records[[k]]$data,
              list(moves = unname(slopes[rows, model$own[[k]], drop = FALSE])))
    log_l <- call_engine(run_likelihood_(data, model$records[[k]]$priors, points,
                                         outputs[rows, rep(fine, each = draws), drop = FALSE],
                                         engine_context(context$seed, context$threads)))
    apply(matrix(log_l, draws), 2, log_mean_exp)
  })
  values[fine] <- Reduce(`+`, each) - 0.5 * rowSums(z[fine, , drop = FALSE]^2)
  values
}

log_mean_exp <- function(x) {
  top <- max(x)
  if (is.finite(top)) top + log(mean(exp(x - top))) else top
}

# The Gaussian that the tangents of several records make together of p parameters, whose prior N(0, I)
# each of them holds: precisions add up, that of the prior counted once.
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
