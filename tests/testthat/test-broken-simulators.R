# Simulators that fail, jump, or leave nothing to explain.

quick_loop <- list(max_steps = 1, calibration = quick_ais, attribution = list(surrogates = 19))

sunny_data <- function(n = 90) {
  data <- linear_data(n)
  data$Ti <- data$Ti + 0.02 * data$Gv
  linear_measurements(data, validate = data$hour > 66)
}

sun_by <- function(f, prior = uniform(0, 0.1)) {
  mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
    with_parameters(model, free("sun_gain", prior), boundary = "Gv", f = f)
  })
}

adding_sun <- function(values, drivers, base) base(values) + values[["sun_gain"]] * drivers[, "Gv"]

loop_with <- function(entry, simulator = linear_simulator(), m = sunny_data()) {
  upgrade_model(simulator, m, catalogue(entry), control = quick_loop, seed = 1, quiet = TRUE)
}

test_that("the loop ends where a simulator fails at all draws of a trial's posterior", {
  skip_on_cran()  # second tier: tools/test --quick
  failing <- sun_by(function(values, drivers, base) {
    if (values[["sun_gain"]] < 0.05) rep(NaN, nrow(drivers)) else adding_sun(values, drivers, base)
  })
  upgrade <- loop_with(failing)
  expect_length(upgrade$models, 1)
  expect_false(upgrade$candidates$trusted)
  expect_identical(upgrade$candidates$judged_by, "trial")
})

test_that("a model that reproduces its record has nothing to attribute", {
  data <- linear_data(90)
  data$Ti <- 20 + 0.4 * data$Te
  upgrade <- upgrade_model(linear_simulator(), linear_measurements(data, validate = data$hour > 66),
                           catalogue(), control = quick_loop, seed = 1, quiet = TRUE)
  expect_false(any(upgrade$models[[1]]$attribution$table$significant))
  expect_identical(summary(upgrade)$verdict, "nothing")
})

test_that("why runs fail is told, of the base model and of a mechanism", {
  stopping <- function_simulator(function(values, drivers) stop("no licence"),
                                 free("gain", uniform(0, 1)), boundary = "Te")
  expect_error(loop_with(sun_by(adding_sun), stopping), "runs over the priors failed.*no licence",
               class = "amiss_error_input")
  typo <- sun_by(function(values, drivers, base) stop("a typo in it"))
  expect_warning(upgrade <- loop_with(typo), "could not be tried.*a typo in it",
                 class = "amiss_warning_trial")
  expect_identical(upgrade$stopped_id, "none_computed")
})

test_that("nothing is said to be right where no mechanism could be tried", {
  typo <- sun_by(function(values, drivers, base) stop("a typo in it"))
  upgrade <- suppressWarnings(loop_with(typo, m = linear_measurements(linear_data(90))))
  expect_match(summary(upgrade)$tag, "No mechanism could be tried")
})

test_that("a catalogue that cannot be applied costs no run", {
  made <- new.env()
  made$runs <- 0
  counting <- function_simulator(function(values, drivers) {
    made$runs <- made$runs + 1
    20 + values[["gain"]] * drivers[, "Te"]
  }, free("gain", uniform(0, 1)), boundary = "Te")
  rain <- mechanism("rain {here}", boundary = character(), sentence = "Rain.",
                    edit = function(model) {
    with_parameters(model, free("r", uniform(0, 1)), boundary = "rain", f = adding_sun)
  })
  expect_error(loop_with(rain, counting),
               "with mechanism \"rain \\{here\\}\" needs column \"rain\"",
               class = "amiss_error_input")
  expect_error(loop_with(mechanism("wrong", function(model) stop("no such wall"), "Gv", "Wrong."),
                         counting), "no such wall", class = "amiss_error_edit")
  expect_identical(made$runs, 0)
})

test_that("outputs beyond all numbers count as failed runs", {
  huge <- sun_by(function(values, drivers, base)
    base(values) + 1e160 * values[["sun_gain"]] * drivers[, "Gv"])
  upgrade <- suppressWarnings(loop_with(huge))
  expect_length(upgrade$models, 1)
})

test_that("a jump between two runs that lie close is no slope", {
  jumping <- function_simulator(function(values, drivers) {
    values[["offset"]] + values[["gain"]] * drivers[, "Te"] + 5 * (values[["offset"]] > 20.005)
  }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te")
  m <- linear_measurements()
  model <- run_model(jumping, m, rbind(c(0, 0), c(0.002, 0), c(1, 0), c(0, 1)))
  known <- cbind(offset = rep(20, 240), gain = m$raw$drivers[, "Te"]) / (2 * sqrt(3))
  reference <- list(z = model$runs$z[1, ] + 0.1, slopes = known, stale = 0.3)
  # 5 K over 0.002 standard deviations are 2500 K for one.
  expect_lt(max(abs(amiss:::secant_slopes(model, 1, reference))), 20)
})

test_that("a random function is run with the same random numbers each time", {
  noisy <- function_simulator(function(values, drivers) {
    20 + values[["gain"]] * drivers[, "Te"] + stats::rnorm(nrow(drivers), 0, 0.05)
  }, free("gain", uniform(0, 1)), boundary = "Te")
  m <- linear_measurements(linear_data(90))
  calibrated <- function() {
    calibrate_refined(simulate_design(noisy, m, runs = 5, seed = 1), m, seed = 1, quiet = TRUE)
  }
  set.seed(3)
  first <- calibrated()
  drawn <- stats::runif(1)
  set.seed(4)
  second <- calibrated()
  expect_identical(second$log_evidence, first$log_evidence)
  expect_true(first$trust$trusted)
  # R's own generator stays as it was.
  set.seed(3)
  expect_identical(stats::runif(1), drawn)
})

test_that("a simulator whose randomness is its own is refused, and it is said why", {
  calls <- 0
  restless <- function_simulator(function(values, drivers) {
    calls <<- calls + 1
    20 + values[["gain"]] * drivers[, "Te"] + sin(calls * seq_len(nrow(drivers))^2)
  }, free("gain", uniform(0, 1)), boundary = "Te")
  expect_error(loop_with(sun_by(adding_sun), restless), class = "amiss_error_input",
               "The simulator is random: two runs at the same values differ by [0-9.]+ times")
  expect_lt(calls, 10)
  m <- linear_measurements(linear_data(90))
  expect_error(calibrate_refined(simulate_design(restless, m, runs = 5, seed = 1), m, seed = 1),
               class = "amiss_error_input", "check that the simulator at hand is the one")
})
