test_that("quantile and distribution function are inverse, truncated or not", {
  u <- c(0.001, 0.2, 0.5, 0.9, 0.999)
  for (prior in list(uniform(2, 5), normal(1, 2), normal(1, 2, lower = 0),
                     lognormal(0, 0.5, upper = 2), beta_prior(2, 3, 1, 4), triangular(0, 1, 5),
                     triangular(0, 0, 1))) {
    expect_equal(amiss:::prior_cdf(prior, amiss:::prior_quantile(prior, u)), u, tolerance = 1e-8)
    expect_true(all(diff(amiss:::prior_quantile(prior, u)) > 0))
  }
})

test_that("a truncated normal agrees with its closed form", {
  prior <- normal(0, 1, lower = 0.5, upper = 2)
  expect_equal(amiss:::prior_cdf(prior, 1), (pnorm(1) - pnorm(0.5)) / (pnorm(2) - pnorm(0.5)))
})

test_that("impossible priors are refused", {
  expect_error(uniform(2, 1), "lower < upper", class = "amiss_error_input")
  expect_error(uniform(1, 1), "lower < upper", class = "amiss_error_input")
  expect_error(uniform(0, Inf), "finite limits", class = "amiss_error_input")
  expect_error(normal(0, -1), class = "amiss_error_input")
  expect_error(normal(0, 1, lower = 50), "no mass", class = "amiss_error_input")
  expect_error(triangular(0, 6, 5), "mode", class = "amiss_error_input")
  expect_error(free("a", 3), "prior", class = "amiss_error_input")
})

test_that("labels tell parameters apart", {
  labels <- function(...) {
    parameters <- named_parameters(lapply(list(...),
                                          function(x) free(x[1], uniform(0, 1), "", x[2])))
    unname(distinct_labels(parameters))
  }
  expect_identical(labels(c("a", "a"), c("b", "gain"), c("c", "gain"), c("d", "a"), c("e", " ")),
                   c("a", "gain (b)", "gain (c)", "a (d)", "e"))
  expect_false(anyDuplicated(labels(c("a", "x"), c("b", "x"), c("c", "x (a)"))) > 0)
})

test_that("a posterior far out in a prior without limits has finite values", {
  parameters <- list(rate = free("rate", lognormal(5, 0.2)))
  values <- amiss:::unit_to_values(cbind(c(0, 0.5, 1)), parameters)
  expect_true(all(is.finite(values)))
  expect_equal(values[2, 1], exp(5), ignore_attr = TRUE)
  limited <- list(k = free("k", uniform(0, 3)))
  expect_identical(amiss:::unit_to_values(cbind(c(0, 1)), limited)[, 1], c(0, 3))
})
