comparison_methods <- c("paper", "history")

comparison_control <- list(emulator = list(), calibration = list(), attribution = list())

#' Compare models by their evidence and by the criteria of practice
#'
#' @description
#' Simulates every model, trains its emulator and calibrates it on the same record, all with one
#' seed. The result has
#'
#' * the evidence with its interval, and Bayes factors in the words of the paper's table 1,
#' * posterior probabilities (equal ones beforehand),
#' * the conditions to which each model's discrepancy responds, and
#' * the parameters of each model.
#'
#' Criteria by which models are chosen in practice are listed as well, so that one sees where they
#' mislead.
#'
#' # Criteria
#'
#' The root mean squared error is that of the simulation averaged over the posterior, in calibration
#' and on held-out rows.
#'
#' Likelihood, AIC, BIC and likelihood ratio are those of the parameters at which the simulator
#' itself (not its emulator) has the least squared error within the priors. They assume that errors
#' are independent and normal with one unknown variance. k counts the parameters and that variance,
#' as `AIC()` of an [lm()] does.
#'
#' The likelihood ratio compares a model with the last earlier model that is nested in it. A model
#' is nested if all its parameters are in the larger model with the same priors. Names alone do not
#' show whether the smaller model is a special case of the larger within the priors. If an added
#' parameter ends at the edge of its range, the chi-square distribution of the statistic does not
#' hold. `lr_note` then says so.
#'
#' None of these criteria knows that a simulation has a discrepancy. They take independent errors
#' for granted. `autocorrelation` (of the least-squares errors at one step) shows how far that is
#' wrong.
#'
#' @param models A named list of simulators. Runs made elsewhere ([ensemble()]) are not compared
#'   here: calibrate each and use [bayes_factor()].
#' @param measurements The [measurements()].
#' @param method `"paper"`: [calibrate_paper()] with its variance index; `"history"`: [calibrate()]
#'   and [attribute_discrepancy()].
#' @param runs Runs of the design of each model for `"paper"`, which is neither checked by runs nor
#'   refined. `"history"` does not use them: it makes runs for searches, regions and checks
#'   ([calibrate_refined()]). Predictions and the least-squares search take more runs.
#' @param control List of lists: `emulator`, `calibration` and `attribution` (only for `"history"`),
#'   as the stages take them.
#' @param truth For a synthetic record, a list of the `simulator` and the named `values` that made
#'   it. They are marked in tables and figures. `NULL` if the truth is not known.
#' @inheritParams upgrade_model
#' @return An object of class `amiss_comparison` with `models`, and the tables that `tidy()` gives
#'   (see *Tables*). Each of the `models` has
#'   * `fit`, `attribution`, `prediction`, `scores`: the calibration and what follows from it.
#'   * `best`: the least-squares parameters.
#'   * `heat_loss`: 200 draws of the heat loss coefficient in W/K, if the model is a [zone()]. Each
#'     driver is at its mean over the calibration rows. Name the wind's direction as `circular(Wd)`
#'     in [measurements()]: otherwise degrees are averaged, and 350 and 10 give 180.
#'
#' @section Tables:
#'   * `"evidence"`: the evidence of each model, see below.
#'   * `"criteria"`: `k`, `rmse_calibration`, `rmse_validation`, `rmse_best`, `log_likelihood`,
#'     `aic`, `bic`, `nested`, `lr`, `lr_df`, `lr_p_value`, `lr_note`, `autocorrelation`,
#'     `converged` (the least-squares search).
#'   * `"ranking"`: the rank of each model by each criterion.
#'   * `"attribution"`: columns as in [attribute_discrepancy()], or as `index` in
#'     [calibrate_paper()], with the column `model`.
#'   * `"parameters"`: the posteriors of the parameters, with the column `model`.
#'
#'   The columns of `"evidence"` are
#'   * `log10_evidence`, `lower95`, `upper95`, `trusted`.
#'   * `log10_bf`, `bf_lower95`, `bf_upper95`, `word`: the Bayes factor against the model named in
#'     `against`. The best model is compared with the second, every other with the one ranked above
#'     it.
#'   * `log10_bf_first`: the factor against the first model of the list.
#'   * `probability`: posterior probability.
#'   * `rank`.
#' @source Monari (2022), table 1 for the words. The likelihood criteria are those of [logLik()],
#'   [AIC()] and [BIC()].
#' @examples
#' data <- data.frame(hour = 1:60, Te = 5 + 3 * sin(1:60 / 4), Gv = cos(1:60 / 3)^2)
#' data$Ti <- 20 + 0.4 * data$Te + 0.5 * data$Gv + 0.1 * sin(61 * (1:60)^2)
#' house <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1)
#' gain <- free("gain", uniform(0, 1))
#' blind <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                             gain, boundary = "Te")
#' sunny <- function_simulator(function(values, drivers) {
#'   20 + values[["gain"]] * drivers[, "Te"] + values[["sun"]] * drivers[, "Gv"]
#' }, gain, free("sun", uniform(0, 1)), boundary = c("Te", "Gv"))
#' compare_models(list(blind = blind, sunny = sunny), house, runs = 12, seed = 1, quiet = TRUE,
#'                control = list(calibration = list(ais = list(pilot_chains = 48, groups = 4))))
#' @seealso [heat_loss_coefficient()], [report()], [figures]
#' @export
compare_models <- function(models, measurements, method = c("paper", "history"), runs = 150,
                           control = NULL, seed = NULL, threads = 1,
                           quiet = FALSE, checkpoint = NULL, truth = NULL) {
  check_arguments()
  check_models(models)
  check_object(measurements, "amiss_measurements", "measurements")
  method <- if (missing(method)) comparison_methods[1] else method
  check_input(checkmate::check_choice(method, comparison_methods), "method")
  check_truth(truth)
  control <- fill_comparison_control(control, measurements, method)
  check_runs_asked(runs, measurements)
  for (model in models) check_enough_runs(runs, length(free_parameters(model)))
  seed <- kept_seed(seed, checkpoint)
  threads <- check_threads(threads)
  settings <- list(calibrate = switch(method, paper = calibrate_paper, history = calibrate),
                   measurements = measurements, runs = runs,
                   control = control, seed = seed, threads = threads)
  say <- progress(quiet)
  settings$keep <- checkpoint_keeper(checkpoint,
                                     c(settings[c("measurements", "runs", "control", "seed")],
                                       method = method))
  turn <- turns("model", length(models))
  compared <- sapply(names(models), function(name) {
    say("Calibrating {.strong {name}}")
    model <- staged(turn(name), compared_model(models[[name]], name, settings))
    say(paste("{.strong {name}}: log10 evidence {round(model$fit$log_evidence / log(10), 1)}, RMSE",
              "{signif(model$scores$calibrate[['rmse']], 3)} in calibration"))
    model
  }, simplify = FALSE)
  tables <- list(evidence = evidence_table(compared), criteria = criteria_table(compared))
  tables$ranking <- ranking_table(tables)
  tables$attribution <- bind_models(compared, function(model) model$attribution)
  tables$parameters <- bind_models(compared, function(model) parameter_rows(model$fit))
  structure(list(format_version = format_version, method = method, models = compared,
                 tables = tables, measurements = measurements,
                 truth = truth, seed = seed, control = control), class = "amiss_comparison")
}

fill_comparison_control <- function(control, measurements, method, call = rlang::caller_env()) {
  control <- merge_control(comparison_control, control, call = call)
  if (method == "paper" && length(control$attribution)) {
    abort_input(c("{.arg control$attribution} belongs to {.code method = \"history\"}.",
                  i = "The paper's index comes with its calibration: leave it out."),
                call = call)
  }
  check_stage_controls(control, measurements, method, call)
  control
}

compared_model <- function(simulator, name, settings) {
  fit <- rlang::try_fetch(compared_fit(simulator, settings), amiss_error = function(e) {
    rlang::abort(paste0("Model \"", name, "\" could not be calibrated."), parent = e,
                 class = setdiff(class(e), c("rlang_error", "error", "condition")), call = NULL)
  })
  warn_coarse_basis(fit$emulator, "control$emulator$max_vectors", name)
  settings$keep(list("compared", name, plain(simulator)), {
    attribution <- condition_table(fit, settings)
    prediction <- stats::predict(fit, seed = settings$seed, threads = settings$threads)
    list(name = name, fit = fit, attribution = attribution, prediction = prediction,
         scores = prediction_scores(prediction),
         best = staged("least squares", least_squares(fit, settings$threads)),
         heat_loss = posterior_heat_loss(fit))
  })
}

# By the paper's method from runs over the priors, the same for all models; by the package's own
# from a search.
compared_fit <- function(simulator, settings) settings$keep(list("fit", plain(simulator)), {
  m <- settings$measurements
  if (identical(settings$calibrate, calibrate)) {
    context <- new_context(settings$seed, settings$threads, settings$control)
    calibrate_model(new_model(list(simulator), list(loop_record(m, settings$control$calibration))),
                    context)$fit
  } else without_basis_warnings({
    runs <- simulate_design(simulator, m, settings$runs, seed = settings$seed,
                            threads = settings$threads)
    emulator <- train_emulator(runs, m, settings$control$emulator, threads = settings$threads)
    settings$calibrate(emulator, m, settings$control$calibration, seed = settings$seed,
                       threads = settings$threads)
  })
})

# The heat loss coefficient at equally weighted posterior draws, in the mean wind of the calibration
# rows.
posterior_heat_loss <- function(fit, draws = 200) {
  simulator <- fit$emulator$simulator
  if (!inherits(simulator, "amiss_zone")) return(NULL)
  picked <- systematic_draws(fit$weights, draws)
  heat_loss_coefficient(simulator, fit$values[picked, , drop = FALSE],
                        mean_drivers(simulator, fit$measurements))
}

# Means over the calibration rows; of what the boundary conditions call circular, the mean
# direction.
mean_drivers <- function(simulator, measurements) {
  raw <- measurements$raw
  rows <- raw$use == "calibrate"
  needed <- driver_names(simulator)
  turning <- condition_label(measurements,
                             measurements$conditions[tabulate(measurements$condition) == 2])
  vapply(needed, function(name) {
    x <- raw$drivers[rows, name]
    if (!condition_label(measurements, name) %in% turning) return(mean(x))
    (atan2(mean(sin(x * pi / 180)), mean(cos(x * pi / 180))) * 180 / pi) %% 360
  }, 0)
}

evidence_table <- function(models) {
  ten <- log(10)
  value <- vapply(models, function(m) m$fit$log_evidence, 0)
  interval <- vapply(models, function(m) m$fit$interval, c(0, 0))
  order <- order(-value)
  against <- function(i, j) bayes_factor(models[[i]]$fit, models[[j]]$fit)
  # The best is held against the second, every other against the one above it.
  rival <- integer(length(models))
  rival[order] <- if (length(models) > 1) c(order[2], order[-length(order)]) else NA
  factors <- do.call(rbind, lapply(seq_along(models), function(i) {
    if (is.na(rival[i])) data.frame(log10_bf = NA_real_, lower95 = NA_real_, upper95 = NA_real_,
                                    word = NA_character_) else against(i, rival[i])
  }))
  data.frame(model = names(models), log10_evidence = value / ten, lower95 = interval[1, ] / ten,
             upper95 = interval[2, ] / ten,
             trusted = vapply(models, function(m) m$fit$trust$trusted, NA),
             against = names(models)[rival], log10_bf = factors$log10_bf,
             bf_lower95 = factors$lower95, bf_upper95 = factors$upper95, word = factors$word,
             log10_bf_first = (value - value[1]) / ten,
             probability = exp(value - max(value)) / sum(exp(value - max(value))),
             rank = rank(-value), row.names = NULL)
}

criteria_table <- function(models) {
  criteria <- do.call(rbind, lapply(models, function(m) likelihood_criteria(m$best)))
  ratios <- do.call(rbind,
                    lapply(seq_along(models), function(i) likelihood_ratio(models, criteria, i)))
  correlation <- vapply(
    models,
    function(m) lag_correlation(m$best$error, segment_starts(m$fit$measurements, m$fit$rows)), 0)
  score <- function(use) vapply(models, function(m) m$scores[[use]][["rmse"]], 0)
  data.frame(model = names(models), rmse_calibration = score("calibrate"),
             rmse_validation = score("validate"), criteria, ratios,
             autocorrelation = correlation,
             converged = vapply(models, function(m) m$best$converged, NA), row.names = NULL)
}

criterion_names <- c(evidence = "evidence", rmse_calibration = "RMSE in calibration",
                     rmse_validation = "RMSE held out", log_likelihood = "likelihood", aic = "AIC",
                     bic = "BIC")

# Ranks by each criterion, 1 the best.
ranking_table <- function(tables) {
  criteria <- tables$criteria
  ranks <- data.frame(model = criteria$model, evidence = tables$evidence$rank,
                      rmse_calibration = rank(criteria$rmse_calibration),
                      rmse_validation = rank(criteria$rmse_validation, na.last = "keep"),
                      log_likelihood = rank(-criteria$log_likelihood),
                      aic = rank(criteria$aic), bic = rank(criteria$bic))
  ranks[vapply(ranks, function(x) !all(is.na(x)), NA)]
}

bind_models <- function(models, table_of) {
  table <- do.call(rbind, lapply(models, function(m) cbind(model = m$name, table_of(m))))
  rownames(table) <- NULL
  table
}

# Criteria that do not put the model of highest evidence first, and the model that they do.
disagreements <- function(comparison) {
  ranks <- comparison$tables$ranking
  others <- setdiff(names(ranks), c("model", "evidence"))
  first <- vapply(others, function(criterion) ranks$model[which.min(ranks[[criterion]])], "")
  first[first != best_model(comparison)]
}

best_model <- function(comparison) with(comparison$tables$evidence, model[which.min(rank)])

# For each criterion, the share of pairs of models that it puts in another order than the evidence
# does.
pairs_otherwise <- function(comparison) {
  ranks <- comparison$tables$ranking
  if (nrow(ranks) < 2) return(numeric())
  pairs <- utils::combn(nrow(ranks), 2)
  order_of <- function(criterion)
    sign(ranks[[criterion]][pairs[1, ]] - ranks[[criterion]][pairs[2, ]])
  others <- setdiff(names(ranks), c("model", "evidence"))
  counts <- vapply(others,
                   function(criterion) sum(order_of(criterion) * order_of("evidence") < 0), 0)
  structure(counts[counts > 0], pairs = ncol(pairs))
}

# Where the likelihood ratio at 5 % prefers another model than the evidence does.
ratio_disagreements <- function(comparison) {
  table <- comparison$tables$criteria
  evidence <- stats::setNames(comparison$tables$evidence$log10_evidence,
                              comparison$tables$evidence$model)
  table$log10_bf <- evidence[table$model] - evidence[table$nested]
  table[!is.na(table$lr_p_value) & (table$lr_p_value < 0.05) != (table$log10_bf > 0), ]
}

disagreement_sentences <- function(comparison) {
  first <- disagreements(comparison)
  best <- best_model(comparison)
  told <- vapply(split(names(first), first),
                 function(criteria) listed(unname(criterion_names[criteria])), "")
  ratios <- ratio_disagreements(comparison)
  pairs <- pairs_otherwise(comparison)
  c(if (length(first))
      sprintf("%s would choose %s; the evidence chooses %s.", told, names(told), best),
    if (length(pairs)) {
      sprintf("%s of %d pairs of models in another order than the evidence.",
              listed(sprintf("%s puts %d", criterion_names[names(pairs)], as.integer(pairs))),
              attr(pairs, "pairs"))
    },
    if (nrow(ratios)) {
      sprintf(paste("The likelihood ratio test %s %s to %s (p = %s); the log10 Bayes factor",
                    "between them is %s."),
              ifelse(ratios$lr_p_value < 0.05, "prefers", "does not prefer"), ratios$model,
              ratios$nested, format.pval(ratios$lr_p_value, 2, eps = 1e-4), signed(ratios$log10_bf))
    })
}

# What keeps a result from being trusted: the sampler, the basis, the emulator, priors too narrow,
# the search.
doubt_sentences <- function(comparison) {
  of_each <- unlist(lapply(comparison$models, function(model) {
    doubts <- model_doubts(model)
    if (length(doubts)) paste0(model$name, ": ", doubts)
  }), use.names = FALSE)
  edge <- comparison$tables$parameters[comparison$tables$parameters$at_edge, ]
  at_edge <- vapply(split(edge$label, factor(edge$model, unique(edge$model))), listed, "")
  c(of_each, if (nrow(edge)) {
    sprintf("At the edge of what was thought possible: %s. %s for something else.",
            paste0(names(at_edge), ": ", at_edge, collapse = "; "),
            if (nrow(edge) == 1) "Widen this prior, or suspect that the parameter makes up"
            else "Widen these priors, or suspect that the parameters make up")
  })
}

model_doubts <- function(model) {
  fit <- model$fit
  emulator <- fit$emulator
  noise <- fit$measurements$noise_sd
  beside <- function(size) sprintf("%s beside a noise of %s", short(size),
                                   with_unit(short(noise), fit$measurements$unit))
  c(if (!fit$trust$trusted) sprintf("the evidence is rough (%s).", fit$trust$verdict),
    if (emulator$basis$discarded_rms > 0.5 * noise) {
      sprintf("the basis is coarse; what it leaves out of the runs (%s) looks like discrepancy.",
              beside(emulator$basis$discarded_rms))
    },
    if (emulator$diagnostics$series_rmse > 0.5 * noise)
      sprintf("the emulator is rough (leave-one-out error %s).",
              beside(emulator$diagnostics$series_rmse)),
    if (!model$best$converged) paste("the search for the least squares did not settle; its",
                                     "likelihood is a lower bound, and with it AIC and BIC are",
                                     "upper ones."))
}

evidence_sentences <- function(comparison) {
  table <- comparison$tables$evidence
  best <- table[which.min(table$rank), ]
  if (nrow(table) < 2)
    return(sprintf("log10 evidence of %s: %s.", best$model,
                   with_limits(best$log10_evidence, best$lower95, best$upper95, "+")))
  sprintf(paste("The evidence for %s over the next best, %s, is %s: log10 Bayes factor %s; it",
                "holds %s of the probability."), best$model, best$against, best$word,
          with_limits(best$log10_bf, best$bf_lower95, best$bf_upper95, "+"),
          percent(best$probability))
}

#' @export
print.amiss_comparison <- function(x, ...) on_stdout(x, {
  x <- labelled(x)
  evidence <- x$tables$evidence
  criteria <- x$tables$criteria
  held_out <- !all(is.na(criteria$rmse_validation))
  interval <- paste0(with_limits(evidence$log10_evidence, evidence$lower95, evidence$upper95),
                     ifelse(evidence$trusted, "", " ?"))
  table <- data.frame(model = evidence$model, log10_L = interval,
                      P = sprintf("%.3f", evidence$probability),
                      RMSE = short(criteria$rmse_calibration, 3))
  if (held_out) table$held_out <- short(criteria$rmse_validation, 3)
  p_value <- ifelse(is.na(criteria$lr_p_value), "", format.pval(criteria$lr_p_value, 2, eps = 1e-4))
  table <- cbind(table, AIC = round(criteria$aic), BIC = round(criteria$bic), LR_p = p_value)
  cli::cli_text(paste("{.strong Comparison} of {nrow(table)} model{?s} on",
                      "{.val {x$measurements$name}} (method {x$method})"))
  shown <- utils::head(order(evidence$rank), 6)
  say_table(table[sort(shown), ])
  doubts <- length(doubt_sentences(x))
  told <- c(evidence_sentences(x), utils::head(disagreement_sentences(x), 1),
            if (doubts) paste0("Doubts: ", doubts, "; summary() lists them."))
  say_bullets(told)
  cli::cli_bullets(c(">" = "next: {.fun summary}, {.fun tidy}, {.fun plot} or {.fun report}"))
})

#' Tables of a comparison
#'
#' @param x A comparison ([compare_models()]).
#' @param what Which table: see [compare_models()].
#' @param ... Not used.
#' @return `tidy()`: a data frame; `glance()`: one row, about the model of highest evidence.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' steep <- function_simulator(function(values, drivers) 20 + values[["gain"]]^2 * drivers[, "Te"],
#'                             free("gain", uniform(0, 1)), boundary = "Te")
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)))
#' comparison <- compare_models(list(linear = linear, steep = steep), room, runs = 20,
#'                              control = quick, seed = 1, quiet = TRUE)
#' tidy(comparison)
#' tidy(comparison, "criteria")
#' @export
tidy.amiss_comparison <- function(x, what = "evidence", ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  check_input(checkmate::check_choice(what, names(x$tables)), "what")
  x$tables[[what]]
}

#' @rdname tidy.amiss_comparison
#' @export
glance.amiss_comparison <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  best <- x$tables$evidence[which.min(x$tables$evidence$rank), ]
  data.frame(best[c("model", "log10_evidence", "lower95", "upper95", "against", "log10_bf",
                    "word", "probability", "trusted")],
             models = length(x$models), n = length(x$models[[1]]$fit$rows),
             disagreements = length(disagreements(x)) + nrow(ratio_disagreements(x)),
             row.names = NULL)
}

check_models <- function(models, call = rlang::caller_env()) {
  check_input(checkmate::check_list(models, min.len = 1, names = "unique"), "models",
              paste("Give a named list of simulators, such as",
                    "{.code list(M1 = zone(...), M2 = zone(...))}."), call = call)
  for (name in names(models)) {
    rlang::try_fetch(check_simulator(models[[name]], call), amiss_error_input = function(e) {
      abort_input(
        c("Model {.val {name}} is no simulator but of class {.cls {class(models[[name]])}}.",
          i = "Make it with {.fun zone} or {.fun function_simulator}."), call = call)
    })
  }
}

# The truth of a synthetic record: the simulator that made it and its values.
check_truth <- function(truth, call = rlang::caller_env()) {
  if (is.null(truth)) return(invisible())
  check_input(checkmate::check_list(truth), "truth", call = call)
  check_input(checkmate::check_subset(c("simulator", "values"), names(truth)), "truth",
              "Give a list of a {.code simulator} and its {.code values}.", call = call)
  check_simulator(truth$simulator, call)
  check_input(checkmate::check_numeric(truth$values, finite = TRUE, any.missing = FALSE,
                                       names = "unique"), "truth$values", call = call)
  absent <- setdiff(names(free_parameters(truth$simulator)), names(truth$values))
  if (length(absent)) {
    abort_input(c("{.arg truth$values} has no value for {.val {absent}}.",
                  i = "Name a value for every free parameter of {.arg truth$simulator}."),
                call = call)
  }
}

# The true values of the parameters, where they are known, by name.
true_values <- function(comparison, names) {
  values <- comparison$truth$values[names]
  if (is.null(values)) rep(NA_real_, length(names)) else unname(values)
}

validates <- function(comparison) !all(is.na(comparison$tables$criteria$rmse_validation))

true_heat_loss <- function(comparison) {
  truth <- comparison$truth
  if (is.null(truth) || !inherits(truth$simulator, "amiss_zone")) return(NA_real_)
  heat_loss_coefficient(truth$simulator, truth$values,
                        mean_drivers(truth$simulator, comparison$measurements))
}
