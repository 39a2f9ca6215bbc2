#' Predict with a calibrated simulator
#'
#' The simulator itself is run at draws of the posterior (no emulator error); errors as large
#' as those that calibration left widen the band. Of an [ensemble()] made elsewhere, the emulator of its runs at the rows
#' asked for predicts, and its own uncertainty widens the band too.
#'
#' @param object A calibration ([calibrate()], [calibrate_paper()]).
#' @param use Which rows: `"calibrate"`, `"validate"` or both.
#' @param draws Number of posterior draws.
#' @param discrepancy `TRUE` adds the response to the boundary conditions that the model lacks, as it was seen in calibration
#'   ([discrepancy()]). Where its reach is limited, the runs of the ensemble are made again at the rows asked for.
#' @inheritParams calibrate
#' @param ... Not used.
#' @return A data frame with `time`, `use`, `observed`, `mean`, `lower95`, `upper95` (band of new measurements), and
#'   `crps`, the continuous ranked probability score of each row.
#' @export
predict.amiss_calibration <- function(object, use = c("calibrate", "validate"), draws = 40, discrepancy = FALSE, seed = object$seed, threads = 1, ...) {
  rlang::check_dots_empty()
  use <- match.arg(use, several.ok = TRUE)
  check_input(checkmate::check_count(draws, positive = TRUE), "draws")
  threads <- check_threads(threads)
  seed <- pick_seed(seed)
  check_input(checkmate::check_flag(discrepancy), "discrepancy")
  if (discrepancy && !inherits(object, "amiss_calibration")) {
    abort_input(paste("{.arg discrepancy} needs a fit of {.fun calibrate}:",
                      "that of the paper does not carry over to other rows."))
  }
  m <- object$measurements
  simulator <- object$emulator$simulator
  picked <- systematic_draws(object$weights[order(object$values[, 1])], draws)
  picked <- order(object$values[, 1])[picked]
  rows <- which(m$use %in% use & !is.na(m$y))
  if (!length(rows)) abort_input("The measurements have no row to {.val {use}}.")
  if (is.null(simulator)) return(predict_given(object, picked, rows, use, discrepancy, seed, threads))
  runs <- simulate_measured(simulator, object$values[picked, , drop = FALSE], m, use, threads)
  runs <- runs[, colSums(!is.finite(runs)) == 0, drop = FALSE]
  if (!ncol(runs)) abort_numerical("The simulator failed at every one of the {draws} posterior draws.")
  sd <- error_sd(object)
  if (discrepancy) {
    carried <- carried_response(object, use, threads)
    runs <- runs + carried$response[, rep_len(seq_len(ncol(carried$response)), ncol(runs)), drop = FALSE]
    sd <- carried$sd
  }
  with_seed(seed, summarise_prediction(m, rows, runs, sd))
}

# The lacking response at the rows of these uses (rows x kept draws), and what it leaves in calibration.
carried_response <- function(fit, use, threads) {
  m <- fit$measurements
  rows <- which(m$use %in% use & !is.na(m$y))
  responses <- filter_responses(m, fit$control$time_constants)
  moves <- if (any(fit$withheld != 0)) moves_at(fit, use, threads) else matrix(0, length(rows), nrow(fit$withheld))
  seen <- lacking_response(fit, responses[fit$rows, , drop = FALSE], simulator_moves(fit$emulator))
  left <- stats::residuals(fit) - rowMeans(seen)
  list(response = lacking_response(fit, responses[rows, , drop = FALSE], moves),
       sd = sqrt(sum(left^2) / max(1, length(left) - length(fit$emulator$parameters))))
}

# simulator_moves() at other rows: the same combinations of the first ensemble's runs, without those that fail there.
moves_at <- function(fit, use, threads) {
  emulator <- emulator_over_priors(fit$emulator)
  w <- emulator$processes$coefficients
  last <- ncol(w)
  values <- unit_to_values(emulator$unit, emulator$parameters)
  runs <- if (is.null(fit$emulator$simulator)) runs_given(fit, use)
          else suppress_run_warnings(simulate_measured(fit$emulator$simulator, values, fit$measurements, use, threads))
  made <- colSums(!is.finite(runs)) == 0
  if (sum(made) < last) {
    abort_numerical("The simulator failed at {sum(!made)} of the ensemble's {length(made)} runs, made at these rows.")
  }
  own <- w[made, -last, drop = FALSE]
  vectors <- cbind(sweep(runs[, made, drop = FALSE], 2, w[made, last]) %*% own %*% solve(crossprod(own)), 1)
  vectors %*% emulator$spread
}

# What the calibrated simulation leaves, as the standard deviation of new errors: noise, model error and discrepancy
# as large as they were seen, the fitted parameters taken off the degrees of freedom.
error_sd <- function(fit) {
  r <- stats::residuals(fit)
  sqrt(sum(r^2) / max(1, length(r) - length(fit$emulator$parameters)))
}

summarise_prediction <- function(m, rows, runs, sd) {
  n <- 200
  member <- rep_len(seq_len(ncol(runs)), n)
  samples <- runs[, member, drop = FALSE] + sd * stats::rnorm(length(rows) * n)
  y <- m$y[rows]
  sorted <- t(apply(samples, 1, sort))
  # CRPS of an ensemble: mean |x - y| - 1/2 mean |x - x'| (Gneiting and Raftery 2007), by the sorted members.
  spread <- as.numeric(sorted %*% (2 * seq_len(n) - n - 1)) / n^2
  data.frame(time = m$time[rows], use = m$use[rows], observed = y, mean = rowMeans(runs),
             lower95 = apply(sorted, 1, stats::quantile, 0.025), upper95 = apply(sorted, 1, stats::quantile, 0.975),
             crps = rowMeans(abs(samples - y)) - spread, segment = m$segment[rows])
}

prediction_scores <- function(prediction) {
  score <- function(use) {
    p <- prediction[prediction$use == use, ]
    if (!nrow(p)) return(c(rmse = NA_real_, crps = NA_real_, coverage95 = NA_real_))
    c(rmse = sqrt(mean((p$observed - p$mean)^2)), crps = mean(p$crps),
      coverage95 = mean(p$observed >= p$lower95 & p$observed <= p$upper95))
  }
  list(calibrate = score("calibrate"), validate = score("validate"))
}

#' @rdname predict.amiss_calibration
#' @export
predict.amiss_paper_calibration <- predict.amiss_calibration
