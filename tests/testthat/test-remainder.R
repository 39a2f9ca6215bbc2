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
  expect_match(door$pattern$what, "every day around 10:00 the measured Ti is on average [78].* K lower than simulated")
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

test_that("a large error that answers to nothing makes the verdict unexplained", {
  upgrade <- base_only(small_upgrade())
  upgrade$models[[1]]$attribution$table$significant <- FALSE
  p <- upgrade$models[[1]]$prediction
  r <- ifelse(seq_along(p$observed) %% 24 == 9, 1, 0)
  upgrade$models[[1]]$prediction$observed <- p$mean + withr::with_seed(1, rnorm(nrow(p), 0, 0.05)) + r
  verdict <- amiss:::diagnosis_verdict(upgrade)
  expect_equal(verdict$verdict, "unexplained")
  expect_match(verdict$headline, "every day around")
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
  expect_no_match(paste(summary(upgrade)$remains, collapse = " "), "do not read their values")
  upgrade$models[[2]]$fit$reach[] <- c(0.01, 0.01, 0.98)
  expect_match(summary(upgrade)$remains, "they may hide a part of it, so do not read their values as physical",
               all = FALSE)
})

test_that("a cause that leaves a good part of the error is only likely", {
  upgrade <- small_upgrade()
  p <- upgrade$models[[2]]$prediction
  # Both models as they were, plus an error that neither explains.
  extra <- withr::with_seed(1, rnorm(nrow(p), 0, 5))
  for (k in 1:2) upgrade$models[[k]]$prediction$observed <- upgrade$models[[k]]$prediction$observed + extra
  expect_true(amiss:::much_remains(upgrade$models, upgrade$measurements))
  expect_false(amiss:::much_remains(small_upgrade()$models, upgrade$measurements))
})

test_that("a cause is only likely where a drift would explain the record as well", {
  upgrade <- small_upgrade()
  rivals <- function(u) amiss:::drift_rivals(u$models, u$measurements, u$control)
  expect_false(rivals(upgrade))
  # The base model off by a parabola; the extended one no better than that.
  p <- upgrade$models[[1]]$prediction
  hours <- upgrade$measurements$hours[match(p$time, upgrade$measurements$time)]
  noise <- withr::with_seed(1, rnorm(nrow(p), 0, upgrade$measurements$noise_sd))
  upgrade$models[[1]]$prediction$observed <- p$mean + noise + 3 * (hours / max(hours))^2
  upgrade$models[[2]]$prediction$observed <- upgrade$models[[2]]$prediction$mean + 1.5 * noise
  expect_true(rivals(upgrade))
  upgrade <- rejudged(upgrade)
  expect_match(upgrade$models[[2]]$doubts, "a drifting sensor would explain the error as well", all = FALSE)
  expect_match(amiss:::diagnosis_verdict(upgrade)$tag, "a drifting sensor would explain the error as well")
})

test_that("slopes of the output are those of the emulated series", {
  fit <- small_upgrade()$models[[1]]$fit
  slopes <- amiss:::output_slopes(fit)
  expect_identical(dim(slopes), c(length(fit$rows), length(fit$emulator$parameters)))
  unit <- amiss:::posterior_unit(fit)
  own <- colSums(fit$weights * unit)
  near <- function(by) fit$emulator$basis$vectors %*% t(amiss:::emulated_coefficients(fit$emulator, t(own + by))$mean)
  expect_equal(slopes[, 1], as.numeric(near(replace(0 * own, 1, 0.01)) - near(replace(0 * own, 1, -0.01))) / 0.02,
               tolerance = 0.02)
})
