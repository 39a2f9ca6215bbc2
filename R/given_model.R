# Models of given runs in the loop: calibrated once, checked by runs left out.

is_verified <- function(model) model$level %in% c("verified", "given")

# The base model of a loop, from simulators or from given runs.
base_model <- function(started, runs, context) {
  simulators <- in_list(started$simulator)
  measurements <- each_record(started$measurements)
  if (is_given(started$simulator)) return(given_model(simulators, measurements, "base", context))
  records <- lapply(measurements, loop_record, context$control$calibration)
  model <- new_model(simulators, records)
  if (!is.null(runs)) model$scouts <- runs
  calibrate_model(model, sparing(context, rules$base_share, wanted_scouts(model)))
}

given_model <- function(ensembles, measurements, name, context, parent = NULL, mechanism = NULL) {
  sets <- Map(function(ensemble, m) {
    emulator <- without_basis_warnings(
      train_emulator(ensemble, m, context$control$emulator, threads = context$threads))
    calibration_setting(emulator, m, context$control$calibration, context$seed)
  }, unname(ensembles), unname(measurements))
  fits <- calibrate_sets(sets, context$threads)$fits
  fits <- lapply(fits, function(fit) {
    fit$rounds <- 0
    fit$runs_made <- runs_spent(context)
    fit
  })
  list(name = name, parent = parent, mechanism = mechanism, simulators = ensembles,
       records = measurements, parameters = joint_parameters(fits),
       fit = joined_fit(stats::setNames(fits, names(ensembles))), level = "given")
}

given_trial <- function(present, name, ensembles, context) {
  given_model(ensembles, present$records, paste(present$name, "+", name), context,
              present$name, name)
}
