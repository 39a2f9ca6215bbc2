# Modes that a sampler has lost: climbs from points of the prior that do not lead to its draws, and
# the mass of the peaks they reach against the draws there. A mode that was lost is added to the
# draws by an importance sample. In normal quantiles x of the parameters, whose prior is N(0, I).

# result: of the engine's sampler, with its draws in rows (`unit`); log_likelihood: of the rows of a
# matrix x.
with_lost_modes <- function(result, log_likelihood, seed) {
  result$x <- to_normal(result$unit)
  p <- ncol(result$x)
  density <- function(x) log_likelihood(x) - 0.5 * rowSums(x^2) - 0.5 * p * log(2 * pi)
  starts <- with_seed(seed, matrix(stats::rnorm(rules$mode_starts * p), rules$mode_starts))
  aside <- leads_elsewhere(density, starts, result, seed)
  result$evaluations <- result$evaluations + 2 * rules$mode_starts
  if (length(aside$values)) {
    reached <- climb(density,
                     aside$x[apart_from_better(aside$x, aside$values), , drop = FALSE], seed)
    result$evaluations <- result$evaluations + reached$evaluations
    for (k in seq_along(reached$value)) {
      peak <- peak_at(density, reached$x[k, ], reached$value[k])
      result$evaluations <- result$evaluations + peak$evaluations
      if (misses(result, peak)) result <- add_mode(result, density, peak, seed + k)
    }
  }
  result$x <- NULL
  result
}

# Starts from which a tenth of the way to the nearest of some draws leads down. If the logarithm of
# a density is concave, only those do that lie higher than the draw.
leads_elsewhere <- function(density, starts, result, seed) {
  drawn <- with_seed(seed, sample.int(nrow(result$x), rules$aside_draws, replace = TRUE,
                                      prob = result$weights))
  draws <- result$x[drawn, , drop = FALSE]
  squares <- outer(rowSums(starts^2), rowSums(draws^2), "+") - 2 * tcrossprod(starts, draws)
  values <- density(starts)
  nearest <- draws[max.col(-squares, "first"), , drop = FALSE]
  towards <- density((1 - rules$aside_way) * starts + rules$aside_way * nearest)
  down <- utils::head(which(is.finite(values) & towards < values), rules$most_aside)
  list(x = starts[down, , drop = FALSE], values = values[down])
}

# Those that lie farthest from any better one: peaks, whatever their height (Rodriguez and Laio
# 2014).
apart_from_better <- function(x, values) {
  distance <- as.matrix(stats::dist(x))
  apart <- vapply(seq_along(values), function(i) {
    better <- values > values[i]
    if (any(better)) min(distance[i, better]) else Inf
  }, 0)
  utils::head(order(-apart, -values), rules$mode_climbs)
}

# All starts climb at once, so that the likelihood is asked for many points at a time: each makes
# random children and moves to the best of them if it is better; its step follows its success
# (Rechenberg 1973).
climb <- function(density, x, seed) {
  p <- ncol(x)
  n <- nrow(x)
  value <- density(x)
  step <- rep(rules$climb_step, n)
  generations <- rules$climb_generations + rules$climb_parameter * p
  random <- with_seed(seed + 1, array(stats::rnorm(generations * n * rules$climb_children * p),
                                      c(n * rules$climb_children, p, generations)))
  parent <- rep(seq_len(n), rules$climb_children)
  for (g in seq_len(generations)) {
    children <- x[parent, , drop = FALSE] + step[parent] * random[, , g] / sqrt(p)
    found <- matrix(density(children), n)
    best <- max.col(replace(found, !is.finite(found), -.Machine$double.xmax), "first")
    top <- found[cbind(seq_len(n), best)]
    better <- top > value
    x[better, ] <- children[cbind(which(better) + (best[better] - 1) * n), ]
    value[better] <- top[better]
    step <- step * ifelse(better, rules$climb_growth, rules$climb_shrinkage)
  }
  list(x = x, value = value, evaluations = n * (1 + generations * rules$climb_children))
}

# The height, the curvature and the mass of a peak by differences, over ways on which the density
# falls by about half a nat; `converged` if its tangent promises no more.
peak_at <- function(density, x, value) {
  p <- length(x)
  at <- function(ways) density(ways + rep(x, each = nrow(ways)))
  step <- rep(1, p)
  evaluations <- 0
  for (half in seq_len(rules$peak_halvings)) {
    fall <- value - at(diag(step, p))
    evaluations <- evaluations + p
    long <- !is.finite(fall) | fall > rules$peak_fall
    if (!any(long)) break
    step[long] <- step[long] / 2
  }
  up <- at(diag(step, p))
  down <- at(-diag(step, p))
  gradient <- (up - down) / 2
  hessian <- diag(2 * value - up - down, p)
  pairs <- utils::combn(p, min(2, p))
  if (p > 1) {
    ways <- matrix(0, ncol(pairs), p)
    ways[cbind(seq_len(ncol(pairs)), pairs[1, ])] <- step[pairs[1, ]]
    ways[cbind(seq_len(ncol(pairs)), pairs[2, ])] <- step[pairs[2, ]]
    both <- at(ways)
    opposite <- at(-ways)
    cross <- -(both + opposite - up[pairs[1, ]] - up[pairs[2, ]] - down[pairs[1, ]] -
               down[pairs[2, ]] + 2 * value) / 2
    hessian[t(pairs)] <- cross
    hessian[t(pairs[2:1, , drop = FALSE])] <- cross
  }
  evaluations <- evaluations + 2 * p + 2 * (p > 1) * ncol(pairs)
  root <- if (all(is.finite(hessian))) tryCatch(chol(hessian), error = function(e) NULL)
  converged <- !is.null(root) &&
    sum(backsolve(root, gradient, transpose = TRUE)^2) / 2 < rules$peak_gain
  list(x = x, step = step, root = root, converged = converged, evaluations = evaluations,
       log_mass = if (converged)
                    value + 0.5 * p * log(2 * pi) + sum(log(step)) - sum(log(diag(root))))
}

# Whether a peak holds a part of the posterior that the draws lack.
misses <- function(result, peak) {
  if (!peak$converged) return(FALSE)
  share <- min(1, exp(peak$log_mass - result$log_evidence))
  drawn <- sum(result$weights[is_at(peak, result$x)])
  share > rules$lost_share && drawn < rules$lost_draws * share
}

# Whether points lie in the ellipsoid of a peak.
is_at <- function(peak, x) is_within_mode(peak$root %*% ((t(x) - peak$x) / peak$step))

# Of points in a mode's own standard deviations, one a column.
is_within_mode <- function(apart) colSums(apart^2) < rules$mode_radius^2 * (nrow(apart) + 4)

# The evidence inside the ellipsoid of the peak, by an importance sample from a Student t
# distribution, beside that outside, of the draws there are.
add_mode <- function(result, density, peak, seed) {
  p <- length(peak$x)
  n <- rules$mode_draws
  dof <- rules$mode_dof
  way <- with_seed(seed, matrix(stats::rnorm(n * p), p) *
                           rep(sqrt(dof / stats::rchisq(n, dof)), each = p))
  x <- t(peak$x + peak$step * backsolve(peak$root, way))
  log_t <- lgamma((dof + p) / 2) - lgamma(dof / 2) - 0.5 * p * log(dof * pi) +
    sum(log(diag(peak$root))) - sum(log(peak$step)) -
    0.5 * (dof + p) * log1p(colSums(way^2) / dof)
  height <- density(x)
  log_weight <- ifelse(is_at(peak, x), height - log_t, -Inf)
  inside <- log_mean_exp(log_weight)
  own <- exp(log_weight - inside) / n
  result$evaluations <- result$evaluations + n
  kept <- !is_at(peak, result$x)
  outside <- sum(result$weights[kept])
  # The ellipsoid of a curved ridge holds less than its curvature says, and a few draws all of the
  # weight.
  share <- min(1, exp(inside - result$log_evidence))
  is_lost <- share > rules$lost_share && 1 - outside < rules$lost_draws * share &&
    1 / sum(own^2) > rules$mode_effective * n
  if (!isTRUE(is_lost)) return(result)
  both <- c(log(outside) + result$log_evidence, inside)
  log_evidence <- log_mean_exp(both) + log(2)
  share <- exp(both - log_evidence)
  error <- sqrt(sum((share * c(result$standard_error, sqrt(sum(own^2) - 1 / n)))^2))
  result$weights <- c(share[1] * result$weights[kept] / outside, share[2] * own)
  result$unit <- rbind(result$unit[kept, , drop = FALSE], unname(stats::pnorm(x)))
  result$x <- rbind(result$x[kept, , drop = FALSE], unname(x))
  result$log_likelihood <- c(result$log_likelihood[kept],
                             height + 0.5 * rowSums(x^2) + 0.5 * p * log(2 * pi))
  result$log_evidence <- log_evidence
  result$standard_error <- error
  result$interval <- log_evidence + c(-1.96, 1.96) * error
  result$ess <- 1 / sum(result$weights^2)
  if (result$trusted) {
    found <- "a search added a mode of the posterior that the chains had missed"
    result[c("trusted", "why", "verdict")] <- new_trust(TRUE, found)
  }
  result
}
