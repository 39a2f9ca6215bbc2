# A model of the loop as a value: what it simulates, the runs that are known of it, and what has
# been found out. One record is a list of one; parameters of the same name are one parameter. Points
# z are those of coordinates.R. Of each run there are outputs, those of all records below each
# other, and the sum of the squares of its errors over the noise.

# What the loop needs of a record, once.
loop_record <- function(measurements, control, call = rlang::caller_env()) {
  m <- measurements
  rows <- used_rows(m, "calibrate")
  check_target_varies(m, rows, call)
  control$reach <- control$reach %||% rules$reach
  control <- fill_calibration_control(control, m, length(rows), call = call)
  control$check <- control$exact <- 0
  used <- which(m$use %in% c("calibrate", "validate") & !is.na(m$y))
  list(measurements = m, rows = rows, held = used_rows(m, "validate"),
       calibrates = used %in% rows, control = control,
       priors = history_priors(m, control, length(rows), discarded_variance = 0),
       data = c(list(basis = matrix(0, length(rows), 0)), record_history(m, rows, control)))
}

new_model <- function(simulators, records, name = "base", parent = NULL, mechanism = NULL) {
  each <- lapply(unname(simulators), free_parameters)
  check_one_prior(each)
  parameters <- do.call(c, each)
  parameters <- parameters[!duplicated(names(parameters))]
  space <- coordinates_of(parameters)
  sizes <- vapply(records, function(record) length(record$rows), 0L)
  held <- vapply(records, function(record) length(record$held), 0L)
  blocks <- function(sizes)
    split(seq_len(sum(sizes)), factor(rep(seq_along(sizes), sizes), seq_along(sizes)))
  list(name = name, parent = parent, mechanism = mechanism, simulators = simulators,
       records = records, parameters = parameters, space = space,
       own = lapply(each, function(p) match(names(p), names(parameters))),
       rows = unname(blocks(sizes)), held_rows = unname(blocks(held)),
       target = unlist(lapply(records, function(record) record$data$y), use.names = FALSE),
       noise = rep(vapply(records, function(r) r$priors$noise_sd, 0), sizes),
       runs = list(z = matrix(0, 0, length(parameters), dimnames = list(NULL, names(parameters))),
                   outputs = new_columns(matrix(0, sum(sizes), 0)),
                   held = new_columns(matrix(0, sum(held), 0)), squares = numeric()),
       level = "none")
}

# Its runs at points (one a row), as far as the budget goes, a failed one NaN: list(model, at), the
# numbers of the runs.
with_runs <- function(model, z, context) {
  z <- pmin(pmax(z, rep(model$space$lower, each = nrow(z))), rep(model$space$upper, each = nrow(z)))
  left <- floor(max(0, runs_left(context)) / length(model$simulators))
  z <- z[seq_len(min(nrow(z), left)), , drop = FALSE]
  at <- nrow(model$runs$z) + seq_len(nrow(z))
  if (length(at)) model$runs <- bind_runs(model$runs, run_at(model, z, context))
  list(model = model, at = at)
}

bind_runs <- function(runs, more) {
  list(z = rbind(runs$z, more$z), outputs = bind_columns(runs$outputs, more$outputs),
       held = bind_columns(runs$held, more$held), squares = c(runs$squares, more$squares))
}

new_runs <- function(model, z, outputs, held) {
  list(z = z, outputs = new_columns(outputs), held = new_columns(held),
       squares = squared_errors(model, outputs))
}

squared_errors <- function(model, outputs)
  colSums(((outputs - model$target) / model$noise)^2)

# A record is run once at points that differ in nothing of its own. `kept_as`: under which name runs
# are kept.
run_at <- function(model, z, context, kept_as = "runs") {
  unit <- to_unit(z, model$space)
  each <- Map(function(simulator, record, own) {
    values <- unit_to_values(unit[, own, drop = FALSE], model$parameters[own])
    key <- apply(values, 1, rlang::hash)
    apart <- values[!duplicated(key), , drop = FALSE]
    made <- context$keep(list(kept_as, plain(simulator), apart), suppress_run_warnings(
      simulate_measured(simulator, apart, record$measurements, c("calibrate", "validate"),
                        context$threads)))
    made[, match(key, unique(key)), drop = FALSE]
  }, model$simulators, model$records, model$own)
  part <- function(calibrates) {
    do.call(rbind, unname(Map(function(made, record) {
      made[record$calibrates == calibrates, , drop = FALSE]
    }, each, model$records)))
  }
  colnames(z) <- names(model$parameters)
  outputs <- part(TRUE)
  outputs[abs(outputs / model$noise) > largest_over_noise] <- NaN
  new_runs(model, z, outputs, part(FALSE))
}

# An output so far beyond the noise is none: its square could not be computed with.
largest_over_noise <- 1e50

# What the simulators say of a run that failed, made again: their first warning, or NULL.
failure_words <- function(model, at) {
  for (k in seq_along(model$simulators)) {
    own <- model$own[[k]]
    unit <- to_unit(model$runs$z[at, own, drop = FALSE], model$space[own, ])
    values <- unit_to_values(unit, model$parameters[own])
    said <- tryCatch({
      simulate_measured(model$simulators[[k]], values, model$records[[k]]$measurements,
                        "calibrate", 1L)
      NULL
    }, amiss_warning_input = conditionMessage)
    if (!is.null(said)) return(said)
  }
}

succeeded <- function(model) is.finite(model$runs$squares)

# RMS of a difference of outputs in units of the noise of each record.
over_noise <- function(model, difference) sqrt(colMeans((cbind(difference) / model$noise)^2))

# ---- what others ask of it

last_model <- function(models) models[[length(models)]]

# The runs of a model are runs of its extension where the mechanism is switched off: at `off`, of
# the parameters that are new.
inherit_runs <- function(model, present, off) {
  runs <- present$runs
  old <- names(present$parameters)
  z <- matrix(0, nrow(runs$z), length(model$parameters),
              dimnames = list(NULL, names(model$parameters)))
  z[, old] <- runs$z
  z[, names(off)] <- rep(off, each = nrow(z))
  model$runs <- bind_runs(replace(runs, "z", list(z)), model$runs)
  model$over_priors <- present$over_priors
  model
}
