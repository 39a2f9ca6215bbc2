# The run of least squares: what the simulation can reach, and where the discrepancy keeps out of
# the parameters.

best_fit <- made_once(function(data) {
  m <- linear_measurements(data, calibrate = data$hour <= 200, validate = data$hour > 200)
  runs <- simulate_design(linear_simulator(), m, 6, seed = 4)
  list(m = m, fit = calibrate_refined(runs, m, control = list(calibration = quick_ais), seed = 4,
                                      quiet = TRUE))
})

# A base that lacks the sun: least squares and the posterior differ.
lacking_sun <- function() {
  data <- linear_data()
  data$Ti <- data$Ti + 0.01 * data$Gv
  data
}

least_squares <- function(m) {
  rows <- m$use == "calibrate"
  stats::lm.fit(cbind(1, m$raw$drivers[rows, "Te"]), m$y[rows])
}

test_that("it is that of least squares by R", {
  made <- best_fit(lacking_sun())
  by_lm <- least_squares(made$m)
  # The search ends where half a nat is left: a relative sum of squares of 1 / N.
  expect_lt(sum(amiss:::left_at_best(made$fit)^2), sum(by_lm$residuals^2) * (1 + 1 / 200))
  expect_equal(as.numeric(made$fit$best$values), unname(by_lm$coefficients), tolerance = 0.02)
})

test_that("predictions and scores are of it, and their band has the spread of the posterior", {
  made <- best_fit(lacking_sun())
  predicted <- predict(made$fit, use = "validate", draws = 20, seed = 1)
  te <- made$m$raw$drivers[made$m$use == "validate", "Te"]
  best <- made$fit$best$values
  expect_equal(predicted$mean, unname(best[, "offset"] + best[, "gain"] * te), tolerance = 1e-8)
  expect_true(all(predicted$lower95 < predicted$mean & predicted$mean < predicted$upper95))
})

test_that(paste("the discrepancy keeps out of the slopes there, in normal quantiles, where least",
                "squares may lie"), {
  made <- best_fit(lacking_sun())
  root <- made$fit$emulator$moves$root
  te <- made$m$raw$drivers[made$m$use == "calibrate", "Te"]
  # d value / dx = (upper - lower) phi(x) of a uniform prior, in the mean square over least squares
  # by R with an error of the stated size, which lies well within the priors.
  per_x <- function(value, lower, upper)
    (upper - lower) * dnorm(qnorm((value - lower) / (upper - lower)))
  design <- cbind(1, te)
  sd <- made$m$noise_sd * sqrt(diag(solve(crossprod(design))))
  at <- least_squares(made$m)$coefficients
  mean_square <- function(k, lower, upper) {
    value <- qnorm(ppoints(1000), at[k], sd[k])
    sqrt(mean(per_x(value, lower, upper)^2))
  }
  expect_equal(root[, 1], rep(mean_square(1, 10, 30), length(te)), tolerance = 0.01,
               ignore_attr = TRUE)
  expect_equal(root[, 2], mean_square(2, 0, 1) * te, tolerance = 0.01, ignore_attr = TRUE)
})

test_that("a parameter moves as it does over all that least squares leaves open, not at one run", {
  # At 1.6 of sqrt(3), known to one standard deviation.
  space <- amiss:::coordinates_of(list(free("k", uniform(0, 1))))
  model <- list(runs = list(z = matrix(1.6), outputs = matrix(1:4)), target = 1:4,
                noise = rep(1, 4), space = space)
  unit <- amiss:::normal_units(model, list(at = 1, slopes = matrix(0.5, 4)))
  z <- seq(-sqrt(3), sqrt(3), length.out = 2001)[-c(1, 2001)]
  weight <- dnorm(z, 1.6, 1)
  exact <- sqrt(sum(weight * amiss:::per_normal(z, space[rep(1, 1999), ])^2) / sum(weight))
  # Of 400 independent draws: three standard errors of the root of a mean square, each of about 2 %.
  expect_equal(unit, exact, tolerance = 0.06)
  expect_gt(unit, 2 * amiss:::per_normal(1.6, space))
})

test_that(
  "a parameter pressed against the end of a flat prior moves nothing; the middle moves most", {
  ends <- amiss:::flat_limit * c(-1, 1)
  flat <- amiss:::coordinates_of(list(free("a", uniform(0, 1)), free("b", uniform(0, 1))))
  mixed <- amiss:::coordinates_of(list(free("a", uniform(0, 1)), free("b", normal(0, 1))))
  expect_equal(amiss:::per_normal(ends, flat), c(0, 0))
  expect_equal(amiss:::per_normal(c(0, 2), mixed), c(2 * sqrt(3) * dnorm(0), 1))
  # Rounded past its end it is at it.
  expect_silent(past <- amiss:::per_normal(ends * (1 + 1e-12), flat))
  expect_equal(past, c(0, 0))
})

test_that("a way counts as far as the simulator moves along it", {
  slopes <- cbind(c(3, 4), c(0, 1), c(0, 0))
  expect_equal(amiss:::way_scale(list(slopes = slopes)), c(1, rules$least_scale, rules$least_scale))
  expect_equal(amiss:::way_scale(list(slopes = 0 * slopes)), c(1, 1, 1))
})
