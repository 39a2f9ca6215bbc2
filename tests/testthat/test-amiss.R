record <- linear_data(96)[c("hour", "Ti", "Te", "Gv")]
design <- withr::with_seed(4, lhs::randomLHS(20, 2))
design <- cbind(offset = 10 + 20 * design[, 1], gain = design[, 2])
runs <- outer(rep(1, 96), design[, "offset"]) + outer(record$Te, design[, "gain"])
quick <- list(calibration = quick_ais)

test_that("one call does what the stages do", {
  m <- measurements(record, "hour", "Ti", c("Te", "Gv"), noise_sd = 0.1)
  made <- ensemble(design, runs, measurements = m)
  fit <- amiss(record, design, runs, noise_sd = 0.1, control = quick, seed = 5)
  by_stages <- calibrate(train_emulator(made, m), m, quick_ais, seed = 5)
  expect_identical(fit$values, by_stages$values)
  expect_identical(fit$log_evidence, by_stages$log_evidence)
  expect_identical(amiss(m, design, runs, control = quick, seed = 5)$values, fit$values)
  expect_equal(unname(coef(fit)), c(20, 0.4), tolerance = 0.02)
})

test_that("without the noise it is taken from second differences", {
  expect_message(m <- record_measurements(record, NULL), "noise of \"Ti\"",
                 class = "amiss_message_noise")
  expect_equal(m$conditions, c("Te", "Gv"))
  expect_equal(m$noise_sd, difference_sd(record$hour, record$Ti))
  # Of 4000 values it is known to 2 %; the course adds (0.01)^2 / 6 to a square of 0.01.
  hours <- c(1:2000, 3001:5000)
  y <- 20 + 5 * sin(hours / 24) + withr::with_seed(1, rnorm(4000, 0, 0.1)) + 50 * (hours > 2500)
  expect_equal(difference_sd(hours, y), 0.1, tolerance = 0.05)
  expect_equal(difference_sd(hours, replace(y, 7, NA)), difference_sd(hours, y), tolerance = 0.01)
})

test_that("what cannot be calibrated is refused", {
  refused <- function(what, ...) expect_error(amiss(...), what, class = "amiss_error_input")
  refused("time, target and boundary", record[1:2], design, runs)
  refused("time, target and boundary", as.matrix(record), design, runs)
  refused("not numeric", transform(record, Ti = as.character(Ti), hour = hour), design, runs)
  refused("needs its run", record, design[-1, ], runs, noise_sd = 0.1)
  refused("part of the", linear_measurements(), design, runs, noise_sd = 0.1)
})
