# Time as people have it, read into the one form that all later stages use: POSIXct where the date is known, numbers
# (hours) where it is not.

time_units <- c(seconds = 1 / 3600, minutes = 1 / 60, hours = 1, days = 24)
day_orders <- c("ymd", "dmy", "mdy")

read_time <- function(values, name, format = NULL, zone = NULL, call = rlang::caller_env()) {
  check_time_options(format, zone, call)
  time <- parse_time(values, name, format, zone, call)
  check_time(time, values, name, call)
  time
}

# Hours, since 1970 in UTC where the date is known.
time_hours <- function(time) as.numeric(time) / if (is.numeric(time)) 1 else 3600

check_time_options <- function(format, zone, call) {
  check_input(checkmate::check_string(format, null.ok = TRUE), "time_format", call = call)
  known <- c(day_orders, names(time_units), "unix")
  if (!is.null(format) && !format %in% known && !is_pattern(format)) {
    abort_input(c("{.arg time_format} = {.val {format}} is not known.",
                  i = "Give one of {.val {known}}, or a format of {.fun strptime} such as {.val %d.%m.%Y %H:%M}."),
                  call = call)
  }
  check_input(checkmate::check_string(zone, null.ok = TRUE), "time_zone", call = call)
  if (!is.null(zone) && !zone %in% zone_names()) {
    abort_input(c("{.arg time_zone} = {.val {zone}} is not known.",
                  i = paste("Give {.val UTC} or a name such as {.val Europe/Berlin} ({.fun OlsonNames} lists them);",
                            "for one hour ahead of UTC all year {.val Etc/GMT-1}, with that sign.")),
                  call = call)
  }
}

# Listed once for a session: each time OlsonNames() walks through a tree of folders.
zone_names <- local({
  names <- NULL
  function() {
    if (is.null(names)) names <<- OlsonNames()
    names
  }
})

is_pattern <- function(format) !is.null(format) && grepl("%", format, fixed = TRUE)

parse_time <- function(values, name, format, zone, call) {
  if (is.factor(values)) values <- as.character(values)
  if (inherits(values, "POSIXt")) return(on_clock(as.POSIXct(values), zone))
  if (inherits(values, "Date")) return(utc(86400 * as.numeric(values)))
  if (inherits(values, "difftime")) return(as.numeric(values, units = "hours"))
  if (is.character(values)) return(parse_text(values, name, format, zone, call))
  if (!is.numeric(values) || is.object(values)) {
    abort_input(c("Time column {.val {name}} is of class {.cls {class(values)}}.",
                  i = "Give text, numbers, {.cls POSIXct}, {.cls POSIXlt} or {.cls Date}."), call = call)
  }
  if (is_pattern(format)) parse_text(base::format(values, scientific = FALSE, trim = TRUE), name, format, zone, call)
  else parse_numbers(as.numeric(values), name, format, zone, call)
}

utc <- function(seconds) as.POSIXct(seconds, origin = "1970-01-01", tz = "UTC")

# With the clock of `zone`, else its own.
on_clock <- function(time, zone) {
  attr(time, "tzone") <- zone %||% attr(time, "tzone")[1]
  time
}

# Numbers that are too large for hours (1e8 hours are 11 000 years) count the seconds or milliseconds of Unix.
parse_numbers <- function(numbers, name, format, zone, call) {
  if (!is.null(format) && !format %in% c(names(time_units), "unix")) {
    abort_input(
      c("Time column {.val {name}} holds numbers, which {.arg time_format} = {.val {format}} does not go with.",
                  i = paste("For numbers it is one of {.val {c(names(time_units), 'unix')}}, or a format of",
                            "{.fun strptime} such as {.val %Y%m%d%H}.")),
                call = call)
  }
  if (is.null(format)) format <- number_format(numbers, name, zone, call)
  if (format == "unix") on_clock(unix_time(numbers), zone %||% "UTC") else numbers * time_units[[format]]
}

number_format <- function(numbers, name, zone, call) {
  size <- range(abs(numbers[is.finite(numbers)]), 0.5)[2]
  if (size < 1e8) return("hours")
  first <- numbers[is.finite(numbers)][1]
  if (!(size < 1e10 || size >= 1e12 && size < 1e13)) {
    abort_input(c(paste("Time column {.val {name}} holds numbers that are neither hours nor Unix time, such as",
                        "{format(first, scientific = FALSE)}."),
                  i = "Say by {.arg time_format} what they are, for example {.val %Y%m%d%H%M}."), call = call)
  }
  shown <- format(on_clock(unix_time(first), zone %||% "UTC"), "%Y-%m-%d %H:%M:%S %Z")
  cli::cli_inform(
    c("Time column {.val {name}} is read as Unix time, from {shown}: its numbers are too large for hours.",
                    i = paste("{.code time_format = \"unix\"} settles it; digits of a date need a format such as",
                              "{.val %Y%m%d%H}.")),
                  class = "amiss_message_time")
  "unix"
}

unix_time <- function(numbers) utc(if (any(numbers >= 1e11, na.rm = TRUE)) numbers / 1000 else numbers)

parse_text <- function(text, name, format, zone, call) {
  text <- trimws(text)
  text[!nzchar(text)] <- NA
  if (is_pattern(format)) return(pattern_time(text, name, format, zone, call))
  numbers <- suppressWarnings(as.numeric(text))
  if (identical(is.na(numbers), is.na(text))) return(parse_numbers(numbers, name, format, zone, call))
  stamps_time(text, name, format, zone, call)
}

require_read <- function(unread, text, name, call) {
  bad <- which(unread & !is.na(text))
  if (!length(bad)) return(invisible())
  abort_input(c("Time column {.val {name}} cannot be read: row {bad[1]} holds {.val {text[bad[1]]}}.",
                i = paste("Use ISO 8601, for example 2013-08-30T00:10:00, or say by {.arg time_format} what it is, for",
                          "example {.val %d.%m.%Y %H:%M}.")),
              call = call)
}

pattern_time <- function(text, name, format, zone, call) {
  seconds <- as.numeric(as.POSIXct(strptime(text, format, tz = "UTC")))
  require_read(is.na(seconds), text, name, call)
  if (grepl("%z", format, fixed = TRUE)) on_clock(utc(seconds), zone) else local_time(seconds, text, name, zone, call)
}

# The forms of a date, the first for which all rows stand; a date without a year is EnergyPlus'.
date_forms <- c(ymd = "(\\d{4})[-/.](\\d{1,2})[-/.](\\d{1,2})", day_month = "(\\d{1,2})([-/.])(\\d{1,2})\\2(\\d{4})",
                dotted = "(\\d{1,2})(\\.)(\\d{1,2})\\.(\\d{2})", no_year = "(\\d{1,2})/(\\d{1,2})")
clock_form <- paste0("(?:(?:T|,?\\s+)(\\d{1,2}):(\\d{2})(?::(\\d{2}(?:[.,]\\d+)?))?\\s*([AaPp][Mm])?",
                     "\\s*(Z|UTC|GMT|[+-]\\d{2}(?::?\\d{2})?)?)?")

stamps_time <- function(text, name, format, zone, call) {
  forms <- paste0("^", date_forms, clock_form, "$")
  stands <- vapply(forms, function(form) sum(grepl(form, text, perl = TRUE)), 0)
  k <- which.max(stands)
  parts <- captures(forms[k], text)
  require_read(is.na(parts[, 1]), text, name, call)
  clock <- parts[, ncol(parts) - 4:0, drop = FALSE]
  seconds <- clock_seconds(clock)
  date <- switch(names(date_forms)[k], ymd = parts[, 1:3, drop = FALSE],
                 no_year = cbind(NA, parts[, 1:2, drop = FALSE]),
                 ordered_date(parts[, 1:4, drop = FALSE], name, format, call))
  if (names(date_forms)[k] == "no_year") {
    hours <- hours_of_year(date, seconds)
    require_read(is.na(hours), text, name, call)
    return(hours)
  }
  seconds <- 86400 * day_number(date) + seconds
  require_read(is.na(seconds), text, name, call)
  offset <- offset_seconds(clock[, 5])
  without <- is.na(offset) & !is.na(text)
  if (!any(without)) return(on_clock(utc(seconds - offset), zone %||% "UTC"))
  if (!all(is.na(offset))) {
    abort_input(c(paste("Time column {.val {name}}: some rows state their offset from UTC and others do not; the first",
                        "without is row {which(without)[1]}, {.val {text[without][1]}}."),
                  i = "State it in all rows or in none."), call = call)
  }
  local_time(seconds, text, name, zone, call)
}

# The groups of a pattern: a matrix of text, NA where a row does not match, "" where a group is not there.
captures <- function(pattern, text) {
  found <- regexpr(pattern, text, perl = TRUE)
  start <- attr(found, "capture.start")
  parts <- matrix(substring(text, start, start + attr(found, "capture.length") - 1), length(text))
  parts[is.na(found) | found < 0, ] <- NA
  parts
}

# Seconds since midnight; 24:00:00 ends the day.
clock_seconds <- function(clock) {
  number <- function(k) as.numeric(sub(",", ".", ifelse(is.na(clock[, k]) | nzchar(clock[, k]), clock[, k], "0"),
                                       fixed = TRUE))
  half <- tolower(clock[, 4])
  twelve <- half %in% c("am", "pm")
  hour <- number(1)
  seconds <- 3600 * ifelse(twelve, hour %% 12 + 12 * (half == "pm"), hour) + 60 * number(2) + number(3)
  seconds[which(number(2) > 59 | number(3) >= 61 | seconds > 86400 | twelve & (hour < 1 | hour > 12))] <- NA
  seconds
}

offset_seconds <- function(offset) {
  offset[offset %in% c("Z", "UTC", "GMT")] <- "+0000"
  offset <- sub(":", "", offset, fixed = TRUE)
  minutes <- as.numeric(substr(offset, 2, 3)) * 60 + ifelse(nchar(offset) > 3, as.numeric(substr(offset, 4, 5)), 0)
  ifelse(startsWith(offset, "-"), -60, 60) * minutes
}

# Days since 1970 of year, month and day; NA where there is no such day.
day_number <- function(date) as.numeric(as.Date(paste(date[, 1], date[, 2], date[, 3]), format = "%Y %m %d"))

# Year, month and day of a column such as 01/02/2020. Dots are day first; else the column itself decides: there is no
# 13th month, and days follow each other.
ordered_date <- function(parts, name, format, call) {
  year <- ifelse(nchar(parts[, 4]) == 2, paste0("20", parts[, 4]), parts[, 4])
  as_dmy <- cbind(year, parts[, 3], parts[, 1])
  as_mdy <- cbind(year, parts[, 1], parts[, 3])
  if (identical(format, "mdy")) return(as_mdy)
  if (identical(format, "dmy") || all(parts[, 2] == ".", na.rm = TRUE)) return(as_dmy)
  days <- list(day_number(as_dmy), day_number(as_mdy))
  given <- !is.na(parts[, 1])
  possible <- !vapply(days, function(d) anyNA(d[given]), NA)
  if (all(possible)) possible <- vapply(days, function(d) all(diff(d[given]) %in% 0:1), NA)
  if (sum(possible) == 1) return(if (possible[1]) as_dmy else as_mdy)
  first <- which(given)[1]
  date <- paste(parts[first, c(1, 2, 3, 2, 4)], collapse = "")
  abort_input(c(paste("Time column {.val {name}}: whether the day or the month comes first in {.val {date}}",
                      "(row {first}) cannot be told from the column."),
                i = "Say {.code time_format = \"dmy\"} (day first) or {.code time_format = \"mdy\"}."), call = call)
}

# Hours since the beginning of the year in which the column starts, as the year itself is not known.
hours_of_year <- function(date, seconds) {
  leap <- any(as.numeric(date[, 2]) == 2 & as.numeric(date[, 3]) == 29, na.rm = TRUE)
  date[, 1] <- if (leap) 2000 else 2001
  day <- day_number(date) - day_number(cbind(date[1, 1], 1, 1))
  year <- cumsum(c(0, diff(ifelse(is.na(day), 0, day)) < -180))
  24 * (day + (365 + leap) * year) + seconds / 3600
}

# Text without offset in a zone: `local` are its seconds as if in UTC, in which it is read if no zone is given.
local_time <- function(local, text, name, zone, call) {
  if (is.null(zone)) {
    require_even_clock(local, text, name, call)
    return(utc(local))
  }
  both <- zone_readings(local, zone)
  absent <- which(is.na(both$first) & is.na(both$second) & !is.na(local))
  if (length(absent)) {
    hours <- both$offset[absent[1]] / 3600
    winter <- if (hours == round(hours)) sprintf("Etc/GMT%+d", -as.integer(hours)) else "UTC"
    abort_input(c(paste("Time column {.val {name}}: row {absent[1]} holds {.val {text[absent[1]]}}, which the clocks",
                        "of {.val {zone}} leave out when daylight saving begins."),
                  i = paste("If the record's clock was not changed, give the zone that it stayed in, such as",
                            "{.code time_zone = \"{winter}\"}.")),
                  call = call)
  }
  on_clock(utc(repeated_hours(local, both, text, name, zone, call)), zone)
}

# The two readings of local time in a zone, by its offsets before and after; NA where the clock never showed it so.
zone_readings <- function(local, zone) {
  offset_at <- function(seconds) {
    offset <- as.POSIXlt(on_clock(utc(seconds), zone))$gmtoff
    if (is.null(offset)) rep(0, length(seconds)) else ifelse(is.na(offset), 0, offset)
  }
  reading <- function(offset) ifelse(offset_at(local - offset) == offset, local - offset, NA)
  before <- offset_at(local - 86400)
  list(first = reading(before), second = reading(offset_at(local + 86400)), offset = before)
}

# What the clock shows twice when daylight saving ends: up to where the column goes back it is the first time, from
# there the second. Where it does not go back, that which follows the row before or leads to the row after without a
# gap.
repeated_hours <- function(local, both, text, name, zone, call) {
  seconds <- ifelse(is.na(both$first), both$second, both$first)
  rows <- which(both$first != both$second)
  for (part in split(rows, cumsum(c(TRUE, diff(rows) > 1 | diff(local[rows]) > 86400))[seq_along(rows)])) {
    back <- which(diff(local[part]) <= 0)
    if (length(back) > 1) {
      abort_input(c(paste("Time column {.val {name}} goes back more than once in the hour that {.val {zone}} has twice",
                          "when daylight saving ends; again in row {part[back[2] + 1]},",
                          "{.val {text[part[back[2] + 1]]}}."),
                    i = "Sort the rows as they were measured, or give time in UTC."), call = call)
    }
    second <- if (length(back)) part[seq_along(part) > back] else {
      to_before <- both$first[part[1]] - c(NA, seconds)[part[1]]
      to_after <- c(seconds, NA)[part[length(part)] + 1] - both$second[part[length(part)]]
      if (isTRUE(to_after < to_before) || is.na(to_before) && !is.na(to_after)) part
    }
    seconds[second] <- both$second[second]
  }
  seconds
}

# Zones for the rules by which clocks are changed in most of the world.
changing_zones <- c("Europe/Berlin", "Europe/London", "Europe/Helsinki", "America/New_York", "America/Santiago",
                    "Australia/Sydney", "Pacific/Auckland")

# Text that steps by an hour more or less just where a zone changes its clocks is local, and not read as UTC unasked.
require_even_clock <- function(local, text, name, call) {
  steps <- diff(local)
  step <- stats::median(steps, na.rm = TRUE)
  jumps <- which(abs(abs(steps - step) - 3600) < 0.01 * step)
  if (!length(jumps)) return(invisible())
  explained <- vapply(changing_zones, function(zone) {
    from <- zone_readings(local[jumps], zone)
    to <- zone_readings(local[jumps + 1], zone)
    ways <- cbind(to$first - from$first, to$second - from$second, to$first - from$second, to$second - from$first)
    rowSums(abs(ways - step) < 0.01 * step, na.rm = TRUE) > 0
  }, logical(length(jumps)))
  explained <- matrix(explained, length(jumps), dimnames = list(NULL, changing_zones))
  if (!any(explained)) return(invisible())
  row <- jumps[rowSums(explained) > 0][1]
  likely <- colnames(explained)[colSums(explained) == max(colSums(explained))]
  others <- if (length(likely) > 1) paste0(" (or that of ", paste(likely[-1], collapse = ", "), ")")
  abort_input(c(paste("Time column {.val {name}} states no zone, and from row {row} to {row + 1} ({.val {text[row]}}",
                      "to {.val {text[row + 1]}}) it steps as clocks do where daylight saving",
                      "{if (steps[row] > step) 'begins' else 'ends'}."),
                i = paste("If it is local, give its zone, such as {.code time_zone = \"{likely[1]}\"}{others}; if it",
                          "is not, {.code time_zone = \"UTC\"}.")),
              call = call)
}

check_time <- function(time, values, name, call) {
  hours <- time_hours(time)
  if (any(is.infinite(hours)))
    abort_input("Time column {.val {name}} has an infinite value in row {which(is.infinite(hours))[1]}.", call = call)
  if (anyNA(hours)) {
    abort_input(c(paste("Time column {.val {name}} has {sum(is.na(hours))} missing value{?s}; the first is in row",
                        "{which(is.na(hours))[1]}."),
                  i = "Every row needs its time; delete rows without one."), call = call)
  }
  twice <- which(duplicated(hours))
  if (length(twice)) {
    abort_input(c(paste("Time column {.val {name}} has {length(twice)} duplicated time stamp{?s}; the first is",
                        "{.val {format(values[twice[1]])}} in row {twice[1]}."),
                  i = paste("Keep one row for each time. The end of daylight saving does this to local time: give its",
                            "text and {.arg time_zone}, or UTC.")),
                call = call)
  }
  back <- which(diff(hours) < 0)
  if (length(back)) {
    abort_input(c(paste("Time column {.val {name}} goes back in row {back[1] + 1}:",
                        "{.val {format(values[back[1] + 1])}} after {.val {format(values[back[1]])}}."),
                  i = "Sort the rows by time."), call = call)
  }
}
