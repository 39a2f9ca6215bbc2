#' A simulator that is an external program
#'
#' Any program that reads text files and writes numbers can be calibrated: ESP-r, EnergyPlus, a Modelica model, a
#' script. Each run gets a fresh directory with the rendered `templates` and the drivers as CSV; the program is started
#' there, without a shell, and its output is read. In templates and in the arguments of the command, `{{name}}` stands
#' for the value of the parameter `name`.
#'
#' The drivers' file has the columns `time` (the record's: ISO 8601 in UTC, or its hours), `hours` since the start of
#' the segment, both at the end of each interval, and the columns named in `boundary`.
#'
#' Of a record with gaps the program is started once for each unbroken segment, from its first row, warm-up included, to
#' the last that is used, at the step of the data (before averages): let it take its period and step from the drivers'
#' file, and write one row for each of its rows.
#'
#' A run that succeeds is kept in `cache` at once and never made twice: its key is what it reads (templates, command,
#' drivers, contents of the files that the command names, `version`) and how its output is read. What else the program
#' reads, such as a library of its own, does not count: give another `version` when it changes. A run that fails (exit
#' status, time limit, unreadable output, too few rows, values that are not finite) is `NaN`, told in a warning with its
#' directory, which is kept, and the last lines of its stderr; it is tried again at the next call. Runs are made in
#' parallel as [future::plan()] says.
#'
#' @param command The program and its arguments, as a character vector. Words that name an existing file become absolute
#'   paths, but for the names of `templates`, `drivers` and the file of `output`: those are in the run's directory.
#' @param ... The parameters, each made by [free()].
#' @param output Where the output is: `c(file = "out.csv", column = "Ti")` of a CSV in the run's directory (`stdout.txt`
#'   for what the program prints), or a function of that directory that returns one number per row of the drivers.
#' @param templates Named list: file in the run's directory = path of its template, or its text in [I()].
#' @param boundary Names of the driver columns that the program needs.
#' @param drivers Name of the drivers' file.
#' @param time_limit Seconds for one run.
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
                              name = "program") {
  check_input(checkmate::check_character(command, any.missing = FALSE, min.len = 1), "command")
  check_input(checkmate::check_string(command[1], min.chars = 1), "command[1]", "Name the program.")
  if (!is.function(output)) {
    check_input(checkmate::check_character(output, len = 2, any.missing = FALSE), "output")
    check_input(checkmate::check_names(names(output), permutation.of = c("file", "column")), "output",
                "Give {.code c(file = \"out.csv\", column = \"Ti\")} or a function of the run's directory.")
  }
  check_columns_named(boundary)
  check_input(checkmate::check_string(drivers, min.chars = 1), "drivers")
  check_input(checkmate::check_number(time_limit, lower = 1e-3, finite = TRUE), "time_limit", "It is in seconds.")
  check_input(checkmate::check_int(retries, lower = 0, upper = 1000), "retries")
  check_input(checkmate::check_string(cache, min.chars = 1), "cache")
  check_input(checkmate::check_string(name), "name")
  templates <- read_templates(templates)
  made <- c(names(templates), drivers, if (!is.function(output)) output[["file"]])  # in the run's directory
  files <- file.exists(command) & !dir.exists(command) & !command %in% made
  command[files] <- normalizePath(command[files])
  simulator <- structure(list(
    format_version = format_version, name = name, command = command, output = output, templates = templates,
    parameters = named_parameters(list(...)), boundary = unique(boundary), drivers = drivers, time_limit = time_limit,
    retries = retries, cache = normalizePath(cache, mustWork = FALSE), version = version),
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
  check_object(simulator, "amiss_program_simulator", "simulator",
              "Make one with {.fun program_simulator}.")
  check_columns_named(boundary)
  added <- read_templates(templates, simulator$templates)
  simulator$templates[names(added)] <- added
  simulator$parameters <- named_parameters(c(unname(simulator$parameters), list(...)))
  simulator$boundary <- union(simulator$boundary, boundary)
  check_placeholders(simulator)
}

# The lines of each template; `present` are those that a function may change.
read_templates <- function(templates, present = list(), call = rlang::caller_env()) {
  if (is.character(templates)) templates <- as.list(templates)
  check_input(checkmate::check_list(templates, null.ok = TRUE, names = if (length(templates)) "unique"), "templates",
              "Give a named list: file = path, or text in {.fun I}.", call = call)
  if (!length(templates)) return(list())
  sapply(names(templates), function(file) {
    x <- templates[[file]]
    if (is.function(x) && !is.null(present[[file]])) return(as.character(x(present[[file]])))
    if (inherits(x, "AsIs")) return(as.character(x))
    if (checkmate::test_string(x) && file.exists(x)) return(readLines(x, warn = FALSE))
    why <- if (is.function(x)) "there is none that its function could change"
           else paste("there is no file", if (checkmate::test_string(x)) x else seen(x))
    abort_input(c("Template {.val {file}} cannot be read: {why}.",
                  i = "Give the path of a file, or text in {.fun I}."), call = call)
  }, simplify = FALSE)
}

placeholder <- "\\{\\{\\s*([^{}]*?)\\s*\\}\\}"

placeholders <- function(text) {
  found <- unlist(regmatches(text, gregexpr(placeholder, text, perl = TRUE)))
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

render <- function(text, values) {
  for (name in names(values)) {
    text <- gsub(paste0("\\{\\{\\s*\\Q", name, "\\E\\s*\\}\\}"), sprintf("%.15g", values[[name]]), text, perl = TRUE)
  }
  text
}

#' @export
print.amiss_program_simulator <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong Simulator} {.val {x$name}} (the program {.file {x$command[1]}}) with",
                      "{length(x$parameters)} free parameter{?s}"))
  cli::cli_bullets(stats::setNames(vapply(x$parameters, format, ""), rep("*", length(x$parameters))))
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
  table <- drivers_table(drivers, step_h, time)
  files <- c(program, simulator$command[file.exists(simulator$command)])
  shared <- rlang::hash(list(table, unname(tools::md5sum(files)), simulator$version, plain(simulator$output),
                             simulator$drivers))
  csv <- csv_lines(table)
  made <- future.apply::future_lapply(seq_len(nrow(values)),
                                      function(m) {
                                        run <- program_run(simulator, values[m, ], csv, shared)
                                        piece_done()
                                        run
                                      }, future.packages = "amiss", future.seed = NULL)
  failed <- which(!vapply(made, is.numeric, NA))
  tell_failed(simulator, made, failed)
  made[failed] <- list(rep(NaN, nrow(drivers)))
  matrix(unlist(made), nrow(drivers))
}

# Times that are no numbers as ISO 8601 in UTC.
drivers_table <- function(drivers, step_h, time) {
  if (!is.numeric(time)) {
    time <- format(utc(round(as.numeric(time))), "%Y-%m-%dT%H:%M:%SZ")
  }
  data.frame(time = time, hours = step_h * seq_len(nrow(drivers)), drivers, check.names = FALSE)
}

# Written once for all runs.
csv_lines <- function(table) {
  file <- tempfile()
  on.exit(unlink(file))
  utils::write.csv(table, file, row.names = FALSE, quote = FALSE)
  readLines(file)
}

tell_failed <- function(simulator, made, failed) {
  if (!length(failed)) return(invisible())
  first <- made[[failed[1]]]
  warn_input(c("{length(failed)} of {length(made)} run{?s} of {.val {simulator$name}} failed.",
               x = "Run {failed[1]}: {first$why}; its directory is {.file {first$directory}}.",
               x = if (length(first$stderr)) "Its last words: {first$stderr}"))
}

# The output of one run, from the cache or made; list(why, directory, stderr) if it failed.
program_run <- function(simulator, values, csv, shared) {
  templates <- lapply(simulator$templates, render, values)
  command <- c(simulator$command[1], render(simulator$command[-1], values))
  key <- rlang::hash(list(shared, templates, command))
  kept <- file.path(simulator$cache, paste0(key, ".rds"))
  if (file.exists(kept)) return(readRDS(kept))
  directory <- tempfile(paste0(key, "-"), simulator$cache)
  for (attempt in 0:simulator$retries) {
    unlink(directory, recursive = TRUE)
    write_inputs(directory, templates, simulator$drivers, csv)
    out <- tryCatch(run_program(simulator, command, directory, length(csv) - 1), error = conditionMessage)
    if (is.numeric(out)) {
      part <- tempfile("part-", simulator$cache)
      saveRDS(out, part)
      file.rename(part, kept)
      unlink(directory, recursive = TRUE)
      return(out)
    }
  }
  failed <- file.path(simulator$cache, paste0("failed-", key))
  unlink(failed, recursive = TRUE)
  file.rename(directory, failed)
  stderr <- file.path(failed, "stderr.txt")
  list(why = out, directory = failed, stderr = if (file.exists(stderr)) utils::tail(readLines(stderr, warn = FALSE), 5))
}

write_inputs <- function(directory, templates, drivers, csv) {
  for (file in names(templates)) {
    path <- file.path(directory, file)
    dir.create(dirname(path), recursive = TRUE, showWarnings = FALSE)
    writeLines(templates[[file]], path)
  }
  dir.create(directory, showWarnings = FALSE)
  writeLines(csv, file.path(directory, drivers))
}

# The output of one run of the program; an error says why there is none.
run_program <- function(simulator, command, directory, rows) {
  done <- processx::run(command[1], command[-1], wd = directory, timeout = simulator$time_limit,
                        error_on_status = FALSE,
                        stdout = file.path(directory, "stdout.txt"), stderr = file.path(directory, "stderr.txt"),
                        cleanup_tree = TRUE)
  if (done$timeout) stop("it did not end within ", simulator$time_limit, " s")
  if (done$status != 0) stop("it ended with exit status ", done$status)
  out <- if (is.function(simulator$output)) simulator$output(directory) else read_output(simulator$output, directory)
  if (!is.numeric(out)) stop("its output is of class ", class(out)[1], ", not numeric")
  if (length(out) != rows) stop("its output has ", length(out), " rows, where ", rows, " were expected")
  if (!all(is.finite(out))) stop("its output is not finite in row ", which(!is.finite(out))[1])
  as.numeric(out)
}

read_output <- function(output, directory) {
  path <- file.path(directory, output[["file"]])
  if (!file.exists(path) || file.size(path) == 0) stop("it wrote nothing into ", output[["file"]])
  table <- utils::read.csv(path, check.names = FALSE)
  if (!output[["column"]] %in% names(table)) {
    stop("there is no column ", output[["column"]], " in ", output[["file"]], "; there: ",
         paste(names(table), collapse = ", "))
  }
  table[[output[["column"]]]]
}
