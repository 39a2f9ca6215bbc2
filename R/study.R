study_fields <- list(
  needed = c("study", "data", "time", "target", "boundary"),
  upgrade = c("model", "catalogue"),
  comparison = c("models", "method", "truth"),
  optional = c("noise_sd", "average_h", "calibrate", "validate", "warmup_h", "unit", "runs", "seed", "control", "title"))

#' Run a study from its file
#'
#' A study is a YAML file: what was measured, which rows calibrate and validate, what is to be done with which models
#' (R files that return them), and the control. `read_study()` checks it and prepares the pieces; `run_study()` does the
#' work and writes the results. Paths in the file are relative to the file.
#'
#' A study that names a `model` and a `catalogue` runs the loop of [upgrade_model()]; one that names `models` (an R file
#' whose value is a named list of simulators) compares them by [compare_models()], with `method` (`paper` or `history`)
#' and, where the record is synthetic, `truth` (an R file whose value is a list of a `simulator` and its `values`).
#'
#' The other fields are `study` (name), `data` (CSV file, or an R file whose value is a data frame), `time`, `target`,
#' `boundary` (list; `circular(Wd)` for degrees), and, if wanted, `title`, `unit` (of the target), `noise_sd`, `average_h`,
#' `warmup_h` (hours), `calibrate`, `validate` (expressions in the columns of the data), `runs`, `seed` and `control` (as in
#' [upgrade_model()] or [compare_models()]). R files are evaluated in their own folder.
#'
#' @param path The YAML file.
#' @param out Folder for the results: `report.html`, `figures/`, `result.rds`, `result.json`. `NULL` writes nothing. It is
#'   filled only when all is computed; until then its folder `stages` holds the finished models, and the same call goes on
#'   from there if it was interrupted.
#' @param seed Overrides the seed of the file.
#' @param threads Number of threads; results do not depend on it.
#' @param quiet No progress messages.
#' @return `run_study()`: the result of [upgrade_model()] or [compare_models()], invisibly; `read_study()`: a list of the
#'   study's pieces.
#' @examples
#' read_study(system.file("studies", "twinhouse_O5.yml", package = "amiss"))$measurements
#' @export
run_study <- function(path, out = NULL, seed = NULL, threads = 1, quiet = FALSE) {
  started <- proc.time()[["elapsed"]]
  study <- read_study(path, quiet)
  if (!is.null(out)) {
    check_report_tools()
    check_out(out)
  }
  seed <- pick_seed(seed %||% study$seed)
  stages <- if (!is.null(out)) file.path(out, "stages")
  result <- if (is.null(study$models)) {
    upgrade_model(study$model, study$measurements, study$catalogue, runs = study$runs, control = study$control,
                  seed = seed, threads = threads, quiet = quiet, checkpoint = stages)
  } else {
    compare_models(study$models, study$measurements, study$method, runs = study$runs, control = study$control,
                   seed = seed, threads = threads, quiet = quiet, checkpoint = stages, truth = study$truth)
  }
  result$study <- study$study
  result$title <- study$title
  result$wall_s <- proc.time()[["elapsed"]] - started
  if (!is.null(out)) {
    write_study(result, out, quiet)
    unlink(stages, recursive = TRUE)
  }
  invisible(result)
}

#' @rdname run_study
#' @export
read_study <- function(path, quiet = TRUE) {
  check_input(checkmate::check_file_exists(path, access = "r"), "path")
  study <- tryCatch(yaml::read_yaml(path), error = function(e) {
    abort_input(c("The study file {.file {path}} cannot be read as YAML.", x = "{conditionMessage(e)}"))
  })
  check_study_fields(study, path)
  folder <- dirname(normalizePath(path))
  data <- study_data(study_path(study$data, folder, "data"))
  measure <- function() {
    measurements(data, time = study$time, target = study$target, boundary = as.character(unlist(study$boundary)),
                 noise_sd = study$noise_sd, average = study$average_h, calibrate = study$calibrate, validate = study$validate,
                 warmup = study$warmup_h %||% 0, name = study$study, unit = study$unit %||% "")
  }
  pieces <- if (is.null(study$models)) upgrade_pieces(study, folder) else comparison_pieces(study, folder)
  c(list(study = study$study, title = study$title %||% study$study, seed = study$seed, runs = study$runs %||% 150, control = study$control),
    pieces, list(measurements = if (quiet) suppressMessages(measure(), classes = "amiss_message_gap") else measure()))
}

check_study_fields <- function(study, path, call = rlang::caller_env()) {
  if (!is.list(study)) abort_input("The study file {.file {path}} holds no fields.", call = call)
  unknown <- setdiff(names(study), unlist(study_fields))
  if (length(unknown)) {
    abort_input(c("The study file {.file {path}} has {cli::qty(unknown)}unknown field{?s} {.field {unknown}}.",
                  i = "Known fields: {.field {unlist(study_fields, use.names = FALSE)}}."), call = call)
  }
  compares <- "models" %in% names(study)
  foreign <- intersect(names(study), if (compares) study_fields$upgrade else study_fields$comparison)
  if (length(foreign)) {
    partner <- if (compares) "catalogue" else "models"
    abort_input(c("The study file {.file {path}} has {cli::qty(foreign)}field{?s} {.field {foreign}}, which {?goes/go} with {.field {partner}} only.",
                  i = "Name either {.field model} and {.field catalogue}, or {.field models}."), call = call)
  }
  absent <- setdiff(c(study_fields$needed, if (!compares) study_fields$upgrade), names(study))
  if (length(absent)) {
    abort_input(c("The study file {.file {path}} lacks {cli::qty(absent)}field{?s} {.field {absent}}.",
                  i = if (any(absent %in% study_fields$upgrade)) "Or name {.field models}, to compare several."), call = call)
  }
}

study_data <- function(path, call = rlang::caller_env()) {
  if (grepl("\\.[rR]$", path)) {
    data <- source_value(path, "data", call)
    check_input(checkmate::check_data_frame(data), "data", "Let the R file end with a data frame.", call = call)
    return(data)
  }
  tryCatch(utils::read.csv(path, stringsAsFactors = FALSE, check.names = FALSE), error = function(e) {
    abort_input(c("The data file {.file {path}} cannot be read.", x = "{conditionMessage(e)}"), call = call)
  })
}

upgrade_pieces <- function(study, folder, call = rlang::caller_env()) {
  model <- source_value(study_path(study$model, folder, "model", call), "model", call)
  check_simulator(model, call)
  catalogue <- source_value(study_path(study$catalogue, folder, "catalogue", call), "catalogue", call)
  check_input(checkmate::check_class(catalogue, "amiss_catalogue"), "catalogue", call = call)
  list(model = model, catalogue = catalogue)
}

comparison_pieces <- function(study, folder, call = rlang::caller_env()) {
  models <- source_value(study_path(study$models, folder, "models", call), "models", call)
  check_models(models, call)
  method <- study$method %||% "paper"
  check_input(checkmate::check_choice(method, comparison_methods), "method", call = call)
  truth <- if (!is.null(study$truth)) source_value(study_path(study$truth, folder, "truth", call), "truth", call)
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

# The value of the last expression of an R file, evaluated in its folder, where it sees the package and nothing of the
# session.
source_value <- function(path, field, call = rlang::caller_env()) {
  tryCatch(sys.source_value(path), error = function(e) {
    if (inherits(e, "amiss_error")) stop(e)
    abort_input(c("The {.field {field}} file {.file {path}} stopped with an error.", x = "{conditionMessage(e)}"), call = call)
  })
}

sys.source_value <- function(path) {
  source(path, local = new.env(parent = new.env(parent = asNamespace("amiss"))), chdir = TRUE)$value
}

check_out <- function(out, call = rlang::caller_env()) {
  check_input(checkmate::check_string(out, min.chars = 1), "out", call = call)
  made <- !dir.exists(out) && suppressWarnings(dir.create(out, recursive = TRUE))
  probe <- file.path(out, "probe")
  usable <- dir.exists(out) && suppressWarnings(file.create(probe))
  unlink(if (made) out else probe, recursive = TRUE)
  if (!usable) {
    abort_input(c("{.arg out} = {.file {out}} is not a folder that can be written.", i = "Name another folder; it is made if it does not exist."), call = call)
  }
}

# Everything is made elsewhere, copied into the folder and renamed when complete: nothing half-written stays.
write_study <- function(result, out, quiet = FALSE) {
  work <- tempfile("amiss-")
  dir.create(file.path(work, "figures"), recursive = TRUE)
  dir.create(out, recursive = TRUE, showWarnings = FALSE)
  staging <- file.path(out, basename(work))
  on.exit(unlink(c(work, staging), recursive = TRUE))
  save_figures(result, file.path(work, "figures"))
  saveRDS(result, file.path(work, "result.rds"))
  jsonlite::write_json(result_list(result), file.path(work, "result.json"), auto_unbox = TRUE, digits = NA,
                       null = "null", na = "null", pretty = TRUE)
  report(result, file.path(work, "report.html"))
  if (!file.copy(work, out, recursive = TRUE)) abort_input("The results could not be copied into {.file {out}}.")
  for (name in dir(work)) {
    unlink(file.path(out, name), recursive = TRUE)
    if (!file.rename(file.path(staging, name), file.path(out, name))) abort_input("{.file {name}} could not be moved into {.file {out}}.")
  }
  if (!quiet) cli::cli_alert_success("Written to {.file {out}}: report.html, figures/, result.rds, result.json")
}

# The result as plain lists, with the fields of result.json.
result_list <- function(x) UseMethod("result_list")

table_rows <- function(table) lapply(seq_len(NROW(table)), function(i) as.list(table[i, , drop = FALSE]))

#' @export
result_list.amiss_upgrade <- function(x) {
  model_list <- function(model) {
    fit <- model$fit
    list(name = model$name, parent = model$parent, mechanism = model$mechanism, Q = ncol(fit$emulator$basis$vectors),
         N = length(fit$rows), M = nrow(fit$emulator$processes$inputs), noise_sd = fit$measurements$noise_sd,
         discarded_rms = fit$emulator$basis$discarded_rms, log10_evidence = fit$log_evidence / log(10),
         log10_evidence_interval = fit$interval / log(10), trusted = fit$trust$trusted, trust = fit$trust$verdict,
         verdict = model$verdict, doubts = as.list(model$doubts), confounded_with = as.list(model$confounded_with),
         held_out_gain = model$held_out_gain[c("mean", "standard_error")], emulator_error = fit$check$error, emulator_ratio = fit$check$ratio,
         emulator_checked = fit$check$passed, refinements = fit$rounds, reach = as.list(fit$reach),
         rmse_calibration = model$scores$calibrate[["rmse"]], rmse_validation = model$scores$validate[["rmse"]],
         coverage95_validation = model$scores$validate[["coverage95"]], crps_calibration = model$scores$calibrate[["crps"]],
         crps_validation = model$scores$validate[["crps"]], parameters = table_rows(parameter_table(fit)),
         attribution = table_rows(model$attribution$table[c("boundary", "log10_bf_dropped", "share", "p_value", "significant", "group")]))
  }
  candidate_list <- function(i) {
    row <- x$candidates[i, ]
    list(from = row$from, mechanism = row$mechanism, log10_bf = row$log10_bf, interval = c(row$lower95, row$upper95),
         probability = row$probability, trusted = row$trusted, screened = row$screened, parameters = table_rows(row$parameters[[1]]))
  }
  cause <- x$named_cause
  if (!is.null(cause)) cause$boundary <- as.list(cause$boundary)
  list(schema = 1L, study = x$study %||% x$measurements$name, seed = x$seed, wall_s = x$wall_s,
       diagnosis = diagnosis_verdict(x), models = lapply(x$models, model_list), candidates = lapply(seq_len(NROW(x$candidates)), candidate_list),
       named_cause = cause, gain = x$gain, stopped_because = x$stopped_because)
}
