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

checked_by_hand <- function(passed = TRUE, effective = 0.5, border = 0, ratio = 0.1, standard_error = 0.1) {
  list(check = list(passed = passed, effective = effective, border = border, ratio = ratio),
       standard_error = standard_error)
}

test_that("the evidence asks for what the check asks for, intervals for more", {
  settled <- function(fit, purpose) amiss:::settled(fit, list(), purpose)
  evidence <- amiss:::for_evidence
  intervals <- amiss:::for_intervals
  expect_true(settled(checked_by_hand(), intervals))
  for (tails in list(checked_by_hand(border = 0.03), checked_by_hand(effective = 0.2))) {
    expect_true(settled(tails, evidence))
    expect_false(settled(tails, intervals))
  }
  expect_false(settled(checked_by_hand(passed = FALSE), evidence))
  expect_false(settled(checked_by_hand(standard_error = 1.5), evidence))
  # A coarse round asks for no exact evidence; its error is the sampler's.
  expect_true(settled(checked_by_hand(effective = NA, standard_error = 1.5), evidence))
  expect_true(amiss:::settled(checked_by_hand(passed = FALSE), NULL, intervals))  # nothing can be run
})

test_that("of rounds the one with the best check is the better one", {
  better <- function(a, b) amiss:::better_checked(list(a), list(b))
  expect_true(better(checked_by_hand(effective = 0.2), checked_by_hand(passed = FALSE, effective = 0.9)))
  expect_true(better(checked_by_hand(effective = 0.6), checked_by_hand(effective = 0.5)))
  expect_false(better(checked_by_hand(), checked_by_hand()))
  expect_true(better(checked_by_hand(effective = NA, ratio = 0.1), checked_by_hand(effective = NA, ratio = 0.2)))
  # Of several records the worst check counts.
  expect_true(amiss:::better_checked(list(checked_by_hand(), checked_by_hand(effective = 0.4)),
                                     list(checked_by_hand(effective = 0.9), checked_by_hand(effective = 0.3))))
})

test_that("where the last round is worse, the one before it stays", {
  m <- bent_measurements()
  runs <- suppressWarnings(simulate_design(bent_simulator(), m, runs = 6, seed = 1))
  rounds <- 0
  # Every calibration in full is told to have a worse check than the one before it; coarse ones ask for no more.
  sets <- amiss:::calibrate_sets
  worse <- function(...) {
    found <- sets(...)
    full <- !is.na(found$fits[[1]]$check$effective)
    rounds <<- rounds + full
    found$fits[[1]]$check[c("passed", "border")] <- list(TRUE, 0)
    if (full) found$fits[[1]]$check$effective <- 0.3 / rounds
    found
  }
  stand_in(calibrate_sets = worse)
  fit <- calibrate_refined(runs, m, rounds = 2, control = list(calibration = quick_ais), seed = 1)
  expect_gt(rounds, 1)
  expect_equal(fit$check$effective, 0.3)
  expect_equal(fit$rounds, 2L)
})
