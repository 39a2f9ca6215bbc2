# The calibration of the linear world, made once for this file.
plain <- new.env()

plain_fit <- function() {
  if (is.null(plain$fit)) plain$fit <- linear_fit()
  plain$fit
}

test_that("calibration finds the parameters and says so", {
  fit <- plain_fit()
  table <- tidy(fit)
  expect_equal(table$term, c("offset", "gain"))
  expect_true(all(table$conf.low < c(20, 0.4) & table$conf.high > c(20, 0.4)))
  expect_true(fit$trust$trusted)
  expect_equal(sd(residuals(fit)), 0.1, tolerance = 0.15)  # of 240 values: standard error 5 %
})

# Of each fit, in decades.
decades <- function(fits, of) vapply(fits, of, 0) / log(10)

test_that("the evidence does not depend on the number of basis vectors", {
  m <- bent_measurements()
  runs <- simulate_design(bent_simulator(), m, runs = 40, seed = 2)
  fits <- lapply(c(3, 4, 6, 8), function(q) {
    calibrate(train_emulator(runs, m, list(max_vectors = q, explained = 1, noise_fraction = 1e-6)),
              m, quick_ais, seed = 1)
  })
  # Three vectors leave out a sixth of the noise, four next to nothing. What is left is the
  # sampler's error, 0.02 decades; 0.3 is a third of what changes a word. A split of the record at
  # these vectors moved it by decades.
  expect_lt(diff(range(decades(fits, function(f) f$log_evidence))), 0.3)
  expect_lt(diff(range(decades(fits, function(f) f$posterior$log_evidence))), 0.3)
  expect_lt(max(decades(fits, function(f) f$standard_error)), 0.05)
})

# A linear simulator has two vectors; what the others hold is rounding.
test_that("basis vectors of rounding leave the evidence as it is", {
  linear <- simulate_design(linear_simulator(), linear_measurements(), runs = 30, seed = 3)
  fits <- lapply(c(2, 8), function(q) {
    emulator <- train_emulator(linear, linear_measurements(),
                               list(max_vectors = q, explained = 1, noise_fraction = 1e-9))
    calibrate(emulator, linear_measurements(), quick_ais, seed = 3)
  })
  expect_lt(diff(range(decades(fits, function(f) f$log_evidence))), 0.3)
})

test_that("the reach is a distribution over the numbers given", {
  fit <- plain_fit()
  expect_named(fit$reach, c("13", "300", "Inf"))
  expect_equal(sum(fit$reach), 1)
  # Nothing lacks, so that nothing is said of where it is.
  expect_true(all(abs(fit$reach - 1 / 3) < 0.1))
  expect_match(printed(fit), "stays open")
})

test_that("a single reach is taken and said", {
  at_reach <- function(reach) {
    calibrate(plain_fit()$emulator, plain_fit()$measurements, c(quick_ais, list(reach = reach)),
              seed = 3)
  }
  free <- at_reach(Inf)
  expect_equal(free$reach, c("Inf" = 1))
  expect_match(printed(free), "the discrepancy is free")
  expect_match(printed(at_reach(13)), "keeps out of what the parameters do (reach 13)",
               fixed = TRUE)
})

test_that("a model that is wrong where its parameters could hide it has a free discrepancy", {
  data <- linear_data()
  data$Ti <- data$Ti + 1.6 * data$Te  # the gain is 2, beyond its prior of 0 to 1
  fit <- linear_fit(linear_measurements(data))
  expect_gt(fit$reach[["Inf"]], 0.95)
  expect_match(printed(fit),
               "reaches into what the parameters can do .probability (0.9[5-9]|1.00).")
})

test_that("the reach has the probabilities that separate calibrations give it", {
  data <- linear_data()
  data$Tn <- withr::with_seed(6, as.numeric(stats::filter(rnorm(240), 0.9, "recursive")))
  data$Ti <- data$Ti + 0.3 * lagged(data$Tn, 3) + 0.3 * data$Te
  m <- linear_measurements(data, boundary = c("Te", "Gv", "Tn"))
  fit <- linear_fit(m)
  alone <- lapply(fit$control$reach,
                  function(reach)
                    calibrate(fit$emulator, m, c(quick_ais, list(reach = reach)), seed = 3))
  of_each <- vapply(alone, `[[`, 0, "log_evidence")
  se <- vapply(alone, `[[`, 0, "standard_error")
  expected <- exp(of_each - max(of_each)) / sum(exp(of_each - max(of_each)))
  # Four standard errors of the evidences, and of shares of the effective draws.
  error <- sqrt(expected * (1 - expected) / fit$posterior$ess +
                (2 * expected * (1 - expected) * max(se))^2)
  expect_length(expected, 3)
  expect_true(all(abs(fit$reach - expected) < 4 * error + 1e-3))
})

test_that("what the reach says is put into words", {
  fit <- plain_fit()
  fit$reach[] <- c(0.9, 0.08, 0.02)
  expect_match(printed(fit), "keeps out of what the parameters can do .probability 0.98.")
})

test_that("same seed, one or two threads: same bits", {
  m <- linear_measurements()
  expect_identical(linear_fit(m, threads = 1)[c("values", "log_evidence")],
                   linear_fit(m, threads = 2)[c("values", "log_evidence")])
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
  expect_identical(attribute_discrepancy(b, list(surrogates = 19), seed = 1)$table,
                   attribute_discrepancy(a, list(surrogates = 19), seed = 1)$table)
})

test_that("the evidence does not depend on the unit of a boundary condition", {
  data <- linear_data()
  data$Gv <- data$Gv / 1000
  expect_equal(linear_fit(linear_measurements(data))$log_evidence, plain_fit()$log_evidence,
               tolerance = 1e-6)
})

test_that("the unit of the basis does not matter", {
  fit <- plain_fit()
  # Powers of two round nothing. Other factors change the last digit, by which a chain may take
  # another way: what is found then differs as between two seeds, whose standard deviation is 0.07
  # (seeds 3 to 9), and the reach's 0.04.
  for (factor in c(2^10, 2^-10, 1000)) {
    other <- calibrate(rescaled(fit$emulator, factor), fit$measurements, quick_ais, seed = 3)
    exact <- factor != 1000
    expect_lt(abs(other$log_evidence - fit$log_evidence), if (exact) 1e-8 else 0.21)
    expect_lt(abs(other$posterior$log_evidence - fit$posterior$log_evidence),
              if (exact) 1e-8 else 0.21)
    expect_lt(max(abs(other$reach - fit$reach)), if (exact) 1e-8 else 0.12)
    expect_equal(coef(other), coef(fit), tolerance = if (exact) 1e-8 else 1e-3)
  }
})

# Another order gives each condition other random numbers: the likelihood is the same (tests/cpp),
# the evidence within its error.
test_that("the order of the conditions does not matter", {
  fit <- plain_fit()
  turned <- calibrate(fit$emulator, linear_measurements(boundary = ~ Gv + Te), quick_ais, seed = 3)
  expect_lt(abs(turned$log_evidence - fit$log_evidence),
            4 * sqrt(turned$standard_error^2 + fit$standard_error^2))
})

test_that("options are checked", {
  m <- plain_fit()$measurements
  emulator <- plain_fit()$emulator
  expect_error(calibrate(emulator, m, list(chains = 3)), "unknown option",
               class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(ais = list(chains = 1)), seed = 1),
               "control\\$ais\\$chains` is 1; it must be 4 or more", class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(confidence = 3)), "confidence",
               class = "amiss_error_input")
  expect_error(calibrate(emulator, m, threads = 0), "threads", class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(reach = c(0, Inf))), "reach",
               class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(reach = c(13, 13))), "reach",
               class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(check = -1)), "control\\$check",
               class = "amiss_error_input")
  expect_error(calibrate(emulator, m, list(exact = 0.5)), "control\\$exact",
               class = "amiss_error_input")
})

test_that("an emulator of another record is refused", {
  shorter <- linear_measurements(linear_data()[1:100, ])
  expect_error(calibrate(plain_fit()$emulator, shorter), "240 steps.*100",
               class = "amiss_error_input")
})

test_that("a record with no more rows than the basis has vectors is refused", {
  data <- linear_data(20)
  m <- linear_measurements(data)
  runs <- simulate_design(linear_simulator(), m, runs = 40, seed = 3)
  noisy <- ensemble(runs$values, runs$outputs + withr::with_seed(1, matrix(rnorm(800), 20)),
                    runs$parameters)
  emulator <- suppressWarnings(train_emulator(noisy, m, list(explained = 1, noise_fraction = 1e-9)))
  expect_identical(ncol(emulator$basis$vectors), 19L)  # never as many as rows
  emulator$basis$vectors <- cbind(emulator$basis$vectors, cos(1:20), sin(1:20))
  emulator$spread <- rbind(emulator$spread, 0, 0)
  emulator$processes$coefficients <- cbind(emulator$processes$coefficients, 0, 0)
  emulator$processes$hyperparameters <-
    emulator$processes$hyperparameters[c(1:19, 19, 19), , drop = FALSE]
  emulator$basis$discarded_sd[] <- 0
  expect_error(calibrate(emulator, m, quick_ais, seed = 1),
               "20 rows, no more than the 21 basis vectors", class = "amiss_error_input")
})

test_that("a Bayes factor needs one record", {
  a <- plain_fit()
  b <- linear_fit(linear_measurements(linear_data(seed = 12)))
  expect_error(bayes_factor(a, b), "different records", class = "amiss_error_input")
  expect_equal(bayes_factor(a, a)$log10_bf, 0)
})

test_that("evidence is put into words by the interval that it lies in", {
  expect_equal(amiss:::evidence_word(c(-1, 0.2, 0.7, 1.5, 3), rep(8, 5)),
               c("undecided", "weak", "substantial", "strong", "decisive"))
  expect_equal(amiss:::evidence_word(-3, -1), "negative")
})
