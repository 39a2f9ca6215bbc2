# What every calibration has, by whatever method it was made.

# A calibration by whatever method: what went into it (`set`: emulator, measurements, control, seed,
# rows, priors), what the sampler said of the parameters, the evidence in all (`total`), and what
# its method alone knows.
new_fit <- function(class, set, posterior, total, ...) {
  common <- c("emulator", "measurements", "control", "seed", "rows", "priors")
  structure(c(list(format_version = format_version), set[common],
              list(values = unit_to_values(posterior$unit, set$emulator$parameters),
                   weights = posterior$weights, posterior = posterior),
              total[c("log_evidence", "standard_error", "interval")], list(...)),
            class = c(class, "amiss_fit"))
}

# The record that a fit was made on; evidences of different ones cannot be compared.
calibrated_record <- function(fit) UseMethod("calibrated_record")

#' @export
calibrated_record.amiss_fit <- function(fit) fit$measurements$y[fit$rows]

# The calibrations of each record: of several that were calibrated together, each with the evidence
# of all, as calibrate_sets() gave them.
record_fits <- function(fit) {
  if (!inherits(fit, "amiss_joint")) return(list(fit))
  lapply(fit$records, function(one) {
    one[c("log_evidence", "standard_error", "interval")] <-
      fit[c("log_evidence", "standard_error", "interval")]
    one$part <- NULL
    one
  })
}

# A fit of one of several records that were calibrated together: the evidence is not its own.
as_part <- function(fit) {
  fit$log_evidence <- fit$standard_error <- NA_real_
  fit$interval <- c(NA_real_, NA_real_)
  fit$part <- TRUE
  fit
}

check_not_part <- function(fit, call = rlang::caller_env()) {
  if (!isTRUE(fit$part)) return(invisible())
  abort_input(
    c("This is one of several records that were calibrated together; by itself it has no evidence.",
      i = "Use the whole of {.fun calibrate_jointly}, or calibrate the record alone."), call = call)
}

# The function that made a fit, and its options if none are given.
calibrator <- function(fit) UseMethod("calibrator")
default_control <- function(fit) UseMethod("default_control")

# What a comparison shows of the conditions.
condition_table <- function(fit, settings) UseMethod("condition_table")

# Whether to believe numbers, and why: `why` is one reason or several.
new_trust <- function(trusted, why) {
  list(trusted = trusted, why = why,
       verdict = paste(if (trusted) "trusted:" else "not trusted:", paste(why, collapse = "; ")))
}

# What the sampler said: of the paper's calibration, which samples twice, of both.
sampler_said <- function(fit) if (knows_history(fit)) fit$posterior else fit$trust

# Whether the discrepancy responds to the history of the conditions: then it carries over to other
# rows.
knows_history <- function(fit) !is.null(fit$coefficients)

# Faults of the record that a calibration reads.
fit_findings <- function(fit, measurements = fit$measurements) {
  simulator <- fit$emulator$simulator
  findings_read(measurements, if (!is.null(simulator)) driver_names(simulator))
}

# Mean of the simulator's runs at posterior draws; by the emulator where there are none.
simulated_mean <- function(fit) {
  if (!is.null(fit$check$mean)) return(fit$check$mean)
  w <- emulated_coefficients(fit$emulator, posterior_unit(fit))$mean
  as.numeric(fit$emulator$basis$vectors %*% crossprod(w, fit$weights))
}

# What it leaves of the record.
left_by_mean <- function(fit) fit$measurements$y[fit$rows] - simulated_mean(fit)
