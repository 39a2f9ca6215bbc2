# Where the parameters' physical values lie. A calibrated value is the one by which the simulation
# is nearest to the record. If what the simulator lacks does, in part, what a parameter does, the
# calibrated value makes up for that part, because the discrepancy keeps out of it.
#
# With the moves E of a record (a column for a unit of each parameter) its discrepancy is
# Psi b = Phi b - E X b: the parameters have taken E X b. Without that, their posterior is the one
# under the whole response Phi b, if the prior is flat. Over records r, each with
# G_r = E_r' E_r / sigma_r^2, they have moved by (I + sum G_r)^-1 sum G_r X_r b_r. Given a kept draw
# b is normal. The interval holds that of the kept draws without the moves, and the posterior's.
# @return A data frame with name, lower and upper, or NULL if a calibration knows no slopes.
physical_intervals <- function(fit, level = 0.95) {
  ends <- stats::confint(fit, level = level)
  physical_ends(fit, data.frame(name = rownames(ends), lower = ends[, 1], upper = ends[, 2],
                                from = -Inf, to = Inf), level)
}

# The same of the parts of posteriors between `from` and `to`, whose intervals are `lower` to
# `upper`; a part without a kept draw has these.
physical_ends <- function(fit, parts, level = 0.95) {
  records <- record_fits(fit)
  if (!all(vapply(records, knows_slopes, NA))) return(NULL)
  parameters <- drawn_parameters(fit)
  space <- coordinates_of(parameters)
  moved <- moved_by_missing(records, names(parameters))
  kept <- records[[1]]$kept + 1L
  z <- from_unit(posterior_unit(fit)[kept, , drop = FALSE], space)
  tails <- c((1 - level) / 2, (1 + level) / 2)
  ends <- vapply(seq_len(nrow(parts)), function(row) {
    j <- match(parts$name[row], names(parameters))
    at <- fit$values[kept, parts$name[row]]
    own <- at >= parts$from[row] & at <= parts$to[row]
    if (!any(own)) return(c(NA_real_, NA_real_))
    without <- z[own, j] - moved$mean[j, own] + outer(moved$sd[j, own], normal_points)
    of_all <- matrix(0, 2, length(parameters))
    of_all[, j] <- pmin(pmax(stats::quantile(without, tails), space$lower[j]), space$upper[j])
    unit_to_values(to_unit(of_all, space), parameters)[, j]
  }, c(0, 0))
  data.frame(name = parts$name, lower = pmin(ends[1, ], parts$lower, na.rm = TRUE),
             upper = pmax(ends[2, ], parts$upper, na.rm = TRUE), row.names = NULL)
}

# Equally probable ones: each draw given is as good as so many.
normal_points <- stats::qnorm((seq_len(40) - 0.5) / 40)

knows_slopes <- function(fit) {
  !is.null(fit$emulator$moves$unit) && !is.null(fit$withheld_covariance)
}

# How far what is missing has moved the parameters, in their coordinates z: mean and standard
# deviation (P x kept draws) given each draw.
moved_by_missing <- function(records, names) {
  p <- length(names)
  unit <- numeric(p)
  information <- diag(p)
  score <- covariance <- 0
  for (fit in records) {
    own <- match(names(fit$emulator$parameters), names)
    moves <- fit$emulator$moves
    unit[own] <- moves$unit
    variance <- stats::weighted.mean(fit$posterior$variance, fit$posterior$weights)
    gram <- matrix(0, p, length(own))
    gram[own, ] <- crossprod(moves$root) / variance
    information[, own] <- information[, own] + gram
    score <- score + gram %*% fit$withheld
    covariance <- covariance + kronecker(gram, gram) %*% fit$withheld_covariance
  }
  way <- unit * solve(information)
  variances <- apply(covariance, 2, function(one) rowSums((way %*% matrix(one, p)) * way))
  list(mean = way %*% score, sd = sqrt(matrix(pmax(variances, 0), p)))
}

# The table of a fit's parameters, with the intervals of physical values if they are known.
physical_table <- function(fit) {
  table <- parameter_table(fit)
  physical <- physical_intervals(fit)
  if (!is.null(physical))
    table[c("physical_lower", "physical_upper")] <- physical[c("lower", "upper")]
  table
}

#' @rdname posterior
#' @export
tidy.amiss_fit <- function(x, conf.level = 0.95, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  check_level(conf.level, "conf.level")
  rows <- mode_rows(x, conf.level)
  table <- data.frame(
    term = rows$name, label = rows$label,
    unit = vapply(drawn_parameters(x)[rows$name], `[[`, "", "unit"), estimate = rows$median,
    std.error = rows$sd, conf.low = rows$lower, conf.high = rows$upper, physical.low = NA_real_,
    physical.high = NA_real_, modes = rows$modes, share = rows$share, row.names = NULL)
  physical <- physical_ends(x, rows, conf.level)
  if (!is.null(physical))
    table[c("physical.low", "physical.high")] <- physical[c("lower", "upper")]
  table
}
