study_fields <- list(
  needed = c("study", "data", "time", "target", "boundary", "model", "catalogue"),
  optional = c("noise_sd", "average_h", "calibrate", "validate", "warmup_h", "unit", "runs", "seed", "control", "title"))

#' Run a study from its file
#'
#' A study is a YAML file: what was measured, which rows calibrate and validate, the model and the catalogue (R files
#' that return them), and the control. `read_study()` checks it and prepares the pieces; `run_study()` runs the loop
#' of [upgrade_model()] and writes the results. Paths in the file are relative to the file.
#'
#' The fields are `study` (name), `data` (CSV file), `time`, `target`, `boundary` (list; `circular(Wd)` for degrees),
#' `model`, `catalogue` (R files), and, if wanted, `title`, `unit` (of the target), `noise_sd`, `average_h`, `warmup_h`
#' (hours), `calibrate`, `validate` (expressions in the columns of the data), `runs`, `seed` and `control` (as in
#' [upgrade_model()]).
#'
#' @param path The YAML file.
#' @param out Folder for the results: `report.html`, `figures/`, `result.rds`, `result.json`. `NULL` writes nothing. It is
#'   filled only when all is computed; until then its folder `stages` holds the finished models, and the same call goes on
#'   from there if it was interrupted.
#' @param seed Overrides the seed of the file.
#' @param threads Number of threads; results do not depend on it.
#' @param quiet No progress messages.
#' @return `run_study()`: the [upgrade_model()] result, invisibly; `read_study()`: a list of its pieces.
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
  upgrade <- upgrade_model(study$model, study$measurements, study$catalogue, runs = study$runs, control = study$control,
                           seed = seed, threads = threads, quiet = quiet, checkpoint = stages)
  upgrade$study <- study$study
  upgrade$title <- study$title
  upgrade$wall_s <- proc.time()[["elapsed"]] - started
  if (!is.null(out)) {
    write_study(upgrade, out, quiet)
    unlink(stages, recursive = TRUE)
  }
  invisible(upgrade)
}

#' @rdname run_study
#' @export
read_study <- function(path, quiet = TRUE) {
  check_input(checkmate::check_file_exists(path, access = "r"), "path")
  study <- tryCatch(yaml::read_yaml(path), error = function(e) {
    abort_input(c("The study file {.file {path}} cannot be read as YAML.", x = "{conditionMessage(e)}"))
  })
  if (!is.list(study)) abort_input("The study file {.file {path}} holds no fields.")
  absent <- setdiff(study_fields$needed, names(study))
  if (length(absent)) abort_input("The study file {.file {path}} lacks {cli::qty(absent)}field{?s} {.field {absent}}.")
  unknown <- setdiff(names(study), unlist(study_fields))
  if (length(unknown)) {
    abort_input(c("The study file {.file {path}} has {cli::qty(unknown)}unknown field{?s} {.field {unknown}}.",
                  i = "Known fields: {.field {unlist(study_fields, use.names = FALSE)}}."))
  }
  folder <- dirname(normalizePath(path))
  data_file <- study_path(study$data, folder, "data")
  data <- tryCatch(utils::read.csv(data_file, stringsAsFactors = FALSE, check.names = FALSE), error = function(e) {
    abort_input(c("The data file {.file {data_file}} cannot be read.", x = "{conditionMessage(e)}"))
  })
  measure <- function() {
    measurements(data, time = study$time, target = study$target, boundary = as.character(unlist(study$boundary)),
                 noise_sd = study$noise_sd, average = study$average_h, calibrate = study$calibrate, validate = study$validate,
                 warmup = study$warmup_h %||% 0, name = study$study, unit = study$unit %||% "")
  }
  model <- source_value(study_path(study$model, folder, "model"), "model")
  check_simulator(model)
  catalogue <- source_value(study_path(study$catalogue, folder, "catalogue"), "catalogue")
  check_input(checkmate::check_class(catalogue, "amiss_catalogue"), "catalogue")
  list(study = study$study, title = study$title %||% study$study, seed = study$seed, runs = study$runs %||% 150,
       control = study$control, model = model, catalogue = catalogue,
       measurements = if (quiet) suppressMessages(measure(), classes = "amiss_message_gap") else measure())
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

# The value of the last expression of an R file, evaluated where it sees the package and nothing of the session.
source_value <- function(path, field, call = rlang::caller_env()) {
  tryCatch(sys.source_value(path), error = function(e) {
    if (inherits(e, "amiss_error")) stop(e)
    abort_input(c("The {.field {field}} file {.file {path}} stopped with an error.", x = "{conditionMessage(e)}"), call = call)
  })
}

sys.source_value <- function(path) {
  source(path, local = new.env(parent = new.env(parent = asNamespace("amiss"))))$value
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
write_study <- function(upgrade, out, quiet = FALSE) {
  work <- tempfile("amiss-")
  dir.create(file.path(work, "figures"), recursive = TRUE)
  dir.create(out, recursive = TRUE, showWarnings = FALSE)
  staging <- file.path(out, basename(work))
  on.exit(unlink(c(work, staging), recursive = TRUE))
  save_figures(upgrade, file.path(work, "figures"))
  saveRDS(upgrade, file.path(work, "result.rds"))
  jsonlite::write_json(result_list(upgrade), file.path(work, "result.json"), auto_unbox = TRUE, digits = NA,
                       null = "null", na = "null", pretty = TRUE)
  report(upgrade, file.path(work, "report.html"))
  if (!file.copy(work, out, recursive = TRUE)) abort_input("The results could not be copied into {.file {out}}.")
  for (name in dir(work)) {
    unlink(file.path(out, name), recursive = TRUE)
    if (!file.rename(file.path(staging, name), file.path(out, name))) abort_input("{.file {name}} could not be moved into {.file {out}}.")
  }
  if (!quiet) cli::cli_alert_success("Written to {.file {out}}: report.html, figures/, result.rds, result.json")
}

# The result as plain lists, with the fields of result.json.
result_list <- function(upgrade) {
  table_rows <- function(table) lapply(seq_len(nrow(table)), function(i) as.list(table[i, , drop = FALSE]))
  model_list <- function(model) {
    fit <- model$fit
    list(name = model$name, parent = model$parent, mechanism = model$mechanism, Q = ncol(fit$emulator$basis$vectors),
         N = length(fit$rows), M = nrow(fit$emulator$processes$inputs), noise_sd = fit$measurements$noise_sd,
         discarded_rms = fit$emulator$basis$discarded_rms, log10_evidence = fit$log_evidence / log(10),
         log10_evidence_interval = fit$interval / log(10), trusted = fit$trust$trusted, verdict = fit$trust$verdict,
         rmse_calibration = model$scores$calibrate[["rmse"]], rmse_validation = model$scores$validate[["rmse"]],
         coverage95_validation = model$scores$validate[["coverage95"]], crps_calibration = model$scores$calibrate[["crps"]],
         crps_validation = model$scores$validate[["crps"]], parameters = table_rows(parameter_table(fit)),
         attribution = table_rows(model$attribution$table[c("boundary", "log10_bf_dropped", "share", "p_value", "significant")]))
  }
  candidate_list <- function(i) {
    row <- upgrade$candidates[i, ]
    list(from = row$from, mechanism = row$mechanism, log10_bf = row$log10_bf, interval = c(row$lower95, row$upper95),
         probability = row$probability, trusted = row$trusted, parameters = table_rows(row$parameters[[1]]))
  }
  cause <- upgrade$named_cause
  if (!is.null(cause)) cause$boundary <- as.list(cause$boundary)
  list(schema = 1L, study = upgrade$study %||% upgrade$measurements$name, seed = upgrade$seed, wall_s = upgrade$wall_s,
       diagnosis = diagnosis_verdict(upgrade), models = lapply(upgrade$models, model_list), candidates = lapply(seq_len(NROW(upgrade$candidates)), candidate_list),
       named_cause = cause, gain = upgrade$gain, stopped_because = upgrade$stopped_because)
}
