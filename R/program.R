#' A simulator that is an external program
#'
#' Makes a simulator of any program that reads text files and writes numbers: ESP-r, EnergyPlus, a
#' Modelica model, a script. Each run gets a fresh directory with the files of the model, the
#' rendered `templates` and the drivers. The program is started there, without a shell, and its
#' output is read. `vignette("programs", "amiss")` has recipes for ESP-r, EnergyPlus and
#' hydrological programs.
#'
#' # Placeholders
#'
#' `{{name}}` stands for the value of a parameter. Placeholders may be in templates, in the
#' arguments of the command and in the inputs of its steps. `{{2 * k + C / 1000}}` is arithmetic of
#' parameters: `+ - * / ^`, parentheses, `sqrt`, `exp`, `log`, `log10`, `abs`, `round`, `min` and
#' `max`. Nothing else is evaluated.
#'
#' A number is written with 15 significant digits at most, and no more than it needs. A program that
#' reads columns of a fixed width, or cuts words, needs a limit:
#'
#' * `{{k:12}}` takes 12 characters at most.
#' * `{{k:%.4f}}` and `{{k:%10.3e}}` are formats of [sprintf()].
#' * `width` is the limit for all others.
#'
#' A number that does not fit is an error before anything is executed. A file without a placeholder
#' is copied byte for byte.
#'
#' # Output
#'
#' `c(file = "out.csv", column = "Ti")` is a CSV with one line of names and a line of numbers for
#' each row of the drivers, with a point before decimals. Exponents as Fortran writes them
#' (`1.5D-03`, `1.5-103`) are numbers, too. Anything else makes the run fail, and the warning names
#' line and value. Examples are `****`, a decimal comma, a row of units, and a line with one field
#' more or less than there are names. [program_output()] describes other tables and also matches
#' rows by time.
#'
#' # A run and its end
#'
#' A run ends with the process that was started. What the process leaves behind in the background is
#' stopped. A run is also stopped, with all its processes, if it takes longer than `time_limit`
#' (with the reading of its output) or writes more than `size_limit`. If R itself is killed, the
#' program is stopped, and the next call removes what was left of its run.
#'
#' A run that fails is `NaN`. Reasons are the exit status, a step that did not make or say what it
#' must, the time limit, unreadable output, too few rows, or values that are not finite. A warning
#' names the directory of the run, which is kept, and shows the end of what it wrote. The run is
#' tried again at the next call.
#'
#' Runs are made in parallel as [future::plan()] says.
#'
#' # Drivers
#'
#' The drivers' CSV has the columns `time` (the record's: ISO 8601 in UTC, or its hours), `hours`
#' since the start of the segment, and the columns named in `boundary`. `time` and `hours` are those
#' at the end of each interval.
#'
#' If a record has gaps, the program is started once for each unbroken segment. The run goes from
#' the segment's first row, warm-up included, to the last that is used, at the step of the data
#' (before averages). Let the program take its period and step from the drivers' file, and write one
#' row for each of its rows.
#'
#' A building or a catchment remembers the weather of days or months before the record. If the
#' record has rows without a target ahead of its first measured value, their drivers are there.
#' `lead_in` asks for more, for each segment.
#'
#' # What is kept
#'
#' A run that succeeds is kept in `cache` at once and never made twice. Its key is what it reads
#' (files, templates, command, drivers, contents of the files that the command names, `version`) and
#' how its output is read. Runs found in the cache count in a budget like others, so that a
#' continued study ends as if it had not been stopped. What was kept is checked when it is read, and
#' made again if it is not whole. What else the program reads, such as a library of its own, is not
#' part of the key: give another `version` when it changes.
#'
#' @param command The program and its arguments, as a character vector, or a list of several
#'   [program_step()], which run one after the other. Words that name an existing file become
#'   absolute paths, but for the names of files of the run.
#' @param ... The parameters, each made by [free()].
#' @param output Where the output is:
#'   * `c(file = "out.csv", column = "Ti")` of a CSV in the run's directory (`stdout.txt` for what
#'     the last program prints);
#'   * a table described by [program_output()];
#'   * a function of that directory that returns one number per row of the drivers.
#' @param templates Named list: file in the run's directory = path of its template, or its text in
#'   [I()]. A name may hold folders (`"inputs/model.txt"`), and does not lead out of the run's
#'   directory. A file of `files` may be named by its path there alone: `templates =
#'   "cfg/walls.con"`.
#' @param boundary Names of the driver columns that the program needs.
#' @param drivers Name of the drivers' CSV; [epw_weather()]; a function of `table` (a data frame of
#'   `time`, `hours` and the columns) and `folder` that writes files into the folder; or a list of
#'   several of these.
#' @param time_limit Seconds for one run.
#' @param size_limit Megabytes that one run may write. If a run fails, its files over one megabyte
#'   are kept without their middle.
#' @param retries How often a failed run is tried again at once.
#' @param cache Directory of the finished runs, and of the directories of failed ones.
#' @param version Anything that tells versions of the program apart.
#' @param name A name for people.
#' @param files The files of the model: a folder, all of which is copied into each run's directory
#'   byte for byte, or paths of files. Give the paths names if the files are to have others there.
#' @param width The most characters of a number for a placeholder that states none.
#' @param lead_in Hours of drivers ahead of the first measured value of each segment. The output has
#'   rows for them, too, which are then left out.
#' @param before How the lead-in is filled:
#'   * `"record"`: by the rows that the record has there, and otherwise by the first day of the
#'     segment, repeated, which is reported;
#'   * `"first_day"`: by that day alone;
#'   * `"record_only"`: only as far as the record goes.
#' @param keep How many directories of runs that succeeded are kept in `cache`, to look at; `TRUE`:
#'   all. See also [render_run()].
#' @return An object of class `amiss_program_simulator`.
#' @examples
#' rule <- c("BEGIN { FS = \",\"; print \"Ti\" }", "NR > 1 { print 20 + {{gain}} * $3 }")
#' linear <- program_simulator(c("awk", "-f", "model.awk", "drivers.csv"),
#'                             free("gain", uniform(0, 2)),
#'                             output = c(file = "stdout.txt", column = "Ti"),
#'                             templates = list(model.awk = I(rule)), boundary = "Te",
#'                             cache = tempfile("runs"))
#' linear
#' simulate_runs(linear, cbind(gain = c(0.5, 1)), cbind(Te = c(4, 6, 5)), step_h = 1)
#'
#' # Two programs in a chain: one simulates, one extracts.
#' chain <- program_simulator(
#'   list(program_step("awk", "-f", "model.awk", "drivers.csv", stdout = "all.txt",
#'                     makes = "all.txt"),
#'        program_step("awk", "NR == 1 || $1 > 24.5", "all.txt")),
#'   free("gain", uniform(0, 2)), output = program_output("stdout.txt", "Ti"),
#'   templates = list(model.awk = I(rule)), boundary = "Te", cache = tempfile("runs"))
#' simulate_runs(chain, cbind(gain = 1.5), cbind(Te = c(4, 6, 5)), step_h = 1)
#' @export
program_simulator <- function(command, ..., output, templates = list(), boundary = character(),
                              drivers = "drivers.csv", time_limit = 600, retries = 0,
                              cache = tools::R_user_dir("amiss", "cache"), version = "",
                              name = "program", size_limit = 1000, files = NULL, width = NULL,
                              lead_in = 0, before = "record", keep = 0) {
  check_arguments()
  steps <- as_steps(command)
  output <- check_output(output)
  check_columns_named(boundary)
  drivers <- check_program_drivers(drivers)
  check_input(checkmate::check_number(time_limit, lower = 1e-3, finite = TRUE), "time_limit",
              "It is in seconds.")
  check_input(checkmate::check_int(retries, lower = 0, upper = 1000), "retries")
  check_input(checkmate::check_string(cache, min.chars = 1), "cache")
  check_input(checkmate::check_string(name), "name")
  check_input(checkmate::check_number(size_limit, lower = 1, finite = TRUE), "size_limit",
              "It is in megabytes.")
  check_input(checkmate::check_int(width, lower = 6, upper = 100, null.ok = TRUE), "width",
              "It is in characters.")
  check_input(checkmate::check_number(lead_in, lower = 0, upper = 1e6), "lead_in",
              "It is in hours.")
  check_input(checkmate::check_choice(before, lead_ways), "before")
  keep <- check_keep(keep)
  files <- model_files(files)
  templates <- read_templates(templates, files = files)
  simulator <- structure(list(
    format_version = format_version, name = name, command = command, output = output,
    templates = templates, parameters = named_parameters(list(...)),
    boundary = union(boundary, drivers_columns(drivers)), drivers = drivers, files = files,
    width = width, time_limit = time_limit, size_limit = size_limit, retries = retries,
    lead_in = lead_in, before = before, keep = keep, cache = normalizePath(cache, mustWork = FALSE),
    version = version), class = "amiss_program_simulator")
  simulator$command <- resolve_command(command, steps, simulator)
  check_program(simulator)
}

check_output <- function(output, call = rlang::caller_env()) {
  if (is.function(output) || inherits(output, "amiss_program_output")) return(output)
  check_input(checkmate::check_character(output, len = 2, any.missing = FALSE), "output",
              call = call)
  check_input(checkmate::check_names(names(output), permutation.of = c("file", "column")), "output",
              paste("Give {.code c(file = \"out.csv\", column = \"Ti\")}, {.fun program_output} or",
                    "a function of the run's directory."), call = call)
  check_inside(c(output = output[["file"]]), call)
  output
}

check_keep <- function(keep, call = rlang::caller_env()) {
  if (isTRUE(keep)) return(Inf)
  if (isFALSE(keep)) return(0)
  check_input(checkmate::check_int(keep, lower = 0), "keep",
              "Give the number of folders to keep, or TRUE for all.", call = call)
  keep
}

# The files of a run that neither templates nor people give.
own_files <- function(simulator, steps) {
  c(drivers_files(simulator$drivers),
    unlist(lapply(steps, function(step) c(step$stdout, step$stderr))))
}

# Words that name a file of the session become absolute paths, but for those that name a file of the
# run. Inputs are read, or are files of the run, too.
resolve_command <- function(command, steps, simulator, call = rlang::caller_env()) {
  made <- c(names(simulator$templates), simulator$files$name, own_files(simulator, steps),
            unlist(lapply(steps, `[[`, "makes")), output_file(simulator$output))
  for (k in seq_along(steps)) {
    words <- steps[[k]]$command
    there <- is_regular_file(words) & !sub("^[.]/", "", words) %in% made
    words[there] <- normalizePath(words[there])
    steps[[k]]["command"] <- list(words)
    steps[[k]]["input"] <- list(step_input(steps[[k]]$input, made, call))
  }
  if (is.character(command)) steps[[1]]$command else steps
}

output_file <- function(output) {
  if (is.function(output)) NULL else if (is.character(output)) output[["file"]] else output$file
}

# Text as lines, bytes of a file, or list(file) of one in the run's folder.
step_input <- function(input, made, call) {
  if (is.null(input) || is.list(input)) return(input)
  if (inherits(input, "AsIs"))
    return(if (is.raw(input)) unclass(input) else enc2utf8(as.character(input)))
  if (input %in% made) return(list(file = input))
  if (is_regular_file(input)) return(template_of(file_bytes(input)))
  abort_input(c("{.arg input} names {.file {input}}, which is neither a file nor one of the run.",
                i = "Files of the run are {.file {made}}. Put text in {.fun I}."), call = call)
}

# What must hold of a simulator and its templates, made or edited.
check_program <- function(simulator, call = rlang::caller_env()) {
  steps <- as_steps(simulator$command, call)
  inputs <- stdin_names(length(steps))[vapply(steps, function(step) !is.null(step$input), NA)]
  check_template_names(names(simulator$templates), c(own_files(simulator, steps), inputs), call)
  written <- intersect(simulator$files$name, own_files(simulator, steps))
  if (length(written)) {
    abort_input(c("The run itself writes {.file {written[1]}}, which is in {.arg files}, too.",
                  i = paste("Give it another name by {.arg drivers}, or by {.arg stdout} of",
                            "{.fun program_step}.")), call = call)
  }
  check_placeholders(places_of(simulator$templates, steps), simulator$parameters,
                     simulator$width, call)
  simulator
}

#' Edit the templates of a program
#'
#' Edits the templates of a [program_simulator()] and adds parameters. A mechanism of a program is
#' an edit like that.
#'
#' @param simulator A [program_simulator()].
#' @param templates Named list of templates, new ones or in place of those of the same name. Each is
#'   a path, text in [I()], or a function of the lines that are there. A function may also be given
#'   for a file of the model's folder. Functions stack: they keep what other mechanisms have put in.
#' @param ... Parameters to add, each made by [free()].
#' @param boundary Driver columns to add.
#' @return The edited simulator.
#' @examples
#' rule <- c("BEGIN { FS = \",\"; print \"Ti\" }", "NR > 1 { print {{gain}} * $3 }")
#' base <- program_simulator(c("awk", "-f", "model.awk", "drivers.csv"),
#'                           free("gain", uniform(0, 2)),
#'                           output = c(file = "stdout.txt", column = "Ti"),
#'                           templates = list(model.awk = I(rule)), boundary = "Te",
#'                           cache = tempfile("runs"))
#' mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
#'   brighter <- function(lines) sub("* $3", "* $3 + {{sun}} * $4", lines, fixed = TRUE)
#'   with_template(model, list(model.awk = brighter), free("sun", uniform(0, 0.1)), boundary = "Gv")
#' })
#' @export
with_template <- function(simulator, templates, ..., boundary = character()) {
  check_arguments()
  check_object(simulator, "amiss_program_simulator", "simulator",
              "Make one with {.fun program_simulator}.")
  check_columns_named(boundary)
  added <- read_templates(templates, simulator$templates, simulator$files)
  simulator$templates[names(added)] <- added
  simulator$parameters <- named_parameters(c(unname(simulator$parameters), list(...)))
  simulator$boundary <- union(simulator$boundary, boundary)
  check_program(simulator)
}

#' @export
print.amiss_program_simulator <- function(x, ...) on_stdout(x, {
  steps <- as_steps(x$command)
  programs <- unique(vapply(steps, function(step) step$command[1], ""))
  cli::cli_text(paste("{.strong Simulator} {.val {x$name}} (the",
                      "{cli::qty(length(programs))}program{?s} {.file {programs}}) with",
                      "{length(x$parameters)} free parameter{?s}"))
  say_bullets(vapply(utils::head(x$parameters, 6), format, ""))
  if (length(x$parameters) > 6)
    say_bullets(paste("and", length(x$parameters) - 6, "more parameters"))
  cli::cli_bullets(
    c("*" = if (length(x$boundary)) "driven by {.field {x$boundary}}" else "driven by nothing",
      "*" = if (nrow(x$files)) "{nrow(x$files)} file{?s} of the model are copied into each run",
      "*" = if (x$lead_in > 0) "{x$lead_in} h of weather ahead of each segment"))
  kept <- kept_runs(x)
  took <- if (is.null(kept$seconds)) "not run yet" else paste(short(kept$seconds), "s a run")
  cli::cli_bullets(c("*" = "{took}; {kept$runs} finished run{?s} in {.file {x$cache}}"))
  folders <- utils::head(kept$folders, 3)
  say_bullets(paste("folder of a run:", folders, recycle0 = TRUE))
  if (length(kept$folders) > 3) say_bullets(paste("and", length(kept$folders) - 3, "more folders"))
})

#' @export
free_parameters.amiss_program_simulator <- function(simulator) simulator$parameters

#' @export
driver_names.amiss_program_simulator <- function(simulator) simulator$boundary

#' @export
simulate_runs.amiss_program_simulator <- function(simulator, values, drivers, step_h, hold = NULL,
                                                  threads = 1L,
                                                  time = step_h * seq_len(nrow(drivers)), ...) {
  check_run_dots(...)
  check_row_times(time, nrow(drivers))
  plan <- plan_runs(simulator, values, drivers, step_h, time)
  if (!dir.exists(simulator$cache) &&
      !dir.create(simulator$cache, recursive = TRUE, showWarnings = FALSE)) {
    abort_input("The folder {.file {simulator$cache}} for {.arg cache} cannot be made.")
  }
  remove_abandoned(simulator$cache)
  jobs <- plan$jobs
  plan$jobs <- NULL
  made <- future.apply::future_lapply(jobs, function(job) {
    run <- program_run(plan, job)
    piece_done()
    run
  }, future.packages = "amiss", future.seed = NULL)
  note_found(vapply(made, function(run) isTRUE(run$found), NA),
             unlist(lapply(made, `[[`, "seconds")))
  tell_failed(simulator, made)
  if (any(vapply(made, function(run) isFALSE(run$kept), NA))) tell_unkept(simulator$cache)
  matrix(unlist(lapply(made, function(run) run$value %||% rep(NaN, nrow(drivers)))), nrow(drivers))
}

tell_failed <- function(simulator, made) {
  failed <- which(vapply(made, function(run) is.null(run$value), NA))
  if (!length(failed)) return(invisible())
  first <- made[[failed[1]]]
  said <- as_said(paste0(names(first$said), ": ", first$said, recycle0 = TRUE))
  warn_input(c("{length(failed)} of {length(made)} run{?s} of {.val {simulator$name}} failed.",
               x = "Run {failed[1]}: {first$why}.",
               x = if (!is.null(first$directory)) "Its directory is {.file {first$directory}}.",
               stats::setNames(said, rep("x", length(said)))))
}
