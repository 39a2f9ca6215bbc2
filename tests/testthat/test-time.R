read <- function(values, ...)
  suppressMessages(amiss:::read_time(values, "t", ...), classes = "amiss_message_time")
at <- function(text) as.POSIXct(text, tz = "UTC")
as_utc <- function(time) format(time, "%Y-%m-%d %H:%M:%OS1", tz = "UTC")
refused <- function(pattern, values, ...)
  expect_error(read(values, ...), pattern, class = "amiss_error_input")

test_that("one time is read the same from all its forms", {
  stamps <- at("2020-01-21 00:00:00") + 900 * (1:200)  # into the 23rd
  forms <- list(
    format(stamps, "%Y-%m-%d %H:%M:%S"), format(stamps, "%Y-%m-%dT%H:%M"),
    format(stamps, "%Y-%m-%dT%H:%M:%SZ"), format(stamps, "%Y/%m/%d %H:%M"),
    format(stamps, "%Y-%m-%dT%H:%M:%S.000+00:00"), format(stamps + 5400, "%Y-%m-%d %H:%M +0130"),
    format(stamps - 3600, "%Y-%m-%d %H:%M:%S-01"), format(stamps, "%d.%m.%Y %H:%M:%S"),
    format(stamps, "%d.%m.%y, %H:%M"), format(stamps, "%d/%m/%Y %H:%M"),
    format(stamps, "%m/%d/%Y %H:%M"), format(stamps, "%m-%d-%Y %I:%M:%S %p"),
    sub("^0", " ", format(stamps, "%m/%d/%Y %I:%M%p")), factor(format(stamps, "%Y-%m-%d %H:%M:%S")),
    as.POSIXlt(stamps), as.POSIXlt(stamps, tz = "America/New_York"), as.numeric(stamps),
    as.numeric(stamps) * 1000, format(as.numeric(stamps)), as.integer(stamps))
  for (form in forms) {
    time <- read(form)
    expect_s3_class(time, "POSIXct")
    expect_equal(as.numeric(time), as.numeric(stamps), info = format(form[1]))
  }
  expect_identical(attr(read(forms[[16]]), "tzone"), "America/New_York")
  expect_identical(read(stamps), stamps)
  patterns <- list("%b %d %Y %H:%M", "%Y%m%d%H%M", "%d/%m/%Y %H.%M", "%Y%m%dT%H%M%S%z")
  for (pattern in patterns)
    expect_equal(as.numeric(read(format(stamps, pattern), format = pattern)), as.numeric(stamps))
  digits <- as.numeric(format(stamps, "%Y%m%d%H%M"))
  expect_equal(as.numeric(read(digits, format = "%Y%m%d%H%M")), as.numeric(stamps))
  expect_equal(as.numeric(read(digits)), as.numeric(stamps))
})

test_that("midnight, days alone and fractions of seconds are read", {
  expect_equal(as_utc(read(c("2024-02-28 24:00:00", "2024-02-29 24:00", "2024-03-01 01:00"))),
               c("2024-02-29 00:00:00.0", "2024-03-01 00:00:00.0", "2024-03-01 01:00:00.0"))
  expect_equal(as_utc(read(c("2024-02-28", "2024-02-29 06:30:00.5"))),
               c("2024-02-28 00:00:00.0", "2024-02-29 06:30:00.5"))
  expect_equal(as_utc(read(as.Date("2024-02-28") + 0:1)),
               c("2024-02-28 00:00:00.0", "2024-02-29 00:00:00.0"))
  expect_equal(as_utc(read(c("1/21/2020 12:15 AM", "1/21/2020 12:15 pm"))),
               c("2020-01-21 00:15:00.0", "2020-01-21 12:15:00.0"))
})

test_that("a stamp marks the end of its interval, the start if that is said, and a date its day", {
  data <- linear_data(48)
  hourly <- as.POSIXct("2024-03-01", tz = "UTC") + 3600 * 0:47
  first <- function(time, ...) {
    data$time <- time
    m <- measurements(data, time = "time", target = "Ti", boundary = ~Te, noise_sd = 0.1, ...)
    c(as_utc(m$time[1]), as_utc(m$raw$time[1]))
  }
  expect_identical(first(hourly), rep("2024-03-01 00:00:00.0", 2))
  expect_identical(first(hourly, stamp = "start"), rep("2024-03-01 01:00:00.0", 2))
  expect_identical(first(hourly, stamp = "start", average = 2)[1], "2024-03-01 02:00:00.0")
  expect_identical(first(format(hourly, "%Y-%m-%d %H:%M"), stamp = "start")[1],
                   "2024-03-01 01:00:00.0")
  days <- as.Date("2024-03-01") + 0:47
  for (dates in list(days, format(days), factor(format(days)), format(days, "%d.%m.%Y"),
                     as.numeric(format(days, "%Y%m%d")), format(days, "%Y%m%d")))
    expect_identical(suppressMessages(first(dates))[1], "2024-03-02 00:00:00.0")
  expect_identical(first(days, stamp = "end")[1], "2024-03-01 00:00:00.0")
  for (instants in list(as.POSIXct(format(days), tz = "UTC"), format(days, "%Y-%m-%d 00:00"),
                        86400 * as.numeric(days)))
    expect_identical(suppressMessages(first(instants))[1], "2024-03-01 00:00:00.0")
  # Hours without a date.
  data$hour <- 0:47
  m <- measurements(data, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1,
                    stamp = "start")
  expect_identical(m$hours[1:2], c(1, 2))
})

test_that("rows are chosen by the stamps as given, and new data have the same stamps", {
  data <- linear_data(60)
  data$day <- as.Date("2024-03-01") + 0:59
  m <- measurements(data, time = "day", target = "Ti", boundary = ~Te, noise_sd = 0.1,
                    validate = "day >= '2024-04-01'")
  expect_identical(sum(m$use == "validate"), 29L)
  expect_identical(as_utc(m$time[m$use == "validate"][1]), "2024-04-02 00:00:00.0")
  new <- data.frame(time = as.Date("2024-05-01") + 0:9, Te = 1:10)
  expect_identical(as_utc(amiss:::new_record(m, new)$time[1]), "2024-05-02 00:00:00.0")
  started <- measurements(transform(data, at = 24 * 0:59), time = "at", target = "Ti",
                          boundary = ~Te, noise_sd = 0.1, stamp = "start",
                          time_format = "hours")
  expect_identical(amiss:::new_record(started, data.frame(time = 24 * 60:61, Te = 1:2))$hours,
                   24 * 61:62)
})

test_that("numbers are hours unless they are said, or too large, to be", {
  expect_identical(read(c("23", "24.5", "49")), c(23, 24.5, 49))
  expect_identical(read(as.difftime(c(30, 90), units = "mins")), c(0.5, 1.5))
  for (case in list(list("seconds", 3600), list("minutes", 60), list("hours", 1),
                    list("days", 1 / 24))) {
    expect_equal(read(case[[2]] * 1:3, format = case[[1]]), 1:3)
  }
  expect_message(amiss:::read_time(1.6e9 + 60 * 1:3, "t"),
                 "Unix time, from 2020-09-13 12:27:40 UTC", class = "amiss_message_time")
  expect_no_message(time <- amiss:::read_time(60 * 1:3, "t", format = "unix"))
  expect_equal(as_utc(time[1]), "1970-01-01 00:01:00.0")
  expect_equal(format(read(1.6e9, zone = "Europe/Berlin"), "%H:%M"), "14:26")
  refused("holds numbers.*dmy", 1:3, format = "dmy")
  refused("class", I(list(1, 2)))
  expect_identical(read(structure(c(1800, 5400), units = "secs", class = c("hms", "difftime"))),
                   c(0.5, 1.5))
  expect_identical(read(structure(c(1800L, 5400L), class = "ITime")), c(0.5, 1.5))
  refused("class.*factor|class.*yearmon", structure(2020.5, class = "yearmon"))
})

test_that("the whole column tells day from month, or is refused", {
  days <- function(order) format(as.Date("2020-02-01") + 0:11, order)
  expect_equal(as_utc(read(days("%d/%m/%Y")))[12], "2020-02-12 00:00:00.0")
  expect_equal(as_utc(read(days("%m/%d/%Y")))[12], "2020-02-12 00:00:00.0")
  refused("cannot be decided.*dmy.*mdy", c("01/02/2020 01:00", "01/02/2020 02:00"))
  refused("cannot be decided", c("01/02/2020", "03/02/2020"))
  refused("cannot be decided", c("13/02/2020", "02/13/2020"))
  expect_equal(as_utc(read("01/02/2020 01:00", format = "dmy")), "2020-02-01 01:00:00.0")
  expect_equal(as_utc(read("01/02/2020 01:00", format = "mdy")), "2020-01-02 01:00:00.0")
  expect_equal(as_utc(read("01.02.2020 01:00")), "2020-02-01 01:00:00.0")
})

test_that("EnergyPlus' stamps are hours of the year", {
  expect_equal(read(c(" 01/21  00:15:00", " 01/21  24:00:00", " 01/22  00:15:00 ")),
               480 + c(0.25, 24, 24.25))
  expect_equal(read(c("02/28  24:00:00", "03/01  01:00:00")), c(59 * 24, 59 * 24 + 1))
  expect_equal(read(c("02/29  24:00:00", "03/01  01:00:00")), c(60 * 24, 60 * 24 + 1))
  expect_equal(read(c("12/31  24:00:00", "01/01  01:00:00")), c(8760, 8761))
  refused("row 2 holds", c("02/28  24:00:00", "02/30  01:00:00"))
})

test_that("rubbish is refused with its row and the option", {
  refused("row 2 holds.*foo.*time_format", c("2024-03-01 01:00:00", "2024-03-01 02:00:00 foo"))
  refused("row 2 holds.*30.02.2024", c("29.02.2024 01:00", "30.02.2024 01:00"))
  refused("row 1 holds", c("2024-03-01 25:00", "2024-03-01 26:00"))
  refused("row 1 holds", c("2024-03-01 13:00 PM", "2024-03-01 02:00 PM"))
  refused("missing value.*row 2", c("2024-03-01 01:00", "", "2024-03-01 03:00"))
  refused("some rows state.*row 2", c("2024-03-01T01:00Z", "2024-03-01T02:00"))
  refused("goes back in row 2",
          c("2024-03-01 03:00", "2024-03-01 02:00", "2024-03-01 05:00", "2024-03-01 06:00"))
  refused("time_format.*not known", 1:3, format = "weeks")
  refused("time_zone.*not known.*Etc/GMT-1", 1:3, zone = "CEST")
})

# Text as the clock of a zone shows `from` and the steps that follow.
local_text <- function(from, zone, minutes, n)
  format(at(from) + 60 * minutes * seq_len(n), "%Y-%m-%d %H:%M", tz = zone)

test_that("both changes of daylight saving are read in their zone", {
  zones <- c("Europe/Berlin", "Europe/London", "America/New_York", "Australia/Sydney",
             "America/Santiago", "Australia/Lord_Howe", "UTC")
  days <- c("03-10", "03-31", "04-07", "09-08", "10-06", "10-27", "11-03")
  steps <- c(10, 30, 60)
  for (i in seq_along(zones)) for (j in seq_along(days)) {
    zone <- zones[i]
    day <- days[j]
    minutes <- steps[1 + (i + j) %% 3]
    from <- paste0("2024-", day, " 00:00")
    n <- 30 * 60 / minutes
    time <- read(local_text(from, zone, minutes, n), zone = zone)
    expect_identical(as.numeric(time), as.numeric(at(from) + 60 * minutes * seq_len(n)),
                     info = paste(zone, minutes, day))
    expect_identical(attr(time, "tzone"), zone)
  }
})

test_that("a record that begins, ends or lacks rows in the repeated hour is read by its order", {
  read_part <- function(rows) {
    # 01:15 ... in Berlin; repeated: 02:00 to 02:45 of both
    stamps <- at("2024-10-26 23:00") + 900 * seq_len(20)
    time <- read(format(stamps[rows], "%d.%m.%Y %H:%M", tz = "Europe/Berlin"),
                 zone = "Europe/Berlin")
    expect_identical(as.numeric(time), as.numeric(stamps[rows]))
  }
  read_part(5:20)      # begins in the first
  read_part(9:20)      # begins in the second
  read_part(1:6)       # ends in the first
  read_part(c(1:7, 12:20))
  read_part(c(1:2, 8:20))
  sorted <- c("2024-10-27 02:00", "2024-10-27 02:00", "2024-10-27 02:15", "2024-10-27 02:15",
              "2024-10-27 02:30", "2024-10-27 02:30")
  refused("more than once", sorted, zone = "Europe/Berlin")
})

test_that("a time that the zone leaves out names the zone that the logger may have stayed in", {
  winter <- local_text("2024-03-31 00:00", "Etc/GMT-1", 15, 40)
  refused("row 4 holds.*02:00.*Europe/Berlin.*Etc/GMT-1", winter, zone = "Europe/Berlin")
  expect_equal(as_utc(read(winter, zone = "Etc/GMT-1"))[1], "2024-03-31 00:15:00.0")
})

test_that("local text is not read as UTC unasked", {
  for (zone in c("Europe/Berlin", "Europe/Helsinki", "America/New_York"))
    for (minutes in c(10, 60, 180)) {
      spring <- if (zone == "America/New_York") "2024-03-09" else "2024-03-30"
      autumn <- if (zone == "America/New_York") "2024-11-02" else "2024-10-26"
      n <- 48 * 60 / minutes
      refused(paste0("daylight saving begins.*", zone, ".*UTC"),
              local_text(paste(spring, "00:00"), zone, minutes, n))
      refused(paste0("daylight saving ends.*", zone, ".*UTC"),
              local_text(paste(autumn, "00:00"), zone, minutes, n))
    }
  spring <- local_text("2024-03-31 00:00", "Europe/Berlin", 60, 36)
  expect_equal(diff(as.numeric(read(spring, zone = "UTC")))[1:2] / 3600, c(1, 1))
  # An hour lost on another day, or at another time of that day, is an hour lost.
  lost <- local_text("2024-03-30 00:00", "UTC", 60, 40)
  expect_length(read(lost[-10]), 39)
  expect_length(read(local_text("2024-03-31 00:00", "UTC", 60, 40)[-12]), 39)
})

test_that("a record does not depend on how its time is written", {
  data <- linear_data()
  stamp <- at("2024-10-20 00:00") + 3600 * data$hour
  record <- function(time, ...) {
    data$time <- time
    linear_measurements(data[-1], time = "time", average = 2, warmup = 12, ...)
  }
  own <- record(stamp)
  parts <- setdiff(names(own), c("time_zone", "time_format", "time", "raw"))
  local <- record(format(stamp, "%d.%m.%Y %H:%M", tz = "Europe/Berlin"),
                  time_zone = "Europe/Berlin")
  expect_identical(local[parts], own[parts])
  expect_equal(local$time, own$time, ignore_attr = TRUE)
  expect_equal(amiss:::clock_hour(local$time[1]), 4)
  expect_identical(record(format(stamp, "%Y-%m-%d %H:%M:%S"))[c(parts, "time", "raw")],
                   own[c(parts, "time", "raw")])
})

test_that("runs and new data are read as the record's time", {
  data <- linear_data()
  stamp <- at("2024-10-20 00:00") + 3600 * data$hour
  data$time <- format(stamp, "%d/%m/%Y %H:%M", tz = "Europe/Berlin")
  m <- linear_measurements(data[-1], time = "time", time_format = "dmy",
                           time_zone = "Europe/Berlin")
  runs <- cbind(data$Ti, data$Ti + 1, data$Ti + 2, data$Ti - 1)
  placed <- amiss:::place_runs(runs, NULL, m, data$time)
  expect_equal(placed$hours, as.numeric(stamp) / 3600)
  new <- amiss:::new_record(m, data[180:220, ])
  expect_equal(new$hours, as.numeric(stamp[180:220]) / 3600)
  expect_equal(new$time, stamp[180:220], ignore_attr = TRUE)
})

test_that("a study says how its time is to be read", {
  path <- twinhouse_study("N2")
  study <- yaml::read_yaml(path)
  study$time_zone <- "Etc/GMT-1"
  study$fill_gaps_h <- 1
  for (field in c("data", "model", "catalogue"))
    study[[field]] <- file.path(normalizePath(dirname(path)), study[[field]])
  file <- withr::local_tempfile(fileext = ".yml")
  yaml::write_yaml(study, file)
  local <- read_study(file, trust = TRUE)$measurements
  unsaid <- read_study(path)$measurements
  expect_equal(local$hours, unsaid$hours - 1)
  expect_equal(amiss:::clock_hour(local$time), amiss:::clock_hour(unsaid$time))
})
