# Forecasts some steps ahead: what is known by then of error and discrepancy is carried forward.

# The rows asked for, once for each horizon: predicted at some draws of the posterior from the
# measurements up to `horizon` steps before. The filter passes through the calibration rows first.
forecast_fit <- function(fit, record, use, picked, horizon, level, seed, threads) {
  chain <- forecast_chain(fit, record, use, picked, threads)
  known <- lapply(horizon, function(k) known_by(chain, k * record$step_h))
  found <- lapply(seq_along(chain$draws), function(i) {
    forecast_draw(fit, chain$draws[i], chain$y - chain$runs[, i], chain, known)
  })
  members <- rep_len(seq_along(found), predicted_samples)
  tables <- lapply(seq_along(horizon), function(k) {
    of_draws <- function(what) {
      do.call(cbind, lapply(found, function(draw) draw[[what]][chain$asked, k]))
    }
    mean <- chain$runs[chain$asked, , drop = FALSE] + of_draws("mean")
    table <- with_seed(seed, summarise_prediction(
      record, rows_used(record, use), mean[, members, drop = FALSE],
      of_draws("sd")[, members, drop = FALSE], "prediction", level))
    data.frame(table["time"], horizon = horizon[k], table[names(table) != "time"])
  })
  structure(do.call(rbind, tables), class = c("amiss_forecast", "data.frame"))
}

# What the filter passes through: the rows of calibration and those asked for, of one record in the
# order of time, those of another record after them. `part` changes where nothing of the error
# before is left. Draws at which the simulator fails are left out.
forecast_chain <- function(fit, record, use, picked, threads) {
  same <- identical(record, fit$measurements)
  others <- if (same) setdiff(use, "calibrate") else use
  parts <- list(chain_part(fit, fit$measurements, "calibrate", picked, threads))
  if (length(rows_used(record, others)))
    parts[[2]] <- chain_part(fit, record, others, picked, threads)
  joined <- function(what, bind = c) do.call(bind, lapply(parts, `[[`, what))
  of_part <- rep(seq_along(parts), lengths(lapply(parts, `[[`, "hours")))
  use_of <- joined("use")
  order <- if (same) order(joined("hours")) else seq_along(of_part)
  part <- if (same) joined("segment") else paste(of_part, joined("segment"))
  runs <- joined("runs", rbind)[order, , drop = FALSE]
  made <- colSums(!is.finite(runs)) == 0
  if (!any(made))
    abort_numerical("The simulator failed at every one of the {length(picked)} posterior draws.")
  list(runs = runs[, made, drop = FALSE], draws = picked[made], y = joined("y")[order],
       hours = joined("hours")[order], part = part[order],
       later = if (same) integer(length(order)) else of_part,
       phi = joined("phi", rbind)[order, , drop = FALSE],
       moves = joined("moves", rbind)[order, , drop = FALSE],
       calibrated = parts[[1]][c("phi", "moves")],
       asked = if (same) use_of[order] %in% use else of_part == 2)
}

chain_part <- function(fit, record, use, picked, threads) {
  rows <- rows_used(record, use)
  runs <- simulate_measured(fit$emulator$simulator, fit$values[picked, , drop = FALSE], record,
                            use, threads)
  moves <- if (identical(use, "calibrate")) simulator_moves(fit$emulator)
           else withheld_moves(fit, use, threads, record)
  list(runs = runs, hours = record$hours[rows], segment = record$segment[rows],
       y = (record$observed %||% record$y)[rows], use = record$use[rows],
       phi = standardised_responses(fit, record, rows), moves = moves)
}

# For each row of the chain the last row that could be known `lead` hours before; 0: none.
known_by <- function(chain, lead) {
  known <- integer(length(chain$hours))
  for (at in split(seq_along(known), chain$later)) {
    hours <- chain$hours[at]
    known[at] <- at[1] - 1L + findInterval(hours - lead * (1 - 1e-6), hours)
  }
  known
}

# list(mean, sd), rows x horizons: of what a draw leaves of each row, given the rows that are known.
forecast_draw <- function(fit, draw, left, chain, known) {
  error <- draw_errors(fit, draw)
  acts <- error$spread > 0
  withheld <- withheld_by(chain$calibrated$phi, chain$calibrated$moves, error$limit)
  columns <- (chain$phi - chain$moves %*% withheld)[, acts, drop = FALSE]
  times <- fit$control$error_times
  last <- unlist(known)
  of_last <- split(seq_along(last), factor(last, seq(0, length(left))))
  look_ahead <- function(i, state, covariance) {
    at <- of_last[[i + 1]]
    if (!length(at)) return(NULL)
    rows <- (at - 1) %% length(left) + 1
    keeps <- exp(-outer(chain$hours[rows] - chain$hours[max(i, 1)], 1 / times))
    keeps[i == 0 | chain$part[rows] != chain$part[max(i, 1)], ] <- 0
    h <- cbind(columns[rows, , drop = FALSE], keeps)
    list(at = at, mean = h %*% state,
         variance = rowSums((h %*% covariance) * h) + (1 - keeps^2) %*% error$slow + error$white)
  }
  steps <- c(Inf, diff(chain$hours))
  steps[c(TRUE, chain$part[-1] != chain$part[-length(left)])] <- Inf
  seen <- filter_rows(left, columns, error$spread[acts], exp(-outer(steps, 1 / times)), error$slow,
                      error$white, look_ahead)$seen
  said <- function(what) unlist(lapply(seen, `[[`, what))
  in_place <- function(x) matrix(x[order(said("at"))], length(left))
  list(mean = in_place(said("mean")), sd = in_place(sqrt(said("variance"))))
}

#' @rdname predict.amiss_fit
#' @export
summary.amiss_forecast <- function(object, ...) {
  rlang::check_dots_empty()
  known <- object[!is.na(object$observed), ]
  scores <- lapply(split(known, known$horizon), function(p) {
    limits <- as.matrix(p[grep("^(lower|upper)", names(p))])
    data.frame(horizon = p$horizon[1], rows = nrow(p), rmse = sqrt(mean((p$observed - p$mean)^2)),
               crps = mean(p$crps),
               coverage = mean(p$observed >= limits[, 1] & p$observed <= limits[, 2]))
  })
  do.call(rbind, unname(scores))
}
