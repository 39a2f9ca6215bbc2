emulator_control <- list(explained = 0.99, noise_fraction = 0.2, max_vectors = 30, starts = 3, searches = 1, max_evaluations = 120)

#' Train the emulator of an ensemble
#'
#' The runs are put on a basis (singular vectors of the centred runs and a vector of ones) and each
#' coefficient gets a Gaussian process over the parameters.
#'
#' @param ensemble An ensemble: [simulate_design()] or [ensemble()].
#' @param noise_sd Standard deviation of the measurement noise, or the [measurements()], which know it: the basis
#'   is kept fine enough that what it discards lies below it.
#' @param control List of options: `explained` (share of variance kept, 0.99), `noise_fraction` (discarded RMS as a
#'   share of the noise, 0.2), `max_vectors` (30), `starts`, `searches` and `max_evaluations` of the gradient search.
#' @param threads Number of threads.
#' @return An object of class `amiss_emulator`, with leave-one-out diagnostics for each coefficient and for the
#'   reconstructed series.
#' @export
train_emulator <- function(ensemble, noise_sd, control = NULL, threads = 1) {
  check_input(checkmate::check_class(ensemble, "amiss_ensemble"), "ensemble")
  if (inherits(noise_sd, "amiss_measurements")) {
    rows <- used_rows(noise_sd, "calibrate")
    if (nrow(ensemble$outputs) != length(rows)) {
      abort_input(c("The runs have {nrow(ensemble$outputs)} steps and the measurements {length(rows)} calibration rows.",
                    i = "Give the runs at exactly these rows."))
    }
    noise_sd <- noise_sd$noise_sd
  }
  check_input(checkmate::check_number(noise_sd, lower = 0, finite = TRUE), "noise_sd")
  control <- merge_control(emulator_control, control)
  threads <- check_threads(threads)
  basis <- call_engine(make_basis_(ensemble$outputs, c(control, noise_sd = noise_sd)))
  trained <- call_engine(train_emulator_(ensemble$unit, basis, control, engine_context(1, threads)))
  diagnostics <- emulator_diagnostics(trained, basis, ensemble$outputs)
  if (basis$discarded_rms > noise_sd && noise_sd > 0) {
    warn_result(c("The basis of {ncol(basis$vectors)} vectors leaves {signif(basis$discarded_rms, 3)} of the runs unexplained (RMS), more than the noise of {signif(noise_sd, 3)}.",
                  i = "What it leaves out looks like discrepancy: raise {.code max_vectors} or narrow the priors."))
  }
  structure(list(format_version = format_version, parameters = ensemble$parameters, simulator = ensemble$simulator,
                 basis = basis[c("vectors", "singular_values", "explained", "discarded_rms", "discarded_ss")],
                 processes = trained[c("inputs", "coefficients", "hyperparameters")], diagnostics = diagnostics,
                 noise_sd = noise_sd, evaluations = trained$evaluations), class = "amiss_emulator")
}

emulator_diagnostics <- function(trained, basis, outputs) {
  z <- (trained$coefficients - trained$loo_mean) / sqrt(trained$loo_variance)
  r2 <- 1 - colSums((trained$coefficients - trained$loo_mean)^2) /
    pmax(colSums(scale(trained$coefficients, scale = FALSE)^2), .Machine$double.xmin)
  predicted <- tcrossprod(basis$vectors, trained$loo_mean)
  list(coefficients = data.frame(vector = seq_len(ncol(z)), r2 = r2, coverage95 = colMeans(abs(z) < stats::qnorm(0.975))),
       series_rmse = sqrt(mean((predicted - outputs)^2)),
       series_r2 = 1 - sum((predicted - outputs)^2) / sum((outputs - rowMeans(outputs))^2))
}

#' @export
print.amiss_emulator <- function(x, ...) {
  d <- x$diagnostics
  cli::cli_text("{.strong Emulator} of {nrow(x$processes$inputs)} runs: {ncol(x$basis$vectors)} basis vectors explain {round(100 * x$basis$explained, 3)} %")
  cli::cli_bullets(c("*" = "left out: {signif(x$basis$discarded_rms, 2)} RMS beside a noise of {signif(x$noise_sd, 2)}",
                     "*" = "leave-one-out: series R2 {round(d$series_r2, 5)}, RMSE {signif(d$series_rmse, 2)}, 95 % coverage of coefficients {round(100 * mean(d$coefficients$coverage95))} %",
                     ">" = "next: {.fun calibrate}"))
  invisible(x)
}

#' Predict the simulator's output by its emulator
#'
#' @param object The emulator.
#' @param newdata Matrix of parameter values, one row a point, named columns.
#' @param ... Not used.
#' @return A list of `mean` and `sd`, one column per point.
#' @export
predict.amiss_emulator <- function(object, newdata, ...) {
  rlang::check_dots_empty()
  newdata <- as.matrix(newdata)
  check_input(checkmate::check_matrix(newdata, "numeric", any.missing = FALSE, min.rows = 1), "newdata")
  absent <- setdiff(names(object$parameters), colnames(newdata))
  if (length(absent)) abort_input("{.arg newdata} lacks {cli::qty(absent)}column{?s} {.val {absent}}.")
  for (name in names(object$parameters)) {
    prior <- object$parameters[[name]]$prior
    outside <- which(newdata[, name] < prior$lower | newdata[, name] > prior$upper)
    if (length(outside)) {
      abort_input(c("{name} = {newdata[outside[1], name]} in row {outside[1]} of {.arg newdata} lies outside its prior, {format(prior)}.",
                    i = "The emulator knows nothing there; run the simulator."))
    }
  }
  unit <- vapply(names(object$parameters), function(n) prior_cdf(object$parameters[[n]]$prior, newdata[, n]), numeric(nrow(newdata)))
  w <- predict_emulator_(object$processes, matrix(unit, nrow(newdata)))
  list(mean = tcrossprod(object$basis$vectors, w$mean), sd = sqrt(tcrossprod(object$basis$vectors^2, w$variance)))
}
