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

# Residuals as points, below the discrepancy with its band.
discrepancy_layers <- function(colour) list(
  ggplot2::geom_point(ggplot2::aes(y = .data$residual), colour = "grey20", size = 0.4),
  ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$lower95, ymax = .data$upper95,
                                    fill = .data[[colour]], colour = .data[[colour]],
                                    group = .data$part), alpha = 0.35, linewidth = 0.25),
  ggplot2::geom_line(ggplot2::aes(y = .data$discrepancy, colour = .data[[colour]],
                                  group = .data$part), linewidth = 0.5))

# A constant between residual and discrepancy that can be seen.
constant_words <- function(table, unit, reach) {
  constant <- vapply(split(table$residual - table$discrepancy, table$stage), mean, 0)
  seen <- constant[abs(constant) > 0.05 * diff(reach)]
  if (!length(seen)) return(NULL)
  told <- paste0(with_unit(short(seen), unit),
                 ifelse(names(seen) == "the model", "", paste0(" ", names(seen))))
  paste0(" It varies about zero: the constant part of the error (", listed(told),
         ") lies between it and the points.")
}

# Discrepancies over time, one panel each on a common scale, and the leading boundary condition
# below them.
figure_discrepancy <- function(discrepancies, leading = NULL) {
  unit <- discrepancies[[1]]$unit
  table <- stage_table(discrepancies, function(d) cbind(d$series, part = d$segment))
  attr(table, "unit") <- unit
  stage_panel <- paste0(ifelse(levels(table$stage) == "the model", "error", levels(table$stage)),
                        if (nzchar(unit)) paste0(" [", pretty_unit(unit), "]"))
  panels <- c(stage_panel, leading$title)
  table$panel <- factor(stage_panel[as.integer(table$stage)], panels)
  reach <- range(table$residual, table$lower95, table$upper95)
  corners <- expand.grid(time = table$time[1], y = reach, panel = factor(stage_panel, panels))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time)) +
    ggplot2::geom_blank(ggplot2::aes(y = .data$y), corners) +
    ggplot2::geom_hline(ggplot2::aes(yintercept = 0), corners, colour = "grey40") +
    discrepancy_layers("stage") +
    leading_layer(leading, table, panels) +
    ggplot2::facet_grid(panel ~ ., scales = "free_y", switch = "y",
                        labeller = wrap_turned(length(panels))) + stage_scales() +
    figure_titles(discrepancy_title(table),
                  paste0("Points: measured - simulated, at the posterior mean of the parameters. ",
                         "Coloured: the discrepancy, the part that responds to boundary ",
                         "conditions, with 95 % band.", constant_words(table, unit, reach),
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
                       panel = factor(leading$title, panels))
  series$part <- cumsum(
    c(TRUE, diff(as.numeric(series$time)) > 1.5 * stats::median(diff(as.numeric(series$time)))))
  ggplot2::geom_line(ggplot2::aes(y = .data$value, group = .data$part), series, colour = "grey25",
                     linewidth = 0.7)
}

response_title <- function(binned, name, noise) {
  swing <- vapply(split(binned$residual, binned$stage), function(r) diff(range(r)), 0)
  if (all(swing < 2 * noise))
    return(sprintf("The error hardly depends on the present value of %s; its past may count", name))
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
                  x = leading$title,
                  y = axis_label("measured - simulated", m$unit)) +
    figure_theme()
  with_height(figure, 5)
}

missing_title <- function(size, name, stage, unit) {
  words <- if (isTRUE(size[[name]]^2 > 0.5 * sum(size^2)))
             "what the model lacks is mostly a response to"
           else if (size[[name]] == max(size)) "the largest response that the model lacks is to"
           else "the largest significant response that the model lacks is to"
  sprintf("%s%s %s, typically %s", if (stage == "before") "before the change, " else "", words,
          name, with_unit(short(size[[name]]), unit))
}

# The response that the model lacks, of each of the leading conditions, in the unit of the target:
# first of those that are significant in the `attribution`, if there is one. What is below a
# twentieth of the largest is a flat line, and left out.
# `left`: the typical error of the run of least squares.
figure_missing <- function(discrepancy, attribution = NULL, stage = "the model", most = 4,
                           left = Inf) {
  responses <- discrepancy$responses
  size <- sqrt(colMeans(responses^2))
  first <- names(size) %in% if (!is.null(attribution)) significant_conditions(attribution$table)
  shown <- utils::head(names(size)[order(!first, -size)], most)
  shown <- shown[size[shown] >= 0.05 * max(size[shown])]
  table <- data.frame(time = rep(discrepancy$series$time, length(shown)),
                      value = as.numeric(responses[, shown]),
                      panel = factor(rep(shown, each = nrow(responses)), shown),
                      part = rep(discrepancy$segment, length(shown)))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time, .data$value, group = .data$part)) +
    ggplot2::geom_hline(yintercept = 0, colour = "grey40") +
    ggplot2::geom_line(colour = stage_colours[[stage]], linewidth = 0.9) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, labeller = wrap_strips()) +
    ggplot2::scale_y_continuous(n.breaks = 4, guide = apart) +
    figure_titles(
      missing_title(size, shown[1], stage, discrepancy$unit),
      paste(c("How the target responds to each boundary condition, present and past, beyond what",
              "the model says. Above zero the model is too low, below it too high.",
              if (left < size[[shown[1]]])
                paste0("The run of least squares leaves only ",
                       with_unit(short(left), discrepancy$unit),
                       ": its parameters make up for a part.")), collapse = " "),
      x = time_label(table$time), y = axis_label("missing response", discrepancy$unit)) +
    time_axis(table$time) + figure_theme()
  # The axis title needs a panel that is not low.
  with_height(figure, max(4.2, 2.2 + 1.2 * length(shown)))
}
