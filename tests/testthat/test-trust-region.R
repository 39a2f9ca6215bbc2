# What a search does after a poor step, and what a trial is given before it is verified.

test_that("a step that fails shrinks the trusted distance to the least value of a parabola", {
  # It falls by 2 per way at first, promised 1 at its least value, and ends 2 higher: 1 / (2 + 2) of
  # the way.
  expect_equal(amiss:::shrinkage(1, -2), 1 / 4)
  # Of one that gained too little a third is left, of one that rose without bound or failed a tenth.
  expect_equal(amiss:::shrinkage(1, 0.1), 1 / rules$trust_changes)
  expect_equal(amiss:::shrinkage(1, -1e6), rules$least_shrinkage)
  expect_equal(amiss:::shrinkage(1, -Inf), rules$least_shrinkage)
})

test_that(paste("slopes are taken again after failures in a row, or once they have had as many",
                "steps as they cost"), {
  search <- list(failed = 0, poor = 0, since = 0, model = list(parameters = letters[1:5]))
  with <- function(...) amiss:::needs_slopes(utils::modifyList(search, list(...)))
  expect_false(with(since = 20))
  expect_true(with(failed = rules$renew_after))
  expect_false(with(poor = rules$renew_after, since = 4))
  expect_true(with(poor = rules$renew_after, since = 5))
})

test_that("new slopes do not make a step longer than three times what was trusted", {
  m <- linear_measurements()
  model <- amiss:::new_model(list(linear_simulator()), list(amiss:::loop_record(m, quick_ais)))
  context <- amiss:::new_context(1, 1, list())
  model <- amiss:::with_runs(model, rbind(c(1, 1)), context)$model
  search <- amiss:::begin_search(model, 1, matrix(0, nrow(model$runs$outputs), 2), 0)
  search[c("trusted", "poor", "since")] <- list(0.2, 3, 4)
  renewed <- amiss:::renew_slopes(search, context)
  expect_equal(renewed$trusted, 0.6)
  expect_equal(unlist(renewed[c("poor", "since")], use.names = FALSE), c(0, 0))
})

test_that("runs of the model before do not fill the region of its extension", {
  m <- linear_measurements()
  context <- amiss:::new_context(1, 1, list())
  model <- amiss:::new_model(list(linear_simulator()), list(amiss:::loop_record(m, quick_ais)))
  z <- rbind(c(0, 0), c(0, 0.1), c(0.1, 0), c(0.1, 0.1))
  model <- amiss:::with_runs(model, z, context)$model
  model$region <- amiss:::new_region(c(0, 0), diag(2), 1, model$parameters)
  expect_equal(sum(amiss:::fills(model)), 4)
  model$off <- c(gain = 0)
  expect_equal(amiss:::fills(model), c(FALSE, TRUE, FALSE, TRUE))
})

test_that("a trial that its runs do not confirm is checked again, once, before it is verified", {
  models <- small_upgrade()$models
  trial <- c(models[[2]], list(level = "tried", taken = 0))
  present <- models[[1]]
  asks <- function(factor, ...)
    amiss:::asks_for_checks(utils::modifyList(trial, list(...)), present,
                            list(factor = factor, standing = -Inf))
  trial$fit$check$effective <- 0.5
  low <- amiss:::log10_factor(trial, present) - amiss:::doubt_of(trial, present)
  expect_true(asks(low + 1))
  expect_false(asks(low - 1))  # it will be verified whatever they say
  expect_false(asks(low + 1, rechecked = TRUE))
  trial$fit$check$effective <- 0.9
  expect_false(asks(low + 1))
})

test_that("a model at a lower mode than its run of least squares is searched again from there", {
  # Two places fit the amplitude; a small term says which is right.
  data <- linear_data(200)
  data$Ti <- 20 + 0.36 * data$Te + 0.012 * data$Gv * 0.6 + 0.1 * cos(1.7 * data$hour)
  m <- linear_measurements(data)
  simulator <- function_simulator(function(v, d) {
    v[["offset"]] + v[["a"]]^2 * d[, "Te"] + 0.012 * v[["a"]] * d[, "Gv"]
  }, free("offset", uniform(10, 30)), free("a", uniform(-1, 1)), boundary = c("Te", "Gv"))
  model <- amiss:::new_model(list(simulator), list(amiss:::loop_record(m, quick_ais)))
  context <- amiss:::new_context(1, 1, list(calibration = quick_ais))
  found <- function(model, a) {
    made <- amiss:::with_runs(model, rbind(c(0, a * sqrt(3))), context)
    slopes <- amiss:::difference_slopes(made$model, made$at, context)
    amiss:::run_search(amiss:::begin_search(slopes$model, made$at, slopes$slopes, 0, steps = 3),
                       context)
  }
  right <- found(model, 0.6)
  wrong <- found(right$model, -0.6)
  model <- amiss:::with_modes(wrong$model, list(wrong), 1)
  model$least <- right$least
  model <- amiss:::with_local_runs(model, 20, context)
  at_wrong <- amiss:::posterior_of(model, context, amiss:::rough_ais)
  checked <- amiss:::check_by_runs(at_wrong$model, at_wrong$fits, 4, context)
  expect_gt(amiss:::straight_distance(checked$model)[model$least$at], 1)
  expect_true(amiss:::misses_least(checked$model, checked$fits))
  moved <- amiss:::moved_to_least(checked$model, context)
  expect_lte(amiss:::straight_distance(moved)[moved$least$at], 1)
  expect_false(amiss:::misses_least(moved, checked$fits))
})

test_that("a search goes on if the bent line gains nearer than where its optimum was sought", {
  m <- linear_measurements()
  model <- amiss:::new_model(list(linear_simulator()), list(amiss:::loop_record(m, quick_ais)))
  context <- amiss:::new_context(1, 1, list())
  model <- amiss:::with_runs(model, rbind(c(1, 1)), context)$model
  slopes <- amiss:::difference_slopes(model, 1, context)
  search <- amiss:::begin_search(slopes$model, 1, slopes$slopes, slopes$stale)
  of <- function(gains) {
    asked <- numeric()
    stand_in(optimum_of_bend = function(search, bent, line, best, within, context) {
      asked <<- c(asked, within)
      list(z = c(0.5, 0.5), gain = gains[length(asked)], from = 1e4, length = min(within, 2))
    })
    found <- amiss:::propose(search, context)
    list(asked = asked, status = found$status, predicted = found$predicted)
  }
  # Each time a tenth of the way that was too far.
  expect_equal(of(c(-5, -1, 300)), list(asked = c(Inf, 0.2, 0.02), status = "going",
                                        predicted = 300))
  # No gain at a thousandth of the way: none is left.
  expect_equal(of(c(-5, -1, -0.1, -0.01))$status, "converged")
})
