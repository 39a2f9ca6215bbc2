# A study file's parts: its records, their data and conditions, and what R files give.

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
