#' Fitted values, evidence and repetition of a calibration
#'
#' Methods of a fitted model for a calibration. For an upgrade they are those of its last model.
#'
#' @section The likelihood: `logLik()` is an error, and so are `AIC()` and `BIC()`. The discrepancy
#'   is integrated out and its settings are shares and grids with priors. No number of free
#'   parameters goes with a greatest likelihood.
#'
#'   Compare models by the evidence, `log_evidence` of the fit ([bayes_factor()]; `logml()` and
#'   `bf()` of the package `bridgesampling` give it as well). AIC and BIC of the simulator fitted by
#'   least squares are among the criteria of [compare_models()].
#'
#'   `loo()` of the package `loo` is an error as well. It leaves out one row at a time, but the
#'   neighbours of a row in a time series give it away. Judge predictions by rows that are held out
#'   (`validate` of [measurements()]).
#'
#' @param object,x A calibration ([calibrate()], [calibrate_paper()]) or, except for `update()`, an
#'   upgrade ([upgrade_model()]).
#' @param data Not used; the record is part of the fit.
#' @param newdata As in [predict.amiss_fit()].
#' @param emulator,measurements What is calibrated; by default the same again.
#' @param control Options that change; the others stay as they were given.
#' @param ... Only used by `augment()` with `newdata`: arguments of [predict.amiss_fit()]. An
#'   argument that is not known is an error.
#' @inheritParams calibrate
#' @return
#'   * `fitted()`: the posterior mean of the simulation at the calibration rows, without the
#'     discrepancy.
#'   * `residuals()`: what `fitted()` leaves.
#'   * `nobs()`: the number of these rows.
#'   * `glance()`: a data frame of one row, see below.
#'   * `augment()`: the record with `.fitted` and `.resid`; with `newdata` its prediction, with
#'     `.lower` and `.upper` too.
#'   * `update()`: a new calibration by the same emulator. A calibration that was refined for its
#'     region is not refined again.
#'
#'   The columns of `glance()` are `log10_evidence` and its interval, `trusted`, `emulator_error`
#'   (of the check by runs, in units of the noise), `sigma` (of what the simulation leaves), `nobs`,
#'   `vectors` and `runs`.
#'
#'   For an upgrade there are also
#'   * `adopted`: the number of mechanisms adopted.
#'   * `named_cause`, `log10_bf`: the cause and its log10 Bayes factor, as `print()` and
#'     `candidates` of the upgrade have it. `NA` if no cause is named or likely.
#'   * `gain_beside_unknown`: the log10 Bayes factor of the last model against the first, if both
#'     have unknown responses to all their conditions. These responses imitate mechanisms, and the
#'     factor is often much smaller than `log10_bf`.
#'   * `rmse_before`, `rmse_after`, `rmse_validation_before`, `rmse_validation_after`: errors of the
#'     first and the last model, on calibration rows and on rows held out.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(ais = list(pilot_chains = 48, groups = 4))  # a coarse sampler, for speed
#' fit <- calibrate(train_emulator(runs, room), room, quick, seed = 1)
#' glance(fit)
#' head(augment(fit))
#' sqrt(mean(residuals(fit)^2))
#' update(fit, control = list(inclusion = 0.5))
#' @name fit
NULL

#' @rdname fit
#' @export
fitted.amiss_fit <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  simulated_mean(object)
}

#' @rdname fit
#' @export
residuals.amiss_fit <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  left_by_mean(object)
}

#' @rdname fit
#' @export
nobs.amiss_fit <- function(object, ...) {
  check_whole(object, "object")
  if (!identical(...names(), "use.fallback")) rlang::check_dots_empty()  # sigma() gives it that
  length(object$rows)
}

#' @rdname fit
#' @export
logLik.amiss_fit <- function(object, ...) {
  check_whole(object, "object")
  abort_input(c(
    "A calibration has no greatest likelihood with a number of free parameters.",
    x = "Its discrepancy is integrated out.",
    i = "Compare models by the evidence: {.fun bayes_factor}, or {.code $log_evidence} of the fit.",
    i = "AIC and BIC of the least-squares fit are among the criteria of {.fun compare_models}."))
}

#' @rdname fit
#' @exportS3Method loo::loo
loo.amiss_fit <- function(x, ...) {
  check_whole(x, "x")
  abort_input(c(
    "{.fun loo} is not for calibrations on a time series.",
    x = paste("Rows of a record are not exchangeable: the neighbours of a row that is left out",
              "give it away, and its score says little."),
    i = paste("Hold rows out by {.arg validate} of {.fun measurements}, and compare them with",
              "{.code predict(use = \"validate\")}."),
    i = "Compare models by the evidence: {.fun bayes_factor}, or {.code $log_evidence}."))
}

#' @rdname fit
#' @export
update.amiss_fit <- function(object, emulator = object$emulator, measurements = object$measurements,
                             control = NULL, seed = object$seed, threads = 1, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  check_input(checkmate::check_list(control, null.ok = TRUE), "control",
              "Give a list of named options.")
  control <- utils::modifyList(given_control(object), as.list(control))
  calibrator(object)(emulator, measurements, control, seed = seed, threads = threads)
}

# The options that differ from what they would be if none were given. The others may follow from the
# measurements.
given_control <- function(fit) {
  defaults <- default_control(fit)
  given <- changed(fit$control, defaults)
  if (!is.null(given$ais)) given$ais <- changed(given$ais, defaults$ais)
  given
}

changed <- function(options, defaults) {
  options[!vapply(names(options), function(n) identical(options[[n]], defaults[[n]]), NA)]
}

#' @rdname fit
#' @export
glance.amiss_fit <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  decades <- c(x$log_evidence, x$interval) / log(10)
  data.frame(log10_evidence = decades[1], lower95 = decades[2], upper95 = decades[3],
             trusted = x$trust$trusted, emulator_error = x$check$ratio %||% NA_real_,
             sigma = error_sd(x),
             nobs = length(x$rows), vectors = ncol(x$emulator$basis$vectors),
             runs = nrow(x$emulator$processes$inputs))
}

#' @rdname fit
#' @export
augment.amiss_fit <- function(x, data = NULL, newdata = NULL, ...) {
  check_whole(x, "x")
  if (!is.null(data)) {
    abort_input(c("{.arg data} is not used: the record is part of the fit.",
                  i = "Another record is {.arg newdata}."))
  }
  if (!is.null(newdata)) return(augment_prediction(x, stats::predict(x, newdata, ...)))
  rlang::check_dots_empty()
  m <- x$measurements
  conditions <- lapply(stats::setNames(nm = m$conditions),
                       function(name) condition_values(m, name)[x$rows])
  simulated <- simulated_mean(x)
  out <- data.frame(time = m$time[x$rows], target = m$y[x$rows], conditions, .fitted = simulated,
                    .resid = m$y[x$rows] - simulated, check.names = FALSE)
  names(out)[2] <- m$target
  out
}

augment_prediction <- function(fit, prediction) {
  ends <- grep("^(lower|upper)", names(prediction), value = TRUE)
  told <- intersect(c("time", "observed", "use", "segment", "horizon"), names(prediction))
  out <- data.frame(prediction[told], .fitted = prediction$mean,
                    .lower = prediction[[ends[1]]], .upper = prediction[[ends[2]]],
                    .resid = prediction$observed - prediction$mean)
  names(out)[2] <- fit$measurements$target
  out
}

#' Summary of a calibration
#'
#' @param object A calibration ([calibrate()], [calibrate_paper()]).
#' @param x Its summary.
#' @param ... Not used: an argument that is not known is an error.
#' @return A list of `parameters` ([tidy()][posterior]), `glance` ([glance()][fit]), and in words
#'   `error`, `evidence`, `modes`, `failing`, `edge`, `record` (its faults), `reach`, `check` and
#'   `trust`.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(ais = list(pilot_chains = 48, groups = 4))  # a coarse sampler, for speed
#' fit <- calibrate(train_emulator(runs, room), room, quick, seed = 1)
#' summary(fit)
#' @export
summary.amiss_fit <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  structure(list(name = object$measurements$name, unit = object$measurements$unit,
                 parameters = generics::tidy(object), glance = generics::glance(object),
                 error = error_sentence(object), evidence = evidence_words(object),
                 modes = mode_words(object), failing = failing_sentence(object),
                 edge = edge_sentence(object),
                 reach = if (!is.null(object$reach)) reach_words(object),
                 record = fit_findings(object)$says, check = object$check$verdict,
                 trust = object$trust$verdict),
            class = "summary.amiss_fit")
}

#' @rdname summary.amiss_fit
#' @export
print.summary.amiss_fit <- function(x, ...) {
  on_stdout(x, {
    cli::cli_text("{.strong Calibration} on {x$glance$nobs} rows of {.val {x$name}}")
    cli::cli_text("log10 evidence {x$evidence}, {x$trust}")
    cli::cli_text("{x$error}")
    say_first(tidy_words(x$parameters), 6)
    say_bullets(c(x$modes, x$failing, x$edge), "!")
    cli::cli_bullets(finding_bullets(x$record))
    then <- if (is.null(x$reach)) "its {.code index} of the boundary conditions"
            else "{.fun attribute_discrepancy}"
    cli::cli_bullets(c("*" = as_said(x$reach), "*" = as_said(x$check),
                       ">" = paste("next: {.fun predict}, {.fun confint} or", then)))
  })
}

# The table of tidy() as people read it: physical values and shares of modes only if they say
# something.
tidy_words <- function(table) {
  told <- same_decimals(table$estimate, table$conf.low, table$conf.high)
  physical <- same_decimals(table$estimate, table$physical.low, table$physical.high)
  words <- data.frame(parameter = labels_with_names(table$label, table$term),
                      unit = pretty_unit(table$unit), estimate = told$estimate,
                      std.error = short(table$std.error), conf.low = told$lower,
                      conf.high = told$upper)
  if (!anyNA(table$physical.low))
    words[c("physical.low", "physical.high")] <- physical[c("lower", "upper")]
  if (any(table$modes > 1)) words$share <- share_words(table)
  words
}
