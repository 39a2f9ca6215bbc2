#' A simulator that is an R function
#'
#' Makes a simulator of a function of parameters and boundary conditions, so that it can be
#' calibrated. The built-in [zone()] is another simulator; runs that were made elsewhere enter by
#' [ensemble()].
#'
#' `with_parameters()` extends such a simulator by the parameters of a mechanism.
#'
#' # Edits that stack
#'
#' The function given to `with_parameters()` has the simulator before the edit as `base`, so edits
#' stack in any order. Make every [mechanism()] of a function in this way. An edit that writes the
#' model anew would lose what was adopted before it.
#'
#' # Random numbers
#'
#' Every run draws the same random numbers of R, so that runs differ by their parameters alone. A
#' result therefore stands for one random course; to see others, let `f` set a seed of its own.
#'
#' # Steps
#'
#' A simulator that integrates in steps should take their length from `info$step_h`.
#' [upgrade_model()] then runs it with rows a half and a quarter as long. A mechanism is not named
#'
#' * if the simulator's own steps err by a third or more of what the mechanism mends, or
#' * if finer steps would take a third or more of that back.
#'
#' Parameters that finer steps would move are reported.
#'
#' Two kinds of simulator cannot be tested so: one with steps of its own, and one whose output does
#' not settle as rows get shorter. Check yourself that half the step changes its output by little
#' compared with the noise.
#'
#' @param f Function of `values` (named numeric vector) and `drivers`, returning one number per row
#'   of `drivers`. `drivers` is a numeric matrix with the columns of `boundary`, one row per
#'   interval of one unbroken segment. `f` may have further arguments:
#'
#'   * `info`: a list of `step_h` (length of an interval in hours), `time` (of each row: `POSIXct`,
#'     or hours), `segment` (its number) and `hold` (the target as measured in the rows that warm
#'     up, `NA` in the others).
#'   * `base` (`with_parameters()` only): the simulator before the edit, as a function of `values`
#'     and, if they are to differ, `drivers` and `info`. To change what that simulator does not read
#'     is an error.
#'
#'   `NULL` (`with_parameters()` only) leaves the function as it is. The parameters are then for the
#'   first function, which uses them if it is given them.
#' @param ... The parameters, each made by [free()]. Those of `model` stay.
#' @param boundary Names of the driver columns that the function needs; in `with_parameters()` those
#'   needed besides the columns of `model`.
#' @param name A name for people.
#' @return An object of class `amiss_function_simulator`.
#' @examples
#' linear <- function_simulator(function(values, drivers) values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 2)), boundary = "Te")
#'
#' # Starts where the measurements stand, and forgets that at a rate per hour.
#' decay <- function_simulator(function(values, drivers, info) {
#'   start <- if (is.na(info$hold[1])) drivers[1, "Te"] else info$hold[1]
#'   kept <- exp(-values[["rate"]] * info$step_h * seq_len(nrow(drivers)))
#'   drivers[, "Te"] + kept * (start - drivers[1, "Te"])
#' }, free("rate", uniform(0.01, 1), "1/h"), boundary = "Te")
#'
#' # Mechanisms that stack.
#' sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
#'   with_parameters(model, free("sun", uniform(0, 0.1)), boundary = "Gv",
#'                   f = function(values, drivers, base) {
#'     base(values) + values[["sun"]] * drivers[, "Gv"]
#'   })
#' })
#' drift <- mechanism("drift", boundary = character(), sentence = "The sensor drifts.",
#'                    edit = function(model) {
#'   with_parameters(model, free("drift", normal(0, 0.1), "K/d"),
#'                   f = function(values, drivers, info, base) {
#'     base(values) + values[["drift"]] * info$step_h * seq_len(nrow(drivers)) / 24
#'   })
#' })
#' drift$edit(sun$edit(linear))
#' @export
function_simulator <- function(f, ..., boundary = character(), name = "simulator") {
  check_arguments()
  check_run_function(f, "info")
  parameters <- named_parameters(list(...))
  check_columns_named(boundary)
  check_input(checkmate::check_string(name), "name")
  structure(list(format_version = format_version, name = name, f = f, parameters = parameters,
                 boundary = unique(boundary)),
            class = "amiss_function_simulator")
}

#' @rdname function_simulator
#' @param model The simulator to extend, made by `function_simulator()`.
#' @export
with_parameters <- function(model, ..., f = NULL, boundary = character(), name = model$name) {
  check_arguments()
  check_object(model, "amiss_function_simulator", "model", "A {.fn zone} has edits of its own.")
  if (!is.null(f)) check_run_function(f, c("info", "base"))
  added <- named_parameters(list(...))
  check_columns_named(boundary)
  check_input(checkmate::check_string(name), "name")
  for (parameter in added[names(added) %in% names(model$parameters)]) {
    if (identical(parameter$prior, model$parameters[[parameter$name]]$prior)) next
    abort_input(c("Parameter {.val {parameter$name}} is in the model already, with another prior.",
                  i = paste("Give the new one a name of its own; to share one, give both the same",
                            "prior.")))
  }
  edited <- model
  edited$name <- name
  edited$parameters[names(added)] <- added
  edited$boundary <- union(model$boundary, boundary)
  if (!is.null(f)) return(on_top_of(edited, f, model))
  # Parameters without a function are for the one that was there first.
  if (is.null(model$base)) edited
  else on_top_of(edited, model$edit, with_parameters(model$base, ..., boundary = boundary))
}

# The simulator whose function is `f` on top of that of `base`. Both stay in sight, for keys of kept
# results.
on_top_of <- function(edited, f, base) {
  edited$f <- function(values, drivers, info = NULL) {
    call_run_function(f, values, drivers, info = info, base = as_base(base, drivers, info))
  }
  edited$edit <- f
  edited$base <- base
  edited
}

# A simulator as a function of its parameters; what is not given is that of the call it is used in.
as_base <- function(model, its_drivers, its_info) {
  function(values, drivers = its_drivers, info = its_info) {
    if (!missing(drivers)) check_drivers_read(model, drivers, its_drivers)
    call_run_function(model$f, values[names(model$parameters)],
                      drivers[, model$boundary, drop = FALSE], info = info)
  }
}

# What an edit changes of the drivers must be read by the simulator that it gives them to.
check_drivers_read <- function(model, drivers, its_drivers) {
  check_named_columns(drivers, "drivers", model$boundary)
  beyond <- setdiff(colnames(drivers), model$boundary)
  as_it_was <- function(name)
    name %in% colnames(its_drivers) && identical(drivers[, name], its_drivers[, name])
  changed <- beyond[!vapply(beyond, as_it_was, NA)]
  if (length(changed)) {
    abort_input(c(paste("{.code base()} was given a {.val {changed}} of its own, which",
                        "{.val {model$name}} does not read: it would change nothing."),
                  i = if (length(model$boundary)) "It reads {.val {model$boundary}}."
                      else "It reads no drivers.",
                  i = "What it does not read must act in {.arg f} itself."), call = NULL)
  }
}

# `f` with those of the further arguments that it has.
call_run_function <- function(f, values, drivers, ...) {
  further <- list(...)
  known <- names(formals(args(f)))
  if (!"..." %in% known) further <- further[names(further) %in% known]
  do.call(f, c(list(values, drivers), further), quote = TRUE)
}

# A function of two arguments, and of those of `offered` that it names; any other must have a
# default.
check_run_function <- function(f, offered, call = rlang::caller_env()) {
  check_input(checkmate::check_function(f), "f", call = call)
  arguments <- names(formals(args(f)))
  needed <- arguments[vapply(formals(args(f)), rlang::is_missing, NA)]
  unknown <- setdiff(needed, c(arguments[1:2], offered, "..."))
  if (length(arguments) < 2 || any(arguments[1:2] %in% offered)) {
    abort_input(c(
      "{.arg f} has the argument{?s} {.arg {arguments}}; its first two must be values and drivers.",
      i = "Write {.code function(values, drivers) ...}; it may have {.arg {offered}} too."),
                call = call)
  }
  if (length(unknown)) {
    abort_input(c(paste("{.arg f} has {cli::qty(unknown)}argument{?s} {.arg {unknown}} that",
                        "nothing is known to give to."),
                  i = paste("Beside values and drivers it may have {.arg {offered}}; others need a",
                            "default.")), call = call)
  }
}

# Names of driver columns.
check_columns_named <- function(boundary, call = rlang::caller_env()) {
  check_input(checkmate::check_character(boundary, min.chars = 1, any.missing = FALSE), "boundary",
              "Give the names of columns of the drivers.", call = call)
}

# Parameters made by free(), under their names.
named_parameters <- function(parameters, call = rlang::caller_env()) {
  other <- Filter(function(x) !inherits(x, "amiss_free"), parameters)
  for (one in parameters) if (inherits(one, "amiss_free")) check_whole(one, "...", call = call)
  if (!length(parameters) || length(other)) {
    abort_input(c(paste("Every parameter must be made by {.fun free}; got",
                        "{if (length(other)) seen(other[[1]]) else 'none'}."),
                  i = "For example {.code free(\"gain\", uniform(0, 2))}."), call = call)
  }
  names(parameters) <- vapply(parameters, `[[`, "", "name")
  twice <- unique(names(parameters)[duplicated(names(parameters))])
  if (length(twice)) abort_input("Parameter {.val {twice}} is declared twice.", call = call)
  parameters
}

#' @export
print.amiss_function_simulator <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong Simulator} {.val {x$name}} (an R function) with",
                      "{length(x$parameters)} free parameter{?s}"))
  say_bullets(vapply(utils::head(x$parameters, 10), format, ""))
  cli::cli_bullets(c("*" = if (length(x$boundary)) "driven by {.field {x$boundary}}",
                     ">" = "next: {.fun simulate_design} or {.fun upgrade_model}"))
})

#' What a simulator needs and does
#'
#' Methods of these make any simulator known to the package.
#'
#' @param simulator A simulator.
#' @param values Matrix of parameter values, one run a row, named columns.
#' @param drivers Numeric matrix with named columns: one row per interval of one unbroken segment.
#' @param step_h Length of an interval in hours.
#' @param hold Values at which the target is held during warm-up, `NA` if it is free; a simulator
#'   that cannot be held ignores it.
#' @param threads Number of threads.
#' @param ... What a method may use or ignore: `time` of each row (`POSIXct`, or hours) and the
#'   number of the `segment`. Every method must have it.
#' @return `free_parameters()`: named list of [free()]; `driver_names()`: names of the columns that
#'   it needs; `simulate_runs()`: matrix with one row per interval and one column per run, `NaN`
#'   columns of failed runs.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' free_parameters(linear)
#' driver_names(linear)
#' simulate_runs(linear, cbind(gain = c(0.2, 0.4)), cbind(Te = c(4, 6, 5)), step_h = 1)
#' @keywords internal
#' @export
free_parameters <- function(simulator) {
  check_arguments()
  if (inherits(simulator, "amiss_ensemble")) check_whole(simulator, "simulator")
  else check_simulator(simulator)
  UseMethod("free_parameters")
}

#' @rdname free_parameters
#' @export
driver_names <- function(simulator) {
  check_simulator(simulator)
  UseMethod("driver_names")
}

#' @rdname free_parameters
#' @export
simulate_runs <- function(simulator, values, drivers, step_h, hold = NULL, threads = 1L, ...) {
  check_run_request(simulator, values, drivers, step_h, hold, threads)
  UseMethod("simulate_runs")
}

# The same generics for simulators that have been checked: a run need not check its simulator
# thrice.
parameters_of <- function(simulator) UseMethod("free_parameters")

named_drivers <- function(simulator) UseMethod("driver_names")

check_run_request <- function(simulator, values, drivers, step_h, hold, threads,
                              call = rlang::caller_env()) {
  check_simulator(simulator, call)
  check_named_columns(values, "values", names(parameters_of(simulator)), call)
  check_named_columns(drivers, "drivers", named_drivers(simulator), call)
  check_input(checkmate::check_number(step_h, lower = 1e-9, finite = TRUE), "step_h", call = call)
  check_input(checkmate::check_numeric(hold, null.ok = TRUE), "hold", call = call)
  if (!length(hold) %in% c(0, nrow(drivers))) {
    abort_input(paste("{.arg hold} has {length(hold)} value{?s}; one for each of the",
                      "{nrow(drivers)} row{?s} of the drivers is needed."), call = call)
  }
  check_threads(threads, call)
}

# A matrix of numbers with these columns among its own.
check_named_columns <- function(x, name, needed, call = rlang::caller_env()) {
  check_input(checkmate::check_matrix(x, if (NCOL(x) > 0) "numeric", min.rows = 1), name,
              call = call)
  absent <- setdiff(needed, colnames(x))
  if (length(absent)) {
    abort_input(c("{.arg {name}} has no column {.val {absent}}.",
                  i = "Columns there: {.val {colnames(x)}}."), call = call)
  }
  twice <- colnames(x)[duplicated(colnames(x))]
  if (length(twice))
    abort_input("{.arg {name}} has the column {.val {twice[1]}} twice.", call = call)
}

# Beside what the method knows, only what every simulator is given.
check_run_dots <- function(..., call = rlang::caller_env()) {
  unknown <- setdiff(rlang::names2(list(...)), c("time", "segment"))
  if (length(unknown))
    abort_input("{.fun simulate_runs} has no argument {.arg {unknown}}.", call = call)
}

# One time for each row.
check_row_times <- function(time, rows, call = rlang::caller_env()) {
  if (length(time) != rows) {
    abort_input(paste("{.arg time} has {length(time)} value{?s}; one for each of the {rows}",
                      "row{?s} of the drivers is needed."), call = call)
  }
}

#' @export
free_parameters.default <- function(simulator) check_simulator(simulator)

#' @export
driver_names.default <- function(simulator) check_simulator(simulator)

#' @export
free_parameters.amiss_function_simulator <- function(simulator) simulator$parameters

#' @export
driver_names.amiss_function_simulator <- function(simulator) simulator$boundary

# Common random numbers: what differs between two runs is what their parameters do.
run_seed <- 1L

#' @export
simulate_runs.amiss_function_simulator <- function(simulator, values, drivers, step_h, hold = NULL,
                                                   threads = 1L,
                                                   time = step_h * seq_len(nrow(drivers)),
                                                   segment = 1L, ...) {
  check_run_dots(...)
  check_row_times(time, nrow(drivers))
  info <- list(step_h = step_h, time = time, segment = segment,
               hold = hold %||% rep(NA_real_, nrow(drivers)))
  runs <- matrix(NaN, nrow(drivers), nrow(values))
  stopped <- list()
  for (m in seq_len(nrow(values))) {
    point <- stats::setNames(values[m, ], colnames(values))
    out <- tryCatch(
      with_seed(run_seed, call_run_function(simulator$f, point, drivers, info = info)),
      error = function(e) e)
    piece_done()
    if (inherits(out, "amiss_error_input")) rlang::cnd_signal(out)
    if (inherits(out, "error")) {
      stopped[[as.character(m)]] <- conditionMessage(out)
      next
    }
    out <- if (is.logical(out) && all(is.na(out))) as.numeric(out) else plain_numbers(out)
    check_run(out, nrow(drivers), simulator, point, m)
    runs[, m] <- out
  }
  if (length(stopped)) {
    first <- as.integer(names(stopped)[1])
    warn_input(c(paste("{length(stopped)} of {nrow(values)} run{?s} of {.val {simulator$name}}",
                       "stopped with an error."),
                 x = "Run {first} at {point_words(values[first, , drop = FALSE])}: {stopped[[1]]}",
                 i = subscript_hint(stopped[[1]]),
                 i = paste("It was given the parameters {.field {colnames(values)}} and the",
                           "columns {.field {colnames(drivers)}}.")))
  }
  runs
}

# What to write where R says that something is not there, or not to be had in this way.
subscript_hint <- function(message) {
  if (grepl("subscript out of bounds", message, fixed = TRUE))
    paste("A column of the drivers is there only if {.arg boundary} names it, a parameter only if",
          "{.fun free} declares it.")
  else if (grepl("$ operator", message, fixed = TRUE))
    paste("Values are a vector and drivers a matrix: write {.code values[[\"k\"]]} and",
          "{.code drivers[, \"Te\"]}.")
}

check_run <- function(out, rows, simulator, point, m, call = rlang::caller_env()) {
  if (is.numeric(out) && length(out) == rows) return(invisible())
  seen <- trimws(utils::capture.output(utils::str(out, give.attr = FALSE)))[1]
  abort_input(c(paste("Run {m} of {.val {simulator$name}} returned {length(out)} value{?s} of",
                      "class {.cls {class(out)}}; {rows} numbers were expected, one for each row",
                      "of the drivers."),
                x = "At {point_words(point)} it returned: {seen}",
                i = "Let the simulator return its output at every row."), call = call)
}

check_simulator <- function(simulator, call = rlang::caller_env()) {
  present(simulator, call, "simulator", argument_code("simulator", call))
  if (was_checked(simulator, "simulator")) return(invisible(TRUE))
  known <- function(class) !is.null(utils::getS3method("simulate_runs", class, optional = TRUE))
  if (!any(vapply(class(simulator), known, NA))) {
    abort_input(c("{.arg simulator} is of class {.cls {class(simulator)}}, which is no simulator.",
                  i = paste("Make one with {.fun zone} or {.fun function_simulator}, or give runs",
                            "with {.fun ensemble}.")), call = call)
  }
  check_whole(simulator, "simulator", call = call)
  note_checked(simulator, "simulator")
}
