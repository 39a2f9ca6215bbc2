refined <- function(runs = 6, seed = 1, ..., m = bent_measurements()) {
  calibrate_refined(simulate_design(bent_simulator(), m, runs, seed = seed), m,
                    control = list(calibration = quick_ais), seed = 1, ...)
}

test_that("a small design leads to a calibration that runs of the simulator confirm", {
  fit <- refined()
  expect_true(fit$check$passed)
  expect_true(fit$trust$trusted)
  expect_true(fit$modes$agree)
  # The first round shows where the posterior lies, the second measures it.
  expect_gte(fit$rounds, 2)
  # An emulator of the region of the mode, from the runs in it.
  expect_false(is.null(fit$emulator$processes$region))
  expect_true(all(amiss:::in_region(fit$emulator$processes$region, fit$emulator$unit)))
  expect_gte(nrow(fit$emulator$unit), 25 - 2)
  expect_true(all(abs(coef(fit) - c(0.6, 0.8)) < 0.05))
})

test_that("the evidence does not depend on the design, the seed or the number of runs", {
  first <- refined()
  m <- bent_measurements()
  reseeded <- calibrate_refined(simulate_design(bent_simulator(), m, 6, seed = 4), m,
                                control = list(calibration = quick_ais), seed = 9)
  for (other in list(refined(seed = 2), refined(runs = 40, seed = 3), reseeded)) {
    # Four standard errors of the sampler, and a tenth of a decade for the emulators.
    allowed <- 4 * sqrt(first$standard_error^2 + other$standard_error^2) + 0.1 * log(10)
    expect_lt(abs(first$log_evidence - other$log_evidence), allowed)
    sd <- sqrt(diag(vcov(first)))
    # A median of some hundred draws has an error of 0.13 standard deviations: four of a difference.
    expect_lt(max(abs(coef(first) - coef(other)) / sd), 4 * sqrt(2) * 0.13)
  }
})

# What responds to the sun's past hardly differs from the slope of a time constant: what of it is
# left to the discrepancy, and with it the evidence, asks for slopes that are exact.
test_that("the evidence of a model whose slopes bend does not depend on the seed", {
  skip_on_cran()  # second tier: tools/test --quick
  data <- synthetic_weather(days = 12, seed = 4, step_h = 0.25)
  n <- nrow(data)
  data$Ti <- 18 + 0.5 * data$Te + 0.004 * data$Gv[c(1:2, 1:(n - 2))] +
    withr::with_seed(3, rnorm(n, sd = 0.1))
  m <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv + Ws, noise_sd = 0.1,
                    validate = data$hour > 216)
  mass <- function_simulator(function(values, drivers) {
    kept <- exp(-0.25 / values[["tau"]])
    sun <- stats::filter((1 - kept) * drivers[, "Gv"], kept, "recursive", init = drivers[1, "Gv"])
    values[["o"]] + values[["g"]] * drivers[, "Te"] + values[["s"]] * as.numeric(sun)
  }, free("o", uniform(15, 21)), free("g", uniform(0, 1)), free("s", uniform(0, 0.02)),
     free("tau", uniform(0.1, 10)), boundary = c("Te", "Gv"))
  fits <- lapply(4:6, function(seed) {
    calibrate_refined(simulate_design(mass, m, runs = 90, seed = seed), m, seed = seed)
  })
  log10_evidence <- vapply(fits, function(fit) fit$log_evidence / log(10), 0)
  expect_lt(diff(range(log10_evidence)), 0.2)
  for (fit in fits) {
    values <- fit$best$values[1, ]
    ends <- lapply(c(-1e-4, 1e-4), function(step) {
      outer(values, rep(1, 4)) + diag(step * values)
    })
    runs <- lapply(ends, function(z) {
      amiss:::simulate_measured(mass, t(z), m, "calibrate", 1)
    })
    exact <- qr.Q(qr((runs[[2]] - runs[[1]]) %*% diag(1 / values)))
    moves <- fit$emulator$moves$root
    outside <- moves - exact %*% crossprod(exact, moves)
    # That of tau turns by as much over a twentieth of its standard deviation.
    expect_lt(max(sqrt(colSums(outside^2) / colSums(moves^2))), 1e-3)
  }
})

test_that("the posterior ends where the simulator fails, and its share is told", {
  data <- linear_data(200)
  data$Ti <- 20 + 0.6 * data$Te + 0.01 * data$Gv + withr::with_seed(3, rnorm(200, sd = 0.1))
  m <- linear_measurements(data, boundary = ~ Te + Gv)
  free_to_fail <- function(limit) {
    function_simulator(function(values, drivers) {
      if (values[["g"]] > limit) stop("the solver did not converge")
      20 + values[["g"]] * drivers[, "Te"] + values[["s"]] * drivers[, "Gv"]
    }, free("g", uniform(0, 1)), free("s", uniform(0, 0.05)), boundary = c("Te", "Gv"))
  }
  fit_of <- function(limit) {
    runs <- suppressWarnings(simulate_design(free_to_fail(limit), m, runs = 60, seed = 1))
    calibrate_refined(runs, m, seed = 1)
  }
  line <- summary(lm(I(Ti - 20) ~ 0 + Te + Gv, data))$coefficients
  limit <- line["Te", 1] + 0.7 * line["Te", 2]
  fit <- fit_of(limit)
  expect_true(fit$trust$trusted)
  beyond <- stats::pnorm(0.7, lower.tail = FALSE)
  # A thousand draws, and an end that some thirty runs show to a fifth of a standard deviation.
  expect_lt(abs(fit$failing - beyond), 0.07)
  expect_lt(confint(fit)["g", 2], limit + 0.25 * line["Te", 2])
  expect_match(printed(fit), sprintf("fails: that cuts off %s of it", amiss:::percent(fit$failing)))
  expect_match(amiss:::failing_sentence(fit), "ends where the simulator fails")
  # Nothing that is drawn lies beyond: simulate() takes draws of the discrepancy.
  expect_true(all(fit$weights[fit$kept + 1] > 0))
  expect_identical(ncol(fit$coefficients), length(fit$kept))
  expect_lt(max(fit$values[fit$weights > 0, "g"]), limit + line["Te", 2])
  expect_equal(fit$posterior$ess, 1 / sum(fit$weights^2))
  # The evidence falls by this share.
  whole <- fit_of(1)
  expect_lt(abs(fit$log_evidence - whole$log_evidence - log(1 - fit$failing)),
            4 * sqrt(fit$standard_error^2 + whole$standard_error^2))
})

test_that("no rounds: the ensemble as it is, as by calibrate()", {
  m <- bent_measurements()
  runs <- simulate_design(bent_simulator(), m, 20, seed = 1)
  control <- list(calibration = quick_ais, emulator = list(noise_fraction = 0.1))
  fit <- calibrate_refined(runs, m, rounds = 0, control = control, seed = 3)
  alone <- calibrate(train_emulator(runs, m, list(noise_fraction = 0.1)), m, quick_ais, seed = 3)
  expect_equal(fit$rounds, 0)
  expect_identical(fit[c("values", "weights", "log_evidence", "check")],
                   alone[c("values", "weights", "log_evidence", "check")])
  rough <- refined(rounds = 0)
  expect_false(rough$check$passed)
  expect_false(rough$trust$trusted)
  expect_equal(nrow(rough$emulator$unit), 6)
})

counting_simulator <- function(count) {
  bent_simulator(function(values, drivers) {
    count$runs <- count$runs + 1
    bent_run(values, drivers)
  })
}

test_that("the runs that are made are told, also those of a check alone", {
  m <- bent_measurements()
  for (rounds in c(8, 1, 0)) {
    count <- new.env()
    count$runs <- 0
    runs <- simulate_design(counting_simulator(count), m, 6, seed = 1)
    count$runs <- 0
    fit <- calibrate_refined(runs, m, rounds = rounds, control = list(calibration = quick_ais),
                             seed = 1)
    expect_equal(fit$runs_made, count$runs, label = paste("runs of", rounds, "rounds"))
  }
})

test_that("a calibration of two parameters takes less than a hundred runs", {
  # Searches of a dozen each, 25 in the region, 3 for the tangent, 10 and 20 for checks.
  expect_lte(refined()$runs_made, 100)
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
  expect_equal(fit$rounds, 0)
  expect_equal(fit$runs_made, 0)
  expect_false(fit$check$passed)
  expect_false(fit$trust$trusted)
  expect_equal(nrow(fit$emulator$unit), 6)
})

test_that("runs that fail are counted, and do not join the ensemble", {
  count <- 0
  fragile <- bent_simulator(function(values, drivers) {
    count <<- count + 1
    if (count %in% c(10, 30, 45)) NaN * drivers[, "Te"] else bent_run(values, drivers)
  })
  m <- bent_measurements()
  fit <- calibrate_refined(simulate_design(fragile, m, 6, seed = 1), m, seed = 1,
                           control = list(calibration = quick_ais))
  expect_gt(count, 45)
  expect_true(fit$check$passed)
  expect_true(all(is.finite(fit$emulator$basis$vectors)))
  expect_equal(fit$runs_made, count - 6)
})

test_that("as many runs lie in the region as were asked for", {
  m <- bent_measurements()
  first <- simulate_design(bent_simulator(), m, 6, seed = 1)
  count <- function(runs) {
    fit <- calibrate_refined(first, m, rounds = 1, runs = runs, seed = 1,
                             control = list(calibration = quick_ais))
    nrow(fit$emulator$unit)
  }
  # Some of a wider region, and of its tangent, are among them; the final region may lose a tenth.
  for (runs in c(25, 60)) {
    expect_gte(count(runs), 0.9 * runs)
    expect_lte(count(runs), runs + 12)
  }
})

test_that("bad arguments are refused", {
  m <- bent_measurements()
  runs <- simulate_design(bent_simulator(), m, 6, seed = 1)
  expect_error(calibrate_refined("runs", m), "ensemble", class = "amiss_error_input")
  expect_error(calibrate_refined(runs, m, rounds = -1), "rounds", class = "amiss_error_input")
  expect_error(calibrate_refined(runs, m, control = list(check = 3)), "unknown option.*check",
               class = "amiss_error_input")
  expect_error(calibrate_refined(runs, m, control = list(calibration = list(check = 1.5))),
               "control\\$calibration\\$check` must be one whole number; got the number 1.5",
               class = "amiss_error_input")
})

checked_by_hand <- function(passed = TRUE, effective = 0.5, border = 0, ratio = 0.1,
                            standard_error = 0.1, log_evidence = 10, ess = 400) {
  list(check = list(passed = passed, effective = effective, border = border, ratio = ratio),
       standard_error = standard_error, log_evidence = log_evidence, posterior = list(ess = ess))
}

test_that("verification ends once a check passes with enough to spare, and two rounds agree", {
  settled <- function(before = 10, ...) amiss:::has_settled(list(checked_by_hand(...)), before)
  expect_true(settled())
  expect_false(settled(before = NULL))  # the first round shows where the posterior lies
  expect_false(settled(before = 8.8))
  expect_true(settled(before = 9.5))
  expect_false(settled(effective = 0.2))
  expect_false(settled(passed = FALSE))
  expect_false(settled(passed = NA))
  # A hundredth within two standard errors of its draws: 0.01 + 2 sqrt(0.01 0.99 / 400) = 0.02.
  expect_true(settled(border = 0.0199))
  expect_false(settled(border = 0.02))
  expect_false(settled(border = 0.0199, ess = 500))
  expect_false(settled(standard_error = 1.5))
  # Of several records all.
  expect_false(amiss:::has_settled(list(checked_by_hand(), checked_by_hand(passed = FALSE)), 10))
})

test_that("of rounds the one with the best check is the better one", {
  score <- function(...) amiss:::check_score(list(...))
  expect_gt(score(checked_by_hand(effective = 0.2)),
            score(checked_by_hand(passed = FALSE, effective = 0.9)))
  expect_gt(score(checked_by_hand(effective = 0.6)), score(checked_by_hand(effective = 0.5)))
  expect_gt(score(checked_by_hand(effective = NA, ratio = 0.1)),
            score(checked_by_hand(effective = NA, ratio = 0.2)))
  expect_gt(score(checked_by_hand(passed = FALSE, effective = 0.01)), score(list(check = NULL)))
  # The share of a few runs that are all off is large: one of four, one of sixteen.
  expect_gt(score(checked_by_hand(passed = FALSE, effective = 0.06, standard_error = 1)),
            score(checked_by_hand(passed = FALSE, effective = 0.25, standard_error = 1e5)))
  # Of several records the worst check counts.
  expect_gt(score(checked_by_hand(), checked_by_hand(effective = 0.4)),
            score(checked_by_hand(effective = 0.9), checked_by_hand(effective = 0.3)))
})

test_that("where later rounds are worse, the one before them stays", {
  rounds <- 0
  check <- amiss:::check_by_runs
  stand_in(check_by_runs = function(...) {
    found <- check(...)
    rounds <<- rounds + 1
    found$fits[[1]]$check[c("passed", "border", "effective")] <- list(TRUE, 0, 0.3 / rounds)
    found
  })
  fit <- refined(rounds = 3)
  expect_equal(rounds, 3)
  expect_equal(fit$check$effective, 0.3)
  expect_equal(fit$rounds, 3)
})

test_that("verification ends after two rounds without progress", {
  stalled <- amiss:::has_stalled
  expect_false(stalled(c(40, 50)))  # too early to tell
  expect_false(stalled(c(12.6, 9.4, 6.6)))
  expect_false(stalled(c(43, 34, 9, 38)))
  expect_true(stalled(c(43, 34, 9, 38, 12)))
  expect_false(stalled(c(0, 0, 0)))  # an emulator without error, whose region is not settled
  expect_false(stalled(c(0.1, 0.2, 0.3)))
  expect_true(stalled(c(0.5, 1, 2)))
  check <- amiss:::check_by_runs
  rounds <- 0
  stand_in(check_by_runs = function(...) {
    found <- check(...)
    rounds <<- rounds + 1
    found$fits[[1]]$check[c("passed", "ratio")] <- list(FALSE, c(1, 2, 2, 0.1)[rounds])
    found
  })
  refined(rounds = 8)
  expect_equal(rounds, 3)
})
