# Each adopted mechanism judged by itself: named, likely, or a stand-in for something that the
# catalogue does not hold. What speaks against a mechanism is a doubt: an id, a test that gives its
# sentence or nothing, and the reason why it counts.

doubt <- function(says, reason) list(says = says, reason = reason)

# Tests of a case: the mechanism's model and its parent, its row and those of its rivals, and what
# judge_models() knows of all models.
doubts <- list(
  record = doubt(function(case) record_doubt_words(case$faults),
                 "a fault of the record looks like a cause"),
  describes = doubt(function(case) {
    if (describes(case$entry)) "it describes what is missing and does not explain it"
  }, "a response is no cause"),
  rivals = doubt(function(case) {
    if (length(case$rivals)) {
      sprintf("this record does not distinguish it from %s",
              listed(rival_words(case$rivals, case$rough), "or"))
    }
  }, "others may have more than 5 % of the probability"),
  open = doubt(function(case) {
    if (length(case$open))
      sprintf("%s %s as near to the record, by numbers that are not trusted", listed(case$open),
              if (length(case$open) > 1) "come" else "comes")
  }, "a number that is not trusted rules nothing out"),
  untried = doubt(function(case) {
    twins <- untried_twins(case$parent, case$entry, case$catalogue)
    told <- function(names) condition_label(case$measurements, names)
    if (length(twins)) {
      sprintf(paste("the error responds to %s as well, which this record cannot distinguish from",
                    "%s and for which no mechanism was given"),
              listed(told(twins)), listed(told(case$entry$boundary), "or"))
    }
  }, "a place or driver that nobody thought of is no less likely"),
  untrusted = doubt(function(case) {
    if (!case$parent$fit$trust$trusted || !case$model$fit$trust$trusted)
      "the numbers behind it are not trusted"
  }, "runs of the simulator refute an emulator, or searches do not agree"),
  steps = doubt(function(case) {
    step_doubt(case$parent, case$model, case$new, case$row$log10_bf, case$measurements)
  }, "coarse steps of a simulator look like a cause"),
  steps_open = doubt(function(case) {
    if (any(vapply(case$model$steps, is_open_effect, NA)))
      "the budget left no runs to see what shorter steps of the simulator change"
  }, "coarse steps of a simulator look like a cause"),
  no_gain = doubt(function(case) {
    if (case$no_gain) "held-out data do not improve"
  }, "what fits alone does not predict"),
  raises_error = doubt(function(case) risen_words(case$parent, case$model),
                       "what is gained, the discrepancy gains"),
  still_responds = doubt(function(case) {
    if (still_answers(case$parent, case$model, case$entry$boundary))
      "the error still responds to what drives it"
  }, "the true mechanism takes the response away"),
  only_beside = doubt(function(case) only_beside(case$models, case$confounded, case$candidates),
                      "two that imitate a third together look like this"),
  stands_on = doubt(function(case) unnamed_before(case$models),
                    "it may make up for what those before it do wrongly"),
  alone = doubt(function(case) {
    if (length(case$unsettled)) {
      sprintf(paste("%s, adopted after it, may be the cause by itself: no search shows that it",
                    "needs this one"), listed(case$unsettled))
    }
  }, "what is adopted later may make it needless"),
  edge = doubt(function(case) {
    edge <- edge_of_prior(case$model$fit)
    beside <- case$confounded[edge[case$confounded]]
    if (any(edge[case$new])) "its value lies at the edge of what was thought possible"
    else if (length(beside))
      sprintf("%s, with which it is correlated, lies at the edge of what was thought possible",
              listed(parameter_labels(case$model$fit, beside)))
  }, "it may make up for something else"),
  remains = doubt(function(case) {
    if (case$remains) "a good part of the error remains"
  }, "the mechanism that made the error leaves nothing"),
  coverage = doubt(function(case) {
    if (isTRUE(case$inside < rules$least_inside)) {
      sprintf("its 95 %% band holds only %s of the data held out", percent(case$inside))
    }
  }, "a band that misses a fifth of new data is wrong"),
  slow = doubt(function(case) {
    if (case$drift && case$slow) {
      "anything that changes slowly would explain the error as well"
    }
  }, "a parabola in time does as well, and so does the mechanism"),
  drift = doubt(function(case) {
    if (case$drift && !case$slow) {
      "a drifting sensor would explain the error as well"
    }
  }, "a parabola in time does as well"))

# Fills `verdict`, `doubts`, `confounded_with` and `held_out_gain` of every model that adopted a
# mechanism, and `steps` (step_effect() of each record) of all, and `suspects` of the first
# (record_suspects()). `left`: how many runs of the simulator may be made. A mechanism is a stand-in
# if held-out data do not improve; it is named if nothing speaks against it, and likely otherwise.
judge_models <- function(models, candidates, catalogue, measurements, control, threads,
                         left = function() Inf) {
  models <- lapply(models, function(model) {
    model$steps <- lapply(record_fits(model$fit), step_effect, threads, left)
    model
  })
  models[[1]]$suspects <- record_suspects(models, measurements, threads, left())
  shared <- list(candidates = candidates, measurements = measurements, left = left,
                 remains = much_remains(models, measurements),
                 faults = c(names(read_findings(models, measurements)), models[[1]]$suspects$id),
                 inside = last_model(models)$scores$validate[["coverage95"]])
  for (k in seq_along(models)[-1]) {
    case <- c(shared, mechanism_case(models, k, catalogue, candidates, control, threads, left))
    models[[k]] <- judged_model(case)
  }
  models
}

mechanism_case <- function(models, k, catalogue, candidates, control, threads, left) {
  model <- models[[k]]
  parent <- models[[k - 1]]
  trials <- candidates[candidates$from == parent$name, ]
  row <- trials[trials$mechanism == model$mechanism, ]
  new <- setdiff(names(drawn_parameters(model$fit)), names(drawn_parameters(parent$fit)))
  # What was adopted later is no other cause: with both, the evidence is decisively above that of
  # either alone, if that of its own trial is known.
  later <- vapply(models[-seq_len(k)], `[[`, "", "mechanism")
  gain <- held_out_gain(parent, model)
  drift <- k == 2 && drift_rivals(models, control, threads)
  list(model = model, parent = parent, models = models[seq_len(k)], row = row, new = new,
       entry = catalogue[[model$mechanism]], catalogue = catalogue, gain = gain,
       no_gain = isFALSE(gain$improves),
       rivals = rivals_of(trials, c(model$mechanism, later)),
       rough = if (row$trusted && parent$fit$trust$trusted) trials$mechanism[!trials$trusted]
               else c("no change", trials$mechanism),
       open = open_rivals(trials, row, c(model$mechanism, later)),
       unsettled = later[vapply(models[-seq_len(k)],
                                function(m) model$mechanism %in% m$may_replace, NA)],
       confounded = confounded_parameters(model$fit, new),
       drift = drift, slow = drift && acts_as_drift(parent$fit, model$fit, threads, left))
}

# What else the evidence of a step allows, with its probability: mechanisms that were not adopted
# and no change, the most probable ones until the others have together no more than 5 %.
rivals_of <- function(trials, adopted) {
  share <- stats::setNames(c(trials$probability, max(0, 1 - sum(trials$probability))),
                           c(trials$mechanism, "no change"))
  share <- sort(share[setdiff(names(share), adopted)], decreasing = TRUE)
  share[rev(cumsum(rev(share))) > rules$rival_probability]
}

# Mechanisms whose numbers are not trusted, and with which the simulation comes as near to the
# record as with the one adopted (`row`).
open_rivals <- function(trials, row, adopted) {
  near <- trials$error_ratio <= row$error_ratio / rules$fallen_error
  trials$mechanism[which(near & !trials$trusted & !trials$mechanism %in% adopted)]
}

# With their probabilities, but for those whose numbers are `rough`.
rival_words <- function(rivals, rough) {
  ifelse(names(rivals) %in% rough, names(rivals),
         paste0(names(rivals), " (", percent(unname(rivals)), ")"))
}

judged_model <- function(case) {
  model <- case$model
  model$rivals <- setdiff(names(case$rivals), "no change")
  model$held_out_gain <- case$gain
  for (name in names(model$records)) {
    model$records[[name]]$held_out_gain <- held_out_gain(record_model(case$parent, name),
                                                         record_model(model, name))
  }
  model$confounded_with <- case$confounded
  model$doubts <- unlist(lapply(doubts, function(doubt) doubt$says(case)))
  model$verdict <- if (case$no_gain) "stand-in" else if (length(model$doubts)) "likely" else "named"
  model
}

# Where the simulation's error in calibration rose, in words: over all, or in some of several
# records.
risen_words <- function(parent, model) {
  rises <- function(parent, model) {
    model$scores$calibrate[["rmse"]] > rules$risen_error * parent$scores$calibrate[["rmse"]]
  }
  if (rises(parent, model)) return("the error in calibration rose with it")
  where <- Filter(function(name) rises(parent$records[[name]], model$records[[name]]),
                  names(model$records))
  if (length(where)) paste("the error in calibration rose with it in", listed(where))
}

# By how much the mean square of the error held out falls, and its standard error, from sums over
# days (or equal blocks of a short record): errors within a day are correlated, those of several
# records too. Of several the error is in units of each one's noise.
held_out_gain <- function(parent, model) {
  before <- parent$prediction[parent$prediction$use == "validate", ]
  after <- model$prediction[model$prediction$use == "validate", ]
  if (!nrow(before)) return(list(mean = NA_real_, standard_error = NA_real_, improves = NA))
  fall <- (before$observed - before$mean)^2 - (after$observed - after$mean)^2
  n <- length(fall)
  predicted <- Filter(function(fit) "validate" %in% predictable(fit), record_fits(model$fit))
  hours <- lapply(predicted,
                  function(fit) fit$measurements$hours[used_rows(fit$measurements, "validate")])
  block <- floor((unlist(hours) - min(unlist(hours))) / rules$held_out_block)
  blocks <- rules$held_out_blocks
  if (length(unique(block)) < blocks)
    block <- unlist(lapply(lengths(hours), function(n) floor(blocks * (seq_len(n) - 1) / n)))
  sums <- rowsum(fall, block)
  error <- sqrt(nrow(sums)) * stats::sd(sums) / n
  list(mean = mean(fall), standard_error = error, improves = mean(fall) > error)
}

# Conditions that drive no mechanism of the catalogue, and that the error before cannot distinguish
# from those that drive this one.
untried_twins <- function(parent, entry, catalogue) {
  same <- Filter(function(g) g$significant && any(g$conditions %in% entry$boundary),
                 parent$attribution$groups)
  driven <- unlist(lapply(unclass(catalogue), `[[`, "boundary"))
  setdiff(unlist(lapply(same, `[[`, "conditions")), driven)
}

# The error responded before to the condition that drives a mechanism, and still does, with more
# than half of its evidence.
still_answers <- function(parent, model, boundary) {
  strength <- function(m) {
    table <- m$attribution$table
    driven <- table$boundary %in% boundary & table$significant
    if (any(driven)) max(table$log10_bf_dropped[driven]) else 0
  }
  before <- strength(parent)
  before > 0 && strength(model) > rules$still_responds * before
}

# Parameters of the model that are strongly correlated with those that the mechanism brought:
# another part of the model that could do the same.
confounded_parameters <- function(fit, new) {
  others <- setdiff(colnames(fit$values), new)
  if (!length(new) || !length(others)) return(character())
  together <- stats::cov.wt(posterior_unit(fit), fit$weights)$cov
  sd <- pmax(sqrt(diag(together)), 1e-12)  # of rounding alone: no correlation
  r <- together / outer(sd, sd)
  dimnames(r) <- list(colnames(fit$values), colnames(fit$values))
  others[apply(abs(r[others, new, drop = FALSE]), 1, max) > rules$confounded]
}

# In words, if the last of `models` was found on top of mechanisms that are not named.
unnamed_before <- function(models) {
  before <- models[-c(1, length(models))]
  unnamed <- Filter(function(model) !identical(model$verdict, "named"), before)
  if (!length(unnamed)) return(NULL)
  sprintf("%s, on top of which it was found, %s not named",
          listed(vapply(unnamed, `[[`, "", "mechanism")), if (length(unnamed) > 1) "are" else "is")
}

# In words, if the last of `models` has no evidence on the base model and is correlated with what
# was adopted before it: two that imitate a third together look like this.
only_beside <- function(models, confounded, candidates) {
  mechanism <- models[[length(models)]]$mechanism
  alone <- candidates$log10_bf[candidates$from == models[[1]]$name &
                               candidates$mechanism == mechanism]
  before <- models[-c(1, length(models))]
  if (!length(before) || !isTRUE(alone < 0)) return(NULL)
  known <- names(drawn_parameters(models[[1]]$fit))
  brought <- lapply(models[-length(models)],
                    function(m) setdiff(names(drawn_parameters(m$fit)), known))
  beside <- before[mapply(function(now, then) any(setdiff(now, then) %in% confounded), brought[-1],
                          brought[-length(brought)])]
  if (length(beside))
    sprintf("it has evidence only together with %s, with which it is correlated",
            listed(vapply(beside, `[[`, "", "mechanism")))
}

# Whether the last model's error is still large, and a good part of what exceeded the noise is left.
# The mechanism that made the error leaves nothing; one that imitates it does.
much_remains <- function(models, measurements) {
  ends <- lapply(models[c(1, length(models))], remaining_error, measurements)
  excess <- vapply(ends, function(e) e$ratio^2 - 1, 0)
  ends[[2]]$large && excess[2] > rules$remains * excess[1]
}
