# What the record says of a response beside a calibrated model, without a calibration of its own.

base_fit <- function() small_upgrade()$models[[1]]$fit

# A driver at the rows of the calibration, as the small room feels it.
felt <- function(driver, hours) {
  m <- small_upgrade()$measurements
  cbind(lagged(m$raw$drivers[, driver], hours)[base_fit()$rows])
}

of_response <- function(...) amiss:::responses_factor(base_fit(), ..., threads = 1)

test_that("the response that is hidden is distinguished from one that is not there", {
  own <- of_response(0.006 * felt("Gv", 3))
  expect_gt(own$lower95, 2)
  expect_gt(own$log10_bf, 5)
  days <- cbind(seq_along(base_fit()$rows) / 100)
  expect_lt(of_response(days)$upper95, 1)
})

test_that("a response of nothing says nothing: its factor is one", {
  own <- of_response(0 * felt("Gv", 3))
  # The same record, model and draws: what is left is rounding.
  expect_lt(abs(own$log10_bf), 1e-6)
})

test_that("the factor of a response lies near that of the mechanism, fully calibrated", {
  upgrade <- small_upgrade()
  full <- upgrade$candidates$beside_unknown[upgrade$candidates$mechanism == "sun"]
  # The prior of the sun is uniform to 0.02, of standard deviation 0.0058.
  seen <- of_response(0.0058 * felt("Gv", 3), scales = 1)$log10_bf
  # A normal prior of that size about none and the uniform one differ at the truth, 0.006, by a
  # fifth of a decade; the tangent's error and discrepancy stand for those of the mechanism.
  expect_gt(seen, 0.4 * full)
  expect_lt(seen, 1.5 * full)
})

test_that("amounts are of the scale that suits the record best", {
  sun <- 0.0058 * felt("Gv", 3)
  each <- vapply(amiss:::rules$drift_scale^(0:2), function(scale) {
    of_response(sun, scales = scale)$log10_bf
  }, 0)
  expect_equal(of_response(sun)$log10_bf, max(each), tolerance = 1e-10)
  # Far too large a response is taken in amounts of a sixteenth of it.
  expect_gt(of_response(16 * sun)$log10_bf, of_response(16 * sun, scales = 1)$log10_bf)
})
