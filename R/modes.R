# The modes of a model's parameters: what searches from several starts lead to, whether they agree,
# and the region that holds them.

# list(model, modes, agree): the base model after scouts and searches, the best mode first.
find_modes <- function(model, context) {
  model <- with_scouts(model, context)
  check_repeats(model, context)
  starts <- start_runs(model)
  first <- from_images(more_modes(model, list(), starts[1], context), context)
  more_modes(first$model, first$modes, starts[-1], context)
}

# Searches beside those that are known, until a second one ends at the best mode: list(model, modes,
# agree). `begin`: how a search begins from a start, beside the modes that are known.
more_modes <- function(model, modes, starts, context, begin = begun_from) {
  agree <- FALSE
  for (start in starts) {
    if (is_spent(context) && length(modes)) break
    search <- run_search(begin(model, start, modes, context), context)
    model <- search$model
    modes <- c(modes, list(known_image(model, search, modes) %||% search))
    if (length(modes) < 2) next
    ranked <- ranked_modes(model, modes, context)
    model <- ranked$model
    modes <- ranked$modes
    agree <- ranked$agree
    if (agree) break
  }
  list(model = model, modes = modes, agree = agree)
}

# What is remembered of searches: whether they agree, how many there were, where they ended, and the
# log posterior there (NA if there was nothing to compare it with).
told_modes <- function(found) {
  ends <- vapply(found$modes, `[[`, 0, "at")
  model <- found$model
  list(agree = found$agree, searches = length(found$modes), ends = ends,
       heights = vapply(found$modes, function(mode) mode$value %||% NA_real_, 0),
       points = values_of_runs(model, ends),
       covariances = lapply(found$modes, `[[`, "covariance"))
}

# The first search begins with slopes by regression on the runs over the priors. The next ones are
# there to find other modes than the `known` ones: slopes over the priors would lead them back, so
# that theirs are taken where they begin.
begun_from <- function(model, start, modes, context) {
  if (length(modes)) {
    found <- difference_slopes(model, start, context)
    model <- found$model
    if (!is.null(found$slopes)) return(begin_search(model, start, found$slopes, found$stale))
  }
  begin_search(model, start, regression_slopes(model, start), rules$scout_stale)
}

# Runs over the priors, as many as it takes to begin; those that are known count.
with_scouts <- function(model, context) {
  n <- max(0, wanted_scouts(model) - nrow(model$runs$z))
  if (n == 0) return(model)
  unit <- with_seed(context$seed, lhs::randomLHS(n, length(model$parameters)))
  made <- with_runs(model, from_unit(unit, model$space), context)
  model <- made$model
  model$over_priors <- c(model$over_priors, made$at)
  check_some_succeeded(model)
  for (rows in model$rows)
    check_runs_change(model$runs$outputs[rows, succeeded(model), drop = FALSE])
  model
}

wanted_scouts <- function(model)
  model$scouts %||% (rules$scouts_base + rules$scouts_parameter * length(model$parameters))

# A run that is made again must give what it gave: no slope could be trusted otherwise. The
# package's own simulators do. What a cache had says nothing.
check_repeats <- function(model, context, call = rlang::caller_env()) {
  at <- which(succeeded(model))[1]
  known <- vapply(model$simulators, inherits, NA, c("amiss_zone", "amiss_network"))
  if (all(known) || runs_left(context) < length(known)) return(invisible())
  found <- found_so_far()
  again <- run_at(model, model$runs$z[at, , drop = FALSE], context, "repeated")
  change <- over_noise(model, again$outputs[, 1] - model$runs$outputs[, at])
  if (found_so_far() > found || !isTRUE(change > rules$random_change)) return(invisible())
  abort_input(c(paste("The simulator is random: two runs at the same values differ by",
                      "{short(change)} times the noise."),
                x = "These values are {point_words(values_of_runs(model, at))}.",
                i = paste("Let it draw the same random numbers in each run, so that runs differ by",
                          "their parameters alone."),
                i = paste("If runs were made elsewhere, check that the simulator at hand is the",
                          "one that made them.")), call = call)
}

values_of_runs <- function(model, at)
  unit_to_values(to_unit(model$runs$z[at, , drop = FALSE], model$space), model$parameters)

check_some_succeeded <- function(model, call = rlang::caller_env()) {
  if (sum(succeeded(model)) >= min(rules$least_succeeded, nrow(model$runs$z))) return(invisible())
  n <- nrow(model$runs$z)
  failed <- which(!succeeded(model))
  said <- failure_words(model, failed[1])
  abort_input(c("{length(failed)} of {n} runs over the priors failed.",
                x = paste("The first is run {failed[1]} at",
                          "{point_words(values_of_runs(model, failed[1]))}."),
                x = if (length(said)) "{said}",
                i = paste("Find out why the simulator fails there, or narrow the priors. If every",
                          "run fails, look for a mistake in the simulator first.")), call = call)
}

# Where searches begin: the run nearest to the record; the nearest of the half that lies farther
# from it; and so on, each time of the half that lies farther from all before.
start_runs <- function(model, starts = NULL, among = seq_len(nrow(model$runs$z))) {
  misfit <- model$runs$squares
  misfit[!succeeded(model) | !seq_along(misfit) %in% among] <- Inf
  starts <- starts %||% which.min(misfit)
  for (k in seq_len(max(0, min(rules$most_starts, sum(is.finite(misfit))) - 1))) {
    apart <- apply(model$runs$z, 1,
                   function(z) min(colSums((t(model$runs$z[starts, , drop = FALSE]) - z)^2)))
    far <- is.finite(misfit) & apart >= stats::median(apart[is.finite(misfit)]) & apart > 0
    if (!any(far)) break
    starts <- c(starts, which(far)[which.min(misfit[far])])
  }
  starts
}

# The modes by their values, which are compared by the draws of all of them, the best first; `agree`
# if another search ended at the mode of the best.
ranked_modes <- function(model, modes, context) {
  at <- vapply(modes, `[[`, 0, "at")
  each <- vapply(modes, function(mode) values_at(model, at, mode$history, mode$moves, context), at)
  value <- apply(matrix(each, length(at)), 1, log_mean_exp)
  order <- order(-value)
  modes <- Map(function(mode, value) replace(mode, "value", value), modes[order], value[order])
  for (other in modes[-1]) {
    same <- is_same_mode(model, modes[[1]], other, context)
    model <- same$model
    if (same$yes) return(list(model = model, modes = modes, agree = TRUE))
  }
  list(model = model, modes = modes, agree = FALSE)
}

# Of one height, near each other as both see it, or without a valley between them: a ridge is one
# mode, and the region holds all modes of one height. list(model, yes).
is_same_mode <- function(model, one, other, context) {
  if (one$value - other$value < rules$same_height) return(list(model = model, yes = TRUE))
  apart <- model$runs$z[other$at, ] - model$runs$z[one$at, ]
  distance <- function(covariance) sum(apart * solve(conditioned(covariance), apart))
  farther <- max(distance(one$covariance), distance(other$covariance))
  if (farther < rules$same_mode * length(apart)) {
    return(list(model = model, yes = TRUE))
  }
  if (one$value - other$value > rules$mode_depth) return(list(model = model, yes = FALSE))
  made <- with_runs(model, rbind(model$runs$z[one$at, ] + apart / 2), context)
  if (!length(made$at)) return(list(model = model, yes = FALSE))
  between <- values_at(made$model, made$at, one$history, one$moves, context)
  list(model = made$model, yes = between > other$value - rules$same_height)
}

# ---- the region that holds them

# Those that count beside the best.
counting_modes <- function(modes) {
  value <- vapply(modes, function(mode) mode$value %||% 0, 0)
  modes[value > max(value) - rules$mode_depth]
}

# Equally many draws of each of them.
region_of_modes <- function(model, modes, seed) {
  draws <- lapply(counting_modes(modes), function(mode) {
    draws_within(mode$mean, mode$covariance, model$space, rules$region_draws, seed)
  })
  unit <- to_unit(do.call(rbind, draws), model$space)
  region_of_draws(unit, rep(1, nrow(unit)), model$parameters)
}
