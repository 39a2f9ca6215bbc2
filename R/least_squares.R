# What practice does: the parameters of least squared error, found with the simulator itself, and
# the criteria that follow from the likelihood there. Errors count as independent and normal, with
# one unknown variance, so that l = -n/2 (log(2 pi RSS / n) + 1), AIC = 2k - 2l, BIC = k log n - 2l,
# k = parameters + 1, as logLik() and AIC() of lm() have it.

# @param fit A calibration of either kind: its posterior draws and the runs of its design give the
#   start.
# @return values, their places in the unit cube, error (n), rss, converged, runs (of the simulator).
least_squares <- function(fit, threads = 1L) {
  parameters <- fit$emulator$parameters
  m <- fit$measurements
  lower <- finite_end(parameters, 0)
  upper <- finite_end(parameters, 1)
  runs <- 0L
  error_at <- function(unit) {
    runs <<- runs + nrow(unit)
    m$y[fit$rows] - simulate_measured(fit$emulator$simulator, unit_to_values(unit, parameters), m,
                                      "calibrate", threads)
  }
  seen <- list(unit = NULL)
  at <- function(unit) {
    if (!identical(seen$unit, unit)) seen <<- list(unit = unit, error = error_at(t(unit))[, 1])
    seen
  }
  slopes <- function(unit) {
    point <- at(unit)
    if (is.null(point$slopes)) seen$slopes <<- central_differences(error_at, unit, lower, upper)
    seen$slopes
  }
  scale <- length(fit$rows) * m$noise_sd^2
  objective <- function(unit) {
    value <- sum(at(unit)$error^2) / (2 * scale)
    if (is.finite(value)) value else Inf
  }
  start <- start_of_search(fit, lower, upper)
  # Where the simulator fails beside a point there are no slopes: the search ends at its start, not
  # converged.
  found <- tryCatch(
    stats::nlminb(start, objective,
                  gradient = function(u) as.numeric(crossprod(slopes(u), at(u)$error)) / scale,
                  hessian = function(u) crossprod(slopes(u)) / scale, lower = lower, upper = upper),
    error = function(e) list(par = start, convergence = 1L))
  error <- at(found$par)$error
  values <- unit_to_values(t(found$par), parameters)[1, ]
  list(values = values, unit = stats::setNames(found$par, names(parameters)), error = error,
       rss = sum(error^2), at_edge = names(parameters)[found$par < 0.005 | found$par > 0.995],
       converged = found$convergence == 0, runs = runs)
}

# The ends of the unit cube, but for priors without limits, whose values there are infinite.
finite_end <- function(parameters, end) {
  vapply(parameters, function(p) if (is.finite(prior_quantile(p$prior, end))) end
                                 else abs(end - 1e-4), 0, USE.NAMES = FALSE)
}

# Central differences; one-sided where a step would leave the cube.
central_differences <- function(f, unit, lower, upper, step = 1e-3) {
  down <- pmax(unit - step, lower)
  up <- pmin(unit + step, upper)
  moved <- function(to) {
    points <- matrix(unit, length(unit), length(unit), byrow = TRUE)
    diag(points) <- to
    points
  }
  values <- f(rbind(moved(down), moved(up)))
  p <- seq_along(unit)
  sweep(values[, length(unit) + p, drop = FALSE] - values[, p, drop = FALSE], 2, up - down, "/")
}

# The posterior draw or run of the design whose emulated error is least.
start_of_search <- function(fit, lower, upper) {
  unit <- rbind(posterior_unit(fit), fit$emulator$unit)
  basis <- fit$emulator$basis$vectors
  norms <- colSums(basis^2)
  target <- as.numeric(crossprod(basis, fit$measurements$y[fit$rows])) / norms
  distance <- sweep(emulated_coefficients(fit$emulator, unit)$mean, 2, target)^2 %*% norms
  pmin(pmax(unit[which.min(distance), ], lower), upper)
}

likelihood_criteria <- function(best) {
  n <- length(best$error)
  k <- length(best$values) + 1
  l <- -n / 2 * (log(2 * pi * best$rss / n) + 1)
  data.frame(k = k, rmse_best = sqrt(best$rss / n), log_likelihood = l, aic = 2 * k - 2 * l,
             bic = k * log(n) - 2 * l)
}

# Correlation of each error with the next, within segments: the criteria believe it to be zero.
lag_correlation <- function(error, starts) {
  later <- which(!starts)
  stats::cor(error[later], error[later - 1])
}

# The last earlier model whose parameters all stand in this one with the same priors: what the
# likelihood ratio needs.
nested_in <- function(models, i) {
  parameters <- lapply(models, function(m) m$fit$emulator$parameters)
  smaller <- Filter(function(j) {
    common <- names(parameters[[j]])
    length(common) < length(parameters[[i]]) && all(common %in% names(parameters[[i]])) &&
      identical(lapply(parameters[[j]], `[[`, "prior"),
                lapply(parameters[[i]][common], `[[`, "prior"))
  }, seq_len(i - 1))
  if (length(smaller)) max(smaller)
}

likelihood_ratio <- function(models, criteria, i) {
  j <- nested_in(models, i)
  if (is.null(j)) {
    note <- if (i == 1) "the first model" else "no earlier model is nested in it"
    return(data.frame(nested = NA_character_, lr = NA_real_, lr_df = NA_integer_,
                      lr_p_value = NA_real_, lr_note = note))
  }
  statistic <- 2 * (criteria$log_likelihood[i] - criteria$log_likelihood[j])
  df <- criteria$k[i] - criteria$k[j]
  added <- setdiff(names(models[[i]]$fit$emulator$parameters),
                   names(models[[j]]$fit$emulator$parameters))
  edge <- intersect(added, models[[i]]$best$at_edge)
  note <- if (statistic < 0)
            "the smaller model fits better: it is not a special case within the priors"
          else if (length(edge)) paste("invalid:", listed(edge), "at the edge of the range")
          else ""
  data.frame(nested = models[[j]]$name, lr = statistic, lr_df = df,
             lr_p_value = if (statistic < 0) NA_real_
                          else stats::pchisq(statistic, df, lower.tail = FALSE), lr_note = note)
}
