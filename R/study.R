study_fields <- list(
  needed = c("study", "data", "time", "target", "boundary"),
  upgrade = c("model", "catalogue"),
  comparison = c("models", "method", "truth"),
  optional = c("noise_sd", "average_h", "calibrate", "validate", "warmup_h", "unit", "label",
               "time_format", "time_zone", "stamp", "fill_gaps_h", "missing", "range", "separator",
               "decimal", "runs", "seed", "control", "title", "records"))

# What each of several records may have of its own.
record_fields <- c("data", "time", "target", "boundary", "model", "noise_sd", "average_h",
                   "calibrate", "validate", "warmup_h", "unit", "label", "time_format", "time_zone",
                   "stamp", "fill_gaps_h", "missing", "range", "separator", "decimal")

# Fields that name a file. All but the data are R files.
file_fields <- c("data", "model", "catalogue", "models", "truth")

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
#'     (`physical_lower`, `physical_upper`, as `tidy()` of a calibration has them).
#'
#'   If the command `amiss` ends with status 0, the work was done. It does not mean that a cause was
#'   found or that numbers are trusted.
#'
#' @section Tables: The table in `data` is a text file. Its header is the line that holds `time`,
#'   `target` and `boundary`. What stands above it is left out, and so are lines that begin with `#`
#'   and rows of units below the header.
#'
#'   Fields are separated by commas, semicolons, tabs, bars or spaces, whichever separates the names
#'   in the header. If that fails, give `separator`: `comma`, `semicolon`, `tab`, `bar`, `space`, or
#'   the sign itself. Decimals may have a comma. If columns disagree, `decimal` says `","` or `"."`,
#'   and the other sign then separates thousands. Exponents may be `E` or `D`.
#'
#'   Empty fields and words such as `NA`, `NaN` and `null` are missing values. A column without a
#'   name gets that of its place, such as `column_1`. A row with more or fewer fields than the
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
#'   read: both can do whatever you can. If not, such a study is refused, or you are asked at a
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
  check_study_control(study)
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
  structure(c(list(study = study$study, title = study$title %||% study$study, seed = study$seed,
                   runs = study$runs, control = study$control),
              pieces, list(measurements = measured, code = code)), class = "amiss_study")
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

# The fields of each record, checked; of a study without `records` its own.
study_records <- function(study, path, call = rlang::caller_env()) {
  if (!is.list(study) || !checkmate::test_named(study, "unique") || is.null(study$records)) {
    check_study_fields(study, path, call = call)
    return(list(study))
  }
  own <- study$records
  if (!is.list(own) || !length(own) || !checkmate::test_named(own, "unique") ||
      !all(vapply(own, function(x) is.null(x) || checkmate::test_list(x, names = "unique"), NA))) {
    abort_input(
      c("{.field records} of the study file {.file {path}} is no mapping of names to fields.",
        i = "Write the name of each record, and indented below it what is its own."), call = call)
  }
  foreign <- intersect(names(study), study_fields$comparison)
  if (length(foreign)) {
    abort_input(c("The study file {.file {path}} has {.field records} and {.field {foreign}}.",
                  i = paste("Several records go through the loop only: name {.field model} and",
                            "{.field catalogue}.")), call = call)
  }
  Map(function(fields, name) {
    unknown <- setdiff(names(fields), record_fields)
    if (length(unknown)) {
      abort_input(c(paste("The record {.val {name}} of the study file {.file {path}} has",
                          "{cli::qty(unknown)}unknown field{?s} {.field {unknown}}."),
                    i = "What a record can have of its own: {.field {record_fields}}."),
                  call = call)
    }
    record <- study[names(study) != "records"]
    record[names(fields)] <- fields
    check_study_fields(record, path, paste0(", record \"", name, "\","), call)
    record$study <- name
    record
  }, own, names(own))
}

# An error in one of several records says in which.
naming_record <- function(name, code, call = rlang::caller_env()) {
  if (!nzchar(name)) return(code)
  tryCatch(code, amiss_error_input = function(e) {
    abort_input(c("The record {.val {name}} cannot be read.", x = "{conditionMessage(e)}"),
                call = call)
  })
}

study_measurements <- function(study, files) {
  data <- study_data(study, files[["data"]])
  rows <- function(field) {
    if (!is.null(study[[field]]))
      structure(list(text = study[[field]]), class = "amiss_row_condition")
  }
  measurements(
    data, time = study$time, target = study$target, boundary = study_boundary(study$boundary),
    noise_sd = study$noise_sd, average = study$average_h,
    calibrate = rows("calibrate"), validate = rows("validate"),
    warmup = study$warmup_h %||% 0, name = study$study, unit = study$unit %||% "",
    time_format = study$time_format, time_zone = study$time_zone, stamp = study$stamp,
    label = study$label, fill_gaps = study$fill_gaps_h %||% 0,
    missing = if (identical(study$missing, "none")) NA else unlist(study$missing),
    range = unlist(study$range))
}

# The options that can be checked before anything is computed.
check_study_control <- function(study, call = rlang::caller_env()) {
  if (is.null(study$models)) fill_upgrade_control(study$control, study$measurements, call)
  else fill_comparison_control(study$control, study$measurements, study$method, call)
}

# `of`: the record in words, if the fields are of one of several.
check_study_fields <- function(study, path, of = "", call = rlang::caller_env()) {
  if (!is.list(study) || !checkmate::test_named(study, "unique")) {
    abort_input(c("The study file {.file {path}} is no mapping of fields to values.",
                  i = "Write a line for each field, as {.code target: Ti}, each field once."),
                call = call)
  }
  unknown <- setdiff(names(study), unlist(study_fields))
  if (length(unknown)) {
    abort_input(c(paste("The study file {.file {path}} has {cli::qty(unknown)}unknown field{?s}",
                        "{.field {unknown}}."),
                  i = "Known fields: {.field {unlist(study_fields, use.names = FALSE)}}."),
                call = call)
  }
  compares <- "models" %in% names(study)
  foreign <- intersect(names(study),
                       if (compares) study_fields$upgrade else study_fields$comparison)
  if (length(foreign)) {
    partner <- if (compares) "catalogue" else "models"
    abort_input(c(paste("The study file {.file {path}} has {cli::qty(foreign)}field{?s}",
                        "{.field {foreign}}, which {?goes/go} with {.field {partner}} only."),
                  i = "Name either {.field model} and {.field catalogue}, or {.field models}."),
                call = call)
  }
  absent <- setdiff(c(study_fields$needed, if (!compares) study_fields$upgrade), names(study))
  if (length(absent)) {
    abort_input(
      c("The study file {.file {path}}{of} lacks {cli::qty(absent)}field{?s} {.field {absent}}.",
        i = if (any(absent %in% study_fields$upgrade))
              "Or name {.field models}, to compare several."), call = call)
  }
  for (field in c("study", "title", "unit", "label", "time", "target")) {
    check_input(checkmate::check_string(study[[field]],
                                        null.ok = field %in% c("title", "unit", "label")),
                field, "Numbers and dates are text in quotes only.", call = call)
  }
}

# The files that a study names, by their fields.
study_files <- function(study, folder, call = rlang::caller_env()) {
  fields <- intersect(file_fields, names(study))
  vapply(fields, function(field) study_path(study[[field]], folder, field, call), "")
}

# R files are code that their author asks to run.
is_code <- function(files) names(files) != "data" | grepl("\\.[rR]$", files)

# A study may read data in its folder, and what ships with the package; all else asks for trust.
require_trust <- function(files, folder, trust, call = rlang::caller_env()) {
  shipped <- normalizePath(system.file("studies", package = "amiss"))
  outside <- !fs::path_has_parent(normalizePath(files), folder)
  if (trust || folder == shipped || !any(is_code(files) | outside)) return(invisible())
  code <- files[is_code(files)]
  other <- files[outside & !is_code(files)]
  if (rlang::is_interactive()) {
    question <- paste0("The study asks to use these files, which can do whatever you can:\n",
                       paste(c(code, other), collapse = "\n"), "\nTrust it?")
    if (isTRUE(utils::askYesNo(question, default = FALSE))) return(invisible())
  }
  cli::cli_abort(
    c("The study asks for trust that was not given.",
      x = if (length(code)) "{cli::qty(code)}It runs the R code of {.file {code}}.",
      x = if (length(other)) "{cli::qty(other)}It reads {.file {other}}, outside its folder.",
      i = paste("If you trust its author, say {.code trust = TRUE}, or {.code --trust} on the",
                "command line.")),
    class = c("amiss_error_trust", "amiss_error_input", "amiss_error"), call = short_call(call))
}

# What `boundary` of a study file holds as measurements() takes it: names, and what is said of
# each.
study_boundary <- function(boundary, call = rlang::caller_env()) {
  each <- unlist(lapply(seq_along(boundary), function(k) {
    one <- boundary[k]
    if (is.list(one[[1]]) && !nzchar(rlang::names2(one))) one[[1]] else as.list(one)
  }), recursive = FALSE)
  if (is.null(names(each))) return(as.character(unlist(each)))
  Map(function(one, name) {
    if (!nzchar(name)) return(as.character(one))
    known <- names(formals(condition))
    unknown <- setdiff(rlang::names2(one), known)
    if (!is.list(one) || length(unknown) || is.null(one$label)) {
      abort_input(c(paste("{.field boundary}: {.val {name}} needs a {.field label}, and may have",
                          "{.field {known[-1]}}."),
                    i = "For example {.code {name}: {{label: outdoor air, unit: degC}}}."),
                  call = call)
    }
    if (is.character(one$circular)) one$circular <- switch(one$circular, yes = TRUE, no = FALSE)
    do.call(condition, as.list(one))
  }, each, names(each))
}

study_data <- function(study, path, call = rlang::caller_env()) {
  if (is_code(c(data = path))) {
    data <- source_value(path, "data", call)
    check_input(checkmate::check_data_frame(data), "data", "Let the R file end with a data frame.",
                call = call)
    return(data)
  }
  conditions <- boundary_terms(study_boundary(study$boundary), call)$name
  read_table_file(path, c(study$time, study$target, conditions), study$separator,
                  study$decimal, call)
}

# `files`: those of each record.
upgrade_pieces <- function(files, measurements, call = rlang::caller_env()) {
  several <- !is.object(measurements)
  model <- if (several) record_models(files, measurements, call)
           else source_value(files[[1]][["model"]], "model", call, measurements)
  for (one in if (several) model else list(model))
    if (!inherits(one, "amiss_ensemble")) check_simulator(one, call)
  catalogue <- source_value(files[[1]][["catalogue"]], "catalogue", call, measurements)
  check_object(catalogue, "amiss_catalogue", "catalogue", call = call)
  attr(catalogue, "labels") <- record_labels(measurements)  # for people who print it
  list(model = model, catalogue = catalogue)
}

# A file that several records name is evaluated once, so that simulators that share their runs go on
# doing so.
record_models <- function(files, measurements, call) {
  paths <- vapply(files, `[[`, "", "model")
  made <- lapply(stats::setNames(nm = unique(paths)), source_value, "model", call)
  Map(function(path, name) {
    value <- made[[path]]
    if (is.function(value)) return(source_value(path, "model", call, measurements[[name]]))
    if (!rlang::is_bare_list(value)) return(value)
    if (!name %in% names(value)) {
      abort_input(c(paste("The {.field model} file {.file {path}} has no simulator of the record",
                          "{.val {name}}."), i = "Those of its list are of {.val {names(value)}}."),
                  call = call)
    }
    value[[name]]
  }, paths, names(paths))
}

comparison_pieces <- function(files, method, call = rlang::caller_env()) {
  models <- source_value(files[["models"]], "models", call)
  check_models(models, call)
  method <- method %||% "paper"
  check_input(checkmate::check_choice(method, comparison_methods), "method", call = call)
  truth <- if ("truth" %in% names(files)) source_value(files[["truth"]], "truth", call)
  check_truth(truth, call)
  list(models = models, method = method, truth = truth)
}

study_path <- function(path, folder, field, call = rlang::caller_env()) {
  check_input(checkmate::check_string(path, min.chars = 1), field, call = call)
  full <- if (grepl("^(/|~|[A-Za-z]:)", path)) path else file.path(folder, path)
  if (!file.exists(full)) {
    abort_input(c("The {.field {field}} file {.file {full}} does not exist.",
                  i = "Paths in a study file are relative to that file."), call = call)
  }
  full
}

# The value of the last expression of an R file, evaluated in its folder, where it sees the package
# and nothing of the session. Where it is a function and the measurements are known, what it makes
# of them.
source_value <- function(path, field, call = rlang::caller_env(), measurements = NULL) {
  tryCatch(sys.source_value(path, measurements), error = function(e) {
    if (inherits(e, "amiss_error")) stop(e)
    abort_input(c("The {.field {field}} file {.file {path}} stopped with an error.",
                  x = "{conditionMessage(e)}"), call = call)
  })
}

sys.source_value <- function(path, measurements = NULL) {
  scope <- new.env(parent = new.env(parent = asNamespace("amiss")))
  code <- study_code(path)
  before <- setwd(dirname(path))
  on.exit(setwd(before))
  value <- NULL
  for (expression in code) value <- eval(expression, scope)
  if (is.function(value) && !is.null(measurements)) value(measurements) else value
}

# The parsed expressions of an R file: its comments and layout make no difference.
study_code <- function(path)
  as.list(parse(text = read_utf8(path, "code"), keep.source = FALSE, encoding = "UTF-8"))
