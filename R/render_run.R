#' One run's directory, to look at
#'
#' Writes what a run of a [program_simulator()] would read into a folder, and runs nothing. The
#' folder has the files of the model, the templates with their numbers, and the drivers if
#' measurements are given. Start the commands there by hand until they do what they should.
#'
#' @param simulator A [program_simulator()].
#' @param values Named numeric vector of the parameters; by default the medians of their priors.
#' @param folder Folder to make; it must not hold anything.
#' @param measurements [measurements()] whose drivers are written.
#' @param segment Number of the segment of the record.
#' @return The commands as text, invisibly.
#' @examples
#' rule <- c("BEGIN { FS = \",\"; print \"Ti\" }", "NR > 1 { print 20 + {{gain}} * $3 }")
#' linear <- program_simulator(c("awk", "-f", "model.awk"), free("gain", uniform(0, 2)),
#'                             output = c(file = "stdout.txt", column = "Ti"),
#'                             templates = list(model.awk = I(rule)), cache = tempfile("runs"))
#' folder <- tempfile("look-")
#' render_run(linear, c(gain = 0.5), folder)
#' readLines(file.path(folder, "model.awk"))
#' @export
render_run <- function(simulator, values = NULL, folder, measurements = NULL, segment = 1) {
  check_arguments()
  check_object(simulator, "amiss_program_simulator", "simulator",
               "Make one with {.fun program_simulator}.")
  check_input(checkmate::check_string(folder, min.chars = 1), "folder")
  if (length(dir(folder, all.files = TRUE, no.. = TRUE))) {
    abort_input(c("{.arg folder} = {.file {folder}} is not empty.", i = "Give a new folder."))
  }
  check_folder_possible(folder, "folder")
  values <- run_values(simulator, values)
  if (is.null(measurements) && !identical(segment, 1)) {
    abort_input("{.arg segment} = {seen(segment)} needs {.arg measurements}, whose segment it is.")
  }
  given <- if (is.null(measurements)) no_drivers() else drivers_of(simulator, measurements, segment)
  if (is.null(measurements)) simulator$drivers <- list()
  plan <- plan_runs(simulator, values, given$drivers, given$step_h, given$time)
  make_folder(plan, plan$jobs[[1]], folder)
  commands <- Map(function(step, words) {
    step$command <- words
    paste0(step_words_of(step), if (is.list(step$input)) paste(" <", step$input$file),
           if (!is.null(step$folder)) paste0("   (in ", step$folder, ")"))
  }, plan$steps, plan$jobs[[1]]$commands)
  cli::cli_inform(c("{.file {folder}} holds what a run reads. Start there:",
                    stats::setNames(as_said(unlist(commands)), rep("*", length(commands)))),
                  class = "amiss_message_render")
  invisible(unlist(commands))
}

run_values <- function(simulator, values, call = rlang::caller_env()) {
  parameters <- simulator$parameters
  if (is.null(values))
    values <- vapply(parameters, function(parameter) prior_quantile(parameter$prior, 0.5), 0)
  check_input(checkmate::check_numeric(values, any.missing = FALSE, finite = TRUE), "values",
              call = call)
  if (!setequal(names(values), names(parameters)) || anyDuplicated(names(values))) {
    abort_input(c("{.arg values} has the names {.val {names(values)}}.",
                  i = "Give a value for each parameter: {.val {names(parameters)}}."), call = call)
  }
  matrix(values, 1, dimnames = list(NULL, names(values)))
}

no_drivers <- function() list(drivers = matrix(0, 1, 0), step_h = 1, time = 1)

drivers_of <- function(simulator, measurements, segment, call = rlang::caller_env()) {
  check_object(measurements, "amiss_measurements", "measurements", call = call)
  raw <- measurements$raw
  check_input(checkmate::check_choice(segment, unique(raw$segment)), "segment",
              "Segments of the record are numbered from 1.", call = call)
  check_driver_columns(simulator, measurements, call)
  given <- segment_drivers(simulator, raw, which(raw$segment == segment), driver_names(simulator))
  c(given[c("drivers", "time")], step_h = raw$step_h)
}
