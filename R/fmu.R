#' A simulator that is an FMU
#'
#' Calibrates parameters of a functional mock-up unit (FMU) that is exported for *co-simulation* by
#' FMI 2.0 or 3.0. Modelica tools, Simulink and many others export a model as an FMU: an archive
#' with the model's description and its compiled code. [fmu_variables()] lists what an FMU has.
#'
#' # Parameters and inputs
#'
#' *Parameters* are named as in the FMU. Their priors lie within its limits. All other parameters
#' keep their start values, but for those in `fixed`. A state whose start the FMU lets be set can
#' stand in both places, too.
#'
#' *Inputs* are driven by columns of the record, in the FMU's units. Convert the columns if
#' necessary: a Modelica model wants K, not degC. A value holds for its whole row. For a Boolean, 0
#' is `FALSE`. An input that is not driven keeps its start value; `print()` says so.
#'
#' # Output and time
#'
#' *The output* is in the FMU's unit, too. By default it is the mean over each row, because most
#' records hold means. The mean is the trapezoidal rule over the communication points,
#' `steps_per_row` in each row. More steps make it closer. An FMU cannot be held at the record while
#' it warms up: give a `warmup` that is long enough for its start to be forgotten.
#'
#' *Time* begins at `start` with the first row of each unbroken segment. A model that knows the
#' date, by the sun or by a schedule, needs a function: `function(time) as.numeric(difftime(time,
#' as.POSIXct("2024-01-01", tz = "UTC"), units = "secs"))`.
#'
#' # Trust and processes
#'
#' *Trust.* The code of an FMU can do whatever you can. To describe or print it runs none of it; its
#' library is loaded at the first run. A study file that uses one is refused unless you trust it
#' ([run_study()]).
#'
#' *Processes.* An FMU runs in a process of its own, one for each worker of [future::plan()]. The
#' process is kept from run to run. If the FMU crashes, or a run takes longer than `time_limit`,
#' that run alone is lost. It is `NaN`, a warning says why, and the next run has a new process. No
#' process stays when R ends, is interrupted or is killed. Text that the FMU prints is not shown,
#' but its last lines are part of the warning.
#'
#' @param file Path of the FMU.
#' @param ... The parameters, each made by [free()], with the name of a parameter of the FMU.
#' @param output Name of the variable that was measured.
#' @param inputs Inputs of the FMU by the columns that drive them: `c(Te = "weather.T_out")`. One
#'   without a name is driven by the column of its own name.
#' @param fixed Named list of values of other parameters, or of inputs that no column drives:
#'   numbers, `TRUE` or `FALSE`, or text.
#' @param averaged Whether the output is the mean over each row; if not, it is the value at the end
#'   of the row.
#' @param steps_per_row Communication steps in each row.
#' @param start Time of the FMU at which a segment begins, in s: a number, or a function of the
#'   begin of the segment (`POSIXct`, or hours).
#' @param tolerance Relative tolerance that the FMU's solver is asked to keep; `NULL` leaves it to
#'   the FMU.
#' @param time_limit Seconds for one run.
#' @param size_limit Megabytes that the FMU may write into its working directory.
#' @param retries How often a failed run is tried again at once, in a new process.
#' @param cache Directory in which finished runs are kept, for FMUs that are slow; `NULL` keeps
#'   none.
#' @param logging Whether the FMU is asked for all its messages, to see why runs fail.
#' @param name A name for people; the FMU's own if not given.
#' @return An object of class `amiss_fmu_simulator`.
#' @section Errors:
#'   * `amiss_error_fmu` (and `amiss_error_input`): the archive is damaged, unsafe to unpack, for
#'     model exchange only or for another platform.
#'   * `amiss_error_input`: a name that the FMU does not have, or uses in another way.
#' @seealso `vignette("fmu", "amiss")`
#' @examplesIf requireNamespace("xml2", quietly = TRUE) && nzchar(Sys.which("make"))
#' source(system.file("examples", "fmu", "build.R", package = "amiss"))
#' file <- build_house(tempfile(fileext = ".fmu"))  # yours is exported by your tool
#' house <- fmu_simulator(file, free("R_out", uniform(0.005, 0.02), "K/W"), output = "T_air",
#'                        inputs = c("Te", "P"), fixed = list(aperture = 0), steps_per_row = 4)
#' house
#' simulate_runs(house, cbind(R_out = c(0.008, 0.015)), cbind(Te = c(4, 6, 5), P = 1000),
#'               step_h = 1)
#' @export
fmu_simulator <- function(file, ..., output, inputs = character(), fixed = list(), averaged = TRUE,
                          steps_per_row = 1, start = 0, tolerance = NULL, time_limit = 600,
                          size_limit = 1000, retries = 0, cache = NULL, logging = FALSE,
                          name = NULL) {
  check_arguments()
  check_input(checkmate::check_string(file, min.chars = 1), "file")
  check_input(checkmate::check_string(output, min.chars = 1), "output",
              "Name the variable that was measured.")
  check_input(checkmate::check_flag(averaged), "averaged")
  check_input(checkmate::check_int(steps_per_row, lower = 1, upper = 1e5), "steps_per_row")
  if (!is.function(start)) {
    check_input(checkmate::check_number(start, finite = TRUE), "start",
                "Give seconds, or a function that returns them.")
  }
  check_input(checkmate::check_number(tolerance, lower = 1e-15, upper = 1, null.ok = TRUE),
              "tolerance")
  check_input(checkmate::check_number(time_limit, lower = 1e-3, finite = TRUE), "time_limit",
              "It is in seconds.")
  check_input(checkmate::check_number(size_limit, lower = 1, finite = TRUE), "size_limit",
              "It is in megabytes.")
  check_input(checkmate::check_int(retries, lower = 0, upper = 1000), "retries")
  check_input(checkmate::check_string(cache, min.chars = 1, null.ok = TRUE), "cache")
  check_input(checkmate::check_flag(logging), "logging")
  check_input(checkmate::check_string(name, null.ok = TRUE), "name")
  fmu <- read_fmu(file)
  simulator <- structure(list(
    format_version = format_version, name = name %||% fmu$model, file = fmu$file, hash = fmu$hash,
    parameters = named_parameters(list(...)), inputs = fmu_inputs(inputs), fixed = fmu_fixed(fixed),
    output = output, averaged = averaged, steps_per_row = steps_per_row, start = start,
    tolerance = tolerance, time_limit = time_limit, size_limit = size_limit, retries = retries,
    cache = if (!is.null(cache)) normalizePath(cache, mustWork = FALSE), logging = logging),
                         class = "amiss_fmu_simulator")
  check_fmu_use(simulator, fmu)
}

#' Extend the use of an FMU
#'
#' A mechanism of an [fmu_simulator()] frees a parameter that was fixed, drives an input that was
#' not driven, or gives a parameter another value. What was freed or driven before stays.
#'
#' @param model An [fmu_simulator()].
#' @param ... Parameters to free, each made by [free()].
#' @param inputs Inputs to drive, as in [fmu_simulator()]. One that is driven already is driven by
#'   the new column.
#' @param fixed Values to fix, as in [fmu_simulator()].
#' @param name A name for people.
#' @return The extended simulator.
#' @examplesIf requireNamespace("xml2", quietly = TRUE) && nzchar(Sys.which("make"))
#' source(system.file("examples", "fmu", "build.R", package = "amiss"))
#' house <- fmu_simulator(build_house(tempfile(fileext = ".fmu")),
#'                        free("R_out", uniform(0.005, 0.02), "K/W"),
#'                        output = "T_air", inputs = "Te")
#' mechanism("sun", boundary = "Gv", sentence = "Sun enters that the model leaves out.",
#'           edit = function(model) {
#'   with_fmu(model, free("aperture", uniform(0, 10), "m2"), inputs = "Gv")
#' })
#' @export
with_fmu <- function(model, ..., inputs = character(), fixed = list(), name = model$name) {
  check_arguments()
  check_object(model, "amiss_fmu_simulator", "model", "Make one with {.fun fmu_simulator}.")
  check_input(checkmate::check_string(name), "name")
  added <- if (...length()) named_parameters(list(...)) else list()
  for (parameter in added[names(added) %in% names(model$parameters)]) {
    if (identical(parameter$prior, model$parameters[[parameter$name]]$prior)) next
    abort_input(c("Parameter {.val {parameter$name}} is free already, with another prior.",
                  i = "To share it, give both the same prior."))
  }
  fixed <- fmu_fixed(fixed)
  both <- intersect(names(fixed), names(model$parameters))
  if (length(both)) {
    abort_input(c("Parameter {.val {both}} is free in the model; {.arg fixed} would take it back.",
                  i = "An extension keeps what was freed before it."))
  }
  edited <- model
  edited$name <- name
  edited$parameters[names(added)] <- added
  inputs <- fmu_inputs(inputs)
  edited$inputs <- c(model$inputs[!model$inputs %in% inputs], inputs)
  kept <- model$fixed[!names(model$fixed) %in% c(names(added), names(fixed), inputs)]
  edited$fixed <- c(kept, fixed)
  check_fmu_use(edited, read_fmu(model$file))
}

# Columns as names, inputs of the FMU as values.
fmu_inputs <- function(inputs, call = rlang::caller_env()) {
  check_input(checkmate::check_character(inputs, min.chars = 1, any.missing = FALSE), "inputs",
              paste("Give inputs of the FMU by the columns that drive them:",
                    "{.code c(Te = \"weather.T_out\")}."), call = call)
  if (!length(inputs)) return(stats::setNames(character(), character()))
  columns <- rlang::names2(inputs)
  columns[columns == ""] <- inputs[columns == ""]
  twice <- inputs[duplicated(inputs)]
  if (length(twice))
    abort_input("{.arg inputs} drives {.val {unname(twice[1])}} twice.", call = call)
  stats::setNames(as.character(inputs), columns)
}

fmu_fixed <- function(fixed, call = rlang::caller_env()) {
  if (is.atomic(fixed) && !is.null(fixed)) fixed <- as.list(fixed)
  check_input(checkmate::check_list(fixed, names = if (length(fixed)) "unique"), "fixed",
              "Give values by names: {.code list(height = 2.5)}.", call = call)
  for (name in names(fixed)) {
    check_input(checkmate::check_scalar(fixed[[name]]), paste0("fixed$", name), "Give one value.",
                call = call)
  }
  fixed
}

# ---- what is declared, held against the description

check_fmu_use <- function(simulator, fmu, call = rlang::caller_env()) {
  v <- fmu$variables
  for (parameter in simulator$parameters) check_fmu_free(parameter, v, call)
  for (name in names(simulator$fixed)) check_fmu_value(name, simulator$fixed[[name]], v, call)
  for (name in simulator$inputs) check_fmu_name(name, v, "input", "inputs", call)
  check_fmu_name(simulator$output, v, "output", "output", call)
  both <- intersect(names(simulator$parameters), names(simulator$fixed))
  if (length(both)) abort_input("Parameter {.val {both}} is free and in {.arg fixed}.", call = call)
  set <- c(names(simulator$parameters), names(simulator$fixed), simulator$inputs)
  rows <- v[match(set, v$name), ]
  key <- paste(rows$reference, rows$code)
  same <- key %in% key[duplicated(key)]
  if (any(same)) {
    abort_input(paste("The FMU has one variable under the names {.val {unname(set[same])}}: give",
                      "it once."), call = call)
  }
  simulator
}

use_words <- c(parameter = "parameter", input = "input",
               output = "variable with a number that could be measured",
               fixed = "parameter or input")

# The row of a name; an error if the FMU has none, or has it for something else.
check_fmu_name <- function(name, v, use, argument, call) {
  row <- v[match(name, v$name), ]
  if (!is.na(row$name) && has_use(row, use)) return(row)
  others <- v$name[has_use(v, use)]
  why <- if (is.na(row$name)) "The FMU has no variable {.val {name}}."
         else if (row$array) "{.val {name}} of the FMU is an array; one number is needed."
         else paste("{.val {name}} of the FMU is no {use_words[[use]]}: its causality is",
                    "{.val {row$causality}}, its variability {.val {row$variability}} and its type",
                    "{.val {row$type}}.")
  near <- nearest_names(name, others)
  abort_input(c(why, x = "It stands in {.arg {argument}}.",
                i = if (!length(others)) "The FMU has no {use_words[[use]]} at all."
                    else paste0("Near names of that kind: {.val {near}}; {.fun fmu_variables} ",
                                "lists all ", length(others), ".")), call = call)
}

# A few names that are most like one.
nearest_names <- function(name, names, n = 5) {
  distance <- utils::adist(name, names, ignore.case = TRUE, partial = FALSE)[1, ]
  held <- grepl(tolower(name), tolower(names), fixed = TRUE)
  names[utils::head(order(!held, distance), n)]
}

check_fmu_free <- function(parameter, v, call) {
  name <- parameter$name
  row <- check_fmu_name(name, v, "parameter", "...", call)
  if (!row$type %in% c("Real", "Float64", "Float32")) {
    abort_input(c(paste("Parameter {.val {name}} of the FMU is of type {.val {row$type}}: only",
                        "real numbers can be free."),
                  i = paste("Give its value in {.arg fixed}; what it switches can be tried as a",
                            "mechanism.")), call = call)
  }
  prior <- parameter$prior
  if (isTRUE(prior$lower < row$min) || isTRUE(prior$upper > row$max)) {
    abort_input(c(paste("The prior of {.val {name}} goes from {.val {prior$lower}} to",
                        "{.val {prior$upper}}, beyond the limits of the FMU, {.val {row$min}} to",
                        "{.val {row$max}}."),
                  i = "Cut it off: every prior takes {.arg lower} and {.arg upper}."), call = call)
  }
}

check_fmu_value <- function(name, value, v, call) {
  row <- check_fmu_name(name, v, "fixed", "fixed", call)
  kind <- if (row$type == "String") "text" else if (row$type == "Boolean") "TRUE or FALSE"
          else if (row$type %in% c("Real", "Float64", "Float32")) "a number" else "a whole number"
  fits <- switch(kind, text = checkmate::test_string(value),
                 `TRUE or FALSE` = checkmate::test_flag(value),
                 `a number` = checkmate::test_number(value, finite = TRUE),
                 checkmate::test_number(value, finite = TRUE) && value == round(value))
  if (!fits) {
    abort_input(paste("{.arg {paste0('fixed$', name)}} = {seen(value)} cannot be used: the FMU",
                      "needs {kind}."), call = call)
  }
  if (is.numeric(value) && (isTRUE(value < row$min) || isTRUE(value > row$max))) {
    abort_input(paste("{.arg {paste0('fixed$', name)}} = {seen(value)} is beyond the limits of the",
                      "FMU, {.val {row$min}} to {.val {row$max}}."), call = call)
  }
}

# ---- methods

#' @export
print.amiss_fmu_simulator <- function(x, ...) on_stdout(x, {
  fmu <- tryCatch(read_fmu(x$file), amiss_error_input = function(e) NULL)
  v <- fmu$variables
  unit <- function(name) pretty_unit(or_empty(v$unit[match(name, v$name)] %||% ""))
  version <- if (is.null(fmu)) "whose file is not there now" else paste0("FMI ", fmu$version, ".0")
  cli::cli_text(paste("{.strong Simulator} {.val {x$name}} (the FMU {.file {basename(x$file)}},",
                      "{version}) with {length(x$parameters)} free parameter{?s}"))
  say_bullets(utils::head(vapply(x$parameters, format, ""), 6))
  if (length(x$parameters) > 6) say_bullets(paste("and", length(x$parameters) - 6, "more"))
  if (length(x$fixed)) {
    values <- vapply(x$fixed, function(value) paste(value), "")
    say_bullets(
      some_words("fixed:", paste(names(x$fixed), "=", with_unit(values, unit(names(x$fixed))))))
  }
  if (length(x$inputs)) {
    other <- names(x$inputs) != x$inputs
    say_bullets(some_words("inputs:",
                           paste0(x$inputs, ifelse(other, paste0(" from ", names(x$inputs)), ""))))
  }
  idle <- idle_inputs(x, v)
  if (nrow(idle)) {
    values <- with_unit(or_empty(idle$start), pretty_unit(idle$unit))
    say_bullets(
      some_words("inputs that keep their start value:", paste0(idle$name, " (", values, ")")), "!")
  }
  steps <- if (x$steps_per_row > 1) paste0(", ", x$steps_per_row, " steps in each")
  say_bullets(paste0("output: ", with_unit(x$output, unit(x$output)), ", ",
                     if (x$averaged) "mean over each row" else "value at the end of each row",
                     steps))
  cli::cli_bullets(c(">" = "next: {.fun simulate_design} or {.fun upgrade_model}"))
})

some_words <- function(what, words, most = 6) {
  more <- if (length(words) > most) paste0(" and ", length(words) - most, " more")
  paste0(what, " ", paste(utils::head(words, most), collapse = ", "), more)
}

# Rows of the inputs that keep their start value.
idle_inputs <- function(simulator, v) {
  if (is.null(v)) return(data.frame())
  v[has_use(v, "input") & !v$name %in% c(simulator$inputs, names(simulator$fixed)), ]
}

#' @export
free_parameters.amiss_fmu_simulator <- function(simulator) simulator$parameters

#' @export
driver_names.amiss_fmu_simulator <- function(simulator) unique(names(simulator$inputs))

#' @export
simulate_runs.amiss_fmu_simulator <- function(simulator, values, drivers, step_h, hold = NULL,
                                              threads = 1L,
                                              time = step_h * seq_len(nrow(drivers)), ...) {
  check_run_dots(...)
  check_row_times(time, nrow(drivers))
  fmu <- current_fmu(simulator)
  check_fmu_steps(simulator, fmu, step_h)
  platform <- fmu_platform(fmu)
  request <- fmu_request(simulator, fmu, drivers, step_h, time)
  made <- future.apply::future_lapply(seq_len(nrow(values)), function(m) {
    run <- fmu_run(simulator, fmu, platform, request, values[m, ])
    piece_done()
    run
  }, future.packages = "amiss", future.seed = NULL)
  tell_failed(simulator, made)
  if (any(vapply(made, function(run) isFALSE(run$kept), NA))) tell_unkept(simulator$cache)
  matrix(unlist(lapply(made, function(run) run$value %||% rep(NaN, nrow(drivers)))), nrow(drivers))
}

# The description of the FMU, if it is the one that was declared.
current_fmu <- function(simulator, call = rlang::caller_env()) {
  fmu <- read_fmu(simulator$file, call)
  if (fmu$hash == simulator$hash) return(fmu)
  refuse_fmu(simulator$file, "It has changed since the simulator was made of it.", call,
             "Make the simulator again with {.fun fmu_simulator}.")
}

# Some FMUs have steps of their own, which communication steps must be multiples of.
check_fmu_steps <- function(simulator, fmu, step_h, call = rlang::caller_env()) {
  own <- fmu$fixed_step
  step <- 3600 * step_h / simulator$steps_per_row
  times <- step / own
  if (is.na(own) || own <= 0 || abs(times - round(times)) < 1e-6 && times > 0.5) return(invisible())
  abort_input(c(paste("The communication step, {signif(step, 4)} s, is no multiple of the FMU's",
                      "own step, {signif(own, 4)} s."),
                i = paste("Change {.arg steps_per_row}; it is {simulator$steps_per_row} for rows",
                          "of {signif(step_h, 4)} h.")), call = call)
}
