# Pairs of mechanisms. Two that nearly cancel take little of the error away alone, and all of it
# together. What their trials have seen tells without a run which pairs promise that. These are
# tried as mechanisms of the catalogue are, and must earn what two of them must.

# list(state, trials, context): trials of pairs, raced and confirmed by what `context` asks of them;
# the state has their entries in its catalogue and knows what its present model loses without their
# conditions.
try_pairs <- function(state, trials, context) {
  pairs <- if (leaves_much(state$present)) promising_pairs(state, trials)
  context$control$decisive <- 2 * context$control$decisive
  if (!length(pairs)) return(list(state = state, trials = list(), context = context))
  known <- with_entries(state$catalogue[names(trials)], pairs)
  state$catalogue <- with_entries(state$catalogue, pairs)
  state$present <- with_losses(state$present, known, state$present$lost, context)
  off <- lapply(trials, `[[`, "off")
  tried <- list()
  for (name in names(pairs)) {
    if (is_spent(context)) break
    simulators <- extended_simulators(pairs[[name]], state)
    bar <- bar_of(tried, state$present, context)
    tried[[name]] <- staged(name, try_mechanism(state$present, name, simulators,
                                                off_of_pair(pairs[[name]], off), bar, context))
    report_trial(tried[[name]], state$present, context)
  }
  tried <- confirm_best(race(state$present, tried, context), state$present, context)
  list(state = state, trials = tried, context = context)
}

# Where both are switched off, if that is known.
off_of_pair <- function(pair, off) {
  each <- off[pair$of]
  if (!any(vapply(each, is.null, NA))) unlist(unname(each))
}

# The pairs that promise to take the error away, and most of it only together; those that promise
# most, if they can be applied.
promising_pairs <- function(state, trials) {
  present <- state$present
  changes <- Filter(length, lapply(trials, largest_change, present, state$catalogue))
  if (length(changes) < 2) return(list())
  left <- function(names) least_error_with(present, do.call(cbind, changes[names]))
  none <- left(character())
  alone <- none - vapply(names(changes), left, 0)
  pairs <- utils::combn(names(changes), 2, simplify = FALSE)
  known <- names(present$parameters)
  brought <- lapply(trials, function(trial) setdiff(names(trial$parameters), known))
  pairs <- Filter(function(pair) !any(brought[[pair[1]]] %in% brought[[pair[2]]]), pairs)
  if (!length(pairs)) return(list())
  after <- vapply(pairs, left, 0)
  together <- none - after
  apart <- vapply(pairs, function(pair) sum(alone[pair]), 0)
  enough <- after - 1 < rules$cause_leaves * (none - 1)
  promising <- pairs[order(after)][(enough & apart < rules$pair_share * together)[order(after)]]
  entries <- lapply(utils::head(promising, rules$pairs), paired_mechanism, state$catalogue)
  names(entries) <- vapply(entries, `[[`, "", "name")
  Filter(function(entry) can_be_made(entry, state), entries)
}

can_be_made <- function(entry, state) {
  tryCatch(length(extended_simulators(entry, state)) > 0,
           amiss_error_edit = function(e) FALSE)
}

# What a mechanism did most to the output of the present model, all else as in that; NULL if that
# was not seen.
largest_change <- function(trial, present, catalogue) {
  if (!trial$level %in% c("tried", "verified")) return(NULL)
  if (describes(catalogue[[trial$mechanism]])) return(NULL)
  at <- present$present$at
  from <- present$runs$z[at, ]
  if (!all(names(from) %in% colnames(trial$runs$z))) return(NULL)  # it replaces a part
  z <- trial$runs$z[, names(from), drop = FALSE]
  looked <- which(succeeded(trial) & colSums(t(z) != from) == 0)
  changes <- trial$runs$outputs[, looked, drop = FALSE] - present$runs$outputs[, at]
  size <- colSums(changes^2)
  if (any(size > 0)) changes[, which.max(size), drop = FALSE]
}

# The mean square of the error over the noise that least squares leaves: the present model along its
# tangent, with changes of its output, each between none of it and all.
least_error_with <- function(present, changes) {
  k <- if (is.null(changes)) 0 else ncol(changes)
  start <- present$present
  z <- present$runs$z[start$at, ]
  error <- (present$target - present$runs$outputs[, start$at]) / present$noise
  ways <- cbind(start$slopes, changes) / present$noise
  limits <- list(lower = c(present$space$lower - z, numeric(k)),
                 upper = c(present$space$upper - z, rep(1, k)))
  precision <- conditioned(crossprod(ways))
  best <- within_limits(solve(precision, crossprod(ways, error)[, 1]), precision, limits)
  mean((error - ways %*% best)^2)
}
