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
  found <- amiss:::search_mode(amiss:::searched_records(list(set), 1), numeric(3))
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
  found <- amiss:::search_mode(amiss:::searched_records(list(set), 1), 0)
  expect_length(found$centre, 1)
  expect_lt(abs(10^amiss:::unit_to_values(matrix(pnorm(found$centre)), emulator$parameters)[1, 1] - 10^-0.3), 0.02)
  set$emulator$simulator$f <- function(values, drivers) NaN * drivers[, 1]
  expect_error(amiss:::search_mode(amiss:::searched_records(list(set), 1), 0), "failed where a search begins",
               class = "amiss_error_numerical")
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

test_that("searches start at the present model, at two near runs that stand apart and in the middle of the priors", {
  simulator <- do.call(wide_simulator, wide_parameters)
  m <- wide_record(simulator, c(rate = -1.2, gain = -0.3, offset = 0.5))
  runs <- simulate_design(simulator, m, 12, seed = 1)
  set <- amiss:::calibration_setting(train_emulator(runs, m), m, quick_ais, 1)
  starts <- amiss:::starts_over_priors(list(runs), list(set), c(gain = 0.7, rate = -1, unknown = 3))
  expect_length(starts, 4)
  expect_identical(starts[[1]], c(rate = -1, gain = 0.7, offset = 0))
  expect_identical(starts[[4]], c(rate = 0, gain = 0, offset = 0))
  z <- qnorm(runs$unit)
  misfit <- colMeans((runs$outputs - m$y[set$rows])^2)
  apart <- sqrt(colSums((t(z) - z[which.min(misfit), ])^2))
  far <- which(apart >= median(apart))
  expect_equal(unname(starts[[2]]), z[which.min(misfit), ])
  expect_equal(unname(starts[[3]]), z[far[which.min(misfit[far])], ])
  expect_length(amiss:::starts_over_priors(list(runs), list(set)), 3)
  # Of two records the run nearest to each.
  other <- set
  other$measurements$y <- runs$outputs[, 5][match(seq_along(m$y), set$rows)]
  both <- amiss:::starts_over_priors(list(runs, runs), list(set, other))
  expect_equal(lapply(both, unname), list(z[which.min(misfit), ], z[5, ], numeric(3)))
})

test_that("a mechanism is searched from the model that it extends", {
  simulator <- do.call(wide_simulator, wide_parameters[1:2])
  m <- wide_record(do.call(wide_simulator, wide_parameters), c(rate = -1.2, gain = -0.3, offset = 0.5))
  offset <- mechanism("offset", boundary = "Te", sentence = "There is an offset.", edit = function(model) {
    do.call(wide_simulator, c(unname(model$parameters), list(free("offset", uniform(0, 4), "K"))))
  })
  seen <- list()
  starts <- amiss:::starts_over_priors
  stand_in(starts_over_priors = function(ensembles, sets, present = NULL) {
    seen[[length(seen) + 1]] <<- list(parameters = names(ensembles[[1]]$parameters), present = present)
    starts(ensembles, sets, present)
  })
  coarse <- list(max_steps = 1, calibration = quick_ais, attribution = list(surrogates = 3))
  upgrade <- upgrade_model(simulator, m, catalogue(offset), runs = 30, control = coarse, seed = 1, quiet = TRUE)
  of_base <- Filter(function(s) !"offset" %in% s$parameters, seen)
  of_trial <- Filter(function(s) "offset" %in% s$parameters, seen)
  expect_null(of_base[[1]]$present)
  expect_equal(of_trial[[1]]$present, amiss:::joint_centre(list(upgrade$models[[1]]$fit)))
})

# A ridge along v = 2 u^2, four hundred times as steep across as along.
curved_set <- function() {
  simulator <- function_simulator(function(values, drivers) {
    20 + 5 * (values[["v"]] - 2 * values[["u"]]^2) * drivers[, "Te"] + 0.5 * values[["u"]] * cos(seq_len(nrow(drivers)))
  }, free("u", normal(0, 1, -4, 4)), free("v", normal(0, 3, -12, 12)), boundary = "Te")
  m <- wide_record(simulator, c(u = 1.2, v = 2.88))
  amiss:::calibration_setting(train_emulator(simulate_design(simulator, m, 12, seed = 1), m), m, quick_ais, 1)
}

test_that("a curved ridge is leapt along", {
  records <- amiss:::searched_records(list(curved_set()), 1)
  found <- amiss:::search_mode(records, c(-1, 0.6))
  expect_true(all(abs(found$centre - c(1.2, 0.96)) < 4 * sqrt(diag(found$covariance))))
  expect_false(found$given_up)
  stand_in(search_leaps = 0)
  stalled <- amiss:::search_mode(records, c(-1, 0.6))
  expect_lt(stalled$value, found$value - 1000)
})

test_that("of searches that lead to the same mode one is carried through, and values are of the same draws", {
  set <- curved_set()
  found <- amiss:::search_modes(list(set), list(c(-1, 0.6), c(-1.5, 1), c(0, 0)), 1)
  expect_length(found$modes, 1)
  alone <- amiss:::search_modes(list(set), list(c(-1, 0.6)), 1)
  expect_identical(found$modes, alone$modes)
  expect_gt(found$runs, alone$runs)
  records <- amiss:::searched_records(list(set), 1)
  apart <- amiss:::search_mode(records, c(1.2, 0.96))
  both <- amiss:::with_common_values(list(alone$modes[[1]], apart), records)
  expect_lt(abs(both[[1]]$value - both[[2]]$value), 1)
  # The mean of what each set of draws says of a mode; those of a larger error say something else.
  vague <- apart
  vague$tangents[[1]]$variance <- 4 * apart$tangents[[1]]$variance
  each <- vapply(list(apart, vague), function(mode) amiss:::log_likelihoods(records, apart$outputs, mode$tangents), 0)
  expect_gt(abs(diff(each)), 1)
  common <- amiss:::with_common_values(list(apart, vague), records)[[1]]
  expect_equal(common$value, log(mean(exp(each - max(each)))) + max(each) - 0.5 * sum(apart$centre^2))
  expect_identical(amiss:::with_common_values(list(), records), list())
})

test_that("a search that would not come near the best mode at its pace is given up, after some steps", {
  records <- amiss:::searched_records(list(curved_set()), 1)
  far_better <- list(list(centre = c(50, 50), covariance = diag(2), value = 1e9))
  patient <- amiss:::search_mode(records, c(-2, 0))
  expect_false(patient$given_up)
  given_up <- amiss:::search_mode(records, c(-2, 0), far_better)
  expect_true(given_up$given_up)
  expect_lt(given_up$runs, patient$runs)
  expect_gte(given_up$runs, 4 * (2 + 6))  # four steps, each of two slopes and six points
})

test_that("where all starts fail there is no mode, and a search keeps what it found before the numbers failed", {
  set <- curved_set()
  records <- amiss:::searched_records(list(set), 1)
  calls <- 0
  tangent_at <- records[[1]]$tangent_at
  records[[1]]$tangent_at <- function(...) {
    calls <<- calls + 1
    if (calls > 2) amiss:::abort_numerical("No draw is possible here.")
    tangent_at(...)
  }
  found <- amiss:::search_mode(records, c(-1, 0.6))
  expect_true(is.finite(found$value))
  expect_error(amiss:::search_mode(records, c(-1, 0.6)), "No draw is possible", class = "amiss_error_numerical")
  set$emulator$simulator$f <- function(values, drivers) NaN * drivers[, 1]
  expect_length(amiss:::search_modes(list(set), list(c(0, 0), c(1, 1)), 1)$modes, 0)
})
