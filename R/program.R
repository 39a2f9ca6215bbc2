#' A simulator that is an external program
#'
#' Any program that reads text files and writes numbers can be calibrated: ESP-r, EnergyPlus, a Modelica model, a
#' script. Each run gets a fresh directory with the rendered `templates` and the drivers as CSV; the program is started
#' there, without a shell, and its output is read. In templates and in the arguments of the command, `{{name}}` stands
#' for the value of the parameter `name`. A file without a placeholder is copied byte for byte.
#'
#' The output is a CSV with one line of names and a line of numbers for each row of the drivers, a point before
#' decimals. Exponents as Fortran writes them (`1.5D-03`, `1.5-103`) are numbers, too. Anything else (`****`, a decimal
#' comma, a row of units, a line with one field more or less than there are names) makes the run fail: the warning says
#' line and value.
#'
#' A run ends with the process that was started: what it leaves behind in the background is stopped, as is everything
#' of a run that takes longer than `time_limit`, reading its output included, or writes more than `size_limit`. If R
#' itself is killed, the program is stopped, and the next call removes what was left of its run.
#'
#' The drivers' file has the columns `time` (the record's: ISO 8601 in UTC, or its hours), `hours` since the start of
#' the segment, both at the end of each interval, and the columns named in `boundary`.
#'
#' Of a record with gaps the program is started once for each unbroken segment, from its first row, warm-up included, to
#' the last that is used, at the step of the data (before averages): let it take its period and step from the drivers'
#' file, and write one row for each of its rows.
#'
#' A run that succeeds is kept in `cache` at once and never made twice: its key is what it reads (templates, command,
#' drivers, contents of the files that the command names, `version`) and how its output is read. What was kept is
#' checked when it is read, and made again if it is not whole. What else the program reads, such as a library of its
#' own, does not count: give another `version` when it changes. A run that fails (exit status, time limit, unreadable
#' output, too few rows, values that are not finite) is `NaN`, told in a warning with its directory, which is kept, and
#' the last lines of its stderr; it is tried again at the next call. Runs are made in parallel as [future::plan()]
#' says.
#'
#' @param command The program and its arguments, as a character vector. Words that name an existing file become absolute
#'   paths, but for the names of `templates`, `drivers` and the file of `output`: those are in the run's directory.
#' @param ... The parameters, each made by [free()].
#' @param output Where the output is: `c(file = "out.csv", column = "Ti")` of a CSV in the run's directory (`stdout.txt`
#'   for what the program prints), or a function of that directory that returns one number per row of the drivers.
#' @param templates Named list: file in the run's directory = path of its template, or its text in [I()]. A name may
#'   hold folders (`"inputs/model.txt"`), and does not lead out of the run's directory.
#' @param boundary Names of the driver columns that the program needs.
#' @param drivers Name of the drivers' file.
#' @param time_limit Seconds for one run.
#' @param size_limit Megabytes that one run may write. Of a run that fails, files over one megabyte are kept without
#'   their middle.
#' @param retries How often a failed run is tried again at once.
#' @param cache Directory of the finished runs, and of the directories of failed ones.
#' @param version Anything that tells versions of the program apart.
#' @param name A name for people.
#' @return An object of class `amiss_program_simulator`.
#' @examples
#' rule <- c("BEGIN { FS = \",\"; print \"Ti\" }", "NR > 1 { print 20 + {{gain}} * $3 }")
#' linear <- program_simulator(c("awk", "-f", "model.awk", "drivers.csv"), free("gain", uniform(0, 2)),
#'                             output = c(file = "stdout.txt", column = "Ti"),
#'                             templates = list(model.awk = I(rule)), boundary = "Te",
#'                             cache = tempfile("runs"))
#' linear
#' simulate_runs(linear, cbind(gain = c(0.5, 1)), cbind(Te = c(4, 6, 5)), step_h = 1)
#' @export
program_simulator <- function(command, ..., output, templates = list(), boundary = character(), drivers = "drivers.csv",
                              time_limit = 600, retries = 0, cache = tools::R_user_dir("amiss", "cache"), version = "",
                              name = "program", size_limit = 1000) {
  check_input(checkmate::check_character(command, any.missing = FALSE, min.len = 1), "command")
  check_input(checkmate::check_string(command[1], min.chars = 1), "command[1]", "Name the program.")
  check_present(output)
  if (!is.function(output)) {
    check_input(checkmate::check_character(output, len = 2, any.missing = FALSE), "output")
    check_input(checkmate::check_names(names(output), permutation.of = c("file", "column")), "output",
                "Give {.code c(file = \"out.csv\", column = \"Ti\")} or a function of the run's directory.")
  }
  check_columns_named(boundary)
  check_input(checkmate::check_string(drivers, min.chars = 1), "drivers")
  check_inside(c(drivers = drivers, output = if (!is.function(output)) output[["file"]]))
  check_input(checkmate::check_number(time_limit, lower = 1e-3, finite = TRUE), "time_limit", "It is in seconds.")
  check_input(checkmate::check_int(retries, lower = 0, upper = 1000), "retries")
  check_input(checkmate::check_string(cache, min.chars = 1), "cache")
  check_input(checkmate::check_string(name), "name")
  check_input(checkmate::check_number(size_limit, lower = 1, finite = TRUE), "size_limit", "It is in megabytes.")
  templates <- read_templates(templates)
  check_template_names(names(templates), drivers)
  made <- c(names(templates), drivers, if (!is.function(output)) output[["file"]])  # in the run's directory
  files <- is_regular_file(command) & !command %in% made
  command[files] <- normalizePath(command[files])
  simulator <- structure(list(
    format_version = format_version, name = name, command = command, output = output, templates = templates,
    parameters = named_parameters(list(...)), boundary = unique(boundary), drivers = drivers, time_limit = time_limit,
    size_limit = size_limit, retries = retries, cache = normalizePath(cache, mustWork = FALSE), version = version),
    class = "amiss_program_simulator")
  check_placeholders(simulator)
}

#' Edit the templates of a program
#'
#' A mechanism of a [program_simulator()] is an edit of its templates, with parameters of its own.
#'
#' @param simulator A [program_simulator()].
#' @param templates Named list of templates, new ones or in place of those of the same name: a path, text in [I()], or a
#'   function of the lines that are there. Functions stack: they keep what other mechanisms have put in.
#' @param ... Parameters to add, each made by [free()].
#' @param boundary Driver columns to add.
#' @return The edited simulator.
#' @examples
#' rule <- c("BEGIN { FS = \",\"; print \"Ti\" }", "NR > 1 { print {{gain}} * $3 }")
#' base <- program_simulator(c("awk", "-f", "model.awk", "drivers.csv"), free("gain", uniform(0, 2)),
#'                           output = c(file = "stdout.txt", column = "Ti"),
#'                           templates = list(model.awk = I(rule)), boundary = "Te",
#'                           cache = tempfile("runs"))
#' mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
#'   brighter <- function(lines) sub("* $3", "* $3 + {{sun}} * $4", lines, fixed = TRUE)
#'   with_template(model, list(model.awk = brighter), free("sun", uniform(0, 0.1)), boundary = "Gv")
#' })
#' @export
with_template <- function(simulator, templates, ..., boundary = character()) {
  check_present(simulator, templates)
  check_object(simulator, "amiss_program_simulator", "simulator",
              "Make one with {.fun program_simulator}.")
  check_columns_named(boundary)
  added <- read_templates(templates, simulator$templates)
  check_template_names(union(names(simulator$templates), names(added)), simulator$drivers)
  simulator$templates[names(added)] <- added
  simulator$parameters <- named_parameters(c(unname(simulator$parameters), list(...)))
  simulator$boundary <- union(simulator$boundary, boundary)
  check_placeholders(simulator)
}

# Each template: its lines, or its bytes as long as nobody reads them. `present` are those that a function may change.
read_templates <- function(templates, present = list(), call = rlang::caller_env()) {
  if (is.character(templates)) templates <- as.list(templates)
  check_input(checkmate::check_list(templates, null.ok = TRUE, names = if (length(templates)) "unique"), "templates",
              "Give a named list: file = path, or text in {.fun I}.", call = call)
  if (!length(templates)) return(list())
  sapply(names(templates), function(file) {
    x <- templates[[file]]
    if (is.function(x) && !is.null(present[[file]])) return(edited_lines(x, present[[file]], file, call))
    if (inherits(x, "AsIs")) return(if (is.raw(x)) unclass(x) else enc2utf8(as.character(x)))
    if (checkmate::test_string(x) && is_regular_file(x)) return(template_of(file_bytes(x)))
    why <- if (is.function(x)) "there is none that its function could change"
           else paste("there is no file", if (checkmate::test_string(x)) x else seen(x))
    abort_input(c("Template {.val {file}} cannot be read: {why}.",
                  i = "Give the path of a file, or text in {.fun I}."), call = call)
  }, simplify = FALSE)
}

# Lines, if there is something to fill in.
template_of <- function(bytes) {
  filled <- length(grepRaw("{{", bytes, fixed = TRUE)) && !any(bytes == as.raw(0))
  if (filled) lines_of(bytes) else bytes
}

edited_lines <- function(edit, template, file, call) {
  if (is.raw(template) && any(template == as.raw(0))) {
    abort_input(c("Template {.val {file}} is binary: it has no lines that a function could change.",
                  i = "Give the path of another file in its place."), call = call)
  }
  lines <- edit(if (is.raw(template)) lines_of(template) else template)
  check_input(checkmate::check_character(lines, any.missing = FALSE), paste0("templates$", file),
              "Let its function return the lines.", call = call)
  lines
}

# Names of files that stay in the run's directory.
check_inside <- function(names, call = rlang::caller_env()) {
  out <- names[!stays_inside(names)]
  if (length(out)) {
    abort_input(c("{.arg {names(out)[1]}} names {.file {out[1]}}, which is no file in the run's directory.",
                  i = "Give a name as {.code model.txt} or {.code inputs/model.txt}."), call = call)
  }
}

# Each has a file of its own, and a folder is none of them.
check_template_names <- function(names, drivers, call = rlang::caller_env()) {
  if (!length(names)) return(invisible())
  check_inside(stats::setNames(names, rep("templates", length(names))), call)
  parts <- fs::path_norm(c(names, drivers, "stdout.txt", "stderr.txt"))
  folders <- unlist(lapply(parts, function(part) setdiff(fs::path_dir(Reduce(fs::path, fs::path_split(part)[[1]],
                                                                              accumulate = TRUE)), ".")))
  taken <- names[match(unique(c(parts[duplicated(parts)], intersect(parts, folders))), parts)]
  if (length(taken)) {
    abort_input(c("The name {.file {taken[1]}} of a template belongs to another file or folder of the run.",
                  i = "The drivers are in {.file {drivers}}, what the program says in stdout.txt and stderr.txt."),
                call = call)
  }
}

placeholder <- "\\{\\{\\s*([^{}]*?)\\s*\\}\\}"

placeholders <- function(text) {
  if (is.raw(text)) return(character())
  found <- as.character(unlist(regmatches(text, gregexpr(placeholder, text, perl = TRUE, useBytes = TRUE))))
  Encoding(found) <- "UTF-8"
  unique(sub(placeholder, "\\1", found, perl = TRUE))
}

check_placeholders <- function(simulator, call = rlang::caller_env()) {
  places <- c(simulator$templates, list(`the command` = simulator$command[-1]))
  known <- names(simulator$parameters)
  for (place in names(places)) {
    unknown <- setdiff(placeholders(places[[place]]), known)
    if (length(unknown)) {
      abort_input(c("Template {.val {place}} holds the placeholder {.val {unknown[1]}}, which is no parameter.",
                    i = "Parameters: {.val {known}}; declare it with {.fun free} or correct the template."),
                    call = call)
    }
  }
  idle <- setdiff(known, unlist(lapply(places, placeholders)))
  if (length(idle)) {
    abort_input(c("Parameter {.val {idle[1]}} stands in no template and in no argument of the command.",
                  i = paste("Write {.code {paste0('{{', idle[1], '}}')}} where its value belongs. Templates:",
                            "{.val {names(simulator$templates)}}.")),
                  call = call)
  }
  simulator
}

#' @export
print.amiss_program_simulator <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong Simulator} {.val {x$name}} (the program {.file {x$command[1]}}) with",
                      "{length(x$parameters)} free parameter{?s}"))
  say_bullets(vapply(x$parameters, format, ""))
  cli::cli_bullets(c("*" = "finished runs in {.file {x$cache}}"))
})

#' @export
free_parameters.amiss_program_simulator <- function(simulator) simulator$parameters

#' @export
driver_names.amiss_program_simulator <- function(simulator) simulator$boundary

#' @export
simulate_runs.amiss_program_simulator <- function(simulator, values, drivers, step_h, hold = NULL, threads = 1L,
                                                  time = step_h * seq_len(nrow(drivers)), ...) {
  check_run_dots(...)
  check_row_times(time, nrow(drivers))
  program <- Sys.which(simulator$command[1])
  if (!nzchar(program)) {
    abort_input(c("The program {.file {simulator$command[1]}} of {.val {simulator$name}} is not there.",
                  i = "Install it, or give its path in {.arg command}."))
  }
  if (!dir.exists(simulator$cache) && !dir.create(simulator$cache, recursive = TRUE, showWarnings = FALSE)) {
    abort_input("The folder {.file {simulator$cache}} for {.arg cache} cannot be made.")
  }
  remove_abandoned(simulator$cache)
  table <- drivers_table(drivers, step_h, time)
  files <- c(program, simulator$command[is_regular_file(simulator$command)])
  shared <- rlang::hash(list(table, unname(tools::md5sum(files)), simulator$version, plain(simulator$output),
                             simulator$drivers))
  csv <- csv_bytes(table)
  made <- future.apply::future_lapply(seq_len(nrow(values)),
                                      function(m) {
                                        run <- program_run(simulator, values[m, ], csv, shared, nrow(drivers))
                                        piece_done()
                                        run
                                      }, future.packages = "amiss", future.seed = NULL)
  tell_failed(simulator, made)
  if (any(vapply(made, function(run) isFALSE(run$kept), NA))) tell_unkept(simulator$cache)
  matrix(unlist(lapply(made, function(run) run$value %||% rep(NaN, nrow(drivers)))), nrow(drivers))
}

# Times that are no numbers as ISO 8601 in UTC.
drivers_table <- function(drivers, step_h, time) {
  if (!is.numeric(time)) {
    time <- format(utc(round(as.numeric(time))), "%Y-%m-%dT%H:%M:%SZ")
  }
  data.frame(time = time, hours = step_h * seq_len(nrow(drivers)), drivers, check.names = FALSE)
}

# Written once for all runs. Names that hold a comma stand in quotes.
csv_bytes <- function(table) {
  file <- tempfile()
  on.exit(unlink(file))
  utils::write.table(table, file, sep = ",", row.names = FALSE, col.names = FALSE, quote = FALSE)
  names <- enc2utf8(names(table))
  apart <- grepl("[\",\r\n]", names)
  names[apart] <- paste0("\"", gsub("\"", "\"\"", names[apart], fixed = TRUE), "\"")
  c(charToRaw(paste0(paste(names, collapse = ","), "\n")), file_bytes(file))
}

tell_failed <- function(simulator, made) {
  failed <- which(vapply(made, function(run) is.null(run$value), NA))
  if (!length(failed)) return(invisible())
  first <- made[[failed[1]]]
  warn_input(c("{length(failed)} of {length(made)} run{?s} of {.val {simulator$name}} failed.",
               x = "Run {failed[1]}: {first$why}.",
               x = if (!is.null(first$directory)) "Its directory is {.file {first$directory}}.",
               x = if (length(first$stderr)) "Its last words: {first$stderr}"))
}
