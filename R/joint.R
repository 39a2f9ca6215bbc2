# Several records at once: targets of one simulator, or objects that share parameters. Each record
# has its own error, its own discrepancy and, if there are several, its own simulator; parameters of
# the same name are one parameter.

#' Calibrate several records together
#'
#' Calibrates one set of parameters on two or more measured series, each with its own noise, error
#' and discrepancy. Examples are temperature and heat flux of one room, two rooms, or two houses
#' with the same walls.
#'
#' Given the parameters the records are independent. Parameters of the same name are one parameter
#' with one prior. Others belong to the records whose simulators have them. [rename_parameters()]
#' gives a parameter another name in one record.
#'
#' Emulators are trained and checked by runs for each record. They are refined where the joint
#' posterior lies, as [calibrate_refined()] does for one record.
#'
#' @param simulators Named list of simulators, one for each record. [outputs_of()] makes them of one
#'   function with several outputs; [zone_flux()] is the heat flux into a wall of a zone.
#' @param measurements Named list of [measurements()], with the same names.
#' @param runs `simulate_jointly()`: runs of each simulator, all of one design.
#'   `calibrate_jointly()`: as in [calibrate_refined()], for each record.
#' @param ensembles Named list of ensembles: those of `simulate_jointly()`, or of [ensemble()] for
#'   runs that were made elsewhere (which are checked, but not refined).
#' @inheritParams calibrate_refined
#' @return `simulate_jointly()`: a named list of ensembles.
#'
#'   `calibrate_jointly()`: an object of class `amiss_joint` with
#'   * `records`: a named list of calibrations ([calibrate()]) whose draws are those of the joint
#'     posterior. Use them for [discrepancy()], `predict()`, `plot()` and all else that concerns one
#'     record.
#'   * `values`, `weights`: draws of all parameters.
#'   * `log_evidence`, `standard_error`, `interval`: the evidence, a density of all records.
#'   * `trust`.
#'   * `rounds`, `runs_made`: as in [calibrate_refined()].
#'
#'   `coef()`, `confint()`, `vcov()`, `tidy()`, `as.data.frame()`, `predict()` (a list by record)
#'   and [bayes_factor()] work on it.
#' @section Errors: `amiss_error_input` if names differ, a parameter has two priors, or fewer than
#'   two records are given.
#' @source The joint posterior is that of [calibrate()] with the product of the records'
#'   likelihoods; `vignette("algorithm", "amiss")`, *Several records*.
#' @seealso [attribute_discrepancy()] says which conditions drive the discrepancy of each record,
#'   and of all. [upgrade_model()] takes several records as well.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4))
#' table$Ti <- 20 + 0.4 * table$Te + 0.1 * cos(1:96 * 1.7)
#' table$flux <- 3 - 2 * table$Te + 0.5 * cos(1:96 * 2.3)
#' record <- function(target, noise_sd) {
#'   measurements(table, time = "hour", target = target, boundary = ~ Te, noise_sd = noise_sd,
#'                validate = table$hour > 72)
#' }
#' both <- list(Ti = record("Ti", 0.1), flux = record("flux", 0.5))
#' wall <- function_simulator(function(values, drivers) {
#'   warmed <- values[["gain"]] * drivers[, "Te"]
#'   cbind(Ti = 20 + warmed, flux = 3 - 5 * warmed)
#' }, free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_jointly(outputs_of(wall, c("Ti", "flux")), both, runs = 20, seed = 1)
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)))  # coarse, for speed
#' fit <- calibrate_jointly(runs, both, control = quick, seed = 1)
#' fit
#' confint(fit)
#' @export
calibrate_jointly <- function(ensembles, measurements, rounds = rules$verify_rounds, runs = NULL,
                              control = NULL, seed = NULL, threads = 1, quiet = FALSE) {
  check_arguments()
  hush(quiet)
  check_records(ensembles, measurements, "ensembles",
                function(x) check_object(x, "amiss_ensemble", "ensembles"))
  check_one_prior(lapply(ensembles, `[[`, "parameters"))
  measurements <- measurements[names(ensembles)]
  control <- check_refining(measurements, rounds, runs, control)
  calibrate_ensembles(ensembles, measurements, rounds, runs, control, pick_seed(seed),
                      check_threads(threads))
}

#' @rdname calibrate_jointly
#' @export
simulate_jointly <- function(simulators, measurements, runs = 150, seed = NULL, threads = 1,
                             quiet = FALSE) {
  check_arguments()
  hush(quiet)
  check_records(simulators, measurements, "simulators", check_simulator)
  check_input(checkmate::check_count(runs, positive = TRUE), "runs")
  for (m in measurements) check_run_number(runs, length(m$raw$hours))
  threads <- check_threads(threads)
  each <- lapply(simulators, free_parameters)
  check_one_prior(each)
  all <- do.call(c, unname(each))
  all <- all[!duplicated(names(all))]
  if (!length(all)) {
    abort_input(c("The simulators have no free parameter.", i = "Replace a number by {.fun free}."))
  }
  check_enough_runs(runs, length(all))
  seed <- pick_seed(seed)
  unit <- with_seed(seed, lhs::randomLHS(runs, length(all)))
  colnames(unit) <- names(all)
  Map(function(simulator, parameters, m) {
    if (!length(parameters)) {
      abort_input(paste("The simulator {.val {simulator$name}} has no free parameter; its record",
                        "says nothing of any."))
    }
    own <- unname(unit[, names(parameters), drop = FALSE])
    values <- unit_to_values(own, parameters)
    new_ensemble(parameters, own, values,
                 simulate_measured(simulator, values, m, "calibrate", threads), simulator, seed,
                 hours = row_hours(m, "calibrate"))
  }, simulators, each, measurements[names(simulators)])
}

check_records <- function(x, measurements, name, check_one, least = 2, call = rlang::caller_env()) {
  check_input(checkmate::check_list(x, min.len = least, names = "unique"), name,
              "Give a named list, one element for each record.", call = call)
  for (one in x) check_one(one)
  check_input(checkmate::check_list(measurements, min.len = least, names = "unique"),
              "measurements", "Give a named list, one element for each record.", call = call)
  for (m in measurements) check_object(m, "amiss_measurements", "measurements", call = call)
  if (!setequal(names(x), names(measurements))) {
    abort_input(c(paste("{.arg {name}} are of {.val {names(x)}}, {.arg measurements} of",
                        "{.val {names(measurements)}}."),
                  i = "Give one of each for every record, under the same name."), call = call)
  }
}

#' @export
print.amiss_joint <- function(x, ...) on_stdout(x, {
  cli::cli_text(
    "{.strong Joint calibration} of {length(x$records)} records: {.val {names(x$records)}}")
  cli::cli_text("log10 evidence {evidence_words(x)}, {x$trust$verdict}")
  say_parameters(x, 4)
  for (name in names(x$records)) {
    fit <- x$records[[name]]
    cli::cli_bullets(c("*" = "{name} ({length(fit$rows)} rows): {fit$check$verdict}"))
    cli::cli_bullets(finding_bullets(fit_findings(fit)$says))
  }
  cli::cli_bullets(c(">" = paste("next: {.fun attribute_discrepancy}, {.fun upgrade_model}, or",
                                 "{.code $records} one by one")))
})

#' @export
summary.amiss_joint <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  object
}

#' @export
coef.amiss_joint <- function(object, ...) coef.amiss_fit(object, ...)

#' @export
confint.amiss_joint <- function(object, parm = NULL, level = 0.95, ...)
  confint.amiss_fit(object, parm, level, ...)

#' @export
vcov.amiss_joint <- function(object, ...) vcov.amiss_fit(object, ...)

#' @export
tidy.amiss_joint <- function(x, conf.level = 0.95, ...) tidy.amiss_fit(x, conf.level, ...)

#' @export
as.data.frame.amiss_joint <- function(x, row.names = NULL, optional = FALSE,
                                      draws = nrow(x$values), ...) {
  as.data.frame.amiss_fit(x, row.names, optional, draws, ...)
}

# By record, as predict() has it.
#' @export
fitted.amiss_joint <- function(object, ...) {
  check_whole(object, "object")
  lapply(object$records, stats::fitted, ...)
}

#' @export
residuals.amiss_joint <- function(object, ...) {
  check_whole(object, "object")
  lapply(object$records, stats::residuals, ...)
}

#' @export
simulate.amiss_joint <- function(object, nsim = 1, seed = NULL, ...) {
  check_whole(object, "object")
  seed <- pick_seed(seed)
  lapply(object$records, stats::simulate, nsim, seed, ...)
}

#' @export
nobs.amiss_joint <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  sum(vapply(object$records, stats::nobs, 0L))
}

#' @export
logLik.amiss_joint <- function(object, ...) logLik.amiss_fit(object, ...)

#' @exportS3Method loo::loo
loo.amiss_joint <- function(x, ...) loo.amiss_fit(x)

# Of the emulators the largest numbers; `sigma` is in units of the noise.
#' @export
glance.amiss_joint <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  decades <- c(x$log_evidence, x$interval) / log(10)
  each <- lapply(unname(x$records), generics::glance)
  largest <- function(column) max(vapply(each, function(g) as.numeric(g[[column]]), 0))
  left <- left_by_simulation(x)
  data.frame(log10_evidence = decades[1], lower95 = decades[2], upper95 = decades[3],
             trusted = x$trust$trusted, emulator_error = x$check$ratio %||% NA_real_,
             sigma = sqrt(sum(left^2) / max(1, length(left) - length(x$parameters))),
             nobs = stats::nobs(x), vectors = largest("vectors"), runs = largest("runs"),
             records = length(x$records))
}

# Records need not share conditions nor clocks: a list by record.
#' @export
augment.amiss_joint <- function(x, data = NULL, newdata = NULL, ...) {
  check_whole(x, "x")
  lapply(stats::setNames(nm = names(x$records)), function(name) {
    generics::augment(x$records[[name]], data = data[[name]], newdata = newdata[[name]], ...)
  })
}

#' @export
as.matrix.amiss_joint <- function(x, draws = nrow(x$values), ...) as.matrix.amiss_fit(x, draws, ...)

#' @exportS3Method posterior::as_draws_matrix
as_draws_matrix.amiss_joint <- function(x, draws = nrow(x$values), ...)
  as_draws_matrix.amiss_fit(x, draws, ...)

#' @exportS3Method posterior::as_draws_df
as_draws_df.amiss_joint <- function(x, draws = nrow(x$values), ...)
  as_draws_df.amiss_fit(x, draws, ...)

#' @exportS3Method posterior::as_draws
as_draws.amiss_joint <- as_draws_df.amiss_joint

#' @export
predict.amiss_joint <- function(object, newdata = NULL, ...) {
  check_whole(object, "object")
  if (!is.null(newdata)) {
    check_input(checkmate::check_list(newdata, names = "unique"), "newdata",
                "Give a list by record.")
    unknown <- setdiff(names(newdata), names(object$records))
    if (length(unknown)) {
      abort_input(
        "{.arg newdata} names {.val {unknown}}; the records are {.val {names(object$records)}}.")
    }
  }
  lapply(stats::setNames(nm = names(newdata) %||% names(object$records)), function(name) {
    stats::predict(object$records[[name]], newdata[[name]], ...)
  })
}

#' @export
calibrated_record.amiss_joint <- function(fit) lapply(fit$records, calibrated_record)

# Which conditions drive the discrepancies: of each record, and the same conditions in all that have
# them.
#' @export
attribute_discrepancy.amiss_joint <- function(fit, control = NULL, seed = fit$seed, threads = 1) {
  check_whole(fit, "fit")
  seed <- pick_seed(seed)
  threads <- check_threads(threads)
  fits <- fit$records
  each <- lapply(stats::setNames(seq_along(fits), names(fits)), function(which) {
    staged(names(fits)[which], attribute_record(unname(fits), which, control, seed, threads))
  })
  together <- attributed_together(fits, each, control, seed, threads)
  structure(c(list(format_version = format_version, records = each), together, list(seed = seed)),
            class = "amiss_joint_attribution")
}

# list(table, groups, lost): a row for each condition that any record has, with the evidence lost if
# it is dropped from all discrepancies, and the least p-value among the records, times their number
# (Bonferroni); the same of groups that some record cannot tell apart, where the records together
# cannot either; and the evidence lost by single conditions.
attributed_together <- function(fits, each, control, seed, threads) {
  records <- engine_records(fits)
  draws <- engine_draws(fits)
  filled <- fill_attribution_control(control, fits[[1]]$control$ais,
                                     length(fits[[1]]$measurements$conditions))
  # `own`: p-values of each record that has them.
  dropped_from_all <- function(conditions, own) {
    at <- lapply(unname(fits),
                 function(fit) which(fit$measurements$conditions %in% conditions) - 1L)
    dropped <- staged("attributing the discrepancies together", call_engine(
      drop_conditions_(records, draws, at, filled$ais, engine_context(seed, threads))))
    p <- min(1, sum(lengths(at) > 0) * min(1, own))
    list(log10_bf_dropped = dropped$lost / log(10),
         standard_error = dropped$standard_error / log(10), p_value = p,
         significant = is_significant(dropped$lost / log(10), p, filled),
         trusted = dropped$trusted)
  }
  conditions <- unique(unlist(lapply(fits, function(fit) fit$measurements$conditions)))
  rows <- lapply(conditions, function(condition) {
    has <- Filter(function(a) condition %in% a$table$boundary, each)
    told <- vapply(has, function(a) a$table$significant[a$table$boundary == condition], NA)
    p <- vapply(has, function(a) a$p_value_own[[condition]], 0)
    data.frame(boundary = condition, dropped_from_all(condition, p), group = NA_character_,
               records = paste(names(which(told)), collapse = ", "))
  })
  table <- do.call(rbind, rows)
  seen <- do.call(c, unname(lapply(each, `[[`, "groups")))
  groups <- lapply(unique(lapply(seen, `[[`, "conditions")), function(conditions) {
    own <- Filter(function(group) identical(group$conditions, conditions), seen)
    c(list(conditions = conditions),
      dropped_from_all(conditions, vapply(own, `[[`, 0, "p_value")),
      list(correlation = min(vapply(own, `[[`, 0, "correlation"))))
  })
  lost <- by_condition_set(table$log10_bf_dropped, conditions)
  # A member that is significant by itself is known apart.
  alone <- table$boundary[table$significant]
  groups <- Filter(function(group) group$significant && !any(group$conditions %in% alone), groups)
  table <- with_groups(table, groups)
  table <- table[order(-table$log10_bf_dropped), ]
  rownames(table) <- NULL
  list(table = table, groups = groups, lost = lost)
}

#' @export
print.amiss_joint_attribution <- function(x, ...) on_stdout(x, {
  x <- told_attribution(x)
  cli::cli_text(
    "{.strong Attribution} of the discrepancies of {.val {names(x$records)}}, together:")
  say_table(x$table[c("boundary", "log10_bf_dropped", "p_value", "significant", "records")])
  for (name in names(x$records)) {
    named <- significant_conditions(x$records[[name]]$table)
    cli::cli_bullets(c("*" = if (length(named)) "{name}: driven by {.field {named}}"
                             else "{name}: no boundary condition is significant"))
  }
  say_bullets(group_words(x), "!")
})

#' @export
tidy.amiss_joint_attribution <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  each <- Map(function(name, attribution) cbind(record = name, attribution$table), names(x$records),
              x$records)
  do.call(rbind, unname(each))
}
