paper_control <- list(confidence = NULL, shared_lambda = FALSE, alpha = c(1, 0.1), t2 = c(1, 1),
                      unit = 1, fictitious_seed = 1, probability = 0.95, tolerance = 0.01,
                      ais = list())

#' Calibrate a simulator as in the paper
#'
#' @description
#' Calibrates by the method of Monari (2022), with the paper's misprints corrected. The package's
#' own method is [calibrate()] followed by [attribute_discrepancy()].
#'
#' * Equation 5 gives the parameters from the coefficients of the measurement on the basis.
#' * Equation 6 gives the discrepancy: a Gaussian process over the boundary conditions of the same
#'   time step.
#' * The variance index says how much each condition explains.
#'
#' Both equations are sampled by annealed importance sampling. The method knows neither the history
#' of the conditions nor autocorrelated errors.
#'
#' # Evidence
#'
#' The evidence is the product of the normalising constants of (5) and (6), with the Jacobian
#' `|K'K|^(-1/2)`. It is a density of the calibration record, so models with different bases may be
#' compared.
#'
#' The precision `lambda*` of the noise is one quantity. As in the paper, it is drawn once for each
#' basis vector and once for the discrepancy. The product is therefore the evidence of a model with
#' as many independent noises. `shared_lambda` draws the precision once for all basis vectors;
#' [calibrate()] draws it once.
#'
#' The prior of the discrepancy's variance is `(1 - t2) / t2` with `t2` uniform. Its median is 1 in
#' the target's unit squared. The evidence therefore depends on that unit beyond the change of
#' density, unless `unit` changes with it. The evidence of [calibrate()] does not.
#'
#' # Variance index
#'
#' `R2_s` is the variance of the discrepancy predicted from condition s alone, divided by the
#' variance of the discrepancy. `R2_0` is the same for a fictitious condition, white noise.
#' `difference` is `R2_s - R2_0`.
#'
#' A condition is significant if 0 lies outside the highest-density interval of the difference. If
#' the whole interval is below 0, the condition explains less than white noise does; its rank shows
#' that.
#'
#' # Cost
#'
#' The kernel of (6) is smooth in the values of the conditions, so its rank is low. If the record
#' has more than 120 steps, the posterior of (6) is annealed by way of every 4th, 16th, ... step.
#' These values are approximate to `tolerance` nats. At 32 of the final draws they are compared with
#' certified values, and the evidence is corrected. With `tolerance = 0` every value is computed
#' densely and the annealing starts from the prior; the cost then grows with N^3.
#'
#' @inheritParams calibrate
#' @param control List of options, with their defaults:
#'   * `confidence`: how firmly `noise_sd` is believed, c in `[2/N, 1]` (2/N).
#'   * `shared_lambda`: one noise precision for all basis vectors (`FALSE`).
#'   * `alpha`, `t2`: the two shapes of their beta priors (`c(1, 0.1)` and `c(1, 1)`).
#'   * `unit`: the unit of the target in whose square `(1 - t2) / t2` is the discrepancy's variance
#'     (1).
#'   * `fictitious_seed`: seed of the white noise, which is part of the data (1).
#'   * `probability`: of the highest-density intervals (0.95).
#'   * `tolerance`: in nats (0.01); 0 computes dense values.
#'   * `ais`: options of [ais()], with its defaults (not those of [calibrate()]).
#' @return An object of class `amiss_paper_calibration`:
#'   * `values`, `weights`: posterior draws of the parameters.
#'   * `log_evidence`, `standard_error`, `interval`: the total evidence.
#'   * `evidence`: a table of equations 5 and 6 and the total.
#'   * `hyperparameters`: draws of `alpha` (the fictitious condition last), `t2`, `lambda`, and
#'     their weights.
#'   * `lambda`: draws of the precisions of equation 5.
#'   * `index`: the ranked variance index, see below.
#'   * `share`: draws of `R2`.
#'   * `trust`: whether the numbers can be believed.
#'   * `posterior`, `outside`: all that the sampler reported about (5) and (6).
#'     `outside$approximation` has the largest error among the certified draws and the correction of
#'     the log evidence. It also has the number of values computed: in the stages before the last,
#'     and in the last by skeletons and directly.
#'
#'   The columns of `index` are `boundary`, `difference` (posterior median), `mean`, `lower95`,
#'   `upper95`, `significant` and `rank`. `lower95` and `upper95` are the ends of the
#'   highest-density interval; they keep these names for any `probability`.
#'
#'   [tidy()][posterior] gives the table of the parameters.
#' @examples
#' data <- data.frame(hour = 1:60, Te = 5 + 3 * sin(1:60 / 4), Gv = cos(1:60 / 3)^2)
#' data$Ti <- 20 + 0.4 * data$Te + 0.5 * data$Gv + 0.1 * sin(61 * (1:60)^2)
#' house <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, house, runs = 12, seed = 1)
#' calibrate_paper(train_emulator(runs, house), house, seed = 1,
#'                 control = list(ais = list(pilot_chains = 48, groups = 4)))
#' @source Monari (2022), An approach for identifying sources of inadequacy and upgrades in models
#'   with high-dimensional outputs and boundary conditions.
#' @export
calibrate_paper <- function(emulator, measurements, control = NULL, seed = NULL, threads = 1) {
  check_arguments()
  rows <- emulated_rows(emulator, measurements)
  check_target_varies(measurements, rows)
  seed <- pick_seed(seed)
  threads <- check_threads(threads)
  control <- fill_paper_control(control, length(rows))
  data <- paper_data(emulator, measurements, rows, control)
  priors <- list(alpha = control$alpha, t2 = control$t2, unit = control$unit,
                 noise_sd = measurements$noise_sd, noise_shape = length(rows) * control$confidence)
  result <- staged("sampling the posterior", call_engine(
    calibrate_paper_(data, priors, emulator$processes, control, engine_context(seed, threads))))
  inside <- result$inside
  outside <- result$outside
  evidence <- paper_evidence(inside, outside)
  conditions <- measurements$conditions
  hyperparameters <- c(outside$hyperparameters, list(weights = outside$weights))
  colnames(hyperparameters$alpha) <- c(conditions, "(fictitious)")
  colnames(result$index$share) <- c(conditions, "(fictitious)")
  total <- list(log_evidence = evidence$log_evidence[3],
                standard_error = evidence$standard_error[3],
                interval = c(evidence$lower95[3], evidence$upper95[3]))
  set <- list(emulator = emulator, measurements = measurements, control = control, seed = seed,
              rows = rows, priors = priors)
  new_fit("amiss_paper_calibration", set, inside, total, lambda = inside$lambda,
          hyperparameters = hyperparameters, evidence = evidence,
          log_jacobian = result$log_jacobian, trust = paper_trust(outside, inside),
          index = index_table(result$index, conditions), share = result$index$share,
          outside = outside)
}

# What a person should know before using it.
paper_trust <- function(outside, inside) {
  against <- c(if (!outside$trusted) paste("discrepancy:", outside$why),
               if (!inside$trusted) paste("parameters:", inside$why))
  new_trust(is.null(against), against %||% inside$why)
}

fill_paper_control <- function(control, n, what = "control", call = rlang::caller_env()) {
  control <- merge_control(paper_control, control, what, call = call)
  named <- function(option) paste0(what, "$", option)
  control$ais <- fill_ais_control(control$ais, named("ais"), call = call)
  if (is.null(control$confidence)) control["confidence"] <- 2 / n
  check_input(checkmate::check_number(control$confidence, lower = 2 / n - 1e-12, upper = 1),
              named("confidence"),
              "It lies between 2/N (hardly believed) and 1 (as firm as N values).", call = call)
  check_input(checkmate::check_flag(control$shared_lambda), named("shared_lambda"), call = call)
  for (prior in c("alpha", "t2")) {
    check_input(checkmate::check_numeric(control[[prior]], lower = 1e-6, finite = TRUE, len = 2,
                                         any.missing = FALSE), named(prior),
                "Give the two shapes of a beta distribution.", call = call)
  }
  check_input(checkmate::check_number(control$unit, lower = .Machine$double.xmin, finite = TRUE),
              named("unit"), call = call)
  check_seed(control$fictitious_seed, named("fictitious_seed"), call)
  check_input(checkmate::check_number(control$probability, lower = 0.01, upper = 0.9999),
              named("probability"), call = call)
  check_input(checkmate::check_number(control$tolerance, lower = 0, upper = 1), named("tolerance"),
              "In nats; 0 for dense values.", call = call)
  control
}

paper_data <- function(emulator, measurements, rows, control) {
  list(y = measurements$y[rows], basis = emulator$basis$vectors,
       conditions = measurements$boundary[rows, , drop = FALSE],
       condition = measurements$condition - 1L, fictitious_seed = control$fictitious_seed)
}

# The two runs are independent: their errors add as squares, each side of the interval on its own.
paper_evidence <- function(inside, outside) {
  value <- c(inside$log_evidence, outside$log_evidence)
  error <- c(inside$standard_error, outside$standard_error)
  interval <- rbind(inside$interval, outside$interval)
  lower <- c(interval[, 1], sum(value) - sqrt(sum((value - interval[, 1])^2)))
  upper <- c(interval[, 2], sum(value) + sqrt(sum((interval[, 2] - value)^2)))
  data.frame(part = c("parameters (5)", "discrepancy (6)", "total"),
             log_evidence = c(value, sum(value)), standard_error = c(error, sqrt(sum(error^2))),
             lower95 = lower, upper95 = upper,
             trusted = c(inside$trusted, outside$trusted, inside$trusted && outside$trusted))
}

index_table <- function(index, conditions) {
  table <- data.frame(boundary = conditions, difference = index$median, mean = index$mean,
                      lower95 = index$lower, upper95 = index$upper,
                      significant = as.logical(index$significant), rank = as.integer(index$rank))
  table <- table[order(table$rank), ]
  rownames(table) <- NULL
  table
}

#' @export
print.amiss_paper_calibration <- function(x, ...) on_stdout(x, {
  decades <- c(x$interval, x$evidence$log_evidence[1:2]) / log(10)
  parts <- same_decimals(decades[3:4], decades[1], decades[2])$estimate
  cli::cli_text(paste("{.strong Calibration as in the paper} on {length(x$rows)} rows of",
                      "{.val {x$measurements$name}}"))
  cli::cli_text(paste("log10 evidence {evidence_words(x)} = {parts[1]} (5) + {parts[2]} (6),",
                      "{x$trust$verdict}"))
  cli::cli_text("{error_sentence(x)}")
  say_parameters(x, 3)
  cli::cli_bullets(finding_bullets(fit_findings(x)$says))
  cli::cli_text("variance index of the boundary conditions over that of white noise")
  index <- utils::head(x$index, 4)
  index$boundary <- condition_label(x$measurements, index$boundary)
  mean <- same_decimals(index$mean, index$lower95, index$upper95)$estimate
  index[c("difference", "lower95", "upper95")] <- same_decimals(index$difference, index$lower95,
                                                                index$upper95)
  index$mean <- mean
  say_table(index)
  cli::cli_bullets(c(">" = paste("next: {.fun calibrate} and {.fun attribute_discrepancy}, which",
                                 "know the history of the conditions")))
})

#' @export
calibrator.amiss_paper_calibration <- function(fit) calibrate_paper

#' @export
default_control.amiss_paper_calibration <- function(fit) fill_paper_control(NULL, length(fit$rows))

#' @export
condition_table.amiss_paper_calibration <- function(fit, settings) fit$index
