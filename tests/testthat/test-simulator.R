drivers <- cbind(Te = c(1, 2, 4, 8), Gv = c(0, 1, 0, 1))
gain <- free("gain", uniform(0, 2))

test_that("a function is given what it asks for", {
  seen <- NULL
  f <- function(values, drivers, info) {
    seen <<- info
    values[["gain"]] * drivers[, "Te"]
  }
  record <- data.frame(hour = c(1:30, 41:70), Te = 1:60, Ti = (1:60) / 2)
  m <- suppressMessages(suppressWarnings(
    measurements(record, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1, warmup = 3)))
  simulate_design(function_simulator(f, gain, boundary = "Te"), m, runs = 5, seed = 1)
  expect_equal(seen$step_h, 1)
  expect_equal(seen$time, 41:70)
  expect_equal(seen$segment, 2)
  expect_equal(seen$hold, c(31:33 / 2, rep(NA, 27)))
  # Without a record the time counts from the first row.
  simulate_runs(function_simulator(f, gain, boundary = "Te"), cbind(gain = 1), drivers,
                step_h = 0.5)
  expect_equal(seen$time, c(0.5, 1, 1.5, 2))
  expect_true(all(is.na(seen$hold)))
})

test_that("functions of two arguments go on working, others are refused with a word", {
  run <- function(f)
    simulate_runs(function_simulator(f, gain), cbind(gain = c(0.5, 1)), drivers, step_h = 1)
  expect_equal(run(function(v, d) v[["gain"]] * d[, "Te"]),
               unname(cbind(drivers[, "Te"] / 2, drivers[, "Te"])))
  expect_equal(run(function(v, d, scale = 3) scale * v[["gain"]] * d[, 1])[, 2], 3 * drivers[, 1])
  expect_equal(run(function(values, drivers, ...) rep(list(...)$info$step_h, 4))[, 1], rep(1, 4))
  expect_error(run(function(v) 1), "values and drivers", class = "amiss_error_input")
  expect_error(run(function(v, d, i) 1), "\"?i`? ?.*nothing is known to give",
               class = "amiss_error_input")
  expect_error(run(function(v, d, base) 1), "base", class = "amiss_error_input")
})

test_that("what a function returned is shown, and for which values", {
  run <- function(f, values = cbind(gain = c(0.25, 1)))
    simulate_runs(function_simulator(f, gain), values, drivers, step_h = 1)
  expect_error(run(function(v, d) c(1.5, 2)),
               "returned 2 values.*At gain = 0.25 it returned: num \\[1:2\\] 1.5 2",
               class = "amiss_error_input")
  expect_error(run(function(v, d) letters[1:4]), "<character>.*chr \\[1:4\\] \"a\"",
               class = "amiss_error_input")
  expect_error(run(function(v, d) list(a = 1)), "<list>", class = "amiss_error_input")
  # One word for all runs that stop.
  expect_warning(out <- run(function(v, d) if (v[["gain"]] < 0.5) stop("no {root}") else d[, "Te"]),
                 "1 of 2 runs.*Run 1 at gain = 0.25: no \\{root\\}", class = "amiss_warning_input")
  expect_equal(is.nan(out[1, ]), c(TRUE, FALSE))
  m <- linear_measurements()
  late <- function_simulator(function(v, d) c(rep(NA, 5), d[-(1:5), "Te"]), gain, boundary = "Te")
  expect_error(simulate_design(late, m, runs = 8, seed = 1), "gain = .*: its row 1 is NA",
               class = "amiss_error_input")
})

test_that("edits with a base stack in any order", {
  # What it is given are its drivers alone.
  model <- function_simulator(function(values, drivers) values[["gain"]] * rowSums(drivers), gain,
                              boundary = "Te")
  sun <- function(model) {
    with_parameters(model, free("sun", uniform(0, 1)), boundary = "Gv",
                    f = function(values, drivers, base)
                      base(values) + values[["sun"]] * drivers[, "Gv"])
  }
  # Acts on what drives the model, and on the time.
  offset <- function(model) {
    with_parameters(model, free("offset", uniform(0, 1)),
                    f = function(values, drivers, info, base) {
      drivers[, "Te"] <- drivers[, "Te"] + values[["offset"]]
      base(values, drivers) + info$step_h
    })
  }
  values <- cbind(gain = 2, sun = 10, offset = 0.5)
  expected <- 2 * (drivers[, "Te"] + 0.5) + 10 * drivers[, "Gv"] + 3
  for (edited in list(sun(offset(model)), offset(sun(model)))) {
    expect_setequal(names(free_parameters(edited)), c("gain", "sun", "offset"))
    expect_setequal(driver_names(edited), c("Te", "Gv"))
    expect_equal(simulate_runs(edited, values, drivers[, driver_names(edited)], step_h = 3)[, 1],
                 expected)
  }
  # Edits that call the function of the model itself go on working on top of it.
  called <- sun(model)$f(c(gain = 2, sun = 10), drivers)
  expect_equal(called, 2 * drivers[, "Te"] + 10 * drivers[, "Gv"])
  # Kept results know one edit from the other.
  brighter <- with_parameters(model, free("sun", uniform(0, 1)), boundary = "Gv",
                              f = function(values, drivers, base)
                                base(values) + 2 * values[["sun"]] * drivers[, "Gv"])
  expect_false(identical(amiss:::plain(sun(model)), amiss:::plain(brighter)))
  expect_identical(amiss:::plain(sun(model)), amiss:::plain(sun(model)))
})

test_that("an edit that changes drivers which the simulator before it does not read is refused", {
  model <- function_simulator(function(values, drivers) values[["gain"]] * drivers[, "Te"], gain,
                              boundary = "Te")
  shaded <- function(change) {
    with_parameters(model, free("shade", uniform(0, 1)), boundary = "Gv",
                    f = function(values, drivers, base) {
      base(values, change(drivers, values[["shade"]]))
    })
  }
  run <- function(change)
    simulate_runs(shaded(change), cbind(gain = 2, shade = 0.5), drivers, step_h = 1)
  expect_error(
    run(function(drivers, by) replace(drivers, TRUE, cbind(drivers[, "Te"], by * drivers[, "Gv"]))),
    "\"Gv\" of its own.*does not read.*It reads \"Te\"", class = "amiss_error_input")
  expect_error(run(function(drivers, by) cbind(drivers, shade = by)), "\"shade\"",
               class = "amiss_error_input")
  expect_error(run(function(drivers, by) drivers[, "Gv", drop = FALSE]), "no column.*Te",
               class = "amiss_error_input")
  expect_equal(run(function(drivers, by) drivers),
               run(function(drivers, by) drivers[, "Te", drop = FALSE]))
})

test_that("parameters without a function reach the one that was there first, in any order", {
  # A door: the model leaks if it is told how much.
  model <- function_simulator(function(values, drivers) {
    leak <- if ("leak" %in% names(values)) values[["leak"]] else 0
    values[["gain"]] * drivers[, "Te"] - leak
  }, gain, boundary = "Te")
  leak <- function(model) with_parameters(model, free("leak", uniform(0, 1)))
  sun <- function(model) {
    with_parameters(model, free("sun", uniform(0, 1)), boundary = "Gv",
                    f = function(values, drivers, base)
                      base(values) + values[["sun"]] * drivers[, "Gv"])
  }
  values <- cbind(gain = 2, sun = 10, leak = 0.5)
  expected <- 2 * drivers[, "Te"] + 10 * drivers[, "Gv"] - 0.5
  run <- function(edited)
    simulate_runs(edited, values, drivers[, driver_names(edited)], step_h = 1)[, 1]
  expect_equal(run(sun(leak(model))), expected)
  expect_equal(run(leak(sun(model))), expected)
  expect_equal(run(leak(sun(sun(model)))), expected + 10 * drivers[, "Gv"])
  expect_false(identical(amiss:::plain(leak(sun(model))), amiss:::plain(sun(model))))
})

test_that("parameters of an extended model are checked", {
  model <- function_simulator(function(values, drivers) drivers[, 1], gain, boundary = "Te")
  expect_error(with_parameters(model, free("gain", uniform(0, 3))), "in the model already",
               class = "amiss_error_input")
  expect_s3_class(with_parameters(model, gain), "amiss_function_simulator")
  expect_error(with_parameters(model), "made by", class = "amiss_error_input")
  expect_error(with_parameters("model", gain), "model", class = "amiss_error_input")
  expect_error(function_simulator(model$f, gain, gain), "declared twice",
               class = "amiss_error_input")
})

test_that(paste("a run that returns NA throughout has failed, and what the function was given is",
                "told with its error"), {
  runs <- function(f) {
    s <- function_simulator(f, free("gain", uniform(0, 1)), boundary = "Te")
    simulate_runs(s, cbind(gain = c(0.2, 0.8)), cbind(Te = 1:5), 1)
  }
  made <- runs(
    function(values, drivers) if (values[["gain"]] > 0.5) rep(NA, 5) else drivers[, "Te"])
  expect_identical(colSums(is.na(made)), c(0, 5))
  expect_warning(runs(function(values, drivers) drivers[, "Gv"]),
                 "parameters gain and the columns Te", class = "amiss_warning_input")
  expect_error(runs(function(values, drivers) rep(NA, 4)), "5 numbers were expected",
               class = "amiss_error_input")
})

test_that("a subscript that fails says what to write", {
  run <- function(f)
    simulate_runs(function_simulator(f, free("k", uniform(0, 1)), boundary = "Te"), cbind(k = 0.5),
                  cbind(Te = 1:3), step_h = 1)
  expect_warning(run(function(values, drivers) drivers[, "Gv"]), "only if `boundary` names it")
  expect_warning(run(function(values, drivers) values[["h"]] * drivers[, "Te"]),
                 "a parameter only if `free\\(\\)`")
  expect_warning(run(function(values, drivers) values$k * drivers[, "Te"]),
                 "`values\\[\\[\"k\"\\]\\]`")
  expect_warning(run(function(values, drivers) drivers$Te), "drivers a matrix")
})
