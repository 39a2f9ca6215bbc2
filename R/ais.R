#' Annealed importance sampling of any posterior
#'
#' The sampler behind [calibrate()], for a likelihood written in R: draws from the posterior and its normalising
#' constant (the evidence), with an interval, a second estimator and a verdict.
#'
#' @param log_likelihood Function of a numeric matrix (one point a row, columns named like `priors`) that returns the
#'   log-likelihood of each point; `-Inf` where it is zero.
#' @param priors Named list of [prior]s.
#' @param control List of options: `pilot_chains`, `groups`, `chains`, `sweeps`, `ess_drop`, `resample` (`FALSE` for plain
#'   annealed importance sampling), `importance_draws` and `max_components` of the second estimator.
#' @param seed Seed; if `NULL`, R's generator gives one.
#' @return An object of class `amiss_ais`: `draws` (matrix), `weights`, `log_evidence`, `standard_error`, `interval` (95 %),
#'   `annealed` and `second` (estimate and standard error of each estimator), `ladder`, `evaluations`, `trusted`, `verdict`.
#' @examples
#' y <- c(1.2, 0.7, 1.9)
#' ais(function(z) vapply(z[, "mean"], function(m) sum(dnorm(y, m, 1, log = TRUE)), 0),
#'     list(mean = normal(0, 2)), seed = 1)
#' @export
ais <- function(log_likelihood, priors, control = NULL, seed = NULL) {
  check_input(checkmate::check_function(log_likelihood), "log_likelihood")
  check_input(checkmate::check_list(priors, types = "amiss_prior", min.len = 1, names = "unique"), "priors",
              "For example {.code list(a = uniform(0, 1))}.")
  control <- merge_control(ais_control, control)
  seed <- pick_seed(seed)
  to_values <- function(unit) {
    values <- vapply(seq_along(priors), function(p) prior_quantile(priors[[p]], unit[, p]), numeric(nrow(unit)))
    matrix(values, nrow(unit), dimnames = list(NULL, names(priors)))
  }
  call <- rlang::current_env()
  at_unit <- function(unit) {
    tryCatch(as.numeric(log_likelihood(to_values(unit))), error = function(e) {
      abort_input(c("{.arg log_likelihood} stopped with an error.", x = "{conditionMessage(e)}"), call = call)
    })
  }
  result <- call_engine(ais_(at_unit, length(priors), control, engine_context(seed, 1)))
  result$draws <- to_values(result$unit)
  result$unit <- NULL
  structure(c(list(format_version = format_version, seed = seed), result), class = "amiss_ais")
}

#' @export
print.amiss_ais <- function(x, ...) {
  cli::cli_text("{.strong Posterior} of {ncol(x$draws)} parameter{?s}: log evidence {round(x$log_evidence, 2)} [{round(x$interval[1], 2)}, {round(x$interval[2], 2)}] ({x$estimator})")
  cli::cli_bullets(c("*" = "{x$evaluations} likelihood values, {round(x$ess)} effective draws", "*" = x$verdict))
  invisible(x)
}
