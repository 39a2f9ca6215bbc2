#' Bayes factor of two calibrated models
#'
#' Both evidences are densities of the same measured record, so that models with different bases may be compared.
#' The words are those of Monari (2022), table 1, for what the whole interval supports: a Bayes factor of 10^3.6 that may as well be
#' 10^-18 is "undecided".
#'
#' @param model,reference Calibrations on the same measurements by the same method ([calibrate()] or [calibrate_paper()]).
#' @return A one-row data frame: `log10_bf` in favour of `model`, its 95 % interval `lower95`, `upper95`, and `word`.
#' @export
bayes_factor <- function(model, reference) {
  fits <- list(model = model, reference = reference)
  for (name in names(fits)) check_input(checkmate::check_multi_class(fits[[name]], c("amiss_calibration", "amiss_paper_calibration")), name)
  if (class(model) != class(reference)) {
    abort_input(c("{.arg model} and {.arg reference} were calibrated by different methods; their evidences cannot be compared.",
                  i = "Use {.fun calibrate} for both, or {.fun calibrate_paper}."))
  }
  if (!identical(model$measurements$y[model$rows], reference$measurements$y[reference$rows])) {
    abort_input(c("The two models were calibrated on different records; their evidences cannot be compared.",
                  i = "Calibrate both on the same measurements."))
  }
  log10_bf <- (model$log_evidence - reference$log_evidence) / log(10)
  se <- sqrt(model$standard_error^2 + reference$standard_error^2) / log(10)
  interval <- log10_bf + c(-1.96, 1.96) * se
  data.frame(log10_bf = log10_bf, lower95 = interval[1], upper95 = interval[2], word = evidence_word(interval[1], interval[2]))
}

evidence_word <- function(lower, upper) {
  words <- c("undecided", "weak", "substantial", "strong", "decisive")
  word <- words[findInterval(lower, c(0, 0.5, 1, 2)) + 1]
  word[upper < 0] <- "negative"
  word
}
