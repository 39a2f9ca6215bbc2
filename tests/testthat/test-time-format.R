quietly <- function(code) suppressMessages(code, classes = "amiss_message_time")
reading <- function(values, name = "t", ...) quietly(amiss:::time_reading(values, name, ...))
refused <- function(pattern, values, ...)
  expect_error(reading(values, ...), pattern, class = "amiss_error_input")
from <- as.POSIXct("2014-06-01 00:30", tz = "UTC")
days <- from + 86400 * 0:99 - 1800
hours <- from + 3600 * 0:599
halves <- from + 1800 * 0:599

expect_recognised <- function(numbers, stamps, format) {
  expect_message(amiss:::read_time(numbers, "t"), format, fixed = TRUE,
                 class = "amiss_message_time")
  read <- reading(numbers)
  expect_identical(read$format, format)
  expect_identical(read$time,
                   structure(as.numeric(stamps), class = c("POSIXct", "POSIXt"), tzone = "UTC"))
  expect_identical(as.numeric(reading(numbers[1:12], format = format)$time),
                   as.numeric(stamps[1:12]))
}

test_that("digits of a date are read as the date, also without the zero in front", {
  cases <- list("%Y%m%d" = days, "%d%m%Y" = days, "%m%d%Y" = days, "%Y%m%d%H" = hours - 1800,
                "%Y%j%H" = hours - 1800, "%Y%m%d%H%M" = halves, "%y%m%d%H%M" = halves,
                "%Y%m%d%H%M%S" = halves, "%y%m%d%H%M%S" = halves)
  for (format in names(cases)) {
    text <- format(cases[[format]], format)
    expect_recognised(as.numeric(text), cases[[format]], format)
    expect_identical(reading(text)$time, reading(as.numeric(text))$time)
  }
})

test_that("days counted from a date are read as the date, with the digits that they have", {
  zero <- c(excel = 25569, matlab = 719529, julian = 2440587.5, mjd = 40587, unix_days = 0)
  for (format in names(zero)) {
    expect_recognised(as.numeric(halves) / 86400 + zero[[format]], halves, format)
    expect_recognised(round(as.numeric(halves) / 86400 + zero[[format]], 4), halves, format)
    refused(paste0("\"hours\".*\"", format, "\"`: 2014-06-01 00:00, steps of 24 h"),
            as.numeric(days) / 86400 + zero[[format]])
  }
  expect_equal(reading(41791.5 + 0:20, format = "excel", zone = "Europe/Berlin")$time[1],
               as.POSIXct("2014-06-01 12:00", tz = "Europe/Berlin"))
})

test_that("Unix time is read in all its units", {
  for (unit in c(1, 1e3, 1e6, 1e9)) expect_recognised(as.numeric(halves) * unit, halves, "unix")
})

test_that("numbers that could be hours and something else are refused with the formats", {
  for (step in c(300, 600, 900, 1800, 3600, 86400)) refused("\"hours\".*\"seconds\"", step * 0:99)
  for (step in c(5, 10, 15, 20, 30, 60)) refused("\"seconds\".*\"minutes\"", step * 0:99)
  for (step in 1 / c(24, 144, 1440)) refused("\"days\"", step * 0:99)
  for (name in c("day", "doy", "Time [d]"))
    refused("\"hours\".*\"days\"`: steps of 24 h", 1:99, name)
  for (name in c("t_s", "seconds")) refused("\"hours\".*\"seconds\"`: steps of 1 s", 0:99, name)
  refused("\"hours\".*%y%m%d", as.numeric(format(days, "%y%m%d")))
  refused("\"hours\".*%Y%j", as.numeric(format(days, "%Y%j")))
  refused("\"hours\".*%Y%m",
          as.numeric(format(seq(as.Date("2010-01-01"), by = "month", length.out = 40), "%Y%m")))
  refused("neither hours nor Unix time.*excel", 20140601 + 0:50 / 4)
  for (step in c(1, 600, 5))
    expect_identical(reading(step * 0:99, "day", format = "hours")$time, step * 0:99)
})

test_that("numbers of weeks, months and years are refused", {
  refused("holds numbers such as 1: a month has no fixed length", 1:12, "month")
  refused("such as 2001: a year has no fixed length", 2001 + 0:99 / 12, "decimal year")
  refused("a week has no fixed length", 1:52, "Week")
  expect_identical(reading(24 * 0:99, "hour of the year")$format, "hours")
  refused("%Y%m", 202001 + 0:9, "year_month")
})

test_that("hours in usual steps stay hours", {
  for (step in c(5 / 3600, 1 / 60, 0.05, 0.1, 1 / 6, 0.25, 0.5, 1, 2, 3, 6, 12, 24, 168, 7.3)) {
    expect_identical(reading(step * 0:99, "hour")$time, step * 0:99)
    expect_identical(reading(step * 0:99)$format, "hours")
  }
  expect_identical(reading(40000 + 0:99 / 10)$format, "hours")
})

test_that("a format that lacks a part of the date, or leaves a rest, is refused", {
  refused("has no year, month and day", format(hours, "%H:%M"), format = "%H:%M")
  refused("has no year, for which", format(hours, "%d.%m. %H:%M"), format = "%d.%m. %H:%M")
  refused("only the beginning of.*30.08.2013.*row 1", c("30.08.2013", "31.08.2013"),
          format = "%d.%m.%y")
  refused("row 1 holds.*201406010030", format(halves, "%Y%m%d%H%M"), format = "%Y%m%d%H")
  expect_equal(format(reading(c("2014-06", "2014-07"), format = "%Y-%m")$time),
               c("2014-06-01", "2014-07-01"))
})

test_that("weeks are no change of clocks", {
  expect_length(reading(format(as.Date("2014-01-01") + 7 * 0:60))$time, 61)
})

test_that("classes of other packages are refused with what to write", {
  refused("as.numeric\\(x, \"hours\"\\)", structure(1:20, class = "Period"))
})
