refined <- function(runs = 6, seed = 1, ..., m = bent_measurements()) {
  calibrate_refined(simulate_design(bent_simulator(), m, runs, seed = seed), m,
                    control = list(calibration = quick_ais), seed = 1, ...)
}

test_that("a check that fails is mended by its own runs", {
  fit <- refined()
  expect_gte(fit$rounds, 1L)
  expect_true(fit$check$passed)
  expect_true(fit$trust$trusted)
  # In a region of its own, of 40 runs and those of the checks; the emulator over the priors says how far the simulator
  # moves.
  expect_false(is.null(fit$emulator$processes$region))
  expect_gte(nrow(fit$emulator$unit), 40)
  expect_gte(fit$runs_made, 40 + fit$check$runs)
  expect_equal(nrow(fit$emulator$over_priors$unit), 6)
  expect_null(fit$emulator$over_priors$simulator)
  # Evidence as of an emulator of many runs, within four standard errors.
  many <- refined(runs = 40, seed = 2)
  expect_identical(many$rounds, 0L)
  expect_lt(abs(fit$log_evidence - many$log_evidence), 4 * sqrt(fit$standard_error^2 + many$standard_error^2))
  expect_true(all(abs(coef(fit) - c(0.6, 0.8)) < 0.05))
})

test_that("no rounds: the check alone", {
  fit <- refined(rounds = 0)
  expect_identical(fit$rounds, 0L)
  expect_false(fit$check$passed)
  expect_false(fit$trust$trusted)
  expect_equal(nrow(fit$emulator$unit), 6)
  expect_equal(fit$runs_made, fit$check$runs)
})

test_that("a good ensemble is calibrated as by calibrate()", {
  m <- bent_measurements()
  runs <- simulate_design(bent_simulator(), m, 20, seed = 1)
  fit <- calibrate_refined(runs, m, control = list(calibration = quick_ais, emulator = list(noise_fraction = 0.1)),
                           seed = 3)
  alone <- calibrate(train_emulator(runs, m, list(noise_fraction = 0.1)), m, quick_ais, seed = 3)
  expect_identical(fit$rounds, 0L)
  expect_identical(fit[c("values", "weights", "log_evidence", "check")],
                   alone[c("values", "weights", "log_evidence", "check")])
})

test_that("the same seed gives the same bits, on one thread and on two", {
  expect_identical(refined(threads = 2)[c("values", "log_evidence", "runs_made")],
                   refined(threads = 1)[c("values", "log_evidence", "runs_made")])
})

test_that("runs made elsewhere are calibrated and checked, not refined", {
  m <- bent_measurements()
  made <- simulate_design(bent_simulator(), m, 6, seed = 1)
  elsewhere <- ensemble(made$values, made$outputs, made$parameters)
  fit <- calibrate_refined(elsewhere, m, control = list(calibration = quick_ais), seed = 1)
  expect_identical(fit$rounds, 0L)
  expect_equal(fit$runs_made, 0)
  expect_false(fit$check$passed)
  expect_false(fit$trust$trusted)
  expect_equal(nrow(fit$emulator$unit), 6)
})

test_that("runs that fail are counted, and do not join the ensemble", {
  count <- 0
  fragile <- bent_simulator(function(values, drivers) {
    count <<- count + 1
    if (count == 10) NaN * drivers[, "Te"] else bent_run(values, drivers)
  })
  m <- bent_measurements()
  fit <- calibrate_refined(simulate_design(fragile, m, 6, seed = 1), m, control = list(calibration = quick_ais),
                           seed = 1)
  expect_gte(fit$rounds, 1L)
  expect_true(all(is.finite(fit$emulator$basis$vectors)))
  expect_equal(fit$runs_made, count - 6)
})

test_that("what joins is what the check asks for, however many runs the exact evidence takes", {
  m <- bent_measurements()
  runs <- simulate_design(bent_simulator(), m, 6, seed = 1)
  control <- list(calibration = c(quick_ais, list(check = 10, exact = 30)))
  count <- function(exact) {
    control$calibration$exact <- exact
    nrow(calibrate_refined(runs, m, rounds = 1, control = control, seed = 1)$emulator$unit)
  }
  expect_equal(count(30), count(10))
})

test_that("as many runs are made in a round as were asked for", {
  m <- bent_measurements()
  first <- simulate_design(bent_simulator(), m, 6, seed = 1)
  count <- function(runs) {
    # Draws that the check meets twice join once: of a few draws none is met twice.
    control <- list(calibration = c(quick_ais, list(check = 10)))
    nrow(calibrate_refined(first, m, rounds = 1, runs = runs, control = control, seed = 1)$emulator$unit)
  }
  expect_equal(count(60) - count(25), 35)
})

test_that("bad arguments are refused", {
  m <- bent_measurements()
  runs <- simulate_design(bent_simulator(), m, 6, seed = 1)
  expect_error(calibrate_refined("runs", m), "ensemble", class = "amiss_error_input")
  expect_error(calibrate_refined(runs, m, rounds = -1), "rounds", class = "amiss_error_input")
  expect_error(calibrate_refined(runs, m, control = list(check = 3)), "unknown option.*check",
               class = "amiss_error_input")
  expect_error(calibrate_refined(runs, m, control = list(calibration = list(check = 1.5))),
               "control\\$calibration\\$check` = 1.5",
               class = "amiss_error_input")
})
