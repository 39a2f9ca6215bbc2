# A calibrated model at rows other than those of calibration: its lacking response, its moves, its
# runs; and how draws of it become a table.

rows_used <- function(measurements, use) which(measurements$use %in% use & !is.na(measurements$y))

# The lacking response at the rows of these uses (rows x kept draws), and what it leaves in
# calibration.
carried_response <- function(fit, use, threads, record = fit$measurements) {
  rows <- rows_used(record, use)
  responses <- filter_responses(record, fit$control$time_constants)[rows, , drop = FALSE]
  moves <- withheld_moves(fit, use, threads, record)
  left <- left_by_mean(fit) - rowMeans(seen_response(fit))
  list(response = lacking_response(fit, responses, moves),
       sd = sqrt(sum(left^2) / max(1, length(left) - length(fit$emulator$parameters))))
}

# The lacking response at the calibration rows (rows x kept draws).
seen_response <- function(fit) {
  responses <- filter_responses(fit$measurements, fit$control$time_constants)
  lacking_response(fit, responses[fit$rows, , drop = FALSE], simulator_moves(fit$emulator))
}

# simulator_moves() at the rows of these uses, or zeros if nothing is withheld along them.
withheld_moves <- function(fit, use, threads, record) {
  if (any(fit$withheld != 0)) return(moves_at(fit, use, threads, record))
  matrix(0, length(rows_used(record, use)), nrow(fit$withheld))
}

# simulator_moves() at other rows.
moves_at <- function(fit, use, threads, record = fit$measurements) {
  emulator <- fit$emulator
  if (is.null(emulator$moves)) {
    wide <- emulator_over_priors(emulator)
    return(vectors_at(fit, wide, use, threads, record) %*% wide$spread)
  }
  slopes_at(fit, use, threads, record)
}

# The simulator's slopes at other rows, at the run of least squares: by differences on both sides,
# as far as the priors go.
slopes_at <- function(fit, use, threads, record) {
  parameters <- fit$emulator$parameters
  space <- coordinates_of(parameters)
  z <- fit$emulator$moves$z
  step <- diag(rules$search_difference, length(z))
  ends <- lapply(c(1, -1), function(side) {
    t(pmin(pmax(z + side * step, space$lower), space$upper))
  })
  around <- do.call(rbind, ends)
  runs <- runs_elsewhere(fit, unit_to_values(to_unit(around, space), parameters), use, threads,
                         record)
  if (!all(is.finite(runs))) {
    abort_numerical("The simulator failed beside its best run at these rows.")
  }
  up <- seq_along(z)
  sweep(runs[, up, drop = FALSE] - runs[, -up, drop = FALSE], 2,
        fit$emulator$moves$unit / diag(ends[[1]] - ends[[2]]), "*")
}

# The vectors of an emulator's basis at other rows: the same combinations of its runs, without those
# that fail there.
vectors_at <- function(fit, emulator, use, threads, record) {
  w <- emulator$processes$coefficients
  last <- ncol(w)
  runs <- if (is.null(fit$emulator$simulator)) runs_given(fit, use)
          else runs_elsewhere(fit, unit_to_values(emulator$unit, emulator$parameters), use, threads,
                              record)
  made <- colSums(!is.finite(runs)) == 0
  if (sum(made) < last) {
    abort_numerical(paste("The simulator failed at {sum(!made)} of the ensemble's {length(made)}",
                          "runs, made at these rows."))
  }
  coordinates <- w[made, -last, drop = FALSE]
  shifted <- sweep(runs[, made, drop = FALSE], 2, w[made, last])
  cbind(shifted %*% coordinates %*% solve(crossprod(coordinates) + diag(1e-12, last - 1)), 1)
}

runs_elsewhere <- function(fit, values, use, threads, record) {
  suppress_run_warnings(simulate_measured(fit$emulator$simulator, values, record, use, threads))
}

# Runs at draws of the posterior about the best run in place of their mean: where the discrepancy
# takes over what parameters at the ends of their priors cannot do, draws lie off the best.
about_best <- function(runs, best) runs + (as.numeric(best) - rowMeans(runs))

predicted_samples <- 400  # of each row, from which its band and score are taken

# `sd` is that of the error: one number, or one for each row and sample.
summarise_prediction <- function(m, rows, runs, sd, interval, level) {
  n <- predicted_samples
  member <- rep_len(seq_len(ncol(runs)), n)
  samples <- runs[, member, drop = FALSE] + sd * stats::rnorm(length(rows) * n)
  y <- (m$observed %||% m$y)[rows]
  sorted <- t(apply(samples, 1, sort))
  # CRPS of an ensemble: mean |x - y| - 1/2 mean |x - x'| (Gneiting and Raftery 2007), by the sorted
  # members.
  spread <- as.numeric(sorted %*% (2 * seq_len(n) - n - 1)) / n^2
  tails <- c((1 - level) / 2, (1 + level) / 2)
  band <- apply(if (interval == "prediction") sorted else runs, 1, stats::quantile, tails)
  ends <- data.frame(band[1, ], band[2, ])
  names(ends) <- paste0(c("lower", "upper"), format(100 * level, digits = 4))
  data.frame(time = m$time[rows], use = m$use[rows], observed = y, mean = rowMeans(runs), ends,
             crps = rowMeans(abs(samples - y)) - spread, segment = m$segment[rows],
             row.names = NULL)
}
