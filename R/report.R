#' Write a report
#'
#' Writes what was found in plain words, what to inspect next, and the figures and tables behind it.
#' `report()` writes a file of its own. `report_fragment()` is for a chunk of a document of yours,
#' of any format that R Markdown knows. RStudio offers the R Markdown template of the report under
#' *New File, From Template: Report of amiss*.
#'
#' @section Formats: The end of the file's name chooses the format:
#'   * `.html`: one file that needs nothing from outside.
#'   * `.pdf`: the same page printed by Chromium, Chrome or Edge (Debian: `apt-get install
#'     chromium`). The environment variable `CHROMOTE_CHROME` may name the program.
#'   * `.docx`: a Word document with the same text, tables and figures.
#'
#' @param x An upgrade ([upgrade_model()]), a comparison ([compare_models()]), a calibration
#'   ([calibrate()], [calibrate_paper()]) or a [survey()] of many studies. The simulator of a
#'   calibration is run again to predict its record.
#' @param file Name of the file, ending in `.html`, `.pdf` or `.docx`; its folder must exist. The
#'   file appears only when it is complete.
#' @param quiet No messages of R Markdown.
#' @param parts Which parts, in their order; `NULL` for all:
#'   * an upgrade: `"summary"`, `"mechanisms"`, `"fit"`, `"drivers"`, `"trials"`, `"parameters"`,
#'     `"lack"`, `"trust"`, `"method"` and `"words"`;
#'   * a comparison: `"summary"`, `"evidence"`, `"drivers"`, `"fit"`, `"parameters"`, `"practice"`
#'     and `"method"`;
#'   * a calibration: `"summary"`, `"fit"`, `"parameters"`, `"lack"` and `"trust"`;
#'   * a survey: `"summary"`, `"causes"`, `"parameters"`, `"drivers"`, `"gain"` and `"studies"`.
#' @param level Level of the headings of the parts, 1 to 4.
#' @return `report()`: `file`, invisibly. `report_fragment()`: text for knitr, which a chunk shows
#'   as it is.
#' @seealso [summary.amiss_upgrade()] and [summary.amiss_comparison()] for the words alone,
#'   [figures] for the figures.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4))
#' table$Ti <- 20 + 0.4 * table$Te + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(ais = list(pilot_chains = 48, groups = 4))  # a coarse sampler, for speed
#' fit <- calibrate(train_emulator(runs, room), room, quick, seed = 1)
#' \donttest{
#' if (rmarkdown::pandoc_available("2.0")) report(fit, file.path(tempdir(), "room.html"))
#' }
#' \dontrun{
#' report_fragment(fit, parts = "summary", level = 3)  # in a chunk of a document
#' }
#' @export
report <- function(x, file, quiet = TRUE) {
  check_arguments()
  check_input(checkmate::check_flag(quiet), "quiet")
  check_reported(x)
  kind <- report_kind(file)
  check_report_tools()
  browser <- if (kind == "pdf") find_browser()
  work <- tempfile("amiss-report-")
  dir.create(work)
  on.exit(unlink(work, recursive = TRUE))
  source <- file.path(work, "report.Rmd")
  file.copy(report_path("templates", "report", "skeleton", "skeleton.Rmd"), source)
  made <- render_report(x, source, work, kind, quiet)
  if (kind == "pdf") made <- print_page(made, file.path(work, "report.pdf"), browser)
  move_into_place(made, file)
  invisible(file)
}

render_report <- function(x, source, work, kind, quiet) {
  rmarkdown::render(source, if (kind == "docx") "word_document" else "html_document",
                    output_dir = work, intermediates_dir = work, params = list(result = x),
                    envir = new.env(parent = globalenv()), quiet = quiet)
}

#' @rdname report
#' @export
report_fragment <- function(x, parts = NULL, level = 2) {
  check_reported(x)
  check_input(checkmate::check_int(level, lower = 1, upper = 4), "level")
  if (!isTRUE(getOption("knitr.in.progress"))) {
    abort_input(c("A fragment belongs in a chunk of a document that is being knit.",
                  i = "{.fun report} writes a file of its own."))
  }
  all <- template_parts(x)
  parts <- parts %||% names(all)
  check_input(checkmate::check_subset(parts, names(all), empty.ok = FALSE), "parts")
  text <- c("::::::::: {.amiss}", unlist(all[parts]), ":::::::::")
  child <- knitr::knit_child(text = text, envir = report_environment(x), quiet = TRUE,
                             options = list(echo = FALSE, message = FALSE, warning = FALSE,
                                            error = FALSE, results = "asis", collapse = FALSE,
                                            comment = NA))
  child <- gsub("(^|\n)##", paste0("\\1", strrep("#", level)), child)
  knitr::asis_output(paste(c(fragment_style(), child), collapse = "\n"))
}

check_reported <- function(x, call = rlang::caller_env()) {
  check_object(x, c("amiss_upgrade", "amiss_comparison", "amiss_fit", "amiss_survey"), "x",
               paste("It is made by {.fun upgrade_model}, {.fun compare_models},",
                     "{.fun calibrate} or {.fun survey}."), call = call)
}

# html, pdf or docx, by the name of a file that can be written.
report_kind <- function(file, call = rlang::caller_env()) {
  check_input(checkmate::check_string(file, min.chars = 1), "file", call = call)
  folder <- dirname(file)
  if (!dir.exists(folder)) {
    abort_input(c("The folder {.file {folder}} of {.arg file} = {.file {file}} does not exist.",
                  i = "Make it with {.fun dir.create}, or choose another."), call = call)
  }
  if (dir.exists(file)) {
    abort_input(c("{.arg file} = {.file {file}} is a folder.",
                  i = "Give the name of the file in it."), call = call)
  }
  kind <- tolower(tools::file_ext(file))
  if (!kind %in% c("html", "htm", "pdf", "docx")) {
    abort_input(c("{.arg file} = {.file {file}} does not say what to write.",
                  i = "Give a name that ends in {.code .html}, {.code .pdf} or {.code .docx}."),
                call = call)
  }
  if (file.access(folder, 2) != 0)
    abort_input("The folder {.file {folder}} cannot be written.", call = call)
  if (kind == "htm") "html" else kind
}

check_report_tools <- function(call = rlang::caller_env()) {
  if (!requireNamespace("rmarkdown", quietly = TRUE)) {
    abort_input(c("A report needs the R package {.pkg rmarkdown}, which is not installed.",
                  i = "Run {.code install.packages(\"rmarkdown\")}."), call = call)
  }
  # A pandoc that cannot be started, for lack of memory perhaps, is an error there.
  if (!tryCatch(rmarkdown::pandoc_available("2.0"), error = function(e) FALSE)) {
    abort_input(c("A report needs pandoc 2.0 or later, which was not found or cannot be started.",
                  i = paste("Install it (Debian: {.code apt-get install pandoc}; others:",
                            "{.url https://pandoc.org/installing.html}), or work in RStudio, which",
                            "brings it.")), call = call)
  }
}

# The parts of a template, each from its mark to the next.
template_parts <- function(x) {
  kind <- if (inherits(x, "amiss_upgrade")) "diagnosis"
          else if (inherits(x, "amiss_comparison")) "comparison"
          else if (inherits(x, "amiss_survey")) "survey"
          else "calibration"
  text <- readLines(report_path("parts", paste0(kind, ".Rmd")), encoding = "UTF-8")
  mark <- "^<!-- part: (.*) -->$"
  starts <- grep(mark, text)
  part <- findInterval(seq_along(text), starts)
  parts <- lapply(seq_along(starts), function(i) text[part == i][-1])
  stats::setNames(parts, sub(mark, "\\1", text[starts]))
}

# What the chunks of a template see: the result, what is said of it, and the package's own
# functions.
report_environment <- function(x) {
  list2env(c(list(result = x), report_content(x)), parent = environment(report))
}

# What the templates show besides the result itself.
report_content <- function(x) UseMethod("report_content")

# Copied beside its destination and renamed: a reader never meets half a file.
move_into_place <- function(made, file, call = rlang::caller_env()) {
  part <- tempfile(".amiss-report-", tmpdir = dirname(file))
  on.exit(unlink(part))
  if (!file.copy(made, part) || !file.rename(part, file)) {
    abort_input("The report could not be written to {.file {file}}.", call = call)
  }
}
