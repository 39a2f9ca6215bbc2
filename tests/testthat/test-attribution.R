test_that("a planted effect is found in the right condition, and none where there is none", {
  data <- linear_data()
  lagged <- as.numeric(stats::filter(data$Gv / 300, 0.8, "recursive")) * 0.2
  data$Ti <- data$Ti + lagged
  found <- attribute_discrepancy(linear_fit(linear_measurements(data)), list(surrogates = 99), seed = 1)
  expect_equal(found$table$boundary[1], "Gv")
  expect_true(found$table$significant[1])
  expect_gt(found$table$log10_bf_dropped[1], 2)
  none <- attribute_discrepancy(linear_fit(), list(surrogates = 99), seed = 1)
  expect_false(any(none$table$significant))
})

test_that("shares are plain shares of the variance where conditions do not overlap, and add up", {
  data <- linear_data()
  data$Ti <- data$Ti + 0.004 * data$Gv
  fit <- linear_fit(linear_measurements(data))
  inside <- amiss:::history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  shares <- amiss:::variance_shares(fit, inside, seed = 1, threads = 1)
  # White error as the posterior's draws have it: all but the noise, over what is measured outside the simulation space.
  outside <- function(v) stats::lm.fit(inside$basis, v)$residuals
  noise <- data$Ti - 20 - 0.4 * data$Te - 0.004 * data$Gv
  explained <- 1 - sum(outside(noise)^2) / sum(outside(data$Ti)^2)
  expect_equal(sum(shares), explained, tolerance = 0.05)
  expect_gt(shares[2], 0.95 * sum(shares))
  expect_true(all(shares >= 0))
})

test_that("two threads give the bits of one", {
  fit <- linear_fit()
  expect_identical(attribute_discrepancy(fit, list(surrogates = 19), seed = 1, threads = 2)$table,
                   attribute_discrepancy(fit, list(surrogates = 19), seed = 1, threads = 1)$table)
})

test_that("one boundary condition is enough", {
  fit <- linear_fit(linear_measurements(boundary = ~Te))
  expect_equal(attribute_discrepancy(fit, list(surrogates = 19), seed = 1)$table$boundary, "Te")
  expect_error(attribute_discrepancy(fit, list(level = 5)), "level", class = "amiss_error_input")
})

test_that("evidence lost by the posterior's own draws is that of sampling again without the condition", {
  data <- linear_data()
  data$Ti <- data$Ti + 0.00037 * data$Gv  # too weak to be certain: a part of the draws leaves it out
  fit <- linear_fit(linear_measurements(data))
  own <- amiss:::evidence_lost(fit)
  expect_true(all(own$standard_error < 0.2))
  inside <- amiss:::history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  control <- list(surrogates = 1, smallest_shift = 0.05, ais = fit$control$ais)
  again <- amiss:::attribute_(inside, fit$priors, 0:1, fit$null_setting, control, list(seed = 9, threads = 1))
  difference <- own$value - (fit$history$log_evidence - again$log_evidence_dropped)
  # Four standard errors of both.
  expect_true(all(abs(difference) < 4 * sqrt(own$standard_error^2 + fit$history$standard_error^2 + again$standard_error^2)))
  expect_gt(diff(range(own$value)), 0.2)  # the two conditions do differ
})
