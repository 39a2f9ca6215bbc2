emulator_control <- list(explained = 0.99, noise_fraction = 0.05, max_vectors = 30,
                         selection = "ard", significance = 0.05,
                         s2 = c(1, 1), eta2 = c(1, 1), beta = c(1, 1), lambda = c(2, NA),
                         starts = 3, searches = 1, max_evaluations = 120)

#' Train the emulator of an ensemble
#'
#' Puts the runs on a basis and gives each coefficient a Gaussian process over the parameters. The
#' basis is the singular vectors of the centred runs and a vector of ones.
#'
#' # Mode
#'
#' The hyper-parameters are those of the greatest joint density (equation 3 of the paper):
#' likelihood times priors. Variances are widened afterwards (*Errors*). The density is one of `s2`,
#' `eta2`, `beta` (all in (0, 1)) and `lambda` themselves. The search runs on logits and logarithms,
#' but no Jacobian enters. With the uniform default priors, `s2`, `eta2` and `beta` are therefore
#' those of the greatest likelihood.
#'
#' # Selection
#'
#' `"ard"` gives each parameter its own `beta` at once.
#'
#' `"forward"` is the forward selection of Welch et al. (1992). All parameters share one `beta` at
#' first. At each stage each parameter that still shares it is given its own `beta` in turn. The
#' parameter that raises the joint density most keeps its own. The selection ends when twice that
#' rise is not significant as chi-squared with one degree of freedom at `significance / k`, because
#' the best of k candidates was taken (Bonferroni). The selection is greedy and costs about 17 times
#' as many evaluations. On the boxes of [paper_box()] its leave-one-out errors are about 2 % larger.
#'
#' # Errors
#'
#' A run's coefficient varies about the smooth part of its process by the nugget and `1 / lambda`,
#' like those of the training runs. Both belong to the variance of a prediction and of a run left
#' out.
#'
#' The series of a run also holds what the basis leaves out. `basis$discarded_sd` is its standard
#' deviation at each step, from the training runs. Because the basis was chosen with these runs, it
#' is raised by `M / (M - Q + 1)`, as in generalised cross-validation (Golub, Heath and Wahba 1979).
#'
#' The mode ignores the uncertainty of the hyper-parameters, and the covariance function is only a
#' model. If the leave-one-out errors of a coefficient are larger than stated, all its variances are
#' therefore widened (Bachoc 2013). The factor is the mean square of these errors in units of their
#' standard deviations. Means stay as they are.
#'
#' The leave-one-out errors are of hyper-parameters that have not seen the run left out. They are
#' those of the mode, moved by one Newton step away from the density of that run. This is the
#' infinitesimal jackknife with the run's leverage and the average information of Gilmour, Thompson
#' and Cullis (1995). At the mode itself the errors would be too small
#' (`bench/emulator_coverage.R`).
#'
#' @param ensemble An ensemble: [simulate_design()] or [ensemble()].
#' @param noise_sd Standard deviation of the measurement noise, or the [measurements()], which know
#'   it. Vectors are kept until `explained` is reached and what is left out (RMS) is below
#'   `noise_fraction` of the noise, but at most `max_vectors`.
#' @param control List of options, with their defaults:
#'   * `explained`: share of variance kept (0.99).
#'   * `noise_fraction`: discarded RMS as a share of the noise (0.05).
#'   * `max_vectors`: most basis vectors (30).
#'   * `selection`: `"ard"` or `"forward"` (`"ard"`).
#'   * `significance`: of the forward selection (0.05).
#'   * `s2`, `eta2`, `beta`: the two shapes of their beta priors, each at least 1 (`c(1, 1)`,
#'     uniform).
#'   * `lambda`: shape a and rate b of the gamma prior of the noise precision (`c(2, NA)`). The rate
#'     is in the squared unit of the outputs. `NA` is the square root of the machine epsilon times
#'     the square of the largest singular value. If the basis leaves nothing out, this is noise at
#'     each step of 1.7e-4 of the runs' RMS.
#'   * `starts`: points looked at by the gradient search (3).
#'   * `searches`: searches from the best of these points (1).
#'   * `max_evaluations`: evaluations of each search (120).
#' @param threads Number of threads; results do not depend on it.
#' @return An object of class `amiss_emulator`:
#'   * `basis`, `processes`: the basis and the Gaussian processes.
#'   * `selection`: a data frame of the steps of the forward selection, with `vector`, `step`,
#'     `parameter` and `gain` of the log density.
#'   * `diagnostics`: leave-one-out errors (*Errors*), see below.
#'   * `trust`: `trusted`, and `verdict`, which says what is wrong with the emulator.
#'
#'   The elements of `diagnostics` are
#'
#'   * `coefficients`: `r2` and `coverage95` of each coefficient, and the factor by which its
#'     variances were `widened`.
#'   * `coverage95`: that of all coefficients, after widening.
#'   * `series_rmse`, `series_r2`, `series_coverage95`: those of the reconstructed series.
#'
#'   `tidy()` gives one row for each coefficient and parameter: its `beta` and, after forward
#'   selection, the `step` in which it got its own.
#' @source Monari (2022), An approach for identifying sources of inadequacy and upgrades in models
#'   with high-dimensional outputs and boundary conditions. Welch, Buck, Sacks, Wynn, Mitchell and
#'   Morris (1992), Screening, predicting, and computer experiments, Technometrics 34, 15-25. Bachoc
#'   (2013), Cross validation and maximum likelihood estimations of hyper-parameters of Gaussian
#'   processes with model misspecification, Computational Statistics and Data Analysis 66, 55-69.
#'   Gilmour, Thompson and Cullis (1995), Average information REML, Biometrics 51, 1440-1450.
#'   Giordano, Stephenson, Liu, Jordan and Broderick (2019), A Swiss army infinitesimal jackknife,
#'   AISTATS.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' emulator <- train_emulator(runs, room)
#' emulator
#' tidy(emulator)
#' @export
train_emulator <- function(ensemble, noise_sd, control = NULL, threads = 1) {
  check_arguments()
  check_object(ensemble, "amiss_ensemble", "ensemble")
  target_unit <- ""
  if (inherits(noise_sd, "amiss_measurements")) {
    target_unit <- noise_sd$unit
    check_ensemble_rows(ensemble, noise_sd)
    noise_sd <- noise_sd$noise_sd
  }
  check_input(checkmate::check_number(noise_sd, lower = 0, finite = TRUE), "noise_sd")
  control <- fill_emulator_control(control)
  threads <- check_threads(threads)
  check_runs_differ(ensemble)
  check_training_size(ncol(ensemble$outputs), "ensemble (runs)")
  tangent <- ensemble$tangent
  basis <- call_engine(make_basis_(cbind(ensemble$outputs, along_tangent(tangent)),
                                   c(control, noise_sd = noise_sd)))
  basis$columns <- nrow(basis$coefficients)
  basis$coefficients <- basis$coefficients[seq_len(ncol(ensemble$outputs)), , drop = FALSE]
  basis$discarded_sd <- discarded_sd(basis, ensemble$outputs)
  trend <- tangent_trend(tangent, basis, ensemble$region)
  trained <- staged(paste("training the emulator of", ncol(ensemble$outputs), "runs"),
                    call_engine(train_emulator_(to_normal(ensemble$unit), ensemble$region, basis,
                                                trend, control, engine_context(1, threads))))
  diagnostics <- emulator_diagnostics(trained, basis, ensemble$outputs)
  selection <- trained$selection
  selection$parameter <- names(ensemble$parameters)[selection$parameter]
  emulator <- structure(
    list(format_version = format_version, parameters = ensemble$parameters,
         simulator = ensemble$simulator,
         basis = basis[c("vectors", "singular_values", "explained",
                         "discarded_rms", "discarded_ss", "discarded_sd")],
         processes = c(trained[c("inputs", "coefficients", "hyperparameters")],
                       list(region = ensemble$region, trend = trend)),
         unit = ensemble$unit, spread = trained$spread, over_priors = ensemble$over_priors,
         left_out = list(error = trained$coefficients - trained$loo_mean,
                         variance = trained$loo_variance), selection = selection,
         diagnostics = diagnostics, trust = emulator_trust(basis, diagnostics, noise_sd, ensemble),
         control = control, hours = ensemble$hours,
         given = if (is.null(ensemble$simulator)) ensemble,
         noise_sd = noise_sd, target_unit = target_unit, evaluations = trained$evaluations),
    class = "amiss_emulator")
  warn_coarse_basis(emulator, "control$max_vectors")
  emulator
}

# Outputs along a tangent, list(centre, slopes): two units of the region's root either way. They put
# its directions into the basis, of which a few runs may not hold all.
along_tangent <- function(tangent) {
  if (!is.null(tangent))
    cbind(tangent$centre + 2 * tangent$slopes, tangent$centre - 2 * tangent$slopes)
}

# The tangent as the mean of each coefficient, linear in the inputs v of the region: with t = R^-1
# (s - c) in units of its root, v = 1/2 + t / (2 rho).
tangent_trend <- function(tangent, basis, region) {
  if (is.null(tangent)) return(NULL)
  slopes <- 2 * region$radius * project_outputs(tangent$slopes, basis)
  unname(cbind(project_outputs(cbind(tangent$centre), basis) - rowSums(slopes) / 2, slopes))
}

# Coefficients (Q x n) of outputs (rows x n): the last vector is constant, the others have mean
# zero.
project_outputs <- function(outputs, basis) {
  last <- ncol(basis$vectors)
  moving <- basis$vectors[, -last, drop = FALSE]
  rbind(crossprod(moving, outputs) / colSums(moving^2), colMeans(outputs))
}

coarse_basis <- function(basis, noise_sd) noise_sd > 0 && basis$discarded_rms > noise_sd

# Said once for every model that was asked for: where emulators come and go
# (without_basis_warnings()), of the one that stays.
warn_coarse_basis <- function(emulator, option, model = NULL) {
  basis <- emulator$basis
  if (!coarse_basis(basis, emulator$noise_sd)) return(invisible())
  of <- if (!is.null(model)) " of {.val {model}}"
  warn_result(c(paste0("The basis", of, " of {ncol(basis$vectors)} vectors leaves ",
                       "{signif(basis$discarded_rms, 3)} of the runs unexplained (RMS), more than ",
                       "the noise of {signif(emulator$noise_sd, 3)}."),
                i = paste("What it leaves out looks like discrepancy: raise {.code {option}} or",
                          "narrow the priors.")), class = "amiss_warning_basis")
}

without_basis_warnings <- function(code) {
  withCallingHandlers(code, amiss_warning_basis = function(w) rlang::cnd_muffle(w))
}

check_runs_differ <- function(ensemble, call = rlang::caller_env()) {
  y <- ensemble$outputs
  if (all(y == y[, 1])) {
    abort_input(c(paste("All {ncol(y)} runs are the same: none of",
                        "{.val {names(ensemble$parameters)}} acts on the output."),
                  i = "Check that the simulator uses its parameters."), call = call)
  }
  check_runs_change(y, call)
}

check_runs_change <- function(outputs, call = rlang::caller_env()) {
  if (ncol(outputs) < 2) return(invisible())  # a budget may end here
  if (!all(apply(outputs, 2, function(run) diff(range(run))) == 0)) return(invisible())
  abort_input(c("The runs do not change over time: each of the {ncol(outputs)} is a constant.",
                i = "The simulator of a time series uses the boundary conditions, or the time."),
              call = call)
}

fill_emulator_control <- function(control, what = "control", call = rlang::caller_env()) {
  control <- merge_control(emulator_control, control, what, call = call)
  named <- function(option) paste0(what, "$", option)
  check_input(checkmate::check_number(control$explained, lower = 1e-6, upper = 1),
              named("explained"), call = call)
  check_input(checkmate::check_number(control$noise_fraction, lower = 1e-12, finite = TRUE),
              named("noise_fraction"), call = call)
  check_input(checkmate::check_int(control$max_vectors, lower = 2, upper = 1e4),
              named("max_vectors"), call = call)
  check_input(checkmate::check_int(control$starts, lower = 1, upper = 1e4), named("starts"),
              call = call)
  check_input(checkmate::check_int(control$searches, lower = 1, upper = control$starts),
              named("searches"), "There can be no more searches than {.code starts}.", call = call)
  check_input(checkmate::check_int(control$max_evaluations, lower = 1, upper = 1e6),
              named("max_evaluations"), call = call)
  check_input(checkmate::check_choice(control$selection, c("ard", "forward")), named("selection"),
              call = call)
  check_input(checkmate::check_number(control$significance, lower = 1e-12, upper = 0.5),
              named("significance"), call = call)
  for (prior in c("s2", "eta2", "beta")) {
    check_input(checkmate::check_numeric(control[[prior]], lower = 1, finite = TRUE, len = 2,
                                         any.missing = FALSE), named(prior),
                paste("Give the two shapes of a beta distribution; below 1 its density has no",
                      "greatest value."), call = call)
  }
  check_input(checkmate::check_numeric(control$lambda, lower = 0, finite = TRUE, len = 2),
              named("lambda"), "Give shape and rate of a gamma distribution; the rate may be NA.",
              call = call)
  lambda <- as.numeric(control$lambda)
  if (is.na(lambda[1]) || lambda[1] <= 0)
    abort_input("The shape of {.arg {named('lambda')}} must be positive; got {.val {lambda[1]}}.",
                call = call)
  control$lambda <- lambda
  control
}

# The part of the runs outside the basis, as of runs that the basis was not chosen with: raised by M
# / (M - Q + 1), for the Q - 1 singular vectors that the M runs determine (the vector of ones is
# given). Outputs along a tangent count among them.
discarded_part <- function(basis, outputs) {
  runs <- basis$columns
  (outputs - tcrossprod(basis$vectors, basis$coefficients)) * runs /
    (runs - ncol(basis$vectors) + 1)
}

discarded_sd <- function(basis, outputs) sqrt(rowMeans(discarded_part(basis, outputs)^2))

# Variance of a run's series (steps x runs) for given variances of its coefficients (runs x
# coefficients).
series_variance <- function(basis, variance)
  tcrossprod(basis$vectors^2, variance) + basis$discarded_sd^2

emulator_diagnostics <- function(trained, basis, outputs) {
  within95 <- function(error, variance) abs(error) < stats::qnorm(0.975) * sqrt(variance)
  error <- trained$coefficients - trained$loo_mean
  r2 <- 1 - colSums(error^2) / pmax(colSums(scale(trained$coefficients, scale = FALSE)^2),
                                    .Machine$double.xmin)
  covered <- within95(error, trained$loo_variance)
  series <- tcrossprod(basis$vectors, error) + discarded_part(basis, outputs)
  list(coefficients = data.frame(vector = seq_len(ncol(error)), r2 = r2,
                                 coverage95 = colMeans(covered), widened = trained$widened),
       coverage95 = mean(covered), series_rmse = sqrt(mean(series^2)),
       series_r2 = 1 - sum(series^2) / sum((outputs - rowMeans(outputs))^2),
       series_coverage95 = mean(within95(series, series_variance(basis, trained$loo_variance))))
}

# What a person should know before using it; a report can repeat it.
emulator_trust <- function(basis, diagnostics, noise_sd, ensemble) {
  predictions <- ncol(ensemble$outputs) * ncol(basis$vectors)
  # below 90 % in truth
  beyond_chance <- diagnostics$coverage95 * predictions < stats::qbinom(0.001, predictions, 0.9)
  why <- c(
    if (coarse_basis(basis, noise_sd))
      sprintf("the basis of %d vectors leaves %s (RMS) of the runs out, more than the noise of %s",
              ncol(basis$vectors), format(signif(basis$discarded_rms, 3)),
              format(signif(noise_sd, 3))),
    if (max(diagnostics$coefficients$widened) > 4)
      sprintf(paste("its leave-one-out errors are up to %s times as large as its hyper-parameters",
                    "would have them, by which its intervals are widened"),
              format(signif(sqrt(max(diagnostics$coefficients$widened)), 2))),
    if (beyond_chance)
      sprintf("its 95 %% intervals hold only %.0f %% of the coefficients left out",
              100 * diagnostics$coverage95),
    uncovered_statement(ensemble))
  list(trusted = is.null(why),
       verdict = if (is.null(why)) "can be trusted" else paste(why, collapse = "; "))
}

#' @export
print.amiss_emulator <- function(x, ...) on_stdout(x, {
  d <- x$diagnostics
  unit <- x$target_unit %||% ""
  told <- with_unit(short(c(x$basis$discarded_rms, x$noise_sd, d$series_rmse)), unit)
  cli::cli_text(paste("{.strong Emulator} of {nrow(x$processes$inputs)} runs:",
                      "{ncol(x$basis$vectors)} basis vectors explain",
                      "{round(100 * x$basis$explained, 3)} %; {x$trust$verdict}"))
  cli::cli_bullets(c("*" = "left out: {told[1]} RMS beside a noise of {told[2]}",
                     "*" = paste("leave-one-out: series R2 {round(d$series_r2, 5)}, RMSE",
                                 "{told[3]}; 95 % intervals hold",
                                 "{round(100 * d$coverage95, 1)} % of the coefficients,",
                                 "{round(100 * d$series_coverage95, 1)} % of the series")))
  if (x$control$selection == "forward") {
    selected <- vapply(seq_len(ncol(x$basis$vectors)),
                       function(q) paste(x$selection$parameter[x$selection$vector == q],
                                         collapse = ", "), "")
    shown <- seq_len(min(length(selected), 8))
    cli::cli_bullets(c("*" = paste("own beta by forward selection, in order, of",
                                   "{length(x$parameters)} parameters:")))
    cli::cli_verbatim(sprintf("    vector %d: %s", shown,
                              ifelse(nzchar(selected[shown]), selected[shown], "none")))
    if (length(selected) > 8)
      cli::cli_verbatim(sprintf("    %d more: see tidy()", length(selected) - 8))
  }
  cli::cli_bullets(c(">" = "next: {.fun calibrate}"))
})

#' @export
tidy.amiss_emulator <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  q <- nrow(x$processes$hyperparameters)
  p <- length(x$parameters)
  table <- data.frame(
    vector = rep(seq_len(q), each = p), parameter = rep(names(x$parameters), q),
    beta = stats::plogis(as.numeric(t(x$processes$hyperparameters[, -(1:3), drop = FALSE]))))
  table$step <- x$selection$step[match(paste(table$vector, table$parameter),
                                       paste(x$selection$vector, x$selection$parameter))]
  table
}

#' Predict the simulator's output by its emulator
#'
#' @param object The emulator.
#' @param newdata Matrix of parameter values, one row a point, named columns.
#' @param ... Not used.
#' @return A list of `mean` and `sd`, one column per point. `sd` is that of a run there: the
#'   emulator's uncertainty and what the basis leaves out.
#' @source `vignette("algorithm", "amiss")`, *Emulator*.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' lapply(predict(train_emulator(runs, room), cbind(gain = c(0.2, 0.4))), head, 3)
#' @export
predict.amiss_emulator <- function(object, newdata, ...) {
  check_whole(object, "object")
  check_arguments()
  rlang::check_dots_empty()
  newdata <- as_number_matrix(newdata)
  check_input(checkmate::check_matrix(newdata, "numeric", any.missing = FALSE, min.rows = 1),
              "newdata")
  absent <- setdiff(names(object$parameters), colnames(newdata))
  if (length(absent))
    abort_input("{.arg newdata} lacks {cli::qty(absent)}column{?s} {.val {absent}}.")
  for (name in names(object$parameters)) {
    prior <- object$parameters[[name]]$prior
    outside <- which(newdata[, name] < prior$lower | newdata[, name] > prior$upper)
    if (length(outside)) {
      abort_input(c(paste("{name} = {newdata[outside[1], name]} in row {outside[1]} of",
                          "{.arg newdata} lies outside its prior, {format(prior)}."),
                    i = "The emulator knows nothing there; run the simulator."))
    }
  }
  unit <- values_to_unit(newdata[, names(object$parameters), drop = FALSE], object$parameters)
  beyond <- which(!in_region(object$processes$region, unit))
  if (length(beyond)) {
    abort_input(c(paste("Row {beyond[1]} of {.arg newdata} lies outside the region that the",
                        "emulator was trained for."),
                  i = paste("Use the emulator of the first ensemble, {.code $over_priors}, or run",
                            "the simulator.")))
  }
  w <- emulated_coefficients(object, unit)
  list(mean = tcrossprod(object$basis$vectors, w$mean),
       sd = sqrt(series_variance(object$basis, w$variance)))
}

# Mean and variance (points x Q) of the coefficients at points of the unit cube.
emulated_coefficients <- function(emulator, unit)
  predict_emulator_(emulator$processes, to_normal(unit))

# The emulator that knows how far the simulator can move under the priors: the first one, of a
# refined ensemble.
emulator_over_priors <- function(emulator) emulator$over_priors %||% emulator

# Root of the covariance that the output has under the priors (rows x r).
simulator_moves <- function(emulator) {
  if (!is.null(emulator$moves)) return(emulator$moves$root)
  wide <- emulator_over_priors(emulator)
  wide$basis$vectors %*% wide$spread
}
