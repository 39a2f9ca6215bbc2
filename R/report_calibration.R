# One calibration in words.

# The calibration as the only model of an upgrade, as the figures over time ask for one.
as_only_model <- function(fit) {
  prediction <- stats::predict(fit, use = predictable_rows(fit))
  model <- list(name = "the model", fit = fit, prediction = prediction,
                scores = prediction_scores(prediction))
  list(models = list(model), measurements = fit$measurements)
}

predictable_rows <- function(fit) {
  intersect(predictable(fit), fit$measurements$use[!is.na(fit$measurements$y)])
}

calibration_words <- function(fit, only) {
  trusted <- fit$trust$trusted
  model <- only$models[[1]]
  left <- remaining_error(model, fit$measurements)
  list(title = fit$measurements$name, verdict = if (trusted) "named" else "likely",
       tag = if (trusted) "Calibration" else "Calibration that is not to be trusted",
       headline = error_sentence(fit),
       sure = c(sprintf("Sampler: %s.", sampler_said(fit)$verdict),
                if (!is.null(fit$check)) sprintf("Emulator: %s.", fit$check$verdict)),
       gain = gain_sentences(only), remains = c(
         if (!is.null(left$pattern))
           sprintf("The error that remains has a pattern: %s.", left$pattern$what),
         if (!is.null(fit$reach)) sub("^(.)(.*)$", "\\U\\1\\E\\2.", reach_words(fit), perl = TRUE),
         mode_words(fit), failing_sentence(fit), edge_sentence(fit) %||% no_edge),
       inspect = calibration_inspections(fit, model), parameters = parameters_words(fit),
       method = method_table(only), seed = fit$seed)
}

#' @export
report_content.amiss_fit <- function(x) {
  only <- as_only_model(x)
  list(fit = x, only = only, told = calibration_words(x, only), history = knows_history(x))
}
