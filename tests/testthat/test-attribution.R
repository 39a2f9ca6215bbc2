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

test_that("shares and the rest add to one", {
  fit <- linear_fit()
  expect_lt(sum(amiss:::variance_shares(fit, amiss:::history_data(fit$emulator, fit$measurements, fit$rows, fit$control))), 1)
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
