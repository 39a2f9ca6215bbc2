# Mechanisms as extensions of the present model: a trial of each from the present mode, as long as it can
# still win; then those in front are verified, until the leader is exact and nobody can reach it.

# The present model as its trials see it: a run at the centre of its posterior and its slopes there.
as_present <- function(model, context) {
  if (model$level == "given") return(model)
  fits <- record_fits(model$fit)
  z <- from_unit(joint_unit(model, fits), model$flat)
  made <- with_runs(model, rbind(colSums(fits[[1]]$weights * z)), context)
  model <- made$model
  at <- if (length(made$at) && succeeded(model)[made$at]) made$at else model$tangent$at
  reference <- list(z = model$runs$z[model$tangent$at, ], slopes = model$tangent$slopes,
                    stale = rules$trial_stale)
  slopes <- secant_slopes(model, at, reference)
  model$present <- list(at = at, slopes = slopes,
                        history = tangent_at(model, at, slopes, NULL, context)$history)
  model
}

# A mechanism tried on the present model: a model at level "tried", or "silent" if it changes nothing.
# `off`: the values of its parameters at which it is switched off, if they are known.
try_mechanism <- function(present, name, simulators, off, bar, context) {
  model <- new_model(simulators, present$records, paste(present$name, "+", name), present$name, name)
  before <- runs_spent(context)
  looked <- look_at_mechanism(model, present, off, context)
  model <- looked$model
  if (looked$silent) return(utils::modifyList(model, list(level = "silent")))
  if (is.null(looked$start)) return(utils::modifyList(model, list(level = "untried")))
  search <- begin_search(model, looked$start, looked$slopes, rules$trial_stale, rules$trial_steps,
                         renews = FALSE)
  search <- run_search(search, context)
  model <- with_mode(search$model, search, region_of_modes(search$model, list(search), context$seed))
  model$off <- looked$off
  model$status <- search$status
  model <- tried_model(model, present, bar, context)
  model$own_runs <- runs_spent(context) - before
  model
}

# A first look: what is new at its ends and between, all else as in the present model. It shows where the
# mechanism is switched off, and where a search begins: list(model, silent, off, start, slopes).
look_at_mechanism <- function(model, present, off, context) {
  old <- names(present$parameters)
  new <- setdiff(names(model$parameters), old)
  kept <- intersect(old, names(model$parameters))
  z <- model$runs$z[integer(0), , drop = FALSE]
  from <- present$runs$z[present$present$at, ]
  place <- function(values) {
    z <- matrix(0, nrow(values), length(model$parameters), dimnames = list(NULL, names(model$parameters)))
    z[, kept] <- rep(from[kept], each = nrow(z))
    z[, new] <- values
    z
  }
  flat <- model$flat[match(new, names(model$parameters))]
  values <- first_values(length(new), flat, model$limit[match(new, names(model$parameters))])
  if (!is.null(off)) values <- values[colSums(t(values) != off) > 0, , drop = FALSE]  # known already
  made <- with_runs(model, place(values), context)
  model <- made$model
  fine <- made$at[succeeded(model)[made$at]]
  if (!length(fine)) return(list(model = model, silent = FALSE))
  base <- present$runs$outputs[, present$present$at]
  change <- over_noise(model, model$runs$outputs[, fine, drop = FALSE] - base)
  if (setequal(kept, old) && all(change == 0)) return(list(model = model, silent = TRUE))
  off <- off %||% switched_off(model, fine, new, change)
  slopes <- matrix(0, nrow(model$runs$outputs), length(model$parameters),
                   dimnames = list(NULL, names(model$parameters)))
  slopes[, kept] <- present$present$slopes[, match(kept, old)]
  if (!is.null(off) && setequal(kept, old)) {
    first <- ncol(present$runs$outputs)
    model <- inherit_runs(model, present, off)
    fine <- fine + first
    fine <- c(present$present$at, fine)
  }
  starts <- lapply(fine, function(at) slopes_in(model, at, fine, new, slopes))
  value <- mapply(profile_value, fine, starts, MoreArgs = list(model = model, present = present, context = context))
  best <- which.max(value)
  list(model = model, silent = FALSE, off = off, start = fine[best], slopes = starts[[best]])
}

# Values of n new parameters for the first look: all at their lower ends, all at their upper ends, and
# between.
first_values <- function(n, flat, limit) {
  if (n == 0) return(matrix(0, 1, 0))
  between <- if (n == 1) matrix(0) else {
    unit <- with_seed(n, lhs::randomLHS(2 * n - 1, n))
    from_unit(unit, flat)
  }
  rbind(-limit, limit, between)
}

# Where the first look shows the output of the present model: a value of each new parameter, or NULL.
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
  slopes[, new] <- change %*% (weights * ways) %*% solve(gram + diag(1e-3 * max(diag(gram)), length(new)))
  slopes
}

# What a search from here may reach: the value at the optimum of the tangent.
profile_value <- function(at, slopes, model, present, context) {
  history <- present$present$history
  tangent <- tangent_at(model, at, slopes, history, context)
  z <- within_limits(tangent$mean, solve(tangent$covariance), model$limit)
  output <- model$runs$outputs[, at] + slopes %*% (z - model$runs$z[at, ])
  values_of(model, output, rbind(z), history, slopes, context)
}

# The posterior of a trial, checked by a few runs that then train, until they confirm it or it cannot win.
tried_model <- function(model, present, bar, context) {
  for (round in seq_len(rules$trial_rounds)) {
    found <- posterior_of(model, context, trial_ais, border = rules$border)
    found <- check_by_runs(found$model, found$fits, rules$trial_check, context)
    model <- with_fit(found$model, found$fits, "tried", round, context)
    if (is_spent(context) || is_clear(model, present, bar)) break
  }
  model
}

trial_ais <- list(pilot_chains = 128, groups = 4, max_groups = 8, max_sweeps = 12, precision = 0.3,
                  gradient = FALSE, importance_draws = 0)

# Whether a trial needs no further runs: they confirm it, it could not win if they did, or it will be verified
# whatever they say.
is_clear <- function(model, present, bar) {
  is_confirmed(model) || upper_bound(model, present) < bar || lower_bound(model, present) > bar
}

is_confirmed <- function(model) {
  check <- model$fit$check
  isTRUE(check$passed) && isTRUE(check$effective >= rules$effective_trial)
}

log10_factor <- function(model, present) {
  (model$fit$log_evidence - present$fit$log_evidence) / log(10)
}

# What the log10 Bayes factor of a model may be at most, by its level.
upper_bound <- function(model, present) {
  error <- sqrt(model$fit$standard_error^2 + present$fit$standard_error^2) / log(10)
  log10_factor(model, present) + 3 * error + trial_margin(model)
}

lower_bound <- function(model, present) 2 * log10_factor(model, present) - upper_bound(model, present)

# What a mechanism must reach to be adopted, as far as the trials before it show.
needed_factor <- function(trials, present, context) {
  seen <- Filter(function(model) !is.null(model$fit) && !raises_simulation(model, present), trials)
  max(context$control$decisive, vapply(seen, lower_bound, 0, present))
}

# How far the evidence may be off beyond its standard error.
trial_margin <- function(model) {
  if (is_verified(model)) 0
  else if (is_confirmed(model)) rules$trial_margin
  else rules$trial_doubt * (1 + (model$fit$check$ratio %||% 1))
}

# The next trial to verify, or NULL: the one of highest bound, if it may be adopted and may lead.
next_to_verify <- function(trials, present, context) {
  open <- Filter(function(model) model$level == "tried" && !raises_simulation(model, present), trials)
  if (!length(open)) return(NULL)
  bound <- vapply(open, upper_bound, 0, present)
  needed <- context$control$decisive
  verified <- Filter(function(model) is_verified(model) && !raises_simulation(model, present), trials)
  if (length(verified)) needed <- max(needed, vapply(verified, log10_factor, 0, present))
  best <- which.max(bound)
  if (bound[best] >= needed) open[[best]]$mechanism
}

raises_simulation <- function(model, present) {
  is_verified(model) && error_ratio(model$fit, present$fit) > risen_error
}

# A trial that its runs confirm has had its first round.
verify_trial <- function(model, context) {
  verify_model(model, context, first = if (is_confirmed(model)) rules$least_rounds else 1)
}

# All trials on the present model and those in front verified: list(trials, present).
race <- function(present, trials, context) {
  repeat {
    name <- next_to_verify(trials, present, context)
    if (is.null(name) || is_spent(context)) break
    trials[[name]] <- staged(paste("verifying", name), verify_trial(trials[[name]], context))
    report_trial(trials[[name]], present, context)
  }
  trials
}
