# The two sides of a comparison in a condition as values of one kind. R compares different kinds as
# text, and text with a time by the clock of the machine.

# What conditions know of the record's time: its column as it was given and as it was read.
condition_clock <- function(values, reading, zone) {
  list(values = if (is.factor(values)) as.character(values) else values, time = reading$time,
       format = reading$format, zone = zone)
}

comparison_operators <- c("==", "!=", "<", "<=", ">", ">=", "%in%")

# The comparisons of R, of values made comparable: a list of functions by their names.
comparisons <- function(clock) {
  lapply(stats::setNames(nm = comparison_operators), function(name) {
    compare <- get(name, baseenv())
    ordered <- name %in% c("<", "<=", ">", ">=")
    function(e1, e2) {
      if (name == "%in%" || length(e2) <= length(e1))
        return(do.call(compare, comparable(e1, e2, ordered, clock)))
      do.call(compare, rev(comparable(e2, e1, ordered, clock)))
    }
  })
}

# list(column, value): `value`, mostly one that is written in the condition, is taken as what the
# column holds.
comparable <- function(column, value, ordered, clock) {
  if (is.factor(column)) column <- as.character(column)
  if (is.factor(value)) value <- as.character(value)
  if (is_record_time(column, value, clock)) {
    value <- if (is_moment(value)) value else as_text(value)
    return(time_pair(clock$time, value, own_format(clock$format, column, value), clock$zone))
  }
  if (is_moment(column) || is_moment(value)) return(moment_pair(column, value, clock))
  if (is_span(column)) column <- as.numeric(unclass(column))
  if (is_span(value)) value <- as.numeric(unclass(value))
  if (is.character(column) && is.character(value)) {
    return(if (ordered) ordered_texts(column, value, clock) else list(column, value))
  }
  if (is.character(column)) column <- as_kind_of(value, column)
  if (is.character(value)) value <- as_kind_of(column, value)
  list(column, value)
}

is_moment <- function(x) inherits(x, c("POSIXt", "Date"))
as_text <- function(x)
  if (is.character(x)) x else format(x, scientific = FALSE, trim = TRUE, digits = 15)

# Whether it is the column of time that is compared, with what is to be read as a time. Its own
# numbers stay numbers, but digits of a date may be written in part.
is_record_time <- function(column, value, clock) {
  if (is_moment(column) || length(column) < 2 || !identical(column, clock$values)) return(FALSE)
  if (is_moment(value)) return(!is.numeric(clock$time))
  if (is.character(value)) return(!is.numeric(clock$time) || is.character(column))
  is.numeric(value) && is_pattern(clock$format)
}

# The order of day and month in a column is not that of a text with dots, if the column has none.
own_format <- function(format, column, value) {
  dotted <- function(x) any(grepl("^\\d+\\.", x))
  if (said_order(format) && dotted(value) && !dotted(column)) NULL else format
}

# Seconds since 1970, or hours where no date is known.
time_pair <- function(time, value, format, zone) {
  if (is.character(value)) value <- read_moments(value, time, format, zone)
  list(as.numeric(if (is.numeric(time)) time else as.POSIXct(time)), moment_number(value))
}

moment_number <- function(x) {
  if (is.numeric(x)) as.numeric(x)
  else if (inherits(x, "Date")) 86400 * as.numeric(x)
  else as.numeric(as.POSIXct(x))
}

# A time beside a text, or another time: a text is read by the clock of the time.
moment_pair <- function(column, value, clock) {
  pair <- list(column, value)
  moment <- vapply(pair, is_moment, NA)
  if (all(moment)) return(lapply(pair, moment_number))
  time <- pair[[which(moment)]]
  text <- pair[[which(!moment)]]
  if (!is.character(text)) {
    stop("a time is compared with ", seen(text),
         "; write a time in quotes, such as \"2013-09-02 00:00\"", call. = FALSE)
  }
  format <- if (identical(time, clock$time)) clock$format
  pair[[which(!moment)]] <- read_moments(text, time, format, clock_zone(time, clock))
  lapply(pair, moment_number)
}

clock_zone <- function(time, clock) {
  if (inherits(time, "Date")) return("UTC")
  zone <- clock$zone %||% attr(time, "tzone")[1] %||% ""
  if (nzchar(zone)) return(zone)
  stop("the times of the column name no zone, so that a text is another time on each machine; ",
       "say `time_zone`, such as \"UTC\"", call. = FALSE)
}

# Two texts have an order only if they are numbers, times of day or times.
ordered_texts <- function(column, value, clock) {
  for (read in list(text_numbers, day_seconds)) {
    numbers <- lapply(list(column, value), function(x) read(clean_text(x)))
    if (!any(vapply(numbers, is.null, NA))) return(numbers)
  }
  column <- clean_text(column)
  tryCatch({
    format <- settled_format(column, "text", NULL, clock$zone, NULL)
    time <- parse_time(column, "text", format, clock$zone, NULL)
    time_pair(time, value, own_format(format, column, value), clock$zone)
  }, amiss_error_input = function(e) {
    first <- column[!is.na(column)][1]
    stop(dQuote(first, FALSE), " and ", dQuote(value[1], FALSE),
         " are compared by their order, but they are no times ",
         "in one format, and texts have no order; compare them by == or %in%", call. = FALSE)
  })
}

# Seconds since midnight of texts such as 06:30; NULL if a text is none.
day_seconds <- function(text) {
  parts <- captures("^(\\d{1,2}):(\\d{2})(?::(\\d{2}(?:[.,]\\d+)?))?\\s*([AaPp][Mm])?$", text)
  seconds <- clock_seconds(parts)
  if (identical(is.na(seconds), is.na(text))) seconds
}

# Texts as numbers, or as TRUE and FALSE, if that is what stands on the other side.
as_kind_of <- function(other, text) {
  if (!is.numeric(other) && !is.logical(other)) return(text)
  values <- if (is.logical(other)) as.logical(trimws(text)) else suppressWarnings(as.numeric(text))
  bad <- which(is.na(values) & !is.na(text))
  if (!length(bad)) return(values)
  row <- if (length(text) > 1) paste0(" (row ", bad[1], ")") else ""
  stop(dQuote(text[bad[1]], FALSE), row,
       if (is.logical(other)) " is compared with TRUE and FALSE, but is neither"
       else " is compared with numbers, but is none", call. = FALSE)
}

# Texts of a condition as times: in the format of the column, in the beginning of it, or as ISO
# 8601.
read_moments <- function(text, time, format, zone) {
  zone <- zone %||% if (!is.numeric(time)) attr(time, "tzone")[1]
  for (form in literal_formats(format)) {
    read <- tryCatch(parse_time(text, "text", form, zone, NULL),
                     amiss_error_input = function(e) NULL)
    if (is.null(read) || anyNA(read) || is.numeric(read) != is.numeric(time)) next
    if (is.null(format)) check_one_year(time)
    return(read)
  }
  stop(dQuote(text[1], FALSE),
       " is no time; write it as in the column, or such as \"2013-09-02 00:00\"", call. = FALSE)
}

# A format, those of its beginnings that hold a date, none, and the order of day and month in it.
literal_formats <- function(format) {
  if (!is_pattern(format)) return(unique(list(format, NULL)))
  ends <- gregexpr("%[EO]?[A-Za-z]", format)[[1]]
  parts <- substring(format, 1, ends + attr(ends, "match.length") - 1)
  whole <- Filter(function(part) !length(pattern_lacks(part)), parts)
  day <- regexpr("%[de]", format)
  month <- regexpr("%[mbBh]", format)
  c(format, rev(whole), list(NULL), if (day > 0 && month > 0) if (day < month) "dmy" else "mdy")
}

# Stamps without a year, such as those of EnergyPlus, distinguish times within one year only.
check_one_year <- function(time) {
  if (!is.numeric(time) || max(time) <= 8784) return(invisible())
  stop("the stamps of the column have no year and go beyond one; give the rows by another column",
       call. = FALSE)
}
