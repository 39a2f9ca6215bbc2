conjugate <- function(d, sd) {
  list(f = function(z) -0.5 * rowSums(z^2) / sd^2 - d * log(sd * sqrt(2 * pi)),
       priors = stats::setNames(rep(list(normal(0, 1)), d), paste0("z", seq_len(d))),
       exact = -d / 2 * log(2 * pi * (1 + sd^2)))
}

test_that("the evidence of a conjugate model is its closed form", {
  for (d in c(3, 10)) {
    case <- conjugate(d, 0.1)
    result <- ais(case$f, case$priors, seed = 1)
    expect_true(result$trusted)
    # Four standard errors: exceeded by chance once in 16,000.
    expect_lt(abs(result$log_evidence - case$exact), 4 * result$standard_error + 0.02)
    expect_equal(as.numeric(crossprod(result$draws^2, result$weights)), rep(0.01 / 1.01, d), tolerance = 0.25)
  }
})

test_that("the evidence agrees with quadrature for a bounded prior and a likelihood that is zero on one side", {
  f <- function(x) ifelse(x < 2, -Inf, dnorm(x, 3, 0.5, log = TRUE))
  exact <- log(stats::integrate(function(x) dnorm(x, 3, 0.5) / 10, 2, 10)$value)
  result <- ais(function(z) f(z[, "a"]), list(a = uniform(0, 10)), seed = 2)
  expect_lt(abs(result$log_evidence - exact), 4 * result$standard_error)
  expect_true(all(result$draws[result$weights > 0, ] >= 2))
})

test_that("plain annealed importance sampling stays selectable and the same seed gives the same bits", {
  case <- conjugate(2, 0.5)
  plain <- ais(case$f, case$priors, list(resample = FALSE, importance_draws = 0), seed = 3)
  expect_equal(plain$estimator, "annealed")
  expect_lt(abs(plain$log_evidence - case$exact), 4 * plain$standard_error)
  expect_identical(ais(case$f, case$priors, seed = 5), ais(case$f, case$priors, seed = 5))
})

test_that("a gradient with respect to the parameters is taken through every kind of prior", {
  f <- function(z) -0.5 * rowSums(z^2) / 0.01
  for (prior in list(normal(0, 1), uniform(-3, 2), lognormal(-1, 1), beta_prior(2, 3), triangular(-1, 0.2, 2),
                     normal(0, 1, lower = 0.05))) {
    exact <- log(stats::integrate(function(x) prior_density(prior, x) * exp(-0.5 * x^2 / 0.01), max(prior$lower, -1),
                                  min(prior$upper, 1), rel.tol = 1e-8)$value)
    result <- ais(f, list(a = prior, b = prior), quick_ais$ais, seed = 4, gradient = function(z) -z / 0.01)
    # Four standard errors: exceeded by chance once in 16,000.
    expect_lt(abs(result$log_evidence - 2 * exact), 4 * result$standard_error)
  }
  expect_error(ais(f, list(a = normal(0, 1)), seed = 1, gradient = function(z) z[, 1]), "gradient",
               class = "amiss_error_input")
})

test_that("bad likelihoods and priors are classed errors", {
  prior <- list(a = uniform(0, 1))
  expect_error(ais(function(z) 1:2, prior, seed = 1), "another number of values", class = "amiss_error_input")
  expect_error(ais(function(z) stop("no simulator"), prior, seed = 1), "no simulator", class = "amiss_error")
  expect_error(ais(function(z) rep(-Inf, nrow(z)), prior, seed = 1), "zero at every draw",
               class = "amiss_error_numerical")
  expect_error(ais(function(z) z[, 1], list(uniform(0, 1))), "priors", class = "amiss_error_input")
  for (bad in list(list(chains = "many"), list(groups = NA), list(precision = -1), list(max_groups = 3),
                   list(sweeps = 1.5),
                   list(ess_drop = 2), list(resample = "no"), list(importance_draws = 10), list(chians = 10))) {
    expect_error(ais(function(z) z[, 1], prior, bad, seed = 1), names(bad), class = "amiss_error_input")
  }
})
