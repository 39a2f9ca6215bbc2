# What a record shows by itself: faults are found, and what is natural for a condition is none.

# A record of 12 days by hour, with edits of its columns.
weather <- function(...) {
  data <- withr::with_seed(5, {
    hour <- 1:288
    Te <- 8 + 5 * sin(2 * pi * hour / 24) + as.numeric(stats::filter(rnorm(288), 0.9, "recursive"))
    Gv <- pmax(0, 500 * sin(2 * pi * (hour - 6) / 24)) * runif(288, 0.3, 1)
    data.frame(hour, Te, Gv, Wd = cumsum(rnorm(288, 0, 25)) %% 360,
               Ti = 18 + 0.5 * Te + 0.004 * Gv + rnorm(288, 0, 0.1))
  })
  edits <- list(...)
  for (name in names(edits)) data[[name]] <- edits[[name]](data[[name]])
  data
}

measure <- function(data, boundary = ~ Te + Gv + circular(Wd), ...) {
  measurements(data, time = "hour", target = "Ti", boundary = boundary, noise_sd = 0.1, ...)
}

ids <- function(data, ...) {
  found <- measure(data, ...)$findings
  paste(found$column, found$id, recycle0 = TRUE)
}

test_that("a clean record has no findings, and neither has what is natural for a condition", {
  expect_identical(ids(weather()), character())
  hour <- 1:288
  natural <- withr::with_seed(2, list(
    rain = ifelse(runif(288) < 0.05, round(rexp(288, 0.7), 1), 0),
    storm = replace(numeric(288), c(60:80, 200), c(round(rexp(21), 1), 9)),
    schedule = ifelse(hour %% 24 > 7 & hour %% 24 < 22 & hour %% 168 < 120, 21, 16),
    holiday = ifelse(hour > 150, 12, ifelse(hour %% 24 > 7, 21, 16)),
    valve = pmin(100, pmax(0, 50 + 80 * sin(hour / 9) + rnorm(288))),
    power = 2000 * (sin(hour / 9) > -0.5),
    rounded = round(8 + 5 * sin(2 * pi * hour / 24) +
                    as.numeric(stats::filter(rnorm(288), 0.9, "recursive"))),
    pressure = 999 + round(cumsum(rnorm(288)) / 3, 1), clock = hour %% 24, people = rpois(288, 3)))
  data <- cbind(weather(), natural)
  expect_identical(ids(data, boundary = c("Te", "circular(Wd)", names(natural))), character())
})

test_that(
  "codes for a missing value are refused in target and conditions, with rows and what to write", {
  refused <- function(name, code, rows = c(40, 41, 120), ...) {
    edit <- stats::setNames(list(function(v) replace(v, rows, code)), name)
    expect_error(measure(do.call(weather, edit)), "rows 40 to 41 and 120: a code.*Give `missing = ",
                 class = "amiss_error_input", info = paste(name, code))
  }
  for (name in c("Ti", "Te")) {
    for (code in c(-9999, -999, -99.9, -99, 9999, 99999, 32767, 65535, 1e30)) refused(name, code)
  }
  for (code in c(-9999, -99.9, 9999, 32767)) refused("Gv", code)
  for (code in c(990, 999, 9999, -999)) refused("Wd", code)
  two <- weather(Te = function(v) replace(v, c(3, 9), c(-999, 9999)))
  expect_error(measure(two), "missing = c\\(-999, 9999\\)", class = "amiss_error_input")
})

test_that("missing sets codes to NA, or says that there are none", {
  data <- weather(Ti = function(v) replace(v, 40:41, -9999),
                  Te = function(v) replace(v, 100, -9999))
  m <- suppressMessages(measure(data, missing = -9999, fill_gaps = 2))
  expect_identical(which(is.na(m$y)), 40:41)
  expect_true(all(abs(m$raw$drivers[, "Te"]) < 50))
  expect_identical(ids(weather(Te = function(v) replace(v, 40, 999)), missing = NA),
                   "Te far_outside")
  expect_error(measure(data, missing = "none"), "missing", class = "amiss_error_input")
  # A column that is not analysed may hold codes.
  other <- cbind(weather(), spare = replace(rnorm(288), 9, -9999))
  expect_identical(ids(other), "spare missing_code")
  expect_no_match(printed(measure(other)), "-9999")
})

test_that("values far outside all others are found in either direction, beside others that are", {
  found <- measure(weather(Ti = function(v) replace(v, c(40, 120), c(85, -60))))$findings
  expect_identical(found$id, "far_outside")
  expect_identical(found$rows[[1]], c(40L, 120L))
  expect_match(found$says, "Ti is 85 or -60 in rows 40 and 120, far outside all other values")
})

test_that("readings at the end of a sensor's range are found, and left out if asked", {
  data <- weather(Ti = function(v) pmin(v, 23))
  m <- measure(data)
  expect_identical(m$findings$id, "range_end")
  expect_identical(m$findings$rows[[1]], which(data$Ti == 23))
  expect_match(printed(m), "Give range = c\\(-Inf, 23\\)")
  asked <- measure(data, range = c(-Inf, 23))
  expect_identical(which(is.na(asked$y)), which(data$Ti == 23))
  expect_identical(nrow(asked$findings), 0L)
  expect_identical(ids(weather(Ti = function(v) pmax(v, 21))), "Ti range_end")
  expect_identical(ids(weather(Ti = function(v) round(pmin(v, 23), 1))), "Ti range_end")
  # Rounded values of a sine pile up at its ends by themselves; nothing is less than no flow.
  expect_identical(ids(weather(Ti = function(v) round(20 + 3 * sin(seq_along(v) / 5), 1))),
                   character())
  expect_identical(ids(weather(Ti = function(v) pmax(0, v - 23))), character())
  expect_error(measure(data, range = c(23, 23)), "lower end comes first",
               class = "amiss_error_input")
})

test_that("a unit that changes at some row is found, with the row", {
  late <- function(change, from = 150) function(v) ifelse(seq_along(v) >= from, change(v), v)
  fahrenheit <- late(function(v) 1.8 * v + 32)
  expect_identical(ids(weather(Ti = fahrenheit)), "Ti unit")
  expect_match(measure(weather(Ti = fahrenheit))$findings$says,
               "Ti seems to change its unit at row 150, from Celsius to Fahrenheit: give all rows")
  expect_identical(ids(weather(Te = fahrenheit)), "Te unit")
  expect_match(measure(weather(Te = late(function(v) v + 273.15)))$findings$says,
               "at row 150, from Celsius to kelvin")
  back <- function(v) ifelse(seq_along(v) < 150, v + 273.15, v)
  expect_match(measure(weather(Te = back))$findings$says, "from kelvin to Celsius")
  # What jumps or grows in other ways is none, nor is what gets there step by step.
  for (change in list(function(v) v + 20, function(v) 2 * v, function(v) v + 48 * 0.7))
    expect_false("unit" %in% measure(weather(Ti = late(change)))$findings$id)
  slowly <- function(v) v + 273.15 * pmin(1, pmax(0, (seq_along(v) - 120) / 40))
  expect_false("unit" %in% measure(weather(Te = slowly))$findings$id)
  expect_match(measure(weather(Te = function(v) late(function(v) (v + 459.67) / 1.8)(1.8 * v + 32)
                               ))$findings$says, "from Fahrenheit to kelvin")
  # A step of something else, as far as its size or its stated unit say so.
  power <- withr::with_seed(3, c(rnorm(149, 1000, 100), rnorm(139, 2000, 150)))
  humid <- withr::with_seed(3, c(rnorm(149, 25, 4), rnorm(139, 70, 5)))
  others <- cbind(weather(), power, humid)
  expect_identical(ids(others, boundary = list(power = condition("heat", "W"),
                                               humid = condition("humidity", "%"))), character())
  cloudy <- cbind(weather(), Gs = weather()$Gv + withr::with_seed(2, rnorm(288, 0, 40)))
  expect_identical(ids(cloudy, boundary = c("Gv", "Gs")), character())
  found <- function(v) amiss:::unit_finding(list(v = v, told = "Te"))
  for (v in list(c(NA, 1, 1000), numeric(100), c(rep(1.7e308, 50), rep(-1.7e308, 50)), rep(NA, 60)))
    expect_null(found(as.numeric(v)))
  long <- as.integer(rep(c(20, 21, 22, 24), 25000))
  expect_null(found(long))
  expect_match(found(c(long[1:5e4], as.integer(1.8 * long[1:5e4] + 32)))$says, "at row 50001,")
  # What drives a simulator elsewhere is looked at in the same way, with codes taken out first.
  coded <- replace(fahrenheit(weather()$Te), c(30, 60), -9999)
  expect_identical(amiss:::table_findings(list(Te = coded))$id, c("missing_code", "unit"))
  expect_identical(amiss:::table_findings(list(Ti = replace(rep(21.5, 300), 150, 22)), "Ti")$id,
                   "at_rest")
})

test_that("a sensor that is stuck is found", {
  resting <- weather(Ti = function(v) replace(rep(21.5, length(v)), 150, 22))
  expect_identical(ids(resting), "Ti at_rest")
  expect_match(measure(resting)$findings$says, "Ti is 21.5 in 287 of 288 rows")
  more <- function(v) replace(rep(21.5, length(v)), seq(10, 100, 10), 21 + seq_len(10))
  expect_identical(ids(weather(Ti = more)), "Ti at_rest")
  rest <- function(v) amiss:::at_rest_finding(list(v = v, told = "Ti"))
  expect_null(rest(rep(NA_real_, 48)))
  expect_null(rest(c(20.1, rep(NA, 47))))
  # No flow may last.
  dry <- function(v) replace(numeric(length(v)), 150:153, c(1.013, 3.27, 2.1, 0.94))
  expect_identical(ids(weather(Ti = dry)), character())
  held <- function(n) function(v) replace(v, 99 + seq_len(n), v[100])
  expect_identical(ids(weather(Ti = held(7))), "Ti stuck")
  expect_identical(ids(weather(Te = held(24))), "Te stuck")
  expect_identical(ids(weather(Te = function(v) held(48)(round(v)))), "Te stuck")
  several <- weather(Te = function(v) {
    for (at in c(30, 100, 200)) v[at + 0:23] <- v[at]
    v
  })
  expect_identical(measure(several)$findings$rows[[1]], c(30:53, 100:123, 200:223))
  # The target of rows that are not compared does no harm.
  expect_identical(ids(weather(Ti = held(20)), calibrate = !1:288 %in% 95:125), character())
})

test_that("a target in steps that are coarse for its noise is found", {
  expect_identical(ids(weather(Ti = function(v) round(2 * v) / 2)), "Ti quantised")
  expect_identical(ids(weather(Ti = function(v) round(v, 1))), character())
  expect_match(measure(weather(Ti = function(v) round(2 * v) / 2))$findings$says,
               "state a noise of 0.14 at least")
})

test_that("values that stand in several rows are found, unless averages are of as many", {
  each <- function(v) rep(v[seq(1, 285, 4)], each = 4)
  expect_identical(ids(weather(Te = each)), "Te repeated")
  expect_identical(ids(weather(Ti = each)), "Ti repeated")
  expect_identical(ids(weather(Te = each), average = 4), character())
})

test_that("a counter and a direction are found", {
  counter <- function(v) (cumsum(v) %% 9000)
  expect_identical(ids(weather(Gv = counter)), "Gv counter")
  # What only rises may be a meter, or a room that warms up: it is not stuck while it stands.
  expect_identical(ids(weather(Gv = cumsum)), character())
  expect_identical(ids(weather(Te = function(v) 20 - 10 * exp(-seq_along(v) / 24))), character())
  expect_identical(ids(weather(), boundary = ~ Te + Gv + Wd), "Wd direction")
  expect_identical(ids(weather(Wd = function(v) ifelse(v > 180, v - 360, v)), boundary = ~ Te + Wd),
                   "Wd direction")
  # One that never jumps has a name; another quantity in such a range has neither.
  narrow <- weather(Wd = function(v) 100 + v / 2)
  expect_identical(ids(narrow, boundary = ~ Te + Wd), "Wd direction")
  expect_identical(ids(transform(narrow, power = Wd), boundary = ~ Te + power), character())
})

test_that(
  "a condition that is constant in calibration only is found, and nobody is asked to name it", {
  data <- weather(Gv = function(v) replace(v, 1:200, 0))
  expect_warning(m <- measure(data, validate = data$hour > 200), "Gv.*not vary",
                 class = "amiss_warning_input")
  expect_identical(paste(m$findings$column, m$findings$id), "Gv constant")
  upgrade <- small_upgrade()
  upgrade$measurements$constant <- "Gv"
  upgrade$measurements$conditions <- "Te"
  asked <- amiss:::driver_inspections(upgrade)
  expect_match(asked[["constant"]], "In calibration Gv did not vary, so sun cannot be judged")
  expect_false("driver" %in% names(asked))
})

test_that("stamps that stray by fractions of a second move no row", {
  data <- weather()[1:240, ]
  exact <- as.POSIXct("2024-01-01", tz = "UTC") + 600 * data$hour
  of <- function(time) {
    measurements(transform(data, time = time), time = "time", target = "Ti", boundary = ~Te,
                 noise_sd = 0.1, average = 1, warmup = 6)
  }
  stray <- of(exact + withr::with_seed(1, runif(240, -0.4, 0.4)))
  expect_identical(stray[c("time", "y", "use")], of(exact)[c("time", "y", "use")])
})

test_that("a batch job that prints no record is told of its faults, and so is who sees a fit", {
  data <- linear_data()
  data$Wd <- withr::with_seed(1, runif(nrow(data), 0, 360))
  expect_message(m <- linear_measurements(data, boundary = ~ Te + Wd),
                 "Look at the record.*circular\\(Wd\\)", class = "amiss_message_record")
  runs <- simulate_design(linear_simulator(), m, runs = 30, seed = 3)
  fit <- calibrate(train_emulator(runs, m), m, quick_ais, seed = 3)
  for (said in list(printed(fit), printed(summary(fit)))) expect_match(said, "circular\\(Wd\\)")
  expect_no_message(linear_measurements(), class = "amiss_message_record")
})
