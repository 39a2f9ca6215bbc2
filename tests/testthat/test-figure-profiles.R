# Profiles of the likelihood, and their figure.

profiled <- made_once(function() amiss:::profiles(plain_linear_fit()))

log_likelihood_at <- function(fit, z)
  amiss:::emulated_log_likelihood(fit, amiss:::emulated_runs(fit, z))

# The largest value over the other of two parameters by a search of base R.
searched_value <- function(fit, j, x) {
  prior <- fit$emulator$parameters[[j]]$prior
  at <- amiss:::to_normal(amiss:::prior_cdf(prior, x))
  z <- amiss:::to_normal(amiss:::posterior_unit(fit))
  other <- setdiff(1:2, j)
  f <- function(v) log_likelihood_at(fit, rbind(replace(c(v, v), j, at)))
  stats::optimize(f, range(z[, other]), maximum = TRUE, tol = 1e-6)$objective
}

test_that("a profile is the largest likelihood over the other parameters", {
  fit <- plain_linear_fit()
  for (j in 1:2) {
    profile <- profiled()[[j]]
    expect_length(profile$x, amiss:::profile_points)
    for (k in c(2, 6, 10)) {
      # Steps end when they gain little: a hundredth of a nat.
      expect_equal(profile$log_likelihood[k], searched_value(fit, j, profile$x[k]),
                   tolerance = 0.01 / abs(profile$log_likelihood[k]), info = paste(j, k))
    }
  }
})

test_that("of a linear simulator it is a parabola, whose 95 % interval is that of the posterior", {
  fit <- plain_linear_fit()
  interval <- stats::confint(fit)
  for (name in names(profiled())) {
    profile <- profiled()[[name]]
    curve <- stats::lm(log_likelihood ~ poly(x, 2, raw = TRUE), profile)
    expect_lt(stats::sd(stats::residuals(curve)), 0.05)
    half <- sqrt(-amiss:::profile_fall / stats::coef(curve)[[3]])
    # Error and discrepancy, which the profile holds as draws have them, widen the posterior; its
    # ends are those of 500 draws.
    expect_equal(half / (diff(interval[name, ]) / 2), 1, tolerance = 0.25, ignore_attr = TRUE)
  }
})

test_that("one parameter alone has the likelihood as its profile", {
  simulator <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
                                  free("gain", uniform(0, 1)), boundary = "Te")
  m <- linear_measurements()
  fit <- calibrate(train_emulator(simulate_design(simulator, m, runs = 12, seed = 1), m), m,
                   quick_ais, seed = 1)
  profile <- amiss:::profiles(fit)$gain
  z <- cbind(amiss:::to_normal(profile$x))  # the prior is the unit interval
  expect_equal(profile$log_likelihood, log_likelihood_at(fit, z))
})

test_that("the title says which parameters the record bounds on both sides", {
  whole <- list(x = 1:3, log_likelihood = c(-3, 0, -2))
  half <- list(x = 1:3, log_likelihood = c(-3, 0, -1))
  label <- c("one", "two", "three", "four")
  said <- function(...) {
    bounded <- amiss:::bounded_by_record(list(...))
    amiss:::profiles_title(bounded, label[seq_along(bounded)])
  }
  expect_identical(said(whole, whole), "The record bounds every parameter on both sides")
  expect_identical(said(half, half), "The record bounds no parameter on both sides")
  expect_identical(said(half, whole), "The record bounds all parameters on both sides but one")
  expect_identical(said(half, half, whole, half, half),
                   "The record bounds 1 of 5 parameters on both sides")
  figure <- ggplot2::autoplot(plain_linear_fit(), "profiles")
  expect_identical(figure$labels$title, "The record bounds every parameter on both sides")
  expect_error(ggplot2::ggplot_build(figure), NA)
})

test_that("emulated runs lack what the basis discards, as the sampler takes them", {
  m <- bent_measurements()
  ensemble <- simulate_design(bent_simulator(), m, runs = 30, seed = 1)
  emulator <- suppressWarnings(train_emulator(ensemble, m, list(max_vectors = 2)))
  fit <- calibrate(emulator, m, quick_ais, seed = 1)
  expect_gt(fit$priors$discarded_variance, 0)
  draws <- amiss:::even_draws(fit, amiss:::profile_draws)
  z <- amiss:::to_normal(amiss:::posterior_unit(fit))
  expected <- fit$posterior$log_likelihood[draws]
  own <- vapply(seq_along(draws), function(k) {
    one <- fit
    one$weights <- replace(0 * fit$weights, draws[k], 1)
    log_likelihood_at(one, z[draws[k], , drop = FALSE])
  }, 0)
  # The sampler adds the emulator's own variance, which is small with so many runs. With what the
  # basis discards taken off, they would differ by tens and hundreds.
  expect_lt(max(abs(own - expected)), 2)
})

test_that("a posterior of few draws, and a part of a joint one, have no profiles", {
  fit <- plain_linear_fit()
  fit$weights <- replace(0 * fit$weights, 1:2, 0.5)
  expect_match(ggplot2::autoplot(fit, "profiles")$labels$title, "too few draws")
  fit <- plain_linear_fit()
  fit$part <- TRUE
  expect_error(ggplot2::autoplot(fit, "profiles"), class = "amiss_error_input")
})
