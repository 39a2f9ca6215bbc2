# The search for the parameters by the simulator itself: slopes, steps, trials.

# ---- slopes

slopes_of_linear <- function(model) {
  # Of offset uniform(10, 30) and gain uniform(0, 1) for a standard deviation of the prior.
  te <- model$records[[1]]$measurements$raw$drivers[model$records[[1]]$rows, "Te"]
  cbind(offset = 20, gain = te) / (2 * sqrt(3))
}

test_that("slopes that a reference knows exactly at its own point are not changed there", {
  model <- run_model(linear_simulator(), linear_measurements(),
                     rbind(c(0, 0), c(0.5, 0), c(0.2, 0.4)))
  exact <- slopes_of_linear(model)
  reference <- list(z = model$runs$z[2, ], slopes = exact + 1, stale = 0)
  expect_equal(amiss:::secant_slopes(model, 2, reference), reference$slopes, tolerance = 1e-14)
})

test_that("one run corrects slopes of which nothing else is known as Broyden's update does", {
  model <- run_model(linear_simulator(), linear_measurements(), rbind(c(0, 0), c(0.5, -0.3)))
  start <- matrix(0.3, nrow(model$runs$outputs), 2)
  own <- amiss:::secant_slopes(model, 2, list(z = model$runs$z[2, ], slopes = start, stale = 1e3))
  way <- model$runs$z[1, ] - model$runs$z[2, ]
  missed <- model$runs$outputs[, 1] - model$runs$outputs[, 2] - start %*% way
  broyden <- start + missed %*% way / sum(way^2)
  # The reference is trusted by 1 / stale^2 = 1e-6 beside 1 / |way|^2 = 3.
  expect_equal(own, broyden, tolerance = 1e-6, ignore_attr = TRUE)
  # Of slopes that were exact at that run, s away, they turn by 2 c |s| and the simulator bends by c
  # |s|^2; a third order adds c |s|^3 / 3. So 4 parts of 5 + s^2 / 9 are the slopes'.
  part <- amiss:::secant_slopes(model, 2, list(z = model$runs$z[1, ], slopes = start, stale = 0))
  expect_equal(part, start + (broyden - start) * 4 / (5 + sum(way^2) / 9), tolerance = 1e-6,
               ignore_attr = TRUE)
})

test_that("the slopes of a linear simulator are exact once runs go along every coordinate", {
  z <- rbind(c(0, 0), c(0.05, 0.02), c(-0.03, 0.06))
  model <- run_model(linear_simulator(), linear_measurements(), z)
  exact <- slopes_of_linear(model)
  reference <- list(z = model$runs$z[1, ] + 1, slopes = 0 * exact + 3, stale = 1)
  # Runs 0.06 away have weights of 1e5: the reference keeps 1e-3 of what it had.
  own <- amiss:::secant_slopes(model, 1, reference)
  expect_equal(own, exact, tolerance = 1e-2, ignore_attr = TRUE)
  two <- run_model(linear_simulator(), linear_measurements(), z[1:2, ])
  expect_gt(max(abs(amiss:::secant_slopes(two, 1, reference) - exact)), 0.5)
  # A run that failed says nothing.
  broken <- failing(model, 3)
  expect_equal(amiss:::secant_slopes(broken, 1, reference),
               amiss:::secant_slopes(two, 1, reference))
})

test_that("differences give the slopes of a linear simulator, within the priors", {
  model <- run_model(linear_simulator(), linear_measurements(), rbind(c(1.73, -1.73)))
  found <- amiss:::difference_slopes(model, 1, search_context())
  expect_equal(found$slopes, slopes_of_linear(model), ignore_attr = TRUE)
  expect_equal(runs_of(found$model), 3)
  expect_true(all(abs(found$model$runs$z) <= sqrt(3)))
})

test_that("slopes that a simulator gives itself cost no run", {
  knows <- linear_simulator()
  class(knows) <- c("amiss_test_sloped", class(knows))
  gives <- function(simulator, values, drivers, step_h, hold = NULL, ...) {
    cbind(offset = 1, gain = drivers[, "Te"])
  }
  registerS3method("slopes", "amiss_test_sloped", gives, envir = asNamespace("amiss"))
  model <- run_model(knows, linear_measurements(), rbind(c(0.3, -0.2)))
  found <- amiss:::difference_slopes(model, 1, search_context())
  # Of flat priors the step from the unit to the parameter is exact.
  expect_equal(found$slopes, slopes_of_linear(model), tolerance = 1e-8, ignore_attr = TRUE)
  expect_equal(runs_of(found$model), 1)
})

test_that("where a small difference shows nothing, a larger one on both sides is taken", {
  coarse <- function_simulator(function(values, drivers) {
    round(8 * values[["step"]]) / 8 * drivers[, "Te"] + values[["offset"]]
  }, free("step", uniform(0, 1)), free("offset", uniform(10, 30)), boundary = "Te")
  model <- run_model(coarse, linear_measurements(), rbind(c(0, 0)))
  found <- amiss:::difference_slopes(model, 1, search_context())
  te <- slopes_of_linear(model)[, "gain"]
  # 0.5 is 0.144 of the width either way, one step of an eighth: 0.125 / 0.144 of the slope.
  expect_equal(found$slopes[, 1] / te, rep(0.125 / (0.5 / (2 * sqrt(3))), length(te)))
  expect_equal(runs_of(found$model), 1 + 2 + 2)
})

test_that("differences that the budget leaves no runs for give no slopes and no error", {
  context <- search_context(budget = 2)
  model <- run_model(linear_simulator(), linear_measurements(), rbind(c(0, 0)), context)
  found <- amiss:::difference_slopes(model, 1, context)
  expect_null(found$slopes)
  expect_equal(runs_of(found$model), 2)
  expect_null(amiss:::difference_slopes(found$model, 1, context)$slopes)
})

# ---- runs

test_that("no more runs are made than the budget has, of several records whole points", {
  made <- function(budget, records = 1) {
    context <- search_context(budget)
    m <- linear_measurements()
    model <- amiss:::new_model(rep(list(linear_simulator()), records),
                               rep(list(amiss:::loop_record(m, quick_ais)), records))
    model <- amiss:::with_runs(model, matrix(seq(-1, 1, length.out = 14), 7), context)$model
    c(runs_of(model), amiss:::runs_left(context))
  }
  expect_equal(made(9), c(7, 2))
  expect_equal(made(5), c(5, 0))
  expect_equal(made(5, records = 2), c(2, 1))
})

test_that("runs outside the limits are made at them", {
  model <- run_model(linear_simulator(), linear_measurements(), rbind(c(5, -5)))
  expect_equal(unname(model$runs$z[1, ]), c(1, -1) * sqrt(3))
  expect_equal(model$runs$outputs[, 1], rep(30, 240))  # offset 30, gain 0
})

# ---- searches

# Least squares in the simulator's own parameters, and how many nats a run lies below it.
nats_below_optimum <- function(model, at, m) {
  rows <- model$records[[1]]$rows
  best <- stats::lm.fit(cbind(1, m$raw$drivers[rows, "Te"]), m$y[rows])
  (sum((m$y[rows] - model$runs$outputs[, at])^2) - sum(best$residuals^2)) / (2 * m$noise_sd^2)
}

test_that("a search finds the least squares of a linear simulator by a run a step", {
  m <- linear_measurements()
  for (start in list(c(-1.5, 1.5), c(1.6, 1.2), c(0, 0))) {
    model <- run_model(linear_simulator(), m, rbind(start, start + c(0.3, 0), start + c(0, -0.3)))
    slopes <- matrix(0.1, 240, 2)  # wrong; the three runs know better
    search <- amiss:::begin_search(model, 1, slopes, stale = 1)
    search <- amiss:::run_search(search, search_context())
    expect_identical(search$status, "converged")
    # Converged is what predicts less than half a nat to gain.
    expect_lt(nats_below_optimum(search$model, search$at, m), 0.5)
    # Of a linear simulator the first step is nearly right and the second lands: two more may
    # confirm.
    expect_lte(runs_of(search$model) - 3, 5)
  }
})

test_that("two searches of a linear simulator end in one mode, by few runs in all", {
  m <- linear_measurements()
  found <- amiss:::find_modes(searched_model(linear_simulator(), m), search_context())
  expect_true(found$agree)
  expect_length(found$modes, 2)
  expect_lt(nats_below_optimum(found$model, found$modes[[1]]$at, m), 0.5)
  # Six over the priors, and two searches of five.
  expect_lte(runs_of(found$model), 6 + 2 * 5)
})

# Rates and amplitudes over two decades.
wide_simulator <- function(...) {
  function_simulator(function(values, drivers) {
    kept <- exp(-10^values[["rate"]])
    slow <- as.numeric(stats::filter((1 - kept) * drivers[, "Te"], kept, "recursive"))
    20 + 10^values[["gain"]] * slow + if ("offset" %in% names(values)) values[["offset"]] else 0
  }, ..., boundary = "Te", name = "wide")
}

wide_parameters <- list(free("rate", uniform(-2, 0)), free("gain", uniform(-2, 0)),
                        free("offset", normal(0, 1, -4, 4), "K"))

test_that("a simulator that bends over two decades is searched by the simulator itself", {
  simulator <- do.call(wide_simulator, wide_parameters)
  truth <- c(rate = -1.2, gain = -0.3, offset = 0.5)
  m <- measured_run(simulator, truth)
  found <- amiss:::find_modes(searched_model(simulator, m), search_context())
  expect_true(found$agree)
  mode <- found$modes[[1]]
  z <- found$model$runs$z[mode$at, ]
  unit <- vapply(names(truth), function(name) {
    amiss:::prior_cdf(found$model$parameters[[name]]$prior, truth[[name]])
  }, 0)
  apart <- z - amiss:::from_unit(rbind(unit), found$model$space)[1, ]
  # The truth is where the posterior may have it, and the mode within a nat of the optimum beside.
  expect_lt(sum(apart * solve(mode$covariance, apart)), stats::qchisq(0.9999, 3) + 2)
  # Scouts, and two searches of at most twenty steps, with slopes by differences.
  expect_lte(runs_of(found$model), 8 + 2 * 20 + 2 * 3)
})

test_that("a search takes no step to a run that fails, and says when it can go no further", {
  m <- linear_measurements()
  fragile <- linear_simulator()
  whole <- fragile$f
  fragile$f <- function(values, drivers) {
    whole(values, drivers) * if (values[["gain"]] > 0.3) NaN else 1
  }
  model <- run_model(fragile, m, rbind(c(0.5, -1.5), c(0.2, -1.5), c(0.5, -1.2)))
  search <- amiss:::begin_search(model, 1, amiss:::regression_slopes(model, 1), 1)
  search <- amiss:::run_search(search, search_context())
  expect_true(all(is.finite(search$model$runs$outputs[, search$at])))
  expect_lte(amiss:::unit_to_values(amiss:::to_unit(search$model$runs$z[search$at, , drop = FALSE],
                                                    model$space), model$parameters)[, "gain"], 0.3)
  expect_true(search$status %in% c("stalled", "steps", "slow", "converged"))
})

test_that("a search that the budget ends keeps its best run", {
  m <- linear_measurements()
  context <- search_context(budget = 4)
  z <- rbind(c(-1.5, 1.5), c(-1.2, 1.5), c(-1.5, 1.2))
  model <- run_model(linear_simulator(), m, z, context)
  search <- amiss:::run_search(amiss:::begin_search(model, 1, matrix(0.1, 240, 2), 1), context)
  expect_identical(search$status, "budget")
  expect_equal(runs_of(search$model), 4)
  expect_true(is.finite(sum(search$covariance)))
})

test_that("searches begin at the run nearest to the record and at near ones far from it", {
  m <- linear_measurements()
  z <- amiss:::from_unit(withr::with_seed(3, lhs::randomLHS(10, 2)),
                         space_of(uniform(0, 1), uniform(0, 1)))
  model <- run_model(linear_simulator(), m, z)
  misfit <- colMeans((model$runs$outputs[, seq_len(10)] - model$target)^2)
  starts <- amiss:::start_runs(model)
  expect_length(starts, 4)
  expect_equal(starts[1], which.min(misfit))
  apart <- sqrt(colSums((t(z) - z[starts[1], ])^2))
  far <- which(apart >= median(apart))
  expect_equal(starts[2], far[which.min(misfit[far])])
  # What failed is no start.
  expect_false(starts[1] %in% amiss:::start_runs(failing(model, starts[1])))
})

test_that("a search whose tangent overshoots is damped until it moves", {
  # At a = -0.05 the tangent points to a = -5, beyond the prior; the mode is at -0.6.
  m <- measured_run(squared_simulator(), c(a = 0.6))
  model <- run_model(squared_simulator(), m, rbind(-0.05 * sqrt(3)))
  context <- search_context()
  found <- amiss:::difference_slopes(model, 1, context)
  search <- amiss:::run_search(amiss:::begin_search(found$model, 1, found$slopes, 0), context)
  expect_equal(unname(search$model$runs$z[search$at, "a"]), -0.6 * sqrt(3), tolerance = 0.01)
})

# A ridge along v = 2 u^2, four hundred times as steep across as along.
curved_simulator <- function() {
  function_simulator(function(values, drivers) {
    20 + 5 * (values[["v"]] - 2 * values[["u"]]^2) * drivers[, "Te"] +
      0.5 * values[["u"]] * cos(seq_len(nrow(drivers)))
  }, free("u", normal(0, 1, -4, 4)), free("v", normal(0, 3, -12, 12)), boundary = "Te")
}

test_that("a curved ridge is followed to its mode", {
  skip_on_cran()  # second tier: tools/test --quick
  m <- measured_run(curved_simulator(), c(u = 1.2, v = 2.88))
  # On the ridge, at its other end: every straight step leaves it.
  model <- run_model(curved_simulator(), m, rbind(c(-1, 0.6)))
  context <- search_context()
  found <- amiss:::difference_slopes(model, 1, context)
  search <- amiss:::run_search(amiss:::begin_search(found$model, 1, found$slopes, 0), context)
  # As probable as the truth, to a nat; and along the ridge no farther from it than the record says:
  # its amplitude of 0.5 is known to 0.1 / (0.5 sqrt(120)) = 0.018 of u.
  run <- search$model$runs$outputs[, search$at]
  truth <- curved_simulator()$f(c(u = 1.2, v = 2.88), as.matrix(m$raw$drivers))
  nats <- (sum((m$y - run)^2) - sum((m$y - truth)^2)) / (2 * 0.1^2)
  expect_lt(nats, 1)
  expect_lt(abs(search$model$runs$z[search$at, "u"] - 1.2), 4 * 0.018)
  expect_lte(runs_of(search$model), 60)
})

test_that("log means of exponentials are exact where they would overflow", {
  expect_equal(amiss:::log_mean_exp(c(-1000, -1000)), -1000)
  expect_equal(amiss:::log_mean_exp(c(900, 900 + log(3))), 900 + log(2))
  expect_identical(amiss:::log_mean_exp(c(-Inf, -Inf)), -Inf)
})

test_that("Gaussians of several records add up, their common prior counted once", {
  # Two records of one parameter, each with precision 1 (prior) and 3 (data), pulled to 1 and 2.
  of <- function(mean) list(mean = 0.75 * mean, covariance = cbind(0.25))
  joint <- amiss:::joint_tangent(list(of(1), of(2)), list(1, 1), 1)
  expect_equal(joint$covariance, cbind(1 / 7))
  expect_equal(joint$mean, (3 * 1 + 3 * 2) / 7)
})

test_that("a search is the same on one thread and on two", {
  m <- linear_measurements()
  of <- function(threads) {
    set.seed(threads)  # whatever the session's own random numbers are
    found <- amiss:::find_modes(searched_model(linear_simulator(), m),
                                search_context(threads = threads))
    list(found$model$runs, lapply(found$modes, `[`, c("mean", "covariance", "status")))
  }
  expect_identical(of(1), of(2))
})

# ---- trials

# A mechanism that does nothing up to a third of its range.
late_simulator <- function() {
  function_simulator(function(values, drivers) {
    values[["offset"]] + max(0, values[["amount"]] - 0.3) * drivers[, "Te"]
  }, free("offset", uniform(0, 50)), free("amount", uniform(0, 1)), boundary = "Te")
}

test_that("a trial whose first search leads no nearer to the record goes on from the next start", {
  simulator <- late_simulator()
  m <- measured_run(simulator, c(offset = 20, amount = 0.7))
  z <- amiss:::from_unit(rbind(c(0.42, 0), c(0.42, 0.6)), space_of(uniform(0, 1), uniform(0, 1)))
  model <- run_model(simulator, m, z)
  start <- function(at)
    list(at = at, slopes = amiss:::difference_slopes(model, at, search_context())$slopes)
  looked <- list(model = model, off_at = 1, starts = list(start(1), start(2)))
  found <- amiss:::search_trial(looked, search_context())
  amount <- amiss:::unit_to_values(
    amiss:::to_unit(found$model$runs$z[found$least$at, , drop = FALSE], model$space),
    model$parameters)[, "amount"]
  # Known to the noise of 0.1 over the 5 degrees by which the weather varies, in a hundred hours and
  # more.
  expect_equal(amount, 0.7, tolerance = 0.02, ignore_attr = TRUE)
  # Nothing is nearer than itself.
  expect_false(amiss:::comes_nearer(model, 1, 1))
  expect_true(amiss:::comes_nearer(found$model, found$least$at, 1))
  expect_true(amiss:::comes_nearer(model, 1, NULL))
})

test_that("the second start of a trial has the mechanism on", {
  # Searches that end where they begin: only the third run is nearer to the record.
  begun <- integer()
  stand_in(run_search = function(search, context) {
    begun <<- c(begun, search$at)
    utils::modifyList(search, list(status = "converged", least = list(at = search$at)))
  }, values_at = function(model, at, ...) -amiss:::squared_misfit(model)[at])
  model <- list(target = rep(0, 9), noise = rep(1, 9), space = space_of(uniform(0, 1)))
  model$runs <- amiss:::new_runs(model, matrix(0, 4, 1), outer(rep(1, 9), c(9, 9, 1, 8)),
                                 matrix(0, 0, 4))
  starts <- lapply(c(2, 1, 3, 4), function(at) list(at = at, slopes = matrix(0, 9, 1)))
  found <- amiss:::search_trial(list(model = model, off_at = 1, starts = starts), search_context())
  expect_equal(begun, c(2, 3))
  expect_equal(found$at, 3)
  # If the mechanism is switched off where the search is most promising, it begins there.
  begun <- integer()
  amiss:::search_trial(list(model = model, off_at = 1, starts = starts[c(2, 1, 3)]),
                       search_context())
  expect_equal(begun, c(1, 2))
})

test_that("directions that are known ten million times better than others can be solved", {
  fine <- diag(c(1, 1e-6))
  expect_identical(amiss:::conditioned(fine), fine)
  flat <- diag(c(1, 1e-20))
  expect_error(solve(flat), "singular")
  expect_equal(solve(amiss:::conditioned(flat))[1, 1], 1)
  # Least squares of a simulator that moves the output by 1e9 noises, and by almost none.
  model <- list(target = c(1, 0), noise = c(1e-9, 1e-9),
                space = space_of(uniform(0, 1), uniform(0, 1)))
  line <- list(output = c(0, 0), slopes = diag(c(1, 1e-10)))
  found <- amiss:::squares_of_line(list(model = model, weighted = FALSE), c(0, 0), line)
  expect_equal(found$mean[1], 1, tolerance = 1e-6)
  expect_true(all(is.finite(solve(amiss:::conditioned(found$precision)))))
})

test_that("least squares that take all steps leave half of them for the mode of the posterior", {
  curved <- function_simulator(function(values, drivers) {
    values[["offset"]] + exp(3 * values[["gain"]]) * drivers[, "Te"] / 8
  }, free("offset", uniform(10, 30)), free("gain", uniform(0, 1)), boundary = "Te")
  data <- linear_data()
  data$Ti <- data$Ti + 0.02 * data$Gv
  model <- run_model(curved, linear_measurements(data),
                     rbind(c(-1.5, 1.5), c(-1.2, 1.5), c(-1.5, 1.2)))
  found <- amiss:::run_search(
    amiss:::begin_search(model, 1, amiss:::regression_slopes(model, 1), 1, steps = 4),
    search_context())
  # After four steps of least squares another 1.3 nats are promised.
  expect_identical(found$status, "converged")
  expect_equal(runs_of(found$model), 8)
})
