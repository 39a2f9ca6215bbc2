# What a trial is worth against the present model, by how much that may be off, and whether it can
# still win.

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

# How far the evidence may be off beyond its standard error.
trial_margin <- function(model) {
  if (is_verified(model)) 0
  else if (has_passed(model)) rules$trial_margin
  else rules$trial_doubt * (1 + min(rules$worst_ratio, model$fit$check$ratio %||% 1))
}

has_passed <- function(model) isTRUE(model$fit$check$passed)

# Whether its check says what its evidence is, too.
is_confirmed <- function(model)
  has_passed(model) && isTRUE(model$fit$check$effective >= rules$effective_trial)

# A trial whose emulator runs refute, or about whose evidence they say nothing, though it is nearer
# to the record at its best than the leader.
is_promising <- function(model, present, leader = present) {
  if (is_verified(model)) return(FALSE)
  is_open <- isFALSE(model$fit$check$passed) || factor_error(model, present) > rules$worst_error
  is_open && least_error(model) < rules$promising_error * least_error(leader)
}

least_error <- function(model) sqrt(mean(left_by_simulation(model$fit)^2))

# The simulation's own error in calibration over that of the fit `current`.
error_ratio <- function(fit, current) {
  sqrt(mean(left_by_simulation(fit)^2) / mean(left_by_simulation(current)^2))
}

is_refused <- function(model, present) {
  at_most <- beside_unknown(model, present) + if (is_verified(model)) 0
                                              else doubt_of(model, present)
  error_ratio(model$fit, present$fit) > rules$fallen_error || speaks_against(at_most)
}

speaks_against <- function(factor) factor < rules$against

# Further runs of a model whose check has passed change neither.
cannot_be_adopted <- function(model, present) {
  (is_verified(model) || has_passed(model)) && is_refused(model, present)
}

# What a mechanism must reach to be adopted, as far as `trials` show: a decisive `factor`, and a
# `standing` that none of those surely has that may be adopted; and the `leader`, which has it.
bar_of <- function(trials, present, context) {
  bar <- list(factor = context$control$decisive, standing = -Inf, leader = present)
  surely <- Filter(function(model) {
    isTRUE(model$fit$trust$trusted) && !cannot_be_adopted(model, present) &&
      is_ahead(model, present, bar)
  }, trials)
  least <- vapply(surely, function(model) standing_of(model, present) - doubt_of(model, present), 0)
  if (!length(surely)) return(bar)
  list(factor = bar$factor, standing = max(least), leader = surely[[which.max(least)]])
}

could_win <- function(model, present, bar) {
  doubt <- doubt_of(model, present, bar$leader)
  log10_factor(model, present) + doubt >= bar$factor &&
    standing_of(model, present) + doubt >= bar$standing
}

is_ahead <- function(model, present, bar) {
  doubt <- doubt_of(model, present)
  log10_factor(model, present) - doubt > bar$factor &&
    standing_of(model, present) - doubt > bar$standing
}

# Whether a trial needs no further runs: they confirm it, it could not win if they did, or it will
# be verified whatever they say.
is_clear <- function(model, present, bar) {
  is_confirmed(model) || !could_win(model, present, bar) || is_ahead(model, present, bar)
}

# Whether a few runs more may show that a trial cannot win, for a tenth of what its verification
# costs: once.
asks_for_checks <- function(model, present, bar) {
  is_open <- !is_confirmed(model) && !is_promising(model, present) && is.null(model$rechecked)
  is_open && (is_refused(model, present) || !is_ahead(model, present, bar))
}
