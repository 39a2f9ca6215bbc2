# Rates and amplitudes over two decades: the emulator of a small design is far too coarse.
wide_simulator <- function(...) {
  function_simulator(function(values, drivers) {
    kept <- exp(-10^values[["rate"]])
    slow <- as.numeric(stats::filter((1 - kept) * drivers[, "Te"], kept, "recursive"))
    20 + 10^values[["gain"]] * slow + if ("offset" %in% names(values)) values[["offset"]] else 0
  }, ..., boundary = "Te", name = "wide")
}

wide_parameters <- list(free("rate", uniform(-2, 0)), free("gain", uniform(-2, 0)),
                        free("offset", normal(0, 1, -4, 4), "K"))

wide_record <- function(simulator, values) {
  data <- linear_data()
  data$Ti <- simulator$f(values, as.matrix(data["Te"])) + withr::with_seed(8, rnorm(nrow(data), 0, 0.1))
  linear_measurements(data)
}

test_that("the search finds the parameters on the simulator itself", {
  simulator <- do.call(wide_simulator, wide_parameters)
  truth <- c(rate = -1.2, gain = -0.3, offset = 0.5)
  m <- wide_record(simulator, truth)
  emulator <- train_emulator(simulate_design(simulator, m, 12, seed = 1), m)
  set <- amiss:::calibration_setting(emulator, m, quick_ais, 1)
  found <- amiss:::search_mode(list(set), numeric(3), 1)
  true_z <- qnorm(vapply(names(truth), function(n) amiss:::prior_cdf(emulator$parameters[[n]]$prior, truth[[n]]), 0))
  apart <- found$centre - true_z
  expect_lt(sum(apart * solve(found$covariance, apart)), stats::qchisq(0.9999, 3))
  expect_gt(found$runs, 10)
  expect_lte(found$runs, 1 + 20 * (3 + 6))
})

test_that("one parameter is enough, and a start where the simulator fails is an error of its own", {
  simulator <- wide_simulator(wide_parameters[[2]], free("rate", uniform(-1.21, -1.19)))
  m <- wide_record(simulator, c(rate = -1.2, gain = -0.3))
  alone <- wide_simulator(wide_parameters[[2]])
  alone$f <- function(values, drivers) simulator$f(c(values, rate = -1.2), drivers)
  emulator <- train_emulator(simulate_design(alone, m, 8, seed = 1), m)
  set <- amiss:::calibration_setting(emulator, m, quick_ais, 1)
  found <- amiss:::search_mode(list(set), 0, 1)
  expect_length(found$centre, 1)
  expect_lt(abs(10^amiss:::unit_to_values(matrix(pnorm(found$centre)), emulator$parameters)[1, 1] - 10^-0.3), 0.02)
  set$emulator$simulator$f <- function(values, drivers) NaN * drivers[, 1]
  expect_error(amiss:::search_mode(list(set), 0, 1), "failed where a search begins", class = "amiss_error_numerical")
})

test_that("an ensemble far too coarse leads to a calibration that its check confirms", {
  simulator <- do.call(wide_simulator, wide_parameters)
  truth <- c(rate = -1.2, gain = -0.3, offset = 0.5)
  m <- wide_record(simulator, truth)
  runs <- simulate_design(simulator, m, 12, seed = 1)
  expect_true(amiss:::too_coarse(train_emulator(runs, m), m))
  fit <- calibrate_refined(runs, m, control = list(calibration = quick_ais), seed = 1)
  expect_true(fit$check$passed)
  expect_gte(fit$rounds, 1L)
  table <- tidy(fit)
  expect_true(all(table$conf.low < truth[table$term] & truth[table$term] < table$conf.high))
  # The same evidence from another design, within four standard errors.
  other <- calibrate_refined(simulate_design(simulator, m, 12, seed = 2), m, control = list(calibration = quick_ais),
                             seed = 2)
  expect_lt(abs(fit$log_evidence - other$log_evidence), 4 * sqrt(fit$standard_error^2 + other$standard_error^2))
})
