# The first look at a simulator.

look_record <- function() {
  hour <- 1:96
  data <- data.frame(hour = hour, Te = 10 + 5 * sin(hour / 4))
  data$Ti <- 20 + 0.4 * data$Te + 0.1 * cos(hour * 1.7)
  measurements(data, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1, warmup = 12)
}

# Forgets its start at a rate; `idle` does nothing.
decaying <- function(rate = 0.2) {
  function_simulator(function(values, drivers) {
    20 + values[["gain"]] * drivers[, "Te"] + 5 * exp(-rate * seq_len(nrow(drivers)))
  }, free("gain", uniform(0, 1)), free("idle", uniform(0, 1)), boundary = "Te")
}

test_that("time, parameters that act, and the start are looked at, with few runs", {
  look <- try_run(decaying(), look_record())
  expect_equal(c(look$runs_made, look$runs_found), c(1 + 2 * 2 + 2, 0))
  expect_null(look$failed)
  expect_identical(look$parameters$acts, c(TRUE, FALSE))
  expect_equal(look$parameters$over_noise[1], 0.8 * sqrt(mean((10 + 5 * sin(13:96 / 4))^2)) / 0.1)
  # 5 (exp(-0.2 k) - exp(-0.2 (k + 32))) is 0.1 at k = 19.6: the rows until then differ by more than
  # the noise.
  expect_equal(look$start$rows, 19)
  expect_false(look$start$settled)  # the warm-up is 12 h
  expect_equal(look$study_s, 200 * look$seconds)
  expect_match(printed(look),
               "gain.*\"idle\" does not act.*forgotten after 19 rows.*12 h are run before.*give")
  expect_lte(length(utils::capture.output(print(look))), 15)
})

test_that("a start that is forgotten, one that is not, and a run that fails are told", {
  expect_true(try_run(decaying(1), look_record())$start$settled)
  slow <- try_run(decaying(0.005), look_record())
  expect_identical(slow$start$rows, NA)
  expect_match(printed(slow), "not forgotten within 64 rows")
  broken <- function_simulator(function(values, drivers) if (values[["a"]] > 0) stop("no weather"),
                               free("a", uniform(1, 2)))
  look <- try_run(broken, look_record())
  expect_match(look$failed, "no weather")
  expect_match(printed(look), "first run failed.*no weather")
  expect_null(look$parameters)
  edge <- function_simulator(
    function(values, drivers) values[["a"]] + 0 / (values[["a"]] < 1.9) * drivers[, "Te"],
    free("a", uniform(1, 2)), free("b", uniform(1, 2)), boundary = "Te")
  edge$f <- function(values, drivers)
    if (values[["a"]] > 1.8) NaN * drivers[, "Te"] else values[["a"]] * drivers[, "Te"]
  look <- try_run(edge, look_record())
  expect_identical(look$parameters$acts, c(NA, FALSE))
  expect_match(printed(look), "fail at low or high \"a\"")
})

test_that("it works for a zone, and for a program whose runs are kept", {
  table <- data.frame(hour = 1:48, Te = 5 + 3 * sin(1:48 / 4), P = 100)
  table$Ti <- 20 + 0.3 * table$Te + 0.05 * cos(1:48 * 1.7)
  m <- suppressWarnings(measurements(table, time = "hour", target = "Ti", boundary = ~ Te + P,
                                     noise_sd = 0.1))
  room <- zone(zone_heater("heater", "P"),
               zone_infiltration("leak", free("ach", uniform(0.5, 2)), "Te"), volume = 10)
  expect_true(try_run(room, m)$parameters$acts)
  skip_on_os("windows")
  rule <- c("BEGIN { FS = \",\"; print \"Ti\" }", "NR > 1 { print 20 + {{gain}} * $3 }")
  program <- program_simulator(
    c("awk", "-f", "model.awk", "drivers.csv"), free("gain", uniform(0, 2)), boundary = "Te",
    output = c(file = "stdout.txt", column = "Ti"), templates = list(model.awk = I(rule)),
    cache = withr::local_tempdir(), name = "room by awk")
  look <- try_run(program, m)
  expect_equal(look$runs_made + look$runs_found, 5)
  again <- try_run(program, m)
  expect_equal(again$runs_made, 0)
  expect_gt(again$seconds, 0)
  expect_match(printed(again), "room by awk.*0 runs made, 5 found.*start is forgotten after 0 rows")
})
