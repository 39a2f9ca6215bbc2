#' Design and runs: an ensemble of simulations
#'
#' Draws a Latin hypercube over the priors and runs the simulator at each point. [ensemble()] takes
#' runs that were made elsewhere.
#'
#' @param simulator A simulator: [zone()], [function_simulator()].
#' @param measurements The [measurements()] that drive the simulator.
#' @param runs Number of runs.
#' @param seed Seed of the design; if `NULL`, R's generator gives one.
#' @param threads Number of threads.
#' @param quiet No progress messages.
#' @return An object of class `amiss_ensemble`: parameter values, their places in the unit cube and
#'   the outputs at the calibration rows (one column per run).
#' @source McKay, Beckman and Conover (1979), A comparison of three methods for selecting values of
#'   input variables in the analysis of output from a computer code, Technometrics 21, 239-245;
#'   drawn by package lhs.
#' @examples
#' table <- data.frame(hour = 1:48, Ti = 20 + sin(1:48 / 4), Te = 5 + 3 * sin(1:48 / 4))
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1)
#' linear <- function_simulator(function(values, drivers) 18 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' simulate_design(linear, room, runs = 12, seed = 1)
#' @export
simulate_design <- function(simulator, measurements, runs = 150, seed = NULL, threads = 1,
                            quiet = FALSE) {
  check_arguments()
  hush(quiet)
  check_simulator(simulator)
  check_object(measurements, "amiss_measurements", "measurements")
  check_input(checkmate::check_count(runs, positive = TRUE), "runs")
  check_run_number(runs, length(measurements$raw$hours))
  threads <- check_threads(threads)
  parameters <- free_parameters(simulator)
  if (!length(parameters))
    abort_input(c("The simulator has no free parameter.", i = "Replace a number by {.fun free}."))
  check_enough_runs(runs, length(parameters))
  seed <- pick_seed(seed)
  unit <- with_seed(seed, lhs::randomLHS(runs, length(parameters)))
  values <- unit_to_values(unit, parameters)
  outputs <- simulate_measured(simulator, values, measurements, "calibrate", threads)
  new_ensemble(parameters, unit, values, outputs, simulator, seed,
               hours = row_hours(measurements, "calibrate"))
}

#' Runs that were made elsewhere
#'
#' Makes an ensemble of a design and its runs. If the runs have the validation rows too, a
#' calibration of them predicts held-out rows. [upgrade_model()] then judges mechanisms by them;
#' each mechanism is another set of runs.
#'
#' # Rows of the runs
#'
#' If `measurements` are given, `outputs` may hold one of these:
#'
#' * their calibration rows,
#' * calibration and validation rows in the order of the record,
#' * all rows, or
#' * all rows of the data before they were averaged. The runs are then averaged in the same way.
#'
#' If `time` is given, rows may be in any order, and may include rows that the measurements do not
#' use. In both cases the ensemble keeps the times of its rows. Measurements with other times are
#' then refused.
#'
#' @param design Matrix or data frame of parameter values, one run a row, with named columns. At
#'   least five runs are needed, and two more than there are parameters.
#' @param outputs Matrix or data frame of outputs, one run a column, at the calibration rows of the
#'   measurements (those that calibrate and have a target). Other rows are possible, see *Rows of
#'   the runs*. A run that is not finite is left out, with a warning.
#' @param parameters The [free()] parameters that the columns of `design` are, in a list. If not
#'   given, each gets a uniform prior over the range of its column.
#' @param measurements The [measurements()] that the runs are compared with. Without them `outputs`
#'   are taken to be at the calibration rows, and validation rows are not known.
#' @param validation Matrix of outputs at the validation rows, one run a column, if `outputs` does
#'   not hold them.
#' @param time Times of the rows of `outputs`, and then of `validation`: anything that
#'   [measurements()] reads, at the end of each row; dates without a time of day are whole days.
#' @return An object of class `amiss_ensemble`; `held_out` holds its runs at the validation rows.
#' @seealso [read_calibro()]
#' @examples
#' table <- data.frame(hour = 1:72, Te = 5 + 3 * sin(1:72 / 4))
#' table$Ti <- 20 + 0.4 * table$Te + 0.1 * sin(61 * (1:72)^2)
#' house <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1,
#'                       validate = table$hour > 48)
#' design <- cbind(gain = seq(0.1, 0.9, 0.1))
#' runs <- 20 + tcrossprod(table$Te, design)
#' made <- ensemble(design, runs, list(free("gain", uniform(0, 1))), measurements = house)
#' fit <- calibrate(train_emulator(made, house), house, seed = 1,
#'                  control = list(ais = list(pilot_chains = 48, groups = 4)))
#' head(predict(fit, use = "validate"))
#' @export
ensemble <- function(design, outputs, parameters = NULL, measurements = NULL, validation = NULL,
                     time = NULL) {
  check_arguments()
  design <- as_number_matrix(design)
  check_input(checkmate::check_matrix(design, "numeric", any.missing = FALSE, min.cols = 1,
                                      col.names = "unique"), "design")
  check_all_finite(design, "design")
  storage.mode(design) <- "double"
  outputs <- check_runs(outputs, "outputs", nrow(design))
  if (!is.null(validation)) validation <- check_runs(validation, "validation", nrow(design))
  runs <- place_runs(outputs, validation, measurements, time)
  check_enough_runs(nrow(unique(design)), ncol(design), nrow(design))
  if (is.null(parameters)) {
    for (name in colnames(design)) check_varies(name, design[, name])
    parameters <- lapply(colnames(design), function(name)
      free(name, uniform(min(design[, name]), max(design[, name]))))
  }
  check_input(checkmate::check_list(parameters), "parameters",
              "Give a list of parameters, each made by {.fun free}.")
  parameters <- named_parameters(parameters)
  check_design_columns(colnames(design), names(parameters))
  values <- design[, names(parameters), drop = FALSE]
  unit <- places_in_priors(values, parameters)
  made <- new_ensemble(parameters, unname(unit), values, runs$calibrate, NULL, NA,
                       hours = runs$hours, held_out = runs$held_out)
  made <- without_repeats(made)
  uncovered <- uncovered_statement(made)
  if (!is.null(uncovered)) {
    warn_input(c("{toupper(substr(uncovered, 1, 1))}{substring(uncovered, 2)}.",
                 i = paste("The emulator extrapolates over the rest: add runs there or narrow the",
                           "prior.")))
  }
  made
}

# A run that is given again, point and output, says nothing new: left out, its twin would seem to be
# foreseen.
without_repeats <- function(ensemble) {
  again <- duplicated(cbind(ensemble$unit, t(ensemble$outputs)))
  if (!any(again)) return(ensemble)
  warn_input(c(paste("{sum(again)} of {length(again)} runs stand{?s/} in {.arg design} and",
                     "{.arg outputs} more than once."), i = "Each counts once."))
  ensemble$unit <- ensemble$unit[!again, , drop = FALSE]
  ensemble$values <- ensemble$values[!again, , drop = FALSE]
  ensemble$outputs <- ensemble$outputs[, !again, drop = FALSE]
  if (!is.null(ensemble$held_out)) {
    ensemble$held_out$outputs <- ensemble$held_out$outputs[, !again, drop = FALSE]
  }
  ensemble
}

check_runs <- function(outputs, name, runs, call = rlang::caller_env()) {
  outputs <- as_number_matrix(outputs)
  check_input(checkmate::check_matrix(outputs, "numeric", min.rows = 1), name, call = call)
  storage.mode(outputs) <- "double"
  if (runs != ncol(outputs)) {
    abort_input(c(paste("{.arg design} has {runs} rows and {.arg {name}} {ncol(outputs)} columns;",
                        "each row of the design needs its run."),
                  i = "Give the outputs as one column per run."), call = call)
  }
  unname(outputs)
}

# The first value that is not finite, by row and column.
check_all_finite <- function(x, name, call = rlang::caller_env()) {
  bad <- which(!is.finite(x), arr.ind = TRUE)
  if (!nrow(bad)) return(invisible())
  abort_input(paste("{.arg {name}} is {x[bad[1, 1], bad[1, 2]]} in row {bad[1, 1]} of column",
                    "{.val {colnames(x)[bad[1, 2]]}}; finite numbers are needed."),
              call = call)
}

check_design_columns <- function(columns, parameters, call = rlang::caller_env()) {
  absent <- setdiff(parameters, columns)
  if (length(absent))
    abort_input("{.arg design} lacks {cli::qty(absent)}column{?s} {.val {absent}}.", call = call)
  unknown <- setdiff(columns, parameters)
  if (length(unknown)) {
    abort_input(c(paste("{.arg design} has {cli::qty(unknown)}column{?s} {.val {unknown}} without",
                        "a parameter; the runs vary with {?it/them} nevertheless."),
                  i = "Declare {cli::qty(unknown)}{?it/them} by {.fun free} in {.arg parameters}."),
                call = call)
  }
}

# The design in the unit cube, all of it inside the priors.
places_in_priors <- function(values, parameters, call = rlang::caller_env()) {
  unit <- values
  for (name in names(parameters)) {
    prior <- parameters[[name]]$prior
    outside <- which(values[, name] < prior$lower | values[, name] > prior$upper)
    if (length(outside) == nrow(values)) {
      abort_input(c(paste("No run lies where the prior of {.val {name}} has mass: {format(prior)},",
                          "while the runs span {signif(min(values[, name]), 4)} to",
                          "{signif(max(values[, name]), 4)}."),
                    i = "Correct the prior or make runs inside it."), call = call)
    }
    if (length(outside)) {
      abort_input(c(paste("{length(outside)} run{?s} lie{?s/} outside the prior of {.val {name}},",
                          "{format(prior)}; the first is run {outside[1]} with value",
                          "{values[outside[1], name]}."),
                    i = "Widen the prior or leave these runs out."), call = call)
    }
    unit[, name] <- prior_cdf(prior, values[, name])
    check_covered(name, prior, values[, name], unit[, name], call)
  }
  unit
}

# Runs by the use of their rows: list(calibrate, hours, held_out), the last list(outputs, hours) or
# NULL.
place_runs <- function(outputs, validation, measurements, time, call = rlang::caller_env()) {
  if (!is.null(measurements))
    check_object(measurements, "amiss_measurements", "measurements", call = call)
  if (is.null(measurements)) {
    if (!is.null(validation)) abort_input(paste("{.arg validation} needs {.arg measurements},",
                                                "which say what its rows are."), call = call)
    hours <- if (!is.null(time)) row_times(time, nrow(outputs), NULL, call)
    return(list(calibrate = outputs, hours = hours))
  }
  record <- if (is.null(time)) {
    runs_by_count(outputs, validation, measurements, call)
  } else {
    runs <- rbind(outputs, validation)
    runs_by_time(runs, row_times(time, nrow(runs), measurements, call), measurements, call)
  }
  held <- used_rows(measurements, "validate")
  list(calibrate = record[used_rows(measurements, "calibrate"), , drop = FALSE],
       hours = row_hours(measurements, "calibrate"),
       held_out = if (length(held) && !all(is.na(record[held, ]))) {
         list(outputs = record[held, , drop = FALSE], hours = row_hours(measurements, "validate"))
       })
}

row_times <- function(time, rows, measurements, call) {
  read <- read_time(time, "time", measurements$time_format, measurements$time_zone, call)
  hours <- time_hours(interval_ends(read, time, measurements$time_format))
  if (length(hours) != rows) abort_input(paste("{.arg time} has {length(hours)} value{?s}, the",
                                               "runs have {rows} row{?s}."), call = call)
  hours
}

row_hours <- function(measurements, use) measurements$hours[used_rows(measurements, use)]

# Runs at each row of the (averaged) record, NA where there are none: what the rows are is told by
# how many there are.
runs_by_count <- function(outputs, validation, measurements, call) {
  m <- measurements
  record <- matrix(NA_real_, length(m$y), ncol(outputs))
  rows <- list(calibration = used_rows(m, "calibrate"), validation = used_rows(m, "validate"),
               record = seq_along(m$y))
  if (!is.null(validation)) {
    if (nrow(outputs) != length(rows$calibration) || nrow(validation) != length(rows$validation)) {
      abort_input(c(paste("{.arg outputs} has {nrow(outputs)} rows and {.arg validation}",
                          "{nrow(validation)}; the measurements have {length(rows$calibration)}",
                          "calibration and {length(rows$validation)} validation rows."),
                    i = "Give the runs at exactly these rows, or the {.arg time} of each."),
                  call = call)
    }
    record[unlist(rows[1:2]), ] <- rbind(outputs, validation)
    return(record)
  }
  if (m$per_step > 1 && nrow(outputs) == length(m$raw$hours)) return(averaged_runs(outputs, m))
  kinds <- list(rows$calibration, sort(c(rows$calibration, rows$validation)), rows$record)
  kind <- match(nrow(outputs), lengths(kinds))
  if (is.na(kind)) {
    readings <- if (m$per_step > 1)
                  paste0(", and ", length(m$raw$hours), " before they were averaged")
                else ""
    abort_input(c(paste("The runs have {nrow(outputs)} rows; the measurements have",
                        "{length(rows$calibration)} calibration and {length(rows$validation)}",
                        "validation rows, of {length(m$y)} in all{readings}."),
                  i = paste("Give the runs at the calibration rows, at both, or at all; or the",
                            "{.arg time} of each row.")), call = call)
  }
  record[kinds[[kind]], ] <- outputs
  record
}

averaged_runs <- function(fine, measurements)
  unname(block_means(fine, measurements$block, measurements$per_step))

runs_by_time <- function(runs, hours, measurements, call) {
  m <- measurements
  found <- function(wanted) match(round(wanted, 6), round(hours, 6))
  rows <- found(m$hours)
  raw <- found(m$raw$hours)
  # Times before averaging where they are there: the end of an average is one of them.
  fine <- m$per_step > 1 && !anyNA(raw)
  for (use in c("calibrate", "validate")) {
    wanted <- used_rows(m, use)
    absent <- wanted[is.na(rows[wanted])]
    if (!length(absent) || use == "validate" && length(absent) == length(wanted)) next
    abort_input(c(paste("The runs lack {length(absent)} of the {length(wanted)} rows of the",
                        "measurements that {use}; the first is at {format(m$time[absent[1]])}."),
                  i = paste("The runs span {signif(min(hours), 8)} to {signif(max(hours), 8)} h",
                            "and the measurements {signif(min(m$hours), 8)} to",
                            "{signif(max(m$hours), 8)} h: check time zone and step.")), call = call)
  }
  if (fine) averaged_runs(runs[raw, , drop = FALSE], m) else runs[rows, , drop = FALSE]
}

# Whether the rows of runs are those of the measurements, where their times are known.
check_same_rows <- function(hours, measurements, use = "calibrate", call = rlang::caller_env()) {
  if (is.null(hours)) return(invisible())
  expected <- row_hours(measurements, use)
  same <- length(hours) == length(expected) && all(abs(hours - expected) < 1e-6)
  if (same) return(invisible())
  differs <- if (length(hours) == length(expected)) which(abs(hours - expected) >= 1e-6)[1] else 1
  abort_input(c(paste("The runs were made at other rows than those of the measurements that {use}:",
                      "row {differs} is at {signif(hours[differs], 8)} h in the runs, at",
                      "{signif(expected[differs], 8)} h in the measurements."),
                i = "Use the measurements that the ensemble was made with, or make the runs anew."),
              call = call)
}

# Whether an ensemble has the calibration rows of the measurements.
check_ensemble_rows <- function(ensemble, measurements, call = rlang::caller_env()) {
  rows <- used_rows(measurements, "calibrate")
  if (nrow(ensemble$outputs) != length(rows)) {
    abort_input(c(paste("The runs have {nrow(ensemble$outputs)} steps and the measurements",
                        "{length(rows)} calibration rows."),
                  i = "Give the runs at exactly these rows."), call = call)
  }
  check_same_rows(ensemble$hours, measurements, call = call)
}

check_varies <- function(name, values, call = rlang::caller_env()) {
  if (diff(range(values)) == 0) {
    abort_input(c(paste("Parameter {.val {name}} has the same value, {signif(values[1], 4)}, in",
                        "all {length(values)} runs."),
                  i = "Vary it, or leave it out of the design."), call = call)
  }
}

# Runs that all lie in a sliver of the prior say nothing about the parameter.
check_covered <- function(name, prior, values, unit, call = rlang::caller_env()) {
  check_varies(name, values, call)
  share <- diff(range(unit))
  if (share < 0.05) {
    abort_input(c(paste("The runs lie where the prior of {.val {name}} has next to no mass:",
                        "{format(prior)} has {signif(100 * share, 2)} % of it between",
                        "{signif(min(values), 4)} and {signif(max(values), 4)}."),
                  i = "Correct the prior or make runs where its mass is."), call = call)
  }
}

# The parameters whose prior reaches further than the runs, or NULL. Of M points scattered over the
# prior, the range holds a Beta(M - 1, 2) share of its mass: what happens to one design in a
# thousand, and leaves out a tenth, is told.
uncovered_statement <- function(ensemble) {
  if (!is.null(ensemble$region)) return(NULL)
  runs <- nrow(ensemble$unit)
  share <- apply(ensemble$unit, 2, function(u) diff(range(u)))
  little <- which(share < min(0.9, stats::qbeta(0.001, runs - 1, 2)))
  if (!length(little)) return(NULL)
  spans <- vapply(little, function(p) {
    span <- format(signif(range(ensemble$values[, p]), 4))
    sprintf("%.0f %% of the prior of %s (from %s to %s)", 100 * share[p],
            names(ensemble$parameters)[p], trimws(span[1]), trimws(span[2]))
  }, "")
  paste("the runs cover only", paste(spans, collapse = ", "))
}

# `runs`: at distinct points.
check_enough_runs <- function(runs, parameters, given = runs, call = rlang::caller_env()) {
  least <- max(5, parameters + 2)
  if (runs >= least) return(invisible())
  points <- if (given > runs) " at {runs} distinct point{?s}" else ""
  own <- if (given > runs) ", each at a point of its own"
  abort_input(c(paste0("{given} run{?s}", points, " {cli::qty(given)}{?is/are} too few for ",
                       "{parameters} parameter{?s}; at least {least} are needed", own, "."),
                i = "Ten times the number of parameters is a good start."), call = call)
}

unit_to_values <- function(unit, parameters) {
  values <- vapply(seq_along(parameters),
                   function(p) finite_quantile(parameters[[p]]$prior, unit[, p]),
                   numeric(nrow(unit)))
  matrix(values, nrow(unit), dimnames = list(NULL, names(parameters)))
}

# Of a prior without limits 0 and 1 stand for the smallest and the largest probability that a number
# can hold: a posterior may lie that far out.
finite_quantile <- function(prior, u) {
  value <- prior_quantile(prior, u)
  far <- is.infinite(value)
  value[far] <- prior_quantile(
    prior, pmin(pmax(u[far], .Machine$double.xmin), 1 - .Machine$double.neg.eps))
  value
}

values_to_unit <- function(values, parameters) {
  unit <- vapply(seq_along(parameters), function(p) prior_cdf(parameters[[p]]$prior, values[, p]),
                 numeric(nrow(values)))
  matrix(unit, nrow(values), length(parameters))
}

# `region`: where the runs lie, if not everywhere; `over_priors`: the emulator of runs that do;
# `hours`: times of the rows, if known; `held_out`: given runs at the validation rows.
new_ensemble <- function(parameters, unit, values, outputs, simulator, seed, region = NULL,
                         over_priors = NULL, hours = NULL, held_out = NULL,
                         call = rlang::caller_env()) {
  everything <- rbind(outputs, held_out$outputs)
  failed <- which(colSums(!is.finite(everything)) > 0)
  if (length(failed)) {
    left <- ncol(outputs) - length(failed)
    row <- which(!is.finite(everything[, failed[1]]))[1]
    first <- paste("The first is run {failed[1]} at",
                   "{point_words(values[failed[1], , drop = FALSE])}: its row {row} is",
                   "{everything[row, failed[1]]}.")
    if (left < max(5, length(parameters) + 2)) {
      abort_input(c(paste("{length(failed)} of {ncol(outputs)} runs hold values that are not",
                          "finite; {left} usable run{?s} {?is/are} too few."),
                    x = first,
                    i = if (left) "Find out why the simulator fails there, or narrow the priors."
                        else paste("Every run failed: look for a mistake in the simulator before",
                                   "you change its priors.")), call = call)
    }
    warn_input(c(paste("{length(failed)} of {ncol(outputs)} runs hold values that are not finite",
                       "and {?is/are} left out."), i = first))
    outputs <- outputs[, -failed, drop = FALSE]
    if (!is.null(held_out)) held_out$outputs <- held_out$outputs[, -failed, drop = FALSE]
    unit <- unit[-failed, , drop = FALSE]
    values <- values[-failed, , drop = FALSE]
  }
  structure(list(format_version = format_version, parameters = parameters, unit = unit,
                 values = values, outputs = outputs,
                 simulator = simulator, failed = length(failed), seed = seed, region = region,
                 over_priors = over_priors, hours = hours, held_out = held_out),
            class = "amiss_ensemble")
}

#' @export
print.amiss_ensemble <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong Ensemble}: {ncol(x$outputs)} runs of {nrow(x$outputs)} steps over",
                      "{length(x$parameters)}",
                      "parameter{?s}{if (x$failed) paste0(' (', x$failed, ' failed)') else ''}"))
  cli::cli_bullets(c("*" = "parameters {.field {parameter_titles(x$parameters)}}",
                     if (!is.null(x$region)) c("*" = "in the region where a posterior lies"),
                     if (!is.null(x$held_out))
                       c("*" = "and at {nrow(x$held_out$outputs)} validation steps"),
                     ">" = "next: {.fun train_emulator}"))
})
