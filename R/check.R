# The simulator has the last word: the emulator's error where the posterior lies, seen by runs of
# the simulator at draws of it or, for runs made elsewhere, by runs left out.

# list(fits, made): calibrations that have the same draws with their checks, and the runs of each
# (NULL where none were made).
checked_by_runs <- function(fits, threads) {
  if (all(vapply(fits, function(fit) fit$control$check, 0) == 0))
    return(list(fits = fits, made = vector("list", length(fits))))
  exact <- max(vapply(fits, function(fit) fit$control$exact %||% default_exact(fit), 0))
  drawn <- even_draws(fits[[1]], max(exact, vapply(fits, function(fit) fit$control$check, 0)))
  made <- lapply(
    fits, function(fit) if (!is.null(fit$emulator$simulator)) posterior_runs(fit, drawn, threads))
  checked <- Map(function(fit, runs) {
    fit$check <- if (is.null(runs)) check_by_left_out(fit) else emulation_check(fit, runs)
    fit
  }, fits, made)
  if (exact > 0 && !any(vapply(made, is.null, NA)))
    checked <- exact_evidence(checked, made, threads)
  list(fits = checked, made = made)
}

# The runs of the check serve the exact evidence.
default_exact <- function(fit) if (is.null(fit$emulator$simulator)) 0 else fit$control$check

# Runs of the simulator at draws spread evenly over the posterior (even_draws()): list(draws, times,
# runs, failed, first, lost), failed ones left out: how many they are, where the first was, and how
# often they were drawn. A draw of more weight than one of them is run once, and counts as often as
# it was drawn.
posterior_runs <- function(fit, drawn, threads) {
  draws <- unique(drawn)
  times <- tabulate(match(drawn, draws))
  runs <- staged("check", suppress_run_warnings(simulate_measured(
    fit$emulator$simulator, fit$values[draws, , drop = FALSE], fit$measurements, "calibrate",
    threads)))
  failed <- colSums(!is.finite(runs)) > 0
  list(draws = draws[!failed], times = times[!failed], runs = runs[, !failed, drop = FALSE],
       failed = sum(failed), first = if (any(failed)) point_words(fit$values[draws[failed][1], ]),
       lost = sum(times[failed]))
}

point_words <- function(values)
  paste(names(values), signif(values, 4), sep = " = ", collapse = ", ")

# The check itself reports failed runs.
suppress_run_warnings <- function(code)
  withCallingHandlers(code, amiss_warning_input = function(w) rlang::cnd_muffle(w))

emulation_check <- function(fit, made) {
  if (!length(made$draws)) return(failed_check(fit, made))
  emulator <- fit$emulator
  w <- emulated_coefficients(emulator, posterior_unit(fit)[made$draws, , drop = FALSE])
  error <- made$runs - tcrossprod(emulator$basis$vectors, w$mean)
  check <- new_check(fit, error, series_variance(emulator$basis, w$variance), made$failed,
                     "runs of the simulator at posterior draws",
                     mean = as.numeric(made$runs %*% made$times) / sum(made$times))
  n <- length(made$draws) + made$failed
  if (made$failed > largest_failed_share * n) {
    check$passed <- FALSE
    check$verdict <- sprintf("the simulator failed at %d of %d posterior draws, the first at %s",
                             made$failed, n, made$first)
  }
  check
}

# Of runs that all failed.
failed_check <- function(fit, made) {
  list(runs = 0L, failed = made$failed, error = NA_real_, noise = fit$measurements$noise_sd,
       ratio = NA_real_, z2 = NA_real_, effective = NA_real_, border = NA_real_, passed = FALSE,
       verdict = sprintf("the simulator failed at all of %d posterior draws, the first at %s",
                         made$failed, made$first), mean = NULL)
}

# Leave-one-out errors of the runs nearest to the posterior's centre, in the unit cube.
check_by_left_out <- function(fit) {
  loo <- fit$emulator$left_out
  if (is.null(loo)) return(NULL)
  inputs <- fit$emulator$unit
  centre <- colSums(fit$weights * posterior_unit(fit))
  near <- order(rowSums(sweep(inputs, 2, centre)^2))[seq_len(
    min(nrow(inputs), max(rules$left_out_runs, ceiling(rules$left_out_share * nrow(inputs)))))]
  error <- tcrossprod(fit$emulator$basis$vectors, loo$error[near, , drop = FALSE])
  error <- sqrt(error^2 + fit$emulator$basis$discarded_sd^2)
  new_check(fit, error, series_variance(fit$emulator$basis, loo$variance[near, , drop = FALSE]), 0,
            "left-out runs nearest to the posterior")
}

new_check <- function(fit, error, variance, failed, by, mean = NULL) {
  rms <- sqrt(mean(error^2))
  ratio <- error_over_noise(fit, error)
  noise <- if (ratio > 0) rms / ratio else fit$measurements$noise_sd
  border <- sum(fit$weights[in_border(fit$emulator$processes$region, posterior_unit(fit))])
  passed <- ratio <= rules$error_ratio && border <= rules$border
  told <- sprintf("by %d %s the emulator's error is %s the noise%s", ncol(error), by,
                  if (ratio > 1) paste(format(signif(ratio, 2)), "times")
                  else paste(format(signif(ratio, 2)), "of"),
                  if (failed) sprintf(" (%d more failed)", failed) else "")
  verdict <- if (ratio > rules$error_ratio)
               paste0(told, ", more than a third: it is not good enough")
             else if (!passed) sprintf(paste("%s, but the posterior reaches the end of the region",
                                             "where it holds (%.0f %%)"), told, 100 * border)
             else told
  list(runs = ncol(error), failed = failed, error = rms, noise = noise, ratio = ratio,
       z2 = mean(error^2 / variance), effective = NA_real_,
       border = border, passed = passed, verdict = verdict, mean = mean)
}

# RMS of errors (rows x n) in units of the measurement error as the likelihood weighs it,
# autocorrelated as it was seen: with its covariance V, the root of e' V^-1 e / N, by which a smooth
# error counts less where the measurement error is smooth. Where the error seen is larger than the
# noise stated (it then holds more than noise), in units of that.
error_over_noise <- function(fit, error) {
  posterior <- fit$posterior
  picked <- systematic_draws(fit$weights, rules$check_draws)
  data <- history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  data$y <- numeric(nrow(error))
  priors <- fit$priors
  priors$discarded_variance <- 0
  runs <- cbind(0, error)
  log_l <- vapply(picked, function(draw) {
    points <- list(setting = rep(posterior$setting[draw], ncol(runs)),
                   variance = rep(posterior$variance[draw], ncol(runs)),
                   t = matrix(0, ncol(runs), ncol(posterior$t)))
    call_engine(run_likelihood_(data, priors, points, runs, engine_context(fit$seed, 1)))
  }, numeric(ncol(runs)))
  squares <- 2 * sweep(-log_l[-1, , drop = FALSE], 2, log_l[1, ], "+")
  seen <- sqrt(sum(fit$weights * posterior$variance * (1 + error_share(fit))))
  sqrt(mean(squares) / nrow(error)) * max(1, seen / fit$measurements$noise_sd)
}

# Variance of the autocorrelated parts of the error over that of its white part, at each draw.
error_share <- function(fit) rowSums(error_ratios_of(fit, seq_along(fit$posterior$setting)))

# The same for each part (draws x parts).
error_ratios_of <- function(fit, draws) {
  ratios <- fit$control$error_ratios
  parts <- seq_along(fit$control$error_times)
  digit <- function(part)
    fit$posterior$setting[draws] %/% length(ratios)^(part - 1) %% length(ratios)
  matrix(vapply(parts, function(part) ratios[digit(part) + 1], numeric(length(draws))),
         length(draws))
}

# Log-likelihood of runs (one a column) of a record, each at its draw or, if there are several for
# each run, at those in turn; with the simulator itself nothing is discarded.
run_log_likelihood <- function(fit, draws, runs, threads) {
  points <- list(setting = fit$posterior$setting[draws],
                 variance = fit$posterior$variance[draws] - fit$priors$discarded_variance,
                 t = fit$posterior$t[draws, , drop = FALSE])
  data <- history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  call_engine(run_likelihood_(data, fit$priors, points, runs, engine_context(fit$seed, threads)))
}

# Z = Z_emulated E[L_run / L_emulated] over draws of the emulated posterior, the likelihoods those
# of all records; of a run that fails it is 0.
exact_evidence <- function(fits, made, threads) {
  drawn <- Reduce(intersect, lapply(made, `[[`, "draws"))
  if (!length(drawn)) return(fits)
  exact <- Reduce(`+`, Map(function(fit, m) {
    run_log_likelihood(fit, drawn, m$runs[, match(drawn, m$draws), drop = FALSE], threads)
  }, fits, made))
  times <- made[[1]]$times[match(drawn, made[[1]]$draws)]
  log_ratio <- rep(exact - fits[[1]]$posterior$log_likelihood[drawn], times)
  ratio <- exp(log_ratio - max(log_ratio))
  weights <- ratio / sum(ratio)
  n <- length(ratio)
  effective <- 1 / (n * sum(weights^2))
  gain <- max(log_ratio) + log(mean(ratio))
  share <- n / (n + max(vapply(made, `[[`, 0, "lost")))  # that did not fail
  # Where few draws carry the weight, their mean may miss what lies further up. By the spread of the
  # upper half it is that of lognormal ratios; how far the two are apart is part of the error.
  above <- pmax(log_ratio - stats::median(log_ratio), 0)
  # twice the mean square of one half, over two
  lognormal <- stats::median(log_ratio) + mean(above^2)
  error <- if (n > 1) sqrt(max(0, 1 / effective - 1) / (n - 1) + max(0, lognormal - gain)^2 +
                             (1 - share) / n)
           else Inf
  lapply(fits, corrected, effective = effective, gain = gain, share = share, error = error)
}

corrected <- function(fit, effective, gain, share, error) {
  fit$check$effective <- effective
  doubt <- if (!isTRUE(effective >= rules$effective))
             sprintf("few of these runs are as likely as it says (effective share %.2f)", effective)
           # what it takes for impossible may then be likeliest
           else if (!isTRUE(abs(gain) <= rules$mode_depth))
             sprintf("these runs are %.0f nats %s likely than it says", abs(gain),
                     if (gain < 0) "less" else "more")
  if (fit$check$passed && !is.null(doubt)) {
    fit$check$passed <- FALSE
    fit$check$verdict <- paste0(fit$check$verdict, ", but ", doubt)
  }
  correction <- gain + log(share)
  fit$check$correction <- correction
  fit$log_evidence <- fit$log_evidence + correction
  fit$standard_error <- sqrt(fit$standard_error^2 + error^2)
  fit$interval <- fit$interval + correction + c(-1.96, 1.96) * error
  fit
}
