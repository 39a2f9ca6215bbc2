# Tables of the diagnosis, as the report and the inspections show them.

# Parameters that shorter steps would move beyond their uncertainty.
step_moved <- function(model) {
  moved <- step_moves(model)
  parameter_labels(model$fit, unique(names(moved)[abs(moved) > rules$largest_move]))
}

step_moved_words <- function(model) {
  moved <- step_moved(model)
  if (length(moved)) sprintf("%s %s by more than a standard deviation", listed(moved),
                             if (length(moved) > 1) "move" else "moves")
}

# The parameters that each adopted mechanism brought, as the last model sees them.
changes_table <- function(upgrade) {
  models <- upgrade$models
  last <- parameters_words(models[[length(models)]]$fit)
  rows <- lapply(seq_along(models)[-1], function(k) {
    new <- setdiff(names(drawn_parameters(models[[k]]$fit)),
                   names(drawn_parameters(models[[k - 1]]$fit)))
    brought <- last[last$name %in% new, ]
    if (nrow(brought)) cbind(mechanism = models[[k]]$mechanism, brought)
  })
  do.call(rbind, rows)
}

parameters_words <- function(fit) {
  rows <- parameter_rows(fit)
  calibrated <- data.frame(
    name = rows$name, parameter = rows$label, unit = pretty_unit(rows$unit),
    median = short(rows$median, 3), "95 % interval" = intervals_words(fit), check.names = FALSE,
    row.names = NULL)
  physical <- physical_words(fit)
  if (!is.null(physical)) calibrated[["physical value"]] <- physical
  cbind(calibrated,
        data.frame(
          "range thought possible" = interval_words(rows$prior_lower, rows$prior_upper, 3),
          note = ifelse(rows$at_edge, "at the edge", ""), check.names = FALSE, row.names = NULL))
}

# Where physical values lie, of each mode.
physical_words <- function(fit) {
  modes <- mode_rows(fit)
  physical <- physical_ends(fit, modes)
  if (!is.null(physical)) listed_of_each(physical$lower, physical$upper, modes$name)
}

# The two parameters that what is missing may bias most, if that is known.
bias_sentence <- function(fit) {
  told <- "The parameters may make up for what is missing: "
  physical <- physical_intervals(fit)
  rows <- parameter_rows(fit)
  wider <- (physical$upper - physical$lower) / (rows$upper95 - rows$lower95)
  most <- utils::head(intersect(order(-wider), which(wider > 1)), 2)
  if (!length(most)) return(paste0(told, "their values may be biased."))
  values <- sprintf("%s may lie anywhere from %s (calibrated: %s)", rows$label[most],
                    with_unit(interval_words(physical$lower[most], physical$upper[most], 3),
                              rows$unit[most]),
                    interval_words(rows$lower95[most], rows$upper95[most], 3))
  paste0(told, "the physical value of ", listed(values, "and that of"), ".")
}

# The 95 % interval of each parameter, or those of its modes.
intervals_words <- function(fit) {
  modes <- mode_rows(fit)
  listed_of_each(modes$lower, modes$upper, modes$name)
}

listed_of_each <- function(lower, upper, name) {
  words <- interval_words(lower, upper, 3)
  unname(vapply(split(words, factor(name, unique(name))), listed, "", "or"))
}

scores_table <- function(upgrade) {
  table <- gain_table(upgrade)
  values <- stats::xtabs(
    seq_len(nrow(table)) ~ paste(table$panel, table$use, sep = ", ") + table$stage)
  keys <- unique(paste(table$panel, table$use, sep = ", "))
  columns <- lapply(levels(table$stage), function(s) as.character(table$label[values[keys, s]]))
  cbind(score = keys, as.data.frame(stats::setNames(columns, levels(table$stage)), optional = TRUE))
}

candidates_words <- function(upgrade) {
  if (is.null(upgrade$candidates)) return(NULL)
  table <- candidate_table(upgrade)
  if (!nrow(table)) return(NULL)
  table <- table[order(table$step, -table$log10_bf), ]
  drives <- vapply(table$mechanism,
                   function(name) paste(upgrade$catalogue[[name]]$boundary, collapse = ", "), "")
  decision <- decision_words(table, upgrade$control$decisive)
  sound <- is_sound(table, upgrade)
  factor <- same_decimals(table$log10_bf, table$lower95, table$upper95, "+")
  data.frame(step = table$step, mechanism = table$mechanism, "driven by" = drives,
             "log10 Bayes factor" = factor$estimate,
             "95 % interval" = paste(factor$lower, "to", factor$upper),
             evidence = ifelse(sound, table$word, ""),
             "beside an unknown response" = signed(table$beside_unknown),
             "with no unknown response" = signed(table$standing),
             probability = ifelse(startsWith(decision, "refused") | !sound, "",
                                  percent(table$probability)),
             "error in calibration" = error_words(table$error_ratio),
             estimate = ifelse(!sound, "rough",
                               ifelse(table$judged_by == "runs", "verified", "trial")),
             decision = decision, check.names = FALSE, row.names = NULL)
}

# Why each mechanism was adopted or not.
decision_words <- function(table, decisive) {
  words <- ifelse(table$judged_by == "trial", "not verified", "too uncertain")
  words[table$step %in% table$step[table$adopted]] <- "another one is better"
  words[is_refuted(table)] <- "refused: an unknown response does better"
  words[keeps_error(table)] <- "refused: the error does not fall by 1 %"
  words[table$log10_bf < decisive] <- "too weak"
  words[table$adopted] <- "adopted"
  words
}

# Over that of the model before.
error_words <- function(ratio) ifelse(is.na(ratio), "", paste(short(ratio), "times"))

# The scores of each of several records, in its own unit.
record_scores <- function(upgrade) {
  names <- names(upgrade$measurements$records)
  tables <- lapply(names,
                   function(name) cbind(record = name, scores_table(record_upgrade(upgrade, name))))
  columns <- unique(unlist(lapply(tables, names)))
  do.call(rbind, lapply(tables, function(table) {
    table[setdiff(columns, names(table))] <- ""
    table[columns]
  }))
}

# What each adopted model was computed with; of several records each has a column.
method_table <- function(upgrade) {
  value <- function(fit) {
    unit <- fit$measurements$unit
    c(length(fit$rows), ncol(fit$emulator$basis$vectors), nrow(fit$emulator$processes$inputs),
      with_unit(short(c(fit$measurements$noise_sd, fit$emulator$basis$discarded_rms)), unit),
      evidence_words(fit, "+"),
      fit$check$verdict %||% "not checked", fit$trust$verdict)
  }
  columns <- unlist(lapply(upgrade$models, function(model) {
    fits <- record_fits(model$fit)
    stats::setNames(lapply(fits, value),
                    paste0(model$name, if (length(names(fits))) paste(":", names(fits))))
  }), recursive = FALSE)
  cbind(quantity = c("calibration steps, N", "vectors of the simulation space, Q",
                     "runs of the simulator, M", "stated measurement noise",
                     "part of the runs that the Q vectors leave out (RMS)",
                     "log10 evidence [95 % interval]", "emulator", "trust"),
        as.data.frame(columns, optional = TRUE))
}
