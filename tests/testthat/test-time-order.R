hint <- function(values) {
  error <- tryCatch(suppressMessages(amiss:::read_time(values, "t")), amiss_error_input = identity)
  gsub("\\s+", " ", cli::ansi_strip(conditionMessage(error)))
}
hours <- as.POSIXct("2014-03-01", tz = "UTC") + 3600 * 0:1999

test_that("rows are to be sorted only if that puts them in order", {
  expect_match(hint(hours[c(500:600, 1:400)]), "goes back in row 102.*Sort the rows by time")
  expect_match(hint(with_seed(1, sample(hours))), "Sort the rows by time")
  expect_match(hint(with_seed(1, sample(100))), "Sort the rows by time")
  expect_match(hint(rev(hours)), "run backwards: reverse them")
})

test_that("a count that begins again is not to be sorted", {
  for (values in list(rep(0:23, 9), c(0:99, 0:49 + 0.5), c(500:600, 0:50), structure(
    3600 * rep(0:23, 2), units = "secs", class = c("hms", "difftime")))) {
    expect_match(hint(values), "Do not sort the rows: a count or a time of day begins again")
  }
})

test_that("stamps that a clock shows twice are not to be sorted or deleted", {
  expect_match(hint(format(hours, "%Y-%m-%d %I:%M")), "Do not sort the rows.*AM and PM")
  expect_match(hint(rep(hours[1:50], 2)), "Do not sort the rows.*below one another")
  expect_match(hint(rep(hours[1:50], each = 2)), "Do not delete rows")
  expect_match(hint(hours[c(1:20, 20:50)]), "1 duplicated time stamp.*row 21.*Keep one row")
})

test_that("an exchange of day and month is named", {
  for (step in c(1, 24)) {
    stamps <- as.POSIXct("2014-03-01", tz = "UTC") + 3600 * step * 0:1999
    stamps <- stamps[stamps < as.POSIXct("2014-11-01", tz = "UTC")]
    expect_match(hint(amiss:::exchanged_days(stamps)),
                 "Day and month are exchanged in some rows, so do not sort")
  }
})

test_that("years of two digits that were read as four are refused", {
  expect_match(hint(as.Date("0013-08-30") + 0:20), "row 1 holds .*, in the year 13.*%y")
  expect_match(hint(as.POSIXct(1.4e12 + 0:20, origin = "1970-01-01", tz = "UTC")),
               "in the year 46334")
})
