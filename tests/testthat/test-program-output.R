# Tables that programs write: comments, units, spaces, and rows matched to the record by time.

# What is read of these lines, for a record of `rows` steps that begins at `from`, or why it is not.
read_lines <- function(lines, ..., rows = 3, from = "2013-07-21", step_h = 1, offset = 0) {
  folder <- withr::local_tempdir()
  writeLines(lines, file.path(folder, "o.txt"))
  time <- if (is.numeric(from)) from + step_h * seq_len(rows) else
    as.POSIXct(from, tz = "UTC") + 3600 * step_h * seq_len(rows)
  expected <- list(time = time, step_h = step_h, rows = rows, offset = offset)
  tryCatch(read_run_output(program_output("o.txt", ...), folder, expected),
           error = conditionMessage)
}

test_that("comments, units, separators and decimals are read as they are said", {
  expect_identical(read_lines(c("! a model", "h;Ti", "h;degC", "1;20,5", "2;-1,5e1", "3;7"), "Ti",
                              comment = "!", decimal = ",", units_rows = 1), c(20.5, -15, 7))
  expect_identical(read_lines(c("# a", "#h   Ti", "  1   20.5", " 2\t1.5D+1", "  3  7  "), "Ti"),
                   c(20.5, 15, 7))
  expect_identical(read_lines(c("x", "x", "Ti,h", "1,9", "2,9", "", "3,9"), "Ti", skip = 2),
                   c(1, 2, 3))
  expect_identical(read_lines(c("1 20", "2 21", "3 22"), 2), c(20, 21, 22))
  expect_identical(read_lines(c("1|20", "2|21", "3|22"), 2, separator = "bar"), c(20, 21, 22))
  expect_identical(read_lines(c("h,Ti,", "1,20,", "2,21,", "3,22,"), "Ti"), c(20, 21, 22))
  expect_identical(read_lines(c("h,\"T, in\"", "1,2", "2,3", "3,4"), "T, in"), c(2, 3, 4))
  expect_identical(read_lines(c("h,Ti", "0,9", "1,20", "2,21", "3,22", "3,9"), "Ti", drop_first = 1,
                              drop_last = 1), c(20, 21, 22))
})

test_that("several columns are added or averaged", {
  lines <- c("quick slow", "1 2", "3 4", "5 6")
  expect_identical(read_lines(lines, c("quick", "slow"), combine = "sum"), c(3, 7, 11))
  expect_identical(read_lines(lines, c("quick", "slow"), combine = "mean"), c(1.5, 3.5, 5.5))
  expect_identical(read_lines(lines, c("quick", "slow"), combine = "sum", transform = sqrt),
                   sqrt(c(3, 7, 11)))
  expect_error(program_output("o.txt", c("quick", "slow")), "combine", class = "amiss_error_input")
})

test_that("what cannot be read is said with its line", {
  expect_match(read_lines(c("h,Ti", "1,20"), "Te"), "no column Te in o.txt; there: \"h,Ti\"")
  expect_match(read_lines(c("h,Ti", "h,degC", "1,20"), "Ti"), "line 2 .*\"degC\".*units_rows")
  expect_match(read_lines(c("h;Ti", "1;20,5"), "Ti"), "\"20,5\".*decimal = \",\"")
  expect_match(read_lines(c("h,Ti", "1,20", "2,3,4"), "Ti"), "line 3 of o.txt has 3 field")
  expect_match(read_lines(c("h,Ti", "1,20", "2,\"3"), "Ti"), "quote that does not end")
  expect_match(read_lines(c("h,Ti", "1,20", "2,****"), "Ti"), "line 3 .*widen the format")
  expect_match(read_lines("h,Ti", "Ti"), "no rows of numbers")
  expect_match(read_lines(c("1 2", "3 4"), 5), "no column 5")
})

energyplus <- c("Date/Time,ROOM:Zone Mean Air Temperature [C](TimeStep),Facility:Power [W](Hourly)",
                # a design day, then two days of the run period, every half an hour
                sprintf(" 01/21  %02d:%02d:00,%g,", rep(0:23, each = 2) + rep(0:1, 24),
                        rep(c(30, 0), 24), -1:-48),
                sprintf(" 07/%02d  %02d:%02d:00,%g,%s", rep(20:21, each = 48),
                        rep(0:23, each = 2) + rep(0:1, 24), rep(c(30, 0), 24), 1:96, c("", "5")))

test_that(
  "EnergyPlus' stamps without a year are matched, half hours averaged, and design days left out", {
  room <- "ROOM:Zone Mean Air Temperature"
  expect_identical(read_lines(energyplus, room, time = "Date/Time", rows = 24),
                   48 + seq(1.5, 47.5, 2))
  # A clock two hours ahead of UTC: 2:00 UTC is 4:00 there.
  expect_identical(read_lines(energyplus, room, time = "Date/Time", utc_offset = 2),
                   48 + c(5.5, 7.5, 9.5))
  expect_identical(read_lines(energyplus, room, time = "Date/Time", offset = 2),
                   48 + c(5.5, 7.5, 9.5))
  expect_identical(read_lines(energyplus, "Facility:Power", time = "Date/Time"), c(5, 5, 5))
  # Hours of a year, as measurements() reads such stamps.
  expect_identical(read_lines(energyplus, room, time = "Date/Time", from = 24 * 200),
                   c(1.5, 3.5, 5.5) + 0)
  expect_match(
    read_lines(energyplus, room, time = "Date/Time", rows = 30),
    "no row for 2013-07-22 01:00: 6 of 30 times .*from 2013-01-21 00:30 to 2013-07-22 00:00")
})

test_that("time goes on over the end of a year, and a leap day is one", {
  days <- format(as.Date("2011-12-25") + 0:12, " %m/%d  24:00:00")
  lines <- c("t,Ti", paste(days, 1:13, sep = ","))
  expect_identical(read_lines(lines, "Ti", time = "t", from = "2012-01-01", step_h = 24),
                   c(8, 9, 10))
  expect_identical(read_lines(lines, "Ti", time = "t", from = "2011-12-30", step_h = 24),
                   c(6, 7, 8))
  leap <- c("t,Ti", " 02/28  24:00:00,1", " 02/29  24:00:00,2", " 03/01  24:00:00,3")
  expect_identical(read_lines(leap, "Ti", time = "t", from = "2012-02-28", step_h = 24), c(1, 2, 3))
  skipped <- c(leap[-3], " 03/02  24:00:00,4")  # a program that knows no leap day
  expect_match(read_lines(skipped, "Ti", time = "t", from = "2012-02-28", step_h = 24),
               "no row for 2012-03-01")
})

test_that("decimal days of ESP-r are matched, rounded as they are", {
  hours <- seq(-48, 30, 0.5)  # two days of start-up before, a last extra row after
  lines <- c("# Results library: house.res", "# Time db",
             sprintf("%.4f  %g", 202 + hours / 24, hours))
  expect_equal(read_lines(lines, 2, time = 1, time_format = "day_of_year", rows = 24), 1:24 - 0.25)
  expect_equal(read_lines(lines, "db", time = "Time", time_format = "day_of_year"), 1:3 - 0.25)
  clock <- c("day clock db", "21/07 23:30 5", "21/07 24:00 6", "22/07 00:30 7", "22/07 01:00 8")
  expect_equal(read_lines(clock, "db", time = c("day", "clock"), rows = 2,
                          time_format = "%d/%m %H:%M", from = "2013-07-21 23:00"), c(5.5, 7.5))
})

test_that("dates, hours and stamps of their own are matched", {
  lines <- c("t;Q", "21.07.2013 01:00;1", "21.07.2013 02:00;2", "21.07.2013 03:00;3",
             "21.07.2013 04:00;4")
  expect_identical(read_lines(lines, "Q", time = "t", time_format = "%d.%m.%Y %H:%M"), c(1, 2, 3))
  expect_identical(read_lines(lines, "Q", time = "t"), c(1, 2, 3))
  iso <- c("time,Q", "2013-07-21T01:00:00Z,1", "2013-07-21T02:00:00Z,2", "2013-07-21T03:00:00Z,3")
  expect_identical(read_lines(iso, "Q", time = "time", utc_offset = 2), c(1, 2, 3))
  hours <- c("h Q", "-1 9", "0 9", "1 1", "2 2", "3 3", "4 9")
  expect_identical(read_lines(hours, "Q", time = "h", time_format = "hours"), c(1, 2, 3))
  expect_identical(read_lines(hours, "Q", time = "h", from = 0), c(1, 2, 3))
  expect_identical(read_lines(hours, "Q", time = "h", time_format = "hours", stamps = "start"),
                   c(9, 1, 2))
  half <- c("h Q", sprintf("%g %g", seq(0.25, 2.75, 0.5), 1:6))
  expect_identical(read_lines(half, "Q", time = "h", time_format = "hours", stamps = "middle"),
                   c(1.5, 3.5, 5.5))
  expect_match(read_lines(hours, "Q", time = "h"), "numbers as time.*time_format")
  expect_match(read_lines(lines, "Q", time = "t", from = 0), "the record is in hours")
  expect_match(read_lines(sub("21", "x", lines), "Q", time = "t"), "cannot be read, such as \"x.07")
  expect_match(read_lines(lines, "Q", time = "t", time_format = "%Y/%m/%d"), "does not read")
})

test_that("a time that is missing, there twice or too coarse is said", {
  lines <- c("h Q", "1 1", "3 3", "4 4")
  expect_match(read_lines(lines, "Q", time = "h", time_format = "hours"),
               paste("no row for 2013-07-21 02:00: 1 of 3 times of the record",
                     ".*from 2013-07-21 01:00 to 2013-07-21 04:00"))
  expect_match(read_lines(c("h Q", "1 1", "2 2", "2 2", "3 3"), "Q", time = "h",
                          time_format = "hours"), "a time twice")
  expect_match(read_lines(c("h Q", "2 1", "4 2", "6 3"), "Q", time = "h", time_format = "hours"),
               "further apart")
  strays <- function(at)
    read_lines(c("h Q", "1 1", paste(at, 2), "3 3"), "Q", time = "h", time_format = "hours")
  expect_identical(strays(2.2), c(1, 2, 3))
  expect_match(strays(2.4), "no row for 2013-07-21 02:00")
  fine <- c("h Q", "0.5 1", "1 2", "2 2", "2.5 1", "3 3")
  expect_match(read_lines(fine, "Q", time = "h", time_format = "hours"),
               "no row for 2013-07-21 02:00")
})

test_that("the run period of EnergyPlus' SQLite output is read by its own time", {
  skip_if_not_installed("RSQLite")
  folder <- withr::local_tempdir()
  database <- DBI::dbConnect(RSQLite::SQLite(), file.path(folder, "eplusout.sql"))
  write <- function(name, ...) DBI::dbWriteTable(database, name, data.frame(...))
  write("ReportDataDictionary", ReportDataDictionaryIndex = 1:3, KeyValue = c("ROOM", "ROOM", ""),
        Name = c("Zone Mean Air Temperature", "Zone Mean Air Temperature", "Electricity:Facility"),
        ReportingFrequency = c("Hourly", "Zone Timestep", "Hourly"))
  write("EnvironmentPeriods", EnvironmentPeriodIndex = 1:2, EnvironmentName = c("WINTER", "RUN"),
        EnvironmentType = c(1, 3))
  hours <- rep(1:6, each = 2)
  write("Time", TimeIndex = 1:12, Month = 7, Day = 21, Hour = (1:12 - 1) %% 6 %/% 2 + rep(0:1, 6),
        Minute = rep(c(30, 0), 6), WarmupFlag = 0, EnvironmentPeriodIndex = rep(1:2, each = 6))
  write("ReportData", TimeIndex = c(1:12, 8, 10, 12),
        ReportDataDictionaryIndex = rep(c(2, 1, 3), c(12, 0, 3)), Value = c(-1:-6, 1:6, 10, 20, 30))
  DBI::dbDisconnect(database)
  expected <- list(time = as.POSIXct("2013-07-21", tz = "UTC") + 3600 * 1:3, step_h = 1, rows = 3,
                   offset = 0)
  read <- function(...)
    tryCatch(read_run_output(program_output("eplusout.sql", ...), folder, expected),
             error = conditionMessage)
  expect_identical(read("Room:Zone Mean Air Temperature"), c(1.5, 3.5, 5.5))
  expect_identical(read("Electricity:Facility"), c(10, 20, 30))
  expect_match(read("ROOM:Zone Air Humidity"), "no variable .*there: \"ROOM:Zone Mean")
  expect_match(read(c("Electricity:Facility", "ROOM:Zone Mean Air Temperature"), combine = "sum"),
               "different times")
})

test_that("SQLite without its package, and what names nothing, are refused", {
  refused <- function(pattern, ...)
    expect_error(program_output(...), pattern, class = "amiss_error_input")
  refused("names no variable", "eplusout.sql", 1)
  refused("run's directory", "../o.txt", "Ti")
  refused("is a name", "o.txt", 1, time = "t")
  refused("time_format", "o.txt", "Ti", time = "t", time_format = "julian")
  refused("has no month and day", "o.txt", "Ti", time = "t", time_format = "%H:%M")
  refused("column", "o.txt", 0)
  refused("drop_first", "o.txt", "Ti", drop_first = -1)
  expect_match(printed(program_output("o.txt", c("a", "b"), "sum", time = "t")),
               "the sum of the columns .*by time")
})

test_that("output is matched by time in a run, with rows before and after", {
  skip_on_os("windows")
  rule <- c("BEGIN { FS = \",\"; print \"# model\"; print \"h Ti\"; print -1, 99 }",
            "NR > 1 { for (k = 1; k <= 2; k++) print $2 - 1 + k / 2, {{gain}} * $3 + k }",
            "END { print $2 + 1, 99 }")
  program <- program_simulator(
    c("awk", "-f", "model.awk", "drivers.csv"), free("gain", uniform(0, 2)), boundary = "Te",
    output = program_output("stdout.txt", "Ti", time = "h", time_format = "hours"),
    templates = list(model.awk = I(rule)), cache = withr::local_tempdir())
  expect_equal(simulate_runs(program, cbind(gain = 2), cbind(Te = c(4, 6, 5)), 1)[, 1],
               2 * c(4, 6, 5) + 1.5)
})
