attribution_control <- list(surrogates = 199, smallest_shift = 0.05, level = 0.05, least_log10_bf = 0.5,
                            ais = list(pilot_chains = 128, groups = 4, max_groups = 32, precision = 0.2))

#' Which boundary conditions drive the discrepancy
#'
#' For each condition: the evidence that the history model loses when the condition is dropped, its share of the
#' discrepancy, and a p-value from surrogates (all conditions shifted in time together, which keeps their
#' autocorrelation and their correlation with one another), adjusted over all conditions by Holm's method.
#'
#' *Share.* A set of conditions explains `1 - RSS / TSS` of the record outside the simulation space, its sums of squares
#' weighed by the covariance of the error (for white error: the plain share of the variance). The share of a condition
#' is its Shapley value: what it adds to those before it, averaged over all orders of the conditions and over the
#' posterior. So shares are not negative and add up to what all conditions explain together, also where conditions are
#' correlated; two conditions that say the same share evenly. Beyond 10 conditions that act, 400 random orders stand for all.
#'
#' @param fit A calibration ([calibrate()]).
#' @param control List of options: `surrogates` (199), `smallest_shift` (0.05 of the record), `level` (0.05),
#'   `least_log10_bf` (0.5: what a condition must earn besides its p-value), and `ais` for the sampler.
#' @inheritParams calibrate
#' @return An object of class `amiss_attribution`; its `table` is ranked.
#' @export
attribute_discrepancy <- function(fit, control = NULL, seed = NULL, threads = 1) {
  check_input(checkmate::check_class(fit, "amiss_calibration"), "fit")
  control <- merge_control(attribution_control, control)
  check_attribution_control(control)
  ais <- fit$control$ais
  ais[names(control$ais)] <- control$ais
  control$ais <- fill_ais_control(ais, "control$ais")
  seed <- pick_seed(seed)
  threads <- check_threads(threads)
  data <- history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  full_setting <- fit$history$setting[which.max(fit$history$log_likelihood)]
  settings <- unique(c(full_setting, fit$null_setting))
  conditions <- fit$measurements$conditions
  lost <- evidence_lost(fit)
  again <- which(!lost$standard_error <= control$ais$precision)
  result <- call_engine(attribute_(data, fit$priors, again - 1L, settings, control, engine_context(seed, threads)))
  lost$value[again] <- fit$history$log_evidence - result$log_evidence_dropped
  lost$standard_error[again] <- sqrt(fit$history$standard_error^2 + result$standard_error^2)
  lost$trusted[again] <- fit$history$trusted & result$trusted
  log10_bf <- lost$value / log(10)
  table <- data.frame(boundary = conditions, log10_bf_dropped = log10_bf, standard_error = lost$standard_error / log(10),
                      share = variance_shares(fit, data, seed, threads), p_value = result$adjusted, p_value_single = result$p_value,
                      significant = result$adjusted <= control$level & log10_bf >= control$least_log10_bf,
                      trusted = lost$trusted)
  table <- table[order(-table$log10_bf_dropped), ]
  rownames(table) <- NULL
  structure(list(format_version = format_version, table = table, surrogates = nrow(result$null_statistics),
                 statistic = stats::setNames(result$statistic, conditions), null_statistics = result$null_statistics,
                 control = control, seed = seed), class = "amiss_attribution")
}

# Log evidence lost without each condition, from the posterior's own draws: with independent priors the model without
# condition s is the one with t_s = 0, so that Z_-s / Z = P(t_s = 0 | y) / P(t_s = 0) (Savage and Dickey). Its error is
# that of a share among as many independent draws as the effective size; a share of none has none.
evidence_lost <- function(fit) {
  history <- fit$history
  off <- colSums(history$weights * (history$t == 0))
  prior_off <- 1 - fit$priors$inclusion
  value <- if (prior_off > 0) log(prior_off) - log(off) else rep(NA_real_, length(off))
  error <- sqrt(pmax(0, 1 - off) / (off * history$ess))
  list(value = value, standard_error = ifelse(is.finite(value), error, Inf), trusted = rep(history$trusted, length(off)))
}

check_attribution_control <- function(control, call = rlang::caller_env()) {
  check_input(checkmate::check_count(control$surrogates, positive = TRUE), "control$surrogates", call = call)
  check_input(checkmate::check_number(control$smallest_shift, lower = 0, upper = 0.49), "control$smallest_shift", call = call)
  check_input(checkmate::check_number(control$level, lower = 0, upper = 1), "control$level", call = call)
  check_input(checkmate::check_number(control$least_log10_bf, finite = TRUE), "control$least_log10_bf", call = call)
  check_input(checkmate::check_list(control$ais), "control$ais", call = call)
}

# Shapley shares, averaged over the posterior draws that are kept for the discrepancy.
variance_shares <- function(fit, data, seed, threads) {
  colMeans(call_engine(shapley_shares_(data, fit$priors, fit$errors, engine_context(seed, threads))))
}

# Posterior mean response of the discrepancy to each condition at the calibration rows (N x S).
condition_responses <- function(fit, data) {
  phi <- sweep(sweep(data$responses, 2, fit$centre), 2, fit$scale, "/")
  b <- rowMeans(fit$coefficients)
  vapply(seq_along(fit$measurements$conditions), function(s) {
    own <- data$condition == s - 1L
    as.numeric(phi[, own, drop = FALSE] %*% b[own])
  }, numeric(nrow(phi)))
}

#' @export
print.amiss_attribution <- function(x, ...) {
  cli::cli_text("{.strong Attribution} of the discrepancy ({x$surrogates} surrogates)")
  print(x$table[c("boundary", "log10_bf_dropped", "share", "p_value", "significant")], digits = 3, row.names = FALSE)
  named <- x$table$boundary[x$table$significant]
  cli::cli_bullets(c("*" = if (length(named)) "driven by {.field {named}}" else "no boundary condition is significant",
                     ">" = "next: {.fun upgrade_model} with a {.fun catalogue}"))
  invisible(x)
}

#' @export
tidy.amiss_attribution <- function(x, ...) x$table
