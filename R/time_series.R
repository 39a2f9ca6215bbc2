# Time series objects (zoo, xts, ts, tsibble) as the data frames that measurements() reads:
# list(data, time, format), the time in the column `time`.

time_table <- function(data, time, format, call = rlang::caller_env()) {
  if (stats::is.ts(data))
    return(with_index(data, stats::time(data), time, format %||% ts_unit(data, call), call))
  if (inherits(data, "zoo")) {
    rlang::check_installed(intersect(class(data), c("xts", "zoo")))
    return(with_index(zoo::coredata(data), zoo::index(data), time, format, call))
  }
  check_input(checkmate::check_data_frame(data), "data", call = call)
  if (inherits(data, "tbl_ts")) time <- time %||% as.character(attr(data, "index"))
  check_input(checkmate::check_string(time), "time", "Name the column that holds the time.",
              call = call)
  list(data = plain_table(as.list(data), nrow(data)), time = time, format = format)
}

# The table only, of plain numbers, each column with a name: other classes take columns in their own
# way.
plain_table <- function(columns, rows) {
  names(columns) <- filled_names(names(columns))
  plain_numbers(structure(columns, class = "data.frame", row.names = .set_row_names(rows)))
}

# A column without a name, such as an index that was written with the table, is named by its place.
filled_names <- function(names)
  ifelse(is.na(names) | !nzchar(names), paste0("column_", seq_along(names)), names)

with_index <- function(values, index, time, format, call) {
  time <- time %||% "time"
  check_input(checkmate::check_string(time), "time", call = call)
  columns <- colnames(values)
  if (is.null(columns)) abort_input(c("{.arg data} is a series whose columns have no names.",
                                      i = "Name them by {.fun colnames}."), call = call)
  if (time %in% columns) {
    abort_input(
      c("{.arg time} = {.val {time}} names a column of the series, whose own index is its time.",
        i = "Leave {.arg time} out, or give another name for the index."), call = call)
  }
  if (stats::is.ts(index)) index <- as.numeric(index)
  data <- c(as.list(as.data.frame(unclass(values))), list(index))
  names(data) <- c(columns, time)
  list(data = plain_table(data, length(index)), time = time, format = format)
}

# A series of 24 values a cycle, or a multiple of that, counts days; what others count is not known.
ts_unit <- function(data, call) {
  values <- stats::frequency(data)
  if (values %% 24 == 0 && values <= 1440) return("days")
  abort_input(
    c("{.arg data} is a {.cls ts} of frequency {values}, which does not say what its time counts.",
      i = paste("Say it by {.arg time_format}, one of {.val {names(time_units)}}, or make it a",
                "data frame with a time column.")),
    call = call)
}
