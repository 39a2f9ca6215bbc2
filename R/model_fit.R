# One model taken down the line: its runs, its emulator, its calibration, coarse at first and then in full. Of several
# records it is a named list of simulators; ensembles, and the runs of their checks, are lists of the same names then.

# How runs are spent where a model is calibrated twice.
refining_control <- list(refine = 1 / 3, rounds = 8,
                         screening = list(pilot_chains = 128, groups = 4, max_groups = 16, max_sweeps = 12,
                                          precision = 0.5, gradient = FALSE, importance_draws = 0))

screening_runs <- 20  # that check a coarse calibration
least_rounds <- 3     # of refinement that are left to each calibration of a model, if so many were asked for

# The options of the stages, as these will take them.
check_stage_controls <- function(control, measurements, method = "history", call = rlang::caller_env()) {
  for (m in each_record(measurements)) check_controls_of(control, m, method, call)
}

check_controls_of <- function(control, measurements, method, call) {
  fill_emulator_control(control$emulator, "control$emulator", call)
  n <- length(used_rows(measurements, "calibrate"))
  if (method == "paper") return(fill_paper_control(control$calibration, n, "control$calibration", call))
  calibration <- fill_calibration_control(control$calibration, measurements, n, "control$calibration", call)
  fill_attribution_control(control$attribution, calibration$ais, length(measurements$conditions), "control$attribution",
                           call)
}

first_runs <- function(simulator, runs, settings) {
  if (is_given(simulator)) return(simulator)
  simulate <- if (is.object(simulator)) simulate_design else simulate_jointly
  simulate(simulator, settings_records(settings), runs, seed = settings$seed, threads = settings$threads)
}

# The record, or a named list of several.
settings_records <- function(settings) {
  if (is_several(settings$measurements)) settings$measurements$records else settings$measurements
}

# A model simulated, trained and calibrated by `settings$calibrate`; calibrate_paper() has no refinements. Every model
# of a study is drawn on the same design seed: differences between models are not the design's.
fit_model <- function(simulator, name, settings) {
  settings$keep(list("fit", name, plain(simulator)), {
    ensemble <- first_runs(simulator, settings$runs, settings)
    if (identical(settings$calibrate, calibrate)) {
      fit_runs(ensemble, settings)$fit
    } else without_basis_warnings({
      emulator <- train_emulator(ensemble, settings$measurements, settings$control$emulator,
                                 threads = settings$threads)
      settings$calibrate(emulator, settings$measurements, settings$control$calibration, seed = settings$seed,
                         threads = settings$threads)
    })
  })
}

# list(ensemble, fit, made): refine_records() as a study asks for it, of one record (or a list of one) each an object,
# of several a list and their joint calibration. What was spent on the model `before` counts; `first` is such a list. Of
# a coarse basis tells who asks for the model.
fit_runs <- function(ensemble, settings, calibration = settings$control$calibration, before = NULL, first = NULL,
                     hopeless = function(fit) FALSE, purpose = for_intervals) {
  ensembles <- in_list(ensemble)
  rounds <- settings$control$rounds %||% refining_control$rounds
  left <- min(rounds, max(least_rounds, rounds - (before$rounds %||% 0)))
  control <- list(emulator = as.list(settings$control$emulator), calibration = as.list(calibration))
  together <- function(fits) joined_fit(stats::setNames(fits, names(ensembles)))
  if (!is.null(first)) {
    first <- list(ensembles = unname(in_list(first$ensemble)), fits = unname(record_fits(first$fit)),
                  made = unname(made_of(first)))
  }
  found <- without_basis_warnings(refine_records(
    unname(ensembles), unname(each_record(settings$measurements)), left, control, settings$seed, settings$threads,
    runs = max(vapply(ensembles, function(e) regional_runs(e$parameters, refined_runs(settings)), 0)), first,
    function(fits) hopeless(together(fits)), purpose, settings$present))
  fits <- lapply(found$fits, function(fit) {
    for (spent in c("rounds", "runs_made")) fit[[spent]] <- fit[[spent]] + (before[[spent]] %||% 0L)
    fit
  })
  if (length(fits) == 1) return(list(ensemble = found$ensembles[[1]], fit = fits[[1]], made = found$made[[1]]))
  list(ensemble = stats::setNames(found$ensembles, names(ensembles)), fit = together(fits),
       made = stats::setNames(found$made, names(ensembles)))
}

# The runs of the checks of what fit_runs() found, by record.
made_of <- function(found) if (inherits(found$fit, "amiss_joint")) found$made else list(found$made)

# settled() of all records of what fit_runs() found.
all_settled <- function(found, purpose) all(mapply(settled, record_fits(found$fit), made_of(found), list(purpose)))

# The coarse calibration of a model, on the runs that fill its parameters' space; it keeps them. A few runs at posterior
# draws tell how far its evidence is off, correct it, and join them where it is too far. It is for the evidence: tails
# that lie at the end of the region, where parameters' intervals need more runs, it leaves to fit_fully().
screen_model <- function(simulator, name, settings, hopeless = function(fit) FALSE) {
  calibration <- as.list(settings$control$calibration)
  calibration$ais <- utils::modifyList(as.list(calibration$ais),
                                       as.list(settings$control$screening %||% refining_control$screening))
  if (is.null(calibration$check) || calibration$check > screening_runs)
    calibration$check <- calibration$exact <- screening_runs
  settings$keep(list("coarse", name, plain(simulator)), {
    fit_runs(first_runs(simulator, settings$runs - refined_runs(settings), settings), settings, calibration,
             hopeless = hopeless, purpose = for_evidence)
  })
}

refined_runs <- function(settings) round((settings$control$refine %||% refining_control$refine) * settings$runs)

# The full calibration: list(ensemble, fit, made). Where the coarse one did with runs spread over the priors, the
# remaining runs are made where its posterior lies. It keeps the coarse one's evidence, and is for the evidence too:
# settled_fit() asks for the tails.
fit_fully <- function(simulator, name, settings, first = NULL) {
  settings$keep(list("full", name, plain(simulator)), {
    more <- refined_runs(settings)
    if (more == 0 && is.null(settings$control$screening)) {
      full <- fit_runs(first_runs(simulator, settings$runs, settings), settings, purpose = for_evidence)
    } else {
      first <- first %||% screen_model(simulator, name, settings)
      full <- if (!can_be_run(in_list(first$ensemble))) {
        fit_runs(first$ensemble, settings, before = first$fit)
      } else if (!all_settled(first, for_evidence)) {
        fit_runs(first$ensemble, settings, before = first$fit, first = first, purpose = for_evidence)
      } else {
        fits <- record_fits(first$fit)
        ensembles <- Map(with_checked_runs, in_list(first$ensemble), fits, made_of(first))
        if (more > 0 && any(vapply(ensembles, function(e) is.null(e$region), NA)))
          ensembles <- Map(refine_ensemble, ensembles, fits, more, threads = settings$threads)
        fit_runs(ensembles, settings, before = first$fit, purpose = for_evidence)
      }
      full$fit$coarse <- first$fit[c("log_evidence", "standard_error")]
    }
    full
  })
}

# The fit that fit_fully() gave, refined where tails of the posterior lie at the end of the region: a model that is kept
# needs its parameters' intervals. What its rounds could not mend is left.
settled_fit <- function(full, name, settings) {
  if (isFALSE(full$fit$check$passed) || all_settled(full, for_intervals)) return(full$fit)
  settings$keep(list("settled", name, plain(model_of(full$fit))), {
    fit <- fit_runs(full$ensemble, settings, before = full$fit, first = full)$fit
    fit$coarse <- full$fit$coarse
    fit
  })
}

measured_model <- function(fit, name, parent, mechanism, settings,
                           stage = "measured") settings$keep(list(stage, name, plain(model_of(fit))), {
  attribution <- attribute_discrepancy(fit, settings$control$attribution, seed = settings$seed,
                                       threads = settings$threads)
  c(list(name = name, parent = parent, mechanism = mechanism, fit = fit, attribution = attribution),
    predicted_record(fit, settings))
})

# list(prediction, scores), of several records in units of each one's noise, with `records`, the same of each as it is.
predicted_record <- function(fit, settings) {
  each <- lapply(record_fits(fit), function(one) {
    prediction <- stats::predict(one, use = predictable(one), seed = settings$seed, threads = settings$threads)
    list(prediction = prediction, scores = prediction_scores(prediction))
  })
  if (!inherits(fit, "amiss_joint")) return(each[[1]])
  scaled <- c("observed", "mean", "lower95", "upper95", "crps")
  in_noise <- Map(function(name, one) {
    noise_sd <- fit$records[[name]]$measurements$noise_sd
    data.frame(record = name, one$prediction[c("use", "segment")], one$prediction[scaled] / noise_sd)
  }, names(each), each)
  together <- do.call(rbind, unname(in_noise))
  list(prediction = together, scores = prediction_scores(together), records = each)
}

# A model that stays needs its parameters' intervals: settled_fit() of its calibration in full, `full`, if that is
# there.
settled_model <- function(model, settings) {
  if (is.null(model$full)) return(model)
  fit <- settled_fit(model$full, model$name, settings)
  full <- model$full
  model$full <- NULL
  if (identical(fit, full$fit)) return(model)
  staged(model$name, measured_model(fit, model$name, model$parent, model$mechanism, settings, "settled, measured"))
}
