# What a table of measurements must not hold, beside what cannot be read.

# Codes of loggers for a value that is missing.
missing_codes <- c(-9999, -99999)

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

check_target_values <- function(y, target, call = rlang::caller_env()) {
  coded <- which(y %in% missing_codes)
  if (length(coded)) {
    abort_input(c(paste("Target {.val {target}} is {y[coded[1]]} in {length(coded)} row{?s}, the first {coded[1]}: a",
                        "code for what is missing."),
                  i = "Mark a missing value as NA: it is then left out."), call = call)
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
