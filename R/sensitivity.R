#' Sobol indices of the parameters
#'
#' @description
#' Says which parameters move the simulation, measured or not. The variance of the simulation over
#' the priors, which are independent, is shared out among the parameters:
#'
#' * The first-order index of a parameter is the part that goes when its value is known.
#' * The total index is the part that stays when all others are known. It counts interactions too.
#'
#' @details
#' Indices of a whole series are those of its steps, weighted by the steps' variances (generalised
#' indices of Lamboni et al. and of Gamboa et al.):
#'
#'     S = sum_t V_t(parameter) / sum_t V_t
#'
#' # Estimate
#'
#' The indices come from the emulator's mean on pairs of Latin hypercubes that exchange a column.
#' The estimators are those of Saltelli (2010) for the first order and of Jansen (1999) for the
#' total. They are exchanged both ways as in Azzini et al. (2021), so that they err little if an
#' index is near 0 or 1.
#'
#' Designs are replicated, and the scatter of the replicates gives the standard error of sampling.
#' The emulator itself is known only as far as its runs show. On each design a function is drawn
#' that these runs leave possible. The root mean square difference of its indices is the error of
#' the emulator (Le Gratiet et al. 2014). `unexplained` is the share of a run's variance that the
#' emulator does not predict.
#'
#' @param x An emulator ([train_emulator()]), or a calibration ([calibrate()], [calibrate_paper()]),
#'   whose emulator over the priors is taken. For the methods, the indices.
#' @param points Points of one hypercube; the emulator is asked at `2 * points * (parameters + 1)`
#'   for each replicate.
#' @param replicates Number of designs.
#' @param by_time Also the indices of each step.
#' @param seed Seed of the designs and drawn functions; if `NULL`, R's generator gives one.
#' @return An object of class `amiss_sobol`:
#'   * `table`: a row for each parameter, with `first` and `total` and the errors of each,
#'     `_sampling` (standard error) and `_emulator`.
#'   * `by_time`, if asked for: columns `time`, `parameter`, `first` and `total`, missing where no
#'     run moves.
#'   * `unexplained`: see *Estimate*.
#'
#'   `as.data.frame()` gives `table`. `tidy()` gives one row for each parameter and `order`, with
#'   `std.error` of both errors and 95 % limits.
#' @source Azzini, Mara and Rosati (2021), Environmental Modelling and Software 144, 105167.
#'   Saltelli, Annoni, Azzini, Campolongo, Ratto and Tarantola (2010), Computer Physics
#'   Communications 181, 259-270. Jansen (1999), Computer Physics Communications 117, 35-43.
#'   Lamboni, Monod and Makowski (2011), Reliability Engineering and System Safety 96, 450-459.
#'   Gamboa, Janon, Klein and Lagnoux (2014), Electronic Journal of Statistics 8, 575-603. Le
#'   Gratiet, Cannamela and Iooss (2014), SIAM/ASA Journal on Uncertainty Quantification 2, 336-363.
#'   Wilson, Borovitskiy, Terenin, Mostowsky and Deisenroth (2020), Efficiently sampling functions
#'   from Gaussian process posteriors, ICML.
#' @examples
#' table <- data.frame(hour = 1:48, Ti = 20 + sin(1:48 / 4), Te = 5 + 3 * sin(1:48 / 4))
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1)
#' model <- function_simulator(function(values, drivers) {
#'   values[["offset"]] + values[["gain"]] * drivers[, "Te"]
#' }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te")
#' sobol_indices(train_emulator(simulate_design(model, room, runs = 30, seed = 1), room), seed = 1)
#' @export
sobol_indices <- function(x, points = 256, replicates = 16, by_time = FALSE, seed = NULL) {
  check_arguments()
  check_object(x, c("amiss_emulator", "amiss_fit"), "x",
              "It is made by {.fun train_emulator} or {.fun calibrate}.")
  check_input(checkmate::check_count(points), "points")
  check_input(checkmate::check_count(replicates), "replicates")
  if (points < 32) abort_input("{.arg points} = {points} is too few; give at least 32.")
  if (replicates < 4) abort_input(paste("{.arg replicates} = {replicates} is too few for a",
                                        "standard error; give at least 4."))
  check_input(checkmate::check_flag(by_time), "by_time")
  seed <- pick_seed(seed)
  parameters <- if (inherits(x, "amiss_fit")) x$emulator$parameters else x$parameters
  check_size("points", points,
             matrix_gb(points, 2 * (length(parameters) + 2), copies = length(parameters) + 2))
  emulator <- emulator_over_priors(if (inherits(x, "amiss_fit")) x$emulator else x)
  replicated <- with_seed(seed,
                          lapply(seq_len(replicates), function(r) pick_freeze(emulator, points)))
  expected <- index_tables(lapply(replicated, `[[`, "expected"), emulator$basis$vectors)
  drawn <- index_tables(lapply(replicated, `[[`, "drawn"), emulator$basis$vectors)
  with_errors <- function(order) {
    scatter <- sweep(expected$each[[order]], 1, expected[[order]])
    columns <- list(expected[[order]], sqrt(rowSums(scatter^2) / (replicates * (replicates - 1))),
                    sqrt(rowMeans((drawn$each[[order]] - expected$each[[order]])^2)))
    stats::setNames(columns, paste0(order, c("", "_sampling", "_emulator")))
  }
  names <- names(emulator$parameters)
  table <- data.frame(parameter = names, label = distinct_labels(emulator$parameters),
                      with_errors("first"), with_errors("total"), row.names = NULL)
  beside <- mean(vapply(replicated, `[[`, 0, "run_variance"))
  structure(list(format_version = format_version, table = table,
                 by_time = if (by_time) times_table(expected, names, emulator, x),
                 unexplained = beside / (beside + sum(expected$steps)), points = points,
                 replicates = replicates, seed = seed), class = "amiss_sobol")
}

# One design: points A and B and, for each parameter, A with the column of B and B with that of A.
# Covariances (Q x Q) of the coefficients over the priors, of what each parameter explains (first, P
# of them) and of what the others leave (total), for the emulator's mean and for a function drawn;
# and the mean variance of a run about the former.
pick_freeze <- function(emulator, points) {
  p <- length(emulator$parameters)
  pair <- lhs::randomLHS(points, 2 * p)
  a <- pair[, seq_len(p), drop = FALSE]
  b <- pair[, p + seq_len(p), drop = FALSE]
  with_column_of <- function(x, other)
    lapply(seq_len(p), function(j) replace(x, cbind(seq_len(points), j), other[, j]))
  unit <- do.call(rbind, c(list(a, b), with_column_of(a, b), with_column_of(b, a)))
  decomposed <- function(values) {
    block <- function(k) values[(k - 1) * points + seq_len(points), , drop = FALSE]
    moved <- function(j) list(block(1) - block(2 + j), block(2 + p + j) - block(2))
    product <- function(x, y = x) crossprod(x, y) / (4 * points)
    list(variance = product(block(1) - block(2)) + product(block(3) - block(3 + p)),
         first = lapply(seq_len(p), function(j) 2 * product(moved(j)[[1]], moved(j)[[2]])),
         total = lapply(seq_len(p), function(j) product(moved(j)[[1]]) + product(moved(j)[[2]])))
  }
  known <- emulated_coefficients(emulator, unit)
  list(expected = decomposed(known$mean), drawn = decomposed(drawn_function(emulator)(unit)),
       run_variance = sum(series_variance(emulator$basis, t(colMeans(known$variance)))))
}

# A function of the unit cube, giving coefficients (n x Q), drawn from those that the runs leave
# possible: a draw of each process before the runs, and the emulator's own prediction of what this
# misses of them (Matheron's rule).
drawn_function <- function(emulator) {
  processes <- emulator$processes
  scale <- apply(processes$coefficients, 2, stats::sd)
  drawn <- lapply(seq_along(scale),
                  function(q) drawn_process(processes$hyperparameters[q, ], scale[q]))
  smooth <- function(unit)
    matrix(vapply(drawn, function(f) f(unit), numeric(nrow(unit))), nrow(unit))
  noise <- scale * sqrt(exp(processes$hyperparameters[, 2]) + exp(-processes$hyperparameters[, 3]))
  runs <- nrow(processes$inputs)
  seen <- smooth(processes$inputs) + sweep(matrix(stats::rnorm(runs * length(scale)), runs), 2,
                                           noise, "*")
  emulator$processes$coefficients <- processes$coefficients - seen
  function(unit) smooth(unit) + emulated_coefficients(emulator, unit)$mean
}

# A Gaussian process of covariance amplitude * prod_p beta_p^(4 d_p^2), by random Fourier features:
# beta^(4 d^2) is the mean of cos(w d) over w ~ N(0, -8 log beta).
drawn_process <- function(hyperparameters, scale, features = 256) {
  sd <- sqrt(-8 * stats::plogis(hyperparameters[-(1:3)], log.p = TRUE))
  frequency <- sd * matrix(stats::rnorm(length(sd) * features), length(sd))
  phase <- stats::runif(features, 0, 2 * pi)
  weight <- scale * sqrt(2 * exp(hyperparameters[1]) / features) * stats::rnorm(features)
  function(unit) as.numeric(cos(sweep(unit %*% frequency, 2, phase, "+")) %*% weight)
}

# Indices of the series by replicate (each: P x R) and over all of them, and the variances of the
# steps that these are of.
index_tables <- function(replicates, vectors) {
  by_step <- function(covariance) rowSums((vectors %*% covariance) * vectors)
  variances <- vapply(replicates, function(r) by_step(r$variance), numeric(nrow(vectors)))
  variances <- matrix(variances, nrow(vectors))
  of <- function(order) {
    array(
      unlist(lapply(replicates, function(r) vapply(r[[order]], by_step, numeric(nrow(vectors))))),
      c(nrow(vectors), length(replicates[[1]][[order]]), length(replicates)))
  }
  parts <- list(first = of("first"), total = of("total"))
  each <- lapply(parts, function(v) sweep(colSums(v), 2, colSums(variances), "/"))
  series <- lapply(parts, function(v) rowSums(colSums(v)) / sum(variances))
  c(series, list(each = each, steps = rowMeans(variances),
                 by_step = lapply(parts, rowMeans, dims = 2)))
}

times_table <- function(expected, names, emulator, x) {
  steps <- length(expected$steps)
  time <- if (inherits(x, "amiss_fit")) x$measurements$time[x$rows]
          else emulator$hours %||% seq_len(steps)
  moves <- ifelse(expected$steps > 1e-12 * max(expected$steps), expected$steps, NA)
  data.frame(time = rep(time, length(names)), parameter = rep(names, each = steps),
             first = as.numeric(expected$by_step$first / moves),
             total = as.numeric(expected$by_step$total / moves))
}

#' @export
print.amiss_sobol <- function(x, ...) {
  check_whole(x, "x")
  shown <- order(-x$table$total)
  rounded <- function(values) format(round(values, 3), nsmall = 3)
  index <- function(order)
    paste(rounded(x$table[[order]]), "+-", rounded(index_error(x$table, order)))
  table <- data.frame(parameter = labels_with_names(x$table$label, x$table$parameter),
                      first = index("first"), total = index("total"))[shown, ]
  on_stdout(x, {
    cli::cli_text(paste("{.strong Sobol indices} of {nrow(table)} parameter{?s} over the priors,",
                        "with standard errors"))
    say_table(utils::head(table, 10))
    if (nrow(table) > 10) cli::cli_text("{nrow(table) - 10} more parameter{?s}: see {.fun tidy}")
    cli::cli_bullets(
      c("*" = "first orders add up to {round(sum(x$table$first), 3)}: the rest is interaction",
        "*" = "the emulator leaves {percent(x$unexplained)} of the variance of a run unexplained"))
  })
}

# Both errors, of sampling and of the emulator.
index_error <- function(table, order)
  sqrt(rowSums(table[paste0(order, c("_sampling", "_emulator"))]^2))

#' @rdname sobol_indices
#' @param ... Not used: an argument that is not known is an error.
#' @export
tidy.amiss_sobol <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  rows <- lapply(c("first", "total"), function(order) {
    error <- index_error(x$table, order)
    data.frame(term = x$table$parameter, label = x$table$label, order = order,
               estimate = x$table[[order]], std.error = error,
               conf.low = pmax(0, x$table[[order]] - stats::qnorm(0.975) * error),
               conf.high = pmin(1, x$table[[order]] + stats::qnorm(0.975) * error))
  })
  do.call(rbind, rows)
}

#' @rdname sobol_indices
#' @param row.names,optional As [as.data.frame()] has them; `optional` is not used.
#' @export
as.data.frame.amiss_sobol <- function(x, row.names = NULL, optional = FALSE, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  as.data.frame(x$table, row.names = row.names)
}
