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
    expect_equal(as.numeric(crossprod(result$draws^2, result$weights)), rep(0.01 / 1.01, d),
                 tolerance = 0.25)
  }
})

test_that(paste("the evidence agrees with quadrature for a bounded prior and a likelihood that is",
                "zero on one side"), {
  f <- function(x) ifelse(x < 2, -Inf, dnorm(x, 3, 0.5, log = TRUE))
  exact <- log(stats::integrate(function(x) dnorm(x, 3, 0.5) / 10, 2, 10)$value)
  result <- ais(function(z) f(z[, "a"]), list(a = uniform(0, 10)), seed = 2)
  expect_lt(abs(result$log_evidence - exact), 4 * result$standard_error)
  expect_true(all(result$draws[result$weights > 0, ] >= 2))
})

test_that(
  "plain annealed importance sampling stays selectable and the same seed gives the same bits", {
  case <- conjugate(2, 0.5)
  plain <- ais(case$f, case$priors, list(resample = FALSE, importance_draws = 0), seed = 3)
  expect_equal(plain$estimator, "annealed")
  expect_lt(abs(plain$log_evidence - case$exact), 4 * plain$standard_error)
  expect_identical(ais(case$f, case$priors, seed = 5), ais(case$f, case$priors, seed = 5))
})

test_that("a gradient with respect to the parameters is taken through every kind of prior", {
  f <- function(z) -0.5 * rowSums(z^2) / 0.01
  for (prior in list(normal(0, 1), uniform(-3, 2), lognormal(-1, 1), beta_prior(2, 3),
                     triangular(-1, 0.2, 2), normal(0, 1, lower = 0.05))) {
    exact <- log(stats::integrate(function(x) prior_density(prior, x) * exp(-0.5 * x^2 / 0.01),
                                  max(prior$lower, -1), min(prior$upper, 1), rel.tol = 1e-8)$value)
    result <- ais(f, list(a = prior, b = prior), quick_ais$ais, seed = 4,
                  gradient = function(z) -z / 0.01)
    # Four standard errors: exceeded by chance once in 16,000.
    expect_lt(abs(result$log_evidence - 2 * exact), 4 * result$standard_error)
  }
  expect_error(ais(f, list(a = normal(0, 1)), seed = 1, gradient = function(z) z[, 1]), "gradient",
               class = "amiss_error_input")
})

test_that("bad likelihoods and priors are classed errors", {
  prior <- list(a = uniform(0, 1))
  expect_error(ais(function(z) 1:2, prior, seed = 1), "another number of values",
               class = "amiss_error_input")
  expect_error(ais(function(z) stop("no simulator"), prior, seed = 1), "no simulator",
               class = "amiss_error")
  expect_error(ais(function(z) rep(-Inf, nrow(z)), prior, seed = 1), "zero at every draw",
               class = "amiss_error_numerical")
  expect_error(ais(function(z) z[, 1], list(uniform(0, 1))), "priors", class = "amiss_error_input")
  for (bad in list(list(chains = "many"), list(groups = NA), list(precision = -1),
                   list(max_groups = 3), list(sweeps = 1.5), list(ess_drop = 2),
                   list(resample = "no"), list(importance_draws = 10), list(chians = 10))) {
    expect_error(ais(function(z) z[, 1], prior, bad, seed = 1), names(bad),
                 class = "amiss_error_input")
  }
})

# Two normal modes of equal mass between -10 and 10 in d dimensions, the second `ratio` times
# narrower.
two_modes <- function(d, sd, ratio) {
  centre <- rep(c(5, -3, 4), length.out = d)
  one <- function(x, at, sd) colSums(dnorm(t(x), at, sd, log = TRUE))
  list(f = function(x) {
         both <- cbind(one(x, centre, sd), one(x, -centre, sd / ratio)) + log(0.5)
         top <- pmax(both[, 1], both[, 2])
         top + log(rowSums(exp(both - top)))
       }, is_first = function(x) (x %*% centre)[, 1] > 0, exact = -d * log(20),
       priors = stats::setNames(rep(list(uniform(-10, 10)), d), paste0("z", seq_len(d))))
}

test_that("a mode that is narrower than another is found, and both have their mass", {
  for (d in 2:3) {
    case <- two_modes(d, 0.3, 5)
    result <- ais(case$f, case$priors, seed = 1)
    expect_true(result$trusted)
    expect_match(result$verdict, "a search added a mode")
    # Without it the evidence would be too low by log(2).
    expect_lt(abs(result$log_evidence - case$exact), 4 * result$standard_error)
    expect_equal(sum(result$weights[case$is_first(unname(result$draws))]), 0.5, tolerance = 0.1)
    expect_equal(sum(result$weights), 1)
    expect_equal(result$log_likelihood, case$f(unname(result$draws)), tolerance = 1e-6)
  }
})

test_that(
  "of a posterior whose logarithm is concave no point leads elsewhere but those above a draw", {
  case <- conjugate(4, 0.2)
  density <- function(x) case$f(x) - 0.5 * rowSums(x^2)
  starts <- withr::with_seed(1, matrix(rnorm(4000), 1000))
  drawn <- list(x = withr::with_seed(2, matrix(rnorm(400, 0, 0.2), 100)), weights = rep(0.01, 100))
  aside <- amiss:::leads_elsewhere(density, starts, drawn, seed = 1)
  expect_lt(length(aside$values), 20)
  expect_gt(min(aside$values), min(density(drawn$x)))
})

test_that("the mass of a normal peak is its closed form, and of a slope there is none", {
  root <- matrix(c(20, 0, 0, 7, 3, 0, -2, 5, 400), 3)
  density <- function(x) -0.5 * colSums((root %*% (t(x) - c(1, -1, 0.5)))^2)
  peak <- amiss:::peak_at(density, c(1, -1, 0.5), 0)
  expect_true(peak$converged)
  expect_equal(peak$log_mass, 1.5 * log(2 * pi) - log(det(root)), tolerance = 1e-6)
  beside <- c(1.5, -1, 0.5)
  expect_false(amiss:::peak_at(density, beside, density(rbind(beside)))$converged)
})
