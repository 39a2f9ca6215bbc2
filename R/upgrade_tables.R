# What the figures and the words of an upgrade are both made of.

stage_names <- c("before", "after", "the model")

# The first and the last model, or the only one.
upgrade_stages <- function(upgrade) {
  k <- length(upgrade$models)
  if (k < 2) list("the model" = upgrade$models[[1]]) else list(before = upgrade$models[[1]],
                                                               after = upgrade$models[[k]])
}

# One table for each stage, bound with a factor `stage` in front.
stage_table <- function(stages, table_of) {
  tables <- Map(function(s, name) {
    table <- table_of(s)
    cbind(stage = rep(name, nrow(table)), table)
  }, stages, names(stages))
  table <- do.call(rbind, unname(tables))
  table$stage <- factor(table$stage, stage_names)
  droplevels(table)
}

leading_condition <- function(upgrade) {
  m <- upgrade$measurements
  name <- upgrade$models[[1]]$attribution$table$boundary[1]
  list(name = name, title = condition_titles(m, name), time = m$time,
       value = condition_values(m, name))
}

use_names <- c(calibrate = "calibration", validate = "held out")

# Prediction of a model at its calibration and held-out rows, with the residual.
prediction_rows <- function(model) {
  p <- model$prediction
  data.frame(time = p$time, use = factor(use_names[p$use], use_names),
             part = paste(p$use, p$segment), observed = p$observed, simulated = p$mean,
             lower95 = p$lower95, upper95 = p$upper95, residual = p$observed - p$mean,
             row = seq_len(nrow(p)))
}

score_of <- function(upgrade, use, score)
  vapply(upgrade_stages(upgrade), function(s) s$scores[[use]][[score]], 0)

has_validation <- function(upgrade) !anyNA(score_of(upgrade, "validate", "rmse"))

gain_table <- function(upgrade) {
  unit <- pretty_unit(upgrade$measurements$unit)
  panels <- c(rmse = axis_label("typical error, RMSE", unit),
              crps = axis_label("error of the prediction with its band, CRPS", unit),
              coverage95 = "measurements inside the 95 % band [%]")
  table <- stage_table(upgrade_stages(upgrade), function(s) {
    rows <- expand.grid(score = names(panels), use = names(use_names), stringsAsFactors = FALSE)
    rows$value <- mapply(function(score, use) s$scores[[use]][[score]], rows$score, rows$use)
    rows
  })
  percent_rows <- table$score == "coverage95"
  table$value[percent_rows] <- 100 * table$value[percent_rows]
  table$label <- ifelse(percent_rows, round(table$value), short(table$value))
  table$panel <- factor(panels[table$score], panels)
  table$use <- factor(use_names[table$use], use_names)
  table[!is.na(table$value), ]
}

# Whether the numbers of trials and of the models they extend can be trusted.
is_sound <- function(rows, upgrade) {
  sure <- Filter(function(model) model$fit$trust$trusted, upgrade$models)
  rows$trusted & rows$from %in% vapply(sure, `[[`, "", "name")
}

# Every trial that has a number, with its step and whether it was adopted there.
candidate_table <- function(upgrade) {
  table <- upgrade$candidates[!is.na(upgrade$candidates$log10_bf), ]
  steps <- unique(upgrade$candidates$from)
  adopted <- as.character(unlist(lapply(upgrade$models, `[[`, "mechanism")))
  table$step <- match(table$from, steps)
  table$adopted <- table$mechanism == adopted[table$step] & !is.na(adopted[table$step])
  table
}
