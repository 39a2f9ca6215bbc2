test_that("runs made elsewhere give the same as runs made here", {
  m <- linear_measurements()
  here <- simulate_design(linear_simulator(), m, runs = 30, seed = 3)
  there <- ensemble(here$values, here$outputs, linear_simulator()$parameters)
  expect_equal(there$unit, here$unit, tolerance = 1e-12)
  a <- calibrate(train_emulator(here, m), m, quick_ais, seed = 1)
  b <- calibrate(train_emulator(there, m), m, quick_ais, seed = 1)
  expect_equal(b$posterior$log_evidence, a$posterior$log_evidence, tolerance = 1e-6)
  expect_lt(abs(b$log_evidence - a$log_evidence), 0.05)  # corrected here by runs of the simulator, there by none
  expect_error(predict(b), "made elsewhere", class = "amiss_error_input")
})

test_that("bad runs are refused or left out with a word", {
  m <- linear_measurements()
  make <- function(f) function_simulator(f, free("offset", uniform(10, 30)), free("gain", uniform(0, 1)), boundary = "Te")
  expect_error(simulate_design(make(function(v, d) 1:3), m, 20), "returned 3 values", class = "amiss_error_input")
  sometimes <- make(function(v, d) if (v[["offset"]] > 25) rep(NaN, nrow(d)) else v[["offset"]] + v[["gain"]] * d[, "Te"])
  expect_warning(e <- simulate_design(sometimes, m, 40, seed = 1), "not finite.*left out", class = "amiss_warning_input")
  expect_equal(ncol(e$outputs) + e$failed, 40)
  expect_error(simulate_design(make(function(v, d) rep(NaN, nrow(d))), m, 20), "40|20 runs hold values", class = "amiss_error_input")
  expect_error(simulate_design(linear_simulator(), m, runs = 3), "too few", class = "amiss_error_input")
  expect_error(simulate_design("a model", m), "no simulator", class = "amiss_error_input")
  wrong <- function_simulator(function(v, d) d[, 1], free("a", uniform(0, 1)), boundary = "humidity")
  expect_error(simulate_design(wrong, m), "humidity.*do not have", class = "amiss_error_input")
  e <- simulate_design(linear_simulator(), m, runs = 30, seed = 3)
  expect_error(ensemble(e$values, e$outputs[, -1]), "needs its run", class = "amiss_error_input")
  expect_error(ensemble(e$values, e$outputs, list(free("offset", uniform(100, 200)), free("gain", uniform(0, 1)))),
               "No run lies where the prior", class = "amiss_error_input")
})

test_that("the design follows its seed and leaves R's generator alone", {
  m <- linear_measurements()
  set.seed(1)
  before <- .Random.seed
  a <- simulate_design(linear_simulator(), m, 20, seed = 5)
  expect_identical(.Random.seed, before)
  expect_identical(simulate_design(linear_simulator(), m, 20, seed = 5)$values, a$values)
  set.seed(2)
  b <- simulate_design(linear_simulator(), m, 20)
  set.seed(2)
  expect_identical(simulate_design(linear_simulator(), m, 20)$values, b$values)
})

test_that("whole-number runs are as good as any", {
  m <- linear_measurements()
  e <- simulate_design(linear_simulator(), m, runs = 30, seed = 3)
  whole <- matrix(as.integer(round(1000 * e$outputs)), nrow(e$outputs))
  expect_s3_class(train_emulator(ensemble(e$values, whole, e$parameters), 10), "amiss_emulator")
})

test_that("runs that cover a part of the prior are told, by parameter and number", {
  r <- simulate_design(linear_simulator(), linear_measurements(), runs = 30, seed = 3)
  with_prior <- function(prior, values = r$values) ensemble(values, r$outputs, list(free("offset", prior), free("gain", uniform(0, 1))))
  expect_warning(part <- with_prior(uniform(10, 60)), "only 38 % of the prior of offset \\(from 10.51 to 29.36\\)", class = "amiss_warning_input")
  emulator <- train_emulator(part, 0.1)
  expect_false(emulator$trust$trusted)
  expect_match(emulator$trust$verdict, "only 38 % of the prior of offset")
  expect_true(train_emulator(r, 0.1)$trust$trusted)
  # An untruncated prior reaches everywhere: its mass between the runs counts, not its limits.
  expect_error(with_prior(normal(500, 2)), "offset.*next to no mass.*between 10.51 and 29.36", class = "amiss_error_input")
  expect_no_warning(with_prior(normal(20, 4)))
  still <- r$values
  still[, "offset"] <- 20
  expect_error(with_prior(uniform(10, 30), still), "offset.*same value, 20, in all 30 runs", class = "amiss_error_input")
  expect_error(ensemble(still, r$outputs), "offset.*same value", class = "amiss_error_input")
})

test_that("runs are added where the posterior lies, and the emulator is better there", {
  hour <- seq_len(72)
  data <- data.frame(hour = hour, Te = 10 + 5 * sin(2 * pi * hour / 24))
  bent <- function_simulator(function(values, drivers) 20 + exp(3 * values[["a"]]) * 0.02 * drivers[, "Te"] + values[["b"]] * seq_len(nrow(drivers)) / 100,
                             free("a", uniform(0, 2)), free("b", uniform(-1, 1)), boundary = "Te")
  data$Ti <- bent$f(c(a = 0.12, b = 0.2), as.matrix(data["Te"])) + withr::with_seed(1, rnorm(72, 0, 0.02))
  m <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te, noise_sd = 0.02)
  first <- simulate_design(bent, m, runs = 12, seed = 2)
  fit <- calibrate(train_emulator(first, m), m, quick_ais, seed = 1)
  more <- refine_ensemble(first, fit, runs = 8)
  # Runs of the first that lie in the region, then the new ones.
  region <- more$region
  inside <- amiss:::region_distance(region, first$unit) <= 1
  n <- nrow(more$values)
  expect_equal(n, sum(inside) + 8)
  expect_lte(max(amiss:::region_distance(region, more$unit)), 1)
  expect_true(all(more$unit > 0 & more$unit < 1))
  expect_lt(abs(mean(more$values[n - 7:0, "a"]) - sum(fit$weights * fit$values[, "a"])), 0.2)
  expect_equal(more$outputs[, n], bent$f(more$values[n, ], as.matrix(data["Te"])))
  # The posterior lies inside, and what the emulator says holds there alone.
  far <- amiss:::region_distance(region, amiss:::posterior_unit(fit))
  expect_gt(sum(fit$weights[far < 1]), 0.99)
  beyond <- amiss:::region_design(within(region, radius <- 1.5 * radius), 50, 1)
  expect_identical(amiss:::in_region(region, beyond), amiss:::region_distance(region, beyond) <= 1)
  expect_true(any(!amiss:::in_region(region, beyond)))
  expect_error(stats::predict(train_emulator(more, m), cbind(a = 1.9, b = -0.9)), "outside the region", class = "amiss_error_input")
  truth <- bent$f(c(a = 0.12, b = 0.2), as.matrix(data["Te"]))
  off <- function(ensemble) max(abs(stats::predict(train_emulator(ensemble, m), cbind(a = 0.12, b = 0.2))$mean - truth))
  expect_lt(off(more), off(first))
  elsewhere <- suppressWarnings(ensemble(first$values, first$outputs))
  expect_error(refine_ensemble(elsewhere, fit), "elsewhere", class = "amiss_error_input")
  expect_error(refine_ensemble(first, "fit"), "fit", class = "amiss_error_input")
  shorter <- simulate_design(bent, measurements(data[1:60, ], time = "hour", target = "Ti", boundary = ~ Te, noise_sd = 0.02), runs = 12, seed = 2)
  expect_error(refine_ensemble(shorter, fit), "72 rows.*60", class = "amiss_error_input")
})
