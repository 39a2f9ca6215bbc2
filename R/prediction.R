#' Predict with a calibrated simulator
#'
#' Runs the simulator itself at draws of the posterior, so there is no emulator error. Errors as
#' large as those that calibration left widen the band. If the runs are an [ensemble()] made
#' elsewhere, the emulator of these runs at the rows asked for predicts, and its own uncertainty
#' widens the band too.
#'
#' # Forecasts
#'
#' With `horizon`, each row is predicted as it would have been that many steps before. The
#' measurements up to then show the error and the discrepancy, and these are carried forward: a
#' Kalman filter for each draw. The parameters stay those of the calibration. `summary()` of the
#' result gives scores by horizon.
#'
#' If the rows are those of `newdata`, the filter knows the calibration rows and, as far as they
#' were measured, the rows of `newdata` before.
#'
#' # New data
#'
#' `newdata` is a record of its own. It may be
#'
#' * [measurements()] with the same time step and boundary conditions, or
#' * a data frame of equal steps, as long as those of the data that were given to [measurements()],
#'   one row for each interval. It needs a column `time` (whatever it was called there), all
#'   boundary conditions of the record, and what else drives the simulator.
#'
#' If a data frame has the column of the target, the target is compared with the prediction. Nothing
#' is learned from it. A data frame has no warm-up: begin it before the rows that count.
#'
#' A data frame is checked as the record was. `missing` and `range` of [measurements()] hold, and
#' other codes for a missing value are refused. A warning names values far outside all others,
#' readings that are stuck, and counters.
#'
#' @param object A calibration ([calibrate()], [calibrate_paper()]), or an upgrade
#'   ([upgrade_model()]), whose last model predicts.
#' @param newdata Another record (see *New data*); by default the record that was calibrated on. For
#'   several records a list by record.
#' @param use Which rows: `"calibrate"`, `"validate"` or both; every row of a data frame.
#' @param draws Number of posterior draws.
#' @param discrepancy `TRUE` adds the response to the boundary conditions that the model lacks, as
#'   it was seen in calibration ([discrepancy()]). If its reach is limited, the runs of the ensemble
#'   are made again at the rows asked for.
#' @param interval `"prediction"`, a band of new measurements, or `"confidence"`, one of the
#'   simulation (and the discrepancy) alone.
#' @param level Probability that the band holds.
#' @param horizon Steps of the record: one or more whole numbers, such as `1:24`. `NULL`: no
#'   measurement helps.
#' @inheritParams calibrate
#' @param ... Not used: an argument that is not known is an error.
#' @return A data frame (for several records a list by record) with
#'   * `time`, `use`, `observed`, `mean`.
#'   * `lower95`, `upper95`: the band, at the probability `level`.
#'   * `crps`: the continuous ranked probability score of each row.
#'   * `segment`: the number of the unbroken part, if `newdata` is a data frame.
#'   * `horizon`: with `horizon`, which repeats the rows for each.
#'
#'   `summary()` of forecasts: a data frame with a row for each `horizon` and the columns `rows`,
#'   `rmse`, `crps` and `coverage`, the share of measurements inside the band.
#' @source Durbin and Koopman (2012), Time Series Analysis by State Space Methods, second edition,
#'   chapter 4, for the filter of forecasts. Gneiting and Raftery (2007), Strictly proper scoring
#'   rules, prediction, and estimation, Journal of the American Statistical Association 102,
#'   359-378, for the CRPS.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(ais = list(pilot_chains = 48, groups = 4))  # a coarse sampler, for speed
#' fit <- calibrate(train_emulator(runs, room), room, quick, seed = 1)
#' head(predict(fit, use = "validate"))
#'
#' # Other weather: a table with the record's boundary conditions.
#' warmer <- data.frame(time = 97:120, Te = 15 + 5 * sin(97:120 / 4), Gv = 0)
#' head(predict(fit, warmer, interval = "confidence"))
#'
#' # How well the record is known one, three and twelve hours ahead.
#' summary(predict(fit, use = "validate", horizon = c(1, 3, 12)))
#' @export
predict.amiss_fit <- function(object, newdata = NULL, use = c("calibrate", "validate"), draws = 40,
                              discrepancy = FALSE, interval = c("prediction", "confidence"),
                              level = 0.95, horizon = NULL, seed = object$seed, threads = 1,
                              ...) {
  rlang::check_dots_empty()
  check_object(object, "amiss_fit", "object")
  check_input(checkmate::check_character(use, min.len = 1), "use")
  check_input(checkmate::check_subset(use, c("calibrate", "validate")), "use")
  interval <- if (missing(interval)) "prediction" else interval
  check_input(checkmate::check_choice(interval, c("prediction", "confidence")), "interval")
  check_level(level, "level")
  check_input(checkmate::check_count(draws, positive = TRUE), "draws")
  threads <- check_threads(threads)
  seed <- pick_seed(seed)
  check_input(checkmate::check_flag(discrepancy), "discrepancy")
  forecast <- !is.null(horizon)
  if (forecast) check_horizon(horizon, discrepancy, interval)
  if ((discrepancy || forecast) && !knows_history(object)) {
    asked <- if (forecast) "horizon" else "discrepancy"
    abort_input(paste("{.arg {asked}} needs a fit of {.fun calibrate}:",
                      "that of the paper does not carry over to other rows."))
  }
  record <- prediction_record(object$measurements, newdata)
  if (is.data.frame(newdata)) use <- "new"
  rows <- rows_used(record, use)
  if (!length(rows)) abort_input("The measurements have no row to {.val {use}}.")
  check_run_number(draws, length(record$raw$hours), "draws")
  picked <- even_draws(object, draws)
  if (forecast) {
    require_simulator(object)
    return(forecast_fit(object, record, use, picked, sort(unique(horizon)), level, seed, threads))
  }
  if (is.null(object$emulator$simulator) && is.null(newdata)) {
    return(predict_given(object, picked, rows, use, discrepancy, interval, level, seed, threads))
  }
  require_simulator(object)
  runs <- simulate_measured(object$emulator$simulator, object$values[picked, , drop = FALSE],
                            record, use, threads)
  runs <- runs[, colSums(!is.finite(runs)) == 0, drop = FALSE]
  if (!ncol(runs))
    abort_numerical("The simulator failed at every one of the {draws} posterior draws.")
  if (!is.null(object$best) && !discrepancy) {
    runs <- about_best(
      runs, simulate_measured(object$emulator$simulator, object$best$values, record, use, threads))
  }
  sd <- error_sd(object)
  if (discrepancy) {
    carried <- carried_response(object, use, threads, record)
    runs <- runs + carried$response[, rep_len(seq_len(ncol(carried$response)), ncol(runs)),
                                    drop = FALSE]
    sd <- carried$sd
  }
  with_seed(seed, summarise_prediction(record, rows, runs, sd, interval, level))
}

check_horizon <- function(horizon, discrepancy, interval, call = rlang::caller_env()) {
  check_input(checkmate::check_integerish(horizon, lower = 1, any.missing = FALSE, min.len = 1),
              "horizon", "Give numbers of steps of the record, such as {.code 1:24}.", call = call)
  if (discrepancy) {
    abort_input(c("{.arg discrepancy} does not go with {.arg horizon}.",
                  i = "A forecast takes the discrepancy along, as far as it is known by then."),
                call = call)
  }
  if (interval != "prediction") {
    abort_input(c("{.arg interval} does not go with {.arg horizon}.",
                  i = "The band of a forecast holds new measurements."), call = call)
  }
}

require_simulator <- function(fit, call = rlang::caller_env()) {
  if (is.null(fit$emulator$simulator)) {
    abort_input(
      c("The runs of this ensemble were made elsewhere, so that the simulator cannot be run again.",
        i = "Use {.fun predict} on the emulator for the calibration rows."), call = call)
  }
}

# The record that is predicted: the fit's, one of its own, or one made of a data frame.
prediction_record <- function(m, newdata, call = rlang::caller_env()) {
  if (is.null(newdata)) return(m)
  if (is.data.frame(newdata)) return(new_record(m, newdata, call))
  check_object(newdata, "amiss_measurements", "newdata",
               paste("Give a data frame or {.fun measurements}; rows of the record itself are",
                     "chosen by {.arg use}."), call = call)
  if (!isTRUE(all.equal(newdata$step_h, m$step_h)) ||
      !identical(newdata$conditions, m$conditions)) {
    abort_input(c("{.arg newdata} must have the record's time step and boundary conditions.",
                  i = "The record has steps of {signif(m$step_h, 3)} h and {.val {m$conditions}}.",
                  x = paste("It has steps of {signif(newdata$step_h, 3)} h and",
                            "{.val {newdata$conditions}}.")), call = call)
  }
  newdata
}

# All rows have the use "new". `y` marks the rows to simulate; `observed` is the target, NA where it
# is not known.
new_record <- function(m, data, call = rlang::caller_env()) {
  terms <- list(name = m$conditions, circular = tabulate(m$condition, length(m$conditions)) == 2)
  data <- plain_table(as.list(data), nrow(data))
  require_columns(data, c("time", terms$name), call)
  data <- with_switches(data, terms$name)
  compared <- c(terms$name, intersect(m$target, names(data)))
  require_numeric(data, compared, call)
  time <- interval_ends(read_time(data$time, "time", m$time_format, m$time_zone, call), data$time,
                        m$time_format, m$stamp)
  hours <- time_hours(time)
  step <- m$raw$step_h
  if (length(hours) < 2 || any(abs(diff(hours) - step) > 0.01 * step)) {
    abort_input(c(paste("{.arg newdata} must have at least two rows, one for every",
                        "{signif(step, 4)} h without a gap."),
                  i = "Predict each part of a broken record on its own."), call = call)
  }
  numeric_columns <- setdiff(names(data)[vapply(data, is.numeric, NA)], c("time", m$target))
  data <- checked_values(m, data, compared, numeric_columns, terms$name[terms$circular], call)
  drivers <- as.matrix(data[numeric_columns])
  require_complete(drivers, terms$name, time, call = call)
  observed <- if (m$target %in% names(data)) as.numeric(data[[m$target]])
              else rep(NA_real_, nrow(data))
  raw <- list(time = time, hours = hours, step_h = step, segment = rep(1L, nrow(data)),
              use = rep("new", nrow(data)), y = observed, drivers = drivers)
  columns <- boundary_columns(drivers, terms)
  coarse <- average_rows(raw, m$step_h, columns$values, call)
  c(list(raw = raw, observed = coarse$y, condition = columns$condition, conditions = columns$names),
    utils::modifyList(coarse, list(y = numeric(length(coarse$y)))))
}

# The table as the record's own was read: its codes for a missing value and the range of its sensor
# hold here as well, other codes are refused, and values that seem to be no measurements are told
# of.
checked_values <- function(m, data, compared, numeric_columns, circular, call) {
  data <- with_marks(data, union(compared, numeric_columns), m$target, m$missing, m$range)
  if (!identical(m$missing, NA)) refuse_codes(data, compared, circular, call)
  found <- table_findings(data[union(compared, numeric_columns)], m$target, circular,
                          m$noise_sd * sqrt(m$per_step), m$per_step, m$findings)
  warn_findings(found[found$id != "missing_code", ], "newdata")
  data
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

#' Simulate the record that a calibration expects
#'
#' @description
#' Draws the calibration record from the posterior, for checks of the model, as `bayesplot` makes
#' them. Each draw is a run of the simulator at a posterior draw and a new error:
#'
#' * [calibrate()]: the discrepancy of that draw is added (its mean given the draw). The error has
#'   the draw's variance and autocorrelation.
#' * [calibrate_paper()]: errors are independent and as large as those that calibration left.
#'
#' @param object A calibration ([calibrate()], [calibrate_paper()]) of an ensemble that knows its
#'   simulator, or an upgrade ([upgrade_model()]), whose last model is simulated.
#' @param nsim Number of records. If a calibration has fewer draws of its discrepancy (`error_draws`
#'   of [calibrate()]), they serve again.
#' @inheritParams calibrate
#' @param ... Not used: an argument that is not known is an error.
#' @return A data frame with one row for each calibration row and the columns `sim_1`, `sim_2`, ...
#'   Its attribute `seed` makes them again.
#' @source `vignette("algorithm", "amiss")`, *One covariance*.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(ais = list(pilot_chains = 48, groups = 4))  # a coarse sampler, for speed
#' fit <- calibrate(train_emulator(runs, room), room, quick, seed = 1)
#' head(simulate(fit, nsim = 3, seed = 1))
#' @export
simulate.amiss_fit <- function(object, nsim = 1, seed = NULL, threads = 1, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  check_input(checkmate::check_count(nsim, positive = TRUE), "nsim")
  check_run_number(nsim, length(object$measurements$raw$hours), "nsim")
  require_simulator(object)
  threads <- check_threads(threads)
  seed <- pick_seed(seed)
  history <- knows_history(object)
  pool <- if (history) object$kept + 1L else even_draws(object, max(nsim, 32))
  records <- with_seed(seed, {
    member <- rep_len(sample.int(length(pool)), nsim)
    draws <- pool[member]
    runs <- simulate_measured(object$emulator$simulator, object$values[draws, , drop = FALSE],
                              object$measurements, "calibrate", threads)
    if (history) runs + seen_response(object)[, member, drop = FALSE] + drawn_errors(object, draws)
    else runs + error_sd(object) * stats::rnorm(length(runs))
  })
  colnames(records) <- paste0("sim_", seq_len(nsim))
  structure(as.data.frame(records), seed = seed)
}

# Errors at the calibration rows (rows x draws) with the white and autocorrelated parts of these
# draws.
drawn_errors <- function(fit, draws) {
  m <- fit$measurements
  n <- length(fit$rows)
  steps <- c(Inf, diff(m$hours[fit$rows]))
  steps[segment_starts(m, fit$rows)] <- Inf
  ratios <- error_ratios_of(fit, draws)
  vapply(seq_along(draws), function(i) {
    sd <- sqrt(fit$posterior$variance[draws[i]])
    error <- sd * stats::rnorm(n)
    for (k in which(ratios[i, ] > 0)) {
      error <- error +
        sd * sqrt(ratios[i, k]) * ornstein_uhlenbeck(exp(-steps / fit$control$error_times[k]))
    }
    error
  }, numeric(n))
}

# Stationary, of variance one; `kept` is what each value keeps of the one before it.
ornstein_uhlenbeck <- function(kept) {
  Reduce(function(x, i) kept[i] * x + sqrt(1 - kept[i]^2) * stats::rnorm(1), seq_along(kept), 0,
         accumulate = TRUE)[-1]
}

# As predict() by the simulator, but by emulators at the draws `picked`; their standard deviations
# join that of the error.
predict_given <- function(fit, picked, rows, use, discrepancy, interval, level, seed, threads,
                          call = rlang::caller_env()) {
  m <- fit$measurements
  values <- fit$values[rep_len(picked, predicted_samples), , drop = FALSE]
  mean <- sd <- matrix(0, length(rows), nrow(values))
  for (one in intersect(use, m$use[rows])) {
    emulated <- stats::predict(if (one == "calibrate") fit$emulator
                               else held_out_emulator(fit, call), values)
    mean[m$use[rows] == one, ] <- emulated$mean
    sd[m$use[rows] == one, ] <- emulated$sd
  }
  left <- error_sd(fit)
  if (discrepancy) {
    carried <- carried_response(fit, use, threads)
    mean <- mean + carried$response[, rep_len(seq_len(ncol(carried$response)), ncol(mean)),
                                    drop = FALSE]
    left <- carried$sd
  }
  with_seed(seed, summarise_prediction(m, rows, mean, sqrt(left^2 + sd^2), interval, level))
}
