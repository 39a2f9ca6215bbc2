#' Design and runs: an ensemble of simulations
#'
#' `simulate_design()` draws a Latin hypercube over the priors and runs the simulator at each point.
#' `ensemble()` takes a design and runs that were made elsewhere.
#'
#' @param simulator A simulator: [zone()], [function_simulator()].
#' @param measurements [measurements()]; the simulator is driven by them.
#' @param runs Number of runs.
#' @param seed Seed of the design; if `NULL`, R's generator gives one.
#' @param threads Number of threads.
#' @return An object of class `amiss_ensemble`: parameter values, their places in the unit cube and the outputs at
#'   the calibration rows (one column per run).
#' @export
simulate_design <- function(simulator, measurements, runs = 150, seed = NULL, threads = 1) {
  check_simulator(simulator)
  check_input(checkmate::check_class(measurements, "amiss_measurements"), "measurements")
  check_input(checkmate::check_count(runs, positive = TRUE), "runs")
  threads <- check_threads(threads)
  parameters <- free_parameters(simulator)
  if (!length(parameters)) abort_input(c("The simulator has no free parameter.", i = "Replace a number by {.fun free}."))
  check_enough_runs(runs, length(parameters))
  seed <- pick_seed(seed)
  unit <- with_seed(seed, lhs::randomLHS(runs, length(parameters)))
  values <- unit_to_values(unit, parameters)
  outputs <- simulate_measured(simulator, values, measurements, "calibrate", threads)
  new_ensemble(parameters, unit, values, outputs, simulator, seed)
}

#' More runs where they matter
#'
#' A design spread over the priors has few runs where the posterior lies, the fewer the more the data say, and an emulator
#' of it can be off there by more than it knows. This makes an ensemble of the region where a first posterior lies: the
#' ellipsoid that holds it, in the coordinates in which the priors are standard normal. Its runs follow the
#' axes of the ellipsoid and fill it evenly; runs of `ensemble` that lie inside join them, the last 40. An emulator of them holds in the region
#' alone, and there a few dozen runs do what hundreds spread over the priors cannot. Parameters outside count as
#' impossible; if the posterior comes near the end of the region, the check of [calibrate()] says so.
#'
#' @param ensemble An ensemble made by [simulate_design()], or by this.
#' @param fit A calibration with the emulator trained on it ([calibrate()]).
#' @param runs Number of runs to add.
#' @inheritParams simulate_design
#' @return An ensemble with a `region`. Train and calibrate anew.
#' @export
refine_ensemble <- function(ensemble, fit, runs = 40, threads = 1) {
  check_input(checkmate::check_class(ensemble, "amiss_ensemble"), "ensemble")
  check_input(checkmate::check_class(fit, "amiss_calibration"), "fit")
  check_input(checkmate::check_count(runs, positive = TRUE), "runs")
  threads <- check_threads(threads)
  if (is.null(ensemble$simulator)) {
    abort_input(c("The runs of this ensemble were made elsewhere, and so must more of them be.",
                  i = "Run the simulator at draws of {.code fit$values} and give all runs to {.fun ensemble}."))
  }
  if (!identical(names(ensemble$parameters), names(fit$emulator$parameters))) {
    abort_input("{.arg fit} has the parameters {.val {names(fit$emulator$parameters)}}, the ensemble {.val {names(ensemble$parameters)}}.")
  }
  if (nrow(ensemble$outputs) != length(fit$rows)) {
    abort_input(c("{.arg fit} was made on {length(fit$rows)} rows, the runs of {.arg ensemble} have {nrow(ensemble$outputs)}.",
                  i = "Give the ensemble and the calibration of the same measurements."))
  }
  regional_ensemble(ensemble, posterior_region(fit, if (isTRUE(fit$check$border > largest_border_share)) 1.5 else 1), fit, runs, threads)
}

# The ensemble of a region of the parameters' space; `fit` knows the emulator over the priors.
regional_ensemble <- function(ensemble, region, fit, runs, threads) {
  unit <- region_design(region, runs, ensemble$seed)
  values <- unit_to_values(unit, ensemble$parameters)
  outputs <- simulate_measured(ensemble$simulator, values, fit$measurements, "calibrate", threads)
  # The last of the runs that lie inside: those of checks, where the posterior was seen last.
  own <- utils::tail(which(in_region(region, ensemble$unit)), 40)
  new_ensemble(ensemble$parameters, rbind(ensemble$unit[own, , drop = FALSE], unit), rbind(ensemble$values[own, , drop = FALSE], values),
               cbind(ensemble$outputs[, own, drop = FALSE], outputs), ensemble$simulator, ensemble$seed, region,
               without_simulator(emulator_over_priors(fit$emulator)))
}

# The ensemble with more runs, of its own region.
join_runs <- function(ensemble, unit, values, outputs) {
  new_ensemble(ensemble$parameters, rbind(ensemble$unit, unit), rbind(ensemble$values, values), cbind(ensemble$outputs, outputs),
               ensemble$simulator, ensemble$seed, ensemble$region, ensemble$over_priors)
}

# The simulator is kept once.
without_simulator <- function(emulator) {
  emulator["simulator"] <- list(NULL)
  emulator
}

#' @rdname simulate_design
#' @param design Matrix of parameter values, one run a row, named columns.
#' @param outputs Matrix of outputs at the calibration rows of the measurements, one run a column.
#' @param parameters The [free()] parameters that the columns of `design` are, in a list; if not given, each gets a
#'   uniform prior over the range of its column.
#' @export
ensemble <- function(design, outputs, parameters = NULL) {
  design <- as.matrix(design)
  outputs <- as.matrix(outputs)
  check_input(checkmate::check_matrix(design, "numeric", any.missing = FALSE, min.cols = 1, col.names = "unique"), "design")
  check_input(checkmate::check_matrix(outputs, "numeric"), "outputs")
  storage.mode(design) <- storage.mode(outputs) <- "double"
  if (nrow(design) != ncol(outputs)) {
    abort_input(c("{.arg design} has {nrow(design)} rows and {.arg outputs} {ncol(outputs)} columns; each row of the design needs its run.",
                  i = "Give the outputs as one column per run."))
  }
  check_enough_runs(nrow(design), ncol(design))
  if (is.null(parameters)) {
    for (name in colnames(design)) check_varies(name, design[, name])
    parameters <- lapply(colnames(design), function(name) free(name, uniform(min(design[, name]), max(design[, name]))))
  }
  names(parameters) <- vapply(parameters, `[[`, "", "name")
  absent <- setdiff(names(parameters), colnames(design))
  if (length(absent)) abort_input("{.arg design} lacks {cli::qty(absent)}column{?s} {.val {absent}}.")
  values <- design[, names(parameters), drop = FALSE]
  unit <- values
  for (name in names(parameters)) {
    prior <- parameters[[name]]$prior
    outside <- which(values[, name] < prior$lower | values[, name] > prior$upper)
    if (length(outside) == nrow(values)) {
      abort_input(c("No run lies where the prior of {.val {name}} has mass: {format(prior)}, while the runs span {signif(min(values[, name]), 4)} to {signif(max(values[, name]), 4)}.",
                    i = "Correct the prior or make runs inside it."))
    }
    if (length(outside)) {
      abort_input(c("{length(outside)} run{?s} lie{?s/} outside the prior of {.val {name}}; the first is run {outside[1]} with value {values[outside[1], name]}.",
                    i = "Widen the prior or leave these runs out."))
    }
    unit[, name] <- prior_cdf(prior, values[, name])
    check_covered(name, prior, values[, name], unit[, name])
  }
  made <- new_ensemble(parameters, unname(unit), values, outputs, NULL, NA)
  uncovered <- uncovered_statement(made)
  if (!is.null(uncovered)) {
    warn_input(c("{toupper(substr(uncovered, 1, 1))}{substring(uncovered, 2)}.",
                 i = "The emulator extrapolates over the rest: add runs there or narrow the prior."))
  }
  made
}

check_varies <- function(name, values, call = rlang::caller_env()) {
  if (diff(range(values)) == 0) {
    abort_input(c("Parameter {.val {name}} has the same value, {signif(values[1], 4)}, in all {length(values)} runs.",
                  i = "Vary it, or leave it out of the design."), call = call)
  }
}

# Runs that all lie in a sliver of the prior say nothing about the parameter.
check_covered <- function(name, prior, values, unit, call = rlang::caller_env()) {
  check_varies(name, values, call)
  share <- diff(range(unit))
  if (share < 0.05) {
    abort_input(c("The runs lie where the prior of {.val {name}} has next to no mass: {format(prior)} has {signif(100 * share, 2)} % of it between {signif(min(values), 4)} and {signif(max(values), 4)}.",
                  i = "Correct the prior or make runs where its mass is."), call = call)
  }
}

# The parameters whose prior reaches further than the runs, or NULL. Of M points scattered over the prior, the range
# holds a Beta(M - 1, 2) share of its mass: what happens to one design in a thousand, and leaves out a tenth, is told.
uncovered_statement <- function(ensemble) {
  if (!is.null(ensemble$region)) return(NULL)
  runs <- nrow(ensemble$unit)
  share <- apply(ensemble$unit, 2, function(u) diff(range(u)))
  little <- which(share < min(0.9, stats::qbeta(0.001, runs - 1, 2)))
  if (!length(little)) return(NULL)
  spans <- vapply(little, function(p) {
    span <- format(signif(range(ensemble$values[, p]), 4))
    sprintf("%.0f %% of the prior of %s (from %s to %s)", 100 * share[p], names(ensemble$parameters)[p], trimws(span[1]), trimws(span[2]))
  }, "")
  paste("the runs cover only", paste(spans, collapse = ", "))
}

check_enough_runs <- function(runs, parameters, of = runs, call = rlang::caller_env()) {
  if (runs < max(5, parameters + 2)) {
    abort_input(c("{runs} run{?s} {?is/are} too few for {parameters} parameter{?s}; at least {max(5, parameters + 2)} are needed.",
                  i = "Ten times the number of parameters is a good start.",
                  if (of != runs) c(i = "Of the {of} runs asked for, {runs} fill the space of the parameters; the others lie where the posterior does ({.code control$refine}).")), call = call)
  }
}

unit_to_values <- function(unit, parameters) {
  values <- vapply(seq_along(parameters), function(p) prior_quantile(parameters[[p]]$prior, unit[, p]), numeric(nrow(unit)))
  matrix(values, nrow(unit), dimnames = list(NULL, names(parameters)))
}

# `region`: where the runs lie, if not everywhere; `over_priors`: the emulator of runs that do.
new_ensemble <- function(parameters, unit, values, outputs, simulator, seed, region = NULL, over_priors = NULL, call = rlang::caller_env()) {
  failed <- which(colSums(!is.finite(outputs)) > 0)
  if (length(failed)) {
    left <- ncol(outputs) - length(failed)
    if (left < max(5, length(parameters) + 2)) {
      abort_input(c("{length(failed)} of {ncol(outputs)} runs hold values that are not finite; {left} usable run{?s} {?is/are} too few.",
                    x = "The first is run {failed[1]} at {paste(colnames(values), signif(values[failed[1], ], 4), sep = ' = ', collapse = ', ')}.",
                    i = "Find out why the simulator fails there, or narrow the priors."), call = call)
    }
    warn_input(c("{length(failed)} of {ncol(outputs)} runs hold values that are not finite and {?is/are} left out.",
                 i = "The first is run {failed[1]} at {paste(colnames(values), signif(values[failed[1], ], 4), sep = ' = ', collapse = ', ')}."))
    outputs <- outputs[, -failed, drop = FALSE]
    unit <- unit[-failed, , drop = FALSE]
    values <- values[-failed, , drop = FALSE]
  }
  structure(list(format_version = format_version, parameters = parameters, unit = unit, values = values, outputs = outputs,
                 simulator = simulator, failed = length(failed), seed = seed, region = region, over_priors = over_priors), class = "amiss_ensemble")
}

#' @export
print.amiss_ensemble <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong Ensemble}: {ncol(x$outputs)} runs of {nrow(x$outputs)} steps over {length(x$parameters)} parameter{?s}{if (x$failed) paste0(' (', x$failed, ' failed)') else ''}")
  cli::cli_bullets(c("*" = "parameters {.field {names(x$parameters)}}", if (!is.null(x$region)) c("*" = "in the region where a posterior lies"), ">" = "next: {.fun train_emulator}"))
})
