# Where the parameters lie, by the simulator itself: least squares, first in units of the noise,
# then by the error and the discrepancy that remain, with the prior, by steps within a trusted
# distance (Levenberg 1944; More 1978). About its best run a search knows the simulator by slopes,
# and by the least curvature that the runs near it ask for. Each run corrects both, so that a step
# costs one run.

# A search from run `at` of a model. `slopes` are right at that run to within what they change over
# `stale` standard deviations of the prior. `off`: the run at which the mechanism of a trial is
# switched off; the search ends if all that it promises beyond that could not make evidence.
# `alone`: whether it knows no runs but its own, so that those of others do not lead it to their
# mode. `gain`: promised gain in nats below which least squares have converged.
begin_search <- function(model, at, slopes, stale, steps = rules$search_steps, off = NULL,
                         alone = FALSE, gain = rules$search_gain) {
  list(model = model, at = at, steps = steps, off = off, step = 0, trusted = Inf, failed = 0,
       poor = 0, since = 0, weighted = FALSE, gain = gain,
       reference = list(z = model$runs$z[at, ], slopes = slopes, stale = stale,
                        others = if (alone) nrow(model$runs$z) else 0), slopes = slopes,
       status = "going")
}

# `least`: the run of least squares, where the simulation is at its best, and the slopes there: what
# the discrepancy keeps out of.
run_search <- function(search, context) {
  search <- descend(search, context)
  search$least <- search[c("at", "slopes")]
  search <- look(search, context)
  for (round in seq_len(rules$weighted_rounds)) {
    if (search$status %in% c("budget", "arrived")) return(search)
    if (is_futile(search, context)) return(replace(search, "status", "futile"))
    if (promised_by(search) < rules$search_gain) return(replace(search, "status", "converged"))
    # At least half of its steps are left for the mode of the posterior.
    if (!search$weighted) search$step <- min(search$step, search$steps %/% 2)
    search <- utils::modifyList(search, list(weighted = TRUE, status = "going", failed = 0,
                                             trusted = search$trusted * rules$trust_changes))
    search["gains"] <- list(NULL)
    search <- look(descend(search, context), context)
    if (search$status != "converged") return(search)
  }
  search
}

descend <- function(search, context) {
  while (!finished(search)) {
    search <- propose(with_given_slopes(search), context)
    if (finished(search)) break
    made <- with_runs(search$model, rbind(search$proposal), context)
    search$model <- made$model
    search <- accept(search, made$at, context)
    if (!finished(search) && needs_slopes(search)) search <- renew_slopes(search, context)
  }
  search <- with_given_slopes(search)
  search$slopes <- secant_slopes(search$model, search$at, search$reference)
  search
}

finished <- function(search) search$status != "going"

# A simulator that knows its slopes gives them at each run that the search has come to.
with_given_slopes <- function(search) {
  z <- search$model$runs$z[search$at, ]
  if (search$reference$stale == 0 && all(search$reference$z == z)) return(search)
  known <- given_slopes(search$model, z)
  if (!is.null(known)) search$reference <- reference_here(search, known, 0)
  search
}

# Slopes by differences cost a run a parameter: they are worth it if steps failed in a row, or if as
# many were made and some of them were poor.
needs_slopes <- function(search) {
  enough <- search$since >= length(search$model$parameters)
  search$failed == rules$renew_after || search$poor >= rules$renew_after && enough
}

# The posterior under the tangent, with error and discrepancy sampled under it.
look <- function(search, context) {
  search[c("mean", "covariance", "history", "moves")] <- tangent_at(
    search$model, search$at, search$slopes, moves_of(search$model, search$least), context)
  search
}

# How far a model moves about its run of least squares: its slopes there for a unit of the normal
# quantile of each parameter (Plumlee 2017), in the mean over what least squares leaves open, so
# that neighbours on a ridge move alike. A parameter that is pressed against the end of a flat prior
# moves little: what it cannot do any more, the discrepancy may. They depend on simulator and
# record alone.
moves_of <- function(model, least) sweep(least$slopes, 2, normal_units(model, least), "*")

normal_units <- function(model, least) {
  open <- left_open(model, least)
  draws <- draws_within(open$mean, open$covariance, model$space, rules$open_draws, 1)
  vapply(seq_len(ncol(draws)), function(j) sqrt(mean(per_normal(draws[, j], model$space[j, ])^2)),
         0)
}

# The parameters by least squares in units of the noise.
left_open <- function(model, least) {
  line <- list(output = model$runs$outputs[, least$at], slopes = least$slopes)
  found <- squares_of_line(list(model = model, weighted = FALSE), model$runs$z[least$at, ], line)
  list(mean = found$mean, covariance = solve(conditioned(found$precision)))
}

# What its optimum would gain.
promised_by <- function(search) {
  precision <- solve(conditioned(search$covariance))
  way <- within_limits(search$mean, precision, search$model$space) -
    search$model$runs$z[search$at, ]
  sum(way * (precision %*% way)) / 2
}

# The next run: the optimum of the bent line within the trusted distance. The slopes are those of
# the bent line: if it rises everywhere where its optimum is looked for, that was too far away.
propose <- function(search, context) {
  model <- search$model
  z <- model$runs$z[search$at, ]
  bent <- bent_line(model, search$at, search$reference)
  line <- along(bent, 0 * z)
  search$slopes <- line$slopes
  first <- squares_of_line(search, z, line, context)
  search$promised <- first$promised
  within <- search$trusted
  for (try in seq_len(rules$bent_tries)) {
    found <- optimum_of_bend(search, bent, line, first, within, context)
    if (found$gain > 0) break
    within <- rules$least_shrinkage * found$length
  }
  search$proposal <- stats::setNames(found$z, names(z))
  search$predicted <- found$gain
  if (search$step >= search$steps) search$status <- "steps"
  # What the slopes promise, or the bend leaves of it unless the distance does.
  open <- min(search$promised, if (is.infinite(within) || found$gain <= 0) found$gain)
  nats <- nats_of(search, found$from)
  if (open < search$gain * nats) search$status <- "converged"
  # A search that cannot come nearer to the record than the run without the mechanism is.
  if (!search$weighted && search$step > 0 && !is.null(search$off) &&
      found$from - search$promised > squared_misfit(model)[search$off] - rules$futile_gain)
    search$status <- "behind"
  search
}

# The best of Gauss-Newton steps on the bent line: list(z, gain, from, length), what it gains by the
# bent line, the misfit where the search is, and how far the first step went.
optimum_of_bend <- function(search, bent, line, best, within, context) {
  model <- search$model
  z <- model$runs$z[search$at, ]
  tried <- rbind(z)
  outputs <- cbind(line$output)
  for (inner in seq_len(rules$bent_steps)) {
    to <- step_within(best, z, within, model$space, bent$scale)
    line <- along(bent, to - z)
    moved <- max(abs(to - tried[nrow(tried), ]))
    tried <- rbind(tried, to)
    outputs <- cbind(outputs, line$output)
    if (moved < rules$bent_moved) break
    best <- squares_of_line(search, to, line, context)
  }
  misfit <- misfit_of(search, outputs, tried, context)
  lowest <- which.min(misfit[-1]) + 1
  list(z = tried[lowest, ], gain = misfit[1] - misfit[lowest], from = misfit[1],
       length = sqrt(sum((bent$scale * (tried[2, ] - z))^2)))
}

# Minus the log posterior density of runs: at first as if all of the error were white noise of the
# stated size, so that a search goes wherever the simulation comes nearest to the record; then by
# draws of error and discrepancy.
misfit_of <- function(search, outputs, z, context) {
  if (search$weighted) -values_of(search$model, outputs, z, search$history, search$moves, context)
  else squared_misfit(search$model, squared_errors(search$model, outputs), z)
}

# By the sums of the squares of the errors over the noise.
squared_misfit <- function(model, squares = model$runs$squares, z = model$runs$z) {
  misfit <- 0.5 * squares + 0.5 * rowSums(z[, !model$space$flat, drop = FALSE]^2)
  ifelse(is.finite(misfit), misfit, Inf)
}

nats_of <- function(search, misfit) if (search$weighted) 1 else squared_nats(search$model, misfit)

# White noise of the stated size makes too many nats of a misfit that is larger: what counts as one.
squared_nats <- function(model, misfit) max(1, 2 * misfit / length(model$target))

# The least squares of a line through z: precision, optimum `mean`, and what it promises to gain.
squares_of_line <- function(search, z, line, context) {
  model <- search$model
  if (search$weighted) {
    found <- tangent_given(model, z, line$output, line$slopes, search$history, search$moves,
                           context)
    precision <- solve(conditioned(found$covariance))
    mean <- found$mean
  } else {
    slopes <- line$slopes / model$noise
    # Beside slopes of any size the sum stays one that can be solved.
    prior <- pmax(ifelse(model$space$flat, rules$flat_precision, 1), 1e-13 * sum(slopes^2))
    precision <- crossprod(slopes) + diag(prior, length(z))
    pull <- crossprod(slopes, (model$target - line$output) / model$noise)[, 1] - prior * z
    mean <- z + solve(precision, pull)
  }
  way <- within_limits(mean, precision, model$space) - z
  list(mean = mean, precision = precision,
       promised = sum((mean - z) * (precision %*% way)) - 0.5 * sum(way * (precision %*% way)))
}

# Its optimum no farther than `trusted` from z, by as much damping as that takes.
step_within <- function(squares, z, trusted, space, scale) {
  damped <- function(damping) {
    damping <- damping * scale^2
    precision <- squares$precision + diag(damping, length(z))
    target <- solve(precision, squares$precision %*% squares$mean + damping * z)[, 1]
    within_limits(target, precision, space)
  }
  is_near <- function(to) sum((scale * (to - z))^2) <= trusted^2
  to <- damped(0)
  if (is_near(to)) return(to)
  ends <- log10(max(diag(squares$precision))) + c(-12, 6)
  for (half in 1:20) {
    if (is_near(damped(10^mean(ends)))) ends[2] <- mean(ends) else ends[1] <- mean(ends)
  }
  damped(10^ends[2])
}

# Whether the evidence could not exceed that of the run without the mechanism by much, if all went
# as the tangent says.
is_futile <- function(search, context) {
  if (is.null(search$off)) return(FALSE)
  value <- values_at(search$model, c(search$at, search$off), search$history, search$moves, context)
  isTRUE(value[1] + promised_by(search) - value[2] < rules$futile_gain)
}

accept <- function(search, made, context) {
  if (!length(made)) {
    search$status <- "budget"
    return(search)
  }
  search$step <- search$step + 1
  search$since <- search$since + 1
  both <- c(search$at, made)
  runs <- search$model$runs
  misfit <- misfit_of(search, runs$outputs[, both], runs$z[both, , drop = FALSE], context)
  gain <- misfit[1] - misfit[2]
  nats <- nats_of(search, min(misfit))
  length <- sqrt(sum((way_scale(search$reference) * (runs$z[made, ] - runs$z[search$at, ]))^2))
  is_poor <- !(gain > max(0, search$predicted * rules$poor_step))
  if (is_poor) {
    search$trusted <- length * shrinkage(max(0, search$predicted), gain)
  } else if (gain > search$predicted * rules$good_step) {
    search$trusted <- max(search$trusted, rules$trust_changes * length)
  }
  search$poor <- search$poor + is_poor
  search$failed <- if (gain > 0) 0 else search$failed + 1
  search$gains <- c(search$gains, max(0, gain))
  if (gain > 0) search$at <- made
  slow <- length(search$gains) >= rules$pace && sum(utils::tail(search$gains, rules$pace)) < nats
  if (slow) search$status <- "slow"
  if (search$failed >= rules$stalled_after) search$status <- "stalled"
  if (has_arrived(search)) search$status <- "arrived"
  search
}

# Whether the search has come as near to a mode that is known as draws of it lie: it would end
# there.
has_arrived <- function(search) {
  z <- search$model$runs$z
  distance <- vapply(search$known, function(mode) {
    apart <- z[search$at, ] - z[mode$at, ]
    sum(apart * solve(conditioned(mode$covariance), apart))
  }, 0)
  any(distance < ncol(z))
}

# By how much: to the least value of the parabola that falls as predicted and ends at what the run
# says.
shrinkage <- function(predicted, gain) {
  least <- if (is.finite(gain)) predicted / (2 * predicted - min(gain, 0)) else 0
  min(max(least, rules$least_shrinkage), 1 / rules$trust_changes)
}
