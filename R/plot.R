figure_names <- c("fit", "attribution", "candidates", "explained", "parameters", "discrepancy",
                  "response", "gain", "mean_day", "priors", "moved", "steps", "missing", "emulator",
                  "residuals", "sampler", "modes", "runs")

# Of several records each has its own.
record_figure_names <- c("fit", "attribution", "discrepancy", "response", "mean_day", "missing",
                         "emulator", "residuals")

calibration_figures <- c("parameters", "residuals", "modes", "profiles")

#' Figures
#'
#' `plot()` draws a figure and returns it invisibly. `autoplot()` of ggplot2 returns it undrawn, to
#' be changed or saved.
#'
#' @param x,object [measurements()]; a calibration ([calibrate()], not [calibrate_paper()]); or the
#'   result of [attribute_discrepancy()], [discrepancy()], [sobol_indices()], [ais()],
#'   [compare_models()], [upgrade_model()] or [survey()]. If there are several records, plot one of
#'   `records`.
#' @param which Which figure of an upgrade, a comparison, a calibration or a survey, see below.
#' @param ... Not used: an argument that is not known is an error.
#' @return A ggplot.
#' @section Figures of an upgrade:
#'   * `"fit"`: measured and simulated.
#'   * `"attribution"`: what the error responds to.
#'   * `"candidates"`: mechanisms tried.
#'   * `"explained"`: what each mechanism leaves of the responses to the boundary conditions.
#'   * `"parameters"`: their estimates.
#'   * `"discrepancy"`: the discrepancy over time.
#'   * `"response"`: the error against the leading boundary condition.
#'   * `"gain"`: scores before and after.
#'   * `"mean_day"`: the mean day.
#'   * `"priors"`: priors against posteriors.
#'   * `"moved"`: parameters that moved between the models, and what they are correlated with.
#'   * `"steps"`: what each mechanism brought.
#'   * `"missing"`: the response that the first model lacks, by boundary condition.
#'   * `"emulator"`: the emulator's errors on runs left out.
#'   * `"residuals"`: whether the last model's error is as the error model says, see *Residuals*.
#'   * `"sampler"`: how the annealing went.
#'   * `"modes"`: the modes of the last model's posterior, and the ends of searches.
#'   * `"runs"`: what the runs of the simulator were spent on.
#'
#'   If an upgrade has several records, figures that show a series are of one record: `"fit of
#'   NAME"`. `"fit"` then shows the first record.
#' @section Figures of a comparison:
#'   * `"evidence"`: the evidence of the models.
#'   * `"criteria"`: ranks by each criterion.
#'   * `"attribution"`: what the error responds to.
#'   * `"fit"`: measured and simulated.
#'   * `"discrepancy"`: the discrepancy over time.
#'   * `"parameters"`: their estimates.
#'   * `"heat_loss"`: the heat loss coefficients of zones.
#'   * `"held_out"`: the held-out rows, if rows validate.
#' @section Figures of a calibration:
#'   * `"parameters"`: their estimates.
#'   * `"residuals"`: whether the error is as the error model says.
#'   * `"modes"`: the modes of the posterior, and the ends of searches.
#'   * `"profiles"`: the profile likelihood of each parameter, see *Profiles*.
#' @section Figures of a survey:
#'   * `"causes"`: how many studies lack what.
#'   * `"studies"`: what became of each mechanism in each study.
#'   * `"gain"`: the typical error of each study before and after.
#' @section Profiles:
#'   The profile likelihood of a parameter is the largest likelihood at each of its values, whatever
#'   the other parameters are. It says what the record alone knows of the parameter. By Wilks, an
#'   interval of 95 % ends where the log-likelihood has fallen by 1.92. The emulator stands in for
#'   the simulator. Error and discrepancy are as ten draws of the posterior have them and do not
#'   follow the parameters, so that true intervals are somewhat wider. The search begins at the best
#'   of 80 draws and stays in their range; it finds the largest value or a lower one. The figure
#'   takes some seconds, and minutes for a record of 10,000 rows.
#' @section Residuals:
#'   A residual is what a measurement does beyond what the calibrated model expects of it, given all
#'   measurements before, in standard deviations. The model is that of one draw of the posterior:
#'   simulation, discrepancy and autocorrelated error. If it is right, the residuals are independent
#'   and N(0, 1) (Johnson 2007). The figure shows them over time and against the two boundary
#'   conditions that they depend on most, their normal quantiles, their autocorrelation and their
#'   cumulated periodogram. The bands hold 95 %: each quantile is that of a beta distribution, the
#'   autocorrelation within 1.96 / sqrt(n), and the whole periodogram (Kolmogorov and Smirnov). The
#'   title tells of the first check that fails at a level of 1 %. A long record shows its first
#'   20,000 rows.
#' @source Johnson (2007), Bayesian model assessment using pivotal quantities, Bayesian Analysis 2,
#'   719-734. Durbin and Koopman (2012), Time series analysis by state space methods, 2nd edition,
#'   for the prediction errors. Wilks (1938), The large-sample distribution of the likelihood ratio
#'   for testing composite hypotheses, Annals of Mathematical Statistics 9, 60-62.
#' @examples
#' table <- data.frame(hour = 1:96, Ti = 20 + sin(1:96 / 4), Te = 5 + 3 * sin(1:96 / 4))
#' plot(measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1,
#'                   warmup = 6))
#' @name figures
NULL

#' @rdname figures
#' @export
plot.amiss_upgrade <- function(x, which = "fit", ...) {
  rlang::check_dots_empty()
  draw(upgrade_figure(x, which))
}

#' @rdname figures
#' @export
plot.amiss_attribution <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  draw(figure_attribution(list("the model" = told_attribution(x))))
}

#' @rdname figures
#' @export
plot.amiss_discrepancy <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  draw(figure_discrepancy(list("the model" = x)))
}

#' @rdname figures
#' @export
plot.amiss_calibration <- function(x, which = "parameters", ...) {
  rlang::check_dots_empty()
  draw(calibration_figure(x, which))
}

#' @rdname figures
#' @export
plot.amiss_ais <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  draw(figure_sampler(list("the model" = x)))
}

#' @rdname figures
#' @export
plot.amiss_measurements <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  draw(figure_measurements(x))
}

#' @rdname figures
#' @export
autoplot.amiss_upgrade <- function(object, which = "fit", ...) {
  rlang::check_dots_empty()
  upgrade_figure(object, which)
}

#' @rdname figures
#' @export
autoplot.amiss_attribution <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  figure_attribution(list("the model" = told_attribution(object)))
}

#' @rdname figures
#' @export
autoplot.amiss_discrepancy <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  figure_discrepancy(list("the model" = object))
}

#' @rdname figures
#' @export
autoplot.amiss_calibration <- function(object, which = "parameters", ...) {
  rlang::check_dots_empty()
  calibration_figure(object, which)
}

#' @rdname figures
#' @export
autoplot.amiss_ais <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  figure_sampler(list("the model" = object))
}

#' @rdname figures
#' @export
autoplot.amiss_measurements <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  figure_measurements(object)
}

draw <- function(figure) {
  print(figure)
  invisible(figure)
}

calibration_figure <- function(fit, which, call = rlang::caller_env()) {
  check_whole(fit, "object", call = call)
  check_input(checkmate::check_choice(which, calibration_figures), "which", call = call)
  if (which == "profiles") check_not_part(fit, call)
  switch(which,
         parameters = figure_parameters(list("the model" = fit)),
         residuals = figure_residuals(fit),
         modes = figure_modes(fit),
         profiles = figure_profiles(fit))
}

upgrade_figure <- function(upgrade, which, call = rlang::caller_env()) {
  check_whole(upgrade, "object", call = call)
  upgrade <- labelled(upgrade)
  if (is_several(upgrade$measurements)) {
    names <- names(upgrade$measurements$records)
    if (checkmate::test_choice(which, record_figure_names)) which <- paste(which, "of", names[1])
    check_input(checkmate::check_choice(which, figures_of(upgrade)), "which", call = call)
    for (name in names) {
      one <- match(which, paste(record_figure_names, "of", name))
      if (!is.na(one))
        return(upgrade_figure(record_upgrade(upgrade, name), record_figure_names[one], call))
    }
  }
  check_input(checkmate::check_choice(which, figure_names), "which", call = call)
  stages <- upgrade_stages(upgrade)
  switch(which,
         fit = figure_fit(upgrade),
         attribution = figure_attribution(lapply(stages, `[[`, "attribution")),
         candidates = figure_candidates(upgrade),
         explained = figure_explained(upgrade),
         parameters = figure_parameters(lapply(stages, `[[`, "fit")),
         discrepancy = figure_discrepancy(lapply(stages, function(s) discrepancy(s$fit)),
                                          leading_condition(upgrade)),
         response = figure_response(upgrade),
         gain = figure_gain(upgrade),
         mean_day = figure_mean_day(upgrade),
         priors = figure_priors(lapply(stages, `[[`, "fit")),
         moved = figure_moved(upgrade),
         steps = figure_steps(upgrade),
         missing = figure_missing(discrepancy(stages[[1]]$fit), stages[[1]]$attribution,
                                  names(stages)[1],
                                  left = sqrt(mean(left_at_best(stages[[1]]$fit)^2))),
         emulator = figure_emulator(lapply(stages, `[[`, "fit")),
         residuals = figure_residuals(stages[[length(stages)]]$fit),
         sampler = figure_sampler(lapply(stages, function(s) s$fit$posterior)),
         modes = figure_modes(stages[[length(stages)]]$fit),
         runs = figure_runs(upgrade))
}

# Names of the figures that an object has.
figures_of <- function(x) UseMethod("figures_of")

#' @export
figures_of.amiss_upgrade <- function(x) {
  if (!is_several(x$measurements)) return(figure_names)
  of_records <- outer(record_figure_names, names(x$measurements$records), paste, sep = " of ")
  c(setdiff(figure_names, record_figure_names), of_records)
}

# Names of the files of figures.
figure_files <- function(which) paste0(file_stem(which), ".png")

# `ragg` finds fonts in the same way on every machine, and letters that a font lacks in another.
save_figure <- function(figure, path, width = canvas_width, dpi = 120) {
  ggplot2::ggsave(path, figure, ragg::agg_png, width = width, height = figure_height(figure, width),
                  dpi = dpi, bg = "white")
}
