# What to inspect next to settle what a result leaves open: sentences that say what to measure, look
# at or compute, each from something that the result knows. Their names are the ids that rank them
# (`inspection_order`). What asks for the same action is one sentence, whatever it is about.

upgrade_inspections <- function(upgrade) {
  last <- upgrade$models[[length(upgrade$models)]]
  adopted <- adopted_models(upgrade)
  told <- c(trust_inspections(upgrade$models),
            record_inspection(upgrade),
            held_out_inspection(last, upgrade$measurements),
            step_inspection(upgrade, adopted, last),
            cause_inspections(upgrade, adopted),
            budget_inspections(upgrade),
            nearest_inspection(upgrade),
            group_inspections(last$attribution),
            answer_inspections(upgrade, last),
            driver_inspections(upgrade),
            edge_inspections(last$fit),
            sensor_inspections(upgrade, adopted, last),
            part_inspection(last, upgrade$measurements),
            spike_inspection(last, upgrade$measurements),
            if (upgrade$stopped_id == "steps") {
              c(steps = paste("Further causes were not looked for: raise control$max_steps and run",
                              "the loop again."))
            })
  if (length(told)) ranked(told)
  else c(nothing = paste("Nothing that this record could settle is open. The next test is a record",
                         "of another season or another use."))
}

# What is asked for one adopted mechanism.
mechanism_inspections <- function(upgrade, model) {
  ranked(c(step_inspection(upgrade, list(model)), cause_inspections(upgrade, list(model)),
           drift_inspection(upgrade, list(model))))
}

calibration_inspections <- function(fit, model = NULL) {
  ranked(c(
    read_findings(list(list(fit = fit)), fit$measurements),
    trust_inspections(list(list(fit = fit, name = "the model"))),
    if (!is.null(model)) held_out_inspection(model, fit$measurements),
    edge_inspections(fit), tied_inspections(fit), loose_inspections(fit),
    if (!is.null(model)) remainder_inspection(model, fit$measurements),
    if (!is.null(model)) part_inspection(model, fit$measurements),
    if (!is.null(model)) spike_inspection(model, fit$measurements),
    cause = paste("A calibration does not show what its error responds to, or what may cause it:",
                  "attribute_discrepancy() asks the first, upgrade_model() with a catalogue of",
                  "mechanisms the second.")))
}

comparison_inspections <- function(comparison) {
  best <- comparison$models[[best_model(comparison)]]
  attribution <- comparison$tables$attribution
  answers <- attribution$boundary[attribution$model == best$name & attribution$significant]
  ranked(c(
    read_findings(unname(comparison$models), comparison$measurements),
    trust_inspections(unname(comparison$models)),
    separation_inspection(comparison),
    held_out_inspection(best, comparison$measurements),
    edge_inspections(best$fit),
    if (length(answers)) {
      c(answers = sprintf(paste("Even %s leaves an error that responds to %s: ask",
                                "upgrade_model() for the cause, with mechanisms driven by",
                                "%s."), best$name, listed(answers), listed(answers, "or")))
    }))
}

# ---- can the numbers be trusted

trust_inspections <- function(models) {
  models <- do.call(c, unname(lapply(models, fits_by_name)))
  refuted <- Filter(function(m) isFALSE(m$fit$check$passed), models)
  sampled <- Filter(function(m) m$samples, models)  # of several records one sampler counts
  sticks <- vapply(sampled, function(m) !sampler_said(m$fit)$trusted, NA)
  other <- Filter(function(m) !m$fit$trust$trusted && !isFALSE(m$fit$check$passed),
                  sampled[!sticks])
  c(if (length(refuted)) emulator_inspection(refuted),
    if (any(sticks)) sampler_inspection(sampled[sticks]),
    if (length(other)) numbers_inspection(other))
}

# The fit of each record, with the name that it has in sentences; `samples`: its sampler counts.
fits_by_name <- function(model) {
  if (!inherits(model$fit, "amiss_joint"))
    return(list(list(name = model$name, fit = model$fit, samples = TRUE)))
  fits <- record_fits(model$fit)
  Map(function(fit, record, samples)
        list(name = paste(model$name, record, sep = ", "), fit = fit, samples = samples),
      fits, names(model$fit$records), seq_along(fits) == 1)
}

# "The emulator of a is not trusted (why)", or the same of several.
untrusted_words <- function(one, several, models, why) {
  names <- vapply(models, `[[`, "", "name")
  if (length(models) == 1) sprintf("The %s %s is not trusted (%s)", one, names, why)
  else sprintf("The %s %s are not trusted", several, listed(sprintf("%s (%s)", names, why)))
}

emulator_inspection <- function(models) {
  why <- vapply(models, function(m) m$fit$check$verdict, "")
  runs <- vapply(models, function(m) nrow(m$fit$emulator$processes$inputs), 0L)
  more <- if (is.null(models[[1]]$fit$emulator$simulator)) "give more runs where the posterior lies"
          else sprintf("make more runs (%s now)", listed(format_each_comma(runs)))
  c(emulator = sprintf("%s: %s before anything is read from %s numbers.",
                       untrusted_words("emulator of", "emulators of", models, why), more,
                       if (length(models) > 1) "their" else "its"))
}

sampler_inspection <- function(models) {
  why <- vapply(models, function(m) listed(sampler_said(m$fit)$why), "")
  chains <- unique(vapply(models, function(m) as.integer(m$fit$control$ais$pilot_chains), 0L))
  c(sampler = sprintf("%s: give %s more chains (pilot_chains, %s now).",
                      untrusted_words("sampler's result for", "sampler's results for", models,
                                       why),
                      if (length(models) > 1) "them" else "it", listed(chains)))
}

# Searches that do not agree, or a mode at which no draw lies.
numbers_inspection <- function(models) {
  why <- vapply(models, function(m) listed(m$fit$trust$why), "")
  c(numbers = sprintf("%s: %s.", untrusted_words("result for", "results for", models, why),
                      if (any(grepl("budget", why))) "give a larger budget (control$runs_total)"
                      else "run it again with another seed and more chains (pilot_chains)"))
}

# ---- the record

# The faults themselves stand with the verdict.
record_inspection <- function(upgrade) {
  ids <- names(record_faults(upgrade))
  if (length(ids)) {
    c(record = sprintf("Correct the record first, then run the loop again. The record has %s.",
                       listed(unique(unname(fault_words[ids])))))
  }
}

held_out_inspection <- function(model, measurements) {
  if (is.na(model$scores$validate[["rmse"]])) {
    return(c(held_out = sprintf(
      paste("No data were held out, so no change was tested on other data. Measure %s more of %s",
            "and its conditions and hold them out (argument validate of measurements()), or keep a",
            "part of this record from calibration."),
      calibrated_words(measurements, rules$held_out_length) %||% "some days",
      target_label(measurements))))
  }
  excess <- held_out_excess(model, measurements)
  if (is.null(excess)) return(NULL)
  beyond <- sort(uncovered_conditions(measurements, model$fit), decreasing = TRUE)
  where <- if (!length(beyond))
             ": compare the two periods for what else differs: settings, use, sensors."
           else sprintf(
             paste(". There %s %s outside of what calibration saw: measure some days with such",
                   "values and calibrate on them too.%s"),
             listed(sprintf("%s (%s of the steps)", names(beyond), percent(beyond))),
             if (length(beyond) > 1) "lie" else "lies",
             if (remaining_error(model, measurements)$large)
               " What is missing may also act more there."
             else "")
  c(held_out = sprintf("On held-out data the error is %s times that in calibration%s",
                       short(excess), where))
}

# How many times as large as in calibration the error on data held out is; NULL where it is no
# larger than that, or the noise, asks for.
held_out_excess <- function(model, measurements) {
  seen <- model$scores$calibrate[["rmse"]]
  held <- model$scores$validate[["rmse"]]
  asked <- rules$held_out_error * max(seen, measurements$noise_sd)
  if (is.na(held) || held < asked) NULL else held / seen
}

# Share of the held-out steps at which a condition that the model reads lies outside of its range in
# calibration, where that is much.
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
  read <- if (is.null(simulator)) names(share)
          else condition_label(measurements, driver_names(simulator))
  share <- stats::setNames(share, condition_label(measurements, names(share)))
  share[share >= rules$outside_share & !turning & names(share) %in% read]
}

# ---- the parameters

edge_inspections <- function(fit) {
  rows <- parameter_rows(fit)
  rows <- rows[rows$at_edge, ]
  if (!nrow(rows)) return(NULL)
  upper <- abs(rows$prior_upper - rows$median) < abs(rows$median - rows$prior_lower)
  side <- ifelse(upper, "upper", "lower")
  end <- with_unit(short(ifelse(upper, rows$prior_upper, rows$prior_lower)), rows$unit)
  c(edge = if (nrow(rows) == 1) {
    sprintf(paste("The parameter %s lies at the %s end of its prior (%s): measure it, or widen the",
                  "prior if %s is possible; otherwise it makes up for something else."),
            rows$label, side, end, if (upper) "more" else "less")
  } else {
    sprintf(paste("Parameters lie at an end of their priors: %s. Measure them, or widen the priors",
                  "if values beyond are possible; otherwise they make up for something else."),
            listed(sprintf("%s (%s end, %s)", rows$label, side, end)))
  })
}

# Pairs of parameters that the record cannot distinguish.
tied_inspections <- function(fit) {
  r <- posterior_correlation(fit)
  if (ncol(r) < 2) return(NULL)
  pairs <- which(abs(r) > rules$tied & upper.tri(r), arr.ind = TRUE)
  label <- parameter_labels(fit, colnames(r))
  a <- label[pairs[, 1]]
  b <- label[pairs[, 2]]
  if (!nrow(pairs)) return(NULL)
  c(tied = if (nrow(pairs) == 1) {
    sprintf(paste("The estimates of %s and %s are correlated (%.2f): a measurement of either would",
                  "narrow both."), a, b, r[pairs])
  } else {
    sprintf("Estimates are correlated: %s. A measurement of one of a pair would narrow both.",
            listed(sprintf("%s with %s (%.2f)", a, b, r[pairs])))
  })
}

loose_inspections <- function(fit) {
  left <- narrowing(fit)
  loose <- names(left)[left > rules$loose]
  if (length(loose)) {
    c(loose = sprintf(paste("The record says little about %s: %s is still the prior's; if it",
                            "matters, measure it or find a record in which it shows."),
                      listed(loose), if (length(loose) > 1) "their range" else "its range"))
  }
}

# ---- what is left of the error

# What a second sensor would show: a drift, and whether the stated noise is right.
sensor_inspections <- function(upgrade, adopted, last) {
  drift <- drift_inspection(upgrade, adopted)
  left <- remainder_inspection(last, upgrade$measurements,
                               if (length(drift)) "the same second sensor" else "a second sensor")
  if (!length(drift) || !"noise" %in% names(left)) return(c(drift, left))
  c(drift = paste(drift, left[["noise"]]), left[names(left) != "noise"])
}

drift_inspection <- function(upgrade, adopted) {
  doubted <- function(doubt) {
    held <- vapply(adopted, function(m) doubt %in% names(m$doubts), NA)
    vapply(adopted[held], `[[`, "", "mechanism")
  }
  drift <- doubted("drift")
  shows <- c(if (length(drift))
               sprintf("a drift of the sensor would explain the error as well as %s",
                       listed(drift, "or")),
             if (length(doubted("slow")))
               "the comparison shows whether the sensor drifts or what it measures changes")
  if (!length(shows)) return(NULL)
  over <- calibrated_words(upgrade$measurements)
  c(drift = sprintf("Compare the sensor of %s with a second one from time to time%s: %s.",
                    target_label(upgrade$measurements),
                    if (is.null(over)) "" else sprintf(" over %s or more", over),
                    paste(shows, collapse = "; ")))
}

remainder_inspection <- function(model, measurements, sensor = "a second sensor") {
  views <- each_view(model, measurements)
  left <- lapply(views, function(view) remaining_error(view$model, view$measurements))
  large <- vapply(left, `[[`, NA, "large")
  pattern <- lengths(lapply(left, `[[`, "pattern")) > 0
  small <- !large & vapply(left, `[[`, 0, "ratio") < rules$small_remainder
  c(if (any(large & !pattern))
      c(noise = noise_words(views[large & !pattern], left[large & !pattern], sensor)),
    if (any(large & pattern)) pattern_inspections(left[large & pattern]),
    if (any(small)) {
      c(small_noise = sprintf(paste("The remaining error is only %s: if the sensor is that good,",
                                    "state less noise, and causes that now hide in it will show."),
                              noise_times(views[small], left[small])))
    })
}

noise_times <- function(views, left) {
  noise <- vapply(views, function(view)
    with_unit(short(view$measurements$noise_sd), view$measurements$unit), "")
  listed(paste0(short(vapply(left, `[[`, 0, "ratio")), " times the stated noise of ", noise,
                if (length(names(left))) paste(" in", names(left))))
}

noise_words <- function(views, left, sensor) {
  answers <- vapply(views, function(view) any(view$model$attribution$table$significant), NA)
  sprintf(paste("The remaining error is %s: check that noise with %s for some days. If it is",
                "right, something is still missing from the model%s."),
          noise_times(views, left), sensor,
          if (any(answers)) ""
          else paste(", perhaps something that acts through two conditions at once or by",
                     "thresholds, which an attribution does not show"))
}

# Records with the same place to look share a sentence.
pattern_inspections <- function(left) {
  where <- vapply(left, function(l) l$pattern$where, "")
  what <- paste0(if (length(names(left))) paste0("in ", names(left), ": "),
                 vapply(left, function(l) l$pattern$what, ""))
  told <- vapply(unique(where), function(place) {
    sprintf("The error that remains has a pattern: %s. %s",
            paste(what[where == place], collapse = "; "), place)
  }, "")
  stats::setNames(told, rep("pattern", length(told)))
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
                             "simulations differ most (by %s) at %s. The difference grows if %s is",
                             "%s: measure under such conditions."),
                       best$model, best$against, with_unit(short(apart[at]), m$unit),
                       paste0(if (is.numeric(a$time)) "hour ", format(a$time[at])),
                       name, if (conditions[[name]] > 0) "higher" else "lower"))
}
