# What is hard on the numerics has the right answer, or a plain statement that there is none.
# Conditions that are correlated by 0.95 and more: test-attribution.R. Fewer rows than basis
# vectors: test-calibration.R.
skip_on_cran()  # second tier: tools/test --quick

hard_fit <- function(f, ..., data = linear_data(96), noise = 0.1, runs = 30, truth, seed = 1,
                     control = quick_ais) {
  simulator <- function_simulator(f, ..., boundary = c("Te", "Gv"))
  if (!missing(truth)) {
    data$Ti <- f(truth, as.matrix(data[c("Te", "Gv")])) +
      noise * withr::with_seed(1, stats::rnorm(nrow(data)))
  }
  m <- linear_measurements(data, noise_sd = noise)
  emulator <- suppressWarnings(train_emulator(simulate_design(simulator, m, runs, seed = 1), m))
  calibrate(emulator, m, control, seed = seed)
}

share_where <- function(fit, condition) sum(fit$weights[condition(fit$values)])

test_that(paste("a simulator that steps is known on its side of the step, or its emulator is said",
                "not to be good enough"), {
  step <- function(values, drivers)
    20 + (values[["a"]] > 0.4) * drivers[, "Gv"] / 100 + values[["b"]] * drivers[, "Te"]
  fit <- hard_fit(step, free("a", uniform(0, 1)), free("b", uniform(0, 1)),
                  truth = c(a = 0.7, b = 0.5))
  expect_gt(share_where(fit, function(values) values[, "a"] > 0.4), 0.95)
  if (!fit$trust$trusted) expect_match(fit$trust$verdict, "not good enough")
})

# The effective size of the draws does not know how the mass is shared between modes that no chain
# goes between: the share scatters more than that says, so that it is judged by its own scatter over
# seeds.
test_that("a posterior of two modes has both in every sample, and each its half on average", {
  even <- function(values, drivers) 20 + (values[["a"]] - 0.5)^2 * drivers[, "Te"]
  shares <- vapply(1:6, function(seed) {
    fit <- hard_fit(even, free("a", uniform(0, 1)), truth = c(a = 0.8), seed = seed, control = NULL)
    expect_gt(share_where(fit, function(values) abs(abs(values[, "a"] - 0.5) - 0.3) < 0.05), 0.9)
    share_where(fit, function(values) values[, "a"] < 0.5)
  }, 0)
  expect_true(all(shares > 0.1 & shares < 0.9))
  expect_lt(abs(mean(shares) - 0.5), 4 * sd(shares) / sqrt(6))
  expect_lt(sd(shares), 0.2)
})

linear <- function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"]
line <- list(free("offset", uniform(10, 30)), free("gain", uniform(0, 1)))

test_that(paste("a noise of a millionth of what the runs differ by is found, or said not to be; a",
                "smaller one is refused"), {
  truth <- c(offset = 20, gain = 0.4)
  fit <- hard_fit(linear, line[[1]], line[[2]], noise = 1e-5, truth = truth)
  expect_equal(coef(fit), truth, tolerance = 1e-5)
  if (!fit$trust$trusted) expect_match(fit$trust$verdict, "not good enough")
  expect_error(hard_fit(linear, line[[1]], line[[2]], noise = 1e-9, truth = truth),
               "noise of 1e-09 is lost", class = "amiss_error_numerical")
})

test_that("pure noise has no cause", {
  data <- linear_data(96)
  data$Ti <- withr::with_seed(1, stats::rnorm(96, 20, 1))
  fit <- hard_fit(linear, line[[1]], line[[2]], data = data, noise = 1)
  expect_true(fit$trust$trusted)
  interval <- confint(fit)
  expect_lt(interval["gain", 1], 0.1)
  expect_false(any(attribute_discrepancy(fit, list(surrogates = 39), seed = 1)$table$significant))
})

test_that("twenty rows are enough for what they can tell", {
  fit <- hard_fit(linear, line[[1]], line[[2]], data = linear_data(20))
  expect_true(fit$trust$trusted)
  interval <- confint(fit)
  expect_true(all(interval[, 1] < c(20, 0.4) & interval[, 2] > c(20, 0.4)))
  expect_false(any(attribute_discrepancy(fit, list(surrogates = 19), seed = 1)$table$significant))
})

test_that("of two hundred parameters those that act are found, or nothing is claimed", {
  names <- sprintf("p%03d", 1:200)
  many <- function(values, drivers) {
    values[["p001"]] * drivers[, "Te"] + values[["p002"]] * drivers[, "Gv"] / 100 +
      0.01 * sum(values[names[-(1:2)]])
  }
  truth <- stats::setNames(rep(0.5, 200), names)
  truth[1:2] <- c(0.3, 0.8)
  fit <- do.call(hard_fit, c(list(many), lapply(names, free, uniform(0, 1)),
                             list(data = linear_data(60), truth = truth, runs = 250)))
  if (fit$trust$trusted) {
    interval <- confint(fit)
    expect_true(all(interval[1:2, 1] < truth[1:2] & interval[1:2, 2] > truth[1:2]))
  } else {
    expect_match(fit$trust$verdict, "not trusted")
  }
})
