# The folder of a study's results: one run at a time, whole results or none, and nothing of anybody
# else's removed.

# Makes the folder if need be and holds it until release_folder(). The lock is the operating
# system's: it ends with the process that holds it, however that ends.
hold_folder <- function(out, call = rlang::caller_env()) {
  check_input(checkmate::check_string(out, min.chars = 1), "out", call = call)
  made <- !dir.exists(out) && suppressWarnings(dir.create(out, recursive = TRUE))
  held <- list(out = out, made = made, holder = file.path(out, ".amiss-holder"))
  lock <- tryCatch(
    suppressWarnings(list(filelock::lock(file.path(out, ".amiss-lock"), timeout = 0))),
    error = function(e) NULL)
  if (is.null(lock)) {
    abort_input(c("{.arg out} = {.file {out}} is not a folder that can be written.",
                  i = "Name another folder; it is made if it does not exist."), call = call)
  }
  if (is.null(lock[[1]])) {
    holder <- tryCatch(suppressWarnings(readLines(held$holder)),
                       error = function(e) "another process")
    abort_input(c("The folder {.file {out}} is in use by {holder}.",
                  i = "Wait until it has ended, or name another folder."), call = call)
  }
  writeLines(sprintf("process %d on %s since %s", Sys.getpid(), Sys.info()[["nodename"]],
                     format(Sys.time(), "%Y-%m-%d %H:%M:%S %Z")), held$holder)
  c(held, lock = lock)
}

# What interrupted runs left half-written goes too: nobody else writes here now.
release_folder <- function(held) {
  unlink(dir(held$out, "^amiss-new-[0-9a-f]+$", full.names = TRUE), recursive = TRUE)
  unlink(c(held$holder, file.path(held$out, ".amiss-lock")))
  filelock::unlock(held$lock)
  if (held$made) remove_empty(held$out)
}

# Everything is made elsewhere and copied beside its place; then what has these names is moved aside
# as a whole and the new moved in. Results of two runs never stand side by side. What cannot be made
# is left out; why, by its name, is the value. Without result.rds, from which all else can be made,
# nothing is written.
write_study <- function(result, out, quiet = FALSE, pieces = result_pieces(result),
                        call = rlang::caller_env()) {
  staging <- tempfile("amiss-new-", out)
  work <- tempfile("amiss-new-")
  on.exit(unlink(c(staging, work), recursive = TRUE))
  missing <- unlist(lapply(stats::setNames(nm = names(pieces)), function(name) {
    make_piece(pieces[[name]], name, work, staging)
  }))
  if ("result.rds" %in% names(missing)) {
    abort_input(c("The results could not be written into {.file {out}}: {missing[['result.rds']]}",
                  i = paste("Is the disk full? What was computed is kept: the same call goes on",
                            "from it.")), call = call)
  }
  set_aside(intersect(sub("/.*", "", names(pieces)), dir(out)), out, quiet)
  written <- dir(staging)
  move_files(written, staging, out)
  if (!quiet) cli::cli_alert_success("Written to {.file {out}}: {written}")
  if (length(missing)) warn_missing(missing, out)
  missing
}

# How each file of the results is made at a path, the first needed most.
result_pieces <- function(result) {
  which <- figures_of(result)
  figures <- lapply(which,
                    function(one) function(path) save_figure(ggplot2::autoplot(result, one), path))
  c(list(result.rds = function(path) saveRDS(result, path),
         result.json = function(path) {
           jsonlite::write_json(result_list(result), path, auto_unbox = TRUE, digits = NA,
                                null = "null", na = "null", pretty = TRUE)
         },
         report.html = function(path) report(result, path)),
    stats::setNames(figures, file.path("figures", figure_files(which))))
}

# NULL if a file is made and stands whole in the folder beside its place, or why not.
make_piece <- function(make, name, work, staging, copy = file.copy) {
  made <- file.path(work, name)
  for (folder in dirname(c(made, file.path(staging, name)))) {
    dir.create(folder, recursive = TRUE, showWarnings = FALSE)
  }
  beside <- file.path(staging, name)
  tryCatch({
    make(made)
    whole <- suppressWarnings(copy(made, beside)) && identical(file.size(made), file.size(beside))
    if (whole && tools::file_ext(name) == "rds") readRDS(beside)
    if (!whole) stop("it could not be copied as a whole")
    NULL
  }, error = function(e) {
    unlink(beside)
    cli::ansi_strip(conditionMessage(e))
  })
}

set_aside <- function(names, out, quiet) {
  if (!length(names)) return(invisible())
  aside <- tempfile(format(Sys.time(), "earlier-%Y-%m-%d-%H%M%S-"), out)
  dir.create(aside)
  move_files(names, out, aside)
  if (!quiet) cli::cli_alert_info(paste("What stood in {.file {out}} under the names of the",
                                        "results is in {.file {aside}}"))
}

warn_missing <- function(missing, out) {
  warn_result(
    c("{length(missing)} file{?s} of the results could not be made: {.file {names(missing)}}.",
      x = "{names(missing)[1]}: {missing[[1]]}",
      i = "The result is whole in {.file {file.path(out, 'result.rds')}}: {.fun readRDS} reads it.",
      i = "The same call makes the rest again, from what was computed."),
    class = "amiss_warning_missing")
}

move_files <- function(names, from, to, call = rlang::caller_env()) {
  for (name in names) {
    if (!suppressWarnings(file.rename(file.path(from, name), file.path(to, name)))) {
      abort_input("{.file {file.path(from, name)}} could not be moved into {.file {to}}.",
                  call = call)
    }
  }
}

# The result as plain lists, with the fields of result.json.
result_list <- function(x) UseMethod("result_list")

table_rows <- function(table)
  lapply(seq_len(NROW(table)), function(i) as.list(table[i, , drop = FALSE]))

#' @export
result_list.amiss_upgrade <- function(x) {
  # What the fit of one record says, and what one model says of it.
  made_with <- function(fit) {
    list(Q = ncol(fit$emulator$basis$vectors), N = length(fit$rows),
         M = nrow(fit$emulator$processes$inputs), noise_sd = fit$measurements$noise_sd,
         discarded_rms = fit$emulator$basis$discarded_rms)
  }
  checked <- function(fit) {
    list(emulator_error = fit$check$error, emulator_ratio = fit$check$ratio,
         emulator_checked = fit$check$passed)
  }
  scored <- function(scores) {
    list(rmse_calibration = scores$calibrate[["rmse"]], rmse_validation = scores$validate[["rmse"]],
         coverage95_validation = scores$validate[["coverage95"]],
         crps_calibration = scores$calibrate[["crps"]], crps_validation = scores$validate[["crps"]])
  }
  answers <- function(attribution) {
    table <- attribution$table
    table_rows(table[intersect(c("boundary", "log10_bf_dropped", "share", "p_value", "significant",
                                 "group", "records"), names(table))])
  }
  model_list <- function(model) {
    fit <- model$fit
    several <- inherits(fit, "amiss_joint")
    listed <- c(
      list(name = model$name, parent = model$parent, mechanism = model$mechanism),
      if (!several) made_with(fit),
      list(log10_evidence = fit$log_evidence / log(10),
           log10_evidence_interval = fit$interval / log(10), trusted = fit$trust$trusted,
           trust = fit$trust$verdict, verdict = model$verdict,
           doubts = as.list(unname(model$doubts)), rivals = as.list(model$rivals),
           confounded_with = as.list(model$confounded_with),
           held_out_gain = model$held_out_gain[c("mean", "standard_error")]),
      if (!several) list(step_error = model$steps[[1]]$error),
      checked(fit), list(refinements = fit$rounds), if (!several) list(reach = as.list(fit$reach)),
      scored(model$scores),
      list(parameters = table_rows(physical_table(fit)), attribution = answers(model$attribution)))
    if (several) listed$records <- lapply(names(fit$records), record_list, model)
    listed
  }
  record_list <- function(name, model) {
    own <- record_model(model, name)
    c(list(name = name, target = own$fit$measurements$target, unit = own$fit$measurements$unit),
      made_with(own$fit), checked(own$fit), list(reach = as.list(own$fit$reach)),
      scored(own$scores),
      list(held_out_gain = model$records[[name]]$held_out_gain[c("mean", "standard_error")],
           step_error = model$steps[[name]]$error,
           attribution = answers(own$attribution)))
  }
  candidate_list <- function(i) {
    row <- x$candidates[i, ]
    list(from = row$from, mechanism = row$mechanism, log10_bf = row$log10_bf,
         interval = c(row$lower95, row$upper95), probability = row$probability,
         error_ratio = row$error_ratio, trusted = row$trusted, judged_by = row$judged_by,
         runs = row$runs, beside_unknown = row$beside_unknown, standing = row$standing,
         parameters = table_rows(row$parameters[[1]]))
  }
  cause <- x$named_cause
  if (!is.null(cause)) cause$boundary <- as.list(cause$boundary)
  list(schema = 1L, study = x$study %||% x$measurements$name, seed = x$seed, wall_s = x$wall_s,
       runs_total = x$runs_total,
       diagnosis = diagnosis_verdict(labelled(x)), models = lapply(x$models, model_list),
       candidates = lapply(seq_len(NROW(x$candidates)), candidate_list),
       named_cause = cause, gain = x$gain, stopped_because = x$stopped_because)
}
