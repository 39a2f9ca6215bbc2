#' A simulator that is an R function
#'
#' Any function of parameters and boundary conditions can be calibrated. The built-in [zone()] is another simulator;
#' runs that were made elsewhere enter by [ensemble()].
#'
#' @param f Function of `values` (named numeric vector) and `drivers` (numeric matrix with named columns, one row
#'   per interval of one unbroken segment), returning one number per row.
#' @param ... The parameters, each made by [free()].
#' @param boundary Names of the driver columns that the function needs.
#' @param name A name for people.
#' @return An object of class `amiss_function_simulator`.
#' @examples
#' linear <- function_simulator(function(values, drivers) values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 2)), boundary = "Te")
#' @export
function_simulator <- function(f, ..., boundary = character(), name = "simulator") {
  check_input(checkmate::check_function(f, nargs = 2), "f")
  parameters <- list(...)
  if (!length(parameters) || !all(vapply(parameters, inherits, TRUE, "amiss_free"))) {
    abort_input(c("Every parameter must be made by {.fun free}; got {length(parameters)} argument{?s}.",
                  i = "For example {.code free(\"gain\", uniform(0, 2))}."))
  }
  names(parameters) <- vapply(parameters, `[[`, "", "name")
  if (anyDuplicated(names(parameters))) abort_input("Parameter {.val {names(parameters)[anyDuplicated(names(parameters))]}} is declared twice.")
  structure(list(format_version = format_version, name = name, f = f, parameters = parameters, boundary = boundary),
            class = "amiss_function_simulator")
}

#' @export
print.amiss_function_simulator <- function(x, ...) {
  cli::cli_text("{.strong Simulator} {.val {x$name}} (an R function) with {length(x$parameters)} free parameter{?s}")
  cli::cli_bullets(stats::setNames(vapply(x$parameters, format, ""), rep("*", length(x$parameters))))
  invisible(x)
}

#' What a simulator needs and does
#'
#' Methods of these make any simulator known to the package.
#'
#' @param simulator A simulator.
#' @param values Matrix of parameter values, one run a row, named columns.
#' @param drivers Numeric matrix with named columns: one row per interval of one unbroken segment.
#' @param step_h Length of an interval in hours.
#' @param hold Values at which the target is held during warm-up, `NA` where it is free; a simulator that cannot be
#'   held ignores it.
#' @param threads Number of threads.
#' @return `free_parameters()`: named list of [free()]; `driver_names()`: names of the columns that it needs;
#'   `simulate_runs()`: matrix with one row per interval and one column per run, `NaN` columns where a run failed.
#' @keywords internal
#' @export
free_parameters <- function(simulator) UseMethod("free_parameters")

#' @rdname free_parameters
#' @export
driver_names <- function(simulator) UseMethod("driver_names")

#' @rdname free_parameters
#' @export
simulate_runs <- function(simulator, values, drivers, step_h, hold = NULL, threads = 1L) UseMethod("simulate_runs")

#' @export
free_parameters.amiss_function_simulator <- function(simulator) simulator$parameters

#' @export
driver_names.amiss_function_simulator <- function(simulator) simulator$boundary

#' @export
simulate_runs.amiss_function_simulator <- function(simulator, values, drivers, step_h, hold = NULL, threads = 1L) {
  runs <- matrix(NaN, nrow(drivers), nrow(values))
  for (m in seq_len(nrow(values))) {
    out <- tryCatch(simulator$f(values[m, ], drivers), error = function(e) e)
    if (inherits(out, "error")) {
      warn_input("Run {m} of {.val {simulator$name}} stopped with an error: {conditionMessage(out)}")
      next
    }
    if (!is.numeric(out) || length(out) != nrow(drivers)) {
      abort_input(c("Run {m} of {.val {simulator$name}} returned {length(out)} value{?s} of class {.cls {class(out)}}; {nrow(drivers)} numbers were expected, one for each row of the drivers.",
                    i = "Let the simulator return its output at every row."))
    }
    runs[, m] <- out
  }
  runs
}

#' @export
free_parameters.amiss_zone <- function(simulator) zone_parameters(simulator)

#' @export
driver_names.amiss_zone <- function(simulator) zone_boundary(simulator)

#' @export
simulate_runs.amiss_zone <- function(simulator, values, drivers, step_h, hold = NULL, threads = 1L) {
  simulate_zone(simulator, values, drivers, step_s = 3600 * step_h, hold = hold, threads = threads)
}

check_simulator <- function(simulator, call = rlang::caller_env()) {
  known <- any(paste0("simulate_runs.", class(simulator)) %in% utils::methods("simulate_runs"))
  if (!known) {
    abort_input(c("{.arg simulator} is of class {.cls {class(simulator)}}, which is no simulator.",
                  i = "Make one with {.fun zone} or {.fun function_simulator}, or give runs with {.fun ensemble}."), call = call)
  }
}

# Runs over the segments that hold rows of the wanted uses, averaged like the measurements: one row for each used row.
simulate_measured <- function(simulator, values, measurements, uses, threads, call = rlang::caller_env()) {
  raw <- measurements$raw
  needed <- driver_names(simulator)
  absent <- setdiff(needed, colnames(raw$drivers))
  if (length(absent)) {
    abort_input(c("The simulator needs {cli::qty(absent)}column{?s} {.val {absent}}, which the measurements do not have.",
                  i = "Columns there: {.val {colnames(raw$drivers)}}."), call = call)
  }
  rows <- which(measurements$use %in% uses & !is.na(measurements$y))
  out <- matrix(NaN, length(measurements$y), nrow(values))
  wanted <- which(measurements$block %in% rows)
  for (segment in unique(measurements$segment[rows])) {
    own <- which(raw$segment == segment)
    own <- own[own <= max(intersect(own, wanted))]  # what comes later changes nothing
    for (column in needed) {
      bad <- own[!is.finite(raw$drivers[own, column])]
      if (length(bad)) {
        abort_input(c("Driver {.val {column}} has {length(bad)} missing value{?s}; the first is in row {bad[1]} ({format(raw$time[bad[1]])}).",
                      i = "A simulator needs every value of what drives it: fill the gap, or remove these rows as a whole."), call = call)
      }
    }
    hold <- ifelse(raw$use[own] == "warmup", raw$y[own], NA_real_)
    drivers <- raw$drivers[own, needed, drop = FALSE]
    if (inherits(simulator, "amiss_program_simulator")) drivers <- structure(drivers, hours = raw$hours[own], calendar = !is.numeric(raw$time))
    fine <- simulate_runs(simulator, values, drivers, raw$step_h, hold, threads)
    block <- measurements$block[own]
    whole <- !is.na(block)
    averaged <- rowsum(fine[whole, , drop = FALSE], block[whole], reorder = TRUE) / measurements$per_step
    out[as.integer(rownames(averaged)), ] <- averaged
  }
  out[rows, , drop = FALSE]
}
