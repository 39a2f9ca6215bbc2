# Calibrations of several records that share parameters, as one.

# A parameter that records share has one prior.
check_one_prior <- function(each, call = rlang::caller_env()) {
  all <- do.call(c, unname(each))
  for (name in unique(names(all)[duplicated(names(all))])) {
    priors <- vapply(all[names(all) == name], function(p) format(p$prior), "")
    if (length(unique(priors)) > 1) {
      abort_input(
        c("The parameter {.val {name}} has different priors: {.val {unique(unname(priors))}}.",
          i = "Parameters of one name are one parameter: give it one prior, or two names."),
        call = call)
    }
  }
}

# The parameters of records that share those of the same name.
joint_parameters <- function(fits) {
  all <- do.call(c, lapply(unname(fits), function(fit) fit$emulator$parameters))
  all[!duplicated(names(all))]
}

# `fits`: calibrations with the same draws.
new_joint <- function(fits) {
  parameters <- joint_parameters(fits)
  values <- do.call(cbind, unname(lapply(fits, `[[`, "values")))[, names(parameters), drop = FALSE]
  first <- fits[[1]]
  untrusted <- Filter(function(name) !fits[[name]]$trust$trusted, names(fits))
  why <- if (!length(untrusted)) first$trust$why
         else unlist(lapply(untrusted, function(name) paste0(name, ": ", fits[[name]]$trust$why)))
  posterior <- first$posterior[setdiff(names(first$posterior), c("setting", "variance", "t"))]
  units <- do.call(cbind, unname(lapply(fits, posterior_unit)))
  named <- unlist(lapply(fits, function(fit) names(fit$emulator$parameters)))
  posterior$unit <- unname(units[, match(names(parameters), named), drop = FALSE])
  structure(
    list(format_version = format_version, records = lapply(fits, as_part), parameters = parameters,
         values = values, weights = first$weights, posterior = posterior,
         log_evidence = first$log_evidence, standard_error = first$standard_error,
         interval = first$interval, check = joint_check(fits),
         trust = new_trust(!length(untrusted), why), rounds = first$rounds,
         runs_made = first$runs_made, modes = first$modes, exchanges = first$exchanges,
         failing = first$failing, seed = first$seed),
    class = "amiss_joint")
}

# What the checks say of all records: passed where each has, with the largest error in units of the
# noise.
joint_check <- function(fits) {
  checks <- Filter(Negate(is.null), lapply(fits, `[[`, "check"))
  if (!length(checks)) return(NULL)
  list(ratio = max(vapply(checks, `[[`, 0, "ratio")), effective = checks[[1]]$effective,
       border = max(vapply(checks, `[[`, 0, "border")),
       passed = all(vapply(checks, `[[`, NA, "passed")),
       verdict = paste0(names(checks), ": ", vapply(checks, `[[`, "", "verdict"), collapse = "; "))
}

# Of one record its calibration, of several all of them together.
joined_fit <- function(fits) if (length(fits) == 1) fits[[1]] else new_joint(fits)

# What the simulation at its best leaves of all records, of several each in units of its noise.
left_by_simulation <- function(fit) {
  fits <- record_fits(fit)
  if (length(fits) == 1) return(left_at_best(fits[[1]]))
  unlist(lapply(unname(fits), function(one) left_at_best(one) / one$measurements$noise_sd))
}

# What the simulation leaves of the record at its best: at the run of least squares, if there is
# one.
left_at_best <- function(fit) {
  if (is.null(fit$best)) left_by_mean(fit) else fit$measurements$y[fit$rows] - fit$best$output
}

# What the calibrated simulation leaves, as the standard deviation of new errors: noise, model error
# and discrepancy as large as they were seen, the fitted parameters taken off the degrees of
# freedom.
error_sd <- function(fit) {
  r <- left_at_best(fit)
  sqrt(sum(r^2) / max(1, length(r) - length(fit$emulator$parameters)))
}

# What the calibrated simulation leaves of the record.
error_sentence <- function(fit) {
  error <- error_sd(fit)
  sprintf("The calibrated model's typical error is %s, %s times the stated noise.",
          with_unit(short(error), fit$measurements$unit),
          short(error / fit$measurements$noise_sd))
}
