# 288 hours, 97 of them from 2 September on.
stamps <- as.POSIXct("2013-08-25", tz = "UTC") + 3600 * 1:288
table <- data.frame(hour = 1:288, Te = sin(1:288 / 4), Ti = cos(1:288 / 3),
                    phase = rep(c("a", "b"), each = 144), us = format(stamps, "%m/%d/%Y %I:%M %p"),
                    clock = format(stamps, "%H:%M"), text = format(1:288),
                    open = rep(c(TRUE, FALSE), each = 144))
study_condition <- function(text) structure(list(text = text), class = "amiss_row_condition")
chosen <- function(condition, when, ...) {
  table$when <- when
  m <- suppressMessages(measurements(table, "when", "Ti", ~Te, noise_sd = 0.1, validate = condition,
                                     ...))
  which(m$use == "validate")
}
# In R code and in a study file alike.
expect_chosen <- function(text, rows, when = stamps, ...) {
  expect_identical(chosen(text, when, ...), rows, info = text)
  expect_identical(chosen(study_condition(text), when, ...), rows, info = text)
}
refused <- function(text, pattern, when = stamps, ...) {
  expect_error(chosen(text, when, ...), pattern, class = "amiss_error_input")
  expect_error(chosen(study_condition(text), when, ...), pattern, class = "amiss_error_input")
}
september <- 192:288

test_that(paste("texts are compared with the record's time as times, in any of its formats and in",
                "any zone of the machine"), {
  withr::local_timezone("America/New_York")
  for (format in c("%d.%m.%Y %H:%M", "%Y-%m-%d %H:%M", "%m/%d/%Y %I:%M %p", "%Y-%m-%dT%H:%M:%SZ",
                   "%Y%m%d%H%M")) {
    text <- format(stamps, format)
    for (from in c(text[192], "2013-09-02", "2013-09-02 00:00", "02.09.2013")) {
      expect_chosen(sprintf("when >= '%s'", from), september, text)
    }
    expect_chosen(sprintf("time < '2013-09-02'"), 1:191, text)
  }
  expect_chosen("when >= '09/02/2013'", september, format(stamps, "%m/%d/%Y %H:%M"))
  expect_chosen("when >= '02-09-2013'", september, format(stamps, "%d-%m-%Y h%H"),
                time_format = "%d-%m-%Y h%H")
  for (when in list(stamps, as.POSIXlt(stamps), as.numeric(stamps),
                    as.numeric(stamps) / 86400 + 25569)) {
    expect_chosen("'2013-09-02' <= when", september, when)
    expect_chosen("when %in% c('2013-09-02', '2013-09-02 02:00')", c(192L, 194L), when)
  }
  digits <- as.numeric(format(stamps, "%Y%m%d%H%M"))
  for (from in c("20130902", "201309020000", "'20130902'", "'2013-09-02'")) {
    expect_chosen(paste("when >=", from), september, digits)
  }
  expect_identical(chosen("when >= as.POSIXct('2013-09-02')", stamps), september)
  expect_identical(chosen("when >= as.Date('2013-09-02')", stamps), september)
})

test_that("texts are read by the clock of the column, or of time_zone", {
  berlin <- structure(stamps, tzone = "Europe/Berlin")
  expect_chosen("when >= '2013-09-02'", 190:288, berlin)
  expect_chosen("when >= '2013-09-02'", september, berlin, time_zone = "UTC")
  bare <- structure(stamps, tzone = NULL)
  refused("when >= '2013-09-02'", "name no zone.*time_zone", bare)
  expect_chosen("when >= '2013-09-02'", september, bare, time_zone = "UTC")
})

test_that("stamps without a year are compared within one year", {
  expect_chosen("when >= '09/02 00:00'", september, format(stamps, " %m/%d  %H:%M:00"))
  refused("when >= '01/01'", "go beyond one", format(stamps + 120 * 86400, " %m/%d  %H:%M:00"))
})

test_that("other columns of dates, of times of day and of numbers are compared as these", {
  expect_chosen("us >= '09/02/2013'", september)
  expect_chosen("us >= '2013-09-02'", september)
  expect_chosen("clock >= '23:00'", which(format(stamps, "%H") == "23"))
  for (text in c("hour >= '192'", "text >= 192", "text >= '192'", "'192' <= hour"))
    expect_chosen(text, september)
  expect_chosen("hour %in% c('7', '8.0')", 7:8)
  expect_chosen("open == 'false'", 145:288)
  expect_chosen("phase == 'b'", 145:288)
  for (when in list(1:288, format(1:288), as.difftime(1:288, units = "hours"))) {
    for (text in c("when >= '192'", "when >= 192")) expect_chosen(text, september, when)
  }
})

test_that("what cannot be compared is refused", {
  refused("phase >= 'b'", "texts have no order")
  refused("phase == 1", "\"a\" \\(row 1\\) is compared with numbers")
  refused("hour <= 'x'", "\"x\" is compared with numbers")
  refused("open == 'no'", "is neither")
  refused("when >= 20130902", "compared with 20130902.*in quotes")
  refused("when >= 'spring'", "\"spring\" is no time")
})
