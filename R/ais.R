#' Annealed importance sampling of any posterior
#'
#' Samples a posterior whose likelihood is written in R. It gives draws from the posterior and its
#' normalising constant (the evidence), with an interval, a second estimator and a verdict.
#' [calibrate()] uses the same sampler.
#'
#' # How it works
#'
#' A pilot finds a ladder of temperatures from the prior to the posterior. For each temperature it
#' finds how the chains move and how often. Then all is frozen, and fresh, independent groups of
#' chains give the estimate. The estimate is unbiased, with an interval by bootstrap over the
#' groups.
#'
#' The second estimator is an importance sample from a mixture fitted in rounds to the draws. If no
#' mixture comes close, it is annealing from that mixture. The second estimate must not be larger
#' than the one reported. Groups or draws are added until the standard error is at most `precision`.
#'
#' # Modes
#'
#' Chains lose a mode that is much narrower than another, because it has little mass while they are
#' warm. Therefore climbs follow from points of the prior that do not lead to the draws. A climb may
#' reach a peak without draws that holds two hundredths of the posterior or more. An importance
#' sample of it then joins the draws, and the verdict says so. A mode to which less than a
#' thousandth of the prior leads is not seen (`bench/trusted.R`).
#'
#' @param log_likelihood Function of a numeric matrix (one point a row, columns named like `priors`)
#'   that returns the log-likelihood of each point; `-Inf` where it is zero.
#' @param priors Named list of [prior]s.
#' @param seed Seed; if `NULL`, R's generator gives one.
#' @param gradient Function of the same matrix that returns the gradient of the log-likelihood with
#'   respect to the parameters, a matrix of the same shape. The chains then make Hamiltonian moves
#'   too.
#' @param control List of options, with their defaults:
#'   * `pilot_chains`: chains of the pilot (16 per dimension, at least 256).
#'   * `chains`: chains in a group (3 per dimension, at least 32).
#'   * `groups` (8), `max_groups` (64), `precision` (0.1): groups are added, up to `max_groups`,
#'     until the standard error of the log evidence is below `precision`.
#'   * `sweeps`, `max_sweeps`: least and greatest number of moves of a chain at a temperature (3, in
#'     the thinned records of [calibrate_paper()] 1; 30).
#'   * `ess_drop`: effective share of the chains that the step to the next temperature leaves (0.7).
#'   * `gradient`: Hamiltonian moves if the likelihood has a gradient (`TRUE`). [calibrate()] makes
#'     them along the parameters: they follow a curved posterior, at up to twice the cost. [ais()]
#'     makes them if it is given a gradient.
#'   * `resample`: `FALSE` for plain annealed importance sampling (Neal 2001).
#'   * `importance_draws`: draws of the mixture (1000; in [ais()] ten for each number of a normal
#'     distribution of all parameters, if that is more). 0 leaves out the second estimator and the
#'     search for modes.
#'   * `max_components`: most components of the mixture (3).
#' @return An object of class `amiss_ais`:
#'   * `draws` (matrix), `weights`.
#'   * `log_evidence`, `standard_error`, `interval` (95 %).
#'   * `annealed`, `second`: estimate and standard error of each estimator.
#'   * `ladder`, `evaluations`.
#'   * `trusted`, `verdict`: what the sampler sees of its own work. A mode that it has not seen
#'     leaves no sign.
#' @source Neal (2001), Annealed importance sampling, Statistics and Computing 11, 125-139. Del
#'   Moral, Doucet and Jasra (2006), Sequential Monte Carlo samplers, Journal of the Royal
#'   Statistical Society B 68, 411-436 (the pilot). Rodriguez and Laio (2014), Clustering by fast
#'   search and find of density peaks, Science 344, 1492-1496 (where climbs begin). Hesterberg
#'   (1995), Weighted average importance sampling and defensive mixture distributions, Technometrics
#'   37, 185-194. The vignette has the whole: `vignette("algorithm", "amiss")`, *Annealed importance
#'   sampling*.
#' @examples
#' y <- c(1.2, 0.7, 1.9)
#' ais(function(z) vapply(z[, "mean"], function(m) sum(dnorm(y, m, 1, log = TRUE)), 0),
#'     list(mean = normal(0, 2)), seed = 1)
#' @export
ais <- function(log_likelihood, priors, control = NULL, seed = NULL, gradient = NULL) {
  check_arguments()
  check_input(checkmate::check_function(log_likelihood), "log_likelihood")
  check_input(checkmate::check_list(priors, types = "amiss_prior", min.len = 1, names = "unique"),
              "priors", "For example {.code list(a = uniform(0, 1))}.")
  for (one in priors) check_whole(one, "priors")
  check_input(checkmate::check_function(gradient, null.ok = TRUE), "gradient")
  filled <- fill_ais_control(control)
  if (is.null(control$importance_draws))
    filled$importance_draws <- max(filled$importance_draws, mixture_draws(length(priors)))
  control <- filled
  control$gradient <- !is.null(gradient)
  seed <- pick_seed(seed)
  to_values <- function(unit) {
    values <- vapply(seq_along(priors), function(p) prior_quantile(priors[[p]], unit[, p]),
                     numeric(nrow(unit)))
    matrix(values, nrow(unit), dimnames = list(NULL, names(priors)))
  }
  call <- rlang::current_env()
  attempt <- function(f, name, values) {
    tryCatch(f(values), error = function(e) {
      abort_input(c("{.arg {name}} stopped with an error.", x = "{conditionMessage(e)}"),
                  call = call)
    })
  }
  tally <- list2env(list(points = 0, undefined = 0))
  at_unit <- function(unit) {
    values <- to_values(unit)
    usable_likelihood(attempt(log_likelihood, "log_likelihood", values), values, tally, call)
  }
  # d value / du is one over the prior's density.
  slope_at_unit <- function(unit) {
    values <- to_values(unit)
    slope <- attempt(gradient, "gradient", values)
    if (!is.numeric(slope) || !identical(dim(slope), dim(values))) {
      abort_input(c(paste("{.arg gradient} must return a matrix like the one it is given,",
                          "{nrow(values)} x {ncol(values)}."),
                    x = "It returned {.cls {class(slope)}} of length {length(slope)}."),
                  call = call)
    }
    density <- vapply(seq_along(priors), function(p) prior_density(priors[[p]], values[, p]),
                      numeric(nrow(unit)))
    unname(slope / matrix(density, nrow(unit)))
  }
  result <- call_engine(ais_(at_unit, if (!is.null(gradient)) slope_at_unit, length(priors),
                             control, engine_context(seed, 1)))
  tell_undefined(tally)
  if (control$importance_draws != 0) {
    result <- with_lost_modes(result, function(x) {
      values <- as.numeric(attempt(log_likelihood, "log_likelihood", to_values(stats::pnorm(x))))
      ifelse(is.na(values), -Inf, values)
    }, seed)
  }
  result$draws <- to_values(result$unit)
  result$unit <- NULL
  structure(c(list(format_version = format_version, seed = seed), result), class = "amiss_ais")
}

# Log-likelihoods as numbers. Where there is none (NaN), the point counts as impossible and is told
# of; where that is a good part of the priors, the result would be of another model.
usable_likelihood <- function(x, values, tally, call) {
  if (!is.numeric(x) && !is.logical(x)) {
    abort_input("{.arg log_likelihood} must return numbers; it returned {.cls {class(x)}}.",
                call = call)
  }
  if (length(x) != nrow(values)) {
    abort_input(c(paste("{.arg log_likelihood} returned another number of values than it got",
                        "points: {length(x)} for {nrow(values)}."),
                  i = "It gets a matrix, one point a row."), call = call)
  }
  at <- function(i) point_words(values[i, , drop = FALSE])
  endless <- which(x == Inf)
  if (length(endless))
    abort_input("{.arg log_likelihood} is Inf at {at(endless[1])}: no likelihood is.", call = call)
  undefined <- which(is.na(x))
  tally$points <- tally$points + length(x)
  tally$undefined <- tally$undefined + length(undefined)
  if (length(undefined) && is.null(tally$where)) tally$where <- at(undefined[1])
  if (tally$undefined > largest_failed_share * tally$points) {
    abort_numerical(c(paste("{.arg log_likelihood} is not a number at {tally$undefined} of the",
                            "first {tally$points} points."),
                      x = "The first is at {tally$where}.",
                      i = paste("Narrow the priors to where it is defined, or return -Inf where",
                                "the data are impossible.")), call = call)
  }
  as.numeric(x)
}

tell_undefined <- function(tally) {
  if (tally$undefined == 0) return(invisible())
  warn_result(c(paste("{.arg log_likelihood} was not a number at {tally$undefined} of",
                      "{tally$points} points, which count as impossible."),
                x = "The first is at {tally$where}."))
}

# The numbers of chains and moves stay 0 where they follow from the target, which the engine knows.
# Limits that were not given follow those that were: more groups than `max_groups` raise it.
# Draws that show the mean and the covariance of d parameters: a mixture that is fitted to few
# misses what it does not know, and an importance sample of it finds too little of a long ridge.
mixture_draws <- function(d) 10 * d * (d + 3) / 2

fill_ais_control <- function(control, what = "control", call = rlang::caller_env()) {
  filled <- merge_control(ais_defaults_(), control, what, call = call)
  for (name in c("pilot_chains", "chains", "sweeps")) filled[[name]] <- filled[[name]] %||% 0
  check <- function(name, value, lower, hint = NULL) {
    check_input(checkmate::check_int(value, lower = lower, upper = 1e7), paste0(what, "$", name),
                hint, call = call)
  }
  follows <- c("pilot_chains", "chains", "sweeps", "importance_draws")
  least <- c(groups = 2, sweeps = 1, pilot_chains = 8, chains = 4, importance_draws = 50,
             max_components = 1)
  for (name in names(least)) {
    value <- filled[[name]]
    if (!(name %in% follows && checkmate::test_number(value) && value == 0))
      check(name, value, least[[name]])
  }
  for (limit in c("groups", "sweeps")) {
    upper <- paste0("max_", limit)
    if (is.null(control[[upper]])) filled[[upper]] <- max(filled[[upper]], filled[[limit]])
  }
  check("max_groups", filled$max_groups, filled$groups, "It may not lie below {.code groups}.")
  check("max_sweeps", filled$max_sweeps, max(1, filled$sweeps),
        "It may not lie below {.code sweeps}.")
  check_input(checkmate::check_number(filled$precision, lower = 1e-6, finite = TRUE),
              paste0(what, "$precision"), "It is a standard error in nats.", call = call)
  check_input(checkmate::check_number(filled$ess_drop, lower = 0.01, upper = 0.999),
              paste0(what, "$ess_drop"), call = call)
  for (flag in c("gradient", "resample")) {
    check_input(checkmate::check_flag(filled[[flag]]), paste0(what, "$", flag), call = call)
  }
  check_sampler_size(filled, what, call)
  filled
}

#' @export
print.amiss_ais <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong Posterior} of {ncol(x$draws)} parameter{?s}: log evidence",
                      "{round(x$log_evidence, 2)} [{round(x$interval[1], 2)},",
                      "{round(x$interval[2], 2)}] ({x$estimator})"))
  cli::cli_bullets(c("*" = "{x$evaluations} likelihood values, {round(x$ess)} effective draws",
                     "*" = as_said(x$verdict), ">" = "next: {.code $draws} with {.code $weights}"))
})
