# The modes of a posterior: what searches from several starts lead to.

test_that("a record with two modes is not told as one: searches find both, or do not agree", {
  m <- measured_run(squared_simulator(), c(a = 0.6))
  for (seed in 1:4) {
    context <- amiss:::new_context(seed, 1, list())
    found <- amiss:::find_modes(searched_model(squared_simulator(), m), context)
    ends <- vapply(found$modes, function(mode) found$model$runs$z[mode$at, "a"], 0)
    region <- amiss:::region_of_modes(found$model, found$modes, seed)
    both <- all(amiss:::in_region(region, cbind(c(0.2, 0.8))))
    expect_true(both || !found$agree,
                label = paste("both modes, or a word of doubt, of seed", seed))
  }
})

test_that("modes of one height are held by one region; one with a valley before it is another", {
  m <- measured_run(squared_simulator(), c(a = 0.6))
  z <- 0.6 * sqrt(3)
  model <- run_model(squared_simulator(), m, cbind(c(z, -z)))
  context <- search_context()
  modes <- lapply(1:2, function(at) {
    found <- amiss:::difference_slopes(model, at, context)
    amiss:::run_search(amiss:::begin_search(model, at, found$slopes, 0, steps = 0), context)
  })
  ranked <- amiss:::ranked_modes(model, modes, context)
  # They are mirror images: equal but for rounding of the run.
  expect_lt(abs(ranked$modes[[1]]$value - ranked$modes[[2]]$value), 0.01)
  held <- function(modes) {
    sum(amiss:::in_region(amiss:::region_of_modes(model, modes, 1), cbind(c(0.2, 0.8))))
  }
  expect_equal(held(ranked$modes), 2)
  # One that is lower is another mode if what lies between is lower still, at the cost of a run.
  lower <- ranked$modes[[2]]
  lower$value <- lower$value - 5
  apart <- amiss:::is_same_mode(model, ranked$modes[[1]], lower, context)
  expect_false(apart$yes)
  expect_equal(runs_of(apart$model), runs_of(model) + 1)
  # One that is far less probable does not count.
  lower$value <- lower$value - 15
  expect_equal(held(list(ranked$modes[[1]], lower)), 1)
})

test_that("where a posterior has two modes, draws lie at both or the result says so", {
  skip_on_cran()  # second tier: tools/test --quick
  m <- measured_run(squared_simulator(), c(a = 0.6))
  for (seed in 1:4) {
    fit <- calibrate_refined(simulate_design(squared_simulator(), m, 6, seed = seed), m,
                             control = list(calibration = quick_ais), seed = seed)
    upper <- sum(fit$weights[fit$values[, "a"] > 0])
    # Each has half; the quick sampler of 200 chains that merge may be off by a third.
    expect_true(!fit$trust$trusted || isFALSE(fit$modes$agree) || (upper > 0.15 && upper < 0.85),
                label = paste("both modes, or a word of doubt, of seed", seed))
    # The record holds |a| to 0.001.
    expect_equal(sum(fit$weights * abs(fit$values[, "a"])), 0.6, tolerance = 0.01)
  }
})

test_that("modes are compared by the same draws, and a ridge is one mode", {
  m <- linear_measurements()
  context <- search_context()
  found <- amiss:::find_modes(searched_model(linear_simulator(), m), context)
  ranked <- amiss:::ranked_modes(found$model, rev(found$modes), context)
  values <- vapply(ranked$modes, `[[`, 0, "value")
  expect_false(is.unsorted(-values))
  expect_equal(values, vapply(found$modes, `[[`, 0, "value"), tolerance = 1e-8)
  expect_true(ranked$agree)
  # If a budget allowed one search alone, it has one mode.
  alone <- amiss:::ranked_modes(found$model, found$modes[1], context)
  expect_length(alone$modes, 1)
  expect_false(alone$agree)
})

# ---- of a model that is adopted

# A loop over one mechanism that adds f() to a linear simulator; the sun gives 0.01 K for a W/m2.
adopting <- function(f, ...) {
  table <- linear_data(60)
  table$Ti <- table$Ti + 0.01 * table$Gv
  m <- linear_measurements(table, calibrate = table$hour <= 42, validate = table$hour > 42)
  sun <- mechanism("sun", boundary = "Gv", sentence = "It acts.", edit = function(model) {
    with_parameters(model, ..., boundary = "Gv",
                    f = function(values, drivers, base) base(values) + f(values) * drivers[, "Gv"])
  })
  control <- list(max_steps = 1, calibration = quick_ais,
                  attribution = list(surrogates = 19))
  upgrade <- upgrade_model(linear_simulator(), m, catalogue(sun), control = control, seed = 1,
                           quiet = TRUE)
  upgrade$models[[2]]$fit
}

test_that("a second search confirms the mode of a model that is adopted", {
  fit <- adopting(function(values) values[["s"]], free("s", uniform(0, 0.02)))
  expect_identical(fit$modes[c("agree", "searches")], list(agree = TRUE, searches = 2L))
  expect_true(fit$trust$trusted)
})

test_that("the mirror image of its mode is found, or the model is not trusted", {
  fit <- adopting(function(values) 0.02 * values[["s"]]^2, free("s", uniform(-1, 1)))
  upper <- sum(fit$weights[fit$values[, "s"] > 0])
  # Each has half; the quick sampler may be off by a third.
  expect_true(!fit$trust$trusted || (upper > 0.15 && upper < 0.85))
  expect_equal(sum(fit$weights * abs(fit$values[, "s"])), sqrt(0.5), tolerance = 0.02)
})
