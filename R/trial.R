# Mechanisms as extensions of the present model: a trial of each from the present mode, as long as
# it can still win.

# The present model as its trials see it: at its run of least squares.
as_present <- function(model, catalogue, attribution, context) {
  model <- with_losses(model, catalogue, attribution$lost, context)
  if (model$level == "given") return(model)
  least <- model$least
  model$present <- list(at = least$at, slopes = least$slopes,
                        history = tangent_at(model, least$at, least$slopes, moves_of(model, least),
                                             context)$history)
  model
}

# The present simulators with a mechanism, of each record in turn; what was adopted may act on some
# of them.
extended_simulators <- function(mechanism, state) {
  brought <- setdiff(names(state$present$parameters), state$base)
  simulators <- state$present$simulators
  extended <- Map(function(simulator, record) {
    extend(simulator, mechanism, intersect(brought, names(parameters_of(simulator))), record)
  }, simulators, names(simulators) %||% state$started$record)
  check_one_prior(lapply(unname(extended), parameters_of))
  extended
}

# A mechanism tried on the present model: a model at level "tried", or "silent" if it changes
# nothing. `off`: the values of its parameters at which it is switched off, if they are known.
try_mechanism <- function(present, name, simulators, off, bar, context) {
  model <- new_model(simulators, present$records, paste(present$name, "+", name),
                     present$name, name)
  before <- runs_spent(context)
  looked <- look_at_mechanism(model, present, off, context)
  model <- looked$model
  model$own_runs <- runs_spent(context) - before
  if (looked$silent) return(utils::modifyList(model, list(level = "silent")))
  if (is_spent(context) && sum(succeeded(model)) < 2)
    return(utils::modifyList(model, list(level = "missed")))
  if (!length(looked$starts)) return(utils::modifyList(model, list(level = "untried")))
  search <- search_trial(looked, context)
  model <- with_least(with_modes(search$model, list(search), context$seed), context)
  model$off <- looked$off
  model$status <- search$status
  model <- tried_model(model, present, bar, context)
  model$own_runs <- runs_spent(context) - before
  model
}

# A search from the most promising start of the first look. An extension holds the present model,
# with its mechanism switched off, and cannot be worse: if the search ends below that, or no nearer
# to the record, it goes on from the next start with the mechanism on.
search_trial <- function(looked, context) {
  model <- looked$model
  is_on <- vapply(looked$starts, function(start) !start$at %in% looked$off_at, NA)
  starts <- looked$starts[is_on | seq_along(is_on) == 1]
  best <- NULL
  for (start in utils::head(starts, rules$trial_starts)) {
    search <- begin_search(model, start$at, start$slopes, rules$trial_stale, rules$trial_steps,
                           looked$off_at)
    search <- run_search(search, context)
    model <- search$model
    others <- c(best$at, looked$off_at)
    value <- values_at(model, c(search$at, others), search$history, search$moves, context)
    if (is.null(best) || value[1] > value[2]) best <- search
    is_done <- all(value[1] >= value[-1]) && search$status %in% c("converged", "futile")
    if (is_spent(context) || is_done && comes_nearer(model, search$least$at, looked$off_at)) break
  }
  best$model <- model
  best
}

# Whether a run is decisively nearer to the record than the one without the mechanism.
comes_nearer <- function(model, at, off_at) {
  if (is.null(off_at)) return(TRUE)
  misfit <- squared_misfit(model)[c(at, off_at)]
  misfit[1] < misfit[2] - rules$decisive * log(10) * squared_nats(model, misfit[2])
}

# A first look: what is new at its ends and between, all else as in the present model. It shows
# where the mechanism is switched off, and where searches may begin, the most promising first:
# list(model, silent, off, off_at, starts).
look_at_mechanism <- function(model, present, off, context) {
  old <- names(present$parameters)
  new <- setdiff(names(model$parameters), old)
  kept <- intersect(old, names(model$parameters))
  z <- model$runs$z[integer(0), , drop = FALSE]
  from <- present$runs$z[present$present$at, ]
  place <- function(values) {
    z <- matrix(0, nrow(values), length(model$parameters),
                dimnames = list(NULL, names(model$parameters)))
    z[, kept] <- rep(from[kept], each = nrow(z))
    z[, new] <- values
    z
  }
  values <- first_values(model$space[match(new, names(model$parameters)), ])
  # known already
  if (!is.null(off)) values <- values[colSums(t(values) != off) > 0, , drop = FALSE]
  made <- with_runs(model, place(values), context)
  model <- made$model
  fine <- made$at[succeeded(model)[made$at]]
  if (!length(fine)) return(list(model = model, silent = FALSE))
  base <- present$runs$outputs[, present$present$at]
  change <- over_noise(model, model$runs$outputs[, fine, drop = FALSE] - base)
  looked_whole <- length(fine) == nrow(values)
  if (setequal(kept, old) && looked_whole && all(change == 0))
    return(list(model = model, silent = TRUE))
  off <- off %||% switched_off(model, fine, new, change)
  slopes <- matrix(0, nrow(model$runs$outputs), length(model$parameters),
                   dimnames = list(NULL, names(model$parameters)))
  slopes[, kept] <- present$present$slopes[, match(kept, old)]
  off_at <- NULL
  if (!is.null(off) && setequal(kept, old)) {
    model <- inherit_runs(model, present, off)
    off_at <- present$present$at
    fine <- c(off_at, fine + ncol(present$runs$outputs))
    change <- c(Inf, change)
  }
  # switched off it is one start
  apart <- if (is.null(off_at)) fine else fine[change >= rules$off_change]
  starts <- lapply(apart,
                   function(at) list(at = at, slopes = slopes_in(model, at, fine, new, slopes)))
  value <- vapply(starts, profile_value, 0, model, present, context)
  list(model = model, silent = FALSE, off = off, off_at = off_at, starts = starts[order(-value)])
}

# Values of new parameters for the first look: all at their lower ends, all at their upper ends, and
# between.
first_values <- function(space) {
  n <- nrow(space)
  if (n == 0) return(matrix(0, 1, 0))
  between <- if (n == 1) matrix(0.5) else with_seed(n, lhs::randomLHS(2 * n - 1, n))
  rbind(space$lower, space$upper, from_unit(between, space))
}

# Where the first look shows the output of the present model: a value of each new parameter, or
# NULL.
switched_off <- function(model, looked, new, change) {
  least <- which.min(change)
  if (length(new) && change[least] < rules$off_change) model$runs$z[looked[least], new]
}

# Slopes of what is new about a run of the first look, by regression on its other runs.
slopes_in <- function(model, at, looked, new, slopes) {
  if (!length(new)) return(slopes)
  ways <- sweep(model$runs$z[looked, new, drop = FALSE], 2, model$runs$z[at, new])
  weights <- ifelse(rowSums(ways^2) > 0, 1 / pmax(rowSums(ways^2), 1e-6)^2, 0)
  change <- model$runs$outputs[, looked, drop = FALSE] - model$runs$outputs[, at]
  gram <- crossprod(ways * sqrt(weights))
  if (!any(gram > 0)) return(slopes)  # the budget left no other run
  slopes[, new] <- change %*% (weights * ways) %*%
    solve(gram + diag(1e-3 * max(diag(gram)), length(new)))
  slopes
}

# What a search from here may reach: the value at the optimum of the tangent.
profile_value <- function(start, model, present, context) {
  at <- start$at
  slopes <- start$slopes
  history <- present$present$history
  moves <- moves_of(model, start)
  tangent <- tangent_given(model, model$runs$z[at, ], model$runs$outputs[, at], slopes, history,
                           moves, context)
  z <- within_limits(tangent$mean, solve(conditioned(tangent$covariance)), model$space)
  output <- model$runs$outputs[, at] + slopes %*% (z - model$runs$z[at, ])
  values_of(model, output, rbind(z), history, moves, context)
}

# The posterior of a trial, checked by a few runs that then train, until they confirm it or it
# cannot win.
tried_model <- function(model, present, bar, context) {
  for (round in seq_len(rules$trial_rounds)) {
    found <- posterior_of(model, context, trial_ais, border = rules$border)
    found <- check_by_runs(found$model, found$fits, rules$trial_check, context)
    model <- with_least(found$model, context)
    if (round < rules$trial_rounds && misses_least(model, found$fits) && !is_spent(context)) {
      model <- moved_to_least(model, context)
      next
    }
    model <- with_fit(model, found$fits, "tried", round, context)
    model <- with_taken(model, present, context)
    if (is_spent(context) || is_clear(model, present, bar)) break
  }
  model
}

trial_ais <- list(pilot_chains = 128, groups = 4, max_groups = 8, max_sweeps = 12, precision = 0.3,
                  gradient = FALSE, importance_draws = 0)

settled_trial <- function(model, present, bar, context) {
  if (!asks_for_checks(model, present, bar)) return(verify_trial(model, present, context))
  model$rechecked <- TRUE
  tried_model(model, present, bar, context)
}

# A trial that its runs confirm has had its first round.
verify_trial <- function(model, present, context) {
  before <- if (is_confirmed(model)) model$fit$log_evidence
  with_taken(verify_model(model, context, before), present, context)
}

# A trial searched again from runs over all priors, far from where it ended: an extension may have a
# better mode there, with another part of the model in the place that its mechanism takes. As it was
# if no higher mode is found, or if what runs confirm of the new one is no better.
widened_trial <- function(trial, present, bar, context) {
  model <- over_priors(trial, context)
  modes <- list(own_mode(trial, context))
  made <- setdiff(seq_len(nrow(model$runs$z)), seq_len(nrow(trial$runs$z)))
  for (start in start_runs(model, trial$mode, made)[-1]) {
    if (is_spent(context)) break
    search <- begin_search(model, start, regression_slopes(model, start), rules$scout_stale)
    search <- run_search(search, context)
    model <- search$model
    modes <- c(modes, list(search))
  }
  found <- ranked_modes(model, modes, context)
  best <- found$modes[[1]]
  own <- Find(function(mode) mode$at == trial$mode, found$modes)
  trial$runs <- found$model$runs
  if (best$value - own$value < rules$same_height) return(trial)
  again <- tried_model(with_modes(trial, list(best), context$seed), present, bar, context)
  is_better <- standing_of(again, present) > standing_of(trial, present)
  if (is_better || !is_confirmed(again)) return(again)
  trial$runs <- again$runs
  trial
}

# Where a trial ended, as its searches are.
own_mode <- function(trial, context) {
  own <- list(at = trial$mode, slopes = secant_slopes(trial, trial$mode, least_reference(trial)),
              least = trial$least)
  own[c("mean", "covariance", "history", "moves")] <-
    tangent_at(trial, own$at, own$slopes, moves_of(trial, own$least), context)
  own
}

over_priors <- function(model, context) {
  p <- length(model$parameters)
  unit <- with_seed(context$seed + p, lhs::randomLHS(rules$scouts_base + p, p))
  with_runs(model, from_unit(unit, model$space), context)$model
}

# The trial that is to be adopted, searched from other starts as a base model is, until a second
# search ends at its best mode. If a search ended outside its region, it is verified in the region
# of all modes; if there is no emulator of that, it stays as it was verified.
searched_again <- function(trial, present, context) {
  if (trial$level == "given") return(trial)
  before <- runs_spent(context)
  found <- list(model = trial, modes = list(own_mode(trial, context)), agree = FALSE)
  new <- setdiff(names(trial$parameters), names(present$parameters))
  found <- from_images(found, context, new)
  for (z in far_points(trial, context)) {
    made <- with_runs(found$model, rbind(z), context)
    found$model <- made$model
    if (!length(made$at)) break
    if (!succeeded(made$model)[made$at]) next
    found <- more_modes(made$model, found$modes, made$at, context, begun_alone)
    if (found$agree) break
  }
  trial[c("runs", "exchanges")] <- found$model[c("runs", "exchanges")]
  trial$modes <- told_modes(found)
  counting <- counting_modes(found$modes)
  ends <- vapply(counting, `[[`, 0, "at")
  if (any(straight_distance(trial)[ends] > 1)) {
    all <- verify_trial(with_modes(trial, counting, context$seed), present, context)
    trial <- if (may_stay(all, trial, present, context)) all
             else beside_modes(replace(trial, "runs", all["runs"]), context)
  } else {
    trial <- beside_modes(trial, context)
  }
  trial$own_runs <- trial$own_runs + runs_spent(context) - before
  trial
}

# The evidence of one mode is a lower bound of that of all. If runs refute the emulator of all, its
# evidence must reach that bound, and be enough to be adopted.
may_stay <- function(all, one, present, context) {
  if (is.null(all$fit$check)) return(FALSE)
  has_passed(all) || !is.null(to_adopt(list(all), present, context)) &&
    standing_of(all, present) >= standing_of(one, present)
}

# A trial with the posterior that it has, beside the modes that searches found since, and at the run
# of least squares of all of them.
beside_modes <- function(trial, context) {
  fits <- record_fits(trial$fit)
  trial <- with_least(trial, context)
  trial$modes <- confirmed_modes(trial, trial$modes, fits)
  with_fit(trial, fits, trial$level, fits[[1]]$rounds, context)
}

# The present model was searched from several starts; what its mechanism brought is new: its slopes
# are taken where the search begins.
begun_alone <- function(model, start, modes, context) {
  slopes <- regression_slopes(model, start)
  new <- intersect(names(model$off), names(model$parameters))
  if (length(new)) {
    found <- difference_slopes(model, start, context, new)
    model <- found$model
    if (!is.null(found$slopes)) slopes[, match(new, names(model$parameters))] <- found$slopes
  }
  search <- begin_search(model, start, slopes, rules$scout_stale, alone = TRUE)
  search$known <- modes
  search
}

# Points far from its mode: where the present model was run over the priors, with what the mechanism
# brought anywhere in its own, farthest first.
far_points <- function(trial, context) {
  if (is.null(trial$over_priors)) {
    known <- nrow(trial$runs$z)
    trial <- over_priors(trial, context)
    trial$over_priors <- known + seq_len(nrow(trial$runs$z) - known)
  }
  at <- start_runs(trial, trial$mode, trial$over_priors)[-1]
  z <- trial$runs$z[at, , drop = FALSE]
  new <- match(names(trial$off), colnames(z))
  if (length(at) && length(new)) {
    unit <- with_seed(context$seed, lhs::randomLHS(length(at), length(new)))
    values <- from_unit(unit, trial$space[new, ])
    apart <- colSums((t(values) - trial$runs$z[trial$mode, new])^2)
    z[, new] <- values[order(-apart), ]
  }
  lapply(seq_along(at), function(k) z[k, ])
}
