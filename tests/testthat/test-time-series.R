values <- function() as.matrix(linear_data()[c("Te", "Gv", "Ti")])
stamps <- as.POSIXct("2024-01-01", tz = "UTC") + 3600 * seq_len(240)
record <- function(data, ...)
  measurements(data, target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1, ...)
expected <- function(time = stamps) record(data.frame(when = time, values()), "when", name = "Ti")

test_that("series of other packages are records of their index", {
  skip_if_not_installed("zoo")
  expect_equal(record(zoo::zoo(values(), stamps)), expected())
  expect_equal(record(zoo::zoo(values(), 1:240)), expected(1:240))
  expect_equal(record(zoo::zoo(values(), stamps), time = "when"), expected())
  expect_error(record(zoo::zoo(values(), stamps), time = "Te"), "own index",
               class = "amiss_error_input")
  expect_error(record(zoo::zoo(1:240, stamps)), "no names", class = "amiss_error_input")
  skip_if_not_installed("xts")
  expect_equal(record(xts::xts(values(), stamps)), expected())
})

test_that("a tsibble names its own index", {
  table <- data.frame(stamp = stamps, values())
  class(table) <- c("tbl_ts", "tbl_df", "tbl", "data.frame")
  attr(table, "index") <- structure("stamp", ordered = TRUE)
  expect_equal(record(table), expected())
})

test_that("a ts counts days where its cycle says so", {
  hours <- function(...) record(stats::ts(values(), ...))[c("hours", "y", "boundary", "step_h")]
  own <- expected(1:240)[c("hours", "y", "boundary", "step_h")]
  expect_equal(hours(start = c(0, 2), frequency = 24), own)
  expect_equal(record(stats::ts(values(), start = c(0, 2), frequency = 96))$step_h, 0.25)
  expect_equal(record(stats::ts(values()), time_format = "hours")$hours, own$hours)
  expect_error(record(stats::ts(values())), "frequency 1.*time_format", class = "amiss_error_input")
  expect_error(record(stats::ts(values(), frequency = 8760)), "frequency 8760",
               class = "amiss_error_input")
})

test_that("a data frame needs its time named", {
  expect_error(record(data.frame(when = stamps, values())), "time.*must be one string; got NULL",
               class = "amiss_error_input")
  expect_error(record(values()), "data.*must be a data frame", class = "amiss_error_input")
})

test_that("columns that stand twice are refused, and those without a name get one", {
  table <- data.frame(time = stamps, values())
  twice <- function(data, ...)
    expect_error(record(data, ...), "Te.*more than once", class = "amiss_error_input")
  twice(stats::setNames(cbind(table, 1), c(names(table), "Te")), "time")
  m <- record(stats::setNames(cbind(1:240, table), c("", names(table))), "time")
  expect_identical(colnames(m$raw$drivers), c("column_1", "Te", "Gv"))
  skip_if_not_installed("zoo")
  twice(zoo::zoo(cbind(values(), Te = 1), stamps))
})
