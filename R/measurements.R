#' Measurements: the target, the boundary conditions and what each row is for
#'
#' @description
#' Checks a table of measurements and prepares it for all later stages:
#'
#' * The record is cut into segments wherever time is broken.
#' * It is averaged to a coarser step if asked (blocks follow the UTC clock).
#' * Each row is given its use: calibration, validation or warm-up.
#'
#' A time stamp marks the end of its interval, so that 10:00 of an hourly record stands for 9:00 to
#' 10:00. If yours mark the beginning, say `stamp = "start"`. A date without a time of day is that
#' whole day.
#'
#' # Time
#'
#' The time column may be `POSIXct`, `POSIXlt`, `Date`, a `difftime`, numbers of hours, or text in
#' one format:
#'
#' * ISO 8601 (`2013-08-30T00:10:00`), with or without an offset like `Z` or `+02:00`;
#' * `30.08.2013 00:10`;
#' * `30/08/2013 00:10` or `08/30/2013 12:10 AM`, if the whole column tells day from month;
#' * the stamps of EnergyPlus (` 01/21 24:00:00`, hours of a year that is not known);
#' * numbers.
#'
#' Midnight may be `24:00:00`.
#'
#' Numbers are hours if their step is a usual one (10 min, 1 h, 1 d). Other numbers are recognised,
#' with a message, if they cannot be hours: Unix time, digits of a date like 201308300010, and
#' days that Excel, MATLAB or astronomers count. Numbers that could be several things are an error
#' that names the `time_format` of each. Examples are daily digits of two-digit years, whole days of
#' Excel, steps of 5, 10, 60 or 600, and a column called `day` or `seconds`. What stays open is an
#' error, and `time_format` settles it.
#'
#' Text without an offset is UTC, or local in `time_zone`. When daylight saving ends, one hour is
#' there twice; the column's order tells the first from the second. A time that the beginning of
#' daylight saving leaves out is an error. Text that steps as the clocks of a common zone do on such
#' a day is not read as UTC unless `time_zone = "UTC"` says so.
#'
#' The record keeps time as `POSIXct`, with the clock of `time_zone`. If no date is known, it keeps
#' hours. Simulators and figures are given that.
#'
#' # Gaps
#'
#' Rows whose target is `NA` drive the simulator and are left out of the comparison. An average that
#' holds one of these rows is left out, too.
#'
#' A lost row does not break the record: its drivers are interpolated linearly. Longer gaps, and
#' values that a driver lacks, are filled in the same way up to `fill_gaps` hours. If more is lost,
#' the record is cut.
#'
#' Stamps that stray by up to a quarter of a step are taken at the nearest of equal steps. Rows at
#' no step, up to a tenth of all, are left out. Each of these changes is reported.
#'
#' # Faults of a record
#'
#' Some values cannot be measurements. Codes for a missing value are refused (`missing`). Other
#' faults are findings:
#'
#' * values far outside all others,
#' * a target at the end of its sensor's range (`range`),
#' * a sensor that is stuck,
#' * a target in steps that are coarse for its noise,
#' * values that are repeated in several rows,
#' * a direction that is not `circular()`,
#' * a counter that rises and is reset,
#' * temperatures whose unit changes at some row,
#' * a condition that is constant in calibration but not in the held-out rows.
#'
#' Zeros, columns of few levels (switches, schedules) and the ends of what drives are no faults.
#' [upgrade_model()] adds what its base model shows: clocks that differ, a start that is not
#' forgotten, a step of the sensor. While a finding stands, a mechanism is *likely* at most.
#'
#' @param data A data frame, or a series of class `zoo`, `xts`, `ts` or `tsibble`. Every numeric
#'   column may drive the simulator. A `ts` of 24 values a cycle, or a multiple of that, counts
#'   days.
#' @param time Name of the time column; a series that knows its own needs none.
#' @param target Name of the measured target.
#' @param boundary The boundary conditions that are analysed: a formula such as `~ Te + Ws +
#'   circular(Wd)`, their names, or a list with a label and a unit for each ([condition()]). A
#'   circular quantity (degrees) enters as sine and cosine. One that is `TRUE` or `FALSE` enters as
#'   1 or 0.
#' @param noise_sd Standard deviation of the (averaged) target's measurement error, in the target's
#'   unit. `"bootstrap"` or [bootstrap_noise()] estimate it from the readings inside each average.
#'   If not given, the standard error of the averages is taken. Both need `average`.
#' @param average Width of the averages in hours; `NULL` keeps the step of the data.
#' @param calibrate,validate Which rows calibrate and which validate: logical vectors, or
#'   expressions in the columns of `data`, as text (see *Choosing rows*).
#' @param warmup Hours at the start of each segment that are left out, so that the simulator's
#'   unknown initial state is forgotten.
#' @param name,unit A name for the record, and the target's unit, for people.
#' @param time_format What the time column holds, if it does not show that itself:
#'   * text: `"dmy"` or `"mdy"`;
#'   * numbers: `"seconds"`, `"minutes"`, `"hours"` or `"days"` (`warmup`, `average` and `fill_gaps`
#'     stay in hours: 5 s are `5 / 3600`);
#'   * numbers since 1970: `"unix"` (seconds, milliseconds, microseconds or nanoseconds) or
#'     `"unix_days"`;
#'   * days counted from a date: `"excel"` (41516 is 30 August 2013), `"matlab"`, `"julian"`,
#'     `"mjd"` (modified Julian);
#'   * either: a format of [strptime()] (`"%Y%m%d%H"`).
#' @param time_zone Zone of text without an offset, and of the clock that times of day are shown in:
#'   `"UTC"`, or a name like `"Europe/Berlin"`.
#' @param fill_gaps Longest gap, in hours, that is filled in what drives the simulator: by straight
#'   lines, circular boundary conditions by way of sine and cosine.
#' @param missing Values that stand for a missing one, like `c(-9999, 85)`: they become `NA` in
#'   every column. `NA` says that no value does. Otherwise, codes in the target or in a boundary
#'   condition are refused.
#' @param range Lower and upper end of the range of the target's sensor. Rows at an end, or beyond,
#'   are left out of the comparison.
#' @param stamp What a time stamp marks of its interval: `"end"` or `"start"`. If it is not given,
#'   the end; but dates without a time of day mark the start of their day.
#' @param label What the target is, in a few words: `"air of the living room"`. Sentences and
#'   figures show it in place of the column's name.
#' @return An object of class `amiss_measurements`:
#'   * `time`, `hours`: of the end of each row, after averaging.
#'   * `y`: the target in each row.
#'   * `use`: `"calibrate"`, `"validate"`, `"warmup"` or `"none"`. The calibration rows are those
#'     with `"calibrate"` whose `y` is not `NA`.
#'   * `noise`: how `noise_sd` came about (`method`). If it was estimated, `per_step` has the value
#'     of each average.
#'   * `findings`: a data frame with a row for each fault of the record: `id`, `column`, `rows`,
#'     `value`, and what it `says`.
#' @section Choosing rows: `calibrate` and `validate` set the use of the rows:
#'   * With neither, all rows calibrate.
#'   * Without `calibrate`, all rows calibrate but those that validate.
#'   * Without `validate`, none validate.
#'
#'   At least 20 rows must calibrate. Rows of neither use still drive the simulator.
#'
#'   In an expression the record's time may be called `time`: its stamps as they were given. Texts
#'   in quotes are compared with numbers as numbers, and with times as times (`"time >=
#'   '2013-09-02'"`). They are then read in the format of their column or as ISO 8601, and in
#'   `time_zone`.
#' @examples
#' table <- data.frame(hour = 1:48, Ti = 20 + sin(1:48 / 4), Te = 5 + 3 * sin(1:48 / 4))
#' measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1, warmup = 6)
#'
#' # Local text, a lost row and a gap of a driver.
#' stamp <- as.POSIXct("2024-03-30", tz = "Europe/Berlin") + 3600 * table$hour
#' table$time <- format(stamp, "%d.%m.%Y %H:%M")
#' table$Te[20] <- NA
#' measurements(table[-30, ], time = "time", target = "Ti", boundary = ~Te, noise_sd = 0.1,
#'              time_zone = "Europe/Berlin", fill_gaps = 2)
#' @export
measurements <- function(data, time = NULL, target, boundary, noise_sd = NULL, average = NULL,
                         calibrate = NULL, validate = NULL, warmup = 0, name = target, unit = "",
                         time_format = NULL, time_zone = NULL, fill_gaps = 0, missing = NULL,
                         range = NULL, stamp = NULL, label = NULL) {
  check_arguments()
  table <- time_table(data, time, time_format)
  data <- table$data
  time <- table$time
  check_input(checkmate::check_data_frame(data, min.rows = 10), "data")
  check_input(checkmate::check_string(target), "target")
  check_input(checkmate::check_number(warmup, lower = 0, finite = TRUE), "warmup")
  check_input(checkmate::check_number(fill_gaps, lower = 0, finite = TRUE), "fill_gaps")
  check_input(checkmate::check_choice(stamp, c("end", "start"), null.ok = TRUE), "stamp")
  check_input(checkmate::check_string(label, min.chars = 1, null.ok = TRUE), "label",
              "Say in a few words what the target is.")
  terms <- boundary_terms(boundary)
  check_record(data, time, target, terms, name, unit)
  check_marks(missing, range)
  require_columns(data, c(time, target, terms$name))
  if (any(terms$name %in% c(time, target))) {
    abort_input(c(paste("{.val {intersect(terms$name, c(time, target))}} cannot be a boundary",
                        "condition: it is the target or the time."),
                  i = "Leave it out of {.arg boundary}."))
  }
  reading <- time_reading(data[[time]], time, table$format, time_zone)
  stamps <- reading$time
  clock <- condition_clock(data[[time]], reading, time_zone)
  columns_known <- with_time(data, stamps)
  data <- with_switches(data, terms$name)
  numeric_columns <- setdiff(names(data)[vapply(data, is.numeric, TRUE)], c(time, target))
  require_numeric(data, c(target, terms$name))
  circular <- terms$name[terms$circular]
  data <- with_marks(data, c(target, numeric_columns), target, missing, range)
  if (!identical(missing, NA)) refuse_codes(data, c(target, terms$name), circular)
  drivers <- as.matrix(data[numeric_columns])
  y <- as.numeric(data[[target]])
  if (any(is.infinite(y))) {
    abort_input(c(paste("Target {.val {target}} has {sum(is.infinite(y))} infinite value{?s}; the",
                        "first is in row {which(is.infinite(y))[1]}."),
                  i = "Mark a missing value as NA: it is then left out."))
  }
  calibrate <- chosen_rows(calibrate, columns_known, clock, "calibrate")
  validate <- chosen_rows(validate, columns_known, clock, "validate")
  validate <- rows_flag(validate, nrow(data), "validate") %||% rep(FALSE, nrow(data))
  calibrate <- rows_flag(calibrate, nrow(data), "calibrate") %||% !validate
  if (any(calibrate & validate)) {
    abort_input(c(paste("{sum(calibrate & validate)} row{?s} both calibrate{?s/} and",
                        "validate{?s/}; the first is row {which(calibrate & validate)[1]}."),
                  i = "Validation rows must not be seen by the calibration."))
  }
  used_for <- ifelse(calibrate, "calibrate", ifelse(validate, "validate", "none"))
  stamps <- interval_ends(stamps, data[[time]], reading$format, stamp)
  grid <- regular_grid(time_hours(stamps), fill_gaps, time)
  there <- !is.na(grid$row)
  use_given <- used_for
  tell_gaps(grid$hours[there], grid$segment[there], used_for[grid$row[there]], grid$row[there])
  drivers <- fill_drivers(drivers[grid$row, , drop = FALSE], grid, fill_gaps, circular)
  stamps <- grid_time(stamps, grid)
  require_complete(drivers, terms$name, stamps, grid$row)
  # A lost row has the use of the row before it, which it needs for averages only.
  used_for <- used_for[grid$row[there]][cumsum(there)]
  into_segment <- grid$hours - stats::ave(grid$hours, grid$segment, FUN = min) + grid$step
  use <- ifelse(into_segment <= warmup + 1e-9, "warmup", used_for)

  raw <- list(time = stamps, hours = grid$hours, step_h = grid$step, segment = grid$segment,
              use = use, y = y[grid$row], drivers = drivers)
  # Sine and cosine are taken before averages: the mean of 350 and 10 degrees is not 180.
  columns <- boundary_columns(drivers, terms)
  coarse <- average_rows(raw, average, columns$values)
  x <- c(list(values = coarse$boundary), columns[c("names", "condition")])
  if (sum(coarse$use == "calibrate" & !is.na(coarse$y)) < 20) {
    abort_input(c(paste("Only {sum(coarse$use == 'calibrate' & !is.na(coarse$y))} rows are left",
                        "for calibration after averaging and warm-up; at least 20 are needed."),
                  i = "Check {.arg calibrate}, {.arg warmup} ({warmup} h) and {.arg average}."))
  }
  if (warmup > 0 && !any(use == "warmup")) {
    warn_input(c(paste("{.arg warmup} is {warmup} h, shorter than a step of {signif(grid$step, 4)}",
                       "h: no row warms up."), i = "Give it in hours."))
  }
  told <- terms$label != terms$name | nzchar(terms$unit)
  constant <- constant_conditions(x, coarse$use == "calibrate")
  if (length(constant)) {
    warn_input(c(paste("{cli::qty(constant)}Boundary condition{?s} {.val {constant}} {?does/do}",
                       "not vary over the calibration rows and {?is/are} left out of the",
                       "analysis."),
                 i = "A constant condition cannot be distinguished from the mean."))
    x <- x_keep(x, setdiff(x$names, constant))
  }
  noise <- noise_level(noise_sd, coarse, raw$y)
  findings <- record_findings(list(columns = c(data[target], data[numeric_columns]),
                                   target = target, conditions = terms$name, circular = circular,
                                   labels = stats::setNames(c(label %||% target, terms$label),
                                                            c(target, terms$name)),
                                   units = stats::setNames(c(unit, terms$unit),
                                                           c(target, terms$name)),
                                   use = use_given,
                                   noise_sd = noise$sd * sqrt(coarse$per_step),
                                   per_step = coarse$per_step, no_codes = identical(missing, NA)))
  measured <- list(
    format_version = format_version, name = name, target = target, unit = unit, label = label,
    noise_sd = noise$sd, noise = noise[-1], raw = raw, per_step = coarse$per_step,
    step_h = coarse$step_h, time = coarse$time, hours = coarse$hours, segment = coarse$segment,
    use = coarse$use, y = coarse$y, standard_error = coarse$standard_error, block = coarse$block,
    boundary = x$values, condition = x$condition, conditions = x$names,
    labels = stats::setNames(terms$label, terms$name)[told],
    units = stats::setNames(terms$unit, terms$name)[told], time_format = reading$format,
    time_zone = time_zone, stamp = stamp, constant = constant, findings = findings,
    faulty = faulty_steps(findings, target, coarse$block, grid$row), missing = missing,
    range = range)
  tell_findings(measured)
  structure(measured, class = "amiss_measurements")
}

# A batch job prints no record: what was found is told when it is read.
tell_findings <- function(measurements) {
  told <- finding_bullets(findings_read(measurements)$says)
  if (length(told))
    cli::cli_inform(c("Look at the record {.val {measurements$name}} first:", told),
                    class = "amiss_message_record")
}

finding_bullets <- function(says) {
  more <- length(says) - most_findings
  c(stats::setNames(as_said(utils::head(says, most_findings)),
                    rep("!", min(length(says), most_findings))),
    if (more > 0) c("!" = sprintf("%d more: see {.code $findings} of the record", more)))
}

most_findings <- 5

# Steps of the averaged record in which a reading of the target is known to be none.
faulty_steps <- function(findings, target, block, row) {
  rows <- unlist(findings$rows[findings$column == target])
  unique(block[match(rows, row)])
}

require_columns <- function(data, columns, call = rlang::caller_env()) {
  missing <- setdiff(columns, names(data))
  if (length(missing)) {
    abort_input(c("{cli::qty(missing)}Column{?s} {.val {missing}} {?is/are} not in the data.",
                  i = "Columns there: {.val {names(data)}}."), call = call)
  }
}

# What is on or off, as 0 and 1.
with_switches <- function(data, columns) {
  switches <- columns[vapply(data[columns], function(x) is.logical(x) && is.null(dim(x)), NA)]
  data[switches] <- lapply(data[switches], as.numeric)
  data
}

require_numeric <- function(data, columns, call = rlang::caller_env()) {
  for (column in columns) {
    if (is.numeric(data[[column]]) && is.null(dim(data[[column]]))) next
    values <- as.character(data[[column]])
    bad <- which(is.na(suppressWarnings(as.numeric(values))) & !is.na(values))
    where <- if (length(bad)) "row {bad[1]} holds {.val {values[bad[1]]}}"
             else "it is of class {.cls {class(data[[column]])}}"
    abort_input(c(paste0("Column {.val {column}} is not numeric: ", where, "."),
                  i = "Read it as numbers, or mark missing values as NA."), call = call)
  }
}

# A gap between two uses of the record is as it should be; one within a use may be a loss of data.
tell_gaps <- function(hours, segment, used_for, row) {
  gaps <- which(diff(segment) != 0)
  inside <- gaps[used_for[gaps] == used_for[gaps + 1]]
  tell <- function(rows, say) {
    if (!length(rows)) return(invisible())
    say(c(paste("The record has {length(rows)} gap{?s} {where}: the first is of",
                "{round(diff(hours)[rows[1]], 1)} h after row {row[rows[1]]}."),
          i = "Each part is simulated on its own, with its own warm-up."))
  }
  where <- "within the rows of one use"
  tell(inside, function(text) warn_input(text, .envir = parent.frame()))
  where <- "between calibration and validation"
  tell(setdiff(gaps, inside),
       function(text) cli::cli_inform(text, class = "amiss_message_gap", .envir = parent.frame()))
}

# `row` of the data, NA for one that was lost.
require_complete <- function(drivers, analysed, time, row = seq_along(time),
                             call = rlang::caller_env()) {
  for (column in analysed) {
    bad <- which(!is.finite(drivers[, column]) & !is.na(row))
    if (length(bad)) {
      abort_input(
        c(paste("Boundary condition {.val {column}} has {length(bad)} missing or infinite",
                "value{?s}; the first is in row {row[bad[1]]} ({format(time[bad[1]])})."),
          i = paste("A simulator needs every value of what drives it: fill short gaps by",
                    "{.arg fill_gaps} of {.fun measurements}, or remove these rows as a whole.")),
        call = call)
    }
  }
}

# What conditions may name: the columns, and the record's time as `time` if none is called so.
with_time <- function(data, stamps) {
  if (!"time" %in% names(data)) data$time <- stamps
  data
}

# The rows that an argument chooses: a condition of a study file, R code as text, or logical values
# as they are.
chosen_rows <- function(rows, data, clock, what, call = rlang::caller_env()) {
  if (inherits(rows, "amiss_row_condition")) row_condition(rows$text, data, what, clock, call)
  else if (is.character(rows)) eval_rows(rows, data, what, clock, call)
  else rows
}

eval_rows <- function(text, data, what, clock, call = rlang::caller_env()) {
  check_input(checkmate::check_string(text, min.chars = 1), what,
              "One expression in the columns of the data.", call = call)
  refuse <- function(e) {
    abort_input(c("{.arg {what}} = {.val {text}} cannot be evaluated: {conditionMessage(e)}.",
                  i = paste("Write an expression in the columns, for example",
                            "{.code phase == \"rolbs\"}.")), call = call)
  }
  scope <- list2env(comparisons(clock), parent = baseenv())
  in_zone(clock$zone %||% attr(clock$time, "tzone")[1],
          tryCatch(eval(str2lang(text), as.list(data), scope), error = refuse))
}

# Code to which times that say no zone are in this one.
in_zone <- function(zone, code) {
  if (is.null(zone) || !nzchar(zone)) return(code)
  before <- Sys.getenv("TZ", NA)
  on.exit(if (is.na(before)) Sys.unsetenv("TZ") else Sys.setenv(TZ = before))
  Sys.setenv(TZ = zone)
  code
}

rows_flag <- function(rows, n, what, call = rlang::caller_env()) {
  if (is.null(rows)) return(NULL)
  check_input(checkmate::check_logical(rows, len = n, any.missing = FALSE), what,
              "One TRUE or FALSE for every row of the data.", call = call)
  if (!any(rows)) abort_input("{.arg {what}} picks no row.", call = call)
  rows
}

# Means over blocks of whole rows, aligned to the clock; a block must be complete and of one use and
# segment.
average_rows <- function(raw, average, boundary, call = rlang::caller_env()) {
  per_step <- 1L
  if (!is.null(average)) {
    check_input(checkmate::check_number(average, lower = 1e-6, upper = 1e6), "average", call = call)
    per_step <- as.integer(round(average / raw$step_h))
    if (per_step < 1 || abs(per_step * raw$step_h - average) > 1e-6 * average) {
      abort_input(paste("{.arg average} = {average} h is not a whole multiple of the data's step",
                        "of {signif(raw$step_h, 4)} h."), call = call)
    }
  }
  width <- per_step * raw$step_h
  clock <- floor((raw$hours - 0.5 * raw$step_h) / width)
  key <- interaction(raw$segment, clock, drop = TRUE, lex.order = TRUE)
  block <- as.integer(factor(key, levels = unique(key)))
  size <- tabulate(block)
  uses <- tapply(raw$use, block, function(u) if (length(unique(u)) == 1) u[1]
                                             else if ("warmup" %in% u) "warmup"
                                             else "none")
  whole <- which(size == per_step)
  index <- match(block, whole)
  keep <- !is.na(index)
  mean_of <- function(v) as.numeric(rowsum(v[keep], index[keep], reorder = TRUE)) / per_step
  y <- mean_of(raw$y)
  spread <-
    if (per_step > 1)
      sqrt(pmax(0, as.numeric(rowsum((raw$y[keep] - y[index[keep]])^2, index[keep])) /
                   (per_step - 1)) / per_step)
    else rep(NA_real_, length(whole))
  boundary <- rowsum(boundary[keep, , drop = FALSE], index[keep], reorder = TRUE) / per_step
  last <- which(keep)[!duplicated(index[keep], fromLast = TRUE)]
  dimnames(boundary) <- NULL
  list(per_step = per_step, step_h = width, time = raw$time[last], hours = raw$hours[last],
       segment = raw$segment[last], use = unname(as.character(uses[whole])), y = y,
       standard_error = spread, boundary = boundary, block = index)
}

# Rows of a use that have a measured value.
used_rows <- function(measurements, use) which(measurements$use == use & !is.na(measurements$y))

# TRUE where a row does not follow the one before at the usual step.
segment_starts <- function(measurements, rows) {
  segment <- measurements$segment[rows]
  c(TRUE, diff(segment) != 0)
}

#' @export
print.amiss_measurements <- function(x, ...) on_stdout(x, {
  lost <- is.na(x$y) & x$use != "warmup"
  n <- table(factor(x$use[!lost], c("calibrate", "validate", "warmup")))
  cli::cli_text(paste("{.strong Measurements} {.val {x$name}}: {length(x$y)} steps of",
                      "{signif(x$step_h, 3)} h in {length(unique(x$segment))} segment{?s}"))
  origin <- switch(
    x$noise$method, given = "",
    `standard error` = paste0(" (standard error of averages of ", x$per_step, " readings)"),
    sprintf(" (%s, %d an average, %d times)", x$noise$method, x$noise$readings, x$noise$replicates))
  cli::cli_bullets(c("*" = paste("target {.field {target_label(x)}}, noise standard deviation",
                                 "{signif(x$noise_sd, 3)} {pretty_unit(x$unit)}{origin}"),
                     "*" = paste("{n[['calibrate']]} calibrate, {n[['validate']]} validate,",
                                 "{n[['warmup']]} warm up"),
                     "*" = if (any(lost)) "{sum(lost)} without a measurement, left out",
                     "*" = "boundary conditions {.field {condition_titles(x)}}"))
  cli::cli_bullets(c(finding_bullets(findings_read(x)$says),
                     ">" = "next: {.fun simulate_design} or {.fun upgrade_model}"))
})
