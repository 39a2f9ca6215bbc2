#' Run a study from its file
#'
#' `read_study()` checks a study and prepares the pieces. `run_study()` does the work and writes the
#' results.
#'
#' A study is a YAML file. It says what was measured, which rows calibrate and validate, what is to
#' be done with which models (R files that return them), and the control. Paths in the file are
#' relative to the file.
#'
#' * A study that names a `model` and a `catalogue` runs the loop of [upgrade_model()].
#' * A study that names `models` compares them by [compare_models()].
#'
#' # Fields
#'
#' Every study needs `study`, `data`, `time`, `target` and `boundary`. It also needs `model` with
#' `catalogue`, or `models`. R files are evaluated in their own folder.
#'
#' * `study`: a name.
#' * `data`: a table (see *Tables*) or an R file whose value is a data frame; `separator` and
#'   `decimal` of the table.
#' * `time`, `target`, `boundary`: columns of `data`. `boundary` is a list, with `circular(Wd)` for
#'   degrees. A condition may have a label and a unit, which people read in its place: `Gv: {label:
#'   sun from the south, unit: W/m2}`, and `circular: true` for degrees.
#' * `calibrate` and `validate`: conditions in the columns of the data.
#' * `noise_sd`, `unit`, `label`, `time_format`, `time_zone`, `stamp`: as in [measurements()].
#' * `average_h` (the step of the data if it is not given), `warmup_h` and `fill_gaps_h` (0): in
#'   hours.
#' * `missing`: codes for a missing value, as `[-9999, 85]`, or `none`.
#' * `range`: ends of the target's sensor, as `[-.inf, 27]`.
#' * `title` (that of `study`), `seed`, `control` and `runs`: as in [upgrade_model()] or
#'   [compare_models()] (150 runs).
#' * `model`, `catalogue`: R files. Their value may also be a function of the [measurements()] that
#'   returns the piece. A study can thus have given runs ([ensemble()]) as its model, and
#'   [responses()] as its catalogue.
#' * `models`: an R file whose value is a named list of simulators.
#' * `method` (`paper`) of a comparison: `paper` or `history`.
#' * `truth` of a comparison, if the record is synthetic: an R file whose value is a list of a
#'   `simulator` and its `values`.
#'
#' # Several records
#'
#' `records` maps the name of each record to the fields that it has of its own. A record may have
#' its own model and all fields that say what was measured. Fields outside `records` are for all
#' records that do not say otherwise.
#'
#' The value of a `model` may also be a list of simulators by the names of the records
#' ([outputs_of()]). A catalogue that is a function gets the list of measurements. The loop is then
#' that of [upgrade_model()] over several records.
#'
#' # Syntax
#'
#' The file is UTF-8 and holds one YAML document without tags. Only the words `true` and `false` are
#' logical. Numbers are those of YAML 1.2: `1e-3` is a number, `017` is 17, `1:30` is text.
#'
#' Conditions are no R code. They may hold columns, numbers, texts in quotes, comparisons, `&`, `|`,
#' `!`, brackets, the four operations of arithmetic and `%in% c(...)`. Texts are compared as in
#' [measurements()]. A condition that begins with `!` needs quotes around it: `validate: '!(hour >
#' 72)'`.
#'
#' @section Results: *result.json* of a loop has these fields; what is not there is `null`:
#'   * `schema`, `study`, `seed`, `wall_s` (seconds), `runs_total`, `stopped_because`.
#'   * `diagnosis`: `verdict` (`"named"`, `"likely"`, `"unexplained"` or `"nothing"`), `tag`,
#'     `headline`.
#'   * `named_cause`: also a likely cause; `null` if there is none.
#'   * `gain`: `log10_bf`, `interval` and the scores of the first and the last model.
#'   * `candidates`: as in [upgrade_model()].
#'   * `models`: see below.
#'
#'   Each of the `models` has
#'   * `name`, `parent`, `mechanism`.
#'   * `N` rows, `M` runs, `Q` basis vectors.
#'   * its evidence, `trusted` and why (`trust`).
#'   * `verdict`, `doubts`, `confounded_with`, `held_out_gain`.
#'   * `step_error`: what shorter steps of the simulator change, as in [upgrade_model()].
#'   * `emulator_error`, `emulator_ratio`, `emulator_checked`: what the check by runs said.
#'   * `refinements`, `reach`, scores and `attribution`.
#'   * `parameters`: median and 95 % interval of each, and where its physical value lies
#'     (`physical_lower`, `physical_upper`, of all its modes together).
#'
#'   If the command `amiss` ends with status 0, the work was done. It does not mean that a cause was
#'   found or that numbers are trusted.
#'
#' @section Tables: The table in `data` is a text file, which may be compressed (`.gz`). Its header
#'   is the line that holds `time`, `target` and `boundary`. What stands above it is left out, and
#'   so are lines that begin with `#` and rows of units below the header.
#'
#'   Fields are separated by commas, semicolons, tabs, bars or spaces, whichever separates the names
#'   in the header. If that fails, give `separator`: `comma`, `semicolon`, `tab`, `bar`, `space`, or
#'   the sign itself. Decimals may have a comma. If columns disagree, `decimal` says `","` or `"."`,
#'   and the other sign then separates thousands. Exponents may be `E` or `D`.
#'
#'   Empty fields and words like `NA`, `NaN` and `null` are missing values. A column without a
#'   name gets that of its place, like `column_1`. A row with more or fewer fields than the
#'   header has names is an error. Text that is not UTF-8 is read as UTF-16 or Windows-1252, with a
#'   message.
#'
#' @param path The YAML file.
#' @param out Folder for the results: `report.html`, `figures/`, `result.rds`, `result.json` (see
#'   *The folder of results*). `NULL` writes nothing.
#' @param seed Overrides the seed of the file. With neither, R's generator draws one, which is kept
#'   with the stages.
#' @param threads Number of threads; results do not depend on it.
#' @param quiet No progress messages.
#' @param trust Whether the R files that the study names may run, and files outside its folder be
#'   read: both can do whatever you can. If not, the study is refused, or you are asked at a
#'   terminal. Studies that ship with the package need no trust.
#' @return `run_study()`: the result of [upgrade_model()] or [compare_models()], with `study`,
#'   `title` and `wall_s`, invisibly. `read_study()`: a list of class
#'   `amiss_study`, which prints itself as a person reads a study, of
#'   * `study`, `title`, `seed`, `runs`, `control`;
#'   * `measurements`: for several records a named list;
#'   * `model` and `catalogue`, or `models`, `method` and `truth`.
#' @section The folder of results: The folder is filled only when all is computed. Until then its
#'   folder `stages` holds the finished models. If the study was interrupted, the same call goes on
#'   from there, as long as the code of the study's R files is the same. One run at a time can use
#'   the folder.
#'
#'   What has the names of the results before, such as earlier results, is moved into a folder
#'   `earlier-` with the time. If the report or a figure cannot be made, a warning
#'   (`amiss_warning_missing`) says which and why. The others are written, and the same call makes
#'   what is missing.
#' @seealso `help("amiss-package")` for options that a batch job may set, and for the classes of
#'   conditions.
#' @examples
#' study <- read_study(system.file("studies", "twinhouse_O5.yml", package = "amiss"))
#' study
#' study$measurements
#' @export
run_study <- function(path, out = NULL, seed = NULL, threads = 1, quiet = FALSE, trust = FALSE) {
  check_arguments()
  hush(quiet)
  started <- elapsed()
  if (!is.null(out)) check_input(checkmate::check_string(out, min.chars = 1), "out")
  if (!is.null(seed)) pick_seed(seed)
  check_threads(threads)
  study <- read_study(path, quiet, trust)
  stages <- NULL
  if (!is.null(out)) {
    check_report_tools()
    held <- hold_folder(out)
    on.exit(release_folder(held), add = TRUE)  # after what hush() undoes
    stages <- file.path(out, "stages", study$code)
  }
  seed <- kept_seed(seed %||% study$seed, stages)
  result <- staged(paste("study", study$study), if (is.null(study$models)) {
    upgrade_model(study$model, study$measurements, study$catalogue, runs = study$runs,
                  control = study$control, seed = seed, threads = threads, quiet = quiet,
                  checkpoint = stages)
  } else {
    compare_models(study$models, study$measurements, study$method, runs = study$runs %||% 150,
                   control = study$control, seed = seed, threads = threads, quiet = quiet,
                   checkpoint = stages, truth = study$truth)
  })
  result$study <- study$study
  result$title <- study$title
  result$wall_s <- elapsed() - started
  if (!is.null(out)) {
    missing <- write_study(result, out, quiet)
    if (!length(missing)) remove_stages(file.path(out, "stages"))
  }
  invisible(result)
}

#' @rdname run_study
#' @export
read_study <- function(path, quiet = TRUE, trust = FALSE) {
  check_arguments()
  check_input(checkmate::check_string(path, min.chars = 1), "path")
  check_input(checkmate::check_file_exists(path, access = "r"), "path")
  check_input(checkmate::check_flag(quiet), "quiet")
  check_input(checkmate::check_flag(trust), "trust")
  study <- read_study_file(path)
  records <- study_records(study, path)
  folder <- dirname(normalizePath(path))
  of_each <- lapply(records, study_files, folder)
  files <- do.call(c, unname(of_each))
  files <- files[!duplicated(paste(names(files), files))]
  require_trust(files, folder, trust)
  measure <- function() Map(function(record, files, name) {
    naming_record(name, study_measurements(record, files))
  }, records, of_each, names(records) %||% "")
  measured <- if (quiet) suppressMessages(measure(), classes = "amiss_message_gap") else measure()
  if (is.null(study$records)) measured <- measured[[1]]
  pieces <- if (is.null(study$models)) upgrade_pieces(of_each, measured)
            else comparison_pieces(files, study$method)
  code <- content_hash(lapply(files[is_code(files)], study_code))
  read <- c(list(study = study$study, title = study$title %||% study$study, seed = study$seed,
                 runs = study$runs, control = study$control),
            pieces, list(measurements = measured, code = code))
  check_study_control(read)
  if (!is.null(study$seed)) pick_seed(study$seed)
  structure(read, class = "amiss_study")
}

#' @rdname run_study
#' @param x A study that was read.
#' @param ... Not used.
#' @export
print.amiss_study <- function(x, ...) on_stdout(x, {
  compares <- !is.null(x[["models"]])
  about <- if (x$title != x$study) paste0(": ", as_said(x$title))
  cli::cli_text("{.strong Study} {.val {x$study}}", about)
  say_bullets(if (compares) {
    sprintf("asked: which of %d models is the most probable (method \"%s\")", length(x$models),
            x$method)
  } else "asked: which mechanisms of the catalogue the model lacks, and what it gains by them")
  records <- in_list(x$measurements)
  say_bullets(unlist(Map(record_lines, records, rlang::names2(records))))
  models <- if (compares) x$models else in_list(x$model)
  say_bullets(sub("model : ", "model: ", paste("model", model_lines(models)), fixed = TRUE))
  if (!compares)
    cli::cli_bullets(c("*" = "{length(x$catalogue)} mechanism{?s}: {names(x$catalogue)}"))
  defaults <- if (compares) c(runs = 150, comparison_control) else upgrade_control
  options <- option_words(changed_options(c(x[c("runs", "seed")], x$control), defaults))
  say_bullets(c(if (length(options)) paste("options:", paste(options, collapse = ", ")),
                if (!is.null(x$truth)) "the truth is known"))
  piece <- if (compares) "compare_models" else "upgrade_model"
  cli::cli_bullets(c(">" = "next: {.fun run_study} of its file, or {.fun {piece}} of its pieces"))
})

# A record in a few lines; `name` is "" if there is only one.
record_lines <- function(m, name) {
  count <- function(use) sum(m$use == use & !is.na(m$y))
  held_out <- count("validate")
  of <- if (nzchar(name)) paste0(name, ": ") else ""
  at <- paste0(if (is.numeric(m$time)) "hour ", format(m$time[c(1, length(m$time))], trim = TRUE))
  c(sprintf("%srecord of %d rows of %s h, from %s to %s: %d calibrate, %s", of, length(m$y),
            format(m$step_h, digits = 3), at[1], at[2], count("calibrate"),
            if (held_out) paste(held_out, "validate") else "none held out"),
    sprintf("%starget %s, noise %s; boundary conditions %s", of,
            axis_label(target_label(m), m$unit),
            trimws(paste(signif(m$noise_sd, 3), pretty_unit(m$unit))), listed(condition_titles(m))))
}

# A model, or several by their names, each in a line.
model_lines <- function(models) {
  what <- vapply(models, function(model) {
    kind <- switch(class(model)[1], amiss_zone = "a zone", amiss_network = "a network",
                   amiss_function_simulator = "an R function",
                   amiss_program_simulator = "a program", amiss_fmu_simulator = "an FMU",
                   amiss_ensemble = "given runs", class(model)[1])
    free <- if (inherits(model, "amiss_ensemble")) model$parameters else free_parameters(model)
    sprintf("%s with %d free parameter%s", kind, length(free), if (length(free) == 1) "" else "s")
  }, "")
  paste0(rlang::names2(models), ": ", what)
}

# Options given that are not what they would be anyway. Defaults of the stages may depend on the
# record; what is given of them is shown as it is.
changed_options <- function(options, defaults) {
  same <- vapply(names(options), function(name) {
    name %in% names(defaults) && isTRUE(all.equal(options[[name]], defaults[[name]]))
  }, NA)
  options[!same]
}

# Options as a person writes them, one in another by its path: `calibration$ais$groups = 4`.
option_words <- function(options, path = "") {
  unlist(lapply(names(options), function(name) {
    value <- options[[name]]
    if (rlang::is_bare_list(value) && rlang::is_named(value))
      return(option_words(value, paste0(path, name, "$")))
    if (is.integer(value)) value <- as.numeric(value)  # without an L
    if (!is.null(value)) paste0(path, name, " = ", deparse1(value))
  }))
}
