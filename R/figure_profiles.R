# Profiles of the likelihood: how high it can be at each value of a parameter, whatever the others
# are.

profile_points <- 11  # of each parameter
profile_draws <- 10   # of error and discrepancy, over which the log-likelihood is averaged
profile_starts <- 80  # draws that steps may begin from
profile_rounds <- 40  # of steps uphill, at most
profile_gain <- 0.01  # nats, below which a point has come to its end
profile_probe <- 0.3  # standard deviations, for slopes
profile_damping <- 0.05  # of steps, beside the curvature over one standard deviation
profile_stride <- 3  # standard deviations, the longest step
profile_numbers <- 2e7  # of runs that are compared at once: 160 MB
profile_fall <- stats::qchisq(0.95, 1) / 2  # at the ends of a 95 % interval (Wilks)

# What the emulator of each record says at points of all parameters (one a row, normal coordinates):
# rows of the record x points.
emulated_runs <- function(fit, z) {
  names <- names(drawn_parameters(fit))
  lapply(record_fits(fit), function(one) {
    own <- match(names(one$emulator$parameters), names)
    w <- predict_emulator_(one$emulator$processes, z[, own, drop = FALSE])$mean
    tcrossprod(one$emulator$basis$vectors, w)
  })
}

# Log-likelihood of such runs, as draws of error and discrepancy see it in the mean.
emulated_log_likelihood <- function(fit, runs) {
  draws <- even_draws(fit, profile_draws)
  n <- ncol(runs[[1]])
  of_record <- function(one, runs) {
    # Unlike runs of the simulator, these lack what the basis discards.
    one$priors$discarded_variance <- 0
    each <- rep(seq_len(ncol(runs)), each = length(draws))
    log_l <- run_log_likelihood(one, rep(draws, ncol(runs)), runs[, each, drop = FALSE], 1)
    colMeans(matrix(log_l, length(draws)))
  }
  rows <- sum(vapply(runs, nrow, 0L))
  at_once <- max(1, floor(profile_numbers / (rows * length(draws))))
  blocks <- split(seq_len(n), (seq_len(n) - 1) %/% at_once)
  value <- unlist(lapply(unname(blocks), function(some) {
    Reduce(`+`, Map(function(one, runs) of_record(one, runs[, some, drop = FALSE]),
                    record_fits(fit), runs))
  }))
  ifelse(is.na(value), -Inf, value)
}

# Of each parameter, in the range of its draws: list(x, log_likelihood), the highest that steps
# uphill find over the others, which stay in the range of theirs.
profiles <- function(fit) {
  parameters <- drawn_parameters(fit)
  z <- to_normal(posterior_unit(fit))
  covariance <- stats::cov.wt(z, fit$weights, method = "ML")$cov
  covariance <- covariance + diag(1e-8 + 1e-6 * diag(covariance), ncol(z))
  box <- apply(z, 2, weighted_quantile, fit$weights, c(0.001, 0.999))
  draws <- unique(even_draws(fit, profile_starts))
  x <- lapply(seq_along(parameters), function(j) {
    ends <- weighted_quantile(fit$values[, j], fit$weights, c(0.005, 0.995))
    seq(ends[1], ends[2], length.out = profile_points)
  })
  fixed <- rep(seq_along(parameters), each = profile_points)
  at <- to_normal(unlist(Map(function(p, x) prior_cdf(p$prior, x), parameters, x)))
  ways <- covariance[fixed, , drop = FALSE] / diag(covariance)[fixed]
  # Points, moved to their fixed coordinates as the others are expected to move with these.
  moved <- function(z, some = seq_along(at)) {
    by <- at[some] - z[cbind(seq_along(some), fixed[some])]
    within_box(z + by * ways[some, , drop = FALSE], box, fixed[some], at[some])
  }
  starts <- lapply(draws, function(i) moved(z[rep(i, length(at)), , drop = FALSE]))
  values <- vapply(starts, function(z) emulated_log_likelihood(fit, emulated_runs(fit, z)), 0 * at)
  best <- max.col(matrix(values, length(at)), "first")
  start <- t(vapply(seq_along(at), function(i) starts[[best[i]]][i, ], z[1, ]))
  found <- climbed(fit, matrix(start, length(at)), fixed, covariance, moved)
  stats::setNames(Map(function(x, value) list(x = x, log_likelihood = value),
                      x, split(found, fixed)), names(parameters))
}

# The points with their fixed coordinates, the others within the box.
within_box <- function(z, box, fixed, at) {
  z <- pmin(pmax(z, rep(box[1, ], each = nrow(z))), rep(box[2, ], each = nrow(z)))
  z[cbind(seq_along(fixed), fixed)] <- at
  z
}

# The largest log-likelihoods that steps uphill find from points `z`, of which the coordinates
# `fixed` stay. A point may also go on from where the one before or after it has come, or the best
# of all. Those that gain nothing more are left.
climbed <- function(fit, z, fixed, covariance, moved) {
  value <- emulated_log_likelihood(fit, emulated_runs(fit, z))
  n <- nrow(z)
  if (ncol(z) == 1) return(value)
  roots <- lapply(seq_len(ncol(z)), function(j) conditional_root(covariance, j))
  climbs <- rep(TRUE, n)
  for (round in seq_len(profile_rounds)) {
    some <- which(climbs)
    way <- newton_steps(fit, z[some, , drop = FALSE], roots[fixed[some]])
    by_step <- lapply(c(1, 0.3, 0.1), function(length) z[some, , drop = FALSE] + length * way)
    neighbours <- lapply(c(-1, 1), function(by) z[pmin(pmax(some + by, 1), n), , drop = FALSE])
    best_of_all <- matrix(z[which.max(value), ], length(some), ncol(z), byrow = TRUE)
    tries <- lapply(c(by_step, neighbours, list(best_of_all)), moved, some)
    values <- matrix(emulated_log_likelihood(fit, emulated_runs(fit, do.call(rbind, tries))),
                     length(some))
    best <- max.col(values, "first")
    gain <- values[cbind(seq_along(some), best)] - value[some]
    gain[is.nan(gain)] <- 0  # impossible before and after
    for (i in which(gain > 0)) {
      z[some[i], ] <- tries[[best[i]]][i, ]
      value[some[i]] <- values[i, best[i]]
    }
    climbs[some] <- gain > profile_gain
    # The neighbour of one that still climbs may follow it.
    climbs <- climbs | c(climbs[-1], FALSE) | c(FALSE, climbs[-n])
    if (!any(climbs)) break
  }
  value
}

# Steps by Gauss and Newton from points, along the columns of a root of each. Given error and
# discrepancy, the log-likelihood is quadratic in the output, and so along its slopes: its values at
# 1 + 2 m + m (m - 1) / 2 outputs give its gradient and its matrix.
newton_steps <- function(fit, z, roots) {
  m <- ncol(z) - 1
  pairs <- if (m > 1) utils::combn(m, 2) else matrix(0L, 2, 0)
  # Combinations of slopes: none, each, each taken off, each pair.
  mix <- cbind(0, diag(m), -diag(m), diag(m)[, pairs[1, ]] + diag(m)[, pairs[2, ]])
  probes <- do.call(rbind, lapply(seq_len(nrow(z)), function(i) {
    away <- profile_probe * t(roots[[i]])
    sweep(rbind(0, away, -away), 2, z[i, ], "+")
  }))
  point <- rep(seq_len(nrow(z)), each = 2 * m + 1)
  mixed <- lapply(emulated_runs(fit, probes), function(runs) {
    do.call(cbind, lapply(seq_len(nrow(z)), function(i) {
      own <- runs[, point == i, drop = FALSE]
      slopes <- (own[, 1 + seq_len(m), drop = FALSE] -
                   own[, 1 + m + seq_len(m), drop = FALSE]) / (2 * profile_probe)
      own[, 1] + slopes %*% mix
    }))
  })
  values <- matrix(emulated_log_likelihood(fit, mixed), ncol(mix))
  t(vapply(seq_len(nrow(z)), function(i) {
    v <- values[, i]
    up <- v[1 + seq_len(m)]
    down <- v[1 + m + seq_len(m)]
    gradient <- (up - down) / 2
    bend <- diag(2 * v[1] - up - down, m)
    bend[t(pairs)] <- up[pairs[1, ]] + up[pairs[2, ]] - v[1] - v[-seq_len(1 + 2 * m)]
    bend[t(pairs)[, 2:1]] <- bend[t(pairs)]
    step <- tryCatch(solve(bend + diag(profile_damping, m), gradient), error = function(e) gradient)
    if (!all(is.finite(step))) step <- 0 * gradient
    as.numeric(roots[[i]] %*% (step / max(1, sqrt(sum(step^2)) / profile_stride)))
  }, z[1, ]))
}

# Columns along which the other coordinates are independent and of standard deviation 1, given
# coordinate `j`, which does not move.
conditional_root <- function(covariance, j) {
  if (ncol(covariance) == 1) return(matrix(0, 1, 0))
  given <- covariance - tcrossprod(covariance[, j]) / covariance[j, j]
  root <- matrix(0, nrow(covariance), ncol(covariance) - 1)
  root[-j, ] <- t(chol(conditioned(given[-j, -j, drop = FALSE])))
  root
}

# Parameters whose profile falls by `profile_fall` on both sides, from the highest of all.
bounded_by_record <- function(profiles) {
  highest <- max(vapply(profiles, function(p) max(p$log_likelihood), 0))
  vapply(profiles, function(p) {
    top <- which.max(p$log_likelihood)
    low <- p$log_likelihood <= highest - profile_fall
    any(low[seq_len(top)]) && any(low[top:length(low)])
  }, NA)
}

profiles_title <- function(bounded, label) {
  if (all(bounded)) return("The record bounds every parameter on both sides")
  if (!any(bounded)) return("The record bounds no parameter on both sides")
  if (sum(!bounded) > 3) return(sprintf("The record bounds %d of %d parameters on both sides",
                                        sum(bounded), length(bounded)))
  sprintf("The record bounds all parameters on both sides but %s", listed(label[!bounded]))
}

figure_profiles <- function(fit) {
  parameters <- drawn_parameters(fit)
  if (length(unique(even_draws(fit, profile_starts))) <= length(parameters))
    return(figure_of_nothing("The posterior has too few draws for profiles"))
  label <- distinct_labels(parameters)
  found <- profiles(fit)
  panels <- axis_label(label, vapply(parameters, `[[`, "", "unit"))
  table <- do.call(rbind, Map(function(p, panel) {
    data.frame(x = p$x, y = p$log_likelihood, panel)
  }, found, panels))
  table$panel <- factor(table$panel, panels)
  table$y <- table$y - max(table$y)
  columns <- min(2, length(panels))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_hline(yintercept = -profile_fall, linetype = "dashed", colour = "grey40") +
    ggplot2::geom_line(colour = stage_colours[["the model"]], linewidth = 0.9) +
    ggplot2::geom_point(colour = stage_colours[["the model"]], size = 1.6) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), scales = "free_x", ncol = columns,
                        labeller = wrap_strips(columns)) +
    ggplot2::scale_x_continuous(n.breaks = 5, labels = short_axis, guide = apart) +
    ggplot2::coord_cartesian(ylim = c(-4, 0)) +
    figure_titles(profiles_title(bounded_by_record(found), label),
                  paste("How far the log-likelihood falls if a parameter has another value and the",
                        "other parameters follow. At the dashed line a value is as far off as the",
                        "end of a 95 % interval. If the curve does not reach the line, it is a",
                        "prior that ends the interval."), y = "log-likelihood") +
    figure_theme()
  with_height(figure, 2 + 2.1 * ceiling(length(panels) / columns))
}
