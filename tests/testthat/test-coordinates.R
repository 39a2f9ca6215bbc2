# Coordinates in which a simulator is most nearly linear.

test_that("coordinates go to the unit cube and back, of mean 0 and variance 1 over a prior", {
  unit <- withr::with_seed(1, matrix(runif(4000), 1000))
  space <- space_of(uniform(0, 5), normal(3, 2), uniform(-1, 1), normal(3, 2, lower = 1))
  z <- amiss:::from_unit(unit, space)
  expect_equal(amiss:::to_unit(z, space), unit, tolerance = 1e-12)
  expect_equal(z[, 2], qnorm(unit[, 2]))
  even <- amiss:::from_unit(matrix((1:1e4 - 0.5) / 1e4, 1e4, 2), space[1:2, ])
  expect_equal(colMeans(even), c(0, 0))
  # Midpoints of 10 000 strips miss the outermost half of one: less than 1e-3 of the variance.
  expect_equal(colMeans(even^2), c(1, 1), tolerance = 1e-3)
  expect_equal(amiss:::from_unit(cbind(0:1), space[1, ])[, 1], c(-1, 1) * sqrt(3))
  # Beyond the end of a flat prior is its end.
  expect_equal(amiss:::to_unit(cbind(c(-2, 2)), space[1, ])[, 1], c(0, 1))
})

test_that("a prior that is cut is linear in z, or in the logarithm, as far as its limits", {
  for (prior in list(normal(20, 3, 18, 29), lognormal(log(2), 0.6, 0.7, 6),
                     normal(0, 1, lower = 2))) {
    space <- space_of(prior)
    z <- seq(space$lower, space$upper, length.out = 50)
    value <- amiss:::prior_quantile(prior, amiss:::to_unit(cbind(z), space)[, 1])
    if (prior$family == "lognormal") value <- log(value)
    expect_equal(diff(value), rep(diff(range(value)) / 49, 49), tolerance = 1e-6)
    # It ends where six in a hundred thousand of the prior are left.
    ends <- amiss:::to_unit(cbind(c(space$lower, space$upper)), space)[, 1]
    expect_equal(ends, pnorm(c(-4, 4)), tolerance = 1e-9)
    # dz/dx by differences, x the normal quantile.
    at <- z[c(10, 25, 40)]
    x <- function(z) qnorm(amiss:::to_unit(cbind(z), space)[, 1])
    slope <- vapply(at, amiss:::per_normal, 0, space)
    expect_equal(slope, 2e-5 / (x(at + 1e-5) - x(at - 1e-5)), tolerance = 1e-5)
  }
  # Beyond its limit nothing can move.
  expect_equal(amiss:::per_normal(3, space_of(normal(0, 1, -2, 2))), 0)
})

test_that("a prior is flat if it is uniform, or wider than its limits", {
  flat <- function(prior) amiss:::is_flat(free("k", prior)$prior)
  expect_true(flat(uniform(0, 1)))
  expect_false(flat(normal(0, 1)))
  expect_false(flat(lognormal(1, 2)))
  expect_true(flat(lognormal(1, 2, 1, 3)))
  expect_true(flat(normal(0, 1, -0.4, 0.5)))
  expect_false(flat(normal(0, 1, -2, 2)))
})

test_that("differences stay within priors that are cut, at either end", {
  space <- space_of(normal(0, 1, -2, 2), normal(0, 1, lower = 1, upper = 2.5), uniform(0, 1),
                    normal(0, 1))
  for (z in list(space$lower, space$upper, (space$lower + space$upper) / 2)) {
    for (step in c(rules$search_difference, rules$wide_difference)) {
      to <- z + step * amiss:::difference_side(z, space)
      expect_true(all(to > space$lower - 1e-9 & to < space$upper + 1e-9))
    }
  }
})

test_that(
  "runs lie as far out in a region as their points of the unit cube do, if no prior is flat", {
  parameters <- list(a = free("a", normal(0, 1, -2, 0.5)), b = free("b", lognormal(0, 1)))
  unit <- withr::with_seed(5, matrix(runif(400), 200))
  region <- amiss:::region_of_draws(unit, rep(1, 200), parameters)
  space <- amiss:::coordinates_of(parameters)
  apart <- amiss:::along_axes(region, space, amiss:::from_unit(unit, space))
  expect_equal(sqrt(colSums(apart^2)) / region$radius, amiss:::region_distance(region, unit),
               tolerance = 1e-9)
})

# The most probable point in a box, by trying every set of coordinates at their ends.
brute_force <- function(mean, precision, limit) {
  p <- length(mean)
  best <- list(value = Inf)
  sides <- as.matrix(expand.grid(rep(list(-1:1), p)))
  for (k in seq_len(nrow(sides))) {
    ends <- sides[k, ]
    free <- ends == 0
    z <- ifelse(ends < 0, limit$lower, ifelse(ends > 0, limit$upper, 0))
    if (any(free)) {
      pulled <- precision[free, !free, drop = FALSE] %*% (z - mean)[!free]
      z[free] <- mean[free] - solve(precision[free, free, drop = FALSE], pulled)
    }
    value <- sum((z - mean) * (precision %*% (z - mean))[, 1])
    is_within <- all(z >= limit$lower - 1e-12 & z <= limit$upper + 1e-12)
    if (is_within && value < best$value) best <- list(z = z, value = value)
  }
  unname(best$z)
}

test_that("the most probable point within limits is that of trying every set of ends", {
  box <- function(seed, p) {
    withr::with_seed(seed, {
      root <- matrix(rnorm(p * p), p)
      list(mean = rnorm(p, 0, 3), precision = crossprod(root) + diag(0.1, p),
           limit = data.frame(lower = -runif(p, -1, 4), upper = runif(p, 1.5, 4)))
    })
  }
  at_end <- 0
  for (seed in 1:60) {
    own <- box(seed, 1 + seed %% 4)
    z <- amiss:::within_limits(own$mean, own$precision, own$limit)
    # A sweep that moves nothing by 1e-6 ends it; 0.1 is the least curvature, so little is left.
    expect_equal(z, brute_force(own$mean, own$precision, own$limit), tolerance = 1e-4)
    at_end <- at_end + any(z == own$limit$lower | z == own$limit$upper)
  }
  expect_gt(at_end, 30)  # most of them do end at a limit
})

test_that("so it is on a ridge a hundred times as long as it is wide", {
  # Two parameters that are correlated, and one at its limit that pulls one of them.
  ridge <- rbind(c(1, 0.9998, 0.5), c(0.9998, 1, 0.5), c(0.5, 0.5, 1))
  mean <- c(0, 0, 3)
  limit <- data.frame(lower = -c(4, 4, 1.7), upper = c(4, 4, 1.7))
  apart <- amiss:::within_limits(mean, solve(ridge), limit) - brute_force(mean, solve(ridge), limit)
  # In standard deviations, a tenth of one is as near as a step of a search is judged.
  expect_lt(sqrt(sum(apart * solve(ridge, apart))), 0.1)
  expect_lt(max(abs(apart)), 0.1)
})

# Mean and variance of N(mean, sd^2) between limits, by quadrature.
truncated_moments <- function(mean, sd, lower, upper) {
  x <- seq(lower, upper, length.out = 2e5)
  weight <- exp(-((x - mean)^2 - min((x - mean)^2)) / (2 * sd^2))
  weight <- weight / sum(weight)
  c(mean = sum(weight * x), variance = sum(weight * (x - sum(weight * x))^2))
}

test_that("draws within limits have the moments of the truncated normal distribution", {
  for (case in list(c(0, 1), c(0.5, 3), c(1.7, 0.2), c(3, 1), c(-4, 0.5), c(30, 0.5), c(-6, 0.3))) {
    limit <- data.frame(lower = -sqrt(3), upper = 2)
    draws <- amiss:::draws_within(case[1], cbind(case[2]^2), limit, 20000, seed = 1)[, 1]
    exact <- truncated_moments(case[1], case[2], limit$lower, limit$upper)
    expect_true(all(draws >= limit$lower & draws <= limit$upper))
    # Of one coordinate draws are independent: four standard errors of a mean, and of a variance
    # whose kurtosis is at most that of the exponential distribution, 9.
    expect_lt(abs(mean(draws) - exact[["mean"]]), 4 * sqrt(exact[["variance"]] / 20000))
    expect_equal(var(draws), exact[["variance"]], tolerance = 4 * sqrt(8 / 20000))
  }
})

test_that(
  "draws leave a corner of the limits in which all of eight correlated coordinates are pressed", {
  root <- withr::with_seed(1, matrix(rnorm(64), 8))
  covariance <- crossprod(root) + diag(0.01, 8)
  mean <- rep(c(-5, 5), 4) * sqrt(diag(covariance))
  limit <- data.frame(lower = rep(-sqrt(3), 8), upper = sqrt(3))
  draws <- amiss:::draws_within(mean, covariance, limit, 600, seed = 1)
  # Along random directions alone no draw would move: hardly any leads inwards in all coordinates.
  expect_lt(max(abs(draws)), sqrt(3))
  expect_false(anyDuplicated(draws[, 1]) > 0)
})

test_that("where no limit is near, draws have the mean and covariance asked for", {
  covariance <- matrix(c(0.04, 0.018, 0.018, 0.02), 2)
  limit <- data.frame(lower = c(-4, -4), upper = 4)
  draws <- amiss:::draws_within(c(0.3, -0.5), covariance, limit, 20000, seed = 2)
  # Gibbs draws of correlation 0.64 repeat themselves: (1 + 0.64^2) / (1 - 0.64^2) = 2.4 count as
  # one.
  error <- 4 * sqrt(2.4 / 20000)
  expect_lt(max(abs(colMeans(draws) - c(0.3, -0.5)) / sqrt(diag(covariance))), error)
  expect_lt(max(abs(apply(draws, 2, sd) / sqrt(diag(covariance)) - 1)), error / sqrt(2))
  expect_lt(abs(cor(draws)[1, 2] - cov2cor(covariance)[1, 2]), (1 - 0.64^2) * error)
  expect_identical(draws, amiss:::draws_within(c(0.3, -0.5), covariance, limit, 20000, seed = 2))
})
