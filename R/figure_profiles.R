# Profiles of the likelihood: how high it can be at each value of a parameter, whatever the others
# are.

profile_points <- 11  # of each parameter
profile_draws <- 10   # of error and discrepancy, over which the log-likelihood is averaged
profile_starts <- 80  # draws that steps may begin from
profile_rounds <- 40  # of steps uphill, at most
profile_gain <- 0.01  # nats, below which a point has come to its end
profile_probe <- 0.3  # standard deviations, for differences
profile_numbers <- 2e7  # of runs that are compared at once: 160 MB
profile_fall <- stats::qchisq(0.95, 1) / 2  # at the ends of a 95 % interval (Wilks)

# Log-likelihood by the emulator at points of all parameters (one a row, normal coordinates), as
# draws of error and discrepancy see it in the mean.
emulated_log_likelihood <- function(fit, z) {
  draws <- even_draws(fit, profile_draws)
  names <- names(drawn_parameters(fit))
  of_record <- function(one, z) {
    own <- match(names(one$emulator$parameters), names)
    w <- predict_emulator_(one$emulator$processes, z[, own, drop = FALSE])$mean
    runs <- tcrossprod(one$emulator$basis$vectors, w)
    # Unlike runs of the simulator, these lack what the basis discards.
    one$priors$discarded_variance <- 0
    each <- rep(seq_len(nrow(z)), each = length(draws))
    log_l <- run_log_likelihood(one, rep(draws, nrow(z)), runs[, each, drop = FALSE], 1)
    colMeans(matrix(log_l, length(draws)))
  }
  rows <- sum(vapply(record_fits(fit), function(one) length(one$rows), 0L))
  at_once <- max(1, floor(profile_numbers / (rows * length(draws))))
  blocks <- split(seq_len(nrow(z)), (seq_len(nrow(z)) - 1) %/% at_once)
  unlist(lapply(unname(blocks), function(some) {
    Reduce(`+`, lapply(record_fits(fit), of_record, z[some, , drop = FALSE]))
  }))
}

# Of each parameter, in the range of its draws: list(x, log_likelihood), the highest that steps
# uphill find over the others, which stay in the range of theirs.
profiles <- function(fit) {
  parameters <- drawn_parameters(fit)
  z <- to_normal(posterior_unit(fit))
  covariance <- stats::cov.wt(z, fit$weights, method = "ML")$cov
  covariance <- covariance + diag(1e-8 + 1e-6 * diag(covariance), ncol(z))
  box <- apply(z, 2, weighted_quantile, fit$weights, c(0.001, 0.999))
  f <- function(z) emulated_log_likelihood(fit, z)
  draws <- unique(even_draws(fit, profile_starts))
  x <- lapply(seq_along(parameters), function(j) {
    ends <- weighted_quantile(fit$values[, j], fit$weights, c(0.005, 0.995))
    seq(ends[1], ends[2], length.out = profile_points)
  })
  fixed <- rep(seq_along(parameters), each = profile_points)
  at <- to_normal(unlist(Map(function(p, x) prior_cdf(p$prior, x), parameters, x)))
  ways <- covariance[fixed, , drop = FALSE] / diag(covariance)[fixed]
  # A point, moved as the others are expected to move with the fixed one.
  moved <- function(point, some = seq_along(at)) {
    from <- matrix(point, length(some), length(point), byrow = TRUE)
    within_box(from + (at[some] - point[fixed[some]]) * ways[some, , drop = FALSE], box,
               fixed[some], at[some])
  }
  starts <- lapply(draws, function(i) moved(z[i, ]))
  values <- matrix(f(do.call(rbind, starts)), length(at))
  values[is.na(values)] <- -Inf
  best <- max.col(values, "first")
  start <- t(vapply(seq_along(at), function(i) starts[[best[i]]][i, ], z[1, ]))
  found <- climbed(f, matrix(start, length(at)), fixed, covariance, box, moved)
  stats::setNames(Map(function(x, value) list(x = x, log_likelihood = value),
                      x, split(found, fixed)), names(parameters))
}

# The points with their fixed coordinates, the others within the box.
within_box <- function(z, box, fixed, at) {
  z <- pmin(pmax(z, rep(box[1, ], each = nrow(z))), rep(box[2, ], each = nrow(z)))
  z[cbind(seq_along(fixed), fixed)] <- at
  z
}

# The largest values of f that steps uphill find from points `z`, of each of which the coordinate
# `fixed` stays. Steps are Newton's, in coordinates in which the others are uncorrelated. A point
# may also go on from where the one before or after it has come, or the best of all. Those that gain
# nothing more are left.
climbed <- function(f, z, fixed, covariance, box, moved) {
  value <- f(z)
  value[is.na(value)] <- -Inf
  others <- ncol(z) - 1
  if (!others) return(value)
  n <- nrow(z)
  at <- z[cbind(seq_len(n), fixed)]
  roots <- lapply(seq_len(ncol(z)), function(j) conditional_root(covariance, j))
  directions <- lapply(seq_len(others), function(k) {
    t(vapply(fixed, function(j) roots[[j]][, k], z[1, ]))
  })
  climbs <- rep(TRUE, n)
  for (round in seq_len(profile_rounds)) {
    some <- which(climbs)
    kept <- function(to) within_box(to, box, fixed[some], at[some])
    part <- function(table) table[some, , drop = FALSE]
    probes <- lapply(directions, function(d) {
      rbind(part(z) + profile_probe * part(d), part(z) - profile_probe * part(d))
    })
    seen <- array(f(do.call(rbind, probes)), c(length(some), 2, others))
    slope <- matrix(seen[, 1, ] - seen[, 2, ], length(some)) / (2 * profile_probe)
    bend <- (matrix(seen[, 1, ] + seen[, 2, ], length(some)) - 2 * value[some]) / profile_probe^2
    steps <- slope / pmax(-bend, 0.2)
    steps <- steps / pmax(1, sqrt(rowSums(steps^2)) / 2)
    way <- Reduce(`+`, Map(function(d, k) part(d) * steps[, k], directions, seq_len(others)))
    tries <- c(lapply(c(1, 0.3, 0.1), function(length) kept(part(z) + length * way)),
               lapply(c(-1, 1), function(by) kept(z[pmin(pmax(some + by, 1), n), , drop = FALSE])),
               list(moved(z[which.max(value), ], some)))
    values <- matrix(f(do.call(rbind, tries)), length(some))
    values[is.na(values)] <- -Inf
    best <- max.col(values, "first")
    gain <- values[cbind(seq_along(some), best)] - value[some]
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
