quietly <- function(...) suppressMessages(linear_measurements(...), classes = "amiss_message_gap")
lag_simulator <- function() {
  function_simulator(function(values, drivers) 20 + values[["gain"]] * lagged(drivers[, "Te"], 8),
                     free("gain", uniform(0, 1)),
                     boundary = "Te", name = "lag")
}

test_that("a lost row costs one row, and no warm-up", {
  data <- linear_data()
  expect_message(m <- linear_measurements(data[-100, ], warmup = 10),
                 "1 lost row in 1 gap is bridged, the first after row 99",
                 class = "amiss_message_gap")
  whole <- linear_measurements(data, warmup = 10)
  expect_identical(m[c("hours", "segment", "use", "step_h")],
                   whole[c("hours", "segment", "use", "step_h")])
  expect_identical(m$y, replace(whole$y, 100, NA))
  expect_equal(m$raw$drivers[100, "Te"], mean(data$Te[c(99, 101)]), ignore_attr = TRUE)
  expect_identical(m$raw$drivers[-100, ], whole$raw$drivers[-100, ])
})

test_that("a lost row is as a row whose target is missing", {
  data <- linear_data()
  data$Te[100] <- mean(data$Te[c(99, 101)])
  data$Gv[100] <- mean(data$Gv[c(99, 101)])
  lost <- quietly(data[-100, ], average = 2)
  expect_equal(lost,
               linear_measurements(replace(data, "Ti", replace(data$Ti, 100, NA)), average = 2))
  values <- rbind(c(gain = 0.4), c(gain = 0.7))
  runs <- function(m) amiss:::simulate_measured(lag_simulator(), values, m, "calibrate", 1L)
  expect_equal(runs(quietly(data[-100, ])), runs(linear_measurements(data))[-100, ])
})

test_that("longer gaps are bridged as far as is asked, and cut the record beyond", {
  data <- linear_data()
  broken <- data[-c(50:52, 100:105), ]
  cut <- suppressWarnings(quietly(broken))
  expect_equal(length(unique(cut$segment)), 3)
  one <- suppressWarnings(quietly(broken, fill_gaps = 3))
  expect_equal(c(length(unique(one$segment)), length(one$y)), c(2, 234))
  both <- quietly(broken, fill_gaps = 6, warmup = 10)
  expect_equal(both$hours, as.numeric(data$hour))
  expect_equal(sum(both$use == "warmup"), 10)
  expect_equal(both$raw$drivers[50:52, "Te"], stats::approx(c(49, 53), data$Te[c(49, 53)], 50:52)$y)
})

test_that("what a driver lacks is filled as far as is asked, and told", {
  data <- linear_data()
  lacking <- replace(data, "Te", replace(data$Te, c(30:32, 70), NA))
  expect_error(linear_measurements(lacking), "Te.*4 missing.*row 30.*fill_gaps",
               class = "amiss_error_input")
  expect_error(quietly(lacking, fill_gaps = 2), "Te.*3 missing.*row 30",
               class = "amiss_error_input")
  expect_message(m <- linear_measurements(lacking, fill_gaps = 3),
                 "4 values of .*Te.* in 2 gaps of at most 3 h", class = "amiss_message_gap")
  expect_equal(m$boundary[30:32, 1], stats::approx(c(29, 33), data$Te[c(29, 33)], 30:32)$y)
  expect_equal(m$y, data$Ti)
  # Beside a lost row the gap is as long as both.
  expect_error(quietly(lacking[-33, ], fill_gaps = 3), "row 30", class = "amiss_error_input")
  expect_length(quietly(lacking[-33, ], fill_gaps = 4)$y, 240)
  # At an end, or beside a cut, there is nothing to draw a line to.
  expect_error(quietly(replace(data, "Te", replace(data$Te, 240, NA)), fill_gaps = 3), "row 240",
               class = "amiss_error_input")
  beside <- replace(data, "Te", replace(data$Te, 99, NA))[-(100:130), ]
  expect_error(suppressWarnings(quietly(beside, fill_gaps = 3)), "row 99",
               class = "amiss_error_input")
})

test_that("directions are filled the short way round", {
  data <- linear_data()
  data$Wd <- rep(c(350, 20, 10), 80)
  data$Wd[c(2, 50)] <- NA
  m <- quietly(data, boundary = ~ Te + circular(Wd), fill_gaps = 1)
  expect_equal((m$raw$drivers[c(2, 50), "Wd"] + 180) %% 360, c(180, 180))
})

test_that("stamps that stray are taken at equal steps", {
  data <- linear_data()
  expect_grid <- function(hours, rows = 1:240, ...) {
    data$hour <- hours
    rows <- (1:240)[rows]
    m <- quietly(data[rows, ], ...)
    expect_equal(m$hours, 1:240)
    expect_equal(m$y, replace(data$Ti, setdiff(1:240, rows), NA))
  }
  stray <- withr::with_seed(3, stats::runif(240, -0.2, 0.2))
  expect_grid(1:240 + stray)
  expect_grid(1:240 + stray, -c(7, 100))
  expect_grid(1:240 + round(60 * stray) / 60, -(20:24), fill_gaps = 5)
  data$hour <- 1:240 + stray
  expect_message(linear_measurements(data), "unequal steps.*equal steps of 1 h, 7.. s away",
                 class = "amiss_message_gap")
  stamped <- data
  stamped$hour <- as.POSIXct("2024-03-01", tz = "Europe/Berlin") + 3600 * data$hour
  expect_equal(quietly(stamped)$time, as.POSIXct("2024-03-01", tz = "Europe/Berlin") + 3600 * 1:240)
  # A clock that is neither of the hour nor of the minute: its own steps.
  data$hour <- 0.4 + 1.0123 * (1:240) + 0.1 * stray
  m <- quietly(data)
  expect_equal(diff(m$hours), rep(m$step_h, 239))
  expect_lt(max(abs(m$hours - data$hour)), 0.04)
})

test_that("readings between two steps are left out, and many of them refused", {
  data <- linear_data()
  between <- rbind(data, transform(data[c(20, 90), ], hour = hour + 0.5, Ti = 99))
  expect_message(m <- linear_measurements(between[order(between$hour), ]),
                 "2 rows between two steps are left out; the first is row 21")
  expect_equal(m$y, data$Ti)
  # Of two at one step, the nearer.
  twice <- rbind(data, transform(data[c(20, 90), ], hour = hour + c(0.1, -0.1), Ti = 99))
  expect_equal(quietly(twice[order(twice$hour), ])$y, data$Ti)
  early <- replace(data, "hour", replace(data$hour, 9, 9.3))
  expect_equal(suppressMessages(linear_measurements(early))$y, replace(data$Ti, 9, NA))
  many <- rbind(data, transform(data[1:60, ], hour = hour + 0.5))
  expect_error(linear_measurements(many[order(many$hour), ]), "unequal steps: 0.5 h after row 1",
               class = "amiss_error_input")
})

test_that("uses and expressions stay with their rows", {
  data <- linear_data()
  m <- quietly(data[-c(50, 150), ], calibrate = "hour <= 120", validate = "hour > 120")
  expect_equal(m$use, rep(c("calibrate", "validate"), each = 120))
  expect_equal(amiss:::used_rows(m, "validate"), setdiff(121:240, 150))
})

test_that("a missing target leaves a calibration as it is without that row", {
  # The likelihood of n rows without one of them is that of the other n - 1: the error's filter
  # steps over it.
  data <- linear_data(60)
  m <- linear_measurements(replace(data, "Ti", replace(data$Ti, 30, NA)))
  lost <- quietly(data[-30, ])
  rows <- amiss:::used_rows(m, "calibrate")
  expect_identical(amiss:::used_rows(lost, "calibrate"), rows)
  expect_identical(lost$hours[rows], m$hours[rows])
  expect_identical(which(amiss:::segment_starts(lost, rows)), 1L)
})
