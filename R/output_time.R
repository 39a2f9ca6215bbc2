# The rows of a program's output by the time of the record.

# One value for each row of the drivers. `table`: list(value, stamp), or with numbers of month, day
# and seconds for it.
by_time <- function(table, output, expected) {
  offset <- output$utc_offset %||% expected$offset
  ends <- clock_of_program(expected$time, offset)
  step <- 3600 * expected$step_h
  tried <- stamp_seconds(table, output, expected, ends, step, offset)
  matched <- lapply(tried, function(seconds) match_rows(seconds, ends, step, output$stamps))
  rows <- vapply(matched, function(one) sum(one$count > 0), 0)
  last <- max(which(rows == max(rows)))
  best <- matched[[last]]
  require_times(best, tried[[last]], expected, output, offset)
  as.numeric(rowsum(table$value[best$at], best$row, reorder = TRUE)) / best$per_row
}

# Which rows of the output end within which row of the drivers: list(at, row, count, per_row,
# twice). NA and other times belong to none.
match_rows <- function(seconds, ends, step, stamps) {
  known <- which(!is.na(seconds))
  own <- own_step(diff(seconds[known]), step)
  per_row <- step / own
  coarse <- per_row < 0.75
  per_row <- max(1, round(per_row))
  own <- step / per_row
  seconds <- seconds + own * c(end = 0, middle = 0.5, start = 1)[[stamps]]
  place <- (seconds - (ends[1] - step)) / own
  at <- known[abs(place[known] - round(place[known])) <= rules$stray_limit]
  at <- at[round(place[at]) >= 1 & round(place[at]) <= length(ends) * per_row]
  row <- as.integer(ceiling(round(place[at]) / per_row))
  list(at = at, row = row, count = tabulate(row, length(ends)), per_row = per_row, coarse = coarse,
       twice = at[anyDuplicated(round(place[at]))])
}

# The usual step of the output. If rows are missing, it may be longer than that of the record, which
# the least is not.
own_step <- function(steps, step) {
  steps <- steps[steps > 0]
  if (!length(steps)) return(step)
  usual <- stats::median(steps)
  if (usual > step / 0.75) min(steps) else usual
}

require_times <- function(best, seconds, expected, output, offset) {
  if (best$coarse)
    stop("the rows of ", output$file, " are further apart than those of the record, ",
         step_words(seq(0, 2) * expected$step_h))
  if (length(best$twice)) stop(output$file, " has a time twice, in its row ", best$twice[1])
  missed <- which(best$count < best$per_row)
  if (!length(missed)) return(invisible())
  range <- range(seconds, na.rm = TRUE)
  stop(output$file, " has no row for ", program_time(expected$time[missed[1]], offset), ": ",
       length(missed), " of ", length(expected$time),
       " times of the record are not in it. Its times go from ", said_time(range[1], expected),
       " to ", said_time(range[2], expected))
}

program_time <- function(time, offset) {
  if (is.numeric(time)) paste(signif(time, 8), "h")
  else format(utc(as.numeric(time) + 3600 * offset), "%Y-%m-%d %H:%M")
}

said_time <- function(seconds, expected) {
  if (!is.finite(seconds)) return("nowhere")
  if (is.numeric(expected$time)) paste(signif((seconds - year_start(2001)) / 3600, 8), "h")
  else format(utc(seconds), "%Y-%m-%d %H:%M")
}

# The seconds of each row in the program's clock, in each way that its stamps can be meant: a list
# of vectors as long as the table.
stamp_seconds <- function(table, output, expected, ends, step, offset) {
  if (!is.null(table$month)) return(dates_without_year(table$month, table$day, table$seconds, ends))
  words <- trimws(table$stamp)
  format <- output$time_format
  if (is.null(format)) return(plain_stamps(words, output, expected, ends, offset))
  if (is_pattern(format)) return(pattern_stamps(words, output, ends))
  number <- stamp_numbers(words, output)
  if (format %in% names(time_units))
    return(list(ends[1] - step + 3600 * time_units[[format]] * number))
  days <- if (format == "day_of_year") number - 1 else number / 24
  days_of_year(days, ends)
}

stamp_numbers <- function(words, output) {
  number <- output_numbers(if (output$decimal == ",") sub(",", ".", words, fixed = TRUE) else words)
  bad <- which(is.na(number))
  if (length(bad))
    stop(output$file, " holds the time ", shown(words[bad[1]]), ", which is no number")
  number
}

no_year_form <- "^(\\d{1,2})/(\\d{1,2})\\s+(\\d{1,2})[:h](\\d{2})(?::(\\d{2}(?:[.]\\d+)?))?$"

# Stamps that say themselves what they are.
plain_stamps <- function(words, output, expected, ends, offset) {
  parts <- captures(no_year_form, words)
  if (!anyNA(parts[, 1])) {
    parts <- matrix(as.numeric(ifelse(nzchar(parts), parts, "0")), nrow(parts))
    return(dates_without_year(parts[, 1], parts[, 2],
                              3600 * parts[, 3] + 60 * parts[, 4] + parts[, 5], ends))
  }
  numbers <- text_numbers(words)
  if (!is.null(numbers)) {
    if (is.numeric(expected$time)) return(list(3600 * numbers + year_start(2001)))
    stop(output$file, " holds numbers as time, such as ", shown(words[1]),
         "; say by time_format what they are")
  }
  time <- tryCatch(parse_text(words, output$time[1], NULL, "UTC", NULL), error = function(e) NULL)
  if (!inherits(time, "POSIXct")) {
    stop("the times of ", output$file, " cannot be read, such as ", shown(words[1]),
         "; say time_format")
  }
  require_dates(expected, output)
  zoned <- grepl("(Z|UTC|GMT|[0-9:][+-]\\d{2}(:?\\d{2})?)$", words)
  list(as.numeric(time) + ifelse(zoned, 3600 * offset, 0))
}

require_dates <- function(expected, output) {
  if (is.numeric(expected$time)) {
    stop(output$file, " has dates, and the record is in hours; give the record dates, or say ",
         "time_format = \"hours\"")
  }
}

# By strptime(), which knows no hour 24: it is hour 0 of the next day.
pattern_stamps <- function(words, output, ends) {
  format <- output$time_format
  late <- grepl("%H", format, fixed = TRUE) & grepl("(^|[^0-9])24([:h.]?00)*$", words)
  early <- ifelse(late, sub("24((?:[:h.]?00)*)$", "00\\1", words, perl = TRUE), words)
  yearless <- "year" %in% pattern_lacks(format)
  parsed <- strptime(if (yearless) paste("2000", early) else early,
                     if (yearless) paste("%Y", format) else format, "UTC")
  bad <- which(is.na(parsed))
  if (length(bad)) {
    stop(output$file, " holds the time ", shown(words[bad[1]]), ", which time_format = \"", format,
         "\" does not read")
  }
  if (!yearless) return(list(as.numeric(as.POSIXct(parsed)) + 86400 * late))
  clock <- 3600 * parsed$hour + 60 * parsed$min + parsed$sec + 86400 * late
  dates_without_year(parsed$mon + 1, parsed$mday, clock, ends)
}

# Parts of a file in each of which time goes on, and years counted in it: list(part, year). December
# before January is a new year; any other way back begins anew.
parts_of_time <- function(days, newyear) {
  back <- c(FALSE, diff(days) < 0)
  list(part = cumsum(c(TRUE, (back & !newyear)[-1])), year = cumsum(newyear))
}

# Seconds of each part in the year of the record, the year before and the year after; NA outside of
# the part.
in_years <- function(parts, seconds_in, ends) {
  first <- as.POSIXlt(utc(ends[1] - 1), tz = "UTC")$year + 1900
  tried <- expand.grid(year = first + c(-1, 1, 0), part = unique(parts$part))
  Map(function(year, part) {
    within <- parts$part == part
    year <- year + parts$year - parts$year[within][1]
    ifelse(within, seconds_in(year), NA_real_)
  }, tried$year, tried$part)
}

dates_without_year <- function(month, day, seconds, ends) {
  days <- 31 * month + day + seconds / 86400
  newyear <- c(FALSE,
               diff(month) < 0 & utils::head(month, -1) == 12 & month[-1] == 1 & day[-1] <= 7 &
               utils::head(day, -1) >= 25)
  in_years(parts_of_time(days, newyear), function(year) {
    86400 * day_number(cbind(year, month, day)) + seconds
  }, ends)
}

# Days since the beginning of a year.
days_of_year <- function(days, ends) {
  newyear <- c(FALSE, utils::head(days, -1) > 358 & days[-1] < 7)
  in_years(parts_of_time(days, newyear), function(year) {
    at <- vapply(unique(year), year_start, 0)
    at[match(year, unique(year))] + 86400 * days
  }, ends)
}
