# What to inspect next to settle what a result leaves open: sentences that say what to measure, look
# at or compute, each from something that the result knows. Their names say what they are about.

upgrade_inspections <- function(upgrade) {
  last <- upgrade$models[[length(upgrade$models)]]
  adopted <- adopted_models(upgrade)
  told <- c(unlist(lapply(upgrade$models, function(m) trust_inspections(m$fit, m$name))),
            held_out_inspection(last, upgrade$measurements),
            shorter_step_inspection(last),
            unlist(lapply(adopted, function(m) mechanism_inspections(upgrade, m))),
            nearest_inspection(upgrade),
            undecided_inspections(upgrade),
            group_inspections(last$attribution),
            answer_inspections(upgrade, last),
            driver_inspections(upgrade),
            edge_inspections(last$fit),
            remainder_inspection(last, upgrade$measurements),
            spike_inspection(last, upgrade$measurements),
            if (upgrade$stopped_id == "steps") {
              c(steps = paste("Further causes were not looked for: raise control$max_steps and run",
                              "the loop again."))
            })
  if (length(told)) told
  else c(nothing = paste("Nothing that this record could settle is open. The next test is a record",
                         "of another season or another use."))
}

calibration_inspections <- function(fit, model = NULL) {
  c(read_findings(list(list(fit = fit)), fit$measurements),
    trust_inspections(fit, "the model"),
    if (!is.null(model)) held_out_inspection(model, fit$measurements),
    edge_inspections(fit), tied_inspections(fit), loose_inspections(fit),
    if (!is.null(model)) remainder_inspection(model, fit$measurements),
    if (!is.null(model)) spike_inspection(model, fit$measurements),
    cause = paste("A calibration does not show what its error responds to, or what may cause it:",
                  "attribute_discrepancy() asks the first, upgrade_model() with a catalogue of",
                  "mechanisms the second."))
}

comparison_inspections <- function(comparison) {
  best <- comparison$models[[best_model(comparison)]]
  attribution <- comparison$tables$attribution
  answers <- attribution$boundary[attribution$model == best$name & attribution$significant]
  c(read_findings(unname(comparison$models), comparison$measurements),
    unlist(lapply(comparison$models, function(m) trust_inspections(m$fit, m$name)),
           use.names = FALSE),
    separation_inspection(comparison),
    held_out_inspection(best, comparison$measurements),
    edge_inspections(best$fit),
    if (length(answers)) {
      c(answers = sprintf(paste("Even %s leaves an error that responds to %s: ask",
                                "upgrade_model() for the cause, with mechanisms driven by",
                                "%s."), best$name, listed(answers), listed(answers, "or")))
    })
}

# ---- can the numbers be trusted

trust_inspections <- function(fit, name) {
  if (inherits(fit, "amiss_joint")) {
    of_each <- Map(trust_inspections, record_fits(fit), paste(name, names(fit$records), sep = ", "))
    told <- do.call(c, unname(of_each))
    # They share one sampler.
    return(told[names(told) != "sampler" | !duplicated(names(told))])
  }
  runs <- nrow(fit$emulator$processes$inputs)
  sampler <- sampler_said(fit)  # of the paper's calibration
  more <- if (is.null(fit$emulator$simulator)) "give more runs where the posterior lies"
          else sprintf("make more runs (%d now)", runs)
  c(if (isFALSE(fit$check$passed)) {
      c(emulator = sprintf(paste("The emulator of %s is not trusted (%s): %s before anything is",
                                 "read from its numbers."), name, fit$check$verdict, more))
    },
    if (!sampler$trusted) {
      c(sampler = sprintf(paste("The sampler's result for %s is not trusted (%s): give it more",
                                "chains (pilot_chains, %d now)."), name,
                          sub("^not trusted: ", "", sampler$verdict),
                          as.integer(fit$control$ais$pilot_chains)))
    })
}

# ---- data held out

held_out_inspection <- function(model, measurements) {
  if (is.na(model$scores$validate[["rmse"]])) {
    return(c(held_out = paste("No data were held out, so that no change could fail a test: keep",
                              "some days from calibration (argument validate of measurements()),",
                              "or measure some more.")))
  }
  excess <- held_out_excess(model, measurements)
  if (is.null(excess)) return(NULL)
  beyond <- uncovered_conditions(measurements, model$fit)
  where <- if (!length(beyond))
             "compare the two periods for what else differs: settings, use, sensors"
           else sprintf(
             "there %s outside of what calibration saw%s; calibrate on data that cover it",
             listed(sprintf("%s lies in %s of the steps", names(beyond), percent(beyond))),
             if (remaining_error(model, measurements)$large) ", or what is missing acts more"
             else "")
  c(held_out = sprintf("On held-out data the error is %s times that in calibration: %s.",
                       short(excess), where))
}

# How many times as large as in calibration the error on data held out is; NULL where it is no
# larger than that, or the noise, asks for.
held_out_excess <- function(model, measurements) {
  seen <- model$scores$calibrate[["rmse"]]
  held <- model$scores$validate[["rmse"]]
  if (is.na(held) || held < 1.5 * max(seen, measurements$noise_sd)) NULL else held / seen
}

# Share of the held-out steps at which a condition that the model reads lies outside of its range in
# calibration, if a tenth or more.
uncovered_conditions <- function(measurements, fit) {
  if (is_several(measurements)) {
    each <- Map(uncovered_conditions, measurements$records,
                fit$records[names(measurements$records)])
    shares <- unlist(unname(each))
    names(shares) <- paste(names(shares), "of", rep(names(each), lengths(each)), recycle0 = TRUE)
    return(shares)
  }
  share <- vapply(measurements$conditions, function(name) {
    value <- condition_values(measurements, name)
    seen <- range(value[measurements$use == "calibrate"], na.rm = TRUE)
    held <- value[measurements$use == "validate"]
    mean(held < seen[1] | held > seen[2], na.rm = TRUE)
  }, 0)
  turning <- tabulate(measurements$condition, length(share)) == 2
  simulator <- fit$emulator$simulator
  read <- if (is.null(simulator)) names(share) else driver_names(simulator)
  share[share >= 0.1 & !turning & names(share) %in% read]
}

# ---- one mechanism

mechanism_inspections <- function(upgrade, model) {
  trials <- upgrade$candidates[upgrade$candidates$from == model$parent, ]
  adopted <- vapply(adopted_models(upgrade), `[[`, "", "mechanism")
  rivals <- trials[!trials$mechanism %in% adopted & trials$probability >= rules$rival_probability, ]
  told <- c(vapply(rivals$mechanism,
                   function(rival) separating_words(upgrade, trials, model$mechanism, rival), ""),
            confounded_inspection(upgrade, model))
  c(stats::setNames(told, rep("rival", length(told))),
    if (model$verdict == "stand-in") stand_in_inspection(model)
    else if (describes(upgrade$catalogue[[model$mechanism]])) description_inspection(upgrade, model)
    else site_inspection(upgrade, model),
    if ("drift" %in% names(model$doubts)) {
      c(drift = sprintf(paste("Compare the sensor of %s with a second one from time to time: a",
                              "drift of it would explain as much as %s."),
                        upgrade$measurements$target, model$mechanism))
    },
    if ("slow" %in% names(model$doubts)) {
      c(drift = sprintf(paste("Compare the sensor of %s with a second one from time to",
                              "time: that shows whether the sensor changes or what it",
                              "measures."), upgrade$measurements$target))
    },
    step_inspection(upgrade, model))
}

# Where what a mechanism mends may be the simulator's own steps: as they were seen or, where they
# could not be, if it brings a time constant about as short as the record's step.
step_inspection <- function(upgrade, model) {
  parent <- Filter(function(m) m$name == model$parent, upgrade$models)[[1]]
  if ("steps" %in% names(model$doubts)) {
    return(c(step = sprintf(paste("Let the simulator run with finer steps before you believe in",
                                  "%s: its steps may be what it mends."), model$mechanism)))
  }
  if (is_several(upgrade$measurements) || !all(is.na(step_error(parent)))) return(NULL)
  brought <- upgrade$candidates[upgrade$candidates$from == model$parent &
                                upgrade$candidates$mechanism == model$mechanism, "parameters"][[1]]
  hours <- c(s = 1 / 3600, min = 1 / 60, h = 1, d = 24)[brought$unit]
  short <- !is.na(hours) & brought$median * hours <= 2 * upgrade$measurements$step_h
  if (!any(short)) return(NULL)
  c(step = sprintf(paste("The time that %s brings (%s) is about a step of the record: a simulator",
                         "whose own steps are coarse errs alike. Run it with finer ones before you",
                         "believe in %s."), model$mechanism, listed(brought$name[short]),
                   model$mechanism))
}

# What the last model's own steps do to what remains, and to its parameters.
shorter_step_inspection <- function(last) {
  error <- max(0, step_error(last), na.rm = TRUE)
  moved <- step_moved_words(last)
  if (error <= rules$error_ratio && is.null(moved)) return(NULL)
  c(steps = paste0("With steps a quarter as long the simulator's output changes by ", short(error),
                   " of the noise beyond what its parameters can take up",
                   if (!is.null(moved)) paste0(", and ", moved), ": let it run with finer ones."))
}

# What would distinguish two mechanisms: conditions that only one responds to, or what each asks to
# be found on site.
separating_words <- function(upgrade, trials, a, b) {
  drivers <- lapply(upgrade$catalogue[c(a, b)], `[[`, "boundary")
  only <- list(setdiff(drivers[[1]], drivers[[2]]), setdiff(drivers[[2]], drivers[[1]]))
  if (!length(unlist(only))) {
    called <- vapply(
      c(a, b), function(name) called_for(trials$parameters[[match(name, trials$mechanism)]]), "")
    same <- if (length(drivers[[1]])) "respond to the same conditions"
            else "respond to no condition that was measured"
    return(sprintf(paste("Because %s and %s %s, only a look on site distinguishes them: the first",
                         "asks for %s, the second for %s."),
                   a, b, same, called[1], called[2]))
  }
  together <- correlation_words(upgrade$measurements, drivers[[1]], drivers[[2]])
  either <- lapply(only, listed, "or")
  changing <- if (all(lengths(only)))
                sprintf("%s changes while %s does not, or vice versa", either[[1]], either[[2]])
              else sprintf("%s changes and nothing else does", listed(unlist(only), "or"))
  sprintf("To distinguish %s from %s, measure while %s%s.", a, b, changing, together)
}

correlation_words <- function(measurements, a, b) {
  if (is_several(measurements)) return("")
  pairs <- expand.grid(a = intersect(a, measurements$conditions),
                       b = intersect(b, measurements$conditions), stringsAsFactors = FALSE)
  pairs <- pairs[pairs$a != pairs$b, ]
  if (nrow(pairs) != 1) return("")
  used <- measurements$use == "calibrate"
  r <- stats::cor(condition_values(measurements, pairs$a)[used],
                  condition_values(measurements, pairs$b)[used], use = "pairwise.complete.obs")
  if (is.na(r) || abs(r) < rules$confounded) ""
  else sprintf(" (in this record the correlation of %s and %s is %.2f)", pairs$a, pairs$b, r)
}

called_for <- function(parameters) {
  if (!NROW(parameters)) return("no value that could be checked")
  listed(sprintf("a %s of %s", parameters$name,
                 with_unit(interval_words(parameters$lower95, parameters$upper95),
                           parameters$unit)))
}

# The strongest tie between what a mechanism brought and another part of the model.
confounded_inspection <- function(upgrade, model) {
  others <- model$confounded_with
  parent <- Filter(function(m) m$name == model$parent, upgrade$models)[[1]]
  new <- setdiff(names(drawn_parameters(model$fit)), names(drawn_parameters(parent$fit)))
  if (!length(others) || !length(new)) return(NULL)
  labels <- parameter_labels(model$fit, others)
  sprintf("The estimate of %s (%s) is correlated with %s: measuring %s would narrow it.",
          model$mechanism, listed(parameter_labels(model$fit, new)), listed(labels),
          if (length(labels) > 1) "one of these" else "that")
}

stand_in_inspection <- function(model) {
  c(stand_in = sprintf(paste("Take %s as a sign and look for something that acts alike but shows",
                             "on held-out data too: which days gain by it in calibration, and",
                             "which lose held out?"),
                       model$mechanism))
}

# What the calibrated values ask to be found on site.
site_inspection <- function(upgrade, model) {
  table <- changes_table(upgrade)
  brought <- table[table$mechanism == model$mechanism, ]
  if (!NROW(brought)) return(NULL)
  between <- sub(" to ", " and ", brought[["95 % interval"]], fixed = TRUE)
  last <- upgrade$models[[length(upgrade$models)]]
  hidden <- if (!is.null(reach_sentence(last$fit)) ||
                remaining_error(last, upgrade$measurements)$large)
    " What is still missing may bias these values."
  if (any(brought$parameter %in% step_moved(last)))
    hidden <- paste(hidden, "Finer steps would move these values.")
  values <- listed(sprintf("%s lies between %s", brought$parameter,
                           with_unit(between, brought$unit)))
  c(site = sprintf("If %s is the cause, %s: check that on site.%s", model$mechanism, values,
                   hidden %||% ""))
}

# ---- what was not adopted

last_trials <- function(upgrade) {
  upgrade$candidates[upgrade$candidates$from == upgrade$models[[length(upgrade$models)]]$name, ]
}

# The best of the mechanisms left, where there is evidence for it that is not decisive: a row of its
# trial, or none.
nearest_trial <- function(upgrade) {
  trials <- last_trials(upgrade)
  if (!NROW(trials)) return(NULL)
  open <- trials[!is.na(trials$log10_bf) & !keeps_error(trials), ]
  best <- open[which.max(open$log10_bf), ]
  best[best$probability >= rules$rival_probability & best$log10_bf > rules$told_evidence, ]
}

# A trial that would have been verified, had the budget not ended.
is_unverified <- function(row, upgrade)
  row$judged_by == "trial" && row$log10_bf >= upgrade$control$decisive

nearest_inspection <- function(upgrade) {
  best <- nearest_trial(upgrade)
  if (!NROW(best) || unjudged(upgrade) || best$upper95 - best$lower95 > rules$too_rough)
    return(NULL)
  if (is_unverified(best, upgrade)) {
    return(c(nearest = sprintf(paste("The mechanism %s was not verified (odds of %s): a",
                                     "larger budget (control$runs_total) would decide it."),
                               best$mechanism, odds(best$log10_bf))))
  }
  drivers <- upgrade$catalogue[[best$mechanism]]$boundary
  new <- best$parameters[[1]]
  c(nearest = sprintf(
    "The mechanism %s remains undecided (odds of %s%s): a longer record%s would decide it%s.",
    best$mechanism, odds(best$log10_bf),
    if (isTRUE(best$error_ratio < rules$clearly_fallen))
      sprintf("; with it the error falls to %s", percent(best$error_ratio))
    else "",
    if (!length(drivers)) ""
    else sprintf(" in which %s strongly",
                 paste(listed(drivers), if (length(drivers) > 1) "change" else "changes")),
    if (NROW(new)) sprintf(", or a look for %s on site", called_for(new)) else ""))
}

# Mechanisms of which the numbers are too rough to rule them out.
undecided_inspections <- function(upgrade) {
  open <- open_trials(upgrade)
  if (!NROW(open)) return(NULL)
  said <- vapply(seq_len(nrow(open)), function(k) {
    ends <- c(open$lower95[k], open$upper95[k])
    if (diff(ends) > rules$too_rough) return("its numbers are too rough for odds")
    sprintf("odds of %s%s, by numbers that are not trusted", odds(open$log10_bf[k]),
            odds_interval(ends))
  }, "")
  told <- sprintf(paste("The mechanism %s is not ruled out: %s. A larger budget",
                        "(control$runs_total), or narrower priors, would decide."),
                  open$mechanism, said)
  stats::setNames(told, rep("undecided", length(told)))
}

group_inspections <- function(attribution) {
  told <- vapply(Filter(function(g) g$significant, attribution$groups), function(g) {
    several <- length(g$conditions) > 2
    sprintf(paste("In this record %s go together (correlation %.2f), so that the cause may lie",
                  "with %s: measure some days on which %s changes while %s %s."),
            listed(g$conditions), g$correlation, if (several) "any of them" else "either",
            g$conditions[1], listed(g$conditions[-1]),
            if (several) "stay as they are" else "stays as it is")
  }, "")
  stats::setNames(told, rep("group", length(told)))
}

# Conditions that the error still responds to, with the mechanisms left that they drive.
answer_inspections <- function(upgrade, last) {
  table <- last$attribution$table
  answers <- table$boundary[table$significant & is.na(table$group)]
  left <- setdiff(names(upgrade$catalogue), unlist(lapply(upgrade$models, `[[`, "mechanism")))
  open <- c(nearest_trial(upgrade)$mechanism, open_trials(upgrade)$mechanism)
  trials <- last_trials(upgrade)
  falls <- trials[trials$trusted & !trials$mechanism %in% open &
                    !is.na(trials$error_ratio) & trials$error_ratio < rules$clearly_fallen, ]
  undecided <- character()  # of each condition the mechanisms that may be why
  told <- character()
  for (name in answers) {
    driven <- left[vapply(upgrade$catalogue[left], function(entry) name %in% entry$boundary, NA)]
    fallen <- falls[falls$mechanism %in% driven, ]
    if (NROW(fallen)) {
      best <- fallen[which.min(fallen$error_ratio), ]
      told <- c(told, sprintf(paste("The error still responds to %s. With %s, which it drives, it",
                                    "falls to %s, but the evidence (odds of %s) does not",
                                    "distinguish that from an unknown response to %s: look for %s",
                                    "on site."),
                              name, best$mechanism, percent(best$error_ratio), odds(best$log10_bf),
                              name, called_for(best$parameters[[1]])))
    } else if (any(driven %in% open)) {
      undecided[name] <- listed(intersect(driven, open), "or")
    } else if (length(driven)) {
      told <- c(told,
                sprintf(paste("The error still responds to %s. Among the mechanisms that it",
                              "drives, %s %s tried but not adopted: look for another way in which",
                              "%s acts."),
                        name, listed(driven), if (length(driven) > 1) "were" else "was", name))
    } else {
      ever <- any(vapply(upgrade$catalogue, function(entry) name %in% entry$boundary, NA))
      told <- c(told, sprintf(paste("The error still responds to %s, and no mechanism %s the",
                                    "catalogue is driven by it: think of what acts with %s, and",
                                    "add it."), name, if (ever) "left in" else "of", name))
    }
  }
  of_reason <- split(answers[answers %in% names(undecided)], factor(undecided, unique(undecided)))
  told <- c(sprintf("The error still responds to %s: %s may be why, and is not decided.",
                    vapply(of_reason, listed, ""), names(of_reason)), told)
  stats::setNames(told, rep("answer", length(told)))
}

# Drivers of mechanisms that are not among the conditions analysed: left out as constant, or never
# given.
driver_inspections <- function(upgrade) {
  drivers <- unique(unlist(lapply(upgrade$catalogue, `[[`, "boundary")))
  absent <- setdiff(drivers, upgrade$measurements$conditions)
  constant <- intersect(absent, unlist(lapply(each_record(upgrade$measurements), `[[`, "constant")))
  absent <- setdiff(absent, constant)
  driven_by <- function(conditions) {
    listed(names(upgrade$catalogue)[
      vapply(upgrade$catalogue, function(m) any(m$boundary %in% conditions), NA)])
  }
  c(if (length(constant)) {
      c(constant = sprintf(paste("%s did not vary in calibration, so that %s cannot be judged:",
                                 "calibrate on rows with changes."),
                           listed(constant), driven_by(constant)))
    },
    if (length(absent)) {
      c(driver = sprintf(
        paste("Not among the boundary conditions analysed: %s, which %s %s. Add to boundary of",
              "measurements(), so that the error can respond to it."),
        listed(absent), if (length(absent) > 1) "drive" else "drives", driven_by(absent)))
    })
}

# ---- the parameters

edge_inspections <- function(fit) {
  rows <- parameter_rows(fit)
  rows <- rows[rows$at_edge, ]
  upper <- abs(rows$prior_upper - rows$median) < abs(rows$median - rows$prior_lower)
  end <- with_unit(short(ifelse(upper, rows$prior_upper, rows$prior_lower)), rows$unit)
  told <- sprintf(paste("The parameter %s lies at the %s end of its prior (%s): measure it, or",
                        "widen the prior if %s is possible; otherwise it makes up for something",
                        "else."),
                  rows$label, ifelse(upper, "upper", "lower"), end, ifelse(upper, "more", "less"))
  stats::setNames(told, rep("edge", length(told)))
}

# Pairs of parameters that the record cannot distinguish.
tied_inspections <- function(fit) {
  r <- posterior_correlation(fit)
  if (ncol(r) < 2) return(NULL)
  pairs <- which(abs(r) > 0.9 & upper.tri(r), arr.ind = TRUE)
  label <- parameter_labels(fit, colnames(r))
  told <- sprintf(paste("The parameters %s and %s are correlated (%.2f): a measurement of either",
                        "settles both."),
                  label[pairs[, 1]], label[pairs[, 2]], r[pairs])
  stats::setNames(told, rep("tied", length(told)))
}

loose_inspections <- function(fit) {
  left <- narrowing(fit)
  loose <- names(left)[left > 0.7]
  if (length(loose)) {
    c(loose = sprintf(paste("The record says little about %s: %s is still the prior's; if it",
                            "matters, measure it or find a record in which it shows."),
                      listed(loose), if (length(loose) > 1) "their range" else "its range"))
  }
}

# ---- what is left of the error

remainder_inspection <- function(model, measurements) {
  if (is_several(measurements)) {
    views <- each_view(model, measurements)
    each <- lapply(views, function(view) remainder_inspection(view$model, view$measurements))
    told <- do.call(c, unname(each))
    if (length(told)) told[] <- paste0(rep(names(each), lengths(each)), ": ", told)
    return(told)
  }
  left <- remaining_error(model, measurements)
  noise <- with_unit(short(measurements$noise_sd), measurements$unit)
  if (left$large && is.null(left$pattern)) {
    return(c(noise = sprintf(paste("The remaining error is %s times the stated noise of %s: check",
                                   "that noise with a second sensor; if it is right, something is",
                                   "still missing from the model%s."),
                             short(left$ratio), noise,
                             if (any(model$attribution$table$significant)) ""
                             else paste(", perhaps something that acts through two conditions at",
                                        "once or by thresholds, which an attribution does not",
                                        "show"))))
  }
  if (left$large) {
    return(c(pattern = sprintf("The error that remains has a pattern: %s. %s", left$pattern$what,
                               left$pattern$where)))
  }
  if (left$ratio < 0.6) {
    c(noise = sprintf(paste("The remaining error is only %s times the stated noise of %s: if the",
                            "sensor is that good, state less noise, and causes that now hide in it",
                            "will show."),
                      short(left$ratio), noise))
  }
}

# ---- models compared

# Where the predictions of two models that are not clearly distinguished differ most.
separation_inspection <- function(comparison) {
  table <- comparison$tables$evidence
  best <- table[which.min(table$rank), ]
  if (nrow(table) < 2 || (best$log10_bf >= 2 && best$bf_lower95 > 0)) return(NULL)
  a <- comparison$models[[best$model]]$prediction
  apart <- abs(a$mean - comparison$models[[best$against]]$prediction$mean)
  m <- comparison$measurements
  rows <- match(a$time, m$time)
  conditions <- vapply(m$conditions, function(name) {
    value <- condition_values(m, name)[rows]
    if (stats::sd(value) > 0 && stats::sd(apart) > 0) stats::cor(value, apart) else 0
  }, 0)
  name <- names(which.max(abs(conditions)))
  at <- which.max(apart)
  c(separate = sprintf(paste("The record does not clearly distinguish %s from %s. Their",
                             "simulations differ most (by %s) at %s, and the more so the %s %s is:",
                             "measure under such conditions."),
                       best$model, best$against, with_unit(short(apart[at]), m$unit),
                       paste0(if (is.numeric(a$time)) "hour ", format(a$time[at])),
                       if (conditions[[name]] > 0) "higher" else "lower", name))
}
