# What each mechanism brought.

steps_table <- function(upgrade) {
  models <- upgrade$models
  told <- vapply(seq_along(models), function(k)
    if (k == 1) models[[1]]$name else paste("+", models[[k]]$mechanism), "")
  rows <- lapply(seq_along(models), function(k) {
    data.frame(step = told[k], use = names(use_names),
               rmse = vapply(names(use_names),
                             function(use) models[[k]]$scores[[use]][["rmse"]], 0))
  })
  table <- do.call(rbind, rows)
  table$step <- factor(table$step, rev(told))
  table$use <- factor(use_names[table$use], use_names)
  table[!is.na(table$rmse), ]
}

figure_steps <- function(upgrade) {
  if (length(upgrade$models) < 2)
    return(figure_of_nothing("No mechanism was adopted, so that nothing was gained"))
  m <- upgrade$measurements
  table <- steps_table(upgrade)
  use <- levels(droplevels(table$use))
  shown <- table[table$use == use[length(use)], ]
  drop <- -diff(shown$rmse)
  best <- which.max(drop)
  change <- change_words(shown$rmse[best], shown$rmse[best + 1], m$unit)
  title <- if (!startsWith(change, "falls"))
             sprintf("No step lowers the typical error (%s)", use[length(use)])
           else sprintf("%s %s: the typical error (%s) %s",
                        sub("^\\+ ", "", as.character(shown$step[best + 1])),
                        if (length(drop) > 1) "brings most" else "lowers the error",
                        use[length(use)], change)
  noise <- if (any(table$rmse < m$noise_sd))
             paste("the stated noise; errors left of it suggest that the measurements are less",
                   "noisy than stated.")
           else "the stated noise, about the smallest error that can be expected."
  figure <- ggplot2::ggplot(
    table, ggplot2::aes(.data$rmse, .data$step, colour = .data$use, shape = .data$use)) +
    ggplot2::geom_vline(xintercept = m$noise_sd, linetype = "dashed", colour = "grey20") +
    ggplot2::geom_path(ggplot2::aes(group = .data$use), linewidth = 0.8) +
    ggplot2::geom_point(size = 4) +
    ggplot2::scale_colour_manual(values = use_colours) +
    ggplot2::scale_shape_manual(values = c("calibration" = 19, "held out" = 17)) +
    ggplot2::scale_x_continuous(limits = c(0, NA), guide = apart) +
    ggplot2::scale_y_discrete(labels = wrap_labels(0.3)) +
    figure_titles(title, paste("Each row adds one mechanism to the row above. Dashed:", noise),
                  x = axis_label("typical error, RMSE", m$unit)) +
    figure_theme()
  with_height(figure, 2.6 + 0.6 * nlevels(table$step))
}
