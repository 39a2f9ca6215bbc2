# A simulator whose parameters go by other names, so that several records need not share them.

#' Give parameters of a simulator other names
#'
#' Renames parameters, so that records that are calibrated together ([calibrate_jointly()]) do not
#' share them. Parameters of the same name are shared. If two houses have the same walls and each
#' its own doors, rename the doors' parameter in one of them.
#'
#' @param simulator Any simulator.
#' @param ... New names by the old ones: `door = "door of O5"`.
#' @return An object of class `amiss_renamed`: a simulator that differs only in the names. The
#'   `edit` of a [mechanism()] gets the simulator with its own names.
#' @section Errors: `amiss_error_input` if the simulator does not have the parameter, or already
#'   has one of the new name.
#' @examples
#' linear <- function_simulator(function(values, drivers) values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 2)), boundary = "Te")
#' rename_parameters(linear, gain = "gain of O5")
#' @export
rename_parameters <- function(simulator, ...) {
  check_arguments()
  check_simulator(simulator)
  to <- list(...)
  check_input(checkmate::check_list(to, names = "unique", min.len = 1), "...",
              "Give new names by the old ones.")
  for (name in names(to)) {
    check_input(checkmate::check_string(to[[name]], min.chars = 1), name,
                "Give the new name of this parameter.")
  }
  to <- unlist(to)
  parameters <- free_parameters(simulator)
  unknown <- setdiff(names(to), names(parameters))
  if (length(unknown)) {
    abort_input(c("The simulator has no parameter {.val {unknown}}.",
                  i = "Its parameters: {.val {names(parameters)}}."))
  }
  twice <- c(to[to %in% setdiff(names(parameters), names(to))], to[duplicated(to)])
  if (length(twice)) abort_input("There would be two parameters {.val {unname(twice[1])}}.")
  structure(list(name = if (is.character(simulator$name)) simulator$name else "simulator",
                 simulator = simulator, to = to), class = "amiss_renamed")
}

#' @export
print.amiss_renamed <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong Simulator} with parameters that go by other names:")
  say_bullets(paste(names(x$to), "is", x$to))
  cli::cli_bullets(c(">" = "next: {.fun simulate_jointly}"))
})

#' @export
free_parameters.amiss_renamed <- function(simulator) {
  parameters <- parameters_of(simulator$simulator)
  at <- match(names(simulator$to), names(parameters))
  names(parameters)[at] <- simulator$to
  for (name in simulator$to) {
    parameter <- parameters[[name]]
    # it had none of its own
    if (identical(parameter$label, parameter$name)) parameter$label <- name
    parameter$name <- name
    parameters[[name]] <- parameter
  }
  parameters
}

# What an edit makes of a simulator: of one whose parameters go by other names, the simulator itself
# is edited, which is what the edit knows, and those that it keeps go by the other names again.
edited <- function(simulator, edit, call = rlang::caller_env()) {
  if (class(simulator)[1] != "amiss_renamed") return(edit(simulator))
  inside <- edited(simulator$simulator, edit, call)
  check_simulator(inside, call)
  names <- names(free_parameters(inside))
  to <- simulator$to[names(simulator$to) %in% names]
  twice <- intersect(to, setdiff(names, names(to)))
  if (length(twice)) abort_input("There would be two parameters {.val {twice[1]}}.", call = call)
  simulator[c("simulator", "to")] <- list(inside, to)
  simulator
}

#' @export
driver_names.amiss_renamed <- function(simulator) named_drivers(simulator$simulator)

#' @export
simulate_runs.amiss_renamed <- function(simulator, values, drivers, step_h, hold = NULL,
                                        threads = 1L, ...) {
  at <- match(simulator$to, colnames(values))
  colnames(values)[at] <- names(simulator$to)
  simulate_runs(simulator$simulator, values, drivers, step_h, hold, threads, ...)
}

#' @export
slopes.amiss_renamed <- function(simulator, values, drivers, step_h, hold = NULL, ...) {
  at <- match(simulator$to, colnames(values))
  colnames(values)[at] <- names(simulator$to)
  out <- slopes(simulator$simulator, values, drivers, step_h, hold, ...)
  if (is.null(out)) return(NULL)
  colnames(out)[match(names(simulator$to), colnames(out))] <- simulator$to
  out
}
