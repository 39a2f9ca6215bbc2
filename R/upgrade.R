upgrade_control <- list(max_steps = 3, decisive = rules$decisive, runs_total = NULL,
                        rounds = rules$verify_rounds, emulator = list(), calibration = list(),
                        attribution = list())

#' The loop: show, name the cause, extend, measure
#'
#' @description
#' Finds what a model lacks and extends it:
#'
#' 1. The model is calibrated and its discrepancy attributed.
#' 2. Every mechanism of the catalogue is tried as a real extension of the model.
#' 3. The mechanism with the highest evidence is adopted if its log10 Bayes factor is at least
#'   `decisive`. The loop begins again with the extended model.
#'
#' A mechanism that raises the simulation's own error in calibration by more than 2 % is not
#' adopted, whatever its evidence. Held-out rows do not decide what is adopted. They do take part in
#' the verdict: named, likely or a stand-in.
#'
#' # Runs
#'
#' The simulator is asked first. A few runs over the priors show where to begin. Searches lead to
#' the mode, with one run a step. About thirty runs in the region of the mode train an emulator.
#' Runs at draws of its posterior check the emulator ([calibrate_refined()]).
#'
#' A trial of a mechanism begins at the mode of the present model. It takes the runs of that model
#' for its own with the mechanism switched off. Four runs check the trial. Trials that can still win
#' are verified like the base model, the best first, until no other can reach the leader. Two steps
#' with eight mechanisms take about 400 runs.
#'
#' [decision_rules()] lists every number that decides.
#'
#' # Pairs
#'
#' If no mechanism suffices alone, though much of the error is left, pairs of mechanisms are tried.
#' One of a pair may take away what the other brings too much of. What the trials have seen tells
#' which pairs promise this. A pair must earn twice the log10 Bayes factor of a mechanism. It is
#' adopted as one, in one step, under both names (`"sun + leak"`). `catalogue` of the result then
#' holds it too.
#'
#' # Workers
#'
#' If [future::plan()] offers workers and there is no budget, the mechanisms of a step after the
#' first are tried side by side, with the same results. Functions and values that a simulator names
#' in the global environment go to the workers; what it writes there is lost. If simulators or
#' mechanisms hold a pointer, as those of compiled code may, they are tried one after the other.
#'
#' # Given runs
#'
#' The base model may be an [ensemble()] of runs that were made elsewhere, and mechanisms may be
#' others (see [mechanism()]). Then nothing is run. The emulators are checked by runs left out, and
#' held-out rows are predicted by emulators of the runs given there.
#'
#' # Several records
#'
#' Two or more series that share parameters ([calibrate_jointly()]) go through the same loop. Give
#' named lists of simulators and measurements. The `edit` of a mechanism is applied to the simulator
#' of each record in turn. If `edit` has two arguments, the second is the record's name
#' ([mechanism()]). Models are compared by the evidence of all records. Scores are in units of each
#' record's noise. Runs count for each record.
#'
#' @param simulator The base model: a simulator, or an [ensemble()] of given runs; for several
#'   records a named list.
#' @param measurements The [measurements()]; for several records a list with the same names.
#' @param catalogue A [catalogue()] of mechanisms.
#' @param runs Runs over the priors of the base model before the search; `NULL`: two, and two for
#'   each parameter. More are seldom needed. The budget of all runs is `control$runs_total`.
#' @param control List of options, with their defaults:
#'   * `max_steps`: most mechanisms adopted (3).
#'   * `decisive`: log10 Bayes factor that a mechanism must earn (2).
#'   * `runs_total`: budget of runs of the simulator (`NULL`: none). A verdict needs about 100.
#'   * `rounds`: checks of a model before it is left as not trusted (8).
#'   * `emulator`, `calibration`, `attribution`: lists of options for the stages. The loop itself
#'     sets `check` and `exact` of `calibration`.
#' @param quiet No progress messages.
#' @param checkpoint A folder in which all runs are kept (and the seed, if none is given). An
#'   interrupted loop that is called again with the same arguments goes on where it stopped. `NULL`
#'   keeps nothing. Delete the folder when the loop is done.
#' @inheritParams calibrate
#' @return An object of class `amiss_upgrade`:
#'   * `models`: the models adopted, first the base model (see *Models*).
#'   * `candidates`: all mechanisms tried, one a row (see *Candidates*).
#'   * `responses`: evidence for a response of the error to boundary conditions, in decades: without
#'     each trusted mechanism (`before`) and with it (`left`). Its conditions count together.
#'     The rows of `"no change"` have the evidence for each condition by itself.
#'   * `named_cause`: the cause that was named or, if there is none, the first that is likely:
#'     `mechanism`, `boundary`, `log10_bf` and `sentence`. `NULL` if there is none of either.
#'   * `gain`: the scores of the first and the last model, and `log10_bf` of the last against the
#'     first with its `interval`. Both models then have unknown responses to all their conditions,
#'     as `beside_unknown` of a mechanism.
#'   * `stopped_because`: why the loop stopped; `stopped_id` is the same in a word.
#'   * `runs_total`: the runs of the simulator that the loop took.
#'   * `runs_found`: those of them that a program's cache had, so that they were not made again.
#'   * `inert`: parameters of the base model that the last model no longer uses.
#'
#' @section Candidates: The columns of `candidates` are
#'   * `from`, `mechanism`: the model that the mechanism extends, and the mechanism.
#'   * `log10_bf`, `lower95`, `upper95`, `word`: the log10 Bayes factor if neither model has an
#'     unknown response to the conditions of the mechanism, its interval, and the same in words.
#'   * `standing`: the factor if neither model has an unknown response to any condition of the
#'     catalogue. The mechanism with the highest standing of those that are decisive is adopted.
#'   * `beside_unknown`: the factor with that response in both models. The response imitates the
#'     mechanism. If a trial is not trusted, `log10_bf` holds this factor as well.
#'   * `probability`: posterior probability.
#'   * `error_ratio`: the simulation's error in calibration, divided by that before.
#'   * `trusted`: whether the numbers can be believed.
#'   * `judged_by`: `"runs"` for mechanisms that were verified, `"trial"` for the others, `"none"`
#'     for those that could not be tried.
#'   * `runs`: the runs of the simulator that its trial took, without those that verified it.
#'   * `parameters`: the estimates of its parameters, with labels and units.
#'
#' @section Models: Each model that adopted a mechanism has a `verdict`:
#'   * `"named"`;
#'   * `"likely"`, if one of its `doubts` (sentences, each with a short name) speaks against it;
#'   * `"stand-in"`, if held-out data do not improve. `held_out_gain` is that gain, with its
#'     standard error.
#'
#'   Each model also has
#'   * `rivals`: mechanisms that the record does not distinguish from it. They and "no change" have
#'     together more than 5 % of the probability.
#'   * `confounded_with`: parameters that are correlated beyond 0.4 with those that the mechanism
#'     brought.
#'   * `steps`: what shorter steps of the simulator change, for each record (`NULL` if this is not
#'     known; see [function_simulator()]). Its `error` is the RMS, in the target's unit, of what the
#'     parameters cannot take up. Its `moved` says by how many of its standard deviations each
#'     parameter would move.
#'
#'   For several records `fit` is what [calibrate_jointly()] gives. `records` of a model then has
#'   `prediction`, `scores` and `held_out_gain` of each record in its own unit.
#' @source Monari (2022) for the loop. How a mechanism is judged is the package's own:
#'   `vignette("algorithm", "amiss")`, *Naming*.
#' @examples
#' \donttest{
#' table <- data.frame(hour = 1:120, Te = 5 + 3 * sin(1:120 / 4),
#'                     Gv = pmax(0, 100 * cos(1:120 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.02 * table$Gv + 0.1 * sin(61 * (1:120)^2)
#' house <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                       validate = table$hour > 90)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' brighter <- function(values, drivers, base) base(values) + values[["sun"]] * drivers[, "Gv"]
#' sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters that the model leaves out.",
#'                  edit = function(model) {
#'   with_parameters(model, free("sun", uniform(0, 0.1), "K m2/W"), boundary = "Gv", f = brighter)
#' })
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)),
#'               attribution = list(surrogates = 19))
#' upgrade <- upgrade_model(linear, house, catalogue(sun), control = quick, seed = 1, quiet = TRUE)
#' upgrade
#' tidy(upgrade, "candidates")
#'
#' # The same of runs that were made elsewhere, over all rows.
#' design <- cbind(gain = lhs::randomLHS(40, 1)[, 1], sun = 0.1 * lhs::randomLHS(40, 1)[, 1])
#' runs <- 20 + tcrossprod(table$Te, design[, "gain"])
#' sunny <- runs + tcrossprod(table$Gv, design[, "sun"])
#' parameters <- list(free("gain", uniform(0, 1)), free("sun", uniform(0, 0.1)))
#' given <- ensemble(design[, "gain", drop = FALSE], runs, parameters[1], measurements = house)
#' with_sun <- ensemble(design, sunny, parameters, measurements = house)
#' other <- mechanism("sun", with_sun, "Gv", "Sun enters.")
#' upgrade_model(given, house, catalogue(other), control = quick, seed = 1, quiet = TRUE)
#' }
#' @export
upgrade_model <- function(simulator, measurements, catalogue, runs = NULL, control = NULL,
                          seed = NULL, threads = 1, quiet = FALSE, checkpoint = NULL) {
  check_arguments()
  started <- upgrade_start(simulator, measurements)
  check_object(catalogue, "amiss_catalogue", "catalogue", "Make it with {.fun catalogue}.")
  check_given_models(started$simulator, catalogue, started$measurements)
  control <- fill_upgrade_control(control, started$measurements)
  check_scouts(runs, started)
  warn_absent_drivers(catalogue, started$measurements)
  check_edits(started, catalogue)
  seed <- kept_seed(seed, checkpoint)
  key <- list(measurements = started$measurements, control = control, seed = seed)
  context <- new_context(seed, check_threads(threads), control, checkpoint_keeper(checkpoint, key),
                         progress(quiet), control$runs_total,
                         length(each_record(started$measurements)))
  of_steps <- leaving(context, judging_points(context))
  state <- first_state(started, catalogue, runs, of_steps)
  while (is.null(state$stopped)) state <- next_step(state, of_steps)
  context$say("Stopped: {state$stopped$words}")
  finish_upgrade(state, context)
}

finish_upgrade <- function(state, context) {
  measurements <- state$started$measurements
  models <- judge_models(state$models, state$candidates, state$catalogue, measurements,
                         context$control, context$threads, function() runs_left(context))
  structure(list(format_version = format_version, models = models, candidates = state$candidates,
                 responses = state$responses, catalogue = state$catalogue,
                 named_cause = named_cause(models, state$candidates, state$catalogue),
                 gain = upgrade_gain(models), stopped_because = state$stopped$words,
                 stopped_id = state$stopped$id,
                 stopped_reason = state$stopped$reason %||% state$stopped$words,
                 inert = inert_parameters(state), runs_total = runs_spent(context),
                 runs_found = runs_found(context), measurements = measurements, seed = context$seed,
                 control = context$control), class = "amiss_upgrade")
}

# What of a budget is left to judge what was adopted: how it acts, and the steps of the simulator.
judging_points <- function(context) {
  floor(min(rules$judging_runs, rules$judging_share * context$budget) / context$records)
}

# Parameters of the base model that what was adopted has replaced or made idle.
inert_parameters <- function(state) {
  last <- state$present
  gone <- setdiff(state$base, names(last$parameters))
  c(gone, intersect(last$least$idle, state$base))
}

# list(simulator, measurements, record): of one record as they are, with its name; of several a list
# of simulators and their measurements together (new_records()).
upgrade_start <- function(simulator, measurements, call = rlang::caller_env()) {
  check_model <- function(x) if (!inherits(x, "amiss_ensemble")) check_simulator(x, call)
  if (!rlang::is_bare_list(simulator) && !rlang::is_bare_list(measurements)) {
    check_model(simulator)
    check_object(measurements, "amiss_measurements", "measurements", call = call)
    return(list(simulator = simulator, measurements = measurements, record = measurements$name))
  }
  for (name in c("simulator", "measurements")) {
    check_input(if (rlang::is_bare_list(get(name))) TRUE else "it is no list", name,
                paste("If there are several records, give named lists of both, one element for",
                      "each record."),
                call = call)
  }
  check_records(simulator, measurements, "simulator", check_model, least = 1, call = call)
  names <- names(simulator)
  if (length(names) == 1) {
    return(list(simulator = simulator[[1]], measurements = measurements[[1]], record = names))
  }
  given <- vapply(simulator, inherits, NA, "amiss_ensemble")
  if (any(given) && !all(given)) {
    abort_input(c(paste("Runs are given for {.val {names[given]}}, but simulators for",
                        "{.val {names[!given]}}."),
                  i = "Give simulators of all records, or an {.fun ensemble} of each."),
                call = call)
  }
  check_one_prior(lapply(simulator, free_parameters), call)
  list(simulator = simulator, measurements = new_records(measurements[names]), record = names)
}

# Ensembles among the models, base and mechanisms, stand at the rows of their record.
check_given_models <- function(simulator, catalogue, measurements, call = rlang::caller_env()) {
  edits <- Filter(function(edit) inherits(edit, "amiss_ensemble"), lapply(catalogue, `[[`, "edit"))
  if (!is_several(measurements)) {
    return(check_given(c(if (is_given(simulator)) list(base = simulator), edits),
                       measurements, call))
  }
  if (length(edits)) {
    abort_input(
      c("The mechanism {.val {names(edits)}} is one set of runs, and there are several records.",
        i = paste("Let its {.code edit} be a function of the model and the record's name that",
                  "returns the runs.")), call = call)
  }
  for (name in names(simulator)) check_given(simulator[name], measurements$records[[name]], call)
}

# A mechanism that cannot be applied is told before the base model has cost any run.
check_edits <- function(started, catalogue, call = rlang::caller_env()) {
  simulators <- if (is_several(started$measurements)) started$simulator else list(started$simulator)
  records <- each_record(started$measurements)
  for (entry in Filter(function(entry) is.function(entry$edit), catalogue)) {
    for (k in seq_along(simulators)) {
      extended <- extend(simulators[[k]], entry, record = started$record[k], call = call)
      if (is_given(extended)) next
      check_driver_columns(extended, records[[k]], call, entry$name)
    }
  }
}

fill_upgrade_control <- function(control, measurements, call = rlang::caller_env()) {
  control <- merge_control(upgrade_control, control, call = call)
  check_input(checkmate::check_count(control$max_steps), "control$max_steps", call = call)
  check_input(checkmate::check_number(control$decisive, lower = 0, finite = TRUE),
              "control$decisive", call = call)
  check_input(checkmate::check_count(control$rounds, positive = TRUE), "control$rounds",
              call = call)
  check_training_size(rules$more_runs * control$rounds, "control$rounds", control$rounds, call)
  check_input(checkmate::check_count(control$runs_total, positive = TRUE, null.ok = TRUE),
              "control$runs_total", call = call)
  check_stage_controls(control, measurements, call = call)
  control
}

# Runs over the priors that a person asks for.
check_scouts <- function(runs, started, call = rlang::caller_env()) {
  check_input(checkmate::check_count(runs, positive = TRUE, null.ok = TRUE), "runs", call = call)
  if (is.null(runs) || is_given(started$simulator)) return(invisible())
  for (m in each_record(started$measurements))
    check_run_number(runs, length(m$raw$hours), "runs", call)
}

# The first mechanism that is named or, if none is, likely; a stand-in is no cause, nor is a
# description.
named_cause <- function(models, candidates, catalogue) {
  adopted <- Filter(function(model) !describes(catalogue[[model$mechanism]]), models[-1])
  verdicts <- vapply(adopted, `[[`, "", "verdict")
  first <- which(verdicts == if (any(verdicts == "named")) "named" else "likely")
  if (!length(first)) return(NULL)
  model <- adopted[[first[1]]]
  trial <- candidates[candidates$from == model$parent & candidates$mechanism == model$mechanism, ]
  entry <- catalogue[[model$mechanism]]
  list(mechanism = model$mechanism, boundary = entry$boundary, log10_bf = trial$log10_bf,
       sentence = entry$sentence)
}

upgrade_gain <- function(models) {
  before <- models[[1]]
  after <- models[[length(models)]]
  bf <- bayes_factor(after$fit, before$fit)
  both <- function(use, score) c(before$scores[[use]][[score]], after$scores[[use]][[score]])
  list(log10_bf = bf$log10_bf, interval = c(bf$lower95, bf$upper95),
       rmse_calibration = both("calibrate", "rmse"), rmse_validation = both("validate", "rmse"),
       coverage95_validation = both("validate", "coverage95"),
       crps_calibration = both("calibrate", "crps"), crps_validation = both("validate", "crps"))
}

adopted_models <- function(upgrade) upgrade$models[-1]

# If runs of the simulator refute the emulator of the model from which all others start, evidence
# compares emulators, not simulators.
unjudged <- function(upgrade) isFALSE(upgrade$models[[1]]$fit$check$passed)

# Mechanisms not adopted whose last trial is not trusted and could still reach what adoption asks
# for. If nothing is left to explain, none.
open_trials <- function(upgrade) {
  if (is.null(upgrade$candidates)) return(NULL)
  adopted <- vapply(adopted_models(upgrade), `[[`, "", "mechanism")
  trials <- upgrade$candidates[!is.na(upgrade$candidates$log10_bf), ]
  needed <- vapply(trials$from, function(from) {
    max(upgrade$control$decisive,
        trials$log10_bf[trials$from == from & trials$mechanism %in% adopted])
  }, 0)
  last <- last_model(upgrade$models)
  explained <- !remaining_error(last, upgrade$measurements)$large &&
    !any(last$attribution$table$significant)
  open <- trials$judged_by == "trial" & !trials$trusted & trials$upper95 >= needed &
    !(explained & trials$from == last$name)
  trials[open & !trials$mechanism %in% adopted & !duplicated(trials$mechanism, fromLast = TRUE), ]
}
