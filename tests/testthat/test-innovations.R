# What a record does beyond what the fitted model expects of it, and the figure that shows it.

quick_fit <- function(m, control = list(), simulator = linear_simulator(), seed = 1) {
  calibrate(train_emulator(simulate_design(simulator, m, 24, seed = seed), m), m,
            utils::modifyList(quick_ais, control), seed = seed)
}

log_density <- function(found) {
  sum(stats::dnorm(found$innovation, log = TRUE)) - sum(log(found$sd))
}

# The same record with other measurements at the rows of a fit.
with_record <- function(fit, y) {
  m <- fit$measurements
  m$y[fit$rows] <- y
  m
}

first_lag <- function(z) sum(z[-1] * z[-length(z)]) / sum(z^2)

test_that("the density of the innovations is the likelihood that the engine sampled", {
  m <- linear_measurements()
  for (control in list(list(), list(error_times = numeric()), list(reach = Inf),
                       list(error_times = c(1, 5, 30), error_ratios = c(0.2, 2)))) {
    fit <- quick_fit(m, control)
    for (draw in c(1, 7, 20))
      expect_equal(log_density(amiss:::innovations(fit, draw)), fit$posterior$log_likelihood[draw],
                   tolerance = 1e-8)
  }
})

test_that("a record with a gap has the engine's likelihood too", {
  data <- linear_data()
  m <- suppressWarnings(linear_measurements(data[-(60:75), ]), classes = "amiss_warning_input")
  expect_gt(length(unique(m$segment)), 1)
  fit <- quick_fit(m)
  expect_equal(log_density(amiss:::innovations(fit, 3)), fit$posterior$log_likelihood[3],
               tolerance = 1e-8)
})

test_that("they are those of a Cholesky factor in the order of time", {
  parts <- withr::with_seed(1, list(left = rnorm(40), columns = matrix(rnorm(120), 40)))
  spread <- c(0.5, 2, 0.1)
  slow <- c(1, 3)
  times <- c(2, 8)
  hours <- cumsum(c(0, rep(c(1, 2.5), length.out = 39)))
  apart <- abs(outer(hours, hours, "-"))
  covariance <- parts$columns %*% (spread * t(parts$columns)) + diag(0.3, 40) +
    slow[1] * exp(-apart / times[1]) + slow[2] * exp(-apart / times[2])
  found <- amiss:::filter_rows(parts$left, parts$columns, spread,
                               exp(-outer(c(Inf, diff(hours)), 1 / times)), slow, 0.3)
  lower <- t(chol(covariance))
  expect_equal(found$error / found$sd, as.numeric(forwardsolve(lower, parts$left)))
  expect_equal(found$sd, diag(lower))
})

test_that("of data drawn from the model they are white and N(0, 1)", {
  fit <- quick_fit(linear_measurements())
  n <- length(fit$rows)
  drawn <- simulate(fit, 4, seed = 3)
  for (k in 1:4) {
    again <- quick_fit(with_record(fit, drawn[[k]]), seed = k)
    z <- amiss:::innovations(again)$innovation
    # Either limit fails one time in 1,000 for one record, if all is right.
    expect_gt(sum(z^2), stats::qchisq(5e-4, n))
    expect_lt(sum(z^2), stats::qchisq(1 - 5e-4, n))
    expect_lt(abs(first_lag(z)), 3.3 / sqrt(n))
  }
})

test_that("an autocorrelated error is flagged if the error model knows only white noise", {
  fit <- quick_fit(linear_measurements())
  n <- length(fit$rows)
  error <- withr::with_seed(5, 0.3 * as.numeric(stats::arima.sim(list(ar = 0.8), n)))
  m <- with_record(fit, fit$measurements$y[fit$rows] + error)
  white <- quick_fit(m, list(error_ratios = 0))
  title <- ggplot2::autoplot(white, "residuals")$labels$title
  expect_match(title, "^Neighbouring residuals agree \\(correlation 0\\.[5-9].*lasts longer")
  knowing <- quick_fit(m)
  expect_lt(abs(first_lag(amiss:::innovations(knowing)$innovation)), 3.3 / sqrt(n))
})

# The error of a house: smooth, and its white part a twentieth of what was stated. If the stated
# noise were firmly believed, neighbours would agree.
test_that("a stated noise that is far too large is not believed", {
  m <- linear_measurements(linear_data(noise = 0.005))
  n <- sum(m$use == "calibrate")
  error <- withr::with_seed(6, 0.02 * as.numeric(stats::arima.sim(list(ar = 0.9), n)))
  m$y[m$use == "calibrate"] <- m$y[m$use == "calibrate"] + error
  fit <- quick_fit(m)
  expect_lt(abs(first_lag(amiss:::innovations(fit)$innovation)), 3.3 / sqrt(n))
  expect_lt(sqrt(max(fit$posterior$variance)), m$noise_sd / 4)
})

test_that("the title tells of the first check that fails", {
  m <- linear_measurements()
  z <- withr::with_seed(2, rnorm(400))
  told <- function(z, means = list()) amiss:::residual_title(z, m, means)
  expect_identical(told(z), "Residuals are white and normal, as the error model says")
  expect_match(told(diff(c(0, z)) / sqrt(2)), "oppose each other \\(correlation -0\\.[45].*faster")
  daily <- (z + 1.5 * sin(2 * pi * seq_along(z) / 24)) / 1.5
  expect_match(told(daily), "agree")
  later <- (z[25:400] + z[1:376]) / sqrt(2)
  expect_match(told(later), "^Residuals 24 h apart agree \\(correlation 0\\.[45]")
  expect_match(told(1.5 * z), "white, but 1\\.[456] times as large")
  expect_match(told(replace(z, c(50, 300), c(6, -7))), "white, but 2 of 400 are too large.*7\\.0")
  depends <- list(Te = list(p_value = 1e-6))
  expect_identical(told(z, depends), "Residuals are white, but they depend on Te")
})

test_that("bands hold what they should", {
  withr::local_seed(4)
  inside <- replicate(400, {
    z <- rnorm(100)
    q <- amiss:::normal_quantiles(z)
    r <- amiss:::correlations(z, 1)
    spectrum <- amiss:::cumulated_periodogram(z, 1)$table
    c(quantiles = mean(q$y > q$lower & q$y < q$upper), lags = mean(abs(r$y) < r$upper),
      spectrum = all(spectrum$y >= spectrum$lower & spectrum$y <= spectrum$upper))
  })
  # Of the mean of 400 shares near 0.95: quantiles of one record go together, at worst as one value,
  # so that its standard error is 0.011 at most.
  expect_equal(rowMeans(inside), c(quantiles = 0.95, lags = 0.95, spectrum = 0.95),
               tolerance = 0.035)
})

test_that("the figure has a panel of each kind, for a record of one condition too", {
  fit <- quick_fit(linear_measurements())
  figure <- ggplot2::autoplot(fit, "residuals")
  expect_s3_class(figure, "ggplot")
  panels <- levels(figure$data$panel)
  for (kind in c("over time", "by normal quantile", "by lag", "frequency"))
    expect_identical(sum(grepl(kind, panels)), 1L)
  expect_lte(length(panels), 6)
  expect_error(ggplot2::ggplot_build(figure), NA)
  expect_error(plot(fit, "nonsense"), class = "amiss_error_input")
})

test_that("classes of a switch are its two states, and a constant condition is one class", {
  withr::local_seed(6)
  found <- data.frame(row = 1:200, innovation = rnorm(200))
  hour <- 1:200
  table <- data.frame(hour, Ti = rnorm(200), fan = hour %% 24 > 12, sun = pmax(0, sin(hour / 4)))
  m <- measurements(table, time = "hour", target = "Ti", boundary = ~ fan + sun, noise_sd = 0.1)
  means <- amiss:::condition_means(m, found)
  expect_equal(means$fan$classes$x, c(0, 1))
  expect_gt(nrow(means$sun$classes), 2)
  found$innovation <- found$innovation + 2 * (hour %% 24 > 12)
  expect_lt(amiss:::condition_means(m, found)$fan$p_value, 1e-6)
  expect_identical(nrow(amiss:::condition_means(m, found[hour %% 24 > 12, ])$fan$classes), 1L)
})

test_that("of a long record the first rows are shown", {
  fit <- quick_fit(linear_measurements())
  whole <- amiss:::innovations(fit)
  expect_equal(amiss:::innovations(fit, most = 50), whole[1:50, ])
  expect_identical(range(amiss:::evenly_kept(20000)), c(1, 20000))
  expect_lte(length(amiss:::evenly_kept(20000)), amiss:::most_residuals)
})
