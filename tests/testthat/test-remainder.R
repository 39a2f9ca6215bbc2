model_of <- function(r, hours = seq_along(r), noise = 1, time = hours) {
  m <- list(hours = hours, time = time, noise_sd = noise, unit = "K", target = "Ti")
  model <- list(prediction = data.frame(use = "calibrate", observed = r, mean = 0),
                fit = list(rows = seq_along(r), emulator = list(basis = list(vectors = matrix(0, length(r), 2)))))
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
  upgrade$models[[1]]$fit$misfit$p <- 0.5
  expect_equal(amiss:::diagnosis_verdict(upgrade)$verdict, "nothing")
  upgrade$models[[1]]$fit$misfit$p <- 1e-4
  expect_equal(amiss:::diagnosis_verdict(upgrade)$verdict, "unexplained")
})

test_that("a model that cannot follow the measurements even inside the simulation space is doubted", {
  upgrade <- small_upgrade()
  expect_no_match(paste(summary(upgrade)$remains, collapse = " "), "best parameters")
  upgrade$models[[2]]$fit$misfit$p <- 1e-4
  expect_match(amiss:::diagnosis_verdict(upgrade)$tag, "cannot follow the measurements")
  expect_match(paste(summary(upgrade)$remains, collapse = " "), "Even with the best parameters")
})

test_that("a cause that leaves a good part of the error is only likely", {
  upgrade <- small_upgrade()
  p <- upgrade$models[[2]]$prediction
  # Both models as they were, plus an error that neither explains.
  extra <- withr::with_seed(1, rnorm(nrow(p), 0, 5))
  for (k in 1:2) upgrade$models[[k]]$prediction$observed <- upgrade$models[[k]]$prediction$observed + extra
  expect_true(amiss:::much_remains(upgrade))
  expect_false(amiss:::much_remains(small_upgrade()))
  expect_match(amiss:::diagnosis_verdict(upgrade)$tag, "a good part of the error remains")
})

test_that("a cause is only likely where a drift would explain the record as well", {
  upgrade <- small_upgrade()
  expect_false(amiss:::drift_rivals(upgrade))
  expect_identical(amiss:::diagnosis_verdict(upgrade)$verdict, "named")
  # The base model off by a parabola; the extended one no better than that.
  p <- upgrade$models[[1]]$prediction
  hours <- upgrade$measurements$hours[match(p$time, upgrade$measurements$time)]
  noise <- withr::with_seed(1, rnorm(nrow(p), 0, upgrade$measurements$noise_sd))
  upgrade$models[[1]]$prediction$observed <- p$mean + noise + 3 * (hours / max(hours))^2
  upgrade$models[[2]]$prediction$observed <- upgrade$models[[2]]$prediction$mean + 1.5 * noise
  expect_true(amiss:::drift_rivals(upgrade))
  expect_match(amiss:::diagnosis_verdict(upgrade)$tag, "a drifting sensor would explain the error as well")
})

test_that("slopes of the output are those of the emulated series", {
  fit <- small_upgrade()$models[[1]]$fit
  slopes <- amiss:::output_slopes(fit)
  expect_identical(dim(slopes), c(length(fit$rows), length(fit$emulator$parameters)))
  unit <- amiss:::posterior_unit(fit)
  own <- colSums(fit$weights * unit)
  near <- function(by) fit$emulator$basis$vectors %*% t(amiss:::predict_emulator_(fit$emulator$processes, t(own + by))$mean)
  expect_equal(slopes[, 1], as.numeric(near(replace(0 * own, 1, 0.01)) - near(replace(0 * own, 1, -0.01))) / 0.02, tolerance = 0.02)
})
