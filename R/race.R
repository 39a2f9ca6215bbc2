# Mechanisms as extensions of the present model: a trial of each from the present mode, as long as
# it can still win; then those in front are verified, until the leader is exact and nobody can reach
# it.

# The present model as its trials see it: at its run of least squares.
as_present <- function(model, catalogue, context) {
  model <- with_losses(model, catalogue, context)
  if (model$level == "given") return(model)
  least <- model$least
  model$present <- list(at = least$at, slopes = least$slopes,
                        history = tangent_at(model, least$at, least$slopes, moves_of(model, least),
                                             context)$history)
  model
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
  if (!length(looked$starts)) {
    return(utils::modifyList(model, list(level = if (is_spent(context)) "missed" else "untried")))
  }
  search <- search_trial(looked, context)
  model$starts <- search$starts
  model <- with_least(with_modes(search$model, list(search), context$seed), context)
  model$off <- looked$off
  model$status <- search$status
  model <- tried_model(model, present, bar, context)
  model$own_runs <- runs_spent(context) - before
  model
}

# A search from the most promising start of the first look. An extension holds the present model,
# with its mechanism switched off, and cannot be worse: if the search ends below that, or no nearer
# to the record, it goes on from the next start with the mechanism on. `starts`: those that are
# left.
search_trial <- function(looked, context) {
  model <- looked$model
  is_on <- vapply(looked$starts, function(start) !start$at %in% looked$off_at, NA)
  starts <- looked$starts[is_on | seq_along(is_on) == 1]
  best <- NULL
  for (tried in seq_len(min(length(starts), rules$trial_starts))) {
    start <- starts[[tried]]
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
  best[c("model", "starts")] <- list(model, starts[-seq_len(tried)])
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
  if (setequal(kept, old) && all(change == 0)) return(list(model = model, silent = TRUE))
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
  z <- within_limits(tangent$mean, solve(tangent$covariance), model$space)
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

# Whether a trial needs no further runs: they confirm it, it could not win if they did, or it will
# be verified whatever they say.
is_clear <- function(model, present, bar) {
  is_confirmed(model) || !could_win(model, present, bar) || is_ahead(model, present, bar)
}

# What a mechanism explains: the log10 Bayes factor with no unknown response to its conditions in
# either model.
log10_factor <- function(model, present) beside_unknown(model, present) + (model$taken %||% 0)

# The same with such a response in both.
beside_unknown <- function(model, present)
  (model$fit$log_evidence - present$fit$log_evidence) / log(10)

# What ranks mechanisms: that with no unknown response to any condition of the catalogue.
standing_of <- function(model, present) {
  beside_unknown(model, present) + (model$taken_of_all %||% model$taken %||% 0)
}

# By how much its log10 Bayes factors may be off; `leader` is the best model that is known.
doubt_of <- function(model, present, leader = present) {
  if (is_promising(model, present, leader)) return(Inf)
  3 * min(factor_error(model, present), rules$worst_error) + trial_margin(model)
}

factor_error <- function(model, present) {
  sqrt(model$fit$standard_error^2 + present$fit$standard_error^2) / log(10)
}

# A trial whose emulator runs refute, or about whose evidence they say nothing, though it is nearer
# to the record at its best than the leader.
is_promising <- function(model, present, leader = present) {
  if (is_verified(model)) return(FALSE)
  is_open <- isFALSE(model$fit$check$passed) || factor_error(model, present) > rules$worst_error
  is_open && least_error(model) < rules$promising_error * least_error(leader)
}

least_error <- function(model) sqrt(mean(left_by_simulation(model$fit)^2))

# What a mechanism must reach to be adopted, as far as `trials` show: a decisive `factor`, and a
# `standing` that none of those surely has that may be adopted.
bar_of <- function(trials, present, context) {
  bar <- list(factor = context$control$decisive, standing = -Inf)
  surely <- Filter(function(model) {
    isTRUE(model$fit$trust$trusted) && !cannot_be_adopted(model, present) &&
      is_ahead(model, present, bar)
  }, trials)
  least <- vapply(surely, function(model) standing_of(model, present) - doubt_of(model, present), 0)
  list(factor = bar$factor, standing = max(bar$standing, least))
}

could_win <- function(model, present, bar, leader = present) {
  doubt <- doubt_of(model, present, leader)
  log10_factor(model, present) + doubt >= bar$factor &&
    standing_of(model, present) + doubt >= bar$standing
}

is_ahead <- function(model, present, bar) {
  doubt <- doubt_of(model, present)
  log10_factor(model, present) - doubt > bar$factor &&
    standing_of(model, present) - doubt > bar$standing
}

# The next trial to verify, or NULL: the one that ranks highest of those that may be adopted and may
# lead, so that what the others must reach is known early; then, of those whose evidence says
# nothing yet, the one that is nearest to the record.
next_to_verify <- function(trials, present, context) {
  adoptable <- Filter(Negate(function(model) cannot_be_adopted(model, present)), trials)
  open <- Filter(function(model) model$level == "tried", adoptable)
  if (!length(open)) return(NULL)
  leader <- leader_of(Filter(is_verified, adoptable), present, context$control$decisive)
  bar <- list(factor = context$control$decisive,
              standing = if (is.null(leader)) -Inf else standing_of(leader, present))
  open <- Filter(function(model) could_win(model, present, bar, leader %||% present), open)
  is_near <- vapply(open, is_promising, NA, present, leader %||% present)
  if (!all(is_near)) {
    open <- open[!is_near]
    return(open[[which.max(vapply(open, standing_of, 0, present))]]$mechanism)
  }
  if (length(open)) open[[which.min(vapply(open, least_error, 0))]]$mechanism
}

# Of models with a decisive factor the one that ranks highest, or NULL.
leader_of <- function(models, present, decisive) {
  models <- Filter(function(model) log10_factor(model, present) >= decisive, models)
  if (length(models)) models[[which.max(vapply(models, standing_of, 0, present))]]
}

# Further runs of a model whose check has passed change neither.
cannot_be_adopted <- function(model, present) {
  (is_verified(model) || has_passed(model)) && is_refused(model, present)
}

is_refused <- function(model, present) {
  at_most <- beside_unknown(model, present) + if (is_verified(model)) 0
                                              else doubt_of(model, present)
  error_ratio(model$fit, present$fit) > rules$fallen_error || speaks_against(at_most)
}

settled_trial <- function(model, present, bar, context) {
  if (!asks_for_checks(model, present, bar)) return(verify_trial(model, present, context))
  model$rechecked <- TRUE
  tried_model(model, present, bar, context)
}

# Whether a few runs more may show that a trial cannot win, for a tenth of what its verification
# costs: once.
asks_for_checks <- function(model, present, bar) {
  is_open <- !is_confirmed(model) && !is_promising(model, present) && is.null(model$rechecked)
  is_open && (is_refused(model, present) || !is_ahead(model, present, bar))
}

# A trial that its runs confirm has had its first round.
verify_trial <- function(model, present, context) {
  before <- if (is_confirmed(model)) model$fit$log_evidence
  model <- verify_model(model, context, before, rules$trial_rounds)
  with_taken(model, present, context)
}

# A trial searched again, far from where it ended: an extension may have a better mode there, with
# another part of the model in the place that its mechanism takes. First from what is left of its
# first look, then from runs over all priors. As it was if none is found.
widened_trial <- function(trial, present, bar, context) {
  searched <- search_again(trial, trial$starts, rules$trial_stale, context)
  if (!comes_nearer(searched$model, which.min(squared_misfit(searched$model)), trial$least$at)) {
    model <- over_priors(searched$model, context)
    starts <- lapply(start_runs(model, trial$mode)[-1],
                     function(at) list(at = at, slopes = regression_slopes(model, at)))
    further <- search_again(model, starts, rules$scout_stale, context)
    searched <- list(model = further$model, modes = c(searched$modes, further$modes))
  }
  trial$starts <- NULL
  trial$runs <- searched$model$runs
  if (!length(searched$modes)) return(trial)
  found <- ranked_modes(searched$model, c(list(own_mode(trial, context)), searched$modes), context)
  best <- found$modes[[1]]
  trial$runs <- found$model$runs
  if (best$at == trial$mode) return(trial)
  again <- tried_model(with_modes(trial, list(best), context$seed), present, bar, context)
  if (standing_of(again, present) > standing_of(trial, present)) return(again)
  trial$runs <- again$runs
  trial
}

search_again <- function(model, starts, stale, context) {
  modes <- list()
  for (start in starts) {
    if (is_spent(context)) break
    search <- run_search(begin_search(model, start$at, start$slopes, stale), context)
    model <- search$model
    modes <- c(modes, list(search))
  }
  list(model = model, modes = modes)
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

# If a step ends without a cause of the error, though much of it is left: trials searched again, the
# one nearest to the record first, until one of them is its cause.
second_look <- function(present, trials, context) {
  for (name in nearest_first(trials)) {
    if (is_spent(context)) break
    bar <- bar_of(trials, present, context)
    before <- trials[[name]]
    trials[[name]] <- staged(paste(name, "again"), widened_trial(before, present, bar, context))
    if (trials[[name]]$mode != before$mode) report_trial(trials[[name]], present, context)
    is_decisive <- is_ahead(trials[[name]], present, replace(bar, "standing", -Inf))
    if (!is_decisive || is_refused(trials[[name]], present)) next
    trials <- race(present, trials, context)
    if (has_cause(trials, present, context)) return(trials)
  }
  race(present, trials, context)
}

nearest_first <- function(trials) {
  searched <- Filter(function(trial) trial$level %in% c("tried", "verified"), trials)
  names(searched)[order(vapply(searched, least_error, 0))]
}

# Whether a trial may be adopted that takes the error away.
has_cause <- function(trials, present, context) {
  decisive <- context$control$decisive
  best <- best_trial(trial_table(trials, present, names(trials), decisive), decisive)
  may_be_adopted(best, decisive) && takes_error(trials[[best$mechanism]], present)
}

# Whether a model leaves little of the error, or of what was beyond the noise.
takes_error <- function(model, present) {
  !leaves_much(model) ||
    left_over_noise(model)^2 - 1 < rules$cause_leaves * (left_over_noise(present)^2 - 1)
}

# Whether what the simulation leaves at its best is large beside the noise; fitted parameters are no
# agreement. Of given runs there are no others to look at.
leaves_much <- function(model) {
  model$level != "given" && left_over_noise(model) > rules$large_remainder
}

left_over_noise <- function(model) {
  n <- length(model$target)
  left <- over_noise(model, model$runs$outputs[, model$least$at] - model$target)
  left * sqrt(n / max(1, n - length(model$parameters)))
}

# All trials on the present model and those in front verified: list(trials, present).
race <- function(present, trials, context) {
  repeat {
    name <- next_to_verify(trials, present, context)
    if (is.null(name) || is_spent(context)) break
    bar <- bar_of(trials[names(trials) != name], present, context)
    trials[[name]] <- staged(paste("verifying", name),
                             settled_trial(trials[[name]], present, bar, context))
    report_trial(trials[[name]], present, context)
  }
  trials
}

report_trial <- function(trial, present, context) {
  what <- switch(trial$level, silent = "changes nothing", failed = "could not be computed",
                 untried = "could not be tried: its runs failed", missed = "the budget ended",
                 sprintf("log10 Bayes factor %s%s", signed(log10_factor(trial, present)),
                         if (trial$level == "verified") ", verified by runs" else ""))
  context$say("  {trial$mechanism}: {what}")
  if (trial$level == "silent") warn_no_response(trial$mechanism)
  if (trial$level == "untried") {
    warn_result(c(paste("Mechanism {.val {trial$mechanism}} could not be tried: every run of its",
                        "first look failed."),
                  i = "Run its simulator at a point of its priors, and see what it returns."),
                class = "amiss_warning_trial")
  }
  if (trial$level == "failed") {
    warn_result(c("Mechanism {.val {trial$mechanism}} could not be tried.", x = "{trial$reason}"),
                class = "amiss_warning_trial")
  }
}

warn_no_response <- function(mechanism) {
  warn_input(c(
    paste("Mechanism {.val {mechanism}} changes nothing: every run with it is that of the model",
          "without it."),
    i = paste("Does this record hold what it acts on, and does the simulator use its parameters?",
              "See {.code vignette(\"mechanisms\")}, Inside a simulator.")))
}
