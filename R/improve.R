# From a mode to a posterior: an emulator in the region of the mode, with the simulator's tangent as
# its mean; the posterior under it; and runs at its draws, which first check the emulator and then
# train it.

# How precisely the sampler works: to see where a posterior lies, and for a result.
verified_ais <- list(pilot_chains = 200, groups = 6, max_groups = 8, max_sweeps = 12,
                     precision = 0.2, gradient = TRUE)
rough_ais <- list(pilot_chains = 128, groups = 2, max_groups = 4, max_sweeps = 8, precision = 0.5,
                  gradient = TRUE, importance_draws = 0)

# What searches know, the best first: the run of the mode; of all of them the run of least squares,
# and its slopes.
with_modes <- function(model, searches, seed) {
  model$mode <- searches[[1]]$at
  ends <- vapply(searches, function(search) search$least$at, 0)
  model$least <- searches[[which.min(squared_misfit(model)[ends])]]$least
  model$region <- region_of_modes(model, searches, seed)
  model
}

# Runs that fill the region, as many as are missing from `least` in it.
with_local_runs <- function(model, least, context) {
  n <- least - sum(fills(model))
  if (n <= 0) return(model)
  seed <- context$seed + nrow(model$runs$z)  # each time others
  unit <- region_design(model$region, n, seed)
  with_runs(model, from_unit(unit, model$space), context)$model
}

is_inside <- function(model) succeeded(model) & straight_distance(model) <= 1

# Those that fill it: of an extension not the runs of the model before, which show the region from
# one side.
fills <- function(model) {
  is_new <- rep(TRUE, nrow(model$runs$z))
  if (length(model$off))
    is_new <- colSums(t(model$runs$z[, names(model$off), drop = FALSE]) != model$off) > 0
  is_inside(model) & is_new
}

least_local <- function(model) {
  max(model$local %||% rules$local_runs, rules$local_parameter * length(model$parameters))
}

# Of its runs, how far out they lie in the straightened coordinates of the region: 1 is where it
# ends. A run at the end of a flat prior, infinitely far in normal coordinates, is near in these.
straight_distance <- function(model) {
  sqrt(colSums(along_axes(model$region, model$space, model$runs$z)^2)) / model$region$radius
}

# The posterior of the model by the runs there are. Where it reaches the end of its region, the
# region follows it. list(model, fits): the region it ended with, and a calibration of each record.
posterior_of <- function(model, context, ais = NULL, border = rules$border_intervals) {
  for (try in seq_len(rules$region_tries)) {
    fits <- fits_in_region(model, context, ais)
    outside <- border_share(model, fits)
    if (outside <= border || try == rules$region_tries) break
    model$region <- region_of_draws(joint_unit(model, fits), fits[[1]]$weights, model$parameters,
                                    growth = if (outside > rules$cut_share) rules$cut_growth
                                             else rules$border_growth)
  }
  list(model = model, fits = fits)
}

# The model with the region of its posterior.
following <- function(found) {
  model <- found$model
  model$region <- region_of_draws(joint_unit(model, found$fits), found$fits[[1]]$weights,
                                  model$parameters, growth = rules$region_growth)
  model
}

border_share <- function(model, fits) {
  sum(fits[[1]]$weights[in_border(model$region, joint_unit(model, fits))])
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
# `failing`: their share.
without_failing <- function(model, fits) {
  failed <- !succeeded(model)
  near <- straight_distance(model) <= rules$failing_radius
  if (!any(failed & near)) return(fits)
  scaled <- function(z) along_axes(model$region, model$space, z)
  draws <- scaled(from_unit(joint_unit(model, fits), model$space))
  runs <- scaled(model$runs$z[near, , drop = FALSE])
  nearest <- apply(draws, 2, function(draw) which.min(colSums((runs - draw)^2)))
  possible <- !failed[near][nearest]
  weights <- fits[[1]]$weights * possible
  kept <- possible[fits[[1]]$kept + 1]
  effective <- sum(weights)^2 / max(sum(weights^2), 1e-300)
  if (effective < rules$least_possible * length(model$parameters) || !any(kept)) return(fits)
  # As well as the runs there tell it.
  error <- sqrt(max(0, 1 / sum(weights) - 1) / sum(near))
  lapply(fits, function(fit) {
    fit$log_evidence <- fit$log_evidence + log(sum(weights))
    fit$standard_error <- sqrt(fit$standard_error^2 + error^2)
    fit$interval <- fit$interval + log(sum(weights)) + c(-1.96, 1.96) * error
    fit$weights <- fit$posterior$weights <- weights / sum(weights)
    fit$posterior$ess <- 1 / sum(fit$weights^2)
    fit$failing <- 1 - (1 - (fit$failing %||% 0)) * sum(weights)
    keeping(fit, kept)
  })
}

# A fit with some of the draws of its discrepancy.
keeping <- function(fit, some) {
  fit$kept <- fit$kept[some]
  for (part in c("coefficients", "withheld", "withheld_covariance"))
    fit[[part]] <- fit[[part]][, some, drop = FALSE]
  fit
}

# The run of least squares, of all runs that there are: if one is nearer to the record, the search
# goes on from it.
with_least <- function(model, context) {
  misfit <- squared_misfit(model)
  nearest <- which.min(misfit)
  enough <- rules$search_gain * squared_nats(model, misfit[nearest])
  if (misfit[model$least$at] - misfit[nearest] <= enough) return(model)
  search <- begin_search(model, nearest, model$least$slopes, 0)
  search$reference <- least_reference(model)
  search <- descend(search, context)
  model <- search$model
  model$least <- search[c("at", "slopes")]
  model
}

# The run of least squares, with the slopes there by differences: the discrepancy keeps out of them.
# First the search converges by the slopes at hand. Slopes of a run before its end would be off by
# what they turn on the way.
with_exact_least <- function(model, context) {
  model <- with_least(model, context)
  if (!isTRUE(model$least$exact)) {
    model <- converged_least(model, least_reference(model), context)
    found <- difference_slopes(model, model$least$at, context)
    model <- found$model
    if (is.null(found$slopes)) return(model)
    known <- list(z = model$runs$z[model$least$at, ], slopes = found$slopes, stale = found$stale)
    model <- converged_least(model, found, context)
    model$least$exact <- TRUE
    model$least[c("known", "idle")] <- list(known, found$idle)
  }
  least <- model$least
  model$least$slopes <- given_slopes(model, model$runs$z[least$at, ]) %||%
    secant_slopes(model, least$at, least$known)
  model$least$slopes[, names(model$parameters) %in% least$idle] <- 0
  model
}

# The search goes on as long as `known` slopes promise that it comes nearer to the record.
converged_least <- function(model, known, context) {
  search <- begin_search(model, model$least$at, known$slopes, known$stale, gain = rules$least_gain)
  search <- descend(search, context)
  model <- search$model
  model$least <- search[c("at", "slopes")]
  model
}

# Where slopes are known, as a search takes them.
least_reference <- function(model) {
  least <- model$least
  least$known %||% list(z = model$runs$z[least$at, ], slopes = least$slopes,
                        stale = rules$trial_stale)
}

# The simulator about the centre of the region as a line: its `output` there and its `slopes` for a
# standard deviation of the prior of each parameter, those of least squares as the runs near it
# correct them.
with_centre <- function(model) {
  at <- which.min(ifelse(succeeded(model), straight_distance(model), Inf))
  slopes <- secant_slopes(model, at, least_reference(model))
  way <- straightened(model$region, model$space)$z - model$runs$z[at, ]
  model$centre <- list(output = model$runs$outputs[, at] + (slopes %*% way)[, 1], slopes = slopes)
  model
}

# One record as the sampler takes it: an emulator of the runs in its region, whose discrepancy keeps
# out of what the parameters do there, as far as its reach says.
record_setting <- function(model, k, context, ais) {
  record <- model$records[[k]]
  own <- model$own[[k]]
  region <- region_part(model$region, own)
  ensemble <- record_ensemble(model, k, region)
  control <- utils::modifyList(list(noise_fraction = rules$basis_error),
                               as.list(context$control$emulator))
  emulator <- without_basis_warnings(
    train_emulator(ensemble, record$measurements, control, threads = context$threads))
  emulator$moves <- local_moves(model, k)
  control <- record$control
  if (!is.null(ais)) {
    control$ais <- fill_ais_control(utils::modifyList(control$ais, ais))
  }
  list(emulator = emulator, measurements = record$measurements, rows = record$rows,
       control = control, priors = history_priors(record$measurements, control, length(record$rows),
                                                  mean(emulator$basis$discarded_sd^2)),
       seed = context$seed)
}

# What the discrepancy of a record keeps out of, and where that is.
local_moves <- function(model, k) {
  own <- model$own[[k]]
  unit <- normal_units(model, model$least)[own]
  slopes <- model$least$slopes[model$rows[[k]], own, drop = FALSE]
  list(root = unname(sweep(slopes, 2, unit, "*")), z = model$runs$z[model$least$at, own],
       unit = unit)
}

# Runs inside the region, or the nearest ones if they are few or too many.
record_ensemble <- function(model, k, region) {
  own <- model$own[[k]]
  record <- model$records[[k]]
  rows <- model$rows[[k]]
  distance <- ifelse(succeeded(model), straight_distance(model), Inf)
  nearest <- order(distance)
  inside <- min(sum(distance <= 1), rules$most_training)
  wanted <- nearest[seq_len(max(inside, min(least_training(own), sum(is.finite(distance)))))]
  wanted <- sort(wanted[!duplicated(model$runs$z[wanted, own, drop = FALSE])])
  parameters <- model$parameters[own]
  unit <- unname(to_unit(model$runs$z[wanted, own, drop = FALSE], model$space[own, ]))
  ensemble <- new_ensemble(parameters, unit, unit_to_values(unit, parameters),
                           model$runs$outputs[rows, wanted, drop = FALSE], model$simulators[[k]],
                           NA,
                           region, hours = record$measurements$hours[record$rows])
  per_unit <- straightened(region, model$space[own, ])$slope * region$root
  ensemble$tangent <- list(centre = model$centre$output[rows],
                           slopes = model$centre$slopes[rows, own, drop = FALSE] %*% per_unit)
  ensemble
}

least_training <- function(own) max(rules$training_runs, length(own) + rules$training_spare)

first_failing <- function(model, at) {
  if (!length(at)) return(NULL)
  unit <- to_unit(model$runs$z[at[1], , drop = FALSE], model$space)
  point_words(unit_to_values(unit, model$parameters)[1, ])
}

# Runs at n draws of the posterior: list(model, fits) with the checks of the calibrations, whose
# evidence they correct. Those that fail show where the posterior ends.
check_by_runs <- function(model, fits, n, context) {
  drawn <- even_draws(fits[[1]], n)
  draws <- unique(drawn)
  z <- from_unit(joint_unit(model, fits)[draws, , drop = FALSE], model$space)
  made <- with_runs(model, z, context)
  model <- made$model
  draws <- draws[seq_along(made$at)]
  fine <- succeeded(model)[made$at]
  model$checked <- list(draws = draws[fine], at = made$at[fine],
                        times = tabulate(match(drawn, draws))[seq_along(draws)][fine])
  if (!any(fine)) return(list(model = model, fits = fits))
  if (!all(fine)) fits <- without_failing(model, fits)
  each <- lapply(model$rows, function(rows) {
    list(draws = draws[fine], times = model$checked$times, failed = sum(!fine),
         lost = 0, first = first_failing(model, made$at[!fine]),
         runs = model$runs$outputs[rows, made$at[fine], drop = FALSE])
  })
  fits <- Map(function(fit, runs) {
    fit$check <- emulation_check(fit, runs)
    fit
  }, fits, each)
  list(model = model, fits = exact_evidence(fits, each, context$threads))
}

# The verified posterior: local runs, the posterior by them, the check, until it passes with enough
# to spare for intervals and two rounds agree on the evidence. `before`: the evidence that an
# earlier check found.
verify_model <- function(model, context, before = NULL,
                         rounds = context$control$rounds %||% rules$verify_rounds) {
  least <- least_local(model)
  best <- NULL
  ratios <- numeric()
  for (round in seq_len(max(1, rounds))) {
    checks <- if (is.null(before)) rules$first_check else rules$check_runs
    before_check <- leaving(context, checks)
    model <- with_exact_least(with_local_runs(model, least, before_check), before_check)
    rough <- posterior_of(model, context, rough_ais)
    model <- following(rough)
    found <- list(model = model, fits = fits_in_region(model, context, model_ais(context)))
    filled <- sum(fills(found$model))
    # The region has moved away from its runs.
    if (filled < rules$filled_share * least && round < rounds && !is_spent(before_check)) {
      model <- found$model
      least <- least_local(model)
      next
    }
    found <- check_by_runs(found$model, found$fits, checks, context)
    model <- found$model
    if (round < rounds && misses_least(model, found$fits) && !is_spent(context)) {
      model <- moved_to_least(model, context)
      least <- least_local(model)
      best <- before <- NULL
      ratios <- numeric()
      next
    }
    settled <- has_settled(found$fits, before)
    found$score <- check_score(found$fits)
    if (settled || is.null(best) || found$score > best$score) best <- found
    ratios <- c(ratios, largest_ratio(found$fits))
    if (settled || is_spent(context) || has_stalled(ratios)) break
    before <- found$fits[[1]]$log_evidence
    passed <- isTRUE(found$fits[[1]]$check$passed)
    least <- filled + length(model$checked$at) + if (passed) 0 else rules$more_runs
  }
  best <- best %||% found
  if (is.null(best$fits[[1]]$check)) {  # the budget ended before the check, or all its runs failed
    level <- if (is_spent(context)) best$model$level else "unchecked"
    return(with_fit(best$model, best$fits, level, 0, context))
  }
  best$model$runs <- model$runs
  if (!is.null(model$modes)) best$model$modes <- confirmed_modes(best$model, model$modes, best$fits)
  with_fit(best$model, best$fits, "verified", round, context)
}

# Whether the run of least squares lies outside the region and is more probable than the draws:
# their mode is another, lower one. A model moves once.
misses_least <- function(model, fits) {
  at <- model$least$at
  if (isTRUE(model$moved) || !length(model$checked$at) || straight_distance(model)[at] <= 1)
    return(FALSE)
  value <- values_under(model, fits, c(at, model$checked$at))
  isTRUE(value[1] > stats::median(rep(value[-1], model$checked$times)) + rules$mode_depth)
}

# The model at the mode that a search from there finds.
moved_to_least <- function(model, context) {
  search <- run_search(begin_search(model, model$least$at, model$least$slopes, 0), context)
  model <- with_modes(search$model, list(search), context$seed)
  model$moved <- TRUE
  model
}

model_ais <- function(context)
  utils::modifyList(verified_ais, as.list(context$control$calibration$ais))

has_settled <- function(fits, before) {
  !is.null(before) && abs(fits[[1]]$log_evidence - before) <= rules$rounds_agree &&
    all(vapply(fits, function(fit) {
      check <- fit$check
      isTRUE(check$passed) && !surely_exceeds(check$border, rules$border_intervals, fit) &&
        check$effective >= rules$effective_intervals && fit$standard_error <= rules$evidence_error
    }, NA))
}

# The emulator's error at draws over the noise, of the record where it is worst.
largest_ratio <- function(fits) max(vapply(fits, function(fit) fit$check$ratio %||% Inf, 0))

# Whether two rounds in a row have not made an emulator better that is not good enough.
has_stalled <- function(ratios) {
  k <- length(ratios)
  if (k < 3) return(FALSE)
  best <- min(ratios[seq_len(k - 2)])
  isTRUE(best > rules$error_ratio && all(ratios[k - 1:0] >= best))
}

# Whether more than a share of a posterior lies somewhere, by so many draws: at two standard errors.
surely_exceeds <- function(seen, share, fit)
  seen > share + 2 * sqrt(share * (1 - share) / fit$posterior$ess)

# Passed ones first, among them by the effective share of the runs, or if there is none by the
# emulator's error; the others by how well the evidence is known.
check_score <- function(fits) {
  min(vapply(fits, function(fit) {
    check <- fit$check
    if (is.null(check)) return(-1)
    error <- if (is.na(fit$standard_error)) Inf else fit$standard_error
    if (!isTRUE(check$passed)) 1 / (1 + error)
    else 1 + (if (is.na(check$effective)) 1 / (1 + check$ratio) else check$effective)
  }, 0))
}

with_fit <- function(model, fits, level, rounds, context) {
  if (is.null(fits[[1]]$exchanges))
    fits <- over_orders(model, fits, joint_unit(model, fits), context$seed)
  best <- best_runs(model)
  fits <- Map(function(fit, best) {
    fit$best <- best
    fit$trust <- fit_trust(fit)
    if (is.null(fit$check)) fit$trust <- not_checked(context)
    fit$rounds <- rounds
    fit$runs_made <- runs_spent(context)
    fit$modes <- model$modes
    if (isFALSE(fit$modes$agree) || isTRUE(fit$modes$lost > 0))
      fit$trust <- not_agreed(fit$trust, fit$modes)
    fit
  }, fits, best)
  model$fit <- joined_fit(stats::setNames(fits, names(model$simulators)))
  model$level <- level
  model
}

# The run of least squares, of each record.
best_runs <- function(model) {
  at <- model$least$at
  unit <- to_unit(model$runs$z[at, , drop = FALSE], model$space)
  Map(function(own, rows) {
    parameters <- model$parameters[own]
    list(values = unit_to_values(unit[, own, drop = FALSE], parameters),
         output = model$runs$outputs[rows, at])
  }, model$own, model$rows)
}

not_checked <- function(context) {
  new_trust(FALSE, if (is_spent(context)) "the budget left no runs to check the emulator"
                   else "the simulator failed at every draw of the posterior that was run")
}

# Of searches from several starts no two led to one mode: there may be a better one.
not_agreed <- function(trust, modes) {
  why <- if (isTRUE(modes$lost > 0))
           sprintf("no draws lie at %d of the modes that searches found", modes$lost)
         else if (modes$searches < 2)
           "the budget allowed a single search, so that no other confirms its mode"
         else sprintf("no two of %d searches led to one mode", modes$searches)
  new_trust(FALSE, c(if (!trust$trusted) trust$why, why))
}

# Whether a second search ended in the region of the posterior, as seen in the end; and how many
# ended at a mode that was lost: it has no draws, though it holds a share of the posterior that
# counts.
confirmed_modes <- function(model, modes, fits) {
  modes$agree <- modes$agree || sum(straight_distance(model)[modes$ends] <= 1) > 1
  z <- from_unit(joint_unit(model, fits)[fits[[1]]$weights > 0, , drop = FALSE], model$space)
  empty <- !mapply(function(at, covariance) {
    any(is_within_mode(forwardsolve(t(chol(covariance)), t(z) - model$runs$z[at, ])))
  }, modes$ends, modes$covariances)
  modes$lost <- sum(share_of_modes(model, fits, modes$ends[empty], modes$covariances[empty]) >
                      rules$lost_share)
  modes$covariances <- NULL
  modes
}

# The mass of modes over that of the posterior's draws, both as normal ones: the density at the peak
# times the root of the determinant of the covariance. The density at the peak of the draws is that
# of their median, by the median of chi^2.
share_of_modes <- function(model, fits, ends, covariances) {
  z <- from_unit(joint_unit(model, fits), model$space)
  drawn <- stats::cov.wt(z, fits[[1]]$weights)$cov
  value <- values_under(model, fits, c(model$checked$at, ends))
  of_draws <- seq_along(model$checked$at)
  peak <- stats::median(rep(value[of_draws], model$checked$times)) + stats::qchisq(0.5, ncol(z)) / 2
  half_log_det <- function(covariance) sum(log(diag(chol(conditioned(covariance)))))
  exp(value[-of_draws] + vapply(covariances, half_log_det, 0) - peak - half_log_det(drawn))
}

# log posterior density of runs, by draws of error and discrepancy of calibrations.
values_under <- function(model, fits, at) {
  draws <- even_draws(fits[[1]], rules$search_draws)
  each <- Map(function(fit, rows) {
    log_l <- run_log_likelihood(fit, rep(draws, length(at)),
                                model$runs$outputs[rows, at, drop = FALSE], 1)
    apply(matrix(log_l, length(draws)), 2, log_mean_exp)
  }, fits, model$rows)
  Reduce(`+`, each) - 0.5 * rowSums(model$runs$z[at, !model$space$flat, drop = FALSE]^2)
}

# The base model from its first run to its verified posterior.
calibrate_model <- function(model, context) {
  found <- find_modes(model, sparing(context, rules$search_share, wanted_scouts(model)))
  model <- with_modes(found$model, found$modes, context$seed)
  model$modes <- told_modes(found)
  verify_model(model, context)
}
