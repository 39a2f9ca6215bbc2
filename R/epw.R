#' Drivers as a weather file of EnergyPlus
#'
#' `drivers = epw_weather(...)` of [program_simulator()] writes what drives a run into an EPW file:
#' a template, in which the columns that were measured are replaced in the hours of the record. All
#' else stays as it is in the template: its eight lines of header, its other columns, the weather of
#' the rest of the year.
#'
#' Hour 1 of a day is the interval from 0:00 to 1:00. The clock of an EPW file is standard time
#' without daylight saving; its `LOCATION` line says how many hours that is ahead of UTC. Times of a
#' record that has dates are taken there; hours of a record without dates count from the beginning
#' of a year. Years do not matter: rows are found by month, day and hour.
#'
#' A value is the mean over the hour. EnergyPlus takes radiation so, but temperature, humidity,
#' pressure and wind as values at the end of the hour: name these in `instant`, and they are
#' interpolated to it.
#'
#' A value that EnergyPlus would take as missing, or as out of range, is an error, such as a
#' dry-bulb temperature of 99.9. Radiation down to -20 W/m2, the offset of a sensor at night, is
#' written as 0.
#'
#' @param template Path of an EPW file with one row for each hour.
#' @param columns Which driver gives which column: `c(dry_bulb = "Te", direct_normal = "In")`. The
#'   names of the columns are those of `epw_columns()`.
#' @param file Name of the file in the run's folder.
#' @param instant Those of `columns` that are values at the end of an hour.
#' @param utc_offset Hours that the clock of the file is ahead of UTC, if the template's `LOCATION`
#'   line is wrong.
#' @return `epw_weather()`: an object of class `amiss_epw`. `epw_columns()`: a data frame of the
#'   columns, in their order: `column`, `lower` and `upper` limit and the code for a `missing`
#'   value.
#' @source EnergyPlus, Auxiliary Programs, *EnergyPlus Weather File (EPW) Data Dictionary*.
#' @examples
#' # A small template: three hours of 1 January in a clock that is an hour ahead of UTC.
#' header <- c("LOCATION,Somewhere,-,DEU,None,000000,48.0,11.7,1.0,700.0", "DESIGN CONDITIONS,0",
#'             "TYPICAL/EXTREME PERIODS,0", "GROUND TEMPERATURES,0",
#'             "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0", "COMMENTS 1,-", "COMMENTS 2,-",
#'             "DATA PERIODS,1,1,Data,Sunday, 1/ 1, 1/ 1")
#' rest <- "999999,999999,999999,9999,180,2.0,5,5,9999,99999,9,999999999,10,0.1,0,88,0.2,0,1"
#' rows <- sprintf("2001,1,1,%d,60,?9,5.0,1.0,75,94000,9999,9999,300,0,0,0,%s", 1:3, rest)
#' template <- tempfile(fileext = ".epw")
#' writeLines(c(header, rows), template)
#' epw_weather(template, c(dry_bulb = "Te"), instant = "dry_bulb")
#' head(epw_columns(), 3)
#' @export
epw_weather <- function(template, columns, file = "weather.epw", instant = character(),
                        utc_offset = NULL) {
  check_arguments()
  check_input(checkmate::check_string(template, min.chars = 1), "template",
              "Give the path of an EPW file.")
  check_input(checkmate::check_character(columns, any.missing = FALSE, min.chars = 1, min.len = 1,
                                         names = "unique"),
              "columns", "Give for example {.code c(dry_bulb = \"Te\")}.")
  known <- epw_columns()$column
  unknown <- setdiff(names(columns), known)
  if (length(unknown)) {
    abort_input(c("{.arg columns} names {.val {unknown[1]}}, which is no column of an EPW file.",
                  i = "Known are {.val {known}}."))
  }
  check_input(checkmate::check_string(file, min.chars = 1), "file")
  check_inside(c(file = file))
  check_input(checkmate::check_character(instant, any.missing = FALSE), "instant",
              "Name some of {.arg columns}.")
  check_input(checkmate::check_subset(instant, names(columns)), "instant",
              "Name some of {.arg columns}.")
  check_input(checkmate::check_number(utc_offset, lower = -14, upper = 14, null.ok = TRUE),
              "utc_offset", "It is in hours.")
  epw <- read_epw(template)
  structure(c(list(file = file, columns = columns, instant = as.character(instant)), epw,
              list(utc_offset = utc_offset %||% epw_offset(epw$lines[1]))), class = "amiss_epw")
}

#' @rdname epw_weather
#' @export
epw_columns <- function() epw_table

epw_table <- local({
  radiation <- c("extraterrestrial_horizontal", "extraterrestrial_normal", "infrared_horizontal",
                 "global_horizontal", "direct_normal", "diffuse_horizontal")
  light <- c("global_illuminance", "direct_illuminance", "diffuse_illuminance")
  of <- function(column, lower, upper, missing) data.frame(column, lower, upper, missing)
  rbind(of(c("dry_bulb", "dew_point"), -70, 70, 99.9), of("relative_humidity", 0, 110, 999),
        of("pressure", 31000, 120000, 999999), of(radiation, 0, 9998, 9999),
        of(light, 0, 999899, 999999), of("zenith_luminance", 0, 9998, 9999),
        of("wind_direction", 0, 360, 999), of("wind_speed", 0, 40, 999),
        of(c("total_sky_cover", "opaque_sky_cover"), 0, 10, 99), of("visibility", 0, 9998, 9999),
        of("ceiling_height", 0, 99998, 99999), of("weather_observation", 0, 9, 9),
        of("weather_codes", 0, 999999998, 999999999), of("precipitable_water", 0, 998, 999),
        of("aerosol_optical_depth", 0, 0.998, 0.999), of("snow_depth", 0, 998, 999),
        of("days_since_snow", 0, 98, 99), of("albedo", 0, 1, 999), of("liquid_depth", 0, 998, 999),
        of("liquid_rate", 0, 98, 99))
})

#' @export
print.amiss_epw <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong EPW weather} in {.file {x$file}}: {length(x$key)} hours,",
                      "{x$utc_offset} h ahead of UTC"))
  say_bullets(paste0(names(x$columns), " from ", x$columns,
                     ifelse(names(x$columns) %in% x$instant, ", at the end of the hour",
                            ", mean of the hour")))
})

first_epw_field <- 7L  # before it stand year, month, day, hour, minute and flags

# list(lines, key): the lines of a template, and month, day and hour of those below the header as
# one number.
read_epw <- function(path, call = rlang::caller_env()) {
  refuse <- function(...) {
    why <- paste0(...)
    abort_input(c("The template {.file {path}} cannot be read as EPW: {why}.",
                  i = paste("Give a weather file of EnergyPlus: eight lines of header, then a row",
                            "for each hour.")), call = call)
  }
  if (!is_regular_file(path))
    refuse(if (dir.exists(path)) "it is a folder" else "there is no such file")
  lines <- lines_of(file_bytes(path))
  if (length(lines) < 9 || !startsWith(lines[1], "LOCATION"))
    refuse("its first line is not that of a LOCATION")
  if (!startsWith(lines[8], "DATA PERIODS")) refuse("line 8 does not say DATA PERIODS")
  per_hour <- trimws(strsplit(lines[8], ",", fixed = TRUE, useBytes = TRUE)[[1]][3])
  if (!identical(per_hour, "1")) refuse("it has ", per_hour, " rows an hour, where 1 is needed")
  fields <- regmatches(lines[-(1:8)],
                       regexec("^[^,]*,\\s*([0-9]+)\\s*,\\s*([0-9]+)\\s*,\\s*([0-9]+)\\s*,",
                               lines[-(1:8)]))
  bad <- which(lengths(fields) != 4)
  if (length(bad)) refuse("line ", bad[1] + 8, " has no month, day and hour")
  at <- matrix(as.integer(unlist(lapply(fields, `[`, -1))), 3)
  key <- epw_key(at[1, ], at[2, ], at[3, ])
  if (anyDuplicated(key))
    refuse("line ", anyDuplicated(key) + 8, " is of the same hour of the year as another")
  list(lines = lines, key = key)
}

epw_key <- function(month, day, hour) 10000 * month + 100 * day + hour

epw_offset <- function(location, call = rlang::caller_env()) {
  offset <- suppressWarnings(
    as.numeric(strsplit(location, ",", fixed = TRUE, useBytes = TRUE)[[1]][9]))
  if (isTRUE(abs(offset) <= 14)) return(offset)
  abort_input("The LOCATION line of the template states no time zone.", call = call)
}

# The bytes of the file for a table of drivers, remembered: a search asks for the same again and
# again, a run at a time.
epw_bytes <- function(epw, table, step_h, call = rlang::caller_env()) {
  key <- rlang::hash(list(epw, table, step_h))
  if (is.null(epw_memory[[key]])) {
    if (length(epw_memory) >= 20) rm(list = ls(epw_memory), envir = epw_memory)
    epw_memory[[key]] <- written_epw(epw, table, step_h, call)
  }
  epw_memory[[key]]
}

epw_memory <- new.env(parent = emptyenv())

written_epw <- function(epw, table, step_h, call) {
  if (step_h > 1 + 1e-6) {
    abort_input(
      c("An EPW file has a row for each hour; the drivers' step is {signif(step_h, 4)} h.",
        i = "Give measurements in steps of an hour or less."), call = call)
  }
  seconds <- clock_of_program(table$time, epw$utc_offset)
  ends <- 3600 * ceiling((seconds - 1) / 3600)
  hours <- unique(ends)
  lines <- epw$lines
  at <- 8 + epw_rows(epw, hours, call)
  fields <- strsplit(lines[at], ",", fixed = TRUE, useBytes = TRUE)
  for (column in names(epw$columns)) {
    x <- table[[epw$columns[[column]]]]
    values <- if (column %in% epw$instant) values_at_ends(x, seconds, hours, step_h,
                                                          column) else hour_means(x, ends, column)
    values <- epw_values(values, column, epw$columns[[column]], lines[at], call)
    place <- first_epw_field - 1L + match(column, epw_columns()$column)
    short <- which(lengths(fields) < place)
    if (length(short)) {
      abort_input("Line {at[short[1]]} of the EPW template has no field for {.val {column}}.",
                  call = call)
    }
    fields <- Map(function(row, value) replace(row, place, value), fields, sprintf("%.7g", values))
  }
  lines[at] <- vapply(fields, paste, "", collapse = ",")
  charToRaw(paste0(lines, "\n", collapse = ""))
}

# Seconds since 1970 as the program's clock shows them; hours without a date count from the
# beginning of 2001.
clock_of_program <- function(time, utc_offset) {
  if (is.numeric(time)) 3600 * time + year_start(2001) else as.numeric(time) + 3600 * utc_offset
}

year_start <- function(year) 86400 * as.numeric(as.Date(paste0(year, "-01-01")))

# The rows of the template for hours that end at these seconds.
epw_rows <- function(epw, hours, call) {
  middle <- as.POSIXlt(utc(hours - 1800), tz = "UTC")
  key <- epw_key(middle$mon + 1, middle$mday, middle$hour + 1)
  at <- match(key, epw$key)
  if (anyNA(at)) {
    lost <- format(middle[is.na(at)][1], "%d %B")
    abort_input(c(paste("The EPW template has no row for hour {middle$hour[is.na(at)][1] + 1} of",
                        "{lost}; {sum(is.na(at))} hour{?s} of the record {?is/are} not in it."),
                  i = paste("Give a template of the year, or the part of it, that the record",
                            "covers, a leap day included.")), call = call)
  }
  twice <- anyDuplicated(key)
  if (twice) {
    abort_input(c(paste("The record has {format(middle[twice], '%d %B')} twice; an EPW file holds",
                        "one year."), i = "Cut the record into segments of at most a year."),
                call = call)
  }
  at
}

hour_means <- function(x, ends, column) {
  mean_of <- function(x) as.numeric(rowsum(x, ends, reorder = FALSE)) / as.numeric(
    rowsum(rep(1, length(x)), ends, reorder = FALSE))
  if (column != "wind_direction") return(mean_of(x))
  (atan2(mean_of(sin(x * pi / 180)), mean_of(cos(x * pi / 180))) * 180 / pi) %% 360
}

# At the ends of hours, between the middles of the rows.
values_at_ends <- function(x, seconds, hours, step_h, column) {
  line <- function(x) stats::approx(seconds - 1800 * step_h, x, hours, rule = 2)$y
  if (length(x) < 2) return(x)
  if (column != "wind_direction") return(line(x))
  (atan2(line(sin(x * pi / 180)), line(cos(x * pi / 180))) * 180 / pi) %% 360
}

night_offset <- -20  # W/m2

epw_values <- function(values, column, driver, rows, call) {
  limits <- epw_columns()[match(column, epw_columns()$column), ]
  if (grepl("_(horizontal|normal)$", column)) values[values < 0 & values >= night_offset] <- 0
  bad <- which(values < limits$lower | values > limits$upper | values == limits$missing)
  if (length(bad)) {
    where <- paste(strsplit(rows[bad[1]], ",", fixed = TRUE)[[1]][2:4], collapse = "/")
    abort_input(c(paste("Driver {.val {driver}} is {signif(values[bad[1]], 6)} at month/day/hour",
                        "{where}, where {.val {column}} of an EPW file goes from {limits$lower} to",
                        "{limits$upper}."),
                  i = "EnergyPlus would take it as missing: see to its unit, or mend the record."),
                call = call)
  }
  values
}
