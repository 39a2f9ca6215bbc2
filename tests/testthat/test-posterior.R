fit <- plain_linear_fit()
w <- fit$weights / sum(fit$weights)

# The smallest value below which a share p of the weight lies, by a search.
share_below <- function(x, at) sum(w[x <= at])

test_that("intervals hold the share of the weight that they should", {
  for (level in c(0.5, 0.95)) {
    ends <- confint(fit, level = level)
    for (name in rownames(ends)) {
      # One draw more or less on each side.
      expect_lte(abs(share_below(fit$values[, name], ends[name, 1]) - (1 - level) / 2),
                 max(w) + 1e-12)
      expect_lte(abs(share_below(fit$values[, name], ends[name, 2]) - (1 + level) / 2),
                 max(w) + 1e-12)
    }
  }
  expect_identical(colnames(confint(fit)), c("2.5 %", "97.5 %"))
  expect_identical(confint(fit, "gain"), confint(fit)["gain", , drop = FALSE])
  expect_identical(confint(fit, 2), confint(fit, "gain"))
  expect_error(confint(fit, "slope"), "no parameter.*slope", class = "amiss_error_input")
  expect_error(confint(fit, level = 95), "level", class = "amiss_error_input")
})

test_that("median and covariance are those of the weighted draws", {
  for (name in names(coef(fit)))
    expect_lte(abs(share_below(fit$values[, name], coef(fit)[[name]]) - 0.5), max(w) + 1e-12)
  centred <- sweep(fit$values, 2, colSums(w * fit$values))
  expect_equal(vcov(fit), t(centred) %*% (w * centred), tolerance = 1e-10)
})

test_that("the tidy table carries labels, units and what the other methods say", {
  table <- tidy(fit, conf.level = 0.9)
  expect_named(table, c("term", "label", "unit", "estimate", "std.error", "conf.low", "conf.high",
                        "physical.low", "physical.high", "modes", "share"))
  expect_identical(table$modes, c(1L, 1L))
  expect_identical(table$unit, c("K", ""))
  expect_identical(table$label, c("offset", "gain"))
  expect_identical(table$estimate, unname(coef(fit)))
  expect_equal(table$std.error^2, unname(diag(vcov(fit))))
  expect_equal(table$share, c(1, 1))
  expect_identical(table$conf.high, unname(confint(fit, level = 0.9)[, 2]))
})

test_that("a posterior of two modes says so, in the table and in words", {
  parted <- fit
  upper <- seq_len(nrow(fit$values)) %% 2 == 0
  parted$values[, "gain"] <- parted$values[, "gain"] + 0.5 * upper
  table <- tidy(parted)
  expect_identical(table$term, c("offset", "gain", "gain"))
  expect_identical(table$modes, c(1L, 2L, 2L))
  expect_equal(table$share[2:3], c(sum(w[!upper]), sum(w[upper])))
  expect_equal(diff(table$estimate[2:3]), 0.5, tolerance = 0.02)
  expect_lt(max(table$std.error[2:3]), 0.1)
  for (said in list(printed(parted), printed(summary(parted))))
    expect_match(said, "posterior of gain has 2 modes: 0")
})

test_that("a few draws in the gap between two modes do not hide them", {
  w <- rep(1, 1001) / 1001
  modes <- function(x, w) length(amiss:::gaps_between_modes(sort(x), w)) + 1L
  two <- withr::with_seed(1, c(rnorm(500, 10, 3), rnorm(501, 350, 3)))
  expect_identical(modes(two, w), 2L)
  stray <- replace(two, c(100, 600), c(120, 240))
  expect_identical(modes(stray, w), 2L)
  # As light as draws of an importance sample are.
  many <- seq(20, 340, 4)
  expect_identical(modes(c(two, many), c(w, rep(1e-6, length(many)))[order(c(two, many))]), 2L)
  three <- withr::with_seed(2, c(rnorm(400, 0, 1), rnorm(300, 60, 1), rnorm(301, 100, 1)))
  expect_identical(modes(three, w), 3L)
  # One peak is one mode: flat, normal, with a long tail, and with its mass at both ends of a range.
  one <- withr::with_seed(3, list(runif(1001), rnorm(1001), rexp(1001), rt(1001, 3),
                                  rbeta(1001, 0.5, 0.5)))
  for (x in one) expect_identical(modes(x, w), 1L)
})

test_that("the parameters are drawn if every one has several modes", {
  parted <- fit
  parted$values <- parted$values + 0.5 * (seq_len(nrow(fit$values)) %% 2 == 0)
  expect_identical(tidy(parted)$modes, rep(2L, 4))
  expect_no_error(ggplot2::ggplot_build(ggplot2::autoplot(parted)))
})

test_that("equal draws have the moments of the weighted ones, each beside its repeats", {
  mean <- colSums(w * fit$values)
  sd <- sqrt(diag(vcov(fit)))
  draws <- as.matrix(fit, draws = 2000)
  # Systematic draws are off by less than independent ones, whose mean has an error of sd /
  # sqrt(2000) = 0.022 sd.
  expect_lt(max(abs(colMeans(draws) - mean) / sd), 0.022)
  expect_equal(apply(draws, 2, stats::sd), sd, tolerance = 0.05)
  same <- match(draws[, "offset"], draws[, "offset"])
  expect_length(rle(same)$lengths, length(unique(same)))
  # The others are in random order: five standard errors.
  apart <- draws[!duplicated(same), "offset"]
  n <- length(apart)
  expect_lt(abs(cor(apart[-1], apart[-n])), 5 / sqrt(n))
  expect_identical(as.matrix(fit, draws = 2000), draws)
  expect_identical(as.data.frame(fit), as.data.frame(as.matrix(fit)))
  expect_identical(dim(as.data.frame(fit, draws = 7)), c(7L, 2L))
  expect_error(as.data.frame(fit, draws = 0), "draws", class = "amiss_error_input")
})

test_that("posterior takes the draws", {
  skip_if_not_installed("posterior")
  expect_s3_class(posterior::as_draws_df(fit), "draws_df")
  expect_s3_class(posterior::as_draws(fit), "draws")
  draws <- posterior::as_draws_matrix(fit, draws = 2000)
  expect_s3_class(draws, "draws_matrix")
  expect_identical(posterior::variables(draws), c("offset", "gain"))
  expect_identical(posterior::nchains(draws), 1L)
  told <- posterior::summarise_draws(draws, "mean", "rhat")
  expect_lt(max(abs(told$mean - colSums(w * fit$values)) / sqrt(diag(vcov(fit)))), 0.022)
  expect_lt(max(told$rhat), 1.05)
  expect_error(posterior::as_draws_df(fit, chains = 2), class = "rlib_error_dots_nonempty")
})

test_that("the effective number of draws that posterior states is that of the weighted ones", {
  skip_if_not_installed("posterior")
  # A few draws of much weight, as those of a hard calibration.
  uneven <- fit
  uneven$weights <- with_seed(1, stats::rexp(nrow(fit$values)))^3
  share <- uneven$weights / sum(uneven$weights)
  for (n in c(nrow(fit$values), 4000)) {
    draws <- posterior::as_draws_df(uneven, draws = n)
    told <- posterior::summarise_draws(draws, "ess_bulk", "ess_tail")
    distinct <- length(unique(draws$offset))
    # An autocorrelation time summed over m lags of n rows is off by a share of sqrt(4 m / n). Runs
    # of repeats need m of a few times their mean length, n / distinct: a share of about
    # sqrt(10 / distinct).
    expect_lte(max(told$ess_bulk), distinct * (1 + 3 * sqrt(10 / distinct)))
    expect_lt(max(told$ess_bulk), 2 / sum(share^2))
  }
})

test_that("a mode of one draw is one", {
  fit <- plain_linear_fit()
  first <- which.min(fit$values[, "gain"])
  fit$values[first, "gain"] <- fit$values[first, "gain"] - 0.1
  fit$weights[first] <- 0.1 * sum(fit$weights[-first]) / 0.9
  modes <- amiss:::parameter_modes(fit, "gain")
  expect_identical(lengths(list(modes)), 2L)
  expect_identical(modes[[1]]$lower, fit$values[[first, "gain"]])
  expect_identical(tidy(fit)$modes[2], 2L)
})
