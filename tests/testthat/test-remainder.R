model_of <- function(r, hours = seq_along(r), noise = 1, time = hours) {
  m <- list(hours = hours, time = time, noise_sd = noise, unit = "K", target = "Ti")
  model <- list(prediction = data.frame(use = "calibrate", observed = r, mean = 0),
                fit = list(rows = seq_along(r), emulator = list(parameters = list(a = 1, b = 2))))
  amiss:::remaining_error(model, m)
}

test_that("an error as large as the noise leaves nothing to say", {
  withr::with_seed(1, white <- rnorm(240))
  left <- model_of(white)
  expect_equal(left$ratio, sqrt(sum(white^2) / 238))
  expect_false(left$large)
  expect_null(left$pattern)
  slow <- withr::with_seed(2, 0.6 * as.numeric(stats::filter(rnorm(240), 0.8, "recursive")))
  expect_false(model_of(slow)$large)
})

test_that("what comes back every day is told with its hour, what drifts with its size", {
  hours <- seq_len(240)
  noise <- withr::with_seed(1, rnorm(240))
  door <- model_of(noise - 8 * (hours %% 24 == 10), hours)
  expect_true(door$large)
  expect_match(door$pattern$what,
               "around 10:00 the measured Ti is in the mean of all days [78].* K lower")
  drift <- model_of(noise + 8 * (hours / 240)^2 - 3, hours)
  expect_match(drift$pattern$what, "it drifts, by \\+[78].*K from the beginning")
  expect_null(model_of(3 * noise, hours)$pattern)
})

test_that("the hour is that of the record's clock", {
  time <- as.POSIXct("2024-03-01 00:30", tz = "Europe/Berlin") + 3600 * seq_len(240)
  hour <- as.POSIXlt(time)$hour
  noise <- withr::with_seed(1, rnorm(240))
  left <- model_of(noise + 8 * (hour == 7), as.numeric(time) / 3600, time = time)
  expect_match(left$pattern$what, "around 07:30")
})

test_that("the clock is that of the record whose time is text", {
  stamp <- as.POSIXct("2013-08-30 00:10:00", tz = "UTC") + 600 * (seq_len(600) - 1)
  hours <- as.numeric(stamp) / 3600
  clock <- as.POSIXlt(stamp)$hour + as.POSIXlt(stamp)$min / 60
  time <- amiss:::read_time(format(stamp, "%Y-%m-%d %H:%M:%S"), "time")
  expect_equal(amiss:::clock_hour(time), clock, tolerance = 1e-4)
  noise <- withr::with_seed(1, rnorm(600))
  expect_no_warning(left <- model_of(noise + 20 * (abs(clock - 7.5) < 0.01), hours, time = time))
  expect_match(left$pattern$what, "around 07:30")
})

test_that("two days say nothing of every day", {
  hours <- seq_len(48)
  noise <- withr::with_seed(1, rnorm(48))
  expect_null(model_of(noise - 8 * (hours %% 24 == 10), hours)$pattern)
})

test_that("a large error that responds to nothing makes the verdict unexplained", {
  upgrade <- base_only(small_upgrade())
  upgrade$models[[1]]$attribution$table$significant <- FALSE
  p <- upgrade$models[[1]]$prediction
  r <- ifelse(seq_along(p$observed) %% 24 == 9, 1, 0)
  upgrade$models[[1]]$prediction$observed <- p$mean +
    withr::with_seed(1, rnorm(nrow(p), 0, 0.05)) + r
  verdict <- amiss:::diagnosis_verdict(upgrade)
  expect_equal(verdict$verdict, "unexplained")
  expect_match(verdict$headline, "in the mean of all days")
  upgrade$models[[1]]$prediction$observed <- p$mean + withr::with_seed(1, rnorm(nrow(p), 0, 0.05))
  expect_equal(amiss:::diagnosis_verdict(upgrade)$verdict, "nothing")
  # Silence of numbers that are not trusted is told as such.
  upgrade$models[[1]]$fit$trust <- list(trusted = FALSE, verdict = "chains stick")
  verdict <- amiss:::diagnosis_verdict(upgrade)
  expect_equal(verdict$verdict, "nothing")
  expect_match(verdict$headline, "not to be trusted: chains stick")
})

test_that("a discrepancy that reaches into what the parameters can do is told", {
  upgrade <- small_upgrade()
  expect_no_match(paste(summary(upgrade)$remains, collapse = " "), "values may be biased")
  # a grid of which the record prefers the free one
  upgrade$models[[2]]$fit$control$reach <- c(13, Inf)
  upgrade$models[[2]]$fit$reach <- c("13" = 0.02, "Inf" = 0.98)
  expect_match(summary(upgrade)$remains,
               "they may hide a part of it, and their values may be biased", all = FALSE)
})

test_that("a cause that leaves a good part of the error is only likely", {
  upgrade <- small_upgrade()
  p <- upgrade$models[[2]]$prediction
  # Both models as they were, plus an error that neither explains.
  extra <- withr::with_seed(1, rnorm(nrow(p), 0, 5))
  for (k in 1:2)
    upgrade$models[[k]]$prediction$observed <- upgrade$models[[k]]$prediction$observed + extra
  expect_true(amiss:::much_remains(upgrade$models, upgrade$measurements))
  expect_false(amiss:::much_remains(small_upgrade()$models, upgrade$measurements))
})

# A record that drifts by `by` over its length and feels the sun by `sun`; its models with the sun
# and with the drift.
drift_world <- function(by, sun) {
  data <- linear_data()
  data$Ti <- data$Ti + by * (data$hour / 240)^2 + sun * data$Gv
  m <- linear_measurements(data, boundary = ~ Te + Gv, calibrate = data$hour <= 192,
                           validate = data$hour > 192)
  fit <- function(simulator) {
    runs <- simulate_design(simulator, m, runs = 30, seed = 1)
    list(fit = calibrate(train_emulator(runs, m), m, quick_ais, seed = 1))
  }
  base <- linear_simulator()
  sunny <- with_parameters(base, free("sun", uniform(0, 0.02)), boundary = "Gv",
                           f = function(values, drivers, base) {
    base(values) + values[["sun"]] * drivers[, "Gv"]
  })
  list(m = m, base = fit(base), sunny = fit(sunny), fit = fit)
}

test_that("a drift rivals a mechanism that does no better than it, and none that does", {
  rivals <- function(world)
    amiss:::drift_rivals(world[c("base", "sunny")], list(decisive = 2), threads = 1)
  expect_true(rivals(drift_world(by = 3, sun = 0)))
  expect_false(rivals(drift_world(by = 0, sun = 0.01)))
})

test_that("the evidence for a drift is that of a full calibration with such a drift", {
  world <- drift_world(by = 1, sun = 0)
  base <- world$base$fit
  hours <- world$m$hours[base$rows]
  parabola <- sqrt(length(hours)) * stats::poly(hours, 2)
  size <- 0.5
  whole <- sqrt(length(hours)) * stats::predict(stats::poly(hours, 2), world$m$hours)
  drifting <- with_parameters(linear_simulator(), free("slope", normal(0, size)),
                              free("bend", normal(0, size)),
                              f = function(values, drivers, info, base) {
    rows <- match(info$time, world$m$time)
    base(values) + as.numeric(whole[rows, ] %*% c(values[["slope"]], values[["bend"]]))
  })
  full <- bayes_factor(world$fit(drifting)$fit, base)
  seen <- amiss:::responses_factor(base, size * parabola, threads = 1, scales = 1)
  # Within what the two samplers state.
  expect_lt(abs(seen$log10_bf - full$log10_bf),
            (seen$upper95 - seen$log10_bf) + (full$upper95 - full$log10_bf) + 0.1)
  expect_gt(full$log10_bf, 2)
})

test_that("a mechanism that moves the simulation as a drift does is known from one that does not", {
  world <- drift_world(by = 3, sun = 0.01)
  drifting <- with_parameters(linear_simulator(), free("slope", normal(0, 0.1)),
                              f = function(values, drivers, base) {
    base(values) + values[["slope"]] * seq_len(nrow(drivers)) / 24
  })
  acts <- function(model) amiss:::acts_as_drift(world$base$fit, model$fit, threads = 1)
  expect_true(acts(world$fit(drifting)))
  expect_false(acts(world$sunny))
})

test_that("a cause that a drift rivals is only likely", {
  upgrade <- small_upgrade()
  expect_false(amiss:::drift_rivals(upgrade$models, upgrade$control, threads = 1))
  upgrade$models[[2]]$fit$log_evidence <- upgrade$models[[1]]$fit$log_evidence
  expect_true(amiss:::drift_rivals(upgrade$models, upgrade$control, threads = 1))
  upgrade <- rejudged(upgrade)
  expect_match(upgrade$models[[2]]$doubts, "a drifting sensor would explain the error as well",
               all = FALSE)
  expect_match(amiss:::diagnosis_verdict(upgrade)$tag,
               "a drifting sensor would explain the error as well")
})

test_that("a drift in what the error responds to does not put the sensor under suspicion", {
  r <- withr::with_seed(1, rnorm(240)) + 8 * (seq_len(240) / 240)^2
  m <- list(hours = seq_len(240), time = seq_len(240), unit = "K", target = "Ti")
  where <- function(answers) amiss:::remainder_pattern(r, seq_len(240), m, answers)$where
  expect_match(where(character()), "Suspect a drifting sensor")
  expect_identical(where("Ws"), "It may follow Ws, to which it responds.")
})

test_that("readings that stand apart are told, and what a model leaves otherwise is not", {
  noise <- withr::with_seed(1, rnorm(2000))
  apart <- function(r, hours = seq_along(r)) amiss:::spikes(r, hours, 1)
  expect_length(apart(noise), 0)
  expect_length(apart(as.numeric(stats::filter(noise, 0.95, "recursive"))), 0)
  expect_length(apart(noise + 30 * (seq_len(2000) %% 400 > 200)), 0)  # a step is no spike
  # nor is a ramp of two
  expect_length(apart(noise + 15 * pmin(pmax(seq_len(2000) - 1000, 0), 2)), 0)
  at <- c(50, 700, 1500)
  with_spikes <- noise
  with_spikes[at] <- with_spikes[at] + c(12, -14, 20)
  expect_identical(apart(with_spikes), as.integer(at))
  gap <- seq_len(2000) + 5 * (seq_len(2000) >= 50)  # after it nothing stands before a reading
  expect_length(apart(with_spikes, gap), 2)
  expect_length(apart(rep(0, 100)), 0)
  upgrade <- small_upgrade()
  told <- function(k) {
    p <- upgrade$models[[2]]$prediction
    p$observed[k] <- p$observed[k] + 1
    upgrade$models[[2]]$prediction <- p
    unname(upgrade_inspections(upgrade)["spikes"])
  }
  expect_true(is.na(told(integer())))
  expect_match(told(c(40, 90)),
               "^2 of 1[0-9][0-9] readings, the first at 2024-03-.* stand apart from those before")
})
