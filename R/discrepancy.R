#' The discrepancy over time
#'
#' @description
#' Gives what the calibrated simulation leaves unexplained, over time:
#'
#' * the measurement less the simulation at the posterior mean of its parameters, and
#' * the whole response to the boundary conditions that the model lacks, with a 95 % band.
#'
#' @details
#' For a calibration as in the paper, the discrepancy is that of equation 8, at the same time step.
#'
#' @param fit A calibration ([calibrate()], [calibrate_paper()]).
#' @return An object of class `amiss_discrepancy`:
#'   * `series`: a data frame with the columns `time`, `observed`, `simulated`, `residual`,
#'     `discrepancy`, `lower95` and `upper95`.
#'   * `responses`: one column for each condition. `NULL` for [calibrate_paper()], which has no sum
#'     of responses.
#'
#'   `as.data.frame()` gives one row for each row of the record:
#'   * `time`, and `use`: `"calibrate"`, `"validate"`, `"warmup"` or `"none"`.
#'   * `measured`: the target, `NA` if it was not measured.
#'   * `mean`, `lower95`, `upper95`: the discrepancy and its 95 % band.
#'   * `residual`: the measurement less the simulation.
#'   * `response_` and the name of a condition: what of `mean` responds to this condition; if there
#'     are `responses`.
#'
#'   All but `time` and `use` are in the unit of the target. What the discrepancy has no value for,
#'   as for rows held out, is `NA`.
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
#' head(discrepancy(fit)$series)
#' tail(as.data.frame(discrepancy(fit)))
#' plot(discrepancy(fit))
#' @export
discrepancy <- function(fit) {
  check_arguments()
  check_object(fit, "amiss_fit", "fit")
  if (!knows_history(fit)) return(paper_discrepancy(fit))
  data <- history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  draws <- lacking_response(fit, data$responses, data$moves)
  responses <- condition_responses(fit, data)
  colnames(responses) <- fit$measurements$conditions
  limits <- apply(draws, 1, stats::quantile, c(0.025, 0.975))
  new_discrepancy(fit, rowMeans(draws), limits[1, ], limits[2, ], responses)
}

# Response to the boundary conditions for each kept draw (rows x draws), given the filter bank and
# simulator_moves() at these rows.
lacking_response <- function(fit, responses, moves) {
  phi <- sweep(sweep(responses, 2, fit$centre), 2, fit$scale, "/")
  phi %*% fit$coefficients - moves %*% fit$withheld
}

new_discrepancy <- function(fit, mean, lower95, upper95, responses = NULL) {
  m <- fit$measurements
  simulated <- simulated_mean(fit)
  series <- data.frame(time = m$time[fit$rows], observed = m$y[fit$rows], simulated = simulated,
                       residual = m$y[fit$rows] - simulated, discrepancy = mean, lower95 = lower95,
                       upper95 = upper95)
  structure(list(format_version = format_version, series = series, responses = responses,
                 record = data.frame(time = m$time, use = m$use, measured = m$y), rows = fit$rows,
                 segment = m$segment[fit$rows], target = target_label(m), unit = m$unit),
            class = "amiss_discrepancy")
}

#' @rdname discrepancy
#' @param x A discrepancy.
#' @param row.names,optional As [as.data.frame()] has them; `optional` is not used.
#' @param ... Not used: an argument that is not known is an error.
#' @export
as.data.frame.amiss_discrepancy <- function(x, row.names = NULL, optional = FALSE, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  known <- data.frame(mean = x$series$discrepancy, x$series[c("lower95", "upper95", "residual")])
  if (!is.null(x$responses)) {
    colnames(x$responses) <- paste0("response_", colnames(x$responses))
    known <- data.frame(known, x$responses, check.names = FALSE)
  }
  # An earlier version kept the rows of the series alone.
  record <- x$record %||% data.frame(time = x$series$time, use = "calibrate",
                                     measured = x$series$observed)
  at <- match(seq_len(nrow(record)), x$rows %||% seq_len(nrow(known)))  # NA for other rows
  out <- data.frame(record, known[at, ], row.names = NULL, check.names = FALSE)
  if (is.null(row.names)) out else as.data.frame(out, row.names = row.names)
}

# Mean and variance over posterior draws of the hyper-parameters, by the law of total variance.
paper_discrepancy <- function(fit, draws = 24) {
  hyper <- fit$hyperparameters
  picked <- systematic_draws(hyper$weights, draws)
  of <- call_engine(paper_discrepancy_(
    paper_data(fit$emulator, fit$measurements, fit$rows, fit$control), fit$priors,
    list(alpha = hyper$alpha[picked, , drop = FALSE], t2 = hyper$t2[picked],
         lambda = hyper$lambda[picked]), engine_context(fit$seed, 1)))
  mean <- rowMeans(of$mean)
  sd <- sqrt(rowMeans(of$variance) + rowMeans((of$mean - mean)^2))
  new_discrepancy(fit, mean, mean - 1.96 * sd, mean + 1.96 * sd)
}

#' @export
print.amiss_discrepancy <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong Discrepancy} of {.field {x$target}} over {nrow(x$series)} steps:",
                      "residual RMS {signif(sqrt(mean(x$series$residual^2)), 3)}",
                      "{pretty_unit(x$unit)}, of which",
                      "{signif(sqrt(mean(x$series$discrepancy^2)), 3)} responds to boundary",
                      "conditions"))
  cli::cli_bullets(c(">" = "next: {.fun plot} or {.fun attribute_discrepancy}"))
})

# Posterior mean response of the discrepancy to each condition at the calibration rows (N x S); they
# add up to the discrepancy.
condition_responses <- function(fit, data) {
  phi <- sweep(sweep(data$responses, 2, fit$centre), 2, fit$scale, "/")
  b <- rowMeans(fit$coefficients)
  vapply(seq_along(fit$measurements$conditions), function(s) {
    columns <- data$condition == s - 1L
    as.numeric(phi[, columns, drop = FALSE] %*% b[columns] -
                 data$moves %*% fit$withheld_of_condition[, s])
  }, numeric(nrow(phi)))
}
