# Profiles of the likelihood: how high it can be at each value of a parameter, whatever the others
# are.

profile_points <- 11  # of each parameter
profile_draws <- 10   # of error and discrepancy, over which the log-likelihood is averaged
profile_starts <- 80  # draws that steps may begin from
profile_rounds <- 10  # of steps uphill
profile_probe <- 0.3  # standard deviations, for differences
profile_fall <- stats::qchisq(0.95, 1) / 2  # at the ends of a 95 % interval (Wilks)

# Log-likelihood by the emulator at points of all parameters (one a row, normal coordinates), as
# draws of error and discrepancy see it in the mean.
emulated_log_likelihood <- function(fit, z) {
  draws <- even_draws(fit, profile_draws)
  names <- names(drawn_parameters(fit))
  of_record <- function(one) {
    own <- match(names(one$emulator$parameters), names)
    w <- predict_emulator_(one$emulator$processes, z[, own, drop = FALSE])$mean
    runs <- tcrossprod(one$emulator$basis$vectors, w)
    each <- rep(seq_len(nrow(z)), each = length(draws))
    log_l <- run_log_likelihood(one, rep(draws, nrow(z)), runs[, each, drop = FALSE], 1)
    colMeans(matrix(log_l, length(draws)))
  }
  Reduce(`+`, lapply(record_fits(fit), of_record))
}

# Of each parameter, in the range of its draws: list(x, log_likelihood), the highest that steps
# uphill find over the others, which stay in the range of theirs.
profiles <- function(fit) {
  parameters <- drawn_parameters(fit)
  z <- to_normal(posterior_unit(fit))
  covariance <- stats::cov.wt(z, fit$weights)$cov
  box <- apply(z, 2, weighted_quantile, fit$weights, c(0.001, 0.999))
  f <- function(z) emulated_log_likelihood(fit, z)
  draws <- unique(even_draws(fit, profile_starts))
  x <- lapply(seq_along(parameters), function(j) {
    ends <- weighted_quantile(fit$values[, j], fit$weights, c(0.005, 0.995))
    seq(ends[1], ends[2], length.out = profile_points)
  })
  fixed <- rep(seq_along(parameters), each = profile_points)
  at <- to_normal(unlist(Map(function(p, x) prior_cdf(p$prior, x), parameters, x)))
  # Each draw, moved as the others are expected to move with the fixed one.
  starts <- lapply(draws, function(i) {
    from <- rep(z[i, ], each = length(at))
    way <- (at - z[i, fixed]) * covariance[fixed, ] / diag(covariance)[fixed]
    within_box(matrix(from, length(at)) + way, box, fixed, at)
  })
  values <- matrix(f(do.call(rbind, starts)), length(at))
  best <- max.col(values, "first")
  start <- t(vapply(seq_along(at), function(i) starts[[best[i]]][i, ], z[1, ]))
  found <- climbed(f, matrix(start, length(at)), fixed, covariance, box)
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
# may also go on from where the one before or after it has come.
climbed <- function(f, z, fixed, covariance, box) {
  n <- nrow(z)
  at <- z[cbind(seq_len(n), fixed)]
  kept <- function(z) within_box(z, box, fixed, at)
  value <- f(z)
  others <- ncol(z) - 1
  if (!others) return(value)
  roots <- lapply(seq_len(ncol(z)), function(j) conditional_root(covariance, j))
  directions <- lapply(seq_len(others), function(k) {
    t(vapply(fixed, function(j) roots[[j]][, k], z[1, ]))
  })
  for (round in seq_len(profile_rounds)) {
    probes <- lapply(directions, function(d) rbind(z + profile_probe * d, z - profile_probe * d))
    seen <- array(f(do.call(rbind, probes)), c(n, 2, others))
    slope <- matrix(seen[, 1, ] - seen[, 2, ], n) / (2 * profile_probe)
    bend <- (matrix(seen[, 1, ] + seen[, 2, ], n) - 2 * value) / profile_probe^2
    steps <- slope / pmax(-bend, 0.2)
    steps <- steps / pmax(1, sqrt(rowSums(steps^2)) / 2)
    way <- Reduce(`+`, Map(function(d, k) d * steps[, k], directions, seq_len(others)))
    tries <- c(lapply(c(1, 0.3, 0.1), function(length) kept(z + length * way)),
               list(kept(z[c(1, seq_len(n - 1)), ]), kept(z[c(seq_len(n)[-1], n), ])))
    values <- matrix(f(do.call(rbind, tries)), n)
    best <- max.col(values, "first")
    for (i in which(values[cbind(seq_len(n), best)] > value)) {
      z[i, ] <- tries[[best[i]]][i, ]
      value[i] <- values[i, best[i]]
    }
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

# Parameters whose profile falls by `profile_fall` on both sides.
bounded_by_record <- function(profiles) {
  vapply(profiles, function(p) {
    top <- which.max(p$log_likelihood)
    low <- p$log_likelihood <= p$log_likelihood[top] - profile_fall
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
  label <- distinct_labels(parameters)
  found <- profiles(fit)
  panels <- axis_label(label, vapply(parameters, `[[`, "", "unit"))
  table <- do.call(rbind, Map(function(p, panel) {
    data.frame(x = p$x, y = p$log_likelihood - max(p$log_likelihood), panel)
  }, found, panels))
  table$panel <- factor(table$panel, panels)
  columns <- min(2, length(panels))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_hline(yintercept = -profile_fall, linetype = "dashed", colour = "grey40") +
    ggplot2::geom_line(colour = stage_colours[["the model"]], linewidth = 0.9) +
    ggplot2::geom_point(colour = stage_colours[["the model"]], size = 1.6) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), scales = "free_x", ncol = columns,
                        labeller = wrap_strips(columns)) +
    ggplot2::scale_x_continuous(n.breaks = 5, labels = short_axis, guide = apart) +
    ggplot2::coord_cartesian(ylim = c(min(-4, -profile_fall), 0)) +
    figure_titles(profiles_title(bounded_by_record(found), label),
                  paste("How far the largest log-likelihood falls if a parameter has another value",
                        "and all others follow. The 95 % interval ends at the dashed line; if the",
                        "curve does not reach it, the prior is what ends the interval."),
                  y = "log-likelihood") +
    figure_theme()
  with_height(figure, 2 + 2.1 * ceiling(length(panels) / columns))
}
