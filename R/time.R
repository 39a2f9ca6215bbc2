# Time as people have it, read into the one form that all later stages use: POSIXct where the date
# is known, numbers (hours) where it is not.

time_units <- c(seconds = 1 / 3600, minutes = 1 / 60, hours = 1, days = 24)
# The number that each way to count days gives 1 January 1970.
serial_days <- c(excel = 25569, matlab = 719529, julian = 2440587.5, mjd = 40587, unix_days = 0)
number_formats <- c(names(time_units), "unix", names(serial_days))
day_orders <- c("ymd", "dmy", "mdy")

# Hours, since 1970 in UTC where the date is known.
time_hours <- function(time) as.numeric(time) / if (is.numeric(time)) 1 else 3600

is_pattern <- function(format) !is.null(format) && grepl("%", format, fixed = TRUE)

# The parts of a date that a pattern does not read.
pattern_lacks <- function(format) {
  parts <- c(year = "%[OE]?[YyFDcxsG]", month = "%[OE]?[mbBhjFDcxs]", day = "%[OE]?[dejFDcxs]")
  names(parts)[!vapply(parts, grepl, NA, format)]
}

# `format`: as time_format() settles it.
parse_time <- function(values, name, format, zone, call) {
  if (inherits(values, "POSIXt")) return(on_clock(as.POSIXct(values), zone))
  if (inherits(values, "Date")) return(utc(86400 * as.numeric(values)))
  if (is_span(values)) return(span_hours(values))
  if (is.character(values)) return(parse_text(values, name, format, zone, call))
  if (is_pattern(format)) return(pattern_time(stamp_text(values, format), name, format, zone, call))
  parse_numbers(values, name, format %||% "hours", zone, call)
}

# Lengths of time: difftime, hms and the times of day of data.table.
is_span <- function(values) inherits(values, c("difftime", "ITime"))

# By the unit that the values say: hms has methods of its own that do not convert.
span_hours <- function(values) {
  unit <- if (inherits(values, "ITime")) "secs" else attr(values, "units")
  as.numeric(unclass(values)) * c(secs = 1 / 3600, mins = 1 / 60, hours = 1, days = 24,
                                  weeks = 168)[[unit]]
}

# Whether times that were read from `values` are dates without a time of day. Seconds since 1970 are
# times of day.
are_days <- function(values, time, format) {
  if (inherits(values, "Date")) return(TRUE)
  if (inherits(values, "POSIXt") || !inherits(time, "POSIXct") || identical(format, "unix"))
    return(FALSE)
  !any(grepl(":", values, fixed = TRUE)) && all(format(time, "%H%M%S") == "000000", na.rm = TRUE)
}

# The ends of the intervals that stamps mark, `time` as read from `values` by `format`.
interval_ends <- function(time, values, format, stamp = NULL) {
  stamp <- stamp %||% if (are_days(values, time, format)) "start" else "end"
  if (stamp == "end") return(time)
  step_h <- stats::median(diff(time_hours(time)))
  time + step_h * if (is.numeric(time)) 1 else 3600
}

utc <- function(seconds) as.POSIXct(seconds, origin = "1970-01-01", tz = "UTC")

# With the clock of `zone`, else its own.
on_clock <- function(time, zone) {
  attr(time, "tzone") <- zone %||% attr(time, "tzone")[1]
  time
}

parse_numbers <- function(numbers, name, format, zone, call) {
  if (format %in% names(time_units)) return(numbers * time_units[[format]])
  if (format == "unix") return(on_clock(utc(unix_seconds(numbers)), zone %||% "UTC"))
  seconds <- serial_seconds(numbers, format)
  if (format %in% c("excel", "matlab"))
    local_time(seconds, format(numbers, digits = 15), name, zone, call)
  else on_clock(utc(seconds), zone %||% "UTC")
}

# Seconds, milliseconds, microseconds or nanoseconds, by their size.
unix_seconds <- function(numbers) {
  size <- max(abs(numbers), 0, na.rm = TRUE)
  numbers / 1000^findInterval(size, c(1e11, 1e14, 1e17))
}

# Fractions of a day lack digits: times are the roundest ones that the digits given allow.
serial_seconds <- function(numbers, format) {
  seconds <- 86400 * (numbers - serial_days[[format]])
  digits <- Find(function(d) all(round(numbers, d) == numbers, na.rm = TRUE), 3:9, nomatch = 10)
  open <- 86400 * 0.5 * 10^-digits + 1e-3
  for (unit in c(3600, 1800, 900, 600, 300, 60, 1)) {
    rounded <- unit * round(seconds / unit)
    if (all(abs(rounded - seconds) <= open, na.rm = TRUE)) return(rounded)
  }
  round(seconds, 3)
}

# Digits as text, with the zeros in front that numbers lose.
stamp_text <- function(numbers, format) {
  text <- base::format(numbers, scientific = FALSE, trim = TRUE, digits = 15)
  width <- stamp_width(format)
  whole <- which(numbers == round(numbers))
  if (!is.na(width)) text[whole] <- sprintf("%0*.0f", width, numbers[whole])
  text[is.na(numbers)] <- NA
  text
}

# How many digits there are in a format of digits alone, such as %Y%m%d; NA for others.
stamp_width <- function(format) {
  if (!grepl("^(%[YymdHMSj])+$", format)) return(NA_integer_)
  letters <- strsplit(gsub("%", "", format, fixed = TRUE), "")[[1]]
  sum(ifelse(letters == "Y", 4L, ifelse(letters == "j", 3L, 2L)))
}

parse_text <- function(text, name, format, zone, call) {
  text <- clean_text(text)
  if (is_pattern(format)) return(pattern_time(text, name, format, zone, call))
  numbers <- text_numbers(text)
  if (is.null(numbers)) stamps_time(text, name, format, zone, call)
  else parse_numbers(numbers, name, if (isTRUE(format %in% number_formats)) format else "hours",
                     zone, call)
}

clean_text <- function(text) {
  text <- trimws(text)
  text[!nzchar(text)] <- NA
  text
}

# NULL if a text is no number.
text_numbers <- function(text) {
  numbers <- suppressWarnings(as.numeric(text))
  if (identical(is.na(numbers), is.na(text))) numbers
}

require_read <- function(unread, text, name, call) {
  bad <- which(unread & !is.na(text))
  if (!length(bad)) return(invisible())
  abort_input(
    c("Time column {.val {name}} cannot be read: row {bad[1]} holds {.val {text[bad[1]]}}.",
      i = paste("Use ISO 8601, for example 2013-08-30T00:10:00, or say by {.arg time_format} what",
                "it is, for example {.val %d.%m.%Y %H:%M}.")),
    call = call)
}

# Months begin on their first day, where strptime() would take the day of today.
pattern_seconds <- function(text, format) {
  if (identical(pattern_lacks(format), "day")) {
    text <- paste(text, 1)
    format <- paste(format, "%d")
  }
  as.numeric(as.POSIXct(strptime(text, format, tz = "UTC")))
}

pattern_time <- function(text, name, format, zone, call) {
  seconds <- pattern_seconds(text, format)
  width <- stamp_width(format)
  if (!is.na(width)) seconds[which(nchar(text) != width)] <- NA
  require_read(is.na(seconds), text, name, call)
  # strptime() reads the beginning of a text alone: an end of its own shows what is left.
  rest <- which(is.na(pattern_seconds(paste0(text, "|"), paste0(format, "|"))) & !is.na(text))
  if (length(rest)) {
    abort_input(c(paste("Time column {.val {name}}: {.arg time_format} = {.val {format}} reads",
                        "only the beginning of {.val {text[rest[1]]}} in row {rest[1]}."),
                  i = paste("Give a format of all of it ({.val %OS} for seconds with a fraction,",
                            "{.val %Y} for a year of four digits); ISO 8601 needs none.")),
                call = call)
  }
  if (grepl("%z", format, fixed = TRUE)) on_clock(utc(seconds), zone)
  else local_time(seconds, text, name, zone, call)
}

# The forms of a date, the first for which all rows stand; a date without a year is EnergyPlus'.
date_forms <- c(ymd = "(\\d{4})[-/.](\\d{1,2})[-/.](\\d{1,2})",
                day_month = "(\\d{1,2})([-/.])(\\d{1,2})\\2(\\d{4})",
                dotted = "(\\d{1,2})(\\.)(\\d{1,2})\\.(\\d{2})", no_year = "(\\d{1,2})/(\\d{1,2})")
clock_form <- paste0(
  "(?:(?:T|,?\\s+)(\\d{1,2}):(\\d{2})(?::(\\d{2}(?:[.,]\\d+)?))?\\s*([AaPp][Mm])?",
  "\\s*(Z|UTC|GMT|[+-]\\d{2}(?::?\\d{2})?)?)?")

stamps_time <- function(text, name, format, zone, call) {
  stamps <- stamp_parts(text, name, call)
  parts <- stamps$parts
  clock <- parts[, ncol(parts) - 4:0, drop = FALSE]
  seconds <- clock_seconds(clock)
  date <- switch(
    stamps$form, ymd = parts[, 1:3, drop = FALSE], no_year = cbind(NA, parts[, 1:2, drop = FALSE]),
    ordered_date(parts, if (said_order(format)) format else day_order(stamps, name, call)))
  if (stamps$form == "no_year") {
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
    abort_input(c(paste("Time column {.val {name}}: some rows state their offset from UTC and",
                        "others do not; the first without is row {which(without)[1]},",
                        "{.val {text[without][1]}}."), i = "State it in all rows or in none."),
                call = call)
  }
  local_time(seconds, text, name, zone, call)
}

# The parts of stamps in the form that most of them have: list(form, parts).
stamp_parts <- function(text, name, call) {
  forms <- paste0("^", date_forms, clock_form, "$")
  stands <- vapply(forms, function(form) sum(grepl(form, text, perl = TRUE)), 0)
  k <- which.max(stands)
  parts <- captures(forms[k], text)
  require_read(is.na(parts[, 1]), text, name, call)
  list(form = names(date_forms)[k], parts = parts)
}

# The groups of a pattern: a matrix of text, NA where a row does not match, "" where a group is not
# there.
captures <- function(pattern, text) {
  found <- regexpr(pattern, text, perl = TRUE)
  start <- attr(found, "capture.start")
  parts <- matrix(substring(text, start, start + attr(found, "capture.length") - 1), length(text))
  parts[is.na(found) | found < 0, ] <- NA
  parts
}

# Seconds since midnight; 24:00:00 ends the day.
clock_seconds <- function(clock) {
  number <- function(k) as.numeric(
    sub(",", ".", ifelse(is.na(clock[, k]) | nzchar(clock[, k]), clock[, k], "0"), fixed = TRUE))
  half <- tolower(clock[, 4])
  twelve <- half %in% c("am", "pm")
  hour <- number(1)
  seconds <- 3600 * ifelse(twelve, hour %% 12 + 12 * (half == "pm"), hour) + 60 * number(2) +
    number(3)
  seconds[which(
    number(2) > 59 | number(3) >= 61 | seconds > 86400 | twelve & (hour < 1 | hour > 12))] <- NA
  seconds
}

offset_seconds <- function(offset) {
  offset[offset %in% c("Z", "UTC", "GMT")] <- "+0000"
  offset <- sub(":", "", offset, fixed = TRUE)
  minutes <- as.numeric(substr(offset, 2, 3)) * 60 +
    ifelse(nchar(offset) > 3, as.numeric(substr(offset, 4, 5)), 0)
  ifelse(startsWith(offset, "-"), -60, 60) * minutes
}

# Days since 1970 of year, month and day; NA where there is no such day.
day_number <- function(date)
  as.numeric(as.Date(paste(date[, 1], date[, 2], date[, 3]), format = "%Y %m %d"))

said_order <- function(format) isTRUE(format %in% c("dmy", "mdy"))

# Year, month and day of a column such as 01/02/2020.
ordered_date <- function(parts, order) {
  year <- ifelse(nchar(parts[, 4]) == 2, paste0("20", parts[, 4]), parts[, 4])
  if (order == "mdy") cbind(year, parts[, 1], parts[, 3]) else cbind(year, parts[, 3], parts[, 1])
}

# "dmy" or "mdy", or NULL for stamps that need neither. Dots are day first; else the column itself
# decides: there is no 13th month, and days follow each other.
day_order <- function(stamps, name, call) {
  if (stamps$form %in% c("ymd", "no_year")) return(NULL)
  parts <- stamps$parts
  if (all(parts[, 2] == ".", na.rm = TRUE)) return("dmy")
  orders <- c("dmy", "mdy")
  given <- !is.na(parts[, 1])
  days <- lapply(orders, function(order) day_number(ordered_date(parts, order))[given])
  possible <- !vapply(days, anyNA, NA)
  if (all(possible)) possible <- vapply(days, function(d) all(diff(d) %in% 0:1), NA)
  if (sum(possible) == 1) return(orders[possible])
  first <- which(given)[1]
  date <- paste(parts[first, c(1, 2, 3, 2, 4)], collapse = "")
  abort_input(c(paste("Time column {.val {name}}: whether the day or the month comes first in",
                      "{.val {date}} (row {first}) cannot be decided from the column."),
                i = paste("Say {.code time_format = \"dmy\"} (day first) or",
                          "{.code time_format = \"mdy\"}.")), call = call)
}

# Hours since the beginning of the year in which the column starts, as the year itself is not known.
hours_of_year <- function(date, seconds) {
  leap <- any(as.numeric(date[, 2]) == 2 & as.numeric(date[, 3]) == 29, na.rm = TRUE)
  date[, 1] <- if (leap) 2000 else 2001
  day <- day_number(date) - day_number(cbind(date[1, 1], 1, 1))
  year <- cumsum(c(0, diff(ifelse(is.na(day), 0, day)) < -180))
  24 * (day + (365 + leap) * year) + seconds / 3600
}

# Text without offset in a zone: `local` are its seconds as if in UTC, in which it is read if no
# zone is given.
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
    abort_input(c(paste("Time column {.val {name}}: row {absent[1]} holds",
                        "{.val {text[absent[1]]}}, which the clocks of {.val {zone}} leave out",
                        "when daylight saving begins."),
                  i = paste("If the record's clock was not changed, give the zone that it stayed",
                            "in, such as {.code time_zone = \"{winter}\"}.")),
                call = call)
  }
  on_clock(utc(repeated_hours(local, both, text, name, zone, call)), zone)
}

# The two readings of local time in a zone, by its offsets before and after; NA where the clock
# never showed it so.
zone_readings <- function(local, zone) {
  offset_at <- function(seconds) {
    offset <- as.POSIXlt(on_clock(utc(seconds), zone))$gmtoff
    if (is.null(offset)) rep(0, length(seconds)) else ifelse(is.na(offset), 0, offset)
  }
  reading <- function(offset) ifelse(offset_at(local - offset) == offset, local - offset, NA)
  before <- offset_at(local - 86400)
  list(first = reading(before), second = reading(offset_at(local + 86400)), offset = before)
}

# What the clock shows twice when daylight saving ends: up to where the column goes back it is the
# first time, from there the second. Where it does not go back, that which follows the row before or
# leads to the row after without a gap.
repeated_hours <- function(local, both, text, name, zone, call) {
  seconds <- ifelse(is.na(both$first), both$second, both$first)
  rows <- which(both$first != both$second)
  for (part in split(rows, cumsum(c(TRUE, diff(rows) > 1 |
                                          diff(local[rows]) > 86400))[seq_along(rows)])) {
    back <- which(diff(local[part]) <= 0)
    if (length(back) > 1) {
      abort_input(c(paste("Time column {.val {name}} goes back more than once in the hour that",
                          "{.val {zone}} has twice when daylight saving ends; again in row",
                          "{part[back[2] + 1]}, {.val {text[part[back[2] + 1]]}}."),
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
changing_zones <- c("Europe/Berlin", "Europe/London", "Europe/Helsinki", "America/New_York",
                    "America/Santiago", "Australia/Sydney", "Pacific/Auckland")

# Text that steps by an hour more or less just where a zone changes its clocks is local, and not
# read as UTC unasked.
require_even_clock <- function(local, text, name, call) {
  steps <- diff(local)
  step <- stats::median(steps, na.rm = TRUE)
  near <- min(0.01 * step, 900)
  jumps <- which(abs(abs(steps - step) - 3600) < near)
  if (!length(jumps)) return(invisible())
  explained <- vapply(changing_zones, function(zone) {
    from <- zone_readings(local[jumps], zone)
    to <- zone_readings(local[jumps + 1], zone)
    ways <- cbind(to$first - from$first, to$second - from$second, to$first - from$second,
                  to$second - from$first)
    rowSums(abs(ways - step) < near, na.rm = TRUE) > 0
  }, logical(length(jumps)))
  explained <- matrix(explained, length(jumps), dimnames = list(NULL, changing_zones))
  if (!any(explained)) return(invisible())
  row <- jumps[rowSums(explained) > 0][1]
  likely <- colnames(explained)[colSums(explained) == max(colSums(explained))]
  others <- if (length(likely) > 1) paste0(" (or that of ", paste(likely[-1], collapse = ", "), ")")
  abort_input(c(paste("Time column {.val {name}} states no zone, and from row {row} to {row + 1}",
                      "({.val {text[row]}} to {.val {text[row + 1]}}) it steps as clocks do where",
                      "daylight saving {if (steps[row] > step) 'begins' else 'ends'}."),
                i = paste("If it is local, give its zone, such as",
                          "{.code time_zone = \"{likely[1]}\"}{others}; if it is not,",
                          "{.code time_zone = \"UTC\"}.")),
              call = call)
}
