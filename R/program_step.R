#' Programs one after the other
#'
#' A simulation often takes a chain of programs: one simulates, another extracts what is needed.
#' Give `program_simulator(command = list(program_step(...), program_step(...)), ...)`. The steps
#' run one after the other in the folder of the run, without a shell; the first that fails ends the
#' run, and the warning shows what it wrote last.
#'
#' A program that exits with 0 may have failed all the same. `makes`, `needs` and `fails_if` find
#' that out at the step that failed, and not at the next, which only misses a file.
#'
#' @param command The program. `./name` or the name of a file in the run's folder is a program that
#'   is copied there.
#' @param ... Its arguments, as text; `{{name}}` stands for a parameter, as in templates.
#' @param input What it reads from standard input: text in [I()] (a line for each element), the path
#'   of a file, or the name of a file in the run's folder. Placeholders in the text or the file are
#'   filled in.
#' @param stdout Name of the file for its standard output. By default `stdout.txt` for the last step
#'   and `stdout-1.txt`, `stdout-2.txt`, ... for those before.
#' @param folder Folder within that of the run in which it is started, like `"cfg"`; by default
#'   that of the run.
#' @param makes Names of files, from the folder of the run, that must be there and not empty after
#'   the step.
#' @param needs,fails_if Regular expressions (of Perl), each of which must stand in its log, or of
#'   which none may. The log is standard output, standard error and the files named in `log`.
#' @param log Names of further files of the log, from the folder of the run (`"eplusout.err"`).
#' @param time_limit Seconds for this step; the run as a whole has a `time_limit`, too.
#' @param status Exit statuses that are no failure; `NULL`: any.
#' @return An object of class `amiss_program_step`.
#' @examples
#' program_step("bps", "-file", "house.cfg", "-mode", "text", input = I(c("c", "{{days:%d}}", "-")),
#'              makes = "house.res", needs = "finished", fails_if = "(?i)error", time_limit = 300)
#' @export
program_step <- function(command, ..., input = NULL, stdout = NULL, folder = NULL, makes = NULL,
                         needs = NULL, fails_if = NULL, log = NULL, time_limit = NULL, status = 0) {
  check_arguments()
  check_input(checkmate::check_string(command, min.chars = 1), "command", "Name the program.")
  arguments <- list(...)
  if (any(nzchar(rlang::names2(arguments)))) {
    abort_input(c("{.fun program_step} has no argument {.arg {setdiff(names(arguments), '')[1]}}.",
                  i = "Arguments of the program have no names: write {.code \"-mode\", \"text\"}."))
  }
  words <- unlist(arguments)
  check_input(checkmate::check_character(words, any.missing = FALSE, null.ok = TRUE), "...",
              "Give the program's arguments as text.")
  check_step_files(input, stdout, folder, makes, log)
  check_patterns(needs, "needs")
  check_patterns(fails_if, "fails_if")
  check_input(checkmate::check_number(time_limit, lower = 1e-3, finite = TRUE, null.ok = TRUE),
              "time_limit", "It is in seconds.")
  check_input(checkmate::check_integerish(status, any.missing = FALSE, null.ok = TRUE), "status")
  structure(list(command = c(command, words), input = input, stdout = stdout, folder = folder,
                 makes = makes, needs = needs, fails_if = fails_if, log = log,
                 time_limit = time_limit, status = status), class = "amiss_program_step")
}

check_step_files <- function(input, stdout, folder, makes, log, call = rlang::caller_env()) {
  if (!inherits(input, "AsIs")) {
    check_input(checkmate::check_string(input, min.chars = 1, null.ok = TRUE), "input",
                "Give text in {.fun I}, or the name of a file.", call = call)
  }
  check_input(checkmate::check_string(stdout, min.chars = 1, null.ok = TRUE), "stdout", call = call)
  check_input(checkmate::check_string(folder, min.chars = 1, null.ok = TRUE), "folder", call = call)
  check_input(checkmate::check_character(makes, min.chars = 1, any.missing = FALSE, null.ok = TRUE),
              "makes", "Give names of files.", call = call)
  check_input(checkmate::check_character(log, min.chars = 1, any.missing = FALSE, null.ok = TRUE),
              "log", "Give names of files.", call = call)
  named <- list(stdout = stdout, folder = folder, makes = makes, log = log)
  for (name in names(named)) {
    files <- as.character(named[[name]])
    check_inside(stats::setNames(files, rep(name, length(files))), call)
  }
}

check_patterns <- function(patterns, name, call = rlang::caller_env()) {
  check_input(
    checkmate::check_character(patterns, min.chars = 1, any.missing = FALSE, null.ok = TRUE), name,
    "Give regular expressions.", call = call)
  for (pattern in patterns) {
    fine <- tryCatch(is.logical(grepl(pattern, "", perl = TRUE)), error = function(e) FALSE,
                     warning = function(w) FALSE)
    if (!fine)
      abort_input("{.arg {name}} = {.val {pattern}} is no regular expression.", call = call)
  }
}

#' @export
print.amiss_program_step <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong Step} {.code {step_words_of(x)}}")
  facts <- c("in the folder" = x$folder, "must write" = x$makes, "must say" = x$needs,
             "fails if it says" = x$fails_if, "seconds at most:" = x$time_limit)
  say_bullets(paste(names(facts), facts, recycle0 = TRUE))
})

# The command as a person would type it.
step_words_of <- function(step) {
  plain <- !grepl("[^[:alnum:]_./=,:{}+-]", step$command) & nzchar(step$command)
  paste(ifelse(plain, step$command, shQuote(step$command)), collapse = " ")
}

# A command as a list of steps, each with names of its own for the files of its output: a character
# vector is one step.
as_steps <- function(command, call = rlang::caller_env()) {
  if (is.character(command)) command <- list(do.call(program_step, as.list(unname(command))))
  if (inherits(command, "amiss_program_step")) command <- list(command)
  check_input(checkmate::check_list(command, min.len = 1), "command",
              "Give a character vector, or a list of {.fun program_step}.", call = call)
  last <- length(command)
  lapply(unname(seq_along(command)), function(k) {
    step <- command[[k]]
    if (is.character(step)) step <- as_steps(step, call)[[1]]
    if (!inherits(step, "amiss_program_step")) {
      abort_input(c("Number {k} of {.arg command} is {seen(step)}.",
                    i = "Give a character vector, or a list of {.fun program_step}."), call = call)
    }
    of <- if (k == last) "" else paste0("-", k)
    step$stdout <- step$stdout %||% paste0("stdout", of, ".txt")
    step$stderr <- paste0("stderr", of, ".txt")
    step
  })
}

# Why the log of a step that ended says that it failed, or NULL. `paths` by the names of the files.
log_failure <- function(step, paths) {
  if (!length(c(step$needs, step$fails_if))) return(NULL)
  lines <- lapply(paths, log_lines)
  for (pattern in step$fails_if) for (file in names(lines)) {
    hit <- grep(pattern, lines[[file]], perl = TRUE, useBytes = TRUE)
    if (length(hit)) return(paste0("its ", file, " says ", shown(lines[[file]][hit[1]])))
  }
  for (pattern in step$needs) {
    if (!any(grepl(pattern, unlist(lines), perl = TRUE, useBytes = TRUE)))
      return(paste0("what it wrote (", listed(names(lines)), ") does not say ", shown(pattern)))
  }
}

most_log <- 2e7  # bytes of a log that are searched, at its begin and at its end

log_lines <- function(path) {
  if (!is_regular_file(path)) return(character())
  bytes <- if (file.size(path) <= most_log) file_bytes(path) else file_ends(path, most_log)
  lines_of(bytes[bytes != as.raw(0)])
}
