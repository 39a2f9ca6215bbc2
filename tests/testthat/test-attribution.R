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

test_that("shares and the unexplained rest add to one", {
  data <- linear_data()
  data$Ti <- data$Ti + 0.004 * data$Gv
  fit <- linear_fit(linear_measurements(data))
  inside <- amiss:::history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  outside <- function(x) stats::lm.fit(inside$basis, x)$residuals
  y <- outside(inside$y)
  rest <- y - outside(rowSums(amiss:::condition_responses(fit, inside)))
  shares <- amiss:::variance_shares(fit, inside)
  expect_equal(sum(shares) + sum(rest * y) / sum(y^2), 1)
  expect_gt(shares[2], 0.5)  # the sun carries an effect of 0.3 K beside a noise of 0.1 K
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
