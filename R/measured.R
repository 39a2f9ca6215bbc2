# A model of the loop as the result has it: its calibration, what its error responds to, its
# prediction of the record and its scores.

measured_model <- function(model, context) {
  attribution <- attribute_discrepancy(model$fit, context$control$attribution, seed = context$seed,
                                       threads = context$threads)
  c(list(name = model$name, parent = model$parent, mechanism = model$mechanism, fit = model$fit,
         attribution = attribution), predicted_record(model, context))
}

# list(prediction, scores), of several records in units of each one's noise, with `records`, the
# same of each as it is. Runs of the check serve for it, so that no further ones are made.
predicted_record <- function(model, context) {
  fits <- record_fits(model$fit)
  each <- lapply(seq_along(fits), function(k) {
    prediction <- if (model$level != "given") prediction_by_runs(model, fits[[k]], k)
                  else stats::predict(fits[[k]], use = predictable(fits[[k]]), seed = context$seed,
                                      threads = context$threads)
    list(prediction = prediction, scores = prediction_scores(prediction))
  })
  if (!inherits(model$fit, "amiss_joint")) return(each[[1]])
  names(each) <- names(model$fit$records)
  scaled <- c("observed", "mean", "lower95", "upper95", "crps")
  in_noise <- Map(function(name, one) {
    noise_sd <- model$fit$records[[name]]$measurements$noise_sd
    data.frame(record = name, one$prediction[c("use", "segment")],
               one$prediction[scaled] / noise_sd)
  }, names(each), each)
  together <- do.call(rbind, unname(in_noise))
  list(prediction = together, scores = prediction_scores(together), records = each)
}

# The runs at draws of the posterior; if the budget left none, those in the middle of its region.
predicting_runs <- function(model) {
  if (length(model$checked$at)) return(rep(model$checked$at, model$checked$times))
  distance <- ifelse(succeeded(model), straight_distance(model), Inf)
  utils::head(order(distance), max(rules$middle_runs, sum(distance <= rules$middle_radius)))
}

prediction_by_runs <- function(model, fit, k) {
  record <- model$records[[k]]
  at <- c(model$least$at, predicting_runs(model))
  runs <- matrix(0, length(record$calibrates), length(at))
  runs[record$calibrates, ] <- model$runs$outputs[model$rows[[k]], at]
  runs[!record$calibrates, ] <- model$runs$held[model$held_rows[[k]], at]
  best <- runs[, 1]
  runs <- runs[, colSums(!is.finite(runs)) == 0, drop = FALSE]
  if (all(is.finite(best))) runs <- about_best(runs[, -1, drop = FALSE], best)
  rows <- sort(c(record$rows, record$held))
  with_seed(fit$seed, summarise_prediction(record$measurements, rows, runs, error_sd(fit),
                                           "prediction", 0.95))
}
