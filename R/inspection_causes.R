# What to inspect next about causes: what would distinguish or confirm the mechanisms adopted, what
# would decide those that were not, and what the error still responds to.

cause_inspections <- function(upgrade, adopted) {
  verdicts <- vapply(adopted, `[[`, "", "verdict")
  described <- vapply(adopted, function(m) describes(upgrade$catalogue[[m$mechanism]]), NA)
  c(rival_inspections(upgrade, adopted),
    confounded_inspection(upgrade, adopted),
    stand_in_inspection(adopted[verdicts == "stand-in"]),
    described_inspection(upgrade, adopted[verdicts != "stand-in" & described]),
    site_inspection(upgrade, adopted[verdicts != "stand-in" & !described]))
}

# ---- the simulator's own steps

# Whether finer steps would take a mechanism back: as they were seen or, if they could not be, if it
# brings a time constant about as short as the record's step. With the last model also what its own
# steps do to what remains, and to its parameters.
step_inspection <- function(upgrade, adopted, last = NULL) {
  doubted <- Filter(function(m) "steps" %in% names(m$doubts), adopted)
  doubted <- vapply(doubted, `[[`, "", "mechanism")
  names <- vapply(adopted, `[[`, "", "mechanism")
  times <- lapply(stats::setNames(adopted, names)[!names %in% doubted], short_times, upgrade)
  times <- times[lengths(times) > 0]
  error <- if (is.null(last)) 0 else max(0, step_error(last), na.rm = TRUE)
  moved <- if (!is.null(last)) step_moved_words(last)
  coarse <- error > rules$error_ratio || !is.null(moved)
  if (!length(doubted) && !length(times) && !coarse) return(NULL)
  mended <- c(doubted, names(times))
  reasons <- c(
    if (length(doubted))
      sprintf("%s may only correct for its coarse steps.", capital(listed(doubted))),
    if (length(times))
      sprintf(paste("The time%s of %s %s about a step of the record, and coarse steps make an",
                    "error of the same shape."), if (length(times) > 1) "s" else "",
              listed(sprintf("%s (%s)", names(times), vapply(times, listed, ""))),
              if (length(times) > 1) "are" else "is"),
    if (coarse)
      paste0("With steps a quarter as long the simulator's output changes by ", short(error),
             " of the noise beyond what its parameters can take up",
             if (!is.null(moved)) paste0(", and ", moved), "."))
  c(step = paste0("Let the simulator run with finer steps",
                  if (length(mended)) paste(" before you believe in", listed(mended, "or")), ". ",
                  paste(reasons, collapse = " ")))
}

# The times that a mechanism brings and that are about a step or less, if its parent's own steps
# could not be tried.
short_times <- function(model, upgrade) {
  parent <- Filter(function(m) m$name == model$parent, upgrade$models)[[1]]
  if (is_several(upgrade$measurements) || !all(is.na(step_error(parent)))) return(NULL)
  brought <- upgrade$candidates[upgrade$candidates$from == model$parent &
                                upgrade$candidates$mechanism == model$mechanism, "parameters"][[1]]
  hours <- c(s = 1 / 3600, min = 1 / 60, h = 1, d = 24)[brought$unit]
  longest <- rules$short_time * upgrade$measurements$step_h
  brought$name[!is.na(hours) & brought$median * hours <= longest]
}

# ---- the mechanisms adopted and their rivals

# What would distinguish them from mechanisms that were not adopted: conditions that only one
# responds to, or what each asks to be found on site.
rival_inspections <- function(upgrade, adopted) {
  pairs <- do.call(c, lapply(adopted, rival_pairs, upgrade))
  measured <- vapply(pairs, function(pair) length(pair$measure) > 0, NA)
  told <- c(measured_words(pairs[measured]), looked_words(pairs[!measured]))
  stats::setNames(told, rep("rival", length(told)))
}

rival_pairs <- function(model, upgrade) {
  trials <- upgrade$candidates[upgrade$candidates$from == model$parent, ]
  adopted <- vapply(adopted_models(upgrade), `[[`, "", "mechanism")
  rivals <- trials[!trials$mechanism %in% adopted & trials$probability >= rules$rival_probability, ]
  lapply(rivals$mechanism, function(rival) {
    names <- c(model$mechanism, rival)
    drivers <- lapply(upgrade$catalogue[names], `[[`, "boundary")
    asks <- vapply(match(names, trials$mechanism), function(k)
      called_for(trials$parameters[[k]], is_sound(trials[k, ], upgrade)), "")
    names(asks) <- names
    list(names = names, drivers = sort(drivers[[1]]), asks = asks,
         measure = separating_words(upgrade$measurements, drivers[[1]], drivers[[2]]))
  })
}

# When to measure to distinguish two mechanisms, by what drives each; NULL if nothing would.
separating_words <- function(measurements, a, b) {
  only <- list(setdiff(a, b), setdiff(b, a))
  if (!length(unlist(only))) return(NULL)
  either <- lapply(only, listed, "or")
  paste0(if (all(lengths(only)))
           sprintf("%s changes and %s does not, or vice versa", either[[1]], either[[2]])
         else sprintf("%s changes and nothing else does", listed(unlist(only), "or")),
         correlation_words(measurements, a, b))
}

measured_words <- function(pairs) {
  measure <- vapply(pairs, `[[`, "", "measure")
  vapply(unique(measure), function(when) {
    names <- vapply(pairs[measure == when], `[[`, c("", ""), "names")
    of <- split(names[2, ], factor(names[1, ], unique(names[1, ])))
    sprintf("To distinguish %s, measure a period in which %s.",
            listed(sprintf("%s from %s", names(of), vapply(of, listed, "", "and from"))), when)
  }, "")
}

looked_words <- function(pairs) {
  drivers <- vapply(pairs, function(pair) paste(pair$drivers, collapse = "\n"), "")
  vapply(unique(drivers), function(same) {
    asks <- do.call(c, lapply(pairs[drivers == same], `[[`, "asks"))
    asks <- asks[!duplicated(names(asks))]
    respond <- if (nzchar(same)) "respond to the same conditions"
               else "respond to no condition that was measured"
    sprintf("%s %s, so only a check on site can distinguish them: %s.", listed(names(asks)),
            respond,
            if (length(asks) == 2) sprintf("the first needs %s, the second %s", asks[[1]],
                                           asks[[2]])
            else paste0(names(asks), " needs ", asks, collapse = "; "))
  }, "")
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

# With their values, if the numbers behind them are `sound`.
called_for <- function(parameters, sound = TRUE) {
  if (!NROW(parameters)) return("no value that could be checked")
  label <- with_article(parameters$label %||% parameters$name)
  if (!sound) return(listed(label))
  listed(sprintf("%s of %s", label,
                 with_unit(interval_words(parameters$lower95, parameters$upper95),
                           parameters$unit)))
}

# The strongest tie between what each mechanism brought and another part of its model.
confounded_inspection <- function(upgrade, adopted) {
  ties <- Filter(Negate(is.null), lapply(adopted, confounded_tie, upgrade))
  if (!length(ties)) return(NULL)
  of <- vapply(ties, `[[`, "", "of")
  with <- lapply(ties, `[[`, "with")
  c(tied = if (length(ties) == 1) {
    sprintf("The estimate of %s is correlated with %s: measuring %s would narrow it.", of,
            listed(with[[1]]), if (lengths(with) > 1) "one of these" else "that")
  } else {
    sprintf("Estimates are correlated: %s. Measuring one of each would narrow them.",
            listed(sprintf("that of %s with %s", of, vapply(with, listed, "", "or"))))
  })
}

confounded_tie <- function(model, upgrade) {
  parent <- Filter(function(m) m$name == model$parent, upgrade$models)[[1]]
  new <- setdiff(names(drawn_parameters(model$fit)), names(drawn_parameters(parent$fit)))
  if (!length(model$confounded_with) || !length(new)) return(NULL)
  list(of = sprintf("%s (%s)", model$mechanism, listed(parameter_labels(model$fit, new))),
       with = parameter_labels(model$fit, model$confounded_with))
}

stand_in_inspection <- function(models) {
  if (!length(models)) return(NULL)
  names <- vapply(models, `[[`, "", "mechanism")
  c(stand_in = sprintf(paste("%s probably %s in for another cause. Compare the days in calibration",
                             "on which the error falls with %s to the held-out days on which it",
                             "rises, and look for what differs."),
                       listed(names), if (length(names) > 1) "stand" else "stands",
                       if (length(names) > 1) "them" else "it"))
}

described_inspection <- function(upgrade, models) {
  if (length(models) < 2) return(unlist(lapply(models, description_inspection, upgrade = upgrade)))
  conditions <- vapply(models, function(m) upgrade$catalogue[[m$mechanism]]$response$boundary, "")
  c(description = sprintf(paste("Look for what lets %s act on %s as the responses do, and add each",
                                "as a mechanism: only that would explain them."),
                          listed(conditions), target_label(upgrade$measurements)))
}

# What the calibrated values ask to be found on site, where physical values lie.
site_inspection <- function(upgrade, models) {
  table <- changes_table(upgrade)
  brought <- table[table$mechanism %in% vapply(models, `[[`, "", "mechanism"), ]
  if (!NROW(brought)) return(NULL)
  last <- upgrade$models[[length(upgrade$models)]]
  if (!last$fit$trust$trusted) {
    causes <- listed(unique(brought$mechanism), "or")
    return(c(site = sprintf(
      "If %s is the cause, measure %s on site: the calibrated %s not trusted.", causes,
      listed(brought$parameter), if (nrow(brought) > 1) "values are" else "value is")))
  }
  between <- gsub(" to ", " and ", brought[["physical value"]] %||% brought[["95 % interval"]],
                  fixed = TRUE)
  values <- sprintf("%s lies between %s", brought$parameter, with_unit(between, brought$unit))
  of <- split(values, factor(brought$mechanism, unique(brought$mechanism)))
  asks <- sprintf("f %s is %s cause, %s", names(of), if (length(of) > 1) "a" else "the",
                  vapply(of, listed, ""))
  c(site = paste(c(if (length(of) == 1) sprintf("I%s: check that on site.", asks)
                   else sprintf("Check on site: i%s.", paste(asks, collapse = "; i")),
                   if (is.null(brought[["physical value"]]) && !is.null(reach_sentence(last$fit)))
                     "What is still missing may bias these values.",
                   if (any(brought$parameter %in% step_moved(last)))
                     "Finer steps would move these values."), collapse = " "))
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
  best <- near_trial(upgrade)
  if (!NROW(best) || is_unverified(best, upgrade) || !is_sound(best, upgrade)) return(NULL)
  drivers <- upgrade$catalogue[[best$mechanism]]$boundary
  new <- best$parameters[[1]]
  c(nearest = sprintf(
    "The mechanism %s is not established (odds of %s%s): a longer record%s%s would decide%s.",
    best$mechanism, odds(best$log10_bf),
    if (isTRUE(best$error_ratio < rules$clearly_fallen))
      sprintf("; with it the error falls to %s", percent(best$error_ratio))
    else "",
    if (!length(drivers)) ""
    else sprintf(" in which %s strongly",
                 paste(listed(drivers), if (length(drivers) > 1) "change" else "changes")),
    longer_words(best, upgrade),
    if (NROW(new)) sprintf(", or a check on site whether there is %s", called_for(new)) else ""))
}

# The nearest trial, if its numbers and those of the model are good enough to speak of.
near_trial <- function(upgrade) {
  best <- nearest_trial(upgrade)
  if (NROW(best) && !unjudged(upgrade) && best$upper95 - best$lower95 <= rules$too_rough) best
}

# How much longer, if evidence grows with the length of the record; nothing if that is too much to
# ask for.
longer_words <- function(trial, upgrade) {
  times <- upgrade$control$decisive / trial$log10_bf - 1
  more <- if (times > 0 && times <= rules$most_longer) calibrated_words(upgrade$measurements, times)
  if (is.null(more)) "" else sprintf(" (about %s more at this pace)", more)
}

# How long was calibrated on, in words; NULL of several records.
calibrated_words <- function(measurements, times = 1) {
  if (is_several(measurements)) return(NULL)
  duration_words(times * sum(measurements$use == "calibrate") * measurements$step_h)
}

# Mechanisms that a larger budget would decide: the nearest one, if it was not verified, and those
# of which the numbers are too rough to rule them out.
budget_inspections <- function(upgrade) {
  if (unjudged(upgrade)) return(NULL)
  best <- near_trial(upgrade)
  unverified <- if (NROW(best) && is_unverified(best, upgrade)) best
  open <- open_trials(upgrade)
  open <- open[!open$mechanism %in% unverified$mechanism, ]
  first <- if (!is.null(unverified))
    sprintf("%s was not verified (%s)", unverified$mechanism,
            if (is_sound(unverified, upgrade)) paste("odds of", odds(unverified$log10_bf))
            else "its numbers are not trusted")
  rough <- if (NROW(open)) rough_words(open)
  if (is.null(rough)) {
    return(if (!is.null(first)) {
      c(nearest = sprintf(paste("The mechanism %s: a larger budget (control$runs_total) would",
                                "decide it."), first))
    })
  }
  what <- if (NROW(open) + length(first) > 1) "Mechanisms remain open: " else "The mechanism "
  c(undecided = sprintf(paste("%s%s. A larger budget (control$runs_total), or narrower priors,",
                              "would decide."), what, paste(c(first, rough), collapse = "; ")))
}

rough_words <- function(open) {
  vapply(seq_len(nrow(open)), function(k) {
    wide <- open$upper95[k] - open$lower95[k]
    paste0(open$mechanism[k], " is not ruled out: ",
           if (wide > rules$too_rough) "its numbers are too rough for odds"
           else "its numbers are not trusted")
  }, "")
}

group_inspections <- function(attribution) {
  groups <- Filter(function(g) g$significant, attribution$groups)
  if (!length(groups)) return(NULL)
  several <- vapply(groups, function(g) length(g$conditions) > 2, NA)
  together <- vapply(groups, function(g) {
    if (go_together(g)) sprintf("%s go together (correlation %.2f)", listed(g$conditions),
                                g$correlation)
    else sprintf("a response to %s would do", listed(g$conditions, "or to"))
  }, "")
  apart <- vapply(groups, function(g) {
    sprintf("%s changes while %s %s", g$conditions[1], listed(g$conditions[-1]),
            if (length(g$conditions) > 2) "stay as they are" else "stays as it is")
  }, "")
  c(group = sprintf(paste("In this record %s, so that the cause may lie with %s: measure some days",
                          "on which %s."),
                    listed(together), if (any(several) || length(groups) > 1) "any of them"
                    else "either", listed(apart, "and some on which")))
}

# ---- what the error still responds to

# Conditions, each with the mechanisms left that it drives; those that ask for the same share a
# sentence.
answer_inspections <- function(upgrade, last) {
  table <- last$attribution$table
  answers <- table$boundary[table$significant & is.na(table$group)]
  left <- setdiff(names(upgrade$catalogue), unlist(lapply(upgrade$models, `[[`, "mechanism")))
  driven <- lapply(stats::setNames(nm = answers), function(name) {
    left[vapply(upgrade$catalogue[left], function(entry) name %in% entry$boundary, NA)]
  })
  open <- c(nearest_trial(upgrade)$mechanism, open_trials(upgrade)$mechanism)
  trials <- last_trials(upgrade)
  falls <- trials[is_sound(trials, upgrade) & !trials$mechanism %in% open &
                    !is.na(trials$error_ratio) & trials$error_ratio < rules$clearly_fallen, ]
  best <- as.character(falls$mechanism[order(as.numeric(falls$error_ratio))])
  fallen <- vapply(driven, function(d) best[match(TRUE, best %in% d)], "")
  undecided <- vapply(driven, function(d) listed(intersect(d, open), "or", ""), "")
  undecided[!is.na(fallen)] <- ""
  tried <- lengths(driven) > 0 & is.na(fallen) & !nzchar(undecided)
  told <- c(undecided_words(split_by(undecided[nzchar(undecided)])),
            fallen_words(split_by(fallen[!is.na(fallen)]), falls),
            tried_words(driven[tried]),
            undriven_words(answers[lengths(driven) == 0], upgrade$catalogue))
  stats::setNames(told, rep("answer", length(told)))
}

# The names of equal values together: list(value = names).
split_by <- function(values) split(names(values), factor(values, unique(values)))

undecided_words <- function(conditions) {
  sprintf("The error still responds to %s: %s may be why, and is not decided.",
          vapply(conditions, listed, ""), names(conditions))
}

fallen_words <- function(conditions, falls) {
  vapply(names(conditions), function(mechanism) {
    of <- listed(conditions[[mechanism]])
    best <- falls[match(mechanism, falls$mechanism), ]
    sprintf(paste("The error still responds to %s. With %s, which %s, the error falls to %s of",
                  "what it is, but an unknown response to %s would explain this as well (log10",
                  "Bayes factor beside it: %s).%s"),
            of, mechanism, if (length(conditions[[mechanism]]) > 1) "they drive" else "it drives",
            percent(best$error_ratio), of, signed(best$beside_unknown),
            if (NROW(best$parameters[[1]]))
              sprintf(" Check on site whether there is %s.", called_for(best$parameters[[1]]))
            else "")
  }, "")
}

tried_words <- function(driven) {
  if (!length(driven)) return(NULL)
  tried <- unique(unlist(driven))
  several <- length(driven) > 1
  sprintf(paste("The error still responds to %s. %s, which %s, %s tried but not adopted: look for",
                "another way in which %s. The best days for this are those on which %s changes",
                "and the other conditions hardly change."),
          listed(names(driven)), capital(listed(tried)), if (several) "they drive" else "it drives",
          if (length(tried) > 1) "were" else "was",
          if (several) "they act" else paste(names(driven), "acts"),
          if (several) "one of them" else "it")
}

undriven_words <- function(conditions, catalogue) {
  if (!length(conditions)) return(NULL)
  drivers <- unlist(lapply(catalogue, `[[`, "boundary"))
  sprintf(paste("The error still responds to %s, and no mechanism %s the catalogue is driven by",
                "%s: add one that is."),
          listed(conditions), if (any(conditions %in% drivers)) "left in" else "of",
          listed(conditions, "or"))
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
      c(constant = sprintf(paste("In calibration %s did not vary, so %s cannot be judged:",
                                 "calibrate on rows with changes."),
                           listed(constant), driven_by(constant)))
    },
    if (length(absent)) {
      c(driver = sprintf(
        paste("In the catalogue %s %s %s, but %s not analysed: name %s in boundary of",
              "measurements(), to see whether the error responds to %s."),
        listed(absent), if (length(absent) > 1) "drive" else "drives", driven_by(absent),
        if (length(absent) > 1) "are" else "is", if (length(absent) > 1) "them" else "it",
        if (length(absent) > 1) "them" else "it"))
    })
}
