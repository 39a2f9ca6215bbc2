#' Read runs as Calibro and ESP-r write them
#'
#' @description
#' Reads a folder of four tables:
#'
#' * `obs.csv`: the record of the target (N x 1).
#' * `bc.csv`: the boundary conditions (N x S).
#' * `inputs.csv`: the parameters, one run a row (M x P).
#' * `sims.csv`: the runs, one a column (N x M).
#'
#' Each may have a line of names. Without it, conditions are called `bc1`, `bc2`, ..., and
#' parameters `p1`, `p2`, ... or as in `parameters`.
#'
#' @details
#' ESP-r puts a row of zeros, the base case, first in `inputs.csv`. The row stays if it has its run
#' and lies between the others, as it does if values are relative to their ranges. Otherwise it is
#' no run of the design and is left out.
#'
#' @section The command: `exec/calibrino -c NAME -b bc.csv -i inputs.csv -o obs.csv -s sims.csv
#'   --fmt json,html` reads such tables and calls [amiss()]. It writes `calibro_report.json` and, by
#'   [report()], the other formats into the working directory. `--help` lists the options.
#'
#'   ESP-r reads this in `calibro_report.json`:
#'   * `CALIBRATION_RESULTS`, `theta.stats`: the median and 95 % limits of each parameter, in the
#'     values of `inputs.csv`.
#'   * `CALIBRATED_MODEL_GOF`: the RMSE of the simulation before and after the calibration. Before,
#'     it is that of the base case if this is among the runs kept, else of the emulator at the
#'     middle of each prior.
#'
#'   The file also has the [Sobol indices][sobol_indices()], the training of the emulator and the
#'   data set. ESP-r's names `what:where` become `what.where`.
#'
#'   Priors are uniform over the range of each column of `inputs.csv`. One record is calibrated at a
#'   time. If nothing can be calibrated, the file holds the `error` alone and the exit status is 1
#'   (2 if the usage is bad).
#'
#' @param folder The folder.
#' @param parameters The [free()] parameters that the columns of `inputs.csv` are, in their order,
#'   in a list. If not given, the columns stay as they are.
#' @param relative `TRUE` if the values in `inputs.csv` go from -1 to 1, the lower and the upper
#'   limit of the parameter's prior, as ESP-r writes them. This needs `parameters`.
#' @param step_h Length of an interval in hours.
#' @param files Names of the tables, if they differ: `obs`, `bc`, `inputs`, `sims`.
#' @return A list:
#'   * `data`: a data frame of `hour`, `target` and the conditions for [measurements()].
#'   * `boundary`: the names of the conditions.
#'   * `design`, `outputs`: for [ensemble()].
#' @examples
#' folder <- file.path(tempdir(), "calibro")
#' dir.create(folder, showWarnings = FALSE)
#' write <- function(x, name) {
#'   write.table(x, file.path(folder, name), sep = ",", row.names = FALSE, col.names = FALSE)
#' }
#' Te <- 5 + 3 * sin(1:48 / 4)
#' gain <- c(0, seq(-1, 1, 0.2))
#' write(20 + 0.4 * Te + 0.1 * sin(61 * (1:48)^2), "obs.csv")
#' write(Te, "bc.csv")
#' write(gain, "inputs.csv")
#' write(20 + outer(Te, (1 + gain) / 2), "sims.csv")
#' gains <- list(free("gain", uniform(0, 1)))
#' files <- read_calibro(folder, gains, relative = TRUE)
#' room <- measurements(files$data, "hour", "target", files$boundary, noise_sd = 0.1)
#' ensemble(files$design, files$outputs, gains, measurements = room)
#' @seealso [amiss()] calibrates what was read.
#' @export
read_calibro <- function(folder, parameters = NULL, relative = FALSE, step_h = 1, files = NULL) {
  check_arguments()
  call <- rlang::current_env()
  check_input(checkmate::check_string(folder, min.chars = 1), "folder")
  check_input(checkmate::check_directory_exists(folder), "folder")
  check_input(checkmate::check_flag(relative), "relative")
  check_input(checkmate::check_number(step_h, lower = 1e-9, finite = TRUE), "step_h")
  files <- merge_control(calibro_files, if (is.atomic(files)) as.list(files) else files, "files")
  for (name in names(files))
    check_input(checkmate::check_string(files[[name]]), paste0("files$", name))
  tables <- lapply(files, function(file) read_numbers(fs::path_abs(file, folder), call))
  check_calibro_steps(tables, files)
  runs <- without_base_case(tables$inputs, tables$sims, files)
  colnames(tables$bc) <- colnames(tables$bc) %||% paste0("bc", seq_len(ncol(tables$bc)))
  taken <- intersect(colnames(tables$bc), c("hour", "target"))
  if (length(taken))
    abort_input("A boundary condition in {.file {files$bc}} cannot be named {.val {taken}}.")
  data <- data.frame(hour = step_h * seq_len(nrow(tables$obs)), target = tables$obs[, 1], tables$bc,
                     check.names = FALSE)
  list(data = data, boundary = colnames(tables$bc),
       design = calibro_design(runs$inputs, parameters, relative), outputs = unname(runs$sims))
}

calibro_files <- list(obs = "obs.csv", bc = "bc.csv", inputs = "inputs.csv", sims = "sims.csv")

# A table of numbers with or without a line of names.
read_numbers <- function(path, call) {
  if (!file.exists(path)) abort_input("The file {.file {path}} does not exist.", call = call)
  if (!is_regular_file(path)) abort_input("{.file {path}} is not a regular file.", call = call)
  first <- scan(path, "", sep = ",", nlines = 1, quiet = TRUE, strip.white = TRUE)
  named <- anyNA(suppressWarnings(as.numeric(first[first != "NA"])))
  check_field_counts(path, call)
  read <- function() utils::read.csv(path, header = named, check.names = FALSE, strip.white = TRUE)
  table <- tryCatch(read(), error = function(e) {
    abort_input(c("The file {.file {path}} cannot be read.", x = "{conditionMessage(e)}"),
                call = call)
  })
  text <- which(!vapply(table, is.numeric, NA))
  if (length(text)) {
    values <- as.character(table[[text[1]]])
    bad <- which(is.na(suppressWarnings(as.numeric(values))))[1]
    abort_input(paste("The file {.file {path}} holds {.val {values[bad]}} in row {bad} of column",
                      "{text[1]}; numbers are expected, between commas."), call = call)
  }
  table <- as.matrix(table)
  dimnames(table) <- list(NULL, if (named) colnames(table))
  table
}

# R would take the first field of rows that are longer than the line of names for the name of the
# row.
check_field_counts <- function(path, call) {
  counts <- utils::count.fields(path, ",", quote = "\"", comment.char = "")
  bad <- which(counts != counts[1])[1]
  if (is.na(bad)) return(invisible())
  abort_input(c(paste("The file {.file {path}} has {counts[bad]} field{?s} in line {bad} and",
                      "{counts[1]} in line 1."),
                i = "Give each row as many fields, and each column a name or none of them."),
              call = call)
}

check_calibro_steps <- function(tables, files, call = rlang::caller_env()) {
  steps <- vapply(tables[c("obs", "bc", "sims")], nrow, 0L)
  if (length(unique(steps)) > 1) {
    abort_input(c(paste("The tables are of unequal length: {files$obs} has {steps[['obs']]} rows,",
                        "{files$bc} {steps[['bc']]} and {files$sims} {steps[['sims']]}."),
                  i = "Each needs one row for every step of the record."), call = call)
  }
  if (ncol(tables$obs) != 1) abort_input(paste("{.file {files$obs}} has {ncol(tables$obs)}",
                                               "columns; one is expected, the target."),
                                         call = call)
}

without_base_case <- function(inputs, sims, files, call = rlang::caller_env()) {
  base <- nrow(inputs) > 1 && all(inputs[1, ] == 0)
  has_run <- ncol(sims) == nrow(inputs)
  if (!has_run && !(base && ncol(sims) == nrow(inputs) - 1)) {
    abort_input(c(paste("{.file {files$inputs}} has {nrow(inputs)} rows and {files$sims}",
                        "{ncol(sims)} columns; each row needs its run."),
                  i = "A first row of zeros, the base case, may be without."), call = call)
  }
  if (!base) return(list(inputs = inputs, sims = sims))
  ranges <- apply(inputs[-1, , drop = FALSE], 2, range)
  if (has_run && all(ranges[1, ] <= 0 & ranges[2, ] >= 0))
    return(list(inputs = inputs, sims = sims))
  cli::cli_inform("The first row of {files$inputs}, all zeros, is left out as the base case.",
                  class = "amiss_message_base_case")
  list(inputs = inputs[-1, , drop = FALSE], sims = if (has_run) sims[, -1, drop = FALSE] else sims)
}

# The values of the parameters, under their names.
calibro_design <- function(inputs, parameters, relative, call = rlang::caller_env()) {
  if (is.null(parameters)) {
    if (relative) abort_input(paste("{.arg relative} values need {.arg parameters}, whose limits",
                                    "they are relative to."), call = call)
    colnames(inputs) <- colnames(inputs) %||% paste0("p", seq_len(ncol(inputs)))
    return(inputs)
  }
  check_input(checkmate::check_list(parameters), "parameters", call = call)
  parameters <- named_parameters(parameters, call)
  if (length(parameters) != ncol(inputs)) {
    abort_input("inputs.csv has {ncol(inputs)} column{?s}, {.arg parameters} {length(parameters)}.",
                call = call)
  }
  colnames(inputs) <- names(parameters)
  if (!relative) return(inputs)
  if (any(abs(inputs) > 1 + 1e-9)) {
    far <- which(abs(inputs) > 1 + 1e-9, arr.ind = TRUE)[1, ]
    abort_input(c(paste("Row {far[1]} of the design has the value {inputs[far[1], far[2]]} for",
                        "{.val {names(parameters)[far[2]]}}; relative values lie between",
                        "-1 and 1."),
                  i = "Use {.code relative = FALSE} for values in the parameter's unit."),
                call = call)
  }
  for (name in names(parameters)) {
    prior <- parameters[[name]]$prior
    if (!is.finite(prior$lower) || !is.finite(prior$upper)) {
      abort_input(paste("Relative values of {.val {name}} need a prior between finite limits; got",
                        "{format(prior)}."), call = call)
    }
    inputs[, name] <- prior$lower +
      (pmin(pmax(inputs[, name], -1), 1) + 1) / 2 * (prior$upper - prior$lower)
  }
  inputs
}
