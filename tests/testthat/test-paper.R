# A linear world of 60 steps: Te enters the simulator, `extra` is added to what is measured.
paper_data_frame <- function(extra = function(data) 0, seed = 5, n = 60) {
  set.seed(seed)
  hour <- seq_len(n)
  data <- data.frame(hour = hour, Te = 10 + 5 * sin(2 * pi * hour / 24) + stats::rnorm(n),
                     Gv = stats::runif(n, 0, 300), Wd = stats::runif(n, 0, 360))
  data$Ti <- 20 + 0.4 * data$Te + extra(data) + stats::rnorm(n, 0, 0.1)
  data
}

paper_measurements <- function(data) {
  measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv + circular(Wd),
               noise_sd = 0.1, unit = "K")
}

paper_fit <- made_once(function(data = paper_data_frame(), control = list(), seed = 3,
                                threads = 2) {
  m <- paper_measurements(data)
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 20, seed = 3), m)
  calibrate_paper(emulator, m, utils::modifyList(quick_ais, control), seed = seed,
                  threads = threads)
})

sun <- function(data) 1.5 * sin(data$Gv / 100)

test_that("a planted effect is significant, first, and its share known; the parameters are found", {
  fit <- paper_fit(paper_data_frame(sun))
  expect_s3_class(fit, "amiss_paper_calibration")
  table <- fit$index
  expect_setequal(table$boundary, c("Te", "Gv", "Wd"))
  expect_identical(table$rank, 1:3)
  expect_identical(table$boundary[1], "Gv")
  expect_true(table$significant[1])
  expect_gt(table$lower95[1], 0.8)
  expect_false(any(table$significant[-1]))
  # All but the noise, outside the simulation space (constant and Te), over what is measured there.
  data <- paper_data_frame(sun)
  outside <- function(v) stats::lm.fit(cbind(1, data$Te), v)$residuals
  noise <- data$Ti - 20 - 0.4 * data$Te - sun(data)
  expect_equal(table$difference[1], 1 - sum(outside(noise)^2) / sum(outside(data$Ti)^2),
               tolerance = 0.05)
  # A discrepancy outside the simulation space does not widen (5): within four of its standard
  # deviations.
  gain <- fit$values[, "gain"]
  centre <- sum(fit$weights * gain)
  expect_lt(abs(centre - stats::lm(Ti ~ Te, data)$coefficients[["Te"]]),
            4 * sqrt(sum(fit$weights * (gain - centre)^2)))
})

test_that("the total is the product of the two evidences, a density of the record", {
  fit <- paper_fit()
  e <- fit$evidence
  expect_equal(e$log_evidence[3], sum(e$log_evidence[1:2]))
  expect_equal(e$standard_error[3], sqrt(sum(e$standard_error[1:2]^2)))
  expect_true(all(e$lower95 < e$log_evidence & e$upper95 > e$log_evidence))
  expect_equal(fit$interval, c(e$lower95[3], e$upper95[3]))
  expect_equal(fit$log_jacobian, -0.5 * sum(log(colSums(fit$emulator$basis$vectors^2))))
  expect_true(fit$trust$trusted)
  expect_error(logLik(fit), "evidence", class = "amiss_error_input")
  # Same basis vectors in another unit, coefficients to match: same evidence.
  other <- fit$emulator
  other$basis$vectors <- other$basis$vectors * 1e3
  other$processes$coefficients <- other$processes$coefficients / 1e3
  again <- calibrate_paper(other, fit$measurements, quick_ais, seed = 3, threads = 2)
  expect_equal(again$log_evidence, fit$log_evidence, tolerance = 1e-6)
})

test_that("one or two threads: same bits; the fictitious condition has its own seed", {
  a <- paper_fit()
  expect_identical(paper_fit(threads = 1)[c("values", "log_evidence", "index", "hyperparameters")],
                   a[c("values", "log_evidence", "index", "hyperparameters")])
  b <- paper_fit(control = list(fictitious_seed = 99))
  expect_identical(b$values, a$values)  # (5) does not see it
  expect_false(identical(b$hyperparameters$alpha, a$hyperparameters$alpha))
})

test_that("draws have the shape that is promised and obey their priors' limits", {
  fit <- paper_fit(control = list(shared_lambda = TRUE))
  n <- length(fit$hyperparameters$weights)
  expect_identical(dim(fit$hyperparameters$alpha), c(n, 4L))
  expect_identical(colnames(fit$hyperparameters$alpha), c("Te", "Gv", "Wd", "(fictitious)"))
  expect_true(all(fit$hyperparameters$alpha >= 0 & fit$hyperparameters$alpha <= 1))
  expect_true(all(fit$share >= 0 & fit$share <= 1))
  expect_identical(ncol(fit$lambda), 1L)
  expect_identical(ncol(paper_fit()$lambda), ncol(fit$emulator$basis$vectors))
  expect_identical(nrow(fit$values), length(fit$weights))
  # Posterior mean discrepancy: orthogonal to the simulation space.
  d <- amiss:::paper_discrepancy_(
    amiss:::paper_data(fit$emulator, fit$measurements, fit$rows, fit$control),
    fit$priors, lapply(fit$hyperparameters[c("alpha", "t2", "lambda")],
                       function(v) if (is.matrix(v)) v[1:2, ] else v[1:2]),
    amiss:::engine_context(1, 1))
  expect_identical(dim(d$mean), c(60L, 2L))
  expect_lt(max(abs(crossprod(fit$emulator$basis$vectors, d$mean))),
            1e-6 * max(abs(fit$emulator$basis$vectors)))
  expect_true(all(d$variance >= 0 & d$variance < 10))
})

test_that("a firm noise and other priors are heard", {
  loose <- paper_fit()
  firm <- paper_fit(control = list(confidence = 1))
  sd_of <- function(fit) {
    noise <- 1 / sqrt(fit$hyperparameters$lambda)
    w <- fit$hyperparameters$weights
    sqrt(sum(w * noise^2) - sum(w * noise)^2)
  }
  expect_lt(sd_of(firm), 0.8 * sd_of(loose))
  rough <- paper_fit(control = list(alpha = c(1, 1)))
  mean_alpha <- function(fit) sum(fit$hyperparameters$weights * fit$hyperparameters$alpha[, "Wd"])
  expect_lt(mean_alpha(rough), mean_alpha(loose))
})

test_that("a longer record is annealed through thinned ones, and its values are certified", {
  data <- paper_data_frame(sun, n = 160)
  fast <- paper_fit(data)
  approximation <- fast$outside$approximation
  expect_lt(approximation$largest_error, 0.1)
  expect_true(all(approximation$values > 0))
  expect_identical(names(approximation$values), c("earlier", "skeleton", "direct"))
  dense <- paper_fit(data, control = list(tolerance = 0))
  expect_identical(dense$outside$approximation$values[["skeleton"]], 0L)
  expect_lt(abs(fast$log_evidence - dense$log_evidence),
            4 * sqrt(fast$standard_error^2 + dense$standard_error^2))
  expect_identical(fast$index$boundary[1], "Gv")
  expect_error(paper_fit(data, control = list(tolerance = 2)), "tolerance",
               class = "amiss_error_input")
})

test_that("it prints, and options are checked", {
  fit <- paper_fit()
  expect_match(printed(fit), "log10 evidence.*significant")
  expect_error(calibrate_paper(fit$emulator, fit$measurements, list(chains = 3)), "unknown option",
               class = "amiss_error_input")
  expect_error(calibrate_paper(fit$emulator, fit$measurements, list(alpha = 1)), "alpha",
               class = "amiss_error_input")
  expect_error(calibrate_paper(fit$emulator, fit$measurements, list(t2 = c(1, -1))), "t2",
               class = "amiss_error_input")
  expect_error(calibrate_paper(fit$emulator, fit$measurements, list(confidence = 3)), "confidence",
               class = "amiss_error_input")
  expect_error(calibrate_paper(fit$emulator, fit$measurements, list(shared_lambda = 2)),
               "shared_lambda", class = "amiss_error_input")
  expect_error(calibrate_paper(fit$emulator, paper_measurements(paper_data_frame(n = 40))),
               "60 steps.*40", class = "amiss_error_input")
})

test_that("the unit of the basis does not matter", {
  m <- paper_measurements(paper_data_frame(sun))
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 20, seed = 3), m)
  fit <- calibrate_paper(emulator, m, quick_ais, seed = 3)
  # Rounding of the last digit, which chains and the emulator's inverse (condition 1e10) amplify, is
  # all that remains: by a power of two only that of the logarithms. Without the Jacobian
  # |K'K|^(-1/2) it would be Q log(factor), more than 13.
  for (factor in c(2^10, 2^-10, 1000)) {
    other <- calibrate_paper(rescaled(emulator, factor), m, quick_ais, seed = 3)
    tolerance <- if (factor == 1000) 1e-5 else 1e-8
    expect_equal(other$evidence$log_evidence, fit$evidence$log_evidence, tolerance = tolerance)
    expect_equal(other$values, fit$values, tolerance = tolerance)
  }
})
