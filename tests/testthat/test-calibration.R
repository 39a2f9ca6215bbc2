test_that("calibration finds the parameters and says so", {
  fit <- linear_fit()
  table <- tidy(fit)
  expect_true(all(table$lower95 < c(20, 0.4) & table$upper95 > c(20, 0.4)))
  expect_true(fit$trust$trusted)
  expect_equal(sd(residuals(fit)), 0.1, tolerance = 0.15)  # of 240 values: standard error 5 %
})

test_that("a record that no parameters reach inside the simulation space is told", {
  fit <- linear_fit()
  expect_gt(fit$misfit$p, 0.01)  # two vectors, two parameters: hardly any misfit is left
  expect_identical(fit$misfit$df, 2L)
  expect_no_match(printed(fit), "lacks something")
  data <- linear_data()
  data$Ti <- data$Ti + 1.6 * data$Te  # the gain is 2, beyond its prior
  beyond <- linear_fit(linear_measurements(data))
  expect_lt(beyond$misfit$p, 1e-6)
  expect_match(printed(beyond), "the model lacks something")
  expect_match(amiss:::model_doubts(list(fit = beyond, best = list(converged = TRUE))), "even the best parameters", all = FALSE)
  expect_identical(glance(beyond)$misfit_p, beyond$misfit$p)
})

test_that("same seed, one or two threads: same bits", {
  m <- linear_measurements()
  expect_identical(linear_fit(m, threads = 1)[c("values", "log_evidence")], linear_fit(m, threads = 2)[c("values", "log_evidence")])
})

test_that("validation rows are never touched by calibration", {
  data <- linear_data()
  use <- list(calibrate = data$hour <= 160, validate = data$hour > 160)
  m <- do.call(linear_measurements, c(list(data), use))
  data$Ti[use$validate] <- 1e3 * rnorm(80)
  spoilt <- do.call(linear_measurements, c(list(data), use))
  a <- linear_fit(m)
  b <- linear_fit(spoilt)
  expect_identical(b$values, a$values)
  expect_identical(b$log_evidence, a$log_evidence)
  expect_identical(attribute_discrepancy(b, list(surrogates = 19), seed = 1)$table, attribute_discrepancy(a, list(surrogates = 19), seed = 1)$table)
})

test_that("the evidence does not depend on the unit of a boundary condition", {
  data <- linear_data()
  a <- linear_fit(linear_measurements(data))
  other <- data
  other$Gv <- other$Gv / 1000
  expect_equal(linear_fit(linear_measurements(other))$log_evidence, a$log_evidence, tolerance = 1e-6)
})

test_that("the unit of the basis and the order of the conditions do not matter", {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  fit <- calibrate(emulator, m, quick_ais, seed = 3)
  # Powers of two round nothing; what other factors change in the last digit, chains amplify (test-paper.R).
  for (factor in c(2^10, 2^-10, 1000)) {
    other <- calibrate(rescaled(emulator, factor), m, quick_ais, seed = 3)
    expect_lt(abs(other$log_evidence - fit$log_evidence), if (factor == 1000) 1e-4 else 1e-8)
    expect_lt(abs(other$history$log_evidence - fit$history$log_evidence), if (factor == 1000) 1e-4 else 1e-8)
    expect_equal(other$values, fit$values, tolerance = if (factor == 1000) 1e-4 else 1e-8)
  }
  # Another order gives each condition other random numbers: the likelihood is the same (tests/cpp), the evidence within its error.
  turned <- calibrate(emulator, linear_measurements(boundary = ~ Gv + Te), quick_ais, seed = 3)
  expect_lt(abs(turned$log_evidence - fit$log_evidence), 4 * sqrt(turned$standard_error^2 + fit$standard_error^2))
})

test_that("options are checked", {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  expect_error(calibrate(emulator, m, list(chains = 3)), "unknown option", class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(ais = list(chains = 1)), seed = 1), "control\\$ais\\$chains.*Seen: 1", class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(confidence = 3)), "confidence", class = "amiss_error_input")
  expect_error(calibrate(emulator, m, threads = 0), "threads", class = "amiss_error_input")
  shorter <- linear_measurements(linear_data()[1:100, ])
  expect_error(calibrate(emulator, shorter), "240 steps.*100", class = "amiss_error_input")
})

test_that("a Bayes factor needs one record", {
  a <- linear_fit()
  b <- linear_fit(linear_measurements(linear_data(seed = 12)))
  expect_error(bayes_factor(a, b), "different records", class = "amiss_error_input")
  expect_equal(bayes_factor(a, a)$log10_bf, 0)
  expect_equal(amiss:::evidence_word(c(-1, 0.2, 0.7, 1.5, 3)), c("negative", "weak", "substantial", "strong", "decisive"))
})
