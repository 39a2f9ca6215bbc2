# What a model leaves of the calibration record, beside the stated noise, and whether the calendar
# shows in it: a pattern that no boundary condition carries is of the clock (something at fixed
# hours) or of time itself (a drift).

remaining_error <- function(model, measurements) {
  p <- model$prediction[model$prediction$use == "calibrate", ]
  r <- p$observed - p$mean
  # As in error_sd(): fitted parameters do not count as agreement.
  q <- length(drawn_parameters(model$fit))
  ratio <- sqrt(sum(r^2) / max(1, length(r) - q)) / measurements$noise_sd
  list(ratio = ratio, large = ratio > rules$large_remainder,
       pattern = if (ratio > rules$large_remainder) {
         if (is_several(measurements)) worst_pattern(model, measurements)
         else remainder_pattern(r, model$fit$rows, measurements,
                                significant_conditions(model$attribution$table))
       })
}

# The pattern in that of several records of which most remains.
worst_pattern <- function(model, measurements) {
  each <- lapply(each_view(model, measurements),
                 function(view) remaining_error(view$model, view$measurements))
  seen <- Filter(function(left) !is.null(left$pattern), each)
  if (!length(seen)) return(NULL)
  worst <- names(which.max(vapply(seen, `[[`, 0, "ratio")))
  pattern <- seen[[worst]]$pattern
  list(what = paste0("in ", worst, ": ", pattern$what), where = pattern$where)
}

# What it is and where to look, in words; NULL if the calendar explains less than half. A
# condition that the error responds to (`answers`) may be as slow as a drift.
remainder_pattern <- function(r, rows, measurements, answers) {
  hours <- measurements$hours[rows]
  clock <- clock_hour(measurements$time[rows])
  unit <- measurements$unit
  shares <- c(drift = drift_share(r, hours), daily = daily_share(r, hours, clock))
  best <- which.max(shares)
  if (!shares[best] > rules$pattern_share) return(NULL)
  if (names(shares)[best] == "drift") {
    ends <- stats::fitted(stats::lm(r ~ stats::poly(hours, 2)))[c(1, length(r))]
    return(list(
      what = sprintf("it drifts, by %s from the beginning to the end of the calibration",
                     with_unit(signed(unname(diff(ends))), unit)),
      where = if (length(answers))
                paste0("It may follow ", listed(answers), ", to which it responds.")
              else "Suspect a drifting sensor, or something slow that the inputs do not hold."))
  }
  profile <- tapply(r, clock, mean)
  peak <- which.max(abs(profile - mean(r)))
  hour <- as.numeric(names(profile)[peak])
  list(what = sprintf("around %s the measured %s is in the mean of all days %s %s than simulated",
                      clock_words(hour), target_label(measurements),
                      with_unit(short(abs(profile[[peak]])), unit),
                      if (profile[[peak]] > 0) "higher" else "lower"),
       where = paste("Look for something that follows the clock and is not among the inputs: a",
                     "schedule, a switch, a habit."))
}

# Hour of the day as the record's own clock shows it.
clock_hour <- function(time) {
  if (is.numeric(time)) return(round(time %% 24, 4))
  parts <- as.POSIXlt(time)
  round(parts$hour + parts$min / 60, 4)
}

# Share of the sum of squares about the mean that a parabola in time explains.
drift_share <- function(r, hours) {
  if (length(r) < rules$drift_rows) return(0)
  left <- stats::residuals(stats::lm(r ~ stats::poly(hours, 2)))
  1 - sum(left^2) / sum((r - mean(r))^2)
}

# Share of the variance that a profile over the day explains, adjusted for its number of values.
daily_share <- function(r, hours, clock) {
  bin <- factor(clock)
  if (diff(range(hours)) < 24 * rules$daily_days || nlevels(bin) < rules$daily_times ||
      length(r) <= rules$daily_rows * nlevels(bin))
    return(0)
  summary(stats::lm(r ~ bin))$adj.r.squared
}

# TRUE where the evidence for all that was adopted is not decisively above that for a drift: a
# parabola in time beside the base model, in amounts of the order of what that leaves or less
# (responses_factor()); of several records in those that ask for it, in one at least.
drift_rivals <- function(models, control, threads) {
  base <- models[[1]]$fit
  of_record <- unlist(lapply(record_fits(base), drift_evidence, threads))
  if (!length(of_record)) return(FALSE)
  drift <- if (any(of_record > 0)) sum(of_record[of_record > 0]) else max(of_record)
  bayes_factor(models[[length(models)]]$fit, base)$log10_bf < drift + control$decisive
}

# Whether a parabola in time holds nearly all that an extension of a model changes, at the centre of
# its posterior: two runs of each record, if as many are `left`.
acts_as_drift <- function(parent, fit, threads, left = function() Inf) {
  if (left() < 2 * length(record_fits(fit))) return(FALSE)
  slow <- mapply(function(before, after) {
    if (is.null(after$emulator$simulator)) return(FALSE)
    parameters <- after$emulator$parameters
    values <- unit_to_values(stats::pnorm(matrix(posterior_centre(after), 1)), parameters)
    run <- function(fit) {
      own <- values[, names(fit$emulator$parameters), drop = FALSE]
      suppress_run_warnings(simulate_measured(fit$emulator$simulator, own, fit$measurements,
                                              "calibrate", threads))[, 1]
    }
    change <- run(after) - run(before)
    all(is.finite(change)) && any(change != 0) &&
      drift_share(change, after$measurements$hours[after$rows]) > rules$drift_alike
  }, record_fits(parent), record_fits(fit))
  all(slow)
}

# Its log10 Bayes factor; NULL for a record too short to show one.
drift_evidence <- function(base, threads) {
  hours <- base$measurements$hours[base$rows]
  if (length(hours) < rules$drift_rows) return(NULL)
  parabola <- error_sd(base) * sqrt(length(hours)) * stats::poly(hours, 2)
  responses_factor(base, parabola, threads)$log10_bf
}

response_ais <- list(pilot_chains = 64, groups = 2, max_groups = 2, max_sweeps = 6, precision = 1,
                     importance_draws = 300, ess_drop = 0.3, gradient = FALSE)

# What the record says of responses (rows x k) beside the model of a calibration, taken as its
# tangent: their log10 Bayes factor against none, its 95 % interval and the word. Amounts are N(0,
# 1) times the scale that suits the record best.
responses_factor <- function(fit, responses, threads, scales = rules$drift_scale^(0:2)) {
  data <- history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  ais <- fill_ais_control(utils::modifyList(fit$control$ais, response_ais))
  evidence <- function(responses) {
    call_engine(response_evidence_(data, fit$priors, fit$tangent, responses, ais,
                                   engine_context(fit$seed, threads)))
  }
  of <- lapply(scales, function(scale) evidence(scale * responses))
  nothing <- evidence(matrix(0, length(fit$rows), 0))
  factor_of(of[[which.max(vapply(of, `[[`, 0, "log_evidence"))]], nothing)
}
