# What a table of measurements must not hold, beside what cannot be read.

check_record <- function(data, time, target, terms, name, unit, call = rlang::caller_env()) {
  check_input(checkmate::check_string(name), "name", call = call)
  check_input(checkmate::check_string(unit), "unit", call = call)
  twice <- names(data)[duplicated(names(data))]
  if (length(twice)) {
    abort_input(c(paste("{.arg data} has {cli::qty(unique(twice))}the column{?s}",
                        "{.val {unique(twice)}} more than once."),
                  i = "Give every column a name of its own."), call = call)
  }
  if (time == target)
    abort_input("{.arg target} and {.arg time} are both the column {.val {time}}.", call = call)
  again <- terms$name[duplicated(terms$name)]
  if (length(again)) {
    abort_input(c("{.val {again[1]}} stands twice in {.arg boundary}.",
                  i = "It is either circular or not."), call = call)
  }
}

check_marks <- function(missing, range, call = rlang::caller_env()) {
  if (!identical(missing, NA)) {
    check_input(checkmate::check_numeric(missing, null.ok = TRUE, any.missing = FALSE), "missing",
                "Give the values that stand for a missing one, or {.code NA} if there is none.",
                call = call)
  }
  check_input(
    checkmate::check_numeric(range, len = 2, any.missing = FALSE, null.ok = TRUE), "range",
    "Give the lower and the upper end of the sensor's range, such as {.code c(-Inf, 27)}.",
    call = call)
  if (!is.null(range) && range[1] >= range[2]) {
    abort_input("{.arg range} goes from {range[1]} to {range[2]}: the lower end comes first.",
                call = call)
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
    abort_input(c(paste("{.val {column}} is {listed(format_each(codes), 'or')} in",
                        "{rows_words(rows)}: a code for a missing value."),
                  i = paste("Give {.code missing = {value_code(codes)}} to {.fun measurements},",
                            "which sets it to NA, or correct these rows."),
                  i = "If it was measured, {.code missing = NA} says that no value is a code."),
                call = call)
  }
}

# What a table shows that drives a simulator without being a record of its own: list(columns, ...)
# as record_findings() has it. `known`: the findings of a record that say the same of it already.
table_findings <- function(columns, target = "", circular = character(), noise_sd = NA_real_,
                           per_step = 1, known = no_findings()) {
  rows <- lengths(columns)[1]
  found <- record_findings(list(
    columns = columns, target = target, conditions = setdiff(names(columns), target),
    circular = circular, use = rep("validate", rows), noise_sd = noise_sd, per_step = per_step))
  told <- found$id %in% c("missing_code", "far_outside", "unit", "counter", "at_rest", "stuck")
  found$says <- sub(" Give missing = .*", "", found$says)
  found[told & !paste(found$id, found$column) %in% paste(known$id, known$column), ]
}

warn_findings <- function(found, name) {
  if (!nrow(found)) return(invisible())
  warn_input(
    c("{.arg {name}} holds {nrow(found)} kind{?s} of values that seem to be no measurements.",
      stats::setNames(as_said(found$says), rep("x", nrow(found))),
      i = "A simulator takes them as they are."))
}

# A record of one value can carry runs, but nothing can be learned of it.
check_target_varies <- function(measurements, rows, call = rlang::caller_env()) {
  y <- measurements$y[rows]
  if (all(y == y[1])) {
    abort_input(paste("Target {.val {measurements$target}} is {y[1]} in all {length(y)} rows that",
                      "calibrate: there is nothing to explain."), call = call)
  }
}
