# What the trials of a step are worth, as a table, and which mechanism is adopted.

# A row for each mechanism that was tried or left out by the budget.
trial_table <- function(trials, present, left, decisive) {
  rows <- lapply(trials, trial_row, present)
  missed <- lapply(setdiff(left, names(trials)), function(name) empty_row(name, present, "none"))
  table <- do.call(rbind, c(unname(rows), missed))
  table$probability <- probability_of(table, decisive)
  rownames(table) <- NULL
  table
}

# Of each mechanism, if these and no change were equally probable beforehand. The best trial has the
# odds of its factor against no change; the others have those of their standing against it.
probability_of <- function(table, decisive) {
  best <- best_trial(table, decisive)
  log10_odds <- if (nrow(best)) best$log10_bf + table$standing - best$standing else table$log10_bf
  log10_odds[is.na(log10_odds)] <- -Inf
  odds <- 10^(c(0, log10_odds) - max(0, log10_odds))
  (odds / sum(odds))[-1]
}

trial_row <- function(trial, present) {
  if (is.null(trial$fit)) return(empty_row(trial$mechanism, present, trial$level, trial$own_runs))
  factor <- bayes_factor(trial$fit, present$fit)
  beside <- factor$log10_bf
  shifted <- c("log10_bf", "lower95", "upper95")
  if (is_emulated(trial)) factor[shifted] <- factor[shifted] + (trial$taken %||% 0)
  factor$word <- evidence_word(factor$lower95, factor$upper95)
  if (!is_verified(trial)) factor <- as_tried(factor, trial)
  factor <- readable(factor)
  row <- data.frame(
    from = present$name, mechanism = trial$mechanism, factor, beside_unknown = beside,
    standing = standing_of(trial, present), error_ratio = error_ratio(trial$fit, present$fit),
    trusted = trial$fit$trust$trusted, judged_by = if (is_verified(trial)) "runs" else "trial",
    runs = trial$own_runs %||% 0)
  row$parameters <- list(added_parameters(trial$fit, present$fit))
  row
}

# Whether its evidence is that of its mode, though there may be another mode.
is_emulated <- function(trial) {
  all(vapply(record_fits(trial$fit), function(fit) fit_trust(fit)$trusted, NA))
}

empty_row <- function(mechanism, present, why, runs = NULL) {
  row <- data.frame(from = present$name, mechanism = mechanism, log10_bf = NA_real_,
                    lower95 = NA_real_, upper95 = NA_real_, word = NA_character_,
                    beside_unknown = NA_real_, standing = NA_real_, error_ratio = NA_real_,
                    trusted = FALSE, judged_by = if (why == "silent") "silent" else "none",
                    runs = runs %||% 0)
  row$parameters <- list(added_parameters(present$fit, present$fit))
  row
}

# An interval that is too rough for odds says so by its width, and no more than that.
readable <- function(row) {
  row$lower95 <- max(row$lower95, row$log10_bf - 2 * rules$too_rough)
  row$upper95 <- min(row$upper95, row$log10_bf + 2 * rules$too_rough)
  row
}

# The interval of a trial allows for what its few runs may have missed.
as_tried <- function(row, trial) {
  margin <- trial_margin(trial)
  row$lower95 <- row$lower95 - margin
  row$upper95 <- row$upper95 + margin
  row$word <- evidence_word(row$lower95, row$upper95)
  row
}

# Beside an unknown response to its conditions a mechanism that is the cause may gain little, as the
# response imitates it; it must not lose decisively.
is_refuted <- function(table) !is.na(table$beside_unknown) & speaks_against(table$beside_unknown)

keeps_error <- function(table) !is.na(table$error_ratio) & table$error_ratio > rules$fallen_error

# Estimates of the parameters that a mechanism brought with it.
added_parameters <- function(fit, parent) {
  table <- parameter_table(fit)
  table$label <- parameter_labels(fit, table$name)
  table[!table$name %in% names(drawn_parameters(parent)), ]
}

# The row of highest standing among the decisive mechanisms that may be adopted: they were verified,
# the simulation's own error falls with them, and they do not lose to an unknown response. If none
# is decisive, that of the highest factor; no row if none may be adopted.
best_trial <- function(table, decisive) {
  open <- table[table$judged_by == "runs" & !keeps_error(table) & !is_refuted(table), ]
  sure <- open[open$log10_bf >= decisive & open$lower95 > 0, ]
  if (nrow(sure)) sure[which.max(sure$standing), ] else open[which.max(open$log10_bf), ]
}

may_be_adopted <- function(best, decisive) {
  nrow(best) > 0 && best$log10_bf >= decisive && best$lower95 > 0
}

# The row of the mechanism to adopt, or NULL.
to_adopt <- function(trials, present, context) {
  if (!length(trials)) return(NULL)
  decisive <- context$control$decisive
  best <- best_trial(trial_table(trials, present, names(trials), decisive), decisive)
  if (may_be_adopted(best, decisive)) best
}
