# Faults of a record that only the base model's error shows, in worlds with nothing hidden.

suspect_room <- function(fault = identity, edit = identity, noise = 0.1) {
  data <- withr::with_seed(4, {
    w <- synthetic_weather(days = 8, seed = 4)
    w <- w[w$hour %% 1 == 0, ]
    transform(w, Ti = 18 + 0.5 * Te + 0.004 * Gv, noise = rnorm(nrow(w), sd = noise))
  })
  data <- fault(data)
  data$Ti <- data$Ti + data$noise
  edit(data)
}

suspect_model <- function() {
  function_simulator(function(values, drivers) {
    values[["o"]] + values[["g"]] * drivers[, "Te"] + values[["s"]] * drivers[, "Gv"]
  }, free("o", uniform(15, 21)), free("g", uniform(0, 1)), free("s", uniform(0, 0.02)),
     boundary = c("Te", "Gv"))
}

suspected <- function(data, ...) {
  m <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
                    unit = "K", ...)
  quick <- list(calibration = list(ais = list(pilot_chains = 24, groups = 4)),
                attribution = list(surrogates = 19))
  upgrade_model(suspect_model(), m, catalogue(), control = quick, seed = 1, quiet = TRUE)
}

expect_suspect <- function(data, id, column, says, ...) {
  upgrade <- suspected(data, ...)
  found <- upgrade$models[[1]]$suspects
  expect_identical(found[c("id", "column")], data.frame(id = id, column = column))
  expect_match(found$says, says)
  invisible(upgrade)
}

late <- function(v, rows) v[pmin(pmax(seq_along(v) - rows, 1), length(v))]

test_that("a clean record is not suspected", {
  upgrade <- suspected(suspect_room())
  expect_null(upgrade$models[[1]]$suspects)
  expect_length(summary(upgrade)$record, 0)
})

test_that("the clock of the target is suspected, and said before all else", {
  upgrade <- expect_suspect(
    suspect_room(function(d) transform(d, Ti = late(Ti, 1))), "clock", "Ti",
    "The clock of Ti seems to be 1.0 h behind.*falls from 0.\\d+ to 0.[01]\\d* K")
  expect_match(summary(upgrade)$headline, "^Correct the record first: it has clocks that differ")
  expect_match(printed(upgrade), "the record itself has clocks that differ.*The clock of Ti")
  expect_match(printed(summary(upgrade)), "Faults of the record: The clock of Ti")
})

test_that("the clock of one driver is suspected, by steps or by a day", {
  expect_suspect(suspect_room(edit = function(d) transform(d, Gv = late(Gv, 2))), "clock", "Gv",
                 "Gv seems to be 2.0 h behind")
  expect_suspect(suspect_room(edit = function(d) transform(d, Gv = late(Gv, -24))), "clock", "Gv",
                 "24 h ahead of")
})

test_that("daylight saving in one column is suspected", {
  changed <- function(v) ifelse(seq_along(v) > 90, late(v, 1), v)
  expect_suspect(suspect_room(function(d) transform(d, Ti = changed(Ti))), "daylight", "Ti",
                 "Ti seems to be 1.0 h behind that of the rest from hour [89]\\d")
})

test_that("a start that is not forgotten, and a step, are suspected", {
  expect_suspect(suspect_room(function(d) transform(d, Ti = Ti + 2 * exp(-hour / 8))), "start",
                 "Ti", "decays from the first row.*warmup of \\d+")
  expect_suspect(suspect_room(function(d) transform(d, Ti = Ti + 0.8 * (hour > 77))), "step_change",
                 "Ti", "From hour 78 on, Ti lies 0.[78]\\d K higher")
})

test_that("a driver whose sensor ends or is coarse is suspected", {
  expect_suspect(suspect_room(edit = function(d) transform(d, Gv = pmin(Gv, 0.6 * max(Gv)))),
                 "range_end", "Gv", "as at the end of its sensor's range")
  expect_suspect(suspect_room(edit = function(d) transform(d, Te = 1.2 * round(Te / 1.2))),
                 "quantised", "Te", "Te comes in steps of 1.2, which moves the simulation by 0.1")
})

test_that("what a mechanism explains decisively better is no fault of the record", {
  slow <- mechanism("mass", boundary = c("Te", "Gv"), sentence = "Mass is missing.",
                    edit = function(model) {
    with_parameters(model, free("tau", uniform(0.25, 10)), boundary = c("Te", "Gv"),
                    f = function(values, drivers, base) {
      for (name in c("Te", "Gv")) drivers[, name] <- lagged(drivers[, name], values[["tau"]])
      base(values, drivers = drivers)
    })
  })
  data <- suspect_room(
    function(d) transform(d, Ti = 18 + 0.5 * lagged(Te, 2) + 0.004 * lagged(Gv, 2)))
  m <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1)
  quick <- list(max_steps = 1, calibration = list(ais = list(pilot_chains = 24, groups = 4)),
                attribution = list(surrogates = 19))
  upgrade <- upgrade_model(suspect_model(), m, catalogue(slow), control = quick, seed = 1,
                           quiet = TRUE)
  expect_identical(upgrade$named_cause$mechanism, "mass")
  expect_null(upgrade$models[[1]]$suspects)
})

test_that("a fault of the record makes a mechanism likely", {
  upgrade <- small_upgrade()
  upgrade$measurements$findings <- data.frame(id = "stuck", column = "Te", rows = I(list(1:9)),
                                              value = 1, says = "Stuck.")
  own <- rejudged(upgrade)$models[[2]]
  expect_identical(own$verdict, "likely")
  expect_identical(own$doubts, c(record = "the record itself has a sensor that is stuck"))
  # A column that neither the loop nor the simulator reads does not.
  upgrade$measurements$findings$column <- "spare"
  expect_identical(rejudged(upgrade)$models[[2]]$verdict, "named")
})
