# What trials are worth against the present model: Bayes factors, how far they may be off, and which may be adopted.

# The fit with the evidence of its coarse calibration, with which other coarse ones are compared.
as_coarse <- function(fit) {
  fit[names(fit$coarse)] <- fit$coarse
  fit
}

# Bayes factors against the fit `current`: of the candidates calibrated in full (`full`) beside its full calibration, of
# the others beside its coarse one.
standing <- function(fits, current, full) {
  rows <- lapply(names(fits), function(name) {
    bayes_factor(fits[[name]], if (name %in% full) current else as_coarse(current))
  })
  do.call(rbind, rows)
}

# The simulation's own error in calibration over that of the fit `current`.
error_ratio <- function(fit, current) sqrt(mean(left_by_simulation(fit)^2) / mean(left_by_simulation(current)^2))

raises_error <- function(table) !is.na(table$error_ratio) & table$error_ratio > risen_error

# Candidates not calibrated in full whose evidence could come near the best that may be adopted, if any could come near
# adoption.
contenders <- function(fits, current, full, control) {
  if (!length(fits)) return(character())
  bf <- standing(fits, current, full)
  reach <- bf$log10_bf + vapply(fits, uncertainty, 0, as_coarse(current), control)
  barred <- vapply(names(fits), function(name) name %in% full && error_ratio(fits[[name]], current) > risen_error, NA)
  setdiff(names(fits)[reach >= max(bf$log10_bf[!barred], control$decisive)], full)
}

# By how many decades the coarse evidence of a fit, beside that of a reference, may lie too low: three standard errors,
# the nats that annealing lies behind the second estimator (where chains lag, a mode may be missed), and the margin, of
# which a third is enough where runs of the simulator have confirmed the fit.
uncertainty <- function(fit, reference, control) {
  lag <- max(0, fit$posterior$second[[1]] - fit$posterior$annealed[[1]], na.rm = TRUE)
  margin <- if (isTRUE(fit$check$passed)) control$margin / 3 else control$margin
  (3 * sqrt(fit$standard_error^2 + reference$standard_error^2) + lag) / log(10) + margin
}

# Bayes factors of all mechanisms against the current model: in full, by the coarse calibration, or by the responses
# alone.
trial_table <- function(fits, current, from, full, responses = NULL) {
  rows <- lapply(names(fits), function(name) {
    row <- data.frame(from = from, mechanism = name, standing(fits[name], current, full),
                      error_ratio = error_ratio(fits[[name]], current), trusted = fits[[name]]$trust$trusted,
                      judged_by = if (name %in% full) "calibration" else "screening")
    if (!name %in% full) row <- as_far_as_emulated(row, fits[[name]]$check, stats::nobs(current))
    row$parameters <- list(added_parameters(fits[[name]], current))
    row
  })
  by_response <- responses[!rownames(responses) %in% names(fits), ]
  if (NROW(by_response)) {
    seen <- data.frame(from = from, mechanism = rownames(by_response),
                       by_response[names(by_response) != "runs"], error_ratio = NA_real_, trusted = FALSE,
                       judged_by = "response", row.names = NULL)
    seen$parameters <- rep(list(added_parameters(current, current)), nrow(seen))
    rows <- c(rows, list(seen))
  }
  table <- do.call(rbind, rows)
  table$screened <- table$judged_by != "calibration"
  # Equal prior probability for no change and for each mechanism; one whose runs all failed was not tried.
  log_odds <- c(0, table$log10_bf) * log(10)
  log_odds[is.na(log_odds)] <- -Inf
  probability <- exp(log_odds - max(log_odds)) / sum(exp(log_odds - max(log_odds)))
  table$probability <- probability[-1]
  table
}

# The Bayes factor of a coarse calibration.
coarse_factor <- function(fit, current) {
  as_far_as_emulated(bayes_factor(fit, as_coarse(current)), fit$check, stats::nobs(current))
}

# The interval of a candidate whose emulator runs refute holds the error e that they saw, in units of the noise: over N
# rows it takes N e^2 / 2 nats from the log-likelihood of what the emulator says, and moves it by sqrt(N) e at random.
as_far_as_emulated <- function(row, check, rows) {
  if (!isFALSE(check$passed)) return(row)
  error <- check$ratio
  row$upper95 <- row$upper95 + (0.5 * rows * error^2 + 1.96 * sqrt(rows) * error) / log(10)
  row$lower95 <- row$lower95 - 1.96 * sqrt(rows) * error / log(10)
  row$word <- evidence_word(row$lower95, row$upper95)
  row
}

# Estimates of the parameters that a mechanism brought with it.
added_parameters <- function(fit, parent) {
  table <- parameter_table(fit)
  table[!table$name %in% names(drawn_parameters(parent)), ]
}

too_rough <- 10  # decades between the ends of an interval from which odds say nothing

# The row of highest evidence among the mechanisms that may be adopted: they were calibrated (responses alone decide
# nothing), and the simulation's own error does not rise with them. No row if there is none.
best_trial <- function(table) {
  open <- table[table$judged_by != "response" & !raises_error(table), ]
  open[which.max(open$log10_bf), ]
}

# Whether the evidence is decisive or, where that of the present model is not known, as runs refute its emulator to the
# end, runs of the simulator are: the error falls by a third, with numbers that can be trusted.
may_be_adopted <- function(best, current, control) {
  if (!nrow(best) || best$log10_bf < control$decisive) return(FALSE)
  best$lower95 > 0 || (isFALSE(current$check$passed) && best$trusted && isTRUE(best$error_ratio < fallen_error))
}
