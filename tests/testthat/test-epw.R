# Weather files of EnergyPlus.

epw_header <- function(zone = "1.0", per_hour = 1) {
  c(paste0("LOCATION,Somewhere,-,DEU,None,000000,48.0,11.7,", zone, ",700.0"),
    "DESIGN CONDITIONS,0", "TYPICAL/EXTREME PERIODS,0", "GROUND TEMPERATURES,0",
    "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0", "COMMENTS 1,\u00e9t\u00e9", "COMMENTS 2,-",
    sprintf("DATA PERIODS,1,%d,Data,Sunday, 1/ 1,12/31", per_hour))
}

# Hours of some days, each with the dry-bulb temperature of its place.
epw_rows_of <- function(days) {
  hours <- seq(as.POSIXct(paste(days[1], "00:30"), tz = "UTC"),
               as.POSIXct(paste(days[2], "23:30"), tz = "UTC"), 3600)
  at <- as.POSIXlt(hours)
  sprintf(paste0("2001,%d,%d,%d,60,?9?9,%d.5,1.0,75,94000,9999,9999,300,10,20,30,999999,999999,",
                 "999999,9999,180,2.0,5,5,9999,99999,9,999999999,10,0.1,0,88,0.2,0,1"),
          at$mon + 1, at$mday, at$hour + 1, seq_along(hours) %% 20)
}

epw_file <- function(..., days = c("2001-12-30", "2001-12-31"), rows = epw_rows_of(days),
                     frame = parent.frame()) {
  withr::local_tempfile(lines = c(epw_header(...), rows), fileext = ".epw", .local_envir = frame)
}

# The fields that an EPW has after a table of drivers was written: a matrix of the rows, and the
# lines.
written <- function(weather, time, ..., step_h = 1) {
  bytes <- epw_bytes(weather, data.frame(time = time, ...), step_h)
  lines <- strsplit(rawToChar(bytes), "\n", fixed = TRUE)[[1]]
  fields <- do.call(rbind, strsplit(lines[-(1:8)], ","))
  list(lines = lines, fields = fields)
}

stamps <- function(from, n, by = 3600) as.POSIXct(from, tz = "UTC") + by * seq_len(n)

test_that(
  "the columns that are named are replaced in the hours of the record, and all else stays", {
  template <- epw_file()
  weather <- epw_weather(template, c(dry_bulb = "Te", direct_normal = "In"))
  # 23:00 UTC of 29 December is midnight there: hour 1 of the 30th is the row that ends at 0:00 UTC.
  out <- written(weather, stamps("2013-12-29 23:00", 3), Te = c(-3.25, 1e-3, 20.123456),
                 In = c(0, -5, 800))
  before <- readLines(template)
  expect_identical(out$lines[c(1:8, 12:56)], before[c(1:8, 12:56)])
  expect_identical(out$fields[1:3, 7], c("-3.25", "0.001", "20.12346"))
  expect_identical(out$fields[1:3, 15], c("0", "0", "800"))
  expect_identical(out$fields[1:3, -c(7, 15)],
                   do.call(rbind, strsplit(before[9:11], ","))[, -c(7, 15)])
  expect_match(printed(weather), "48 hours, 1 h ahead of UTC.*dry_bulb from Te, mean of the hour")
})

test_that("a template of Windows, in Latin-1, is read", {
  file <- withr::local_tempfile()
  lines <- epw_header()
  lines[c(1, 6)] <- c("LOCATION,M*nchen,-,DEU,None,0,48.0,11.7,1.0,700.0", "COMMENTS 1,-")
  bytes <- charToRaw(paste0(c(lines, epw_rows_of(c("2001-12-30", "2001-12-30"))), "\r\n",
                            collapse = ""))
  bytes[bytes == charToRaw("*")] <- as.raw(0xfc)
  writeBin(bytes, file)
  weather <- epw_weather(file, c(dry_bulb = "Te"))
  expect_identical(weather$utc_offset, 1)
  bytes <- epw_bytes(weather, data.frame(time = stamps("2013-12-29 23:00", 2), Te = 1:2), 1)
  expect_length(grepRaw(as.raw(c(0x4d, 0xfc)), bytes), 1)
  expect_length(grepRaw(charToRaw("?9,1,1.0"), bytes, fixed = TRUE), 1)
})

test_that("hour 24 ends a day, and years do not matter", {
  weather <- epw_weather(epw_file("0.0"), c(dry_bulb = "Te"))
  out <- written(weather, stamps("2013-12-30 22:00", 3), Te = c(101, 102, 103) / 10)
  expect_identical(out$fields[23:25, c(2:4, 7)],
                   cbind("12", c("30", "30", "31"), c("23", "24", "1"), c("10.1", "10.2", "10.3")))
  hours <- 24 * 363 + 1:3  # of a year that is not known: 30 December
  expect_identical(written(weather, hours, Te = 1:3)$fields[1:3, 7], c("1", "2", "3"))
})

test_that(
  "finer rows are averaged over the hour, directions as such, and instants are taken at its end", {
  weather <- epw_weather(epw_file("0.0"),
                         c(dry_bulb = "Te", wind_direction = "Wd", relative_humidity = "RH"),
                         instant = "relative_humidity")
  te <- 1:12
  out <- written(weather, stamps("2013-12-30", 12, 600), Te = te, Wd = rep(c(350, 10), 6), RH = te,
                 step_h = 1 / 6)
  expect_identical(out$fields[1:2, 7], c("3.5", "9.5"))
  expect_true(
    all(pmin(as.numeric(out$fields[1:2, 21]), 360 - as.numeric(out$fields[1:2, 21])) < 1e-6))
  expect_identical(out$fields[1:2, 9], c("6.5", "12"))  # the last row has none after it
})

test_that("what EnergyPlus would take as missing, and hours that are not there, are refused", {
  weather <- epw_weather(epw_file("0.0"), c(dry_bulb = "Te", global_horizontal = "G"))
  refused <- function(pattern, time = stamps("2013-12-30", 2), Te = c(1, 2), G = 0, ...) {
    expect_error(written(weather, time, Te = Te, G = G, ...), pattern, class = "amiss_error_input")
  }
  refused("\"Te\" is 99.9 at month/day/hour 12/30/2.*from -70 to 70", Te = c(1, 99.9))
  refused("\"G\" is -40", G = c(0, -40))
  refused("no row for hour 1 of 29 December; 1 hour", time = stamps("2013-12-29", 1), Te = 1)
  refused("no row for hour 1 of 29 February", time = stamps("2012-02-29", 1), Te = 1)
  refused("step is 3 h", step_h = 3)
  expect_error(written(weather, stamps("2013-12-30", 8770), Te = 1, G = 1),
               class = "amiss_error_input")
})

test_that("a template that is none, and columns that are none, are refused", {
  refused <- function(pattern, template = epw_file(), columns = c(dry_bulb = "Te"), ...) {
    expect_error(epw_weather(template, columns, ...), pattern, class = "amiss_error_input")
  }
  refused("no such file", "nowhere.epw")
  refused("it is a folder", withr::local_tempdir())
  refused("LOCATION", withr::local_tempfile(lines = letters))
  refused("4 rows an hour", epw_file(per_hour = 4))
  refused("same hour", epw_file(rows = rep(epw_rows_of(c("2001-01-01", "2001-01-01")), 2)))
  refused("line 10 has no month",
          epw_file(rows = c(epw_rows_of(c("2001-01-01", "2001-01-01"))[1], "a,b")))
  refused("time zone", epw_file("east"))
  refused("no column of an EPW", columns = c(temperature = "Te"))
  refused("columns", columns = "Te")
  refused("instant", instant = "wind_speed")
  refused("run's directory", file = "../w.epw")
  expect_identical(nrow(epw_columns()), 29L)
})

# A chain that reads EPW: awk takes hour and temperature of the file, a second program extracts.
epw_chain <- function(template, ..., frame = parent.frame()) {
  model <- c("BEGIN { FS = \",\"; print \"Date/Time,Ti\" }",
             "NR > 8 { printf \" %02d/%02d  %02d:00:00,%.6f\\n\", $2, $3, $4, 20 + {{gain}} * $7 }")
  program_simulator(list(program_step("awk", "-f", "model.awk", "weather.epw", stdout = "all.csv"),
                         program_step("grep", "-v", "^$", "all.csv")),
                    free("gain", uniform(0, 2)), templates = list(model.awk = I(model)),
                    drivers = epw_weather(template, c(dry_bulb = "Te")),
                    output = program_output("stdout.txt", "Ti", time = "Date/Time"),
                    cache = withr::local_tempdir(.local_envir = frame), ...)
}

test_that(paste("a chain of programs is driven by the weather file, and its output is matched in",
                "the file's clock"), {
  skip_on_os("windows")
  program <- epw_chain(epw_file())
  expect_identical(driver_names(program), "Te")
  time <- stamps("2013-12-30 05:00", 6, 3600)
  runs <- simulate_runs(program, cbind(gain = c(1, 2)), cbind(Te = 1:6), 1, time = time)
  expect_equal(runs, cbind(20 + 1:6, 20 + 2 * (1:6)))
  half <- stamps("2013-12-30 05:00", 4, 1800)
  expect_warning(simulate_runs(program, cbind(gain = 1), cbind(Te = 1:4), 0.5, time = half),
                 "further apart", class = "amiss_warning_input")
})

test_that("drivers are several files, or what a function writes", {
  skip_on_os("windows")
  drivers <- list("drivers.csv", epw_weather(epw_file("0.0"), c(dry_bulb = "Te")),
                  function(table, folder) {
    writeLines(format(2 * table$Te), file.path(folder, "twice.txt"))
  })
  made <- function(drivers) {
    program_simulator(c("sh", "-c", "ls; echo Ti; cat twice.txt; # {{a}}"),
                      free("a", uniform(0, 1)), boundary = "Te", drivers = drivers,
                      output = program_output("stdout.txt", "Ti"), keep = 1,
                      cache = withr::local_tempdir(.local_envir = parent.frame()))
  }
  time <- stamps("2013-12-30", 3)
  expect_equal(simulate_runs(made(drivers), cbind(a = 0.5), cbind(Te = 1:3), 1, time = time)[, 1],
               c(2, 4, 6))
  run <- function(f) simulate_runs(made(f), cbind(a = 0.5), cbind(Te = 1:3), 1, time = time)
  expect_error(run(function(table, folder) NULL), "wrote no file", class = "amiss_error_input")
  expect_error(run(function(table, folder) stop("no sun")), "stopped: no sun",
               class = "amiss_error_input")
  expect_error(made(function(table) NULL), "1 argument", class = "amiss_error_input")
  expect_error(made(list("a.csv", "a.csv")), "twice", class = "amiss_error_input")
  expect_error(made(list(1)), "drivers", class = "amiss_error_input")
})
