test_that("runs made elsewhere give the same as runs made here", {
  m <- linear_measurements()
  here <- simulate_design(linear_simulator(), m, runs = 30, seed = 3)
  there <- ensemble(here$values, here$outputs, linear_simulator()$parameters)
  expect_equal(there$unit, here$unit, tolerance = 1e-12)
  a <- calibrate(train_emulator(here, m), m, quick_ais, seed = 1)
  b <- calibrate(train_emulator(there, m), m, quick_ais, seed = 1)
  expect_equal(b$posterior$log_evidence, a$posterior$log_evidence, tolerance = 1e-6)
  # corrected here by runs of the simulator, there by none
  expect_lt(abs(b$log_evidence - a$log_evidence), 0.05)
})

# A record of two days in use, one held out, and runs of the linear simulator over all of it.
given_world <- function(...) {
  data <- linear_data(96)
  m <- linear_measurements(data, calibrate = data$hour <= 60, validate = data$hour > 60, warmup = 6,
                           ...)
  values <- simulate_design(linear_simulator(), m, runs = 20, seed = 3)$values
  list(m = m, values = values,
       runs = simulate_runs(linear_simulator(), values, as.matrix(data["Te"]), step_h = 1),
       parameters = linear_simulator()$parameters)
}

test_that("rows of given runs are told by their number or their times", {
  w <- given_world()
  make <- function(outputs, ..., m = w$m)
    ensemble(w$values, outputs, w$parameters, measurements = m, ...)
  rows <- list(7:60, 61:96)
  all <- make(w$runs)
  expect_equal(all$outputs, w$runs[7:60, ])
  expect_equal(all$hours, 7:60)
  expect_equal(all$held_out, list(outputs = w$runs[61:96, ], hours = as.numeric(61:96)))
  expect_equal(make(w$runs[7:96, ]), all)
  expect_equal(make(w$runs[7:60, ], validation = w$runs[61:96, ]), all)
  mixed <- c(96:1, 1)
  expect_error(make(w$runs[mixed, ], time = mixed), "duplicated", class = "amiss_error_input")
  expect_equal(make(w$runs, time = 1:96), all)
  expect_equal(make(rbind(0, w$runs[5:96, ]), time = c(2, 5:96)), all)
  expect_null(make(w$runs[7:60, ])$held_out)
  expect_null(make(w$runs[7:60, ], time = 7:60)$held_out)
  refused <- function(what, ...) expect_error(make(...), what, class = "amiss_error_input")
  refused("50 rows; the measurements have 54 calibration and 36 validation rows, of 96",
          w$runs[1:50, ])
  refused("lack 1 of the 54.*calibrate; the first is at 60", w$runs[-60, ], time = (1:96)[-60])
  refused("lack 6 of the 36.*validate", w$runs[1:90, ], time = 1:90)
  refused("90 values?, the runs have 96", w$runs, time = 1:90)
  refused("54 calibration and 36", w$runs[7:60, ], validation = w$runs[1:5, ])
  refused("each row of the design needs its run", w$runs[7:60, ], validation = w$runs[61:96, -1])
  expect_error(ensemble(w$values, w$runs[7:60, ], validation = w$runs[61:96, ]),
               "needs `measurements`", class = "amiss_error_input")
})

test_that("runs at the step before averaging are averaged like the measurements", {
  w <- given_world(average = 2)
  here <- amiss:::simulate_measured(linear_simulator(), w$values, w$m, c("calibrate", "validate"),
                                    1)
  made <- ensemble(w$values, w$runs, w$parameters, measurements = w$m)
  expect_equal(rbind(made$outputs, made$held_out$outputs), here)
  expect_equal(ensemble(w$values, w$runs, w$parameters, measurements = w$m, time = 1:96), made)
  expect_equal(ensemble(w$values, here, w$parameters, measurements = w$m, time = seq(8, 96, 2)),
               made)
})

test_that("runs of other rows are refused, even if as many", {
  w <- given_world()
  made <- ensemble(w$values, w$runs, w$parameters, measurements = w$m)
  data <- linear_data(96)
  later <- linear_measurements(data, calibrate = data$hour > 42, validate = data$hour <= 42)
  expect_equal(sum(later$use == "calibrate"), 54)
  expect_error(train_emulator(made, later), "other rows.*row 1 is at 7 h in the runs, at 43 h",
               class = "amiss_error_input")
  expect_error(calibrate(train_emulator(made, w$m), later, quick_ais), "other rows",
               class = "amiss_error_input")
  expect_error(train_emulator(simulate_design(linear_simulator(), w$m, runs = 20, seed = 1), later),
               "other rows", class = "amiss_error_input")
  timed <- ensemble(w$values, w$runs[7:60, ], w$parameters, time = 7:60)
  expect_error(train_emulator(timed, later), "other rows", class = "amiss_error_input")
  expect_s3_class(train_emulator(timed, w$m), "amiss_emulator")
})

test_that("a calibration of given runs predicts held-out rows as the simulator would", {
  w <- given_world()
  made <- ensemble(w$values, w$runs, w$parameters, measurements = w$m)
  fit <- calibrate(train_emulator(made, w$m), w$m, quick_ais, seed = 1)
  expect_true(fit$check$passed)
  given <- predict(fit)
  fit$emulator$simulator <- linear_simulator()
  run <- predict(fit)
  expect_equal(given[c("time", "use", "observed")], run[c("time", "use", "observed")])
  expect_lt(max(abs(given$mean - run$mean)), 0.02)  # a fifth of the noise
  expect_lt(max(abs(given$upper95 - run$upper95)), 0.05)
  fit$emulator["simulator"] <- list(NULL)
  expect_equal(predict(fit, use = "validate")$mean, given$mean[given$use == "validate"])
  carried <- predict(fit, discrepancy = TRUE)
  expect_lt(max(abs(carried$mean - given$mean)), 0.15)  # nothing lacks
  expect_equal(amiss:::runs_given(fit, c("calibrate", "validate")), w$runs[7:96, ])
  # The emulator's own uncertainty widens the band.
  wide <- fit
  wide$emulator$basis$discarded_sd[] <- 1
  expect_gt(mean(with(predict(wide, use = "calibrate"), upper95 - lower95)), 3)
  fit$emulator$given["held_out"] <- list(NULL)
  expect_error(predict(fit), "none at the validation rows", class = "amiss_error_input")
  expect_equal(nrow(predict(fit, use = "calibrate")), 54)
})

test_that("designs that do not fit their parameters are refused", {
  w <- given_world()
  refused <- function(what, parameters, values = w$values) {
    expect_error(ensemble(values, w$runs, parameters), what, class = "amiss_error_input")
  }
  refused("column \"gain\" without a parameter", w$parameters["offset"])
  refused("lacks column \"slope\"", c(w$parameters, list(free("slope", uniform(0, 1)))))
  refused("\"gain\" is declared twice", c(w$parameters, w$parameters["gain"]))
  refused("made by", list(offset = uniform(10, 30), gain = uniform(0, 1)))
  refused("lies? outside the prior of \"gain\"",
          list(w$parameters$offset, free("gain", uniform(0.1, 1))))
})

test_that("bad runs are refused or left out with a word", {
  m <- linear_measurements()
  make <- function(f)
    function_simulator(f, free("offset", uniform(10, 30)), free("gain", uniform(0, 1)),
                       boundary = "Te")
  expect_error(simulate_design(make(function(v, d) 1:3), m, 20), "returned 3 values",
               class = "amiss_error_input")
  sometimes <- make(function(v, d) if (v[["offset"]] > 25) rep(NaN, nrow(d)) else v[["offset"]] +
                    v[["gain"]] * d[, "Te"])
  expect_warning(e <- simulate_design(sometimes, m, 40, seed = 1), "not finite.*left out",
                 class = "amiss_warning_input")
  expect_equal(ncol(e$outputs) + e$failed, 40)
  expect_error(simulate_design(make(function(v, d) rep(NaN, nrow(d))), m, 20),
               "40|20 runs hold values", class = "amiss_error_input")
  expect_error(simulate_design(linear_simulator(), m, runs = 3), "too few",
               class = "amiss_error_input")
  expect_error(simulate_design("a model", m), "no simulator", class = "amiss_error_input")
  wrong <- function_simulator(function(v, d) d[, 1], free("a", uniform(0, 1)),
                              boundary = "humidity")
  expect_error(simulate_design(wrong, m), "humidity.*do not have", class = "amiss_error_input")
  e <- simulate_design(linear_simulator(), m, runs = 30, seed = 3)
  expect_error(ensemble(e$values, e$outputs[, -1]), "needs its run", class = "amiss_error_input")
  expect_error(ensemble(e$values, e$outputs,
                        list(free("offset", uniform(100, 200)), free("gain", uniform(0, 1)))),
               "No run lies where the prior", class = "amiss_error_input")
})

test_that("a run that is given again counts once", {
  m <- linear_measurements()
  e <- simulate_design(linear_simulator(), m, runs = 8, seed = 3)
  twice <- c(1:8, 3, 3)
  expect_warning(again <- ensemble(e$values[twice, ], e$outputs[, twice], e$parameters),
                 "2 of 10 runs stand", class = "amiss_warning_input")
  expect_equal(again$outputs, e$outputs)
  # Another output at the same point is that of a stochastic simulator, and stays.
  expect_silent(other <- ensemble(e$values[twice, ],
                                  cbind(e$outputs, e$outputs[, 3] + 0.1, e$outputs[, 3] - 0.1),
                                  e$parameters))
  expect_equal(ncol(other$outputs), 10)
  two <- rep(1:2, 10)
  expect_error(ensemble(e$values[two, ], e$outputs[, two], e$parameters),
               "20 runs at 2 distinct points are too few", class = "amiss_error_input")
})

test_that("a simulator that is constant in time is refused, by an emulator and by a search", {
  m <- linear_measurements()
  constant <- function_simulator(function(v, d) rep(v[["a"]], nrow(d)), free("a", uniform(10, 30)),
                                 boundary = "Te")
  runs <- simulate_design(constant, m, runs = 8, seed = 1)
  expect_error(train_emulator(runs, m), "do not change over time", class = "amiss_error_input")
  expect_error(calibrate_refined(runs, m, quiet = TRUE), "do not change over time",
               class = "amiss_error_input")
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
  with_prior <- function(prior, values = r$values)
    ensemble(values, r$outputs, list(free("offset", prior), free("gain", uniform(0, 1))))
  expect_warning(part <- with_prior(uniform(10, 60)),
                 "only 38 % of the prior of offset \\(from 10.51 to 29.36\\)",
                 class = "amiss_warning_input")
  emulator <- train_emulator(part, 0.1)
  expect_false(emulator$trust$trusted)
  expect_match(emulator$trust$verdict, "only 38 % of the prior of offset")
  expect_true(train_emulator(r, 0.1)$trust$trusted)
  # An untruncated prior reaches everywhere: its mass between the runs counts, not its limits.
  expect_error(with_prior(normal(500, 2)), "offset.*next to no mass.*between 10.51 and 29.36",
               class = "amiss_error_input")
  expect_no_warning(with_prior(normal(20, 4)))
  still <- r$values
  still[, "offset"] <- 20
  expect_error(with_prior(uniform(10, 30), still), "offset.*same value, 20, in all 30 runs",
               class = "amiss_error_input")
  expect_error(ensemble(still, r$outputs), "offset.*same value", class = "amiss_error_input")
})

test_that("runs are added where the posterior lies, and the emulator is better there", {
  hour <- seq_len(72)
  data <- data.frame(hour = hour, Te = 10 + 5 * sin(2 * pi * hour / 24))
  bent <- function_simulator(
    function(values, drivers)
      20 + exp(3 * values[["a"]]) * 0.02 * drivers[, "Te"] +
      values[["b"]] * seq_len(nrow(drivers)) / 100,
    free("a", uniform(0, 2)), free("b", uniform(-1, 1)), boundary = "Te")
  data$Ti <- bent$f(c(a = 0.12, b = 0.2), as.matrix(data["Te"])) +
    withr::with_seed(1, rnorm(72, 0, 0.02))
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
  # At all distances from the centre alike: spread over the volume, of two parameters a quarter
  # would lie half as near.
  expect_equal(mean(amiss:::region_distance(region, amiss:::region_design(region, 200, 1)) < 0.5),
               0.5, tolerance = 0.02)
  expect_error(stats::predict(train_emulator(more, m), cbind(a = 1.9, b = -0.9)),
               "outside the region", class = "amiss_error_input")
  truth <- bent$f(c(a = 0.12, b = 0.2), as.matrix(data["Te"]))
  off <- function(ensemble)
    max(abs(stats::predict(train_emulator(ensemble, m), cbind(a = 0.12, b = 0.2))$mean - truth))
  expect_lt(off(more), off(first))
  # Wider where the posterior came to the end of its region, or the emulator was surer than right;
  # not where it fails and knows.
  drawn_with <- function(...) {
    fit$check <- utils::modifyList(fit$check, list(...))
    diag(refine_ensemble(first, fit, runs = 8)$region$root)
  }
  usual <- drawn_with(passed = TRUE, border = 0, z2 = 0.5)
  expect_equal(drawn_with(passed = FALSE, border = 0, z2 = 0.5), usual)
  expect_equal(drawn_with(border = 0.06, z2 = 0.5), 1.5 * usual)
  expect_equal(drawn_with(border = 0, z2 = 1.5), 1.5 * usual)
  elsewhere <- suppressWarnings(ensemble(first$values, first$outputs))
  expect_error(refine_ensemble(elsewhere, fit), "elsewhere", class = "amiss_error_input")
  expect_error(refine_ensemble(first, "fit"), "fit", class = "amiss_error_input")
  shorter <- simulate_design(bent, measurements(data[1:60, ], time = "hour", target = "Ti",
                                                boundary = ~ Te, noise_sd = 0.02),
                             runs = 12, seed = 2)
  expect_error(refine_ensemble(shorter, fit), "72 rows.*60", class = "amiss_error_input")
})

test_that("where every run fails the simulator is asked for, not the priors", {
  fails <- function_simulator(function(values, drivers) stop("no"), free("k", uniform(0, 1)),
                              boundary = "Te")
  expect_error(suppressWarnings(simulate_design(fails, linear_measurements(), runs = 20, seed = 1)),
               "Every run failed: look for a mistake in the simulator", class = "amiss_error_input")
})
