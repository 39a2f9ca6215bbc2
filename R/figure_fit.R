# Measured and simulated, and what is gained and left: over time, in scores, over the day.

fit_title <- function(upgrade) {
  unit <- upgrade$measurements$unit
  seen <- score_of(upgrade, "calibrate", "rmse")
  held <- score_of(upgrade, "validate", "rmse")
  if (length(seen) < 2) {
    title <- paste("The calibrated model is typically wrong by", with_unit(short(seen), unit))
    return(if (anyNA(held)) title
           else paste0(title, "; on data it has not seen, by ", with_unit(short(held), unit)))
  }
  title <- paste("The typical error", change_words(seen[1], seen[2], unit))
  if (anyNA(held)) title else paste0(title, "; on data the model has not seen it ",
                                     change_words(held[1], held[2], unit))
}

figure_fit <- function(upgrade) {
  m <- upgrade$measurements
  table <- stage_table(upgrade_stages(upgrade), prediction_rows)
  panels <- c(axis_label(target_label(m), level_unit(m$unit, table$observed)),
              axis_label("error", m$unit))
  in_panel <- function(i, table) cbind(table, panel = factor(panels[i], panels))
  measured <- table[table$stage == levels(table$stage)[1], ]
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time)) +
    ggplot2::geom_hline(ggplot2::aes(yintercept = 0), in_panel(2, data.frame(zero = 0)),
                        colour = "grey40") +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$lower95, ymax = .data$upper95,
                                      fill = .data$stage,
                                      group = interaction(.data$stage, .data$part)),
                         in_panel(1, table), alpha = 0.18) +
    ggplot2::geom_point(ggplot2::aes(y = .data$observed), in_panel(1, measured),
                        colour = "grey45", size = 0.9) +
    ggplot2::geom_line(ggplot2::aes(y = .data$simulated, colour = .data$stage,
                                    group = interaction(.data$stage, .data$part)),
                       in_panel(1, table), linewidth = 0.7) +
    ggplot2::geom_line(ggplot2::aes(y = .data$residual, colour = .data$stage,
                                    group = interaction(.data$stage, .data$part)),
                       in_panel(2, table), linewidth = 0.7) +
    ggplot2::facet_grid(panel ~ use, scales = "free", space = "free_x", switch = "y",
                        labeller = ggplot2::labeller(panel = wrap_turned(2))) +
    stage_scales() +
    figure_titles(fit_title(upgrade),
                  paste("Above, grey: measured; coloured: simulated, with the band that should",
                        "hold 95 % of the measurements. Below: error = measured - simulated."),
                  x = time_label(table$time)) + time_axis(table$time) + figure_theme() +
    ggplot2::theme(panel.spacing.x = ggplot2::unit(30, "pt"))
  with_height(figure, 6.4)
}

gain_title <- function(upgrade) {
  use <- if (has_validation(upgrade)) "validate" else "calibrate"
  where <- if (use == "validate") "On data the model has not seen" else "In calibration"
  rmse <- score_of(upgrade, use, "rmse")
  inside <- score_of(upgrade, use, "coverage95")
  band <- paste(round(100 * inside[length(inside)]), "% of the measurements lie in the 95 % band")
  if (length(rmse) < 2) return(paste0(where, ", ", band))
  told <- short(rmse)
  change <- if (told[1] == told[2]) paste("stays at", with_unit(told[1], upgrade$measurements$unit))
            else sprintf("%s by %s", if (rmse[2] < rmse[1]) "falls" else "rises",
                         percent(abs(1 - rmse[2] / rmse[1])))
  sprintf("%s the error %s; %s", where, change, band)
}

figure_gain <- function(upgrade) {
  table <- gain_table(upgrade)
  target <- data.frame(panel = factor(levels(table$panel)[3], levels(table$panel)), value = 95)
  dodge <- ggplot2::position_dodge(width = 0.9)
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$use, .data$value, fill = .data$stage)) +
    ggplot2::geom_col(position = dodge, width = 0.84) +
    ggplot2::geom_text(
      ggplot2::aes(
        label = .data$label, vjust = ifelse(.data$score == "coverage95", 3, -0.35),
        colour = ifelse(.data$score == "coverage95" & .data$stage != "before", "white", "black")),
      position = dodge, size = 3.9) +
    ggplot2::scale_colour_identity() +
    ggplot2::geom_hline(ggplot2::aes(yintercept = .data$value), target, linetype = "dashed",
                        colour = "grey20") +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), scales = "free_y", ncol = 3,
                        labeller = wrap_strips(3)) +
    ggplot2::scale_x_discrete(expand = ggplot2::expansion(add = 0.5)) +
    ggplot2::scale_y_continuous(expand = ggplot2::expansion(mult = c(0, 0.14))) +
    ggplot2::scale_fill_manual(values = stage_colours) +
    figure_titles(gain_title(upgrade), paste("Lower is better for the two errors; the third should",
                                             "come near 95.")) + figure_theme() +
    ggplot2::theme(panel.grid.major = ggplot2::element_blank(),
                   strip.text = ggplot2::element_text(vjust = 1))
  with_height(figure, 5)
}

mean_day_title <- function(binned, unit, noise) {
  stages <- split(binned[binned$use == "calibration", ], binned$stage[binned$use == "calibration"])
  worst <- stages[[1]][which.max(abs(stages[[1]]$residual)), ]
  # Of 24 means of noise, hardly one lies beyond three of its standard deviations.
  if (abs(worst$residual) < 3 * noise / sqrt(worst$n))
    return("No time of day stands out from the noise")
  told <- function(r) paste(with_unit(short(abs(r)), unit), if (r > 0) "too low" else "too high")
  title <- sprintf("In calibration, around %02d:30, the simulation is on average %s",
                   floor(worst$hour), told(worst$residual))
  if (length(stages) < 2) return(title)
  after <- stages[[2]]$residual[stages[[2]]$hour == worst$hour]
  paste0(title, " before, ", told(after), " after")
}

figure_mean_day <- function(upgrade) {
  m <- upgrade$measurements
  table <- stage_table(upgrade_stages(upgrade), prediction_rows)
  table$hour <- hour_of_day(table$time, m$step_h)
  binned <- stats::aggregate(residual ~ hour + use + stage, table, mean)
  binned$n <- stats::aggregate(residual ~ hour + use + stage, table, length)$residual
  spread <- stats::aggregate(residual ~ hour + use + stage, table, stats::quantile,
                             probs = c(0.1, 0.9))
  binned[c("low", "high")] <- spread$residual
  figure <- ggplot2::ggplot(binned,
                            ggplot2::aes(.data$hour, .data$residual, colour = .data$stage,
                                         fill = .data$stage)) +
    ggplot2::geom_hline(yintercept = 0, colour = "grey40") +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$low, ymax = .data$high), alpha = 0.18,
                         colour = NA) + ggplot2::geom_line(linewidth = 1.2) +
    ggplot2::scale_x_continuous(breaks = seq(0, 24, 6), guide = apart, limits = c(0, 24)) +
    ggplot2::facet_wrap(ggplot2::vars(.data$use)) +
    stage_scales() +
    figure_titles(mean_day_title(binned, m$unit, m$noise_sd),
                  "Lines: mean of all days. Bands: eight days of ten.", x = "hour of day",
                  y = axis_label("measured - simulated", m$unit)) +
    figure_theme()
  with_height(figure, 4.6)
}

figure_measurements <- function(measurements) {
  m <- measurements
  series <- c(list(m$y), lapply(m$conditions, function(name) condition_values(m, name)))
  panels <- c(axis_label(target_label(m), level_unit(m$unit, m$y)), condition_titles(m))
  uses <- c(warmup = names(use_colours)[1], use_names, none = names(use_colours)[4])
  table <- data.frame(time = rep(m$time, length(panels)), value = unlist(series),
                      use = factor(uses[rep(m$use, length(panels))], uses),
                      panel = factor(rep(panels, each = length(m$y)), panels),
                      part = rep(paste(m$segment,
                                       cumsum(c(TRUE, m$use[-1] != m$use[-length(m$use)]))),
                                 length(panels)))
  count <- function(use) sum(m$use == use & !is.na(m$y))
  title <- sprintf("%s: %d steps of %s h to calibrate, %d held out", m$name, count("calibrate"),
                   format(m$step_h), count("validate"))
  figure <- ggplot2::ggplot(table[!is.na(table$value), ],
                            ggplot2::aes(.data$time, .data$value, colour = .data$use,
                                         group = .data$part)) +
    ggplot2::geom_line(linewidth = 0.6) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, scales = "free_y",
                        labeller = wrap_strips()) +
    ggplot2::scale_y_continuous(n.breaks = 4, guide = apart) +
    ggplot2::scale_colour_manual(values = use_colours) +
    figure_titles(title, "The target above, the boundary conditions below it.",
                  x = time_label(table$time)) + time_axis(table$time) + figure_theme()
  with_height(figure, 1.6 + 1.15 * length(panels))
}
