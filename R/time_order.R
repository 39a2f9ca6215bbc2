# Whether time runs on from row to row. Rows are to be sorted only if that cannot scramble the
# record.

check_time <- function(time, values, name, call) {
  hours <- time_hours(time)
  if (any(is.infinite(hours))) abort_input(paste("Time column {.val {name}} has an infinite value",
                                                 "in row {which(is.infinite(hours))[1]}."),
                                           call = call)
  if (anyNA(hours)) {
    abort_input(c(paste("Time column {.val {name}} has {sum(is.na(hours))} missing value{?s}; the",
                        "first is in row {which(is.na(hours))[1]}."),
                  i = "Every row needs its time; delete rows without one."), call = call)
  }
  if (!is.numeric(time)) check_years(time, values, name, call)
  steps <- diff(hours)
  if (all(steps > 0)) return(invisible())
  row <- which(steps <= 0)[1] + 1
  twice <- which(duplicated(hours))
  seen <- if (length(twice)) {
    paste("has {length(twice)} duplicated time stamp{?s}; the first is",
          "{.val {format(values[twice[1]])}} in row {twice[1]}.")
  } else {
    "goes back in row {row}: {.val {format(values[row])}} after {.val {format(values[row - 1])}}."
  }
  abort_input(c(paste("Time column {.val {name}}", seen), i = order_hint(time, hours, steps)),
              call = call)
}

# Years that a date gets where two digits of a year, or another unit, are read as something else.
check_years <- function(time, values, name, call) {
  year <- as.POSIXlt(time, tz = "UTC")$year + 1900
  bad <- which(year < 1000 | year > 2999)
  if (!length(bad)) return(invisible())
  abort_input(c(paste("Time column {.val {name}}: row {bad[1]} holds",
                      "{.val {format(values[bad[1]])}}, in the year {year[bad[1]]}."),
                i = paste("Read a year of two digits by {.val %y} of {.fun strptime}, not by",
                          "{.val %Y}; a simulated year far from ours is best given in hours.")),
              call = call)
}

# Whether the one time that stands twice is an hour that its zone has twice.
doubled_hour <- function(time) {
  if (!inherits(time, "POSIXct")) return(FALSE)
  at <- time[duplicated(time)][1]
  daylight <- function(t) as.POSIXlt(t, tz = attr(time, "tzone")[1] %||% "")$isdst
  daylight(at - 3600) + daylight(at + 3600) == 1 || daylight(at) != daylight(at + 3600)
}

# What to do about time that does not run on.
order_hint <- function(time, hours, steps) {
  dated <- !is.numeric(time)
  if (all(steps < 0)) return("The rows run backwards: reverse them.")
  if (dated && all(diff(time_hours(exchanged_days(time))) > 0)) {
    return(paste("Day and month are exchanged in some rows, so do not sort them: read the stamps",
                 "again with one format for all, such as {.val %d/%m/%Y %H:%M}."))
  }
  again <- mean(duplicated(hours))
  if (dated && all(steps >= 0) && sum(steps == 0) == 1 && doubled_hour(time)) {
    return(paste("This is an hour of the end of daylight saving, which a clock shows twice: give",
                 "local text and {.arg time_zone}, or UTC. Do not delete it."))
  }
  if (all(steps >= 0) && again <= 0.05) return("Keep one row for each time.")
  if (all(steps >= 0)) {
    return(paste("Do not delete rows: if the stamps are rounded, give them to the second; if",
                 "several series stand below one another, make each a column."))
  }
  # An instant has one place. A count may begin again, and then a few rows go back.
  if (again == 0 && (dated || mean(steps < 0) > 0.1 && diff(range(hours)) > 24))
    return("Sort the rows by time.")
  paste("Do not sort the rows:",
        if (dated) paste("clocks were set back (for the end of daylight saving give local text and",
                         "{.arg time_zone}, or UTC), a clock of 12 hours lacks AM and PM, or",
                         "several series stand below one another.")
        else paste("a count or a time of day begins again. Give each row its date, or add to each",
                   "part what had passed before it."))
}

# Time with day and month exchanged on the first twelve days of each month, which alone can be read
# both ways.
exchanged_days <- function(time) {
  parts <- as.POSIXlt(time, tz = "UTC")
  early <- parts$mday <= 12
  day <- parts$mday[early]
  parts$mday[early] <- parts$mon[early] + 1L
  parts$mon[early] <- day - 1L
  as.POSIXct(parts)
}
