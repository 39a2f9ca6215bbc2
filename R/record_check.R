# What a table of measurements must not hold, beside what cannot be read.

check_record <- function(data, time, target, terms, name, unit, call = rlang::caller_env()) {
  check_input(checkmate::check_string(name), "name", call = call)
  check_input(checkmate::check_string(unit), "unit", call = call)
  twice <- names(data)[duplicated(names(data))]
  if (length(twice)) {
    abort_input(c("{.arg data} has {cli::qty(unique(twice))}the column{?s} {.val {unique(twice)}} more than once.",
                  i = "Give every column a name of its own."), call = call)
  }
  if (time == target) abort_input("{.arg target} and {.arg time} are both the column {.val {time}}.", call = call)
  again <- terms$name[duplicated(terms$name)]
  if (length(again)) {
    abort_input(c("{.val {again[1]}} stands twice in {.arg boundary}.", i = "It is either circular or not."),
                call = call)
  }
}

check_marks <- function(missing, range, call = rlang::caller_env()) {
  if (!identical(missing, NA)) {
    check_input(checkmate::check_numeric(missing, null.ok = TRUE, any.missing = FALSE), "missing",
                "Give the values that stand for a missing one, or {.code NA} if there is none.", call = call)
  }
  check_input(checkmate::check_numeric(range, len = 2, any.missing = FALSE, null.ok = TRUE), "range",
              "Give the lower and the upper end of the sensor's range, such as {.code c(-Inf, 27)}.", call = call)
  if (!is.null(range) && range[1] >= range[2]) {
    abort_input("{.arg range} goes from {range[1]} to {range[2]}: the lower end comes first.", call = call)
  }
}

# The table with NA for the codes in `missing`, and for a target at or beyond an end of its range.
with_marks <- function(data, columns, target, missing, range) {
  codes <- missing[!is.na(missing)]
  for (column in columns) data[[column]][data[[column]] %in% codes] <- NA
  if (length(range)) {
    y <- data[[target]]
    data[[target]][!is.na(y) & (y <= range[1] | y >= range[2])] <- NA
  }
  data
}

# `columns`: the target and the boundary conditions. `circular`: those of them in degrees.
refuse_codes <- function(data, columns, circular, call = rlang::caller_env()) {
  for (column in columns) {
    v <- as.numeric(data[[column]])
    rows <- coded_rows(v, column %in% circular)
    if (!length(rows)) next
    codes <- unique(v[rows])
    abort_input(c(paste("{.val {column}} is {listed(format_each(codes), 'or')} in {rows_words(rows)}: a code for a",
                        "missing value."),
                  i = "Give {.code missing = {value_code(codes)}} to set it to NA, or correct these rows.",
                  i = "If it was measured, {.code missing = NA} says that no value is a code."), call = call)
  }
}

# A record of one value can carry runs, but nothing can be learned of it.
check_target_varies <- function(measurements, rows, call = rlang::caller_env()) {
  y <- measurements$y[rows]
  if (all(y == y[1])) {
    abort_input(paste("Target {.val {measurements$target}} is {y[1]} in all {length(y)} rows that calibrate: there is",
                      "nothing to explain."), call = call)
  }
}
