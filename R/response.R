# What a mechanism could explain, before it has an emulator: a few runs of it at the posterior of the present model, its
# own parameters over their priors, show the responses that it adds. If the present model is taken as the line that
# touches it there, and the responses come in amounts that are free, the evidence is a matter of milliseconds
# (response_evidence_()).

response_ais <- list(pilot_chains = 64, groups = 2, max_groups = 2, max_sweeps = 6, precision = 1,
                     importance_draws = 300,
                     ess_drop = 0.3, gradient = FALSE)

response_scales <- c(1, 0.25, 0.0625)

# What the record says of responses (rows x k) beside the model of a calibration: a function of them that gives their
# log10 Bayes factor against none, its 95 % interval and the word. Amounts are N(0, 1) times the scale that suits the
# record best: a mechanism whose prior is wide may be needed in a small part of it alone.
responses_factor <- function(fit, threads, scales = response_scales) {
  data <- history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  ais <- fill_ais_control(utils::modifyList(fit$control$ais, response_ais))
  evidence <- function(responses) {
    call_engine(response_evidence_(data, fit$priors, fit$tangent, responses, ais, engine_context(fit$seed, threads)))
  }
  nothing <- evidence(matrix(0, length(fit$rows), 0))
  function(responses) {
    of <- lapply(scales, function(scale) evidence(scale * responses))
    factor_of(of[[which.max(vapply(of, `[[`, 0, "log_evidence"))]], nothing)
  }
}

# responses_factor() of the responses that trials show, a row for each, and the runs made. NA where its runs failed. Of
# several records each has amounts of its own, so that their factors multiply.
response_factors <- function(fit, trials, threads) {
  factors <- unname(lapply(record_fits(fit), trial_factor, threads))
  rows <- Map(function(trial, name) {
    each <- Map(function(factor, simulator) factor(simulator), factors, unname(in_list(trial)))
    if (all(vapply(each, `[[`, NA, "silent"))) warn_no_response(name)
    product_of_factors(lapply(each, `[[`, "row"))
  }, trials, names(trials))
  do.call(rbind, rows)
}

product_of_factors <- function(rows) {
  if (length(rows) == 1) return(rows[[1]])
  of <- function(column) vapply(rows, `[[`, 0, column)
  log10_bf <- sum(of("log10_bf"))
  half <- sqrt(sum((of("upper95") - of("log10_bf"))^2))
  word <- if (is.na(log10_bf)) NA_character_ else evidence_word(log10_bf - half, log10_bf + half)
  data.frame(log10_bf = log10_bf, lower95 = log10_bf - half, upper95 = log10_bf + half, word = word,
             runs = sum(of("runs")))
}

# A function of a trial of one record: list(row, silent), `silent` if it changes nothing.
trial_factor <- function(fit, threads) {
  emulator <- fit$emulator
  simulated <- function(simulator, values) {
    suppress_run_warnings(simulate_measured(simulator, values, fit$measurements, "calibrate", threads))
  }
  centre <- unit_to_values(stats::pnorm(matrix(posterior_centre(fit), 1)), emulator$parameters)
  present <- simulated(emulator$simulator, centre)[, 1]
  factor <- responses_factor(fit, threads)
  function(trial) {
    values <- response_design(trial, centre)
    responses <- simulated(trial, values) - present
    responses <- responses[, colSums(!is.finite(responses)) == 0, drop = FALSE]
    row <- if (ncol(responses)) factor(responses) else {
      data.frame(log10_bf = NA_real_, lower95 = NA_real_, upper95 = NA_real_, word = NA_character_)
    }
    list(row = cbind(row, runs = nrow(values)), silent = ncol(responses) > 0 && all(responses == 0))
  }
}

warn_no_response <- function(mechanism) {
  warn_input(c("Mechanism {.val {mechanism}} changes nothing: every run with it is that of the model without it.",
               i = paste("Does this record hold what it acts on, and does the simulator use its parameters? See",
                         "{.code vignette(\"mechanisms\")}, Inside a simulator.")))
}

# Values of the parameters for the runs that show a mechanism's responses: those of the model at `centre`, those that
# the mechanism brings spread over their priors.
response_design <- function(trial, centre) {
  parameters <- free_parameters(trial)
  new <- setdiff(names(parameters), colnames(centre))
  runs <- if (length(new)) 2 + 2 * length(new) else 1
  unit <- matrix(0.5, runs, length(parameters), dimnames = list(NULL, names(parameters)))
  for (name in new) unit[, name] <- (with_seed(match(name, new), sample(runs)) - 0.5) / runs
  values <- unit_to_values(unit, parameters)
  for (name in setdiff(names(parameters), new)) {
    prior <- parameters[[name]]$prior
    values[, name] <- min(max(centre[, name], prior$lower), prior$upper)
  }
  values
}
