#' Bayes factor of two calibrated models
#'
#' Compares two models by their evidence. Both evidences are densities of the same measured record,
#' so models with different bases may be compared. The words are those of Monari (2022), table 1.
#' They say what the whole interval supports: a Bayes factor of 10^3.6 that may as well be 10^-18 is
#' "undecided".
#'
#' @param model,reference Calibrations on the same measurements by the same method ([calibrate()] or
#'   [calibrate_paper()]).
#' @return A one-row data frame: `log10_bf` in favour of `model`, its 95 % interval `lower95`,
#'   `upper95`, and `word`.
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
#' sunny <- function_simulator(function(values, drivers) 20 + values[["sun"]] * drivers[, "Gv"],
#'                             free("sun", uniform(0, 0.1)), boundary = "Gv")
#' more <- simulate_design(sunny, room, runs = 20, seed = 1)
#' other <- calibrate(train_emulator(more, room), room, quick, seed = 1)
#' bayes_factor(fit, other)
#' @export
bayes_factor <- function(model, reference) {
  check_arguments()
  fits <- list(model = model, reference = reference)
  for (name in names(fits))
    check_object(fits[[name]], c("amiss_fit", "amiss_joint"), name)
  lapply(fits, check_not_part)
  if (!identical(class(model)[1], class(reference)[1])) {
    abort_input(c(paste("{.arg model} and {.arg reference} were calibrated by different methods;",
                        "their evidences cannot be compared."),
                  i = "Use {.fun calibrate} for both, or {.fun calibrate_paper}."))
  }
  if (!identical(calibrated_record(model), calibrated_record(reference))) {
    abort_input(c(paste("The two models were calibrated on different records; their evidences",
                        "cannot be compared."), i = "Calibrate both on the same measurements."))
  }
  factor_of(model, reference)
}

# The same of any two evidences of one record, each with its standard error.
factor_of <- function(model, reference) {
  log10_bf <- (model$log_evidence - reference$log_evidence) / log(10)
  se <- sqrt(model$standard_error^2 + reference$standard_error^2) / log(10)
  interval <- log10_bf + c(-1.96, 1.96) * se
  data.frame(log10_bf = log10_bf, lower95 = interval[1], upper95 = interval[2],
             word = evidence_word(interval[1], interval[2]))
}

evidence_word <- function(lower, upper) {
  words <- c("undecided", "weak", "substantial", "strong", "decisive")
  word <- words[findInterval(lower, c(0, 0.5, 1, 2)) + 1]
  word[upper < 0] <- "negative"
  word
}

#' Evidence for bridgesampling
#'
#' `logml()` and `bf()` of the package `bridgesampling` for calibrations, whose evidence comes from
#' annealed importance sampling. [bayes_factor()] gives the interval as well.
#'
#' @param x,x1,x2 Calibrations ([calibrate()], [calibrate_paper()]); two on the same measurements by
#'   the same method.
#' @param log Whether the natural logarithm of the Bayes factor is given.
#' @param ... Not used: an argument that is not known is an error.
#' @return `logml()`: the natural logarithm of the evidence. `bf()`: the Bayes factor in favour of
#'   `x1`, of the class `bf_bridge`.
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
#' if (requireNamespace("bridgesampling", quietly = TRUE)) bridgesampling::logml(fit)
#' @name logml
#' @exportS3Method bridgesampling::logml
logml.amiss_fit <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  x$log_evidence
}

#' @rdname logml
#' @exportS3Method bridgesampling::bf
bf.amiss_fit <- function(x1, x2, log = FALSE, ...) {
  check_whole(x1, "x1")
  rlang::check_dots_empty()
  check_input(checkmate::check_flag(log), "log")
  value <- bayes_factor(x1, x2)$log10_bf * base::log(10)
  structure(list(bf = if (log) value else exp(value), log = log), class = "bf_bridge",
            model_names = c(deparse1(substitute(x1)), deparse1(substitute(x2))))
}
