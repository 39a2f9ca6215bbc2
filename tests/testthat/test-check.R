# A simulator that counts its runs and does as `misbehave(count, series)` says from the run `after`
# on.
counting <- function(misbehave, after) {
  count <- 0
  function_simulator(function(values, drivers) {
    count <<- count + 1
    series <- values[["offset"]] + values[["gain"]] * drivers[, "Te"]
    if (count > after) misbehave(count - after, series) else series
  }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te",
     name = "counting")
}

# Runs misbehave at posterior draws alone: the design has 30.
checked <- function(misbehave) {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(counting(misbehave, 30), m, runs = 30, seed = 3), m)
  calibrate(emulator, m, quick_ais, seed = 3)
}

test_that("a good emulator passes the check by runs", {
  fit <- linear_fit()
  expect_true(fit$check$passed)
  expect_lt(fit$check$ratio, 0.01)  # two vectors hold a linear simulator exactly
  expect_true(fit$trust$trusted)
  expect_match(fit$check$verdict,
               sprintf("by %d runs of the simulator at posterior draws", fit$check$runs),
               fixed = TRUE)
  expect_identical(glance(fit)$emulator_error, fit$check$ratio)
  expect_equal(fitted(fit), fit$check$mean)
})

test_that("the error of the check is that of runs at the record's rows", {
  fit <- linear_fit()
  made <- amiss:::posterior_runs(fit, amiss:::even_draws(fit, 40), 1)
  own <- function(i) {
    run <- fit$values[made$draws[i], "offset"] +
      fit$values[made$draws[i], "gain"] * linear_data()$Te
    run - stats::predict(fit$emulator, fit$values[made$draws[i], , drop = FALSE])$mean[, 1]
  }
  # Both are differences of numbers near 25: rounding, of 1e-4.
  expect_equal(fit$check$error, sqrt(mean(vapply(seq_along(made$draws), own, numeric(240))^2)),
               tolerance = 1e-6)
  expect_equal(fit$check$ratio, fit$check$error / fit$check$noise)
  # White error of 0.1, as stated: the noise that it is measured by lies within what 240 values tell
  # of it.
  white <- calibrate(fit$emulator, fit$measurements, c(quick_ais, list(error_times = numeric())),
                     seed = 3)
  expect_lt(abs(white$check$noise - 0.1), 0.1 * 4 / sqrt(2 * 240))
})

test_that("a smooth error counts less where the measurement error is smooth", {
  fit <- linear_fit()
  smooth <- matrix(0.05 * sin(2 * pi * seq_len(240) / 120))
  rough <- matrix(0.05 * rep(c(-1, 1), 120) / sqrt(2))  # as large
  ratio <- function(digit, error) {
    fit$posterior$setting[] <- digit
    fit$posterior$variance[] <- 0.01
    amiss:::error_over_noise(fit, error)
  }
  white <- ratio(0L, smooth)
  expect_equal(white, sqrt(mean(smooth^2)) / 0.1, tolerance = 1e-8)
  expect_equal(ratio(0L, rough), sqrt(mean(rough^2)) / 0.1, tolerance = 1e-8)
  # Setting 5: an Ornstein-Uhlenbeck part of 30 times the white variance over two steps. Its
  # spectrum over its variance is 4.1 for slow errors and 0.25 for those that alternate; both count
  # over the larger noise seen, by the root of 31.
  expect_equal(ratio(5L, smooth) / white, sqrt(31 / (1 + 30 * 4.1)), tolerance = 0.1)
  expect_equal(ratio(5L, rough) / white, sqrt(31 / (1 + 30 * 0.25)), tolerance = 0.1)
})

test_that("spoiled coefficients fail the check, and the calibration says why it is not trusted", {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  # 2 % of 24 K beside a noise of 0.1 K
  emulator$processes$coefficients <- 1.02 * emulator$processes$coefficients
  fit <- calibrate(emulator, m, quick_ais, seed = 3)
  expect_false(fit$check$passed)
  expect_gt(fit$check$ratio, 1)
  expect_false(fit$trust$trusted)
  expect_match(fit$trust$verdict,
               paste("not trusted: by .* runs .* times the noise, more than a third: it is not",
                     "good enough"))
  expect_false(glance(fit)$trusted)
  expect_match(printed(fit), "not good enough")
})

# The error is a tenth of the noise in every row. As it has the signs of what the simulation leaves,
# the likelihoods of 240 rows differ by 0.1 x 240 E|e| = 19 nats together, or by 1 less or more.
test_that("a small error that changes the likelihood by many nats fails the check", {
  data <- linear_data()
  best <- stats::fitted(stats::lm(Ti ~ Te, data))
  for (towards in c(-1, 1)) {
    fit <- checked(function(k, y) y + towards * 0.01 * sign(data$Ti - best))
    expect_lt(fit$check$ratio, 1 / 3)
    expect_equal(towards * fit$check$correction, 19, tolerance = 0.3)
    expect_false(fit$check$passed)
    expect_match(fit$trust$verdict, paste("nats", if (towards > 0) "more" else "less", "likely"))
  }
})

test_that("too few runs fail the check", {
  m <- bent_measurements()
  fit <- calibrate(train_emulator(simulate_design(bent_simulator(), m, runs = 6, seed = 1), m), m,
                   quick_ais, seed = 1)
  expect_gt(fit$check$ratio, 1)
  expect_false(fit$trust$trusted)
})

test_that("the check can be left out", {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  fit <- calibrate(emulator, m, c(quick_ais, list(check = 0)), seed = 3)
  expect_null(fit$check)
  expect_true(fit$trust$trusted)
  expect_identical(fit$log_evidence, fit$posterior$log_evidence)
  expect_no_match(printed(fit), "of the noise")
})

test_that("runs that fail at posterior draws are left out and told", {
  for (failing in list(function(k, y) if (k %% 10 == 0) NaN * y else y,
                       function(k, y) if (k %% 10 == 0) stop("no steady state") else y,
                       function(k, y) if (k %% 10 == 0) replace(y, 7, Inf) else y)) {
    expect_no_warning(fit <- checked(failing))
    # A draw of more weight than one of 40 is run once.
    expect_equal(fit$check$failed, (fit$check$runs + fit$check$failed) %/% 10)
    expect_gte(fit$check$failed, 3)
    expect_match(fit$check$verdict, sprintf("(%d more failed)", fit$check$failed), fixed = TRUE)
    expect_true(fit$trust$trusted)
  }
})

test_that("a calibration is kept but not trusted if many runs at posterior draws fail", {
  fit <- checked(function(k, y) if (k %% 3 == 0) NaN * y else y)
  expect_false(fit$trust$trusted)
  expect_match(fit$trust$verdict,
               paste("failed at 1[23] of [34][0-9] posterior draws, the first at offset =",
                     "[0-9.]+, gain = [0-9.]+"))
  # A third of the posterior is impossible.
  expect_equal(fit$check$correction, log(2 / 3), tolerance = 0.1)
  none <- checked(function(k, y) stop("no steady state"))
  expect_false(none$trust$trusted)
  expect_match(none$trust$verdict, "failed at all of [34][0-9] posterior draws")
  expect_equal(none$log_evidence, none$posterior$log_evidence)
  expect_true(is.na(glance(none)$emulator_error))
  expect_no_error(amiss:::check_whole(none, "none"))
  expect_output(print(summary(none)), "failed at all")
})

test_that("a simulator that returns another number of values at posterior draws is refused", {
  expect_error(checked(function(k, y) y[-1]), "returned 239 value.*240 numbers",
               class = "amiss_error_input")
  expect_error(checked(function(k, y) as.character(y)), "class <character>",
               class = "amiss_error_input")
})

test_that("runs made elsewhere are checked by those left out", {
  m <- bent_measurements()
  elsewhere <- function(runs) {
    made <- simulate_design(bent_simulator(), m, runs, seed = 1)
    calibrate(train_emulator(ensemble(made$values, made$outputs, made$parameters), m), m, quick_ais,
              seed = 1)
  }
  good <- elsewhere(60)
  expect_true(good$check$passed)
  expect_identical(good$check$runs, 20L)  # a fifth would be 12
  expect_match(good$check$verdict, "by 20 left-out runs nearest to the posterior", fixed = TRUE)
  expect_true(is.na(good$check$effective))
  expect_identical(good$log_evidence, good$posterior$log_evidence)
  expect_null(good$check$mean)
  bad <- elsewhere(6)
  expect_false(bad$check$passed)
  expect_match(bad$trust$verdict, "by 6 left-out runs.*not good enough")
})

test_that("of a linear simulator the exact evidence is the emulated one", {
  fit <- linear_fit()
  # The emulator's error is below 1e-3 of the noise, at 240 rows: less than 0.05 nats of a
  # likelihood.
  expect_lt(abs(fit$check$correction), 0.05)
  expect_equal(fit$log_evidence, fit$posterior$log_evidence + fit$check$correction)
  expect_gt(fit$check$effective, 0.99)
})

test_that("with a coarse basis the exact evidence comes closer to that of a fine one", {
  m <- bent_measurements()
  runs <- simulate_design(bent_simulator(), m, runs = 40, seed = 2)
  calibrated <- function(control, seed)
    suppressWarnings(calibrate(train_emulator(runs, m, control), m, quick_ais, seed = seed))
  for (noise_fraction in c(1, 10)) {
    # The correction by a few draws is off by 0.1, a third of what it corrects: the mean over three
    # seeds is by half of that.
    off <- vapply(1:3, function(seed) {
      fine <- calibrated(list(explained = 1, noise_fraction = 1e-6), seed)
      coarse <- calibrated(list(explained = 0.5, noise_fraction = noise_fraction), seed)
      expect_lt(ncol(coarse$emulator$basis$vectors), ncol(fine$emulator$basis$vectors))
      # What few draws say of the correction is part of the error.
      expect_gt(coarse$standard_error, coarse$posterior$standard_error)
      exact <- coarse$log_evidence - fine$log_evidence
      expect_lt(abs(exact), 4 * sqrt(coarse$standard_error^2 + fine$standard_error^2))
      c(exact = exact, emulated = coarse$posterior$log_evidence - fine$log_evidence)
    }, c(exact = 0, emulated = 0))
    off <- abs(rowMeans(off))
    expect_lt(off[["exact"]], 0.5 * off[["emulated"]])
  }
})

test_that("a draw of much weight is run once and counts as often as it was drawn", {
  fit <- linear_fit()
  fit$weights[] <- 0.5 / (length(fit$weights) - 1)
  fit$weights[5] <- 0.5
  made <- amiss:::posterior_runs(fit, amiss:::even_draws(fit, 40), 1)
  expect_identical(anyDuplicated(made$draws), 0L)
  expect_equal(sum(made$times), 40)
  expect_equal(made$times[made$draws == 5], 20)
  expect_equal(amiss:::emulation_check(fit, made)$mean, as.numeric(made$runs %*% made$times) / 40)
  # The same draws one by one: the same correction.
  each <- rep(seq_along(made$draws), made$times)
  twice <- list(draws = made$draws[each], times = rep(1, 40), runs = made$runs[, each], failed = 0,
                lost = 0)
  expect_equal(amiss:::exact_evidence(list(fit), list(made), 1)[[1]]$log_evidence,
               amiss:::exact_evidence(list(fit), list(twice), 1)[[1]]$log_evidence)
})

test_that("an evidence that its correction leaves open by more than a nat is not trusted", {
  fit <- linear_fit()
  expect_true(amiss:::fit_trust(fit)$trusted)
  fit$standard_error <- 1.5
  expect_false(amiss:::fit_trust(fit)$trusted)
  expect_match(amiss:::fit_trust(fit)$verdict, "standard error of more than one nat")
})
