# The discrepancy over time and against the leading boundary condition.

discrepancy_title <- function(table) {
  size <- vapply(split(table$discrepancy, table$stage), function(d) sqrt(mean(d^2)), 0)
  unit <- attr(table, "unit")
  if (length(size) < 2)
    paste("The part of the error that responds to boundary conditions is typically",
          with_unit(short(size), unit))
  else paste("The part of the error that responds to boundary conditions",
             change_words(size[1], size[2], unit))
}

# Discrepancies over time, one panel each on a common scale, and the leading boundary condition
# below them.
figure_discrepancy <- function(discrepancies, leading = NULL) {
  unit <- discrepancies[[1]]$unit
  table <- stage_table(discrepancies, function(d) cbind(d$series, segment = d$segment))
  attr(table, "unit") <- unit
  stage_panel <- paste0(ifelse(levels(table$stage) == "the model", "error", levels(table$stage)),
                        if (nzchar(unit)) paste0(" [", pretty_unit(unit), "]"))
  panels <- c(stage_panel, leading$name)
  table$panel <- factor(stage_panel[as.integer(table$stage)], panels)
  reach <- range(table$residual, table$lower95, table$upper95)
  corners <- expand.grid(time = table$time[1], y = reach, panel = factor(stage_panel, panels))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time)) +
    ggplot2::geom_blank(ggplot2::aes(y = .data$y), corners) +
    ggplot2::geom_hline(ggplot2::aes(yintercept = 0), corners, colour = "grey40") +
    ggplot2::geom_line(ggplot2::aes(y = .data$residual, group = .data$segment), colour = "grey60",
                       linewidth = 0.6) +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$lower95, ymax = .data$upper95,
                                      fill = .data$stage, group = .data$segment), alpha = 0.3) +
    ggplot2::geom_line(ggplot2::aes(y = .data$discrepancy, colour = .data$stage,
                                    group = .data$segment), linewidth = 0.9) +
    leading_layer(leading, table, panels) +
    ggplot2::facet_grid(panel ~ ., scales = "free_y", switch = "y",
                        labeller = wrap_turned(length(panels))) + stage_scales() +
    figure_titles(discrepancy_title(table),
                  paste0("Grey: measured - simulated, at the posterior mean of the parameters. ",
                         "Coloured: the discrepancy, which responds to boundary conditions, with ",
                         "95 % band.",
                         if (!is.null(leading))
                           paste0(" Below: ", leading$name, ", which leads.")),
                  x = time_label(table$time)) +
    time_axis(table$time) + figure_theme() + ggplot2::theme(legend.position = "none")
  with_height(figure, 1.8 + 1.9 * length(panels))
}

leading_layer <- function(leading, table, panels) {
  if (is.null(leading)) return(NULL)
  time <- leading$time
  shown <- time %in% table$time
  series <- data.frame(time = time[shown], value = leading$value[shown],
                       panel = factor(leading$name, panels))
  series$part <- cumsum(
    c(TRUE, diff(as.numeric(series$time)) > 1.5 * stats::median(diff(as.numeric(series$time)))))
  ggplot2::geom_line(ggplot2::aes(y = .data$value, group = .data$part), series, colour = "grey25",
                     linewidth = 0.7)
}

response_title <- function(binned, name, noise) {
  swing <- vapply(split(binned$residual, binned$stage), function(r) diff(range(r)), 0)
  if (all(swing < 2 * noise)) return(paste("The error hardly depends on", name))
  if (length(swing) < 2) return(paste("How the error changes with", name))
  if (swing[2] < 0.7 * swing[1])
    paste("The error depends on", name, "before the change, and less after it")
  else paste("The error depends on", name, "about as much after the change as before")
}

# Mean error in classes of the leading boundary condition; classes of fewer than five steps are left
# out.
figure_response <- function(upgrade, classes = 10) {
  leading <- leading_condition(upgrade)
  m <- upgrade$measurements
  table <- stage_table(upgrade_stages(upgrade), prediction_rows)
  table$value <- leading$value[match(table$time, leading$time)]
  table$class <- cut(table$value, classes)
  binned <- stats::aggregate(cbind(residual, value) ~ class + stage, table, mean)
  binned <- binned[stats::aggregate(residual ~ class + stage, table, length)$residual >= 5, ]
  figure <- ggplot2::ggplot(binned,
                            ggplot2::aes(.data$value, .data$residual, colour = .data$stage)) +
    ggplot2::geom_point(data = table, alpha = 0.18, size = 1.4, shape = 16) +
    ggplot2::geom_hline(yintercept = 0, colour = "grey40") +
    ggplot2::geom_line(linewidth = 1.2) +
    ggplot2::geom_point(size = 3.6) +
    stage_scales() +
    figure_titles(response_title(binned, leading$name, m$noise_sd),
                  paste0("Small points: every time step. Large points: means over classes ",
                         "of ", leading$name, "."),
                  x = condition_titles(m, leading$name),
                  y = axis_label("measured - simulated", m$unit)) +
    figure_theme()
  with_height(figure, 5)
}

# The response that the model lacks, of each of the leading conditions, in the unit of the target:
# first of those that are significant in the `attribution`, if there is one. What is below a
# hundredth of the largest is a flat line, and left out.
figure_missing <- function(discrepancy, attribution = NULL, stage = "the model", most = 4) {
  responses <- discrepancy$responses
  size <- sqrt(colMeans(responses^2))
  first <- names(size) %in% if (!is.null(attribution)) significant_conditions(attribution$table)
  shown <- utils::head(names(size)[order(!first, -size)], most)
  shown <- shown[size[shown] >= 0.01 * max(size)]
  table <- data.frame(time = rep(discrepancy$series$time, length(shown)),
                      value = as.numeric(responses[, shown]),
                      panel = factor(rep(shown, each = nrow(responses)), shown),
                      part = rep(discrepancy$segment, length(shown)))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time, .data$value, group = .data$part)) +
    ggplot2::geom_hline(yintercept = 0, colour = "grey40") +
    ggplot2::geom_line(colour = stage_colours[[stage]], linewidth = 0.9) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, labeller = wrap_strips()) +
    figure_titles(
      sprintf("%s is mostly a response to %s, typically %s",
              if (stage == "before") "What the model lacks before the change"
              else "What the model lacks", shown[1],
              with_unit(short(size[[shown[1]]]), discrepancy$unit)),
      paste("How the target responds to each boundary condition, present and past, beyond what",
            "the model says. Above zero the model is too low, below it too high."),
      x = time_label(table$time), y = axis_label("missing response", discrepancy$unit)) +
    time_axis(table$time) + figure_theme()
  with_height(figure, 2 + 1.2 * length(shown))
}
