# From a mode to a posterior: an emulator in the region of the mode, with the simulator's tangent as its
# mean; the posterior under it; and runs at its draws, which first check the emulator and then train it.

# How precisely the sampler works: to see where a posterior lies, and for a result.
verified_ais <- list(pilot_chains = 200, groups = 6, max_groups = 8, max_sweeps = 12, precision = 0.2,
                     gradient = FALSE)
rough_ais <- list(pilot_chains = 128, groups = 2, max_groups = 4, max_sweeps = 8, precision = 0.5,
                  gradient = FALSE, importance_draws = 0)

# What the search knows, for the region: the run that the tangent touches and its slopes.
with_mode <- function(model, search, region) {
  model$tangent <- list(at = search$at, slopes = search$slopes)
  model$region <- region
  model
}

# Runs that fill the region, as many as are missing from `least` in it.
with_local_runs <- function(model, least, context) {
  inside <- sum(succeeded(model) & straight_distance(model) <= 1)
  n <- least - inside
  if (n <= 0) return(model)
  seed <- context$seed + nrow(model$runs$z)  # each time others
  unit <- region_design(model$region, n, seed)
  with_runs(model, from_unit(unit, model$flat), context)$model
}

least_local <- function(model) {
  max(model$local %||% rules$local_runs, rules$local_parameter * length(model$parameters))
}

# Of its runs, how far out they lie in the straightened coordinates of the region: 1 is where it ends.
# A run at the end of a flat prior, infinitely far in normal coordinates, is near in these.
straight_distance <- function(model) {
  straight <- straightened(model$region)
  apart <- (t(model$runs$z) - straight$z) / straight$slope
  sqrt(colSums(forwardsolve(model$region$root, apart)^2)) / model$region$radius
}

# The posterior of the model by the runs there are. Where it reaches the end of its region, the region
# follows it. list(model, fits): the region it ended with, and a calibration of each record.
posterior_of <- function(model, context, ais = NULL, border = rules$border_intervals) {
  for (try in seq_len(rules$region_tries)) {
    fits <- fits_in_region(model, context, ais)
    outside <- border_share(model, fits)
    if (outside <= rules$border) model <- with_draws(model, fits)
    if (outside <= border || try == rules$region_tries) break
    model$region <- region_of_draws(joint_unit(model, fits), fits[[1]]$weights, model$parameters,
                                    growth = if (outside > 0.2) 1.5 else 1.2)
  }
  list(model = model, fits = fits)
}

# The model with the region of its posterior, and draws of it. Those of the round before count as well: what the
# discrepancy keeps out of moves the posterior, which moves that again.
following <- function(found) {
  model <- with_draws(found$model, found$fits)
  model$last_draws <- posterior_z(model, found$fits)
  model$region <- region_of_draws(joint_unit(model, found$fits), found$fits[[1]]$weights, model$parameters,
                                  growth = rules$region_growth)
  model
}

with_draws <- function(model, fits) {
  model$draws <- rbind(model$last_draws, posterior_z(model, fits))
  model
}

posterior_z <- function(model, fits) {
  drawn <- even_draws(fits[[1]], rules$slope_draws)
  from_unit(joint_unit(model, fits)[drawn, , drop = FALSE], model$flat)
}

border_share <- function(model, fits) {
  sum(fits[[1]]$weights[region_distance(model$region, joint_unit(model, fits)) > 0.9])
}

# Draws of all parameters in the unit cube; the calibrations of all records have the same draws.
joint_unit <- function(model, fits) {
  unit <- matrix(0, length(fits[[1]]$weights), length(model$parameters))
  for (k in seq_along(fits)) unit[, model$own[[k]]] <- posterior_unit(fits[[k]])
  unit
}

fits_in_region <- function(model, context, ais) {
  model <- with_centre(model)
  sets <- lapply(seq_along(model$records), function(k) record_setting(model, k, context, ais))
  without_failing(model, calibrate_sets(sets, context$threads)$fits)
}

# The posterior ends where the simulator fails: draws whose nearest run failed are impossible.
without_failing <- function(model, fits) {
  failed <- !succeeded(model)
  near <- straight_distance(model) <= 2
  if (!any(failed & near)) return(fits)
  straight <- straightened(model$region)
  scaled <- function(z) forwardsolve(model$region$root, (t(z) - straight$z) / straight$slope)
  draws <- scaled(from_unit(joint_unit(model, fits), model$flat))
  runs <- scaled(model$runs$z[near, , drop = FALSE])
  nearest <- apply(draws, 2, function(draw) which.min(colSums((runs - draw)^2)))
  possible <- !failed[near][nearest]
  weights <- fits[[1]]$weights * possible
  if (sum(weights) < 1e-6) return(fits)
  lapply(fits, function(fit) {
    fit$log_evidence <- fit$log_evidence + log(sum(weights))
    fit$interval <- fit$interval + log(sum(weights))
    fit$weights <- fit$posterior$weights <- weights / sum(weights)
    fit$failing <- 1 - sum(weights)
    fit
  })
}

# The tangent at the centre of the region, by differences: what the discrepancy keeps out of hangs on it
# being exact. It stays as long as it is near the centre.
with_exact_tangent <- function(model, context) {
  if (isTRUE(model$tangent$exact) && straight_distance(model)[model$tangent$at] < rules$tangent_near) {
    return(model)
  }
  made <- with_runs(model, rbind(straightened(model$region)$z), context)
  if (!length(made$at) || !succeeded(made$model)[made$at]) return(made$model)
  found <- difference_slopes(made$model, made$at, context)
  model <- found$model
  if (!is.null(found$slopes)) model$tangent <- list(at = made$at, slopes = found$slopes, exact = TRUE)
  model
}

# The simulator about the centre of the region as a line: its `output` there and its `slopes` for a standard
# deviation of the prior of each parameter. Slopes of the search are corrected by the runs near.
with_centre <- function(model) {
  at <- model$tangent$at
  slopes <- model$tangent$slopes
  if (!isTRUE(model$tangent$exact)) {
    reference <- list(z = model$runs$z[at, ], slopes = slopes, stale = rules$trial_stale)
    at <- which.min(ifelse(succeeded(model), straight_distance(model), Inf))
    slopes <- secant_slopes(model, at, reference)
  }
  way <- straightened(model$region)$z - model$runs$z[at, ]
  model$centre <- list(output = model$runs$outputs[, at] + (slopes %*% way)[, 1], slopes = slopes)
  model
}

# One record as the sampler takes it: an emulator of the runs in its region, whose discrepancy keeps out
# of what the parameters do there, as far as its reach says.
record_setting <- function(model, k, context, ais) {
  record <- model$records[[k]]
  own <- model$own[[k]]
  region <- region_part(model$region, own)
  ensemble <- record_ensemble(model, k, region)
  control <- utils::modifyList(list(noise_fraction = rules$basis_error), as.list(context$control$emulator))
  emulator <- without_basis_warnings(
    train_emulator(ensemble, record$measurements, control, threads = context$threads))
  emulator$moves <- local_moves(model, k, emulator)
  control <- record$control
  if (!is.null(ais)) {
    control$ais <- fill_ais_control(utils::modifyList(control$ais, ais))
  }
  list(emulator = emulator, measurements = record$measurements, rows = record$rows, control = control,
       priors = history_priors(record$measurements, control, length(record$rows),
                               mean(emulator$basis$discarded_sd^2)),
       seed = context$seed)
}

# How far the simulator moves where the posterior lies: a root E (N x r) of the mean of J J' over draws of the
# posterior, J its slopes for a standard deviation of the prior of each parameter. J is the tangent's, and the
# emulator says how it turns from draw to draw. It is not put on the emulator's basis, which holds the posterior
# to a hundredth of the noise: over a prior a hundred times as wide, that would be the noise itself.
# E = [J, K] combine, K the basis.
local_moves <- function(model, k, emulator) {
  own <- model$own[[k]]
  slopes <- unname(model$centre$slopes[model$rows[[k]], own, drop = FALSE])
  p <- length(own)
  q <- ncol(emulator$basis$vectors)
  combine <- rbind(diag(p), matrix(0, q, p))
  both <- cbind(slopes, emulator$basis$vectors)
  if (!is.null(model$draws)) combine <- root_of(tcrossprod(turning_combination(model, own, emulator)))
  energy <- eigen(crossprod(both %*% combine), symmetric = TRUE)
  acts <- energy$values > (1e-3 * model$records[[k]]$priors$noise_sd)^2
  combine <- combine %*% energy$vectors[, acts, drop = FALSE]
  list(root = both %*% combine, combine = combine, z = model$runs$z[model$tangent$at, own])
}

root_of <- function(covariance) {
  parts <- eigen(covariance, symmetric = TRUE)
  sweep(parts$vectors, 2, sqrt(pmax(parts$values, 0)), "*")
}

# Combinations of the tangent's slopes and of the basis vectors, one for each draw and parameter.
turning_combination <- function(model, own, emulator) {
  z <- rbind(model$runs$z[model$tangent$at, own], model$draws[, own, drop = FALSE])
  n <- nrow(z) - 1
  step <- pmax(0.1 * apply(z[-1, , drop = FALSE], 2, stats::sd), 1e-4)
  parts <- lapply(seq_along(own), function(j) {
    limit <- model$limit[own[j]]
    up <- down <- z
    up[, j] <- pmin(z[, j] + step[j], limit)
    down[, j] <- pmax(z[, j] - step[j], -limit)
    seen <- lapply(list(up, down), function(z) {
      predict_emulator_(emulator$processes, to_normal(to_unit(z, model$flat[own])))$mean
    })
    turned <- (seen[[1]] - seen[[2]]) / (up[, j] - down[, j])
    own_slope <- matrix(0, length(own), n)
    own_slope[j, ] <- 1
    rbind(own_slope, t(turned[-1, , drop = FALSE]) - turned[1, ]) / sqrt(n)
  })
  do.call(cbind, parts)
}

# Runs inside the region or, if they are few, the nearest ones.
record_ensemble <- function(model, k, region) {
  own <- model$own[[k]]
  record <- model$records[[k]]
  rows <- model$rows[[k]]
  distance <- ifelse(succeeded(model), straight_distance(model), Inf)
  nearest <- order(distance)
  inside <- sum(distance <= 1)
  wanted <- nearest[seq_len(max(inside, min(least_training(own), sum(is.finite(distance)))))]
  wanted <- sort(wanted[!duplicated(model$runs$z[wanted, own, drop = FALSE])])
  parameters <- model$parameters[own]
  unit <- unname(to_unit(model$runs$z[wanted, own, drop = FALSE], model$flat[own]))
  ensemble <- new_ensemble(parameters, unit, unit_to_values(unit, parameters),
                           model$runs$outputs[rows, wanted, drop = FALSE], model$simulators[[k]], NA,
                           region, hours = record$measurements$hours[record$rows])
  per_unit <- straightened(region)$slope * region$root
  ensemble$tangent <- list(centre = model$centre$output[rows],
                           slopes = model$centre$slopes[rows, own, drop = FALSE] %*% per_unit)
  ensemble
}

least_training <- function(own) max(6, length(own) + 3)

# Runs at n draws of the posterior: list(model, fits) with the checks of the calibrations, whose evidence
# they correct.
check_by_runs <- function(model, fits, n, context) {
  drawn <- even_draws(fits[[1]], n)
  draws <- unique(drawn)
  z <- from_unit(joint_unit(model, fits)[draws, , drop = FALSE], model$flat)
  made <- with_runs(model, z, context)
  model <- made$model
  draws <- draws[seq_along(made$at)]
  fine <- succeeded(model)[made$at]
  model$checked <- list(draws = draws[fine], at = made$at[fine],
                        times = tabulate(match(drawn, draws))[seq_along(draws)][fine])
  if (!any(fine)) return(list(model = model, fits = fits))
  each <- lapply(model$rows, function(rows) {
    list(draws = draws[fine], times = model$checked$times, failed = sum(!fine),
         runs = model$runs$outputs[rows, made$at[fine], drop = FALSE])
  })
  fits <- Map(function(fit, runs) {
    fit$check <- emulation_check(fit, runs)
    fit
  }, fits, each)
  list(model = model, fits = exact_evidence(fits, each, context$threads))
}

# The verified posterior: local runs, the posterior by them, the check, until it passes with enough to spare for
# intervals and two rounds agree on the evidence. `before`: the evidence that an earlier check found.
verify_model <- function(model, context, before = NULL) {
  least <- least_local(model)
  best <- NULL
  for (round in seq_len(max(1, context$control$rounds %||% rules$verify_rounds))) {
    model <- with_local_runs(model, least - length(model$parameters), context)
    rough <- posterior_of(model, context, rough_ais)
    model <- with_exact_tangent(following(rough), context)
    found <- list(model = model, fits = fits_in_region(model, context, model_ais(context)))
    inside <- sum(succeeded(found$model) & straight_distance(found$model) <= 1)
    if (inside < least / 2 && !is_spent(context)) {  # the region has moved away from its runs
      model <- found$model
      next
    }
    checks <- if (is.null(before)) rules$first_check else rules$check_runs
    found <- check_by_runs(found$model, found$fits, checks, context)
    model <- found$model
    settled <- has_settled(found$fits, before)
    found$score <- check_score(found$fits)
    if (settled || is.null(best) || found$score > best$score) best <- found
    if (settled || is_spent(context)) break
    before <- found$fits[[1]]$log_evidence
    passed <- isTRUE(found$fits[[1]]$check$passed)
    least <- inside + length(model$checked$at) + if (passed) 0 else rules$more_runs
  }
  best <- best %||% found
  if (is.null(best$fits[[1]]$check)) {  # the budget ended before the check
    return(with_fit(best$model, best$fits, best$model$level, 0, context))
  }
  best$model$runs <- model$runs
  if (!is.null(model$modes)) best$model$modes <- confirmed_modes(best$model, model$modes, best$fits)
  with_fit(best$model, best$fits, "verified", round, context)
}

model_ais <- function(context) utils::modifyList(verified_ais, as.list(context$control$calibration$ais))

has_settled <- function(fits, before) {
  !is.null(before) && abs(fits[[1]]$log_evidence - before) <= rules$rounds_agree && all(vapply(fits, function(fit) {
    check <- fit$check
    isTRUE(check$passed) && check$border <= rules$border_intervals &&
      check$effective >= rules$effective_intervals && fit$standard_error <= rules$evidence_error
  }, NA))
}

# Passed ones first, among them by the effective share of the runs.
check_score <- function(fits) {
  min(vapply(fits, function(fit) {
    check <- fit$check
    if (is.null(check)) return(-1)
    isTRUE(check$passed) + (if (is.na(check$effective)) 1 / (1 + check$ratio) else check$effective)
  }, 0))
}

with_fit <- function(model, fits, level, rounds, context) {
  fits <- lapply(fits, function(fit) {
    fit$trust <- fit_trust(fit)
    if (is.null(fit$check)) fit$trust <- not_checked()
    fit$rounds <- rounds
    fit$runs_made <- runs_spent(context)
    fit$modes <- model$modes
    if (isFALSE(fit$modes$agree) || isTRUE(fit$modes$lost > 0)) fit$trust <- not_agreed(fit$trust, fit$modes)
    fit
  })
  model$fit <- joined_fit(stats::setNames(fits, names(model$simulators)))
  model$level <- level
  model
}

not_checked <- function() {
  list(trusted = FALSE, verdict = "not trusted: the budget left no runs to check the emulator")
}

# Of searches from several starts no two led to one mode: there may be a better one.
not_agreed <- function(trust, modes) {
  why <- if (isTRUE(modes$lost > 0)) sprintf("no draws lie at %d of the modes that searches found", modes$lost)
         else if (modes$searches < 2) "the budget allowed a single search, so that no other confirms its mode"
         else sprintf("no two of %d searches led to one mode", modes$searches)
  list(trusted = FALSE, verdict = paste0(c(if (!trust$trusted) trust$verdict, paste("not trusted:", why)),
                                         collapse = "; "))
}

# Whether a second search ended in the region of the posterior, as seen in the end; and how many ended at a place as
# probable as the draws of the posterior that were run, but without draws: a mode that was lost.
confirmed_modes <- function(model, modes, fits) {
  modes$agree <- modes$agree || sum(straight_distance(model)[modes$ends] <= 1) > 1
  z <- t(from_unit(joint_unit(model, fits)[fits[[1]]$weights > 0, , drop = FALSE], model$flat))
  empty <- !mapply(function(at, covariance) {
    apart <- forwardsolve(t(chol(covariance)), z - model$runs$z[at, ])
    any(colSums(apart^2) < 4 * (nrow(z) + 4))
  }, modes$ends, modes$covariances)
  value <- values_under(model, fits, c(model$checked$at, modes$ends[empty]))
  drawn <- seq_along(model$checked$at)
  typical <- stats::median(rep(value[drawn], model$checked$times))
  modes$lost <- sum(value[-drawn] > typical - rules$same_height)
  modes$covariances <- NULL
  modes
}

# log posterior density of runs, by draws of error and discrepancy of calibrations.
values_under <- function(model, fits, at) {
  draws <- even_draws(fits[[1]], rules$search_draws)
  each <- Map(function(fit, rows) {
    log_l <- run_log_likelihood(fit, rep(draws, length(at)),
                                model$runs$outputs[rows, rep(at, each = length(draws)), drop = FALSE], 1)
    apply(matrix(log_l, length(draws)), 2, log_mean_exp)
  }, fits, model$rows)
  Reduce(`+`, each) - 0.5 * rowSums(model$runs$z[at, !model$flat, drop = FALSE]^2)
}

# The base model from its first run to its verified posterior.
calibrate_model <- function(model, context) {
  found <- find_modes(model, context)
  region <- region_of_modes(found$model, found$modes, context$seed)
  model <- with_mode(found$model, found$modes[[1]], region)
  model$modes <- list(agree = found$agree, searches = length(found$modes),
                      ends = vapply(found$modes, `[[`, 0, "at"), covariances = lapply(found$modes, `[[`, "covariance"))
  verify_model(model, context)
}
