# Parameters, before and after the measurements and from model to model.

parameters_title <- function(table) {
  count <- vapply(split(table$at_edge, table$stage),
                  function(e) sprintf("%d of %d", sum(e), length(e)), "")
  if (length(count) < 2) paste("At the edge of what was thought possible:", count, "parameters")
  else sprintf("At the edge of what was thought possible: %s parameters before, %s after", count[1],
               count[2])
}

# Where physical values lie, of parameters that have one mode.
physical_rows <- function(fit) {
  physical <- physical_intervals(fit)
  if (is.null(physical))
    physical <- with(parameter_table(fit), data.frame(name, lower = lower95, upper = upper95))
  physical[table(mode_rows(fit)$name)[physical$name] == 1, ]
}

figure_parameters <- function(fits) {
  table <- stage_table(fits, parameter_rows)
  table$panel <- axis_label(table$label, table$unit)
  table$panel <- factor(table$panel, unique(table$panel))
  table$row <- factor(table$stage, rev(levels(table$stage)))
  edge <- table[table$at_edge, ]
  modes <- stage_table(fits, mode_rows)
  modes <- merge(modes, table[c("stage", "label", "panel", "row")])
  physical <- merge(stage_table(fits, physical_rows), table)
  physical <- physical[physical$lower < physical$lower95 | physical$upper > physical$upper95, ]
  figure <- ggplot2::ggplot(table, ggplot2::aes(y = .data$row, colour = .data$stage)) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$prior_lower, xmax = .data$prior_upper),
                            colour = "grey88", linewidth = 9) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower, xmax = .data$upper), physical,
                            linewidth = 0.5) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower, xmax = .data$upper), modes,
                            linewidth = 1.6) +
    ggplot2::geom_point(ggplot2::aes(.data$median), modes, size = 3.6) +
    ggplot2::geom_point(ggplot2::aes(.data$median, shape = "at the edge of its prior"), edge,
                        colour = "black", size = 6, stroke = 1.1) +
    ggplot2::scale_shape_manual(values = c("at the edge of its prior" = 1)) +
    ggplot2::scale_x_continuous(n.breaks = 4, labels = short_axis, guide = apart) +
    ggplot2::coord_cartesian(clip = "off") +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 2, scales = "free",
                        labeller = wrap_strips(2)) + stage_scales() +
    figure_titles(parameters_title(table),
                  paste(c("Grey: what was thought possible (prior). Points and lines: what the",
                          "measurements say, with 95 % intervals.",
                          if (nrow(physical)) "Thin lines: where physical values may lie.",
                          if (nrow(modes) > nrow(table))
                            "Several of one colour: the record does not tell which is right."),
                        collapse = " ")) +
    figure_theme() +
    ggplot2::theme(panel.grid.major.y = ggplot2::element_blank(),
                   axis.text.y = ggplot2::element_blank(),
                   strip.text = ggplot2::element_text(size = ggplot2::rel(0.87)))
  with_height(figure, 1.9 + 1.2 * ceiling(nlevels(table$panel) / 2))
}
