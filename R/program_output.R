#' Where the output of a program is
#'
#' Describes a table in a file that a program wrote, for `program_simulator(output = )`. Programs
#' write comments, rows of units, days of warm-up before the record and finer steps than it has. All
#' of that is read as it is, and matched to the record by `time`.
#'
#' # Which rows are read
#'
#' Without `time`, the table has one row for each row of the drivers, in their order, but for the
#' rows that `drop_first` and `drop_last` leave out.
#'
#' With `time`, each row of the drivers takes the rows of the table that end within it; several are
#' averaged. Other rows (a warm-up, a last row at midnight) are left out. If time begins again in
#' the file, as after the design days of EnergyPlus, the part that covers the record is taken, the
#' last of several. A time of the record that the table does not have, or has twice, makes the run
#' fail and is named.
#'
#' # Formats of time
#'
#' * `NULL`: text in ISO 8601 and the other forms of [measurements()], also ` 07/21 24:00:00` of
#'   EnergyPlus, which has no year; or numbers that are the `time` of the drivers' CSV, for a record
#'   without dates.
#' * `"seconds"`, `"minutes"`, `"hours"`, `"days"`: numbers since the beginning of the first row of
#'   the drivers, as in their column `hours`.
#' * `"day_of_year"`: decimal days of ESP-r. 1 January 0:00 is 1, noon of 2 January is 2.5.
#' * `"hours_of_year"`: hours since 1 January 0:00.
#' * A format of [strptime()]: text, with a year (`"%d.%m.%Y %H:%M"`) or without (`"%d/%m %H:%M"`).
#'   Hour 24 ends a day.
#'
#' Stamps that say no zone are in the clock of the program: UTC, or standard time `utc_offset` hours
#' ahead of it. If the drivers are an [epw_weather()], it is the clock of that file. Stamps without
#' a year are those of the record's year.
#'
#' @param file The file in the run's folder (`"stdout.txt"` for what the last step prints). A file
#'   that ends in `.sql` is EnergyPlus' SQLite output; its columns are named `"KEY:Name of the
#'   variable"`, and its time is known.
#' @param column Names of the columns, or their numbers in a table without names. The units that
#'   EnergyPlus writes behind a name (` [C](TimeStep)`) may be left out.
#' @param combine `"sum"` or `"mean"` of several columns.
#' @param time Name or number of the column of time; two, such as a day and a clock, are read as one
#'   text.
#' @param time_format See *Formats of time*.
#' @param stamps Whether a time is the `"end"` of its interval, its `"start"` or its `"middle"`.
#' @param utc_offset Hours that the program's clock is ahead of UTC.
#' @param skip Lines to leave out at the beginning of the file.
#' @param comment Sign with which lines of comment begin; `""` if there are none. Names of columns
#'   may stand in one.
#' @param separator Sign between fields, or `"comma"`, `"semicolon"`, `"tab"`, `"bar"`, `"space"`
#'   (any number of them). By default the one with which the names of the columns are found; in a
#'   table without names, spaces.
#' @param decimal `"."` or `","`.
#' @param units_rows Rows between the names and the first row of numbers.
#' @param drop_first,drop_last Rows to leave out at the begin and at the end.
#' @param transform Function of the values, taken last: `log` for the logarithm of a flow.
#' @return An object of class `amiss_program_output`.
#' @examples
#' # EnergyPlus
#' program_output("eplusout.csv", "LIVING ROOM:Zone Mean Air Temperature", time = "Date/Time")
#' # ESP-r: days as decimals, whitespace between columns, comments
#' program_output("raw.txt", 2, time = 1, time_format = "day_of_year", separator = "space")
#' # A hydrological program: two components of the flow
#' program_output("flow.txt", c("quick", "slow"), combine = "sum", time = "date",
#'                time_format = "%d.%m.%Y", separator = "semicolon", decimal = ",", units_rows = 1)
#' @export
program_output <- function(file, column, combine = NULL, time = NULL, time_format = NULL,
                           stamps = "end", utc_offset = NULL, skip = 0, comment = "#",
                           separator = NULL, decimal = ".", units_rows = 0, drop_first = 0,
                           drop_last = 0, transform = NULL) {
  check_arguments()
  check_input(checkmate::check_string(file, min.chars = 1), "file")
  check_inside(c(file = file))
  check_output_columns(column, combine, time)
  check_output_time(time_format, stamps, utc_offset)
  check_input(checkmate::check_string(comment), "comment")
  check_table_options(separator, decimal, rlang::current_env())
  check_input(checkmate::check_string(decimal), "decimal", "It is {.val .} or {.val ,}, in quotes.")
  counts <- list(skip = skip, units_rows = units_rows, drop_first = drop_first,
                 drop_last = drop_last)
  for (name in names(counts)) {
    count <- counts[[name]]
    check_input(checkmate::check_int(count, lower = 0, upper = 1e6), name,
                "It is a number of rows.")
  }
  check_input(checkmate::check_function(transform, null.ok = TRUE), "transform",
              "Give for example {.code log}.")
  sqlite <- grepl("[.](sql|sqlite|db)$", file)
  if (sqlite) check_sqlite(column)
  structure(c(list(file = file, column = column, combine = combine, time = time,
                   time_format = time_format, stamps = stamps, utc_offset = utc_offset,
                   comment = comment, separator = separator, decimal = decimal, sqlite = sqlite,
                   transform = transform), counts), class = "amiss_program_output")
}

check_output_columns <- function(column, combine, time, call = rlang::caller_env()) {
  names <- function(x, name, ...) {
    check_input(
      if (is.numeric(x)) checkmate::check_integerish(x, lower = 1, any.missing = FALSE, ...)
      else checkmate::check_character(x, min.chars = 1, any.missing = FALSE, ...),
      name, "Give names of columns, or their numbers in a table without names.", call = call)
  }
  names(column, "column", min.len = 1, unique = TRUE)
  if (!is.null(time)) names(time, "time", min.len = 1, max.len = 2)
  if (!is.null(time) && is.numeric(time) != is.numeric(column)) {
    abort_input(c(paste("{.arg time} = {.val {time}} is a",
                        "{if (is.numeric(time)) 'number' else 'name'}, {.arg column} is not."),
                  i = "Give names for both, or numbers in a table without names."), call = call)
  }
  check_input(checkmate::check_choice(combine, c("sum", "mean"), null.ok = TRUE), "combine",
              call = call)
  if (length(column) > 1 && is.null(combine)) {
    abort_input(c("{.arg column} names {length(column)} columns.",
                  i = paste("Say by {.arg combine} whether their {.val sum} or their {.val mean}",
                            "is meant.")), call = call)
  }
}

check_output_time <- function(format, stamps, utc_offset, call = rlang::caller_env()) {
  check_input(checkmate::check_string(format, null.ok = TRUE), "time_format", call = call)
  known <- c(names(time_units), "day_of_year", "hours_of_year")
  if (!is.null(format) && !format %in% known && !is_pattern(format)) {
    abort_input(c("{.arg time_format} = {.val {format}} is not known.",
                  i = paste("Give one of {.val {known}}, or a format of {.fun strptime} such as",
                            "{.val %d.%m.%Y %H:%M}.")), call = call)
  }
  lacks <- if (is_pattern(format)) setdiff(pattern_lacks(format), "year")
  if (length(lacks)) {
    abort_input(c("{.arg time_format} = {.val {format}} has no {listed(lacks)}.",
                  i = "If day and clock are two columns, name both in {.arg time}."), call = call)
  }
  check_input(checkmate::check_choice(stamps, c("end", "start", "middle")), "stamps", call = call)
  check_input(checkmate::check_number(utc_offset, lower = -14, upper = 14, null.ok = TRUE),
              "utc_offset", "It is in hours.", call = call)
}

#' @export
print.amiss_program_output <- function(x, ...) on_stdout(x, {
  of <- if (length(x$column) > 1) paste("the", x$combine, "of the ") else "the "
  cli::cli_text(paste("{.strong Output} in {.file {x$file}}:",
                      "{of}{cli::qty(length(x$column))}column{?s} {.val {x$column}}"))
  how <- if (x$sqlite) "by EnergyPlus' own time"
         else if (is.null(x$time)) "by the number of rows"
         else paste0("by time (column ", listed(x$time),
                     if (!is.null(x$time_format)) paste0(", ", x$time_format), ")")
  say_bullets(paste("matched to the record", how))
})

# The output of a run: one number for each row of the drivers. `expected`: list(time, step_h, rows,
# offset), the times of these rows and the program's clock. An error says why there is none.
read_run_output <- function(output, folder, expected) {
  if (!inherits(output, "amiss_program_output")) return(read_output(output, folder, expected$rows))
  value <- if (output$sqlite) {
    by_time(read_sqlite(output, folder), output, expected)
  } else {
    table <- read_output_table(output, folder, expected$rows)
    if (is.null(output$time)) table$value else by_time(table, output, expected)
  }
  if (is.null(output$transform)) value else output$transform(value)
}
