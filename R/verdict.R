# Each adopted mechanism judged by itself: named, likely, or a stand-in for something that the catalogue does not hold.

risen_error <- 1.02   # times the simulation's error in calibration before: from there it counts as risen
fallen_error <- 2 / 3  # times it: from there down it has fallen, whatever the evidence

# Fills `verdict`, `doubts`, `confounded_with` and `held_out_gain` of every model that adopted a mechanism, and `steps`
# (step_effect() of each record) of all. A mechanism is a stand-in where data held out do not gain by it, nor beside
# what was adopted later; it is named where nothing speaks against it, and likely otherwise.
judge_models <- function(models, candidates, catalogue, measurements, control, threads) {
  remains <- much_remains(models, measurements)
  inside <- models[[length(models)]]$scores$validate[["coverage95"]]
  models <- lapply(models, function(model) {
    model$steps <- lapply(record_fits(model$fit), step_effect, threads)
    model
  })
  for (k in seq_along(models)[-1]) {
    model <- models[[k]]
    parent <- models[[k - 1]]
    trials <- candidates[candidates$from == parent$name, ]
    row <- trials[trials$mechanism == model$mechanism, ]
    new <- setdiff(names(drawn_parameters(model$fit)), names(drawn_parameters(parent$fit)))
    gain <- held_out_gain(parent, model)
    no_gain <- isFALSE(gain$improves) && !isTRUE(model$gain_beside_later$improves)
    confounded <- confounded_parameters(model$fit, new)
    # What was adopted later is no other cause: with both, the evidence is decisively above that of either alone.
    later <- vapply(models[-seq_len(k)], `[[`, "", "mechanism")
    others <- 1 - row$probability - sum(trials$probability[trials$mechanism %in% later])
    doubts <- c(
      if (describes(catalogue[[model$mechanism]])) "it describes what is missing and does not explain it",
      if (others > 0.05) "other causes are possible",
      if (length(model$held_out_rivals)) paste("data held out speak for", listed(model$held_out_rivals)),
      if (!parent$fit$trust$trusted || !model$fit$trust$trusted) "the numbers behind it are not trusted",
      if (row$lower95 < control$decisive + few_runs_error && from_few_runs(model$fit))
        "the runs over the priors are too few for evidence of that size",
      step_doubt(parent, model, new, row$log10_bf, measurements),
      if (row$lower95 <= 0) "the fall of the error speaks for it, the evidence is not known",
      if (no_gain) "data held out do not gain by it",
      risen_words(parent, model),
      if (still_answers(parent, model, catalogue[[model$mechanism]]$boundary))
        "the error still answers to what drives it",
      only_beside(models[seq_len(k)], confounded, candidates),
      if (any(edge_of_prior(model$fit)[new])) "its value lies at the edge of what was thought possible",
      if (remains) "a good part of the error remains",
      if (isTRUE(inside < least_inside)) sprintf("its 95 %% band holds only %s of the data held out", percent(inside)),
      if (k == 2 && drift_rivals(models, control, threads)) drift_doubt(parent, model, threads))
    models[[k]]$held_out_gain <- gain
    for (name in names(model$records)) {
      models[[k]]$records[[name]]$held_out_gain <- held_out_gain(record_model(parent, name), record_model(model, name))
    }
    models[[k]]$confounded_with <- confounded
    models[[k]]$doubts <- doubts
    models[[k]]$verdict <- if (no_gain) "stand-in" else if (length(doubts)) "likely" else "named"
  }
  models
}

rival_probability <- 0.05  # of a mechanism not adopted, below which it is no rival and not worth a measurement
least_inside <- 0.8  # share of the data held out in the 95 % band of the last model, below which it is wrong there
few_runs_error <- 3  # decades by which evidence was off with too few runs

# Whether the runs that fill the space of a model's parameters are few_runs(), of one record at least.
from_few_runs <- function(fit) {
  few <- function(fit) few_runs(nrow(emulator_over_priors(fit$emulator)$unit), length(fit$emulator$parameters))
  any(vapply(record_fits(fit), few, NA))
}

# Where the simulation's error in calibration rose, in words: over all, or in some of several records.
risen_words <- function(parent, model) {
  rises <- function(parent, model) {
    model$scores$calibrate[["rmse"]] > risen_error * parent$scores$calibrate[["rmse"]]
  }
  if (rises(parent, model)) return("the error in calibration rose with it")
  where <- Filter(function(name) rises(parent$records[[name]], model$records[[name]]), names(model$records))
  if (length(where)) paste("the error in calibration rose with it in", listed(where))
}

# By how much the mean square of the error held out falls, and its standard error, from sums over days (or eighths of
# a short record): errors within a day hang together, those of several records too. Of several the error is in units of
# each one's noise.
held_out_gain <- function(parent, model) {
  before <- parent$prediction[parent$prediction$use == "validate", ]
  after <- model$prediction[model$prediction$use == "validate", ]
  if (!nrow(before)) return(list(mean = NA_real_, standard_error = NA_real_, improves = NA))
  fall <- (before$observed - before$mean)^2 - (after$observed - after$mean)^2
  n <- length(fall)
  predicted <- Filter(function(fit) "validate" %in% predictable(fit), record_fits(model$fit))
  hours <- lapply(predicted, function(fit) fit$measurements$hours[used_rows(fit$measurements, "validate")])
  block <- floor((unlist(hours) - min(unlist(hours))) / 24)
  if (length(unique(block)) < 8) block <- unlist(lapply(lengths(hours), function(n) floor(8 * (seq_len(n) - 1) / n)))
  sums <- rowsum(fall, block)
  error <- sqrt(nrow(sums)) * stats::sd(sums) / n
  list(mean = mean(fall), standard_error = error, improves = mean(fall) > error)
}

# The condition that drives a mechanism answered before and does so still, with more than half of its evidence.
still_answers <- function(parent, model, boundary) {
  strength <- function(m) {
    table <- m$attribution$table
    driven <- table$boundary %in% boundary & table$significant
    if (any(driven)) max(table$log10_bf_dropped[driven]) else 0
  }
  before <- strength(parent)
  before > 0 && strength(model) > 0.5 * before
}

# Parameters of the model that are correlated beyond 0.4 with those that the mechanism brought: another part of the
# model that could do the same.
confounded_parameters <- function(fit, new) {
  others <- setdiff(colnames(fit$values), new)
  if (!length(new) || !length(others)) return(character())
  r <- stats::cov.wt(posterior_unit(fit), fit$weights, cor = TRUE)$cor
  dimnames(r) <- list(colnames(fit$values), colnames(fit$values))
  others[apply(abs(r[others, new, drop = FALSE]), 1, max) > 0.4]
}

# In words, where the last of `models` has no evidence on the base model and trades off against what was adopted before
# it: two that imitate a third together look like this.
only_beside <- function(models, confounded, candidates) {
  mechanism <- models[[length(models)]]$mechanism
  alone <- candidates$log10_bf[candidates$from == models[[1]]$name & candidates$mechanism == mechanism]
  before <- models[-c(1, length(models))]
  if (!length(before) || !isTRUE(alone < 0)) return(NULL)
  known <- names(drawn_parameters(models[[1]]$fit))
  brought <- lapply(models[-length(models)], function(m) setdiff(names(drawn_parameters(m$fit)), known))
  beside <- before[mapply(function(now, then) any(setdiff(now, then) %in% confounded), brought[-1],
                          brought[-length(brought)])]
  if (length(beside))
    sprintf("it has evidence only beside %s, with which it trades off", listed(vapply(beside, `[[`, "", "mechanism")))
}

# TRUE where the last model's error is still large and of what exceeded the noise more than a tenth is left. The
# mechanism that made the error leaves nothing; one that imitates it does.
much_remains <- function(models, measurements) {
  ends <- lapply(models[c(1, length(models))], remaining_error, measurements)
  excess <- vapply(ends, function(e) e$ratio^2 - 1, 0)
  ends[[2]]$large && excess[2] > 0.1 * excess[1]
}
