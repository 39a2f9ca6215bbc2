# What a time column holds: what its people say, or what it can be alone. A column that could be
# several things is refused, with the `time_format` of each.

read_time <- function(values, name, format = NULL, zone = NULL, call = rlang::caller_env()) {
  time_reading(values, name, format, zone, call)$time
}

# list(time, format), the format as it was settled, in which other values of the same record are
# read.
time_reading <- function(values, name, format = NULL, zone = NULL, call = rlang::caller_env()) {
  check_time_options(format, zone, call)
  values <- plain_time(values, name, call)
  format <- settled_format(values, name, format, zone, call)
  time <- parse_time(values, name, format, zone, call)
  check_time(time, values, name, call)
  list(time = time, format = format)
}

check_time_options <- function(format, zone, call) {
  check_input(checkmate::check_string(format, null.ok = TRUE), "time_format", call = call)
  known <- c(day_orders, number_formats)
  if (!is.null(format) && !format %in% known && !is_pattern(format)) {
    abort_input(c("{.arg time_format} = {.val {format}} is not known.",
                  i = paste("Give one of {.val {known}}, or a format of {.fun strptime} such as",
                            "{.val %d.%m.%Y %H:%M}.")), call = call)
  }
  absent <- if (is_pattern(format)) pattern_lacks(format)
  if (length(setdiff(absent, "day"))) {
    abort_input(c(paste("{.arg time_format} = {.val {format}} has no {listed(absent)}, for which",
                        "{.fun strptime} takes those of today."),
                  i = paste("Put the date in front of the time of day in {.arg data}, and its",
                            "format here.")), call = call)
  }
  check_input(checkmate::check_string(zone, null.ok = TRUE), "time_zone", call = call)
  if (!is.null(zone) && !zone %in% zone_names()) {
    abort_input(c("{.arg time_zone} = {.val {zone}} is not known.",
                  i = paste("Give {.val UTC} or a name such as {.val Europe/Berlin}",
                            "({.fun OlsonNames} lists them); for one hour ahead of UTC all year",
                            "{.val Etc/GMT-1}, with that sign.")),
                call = call)
  }
}

# Listed once for a session: each time OlsonNames() walks through a tree of folders.
known_zones <- new.env(parent = emptyenv())

zone_names <- function() {
  if (is.null(known_zones$names)) known_zones$names <- OlsonNames()
  known_zones$names
}

# Text, plain numbers, or one of the classes that parse_time() reads.
plain_time <- function(values, name, call) {
  values <- plain_numbers(values)
  if (is.factor(values)) return(as.character(values))
  if (inherits(values, c("POSIXt", "Date")) || is_span(values) || is.character(values))
    return(values)
  if (is.numeric(values) && !is.object(values)) return(as.numeric(values))
  abort_input(c("Time column {.val {name}} is of class {.cls {class(values)}}.",
                i = paste("Give text, numbers, {.cls POSIXct}, {.cls POSIXlt}, {.cls Date} or",
                          "{.cls difftime}; most other classes become {.cls POSIXct} by",
                          "{.fun as.POSIXct}, lengths of time hours by",
                          "{.code as.numeric(x, \"hours\")}.")), call = call)
}

settled_format <- function(values, name, format, zone, call) {
  plain <- is.character(values) || is.numeric(values) && !is_span(values)
  if (is_pattern(format) || !plain) return(format)
  numbers <- if (is.character(values)) text_numbers(clean_text(values)) else values
  if (is.null(numbers)) {
    if (said_order(format)) return(format)
    return(day_order(stamp_parts(clean_text(values), name, call), name, call))
  }
  if (is.null(format)) return(number_format(numbers, name, zone, call))
  if (!format %in% number_formats) {
    abort_input(c(paste("Time column {.val {name}} holds numbers, which {.arg time_format} =",
                        "{.val {format}} does not go with."),
                  i = paste("For numbers it is one of {.val {number_formats}}, or a format of",
                            "{.fun strptime} such as {.val %Y%m%d%H}.")), call = call)
  }
  format
}

largest_hours <- 1.8e7  # two thousand years
# What people count in, as hours and days are written: steps of other lengths are hardly anybody's.
usual_steps <- c(c(1, 2, 5, 6, 10, 12, 15, 20, 30) / 3600,
                 c(1, 2, 3, 4, 5, 6, 10, 12, 15, 20, 30) / 60,
                 c(1, 2, 3, 4, 6, 8, 12), 24 * c(1, 2, 5, 7, 10, 14, 30, 31))

# The share of the steps that are the usual one, 0 if that is none of people's.
step_fit <- function(hours) {
  steps <- diff(sort(hours))
  step <- stats::median(steps)
  if (!length(steps) || !any(abs(usual_steps / step - 1) < 0.01)) return(0)
  mean(abs(steps / step - 1) < 0.25)
}

# What the numbers are, if they can be one thing only. Small ones in usual steps of hours are hours.
number_format <- function(numbers, name, zone, call) {
  known <- sort(unique(numbers[is.finite(numbers)]))
  hours <- max(abs(known), 0) < largest_hours
  if (length(known) < 3 && hours) return("hours")
  dated <- dated_formats(known)
  if (!length(dated)) refuse_periods(known, name, call)
  fits <- fit_of(dated, known)
  if (any(fits > 0.5)) dated <- dated[fits > 0.5 & fits > 0.95 * max(fits)]
  if (any(startsWith(dated, "%Y"))) dated <- dated[startsWith(dated, "%Y")]
  if (hours && fit_of("hours", known) > 0.5) {
    could_be <- c(dated[fit_of(dated, known) > 0.5], named_unit(name))
    if (!length(could_be)) return("hours")
  } else {
    if (length(dated) == 1 && (!hours || fit_of(dated, known) > 0.5))
      return(told_format(dated, known, name, zone))
    units <- setdiff(names(time_units), "hours")
    could_be <- c(dated, if (hours) units[fit_of(units, known) > 0.5])
    if (hours && !length(could_be) && stats::median(diff(known)) <= 24) return("hours")
  }
  refuse_numbers(known, unique(c(if (hours) "hours", could_be)), name, zone, call)
}

fit_of <- function(formats, numbers) {
  vapply(formats, function(format) step_fit(number_hours(numbers, format)), 0, USE.NAMES = FALSE)
}

number_hours <- function(numbers, format) {
  if (is_pattern(format)) return(digit_hours(numbers, format))
  if (format %in% names(time_units)) return(numbers * time_units[[format]])
  (if (format == "unix") unix_seconds(numbers) else serial_seconds(numbers, format)) / 3600
}

# Digits of a date without signs between them, those of a year of four first.
digit_formats <- c(
  "%Y%m%d", "%Y%m%d%H", "%Y%m%d%H%M", "%Y%m%d%H%M%S", "%Y%m", "%Y%j", "%Y%j%H", "%Y%j%H%M",
  "%y%m%d", "%y%m%d%H", "%y%m%d%H%M", "%y%m%d%H%M%S",
  "%d%m%Y", "%m%d%Y", "%d%m%Y%H", "%m%d%Y%H", "%d%m%Y%H%M", "%m%d%Y%H%M")

# Hours since 1970, NA for what is no date of 1950 to 2099.
digit_hours <- function(numbers, format) {
  text <- stamp_text(numbers, format)
  hours <- pattern_seconds(text, format) / 3600
  hours[nchar(text) != stamp_width(format) | hours < -20 * 8766 | hours > 130 * 8766] <- NA
  hours
}

# Days that are counted from a date: numbers of them that measurements of our time have.
serial_ranges <- list(excel = c(25569, 50000), matlab = c(712224, 767000),
                      julian = c(2433282, 2488070),
                      mjd = c(50000, 70000), unix_days = c(12000, 25569))

# The formats in which all these numbers are dates.
dated_formats <- function(numbers) {
  digits <- Filter(function(format) !anyNA(digit_hours(numbers, format)), fitting_widths(numbers))
  serial <- Filter(function(days) all(numbers >= days[1] & numbers < days[2]), serial_ranges)
  size <- max(abs(numbers))
  unix <- any(size >= c(1e8, 1e12, 1e15, 1e18) & size < c(1e10, 1e13, 1e16, 1e19))
  c(digits, names(serial), if (unix) "unix")
}

# Formats of as many digits as the numbers have; a zero in front is lost.
fitting_widths <- function(numbers) {
  if (any(numbers != round(numbers)) || any(numbers < 0)) return(character())
  lost <- ifelse(startsWith(digit_formats, "%Y"), 0, 1)
  width <- vapply(digit_formats, stamp_width, 0L) - nchar(sprintf("%.0f", max(numbers)))
  digit_formats[width >= 0 & width <= lost]
}

name_words <- function(name) strsplit(tolower(name), "[^a-z]+")[[1]]

# Months and years are of no one length, and a number of a week says no year.
refuse_periods <- function(numbers, name, call) {
  words <- name_words(name)
  periods <- c("week", "weeks", "month", "months", "quarter", "year", "years", "yr", "yrs")
  counted <- intersect(words, periods)
  if (!length(counted) || any(c("hour", "hours", "h", "day", "days") %in% words))
    return(invisible())
  abort_input(c(paste("Time column {.val {name}} holds numbers such as {format(numbers[1])}: a",
                      "{counted[1]} has no fixed length in hours."),
                i = paste("Give dates, for example {.val 2024-03-01}, or days with",
                          "{.code time_format = \"days\"}.")), call = call)
}

# The unit that a column's name says, if it is not hours: "seconds", "t_min", "Time [d]", "doy".
named_unit <- function(name) {
  words <- name_words(name)
  said <- c(s = "seconds", sec = "seconds", secs = "seconds", second = "seconds",
            seconds = "seconds", min = "minutes", mins = "minutes", minute = "minutes",
            minutes = "minutes", d = "days", day = "days", days = "days", doy = "days",
            jday = "days", yday = "days")
  if (any(c("h", "hr", "hrs", "hour", "hours") %in% words)) return(NULL)
  unique(unname(said[words[words %in% names(said)]]))
}

format_words <- c(unix = "Unix time", excel = "days of Excel", matlab = "days of MATLAB",
                  julian = "Julian days", mjd = "modified Julian days",
                  unix_days = "days since 1970")

# The first of the numbers in words, as a format reads it.
first_shown <- function(format, numbers, zone) {
  hours <- number_hours(numbers, format)
  if (format %in% names(time_units)) return(paste("steps of", step_words(hours)))
  clock <- if (format == "unix") zone %||% "UTC" else "UTC"
  first <- format(on_clock(utc(3600 * hours[1]), clock),
                  if (format == "unix") "%Y-%m-%d %H:%M:%S %Z" else "%Y-%m-%d %H:%M")
  if (length(hours) < 2) first else paste0(first, ", steps of ", step_words(hours))
}

step_words <- function(hours) {
  step <- stats::median(diff(hours))
  unit <- if (step >= 48) c(24, "d")
          else if (step >= 1) c(1, "h")
          else if (step >= 1 / 60) c(1 / 60, "min")
          else c(1 / 3600, "s")
  paste(signif(step / as.numeric(unit[1]), 3), unit[2])
}

told_format <- function(format, numbers, name, zone) {
  what <- if (is_pattern(format)) "digits of a date" else format_words[[format]]
  shown <- first_shown(format, numbers, zone)
  cli::cli_inform(
    c("Time column {.val {name}} is read as {what}, from {shown}: its numbers do not fit hours.",
      i = "{.code time_format = \"{format}\"} settles it."), class = "amiss_message_time")
  format
}

refuse_numbers <- function(numbers, could_be, name, zone, call) {
  first <- format(numbers[1], digits = 15, scientific = FALSE)
  if (!length(could_be)) {
    abort_input(c(paste("Time column {.val {name}} holds numbers that are neither hours nor Unix",
                        "time, such as {first}."),
                  i = paste("Say by {.arg time_format} what they are, for example",
                            "{.val %d%m%Y%H%M}, or one of {.val {number_formats}}.")), call = call)
  }
  if (identical(could_be, "hours")) could_be <- names(time_units)
  shown <- vapply(could_be, function(format) {
    sprintf("{.code time_format = \"%s\"}: %s", format, first_shown(format, numbers, zone))
  }, "")
  abort_input(
    c("Time column {.val {name}} holds numbers, such as {first}, that could be several things.",
      stats::setNames(shown, rep("*", length(shown))), i = "Say which by {.arg time_format}."),
    call = call)
}
