# What the error responds to.

attribution_title <- function(attributions) {
  named <- lapply(attributions, function(a) significant_conditions(a$table))
  if (length(named) < 2)
    return(paste("The remaining error follows", strongest(named[[1]])))
  if (!length(named[[1]]) && !length(named[[2]]))
    return("The remaining error follows no boundary condition, neither before nor after")
  sprintf("The remaining error follows %s before the change, %s after it", strongest(named[[1]]),
          strongest(named[[2]]))
}

# At most three conditions, in the order of their evidence: the figure itself lists them all.
strongest <- function(conditions) {
  shown <- if (length(conditions) > 3) 2 else 3
  others <- length(conditions) - shown
  listed(c(utils::head(conditions, shown), if (others > 0) sprintf("%d others", others)),
         none = "no boundary condition")
}

# For each condition that is significant, its shares of the misfit in the order of the stages.
share_labels <- function(table) {
  told <- tapply(round(100 * pmax(table$share, 0)), table$boundary, paste, collapse = " -> ")
  significant <- tapply(table$significant, table$boundary, any)
  data.frame(y = seq_along(told), label = ifelse(significant, paste0("   ", told, " %"), ""))
}

figure_attribution <- function(attributions) {
  table <- stage_table(attributions, function(a) a$table)
  strength <- tapply(table$log10_bf_dropped, table$boundary, max)
  table$boundary <- factor(table$boundary, names(sort(strength)))
  shares <- share_labels(table)
  table$y <- as.integer(table$boundary) +
    if (length(attributions) > 1) ifelse(table$stage == "before", 0.18, -0.18) else 0
  axis <- signed_log_axis(table$log10_bf_dropped)
  figure <- ggplot2::ggplot(table,
                            ggplot2::aes(.data$log10_bf_dropped, .data$y, colour = .data$stage)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = 0, xmax = .data$log10_bf_dropped),
                            linewidth = 1.1) +
    ggplot2::geom_point(ggplot2::aes(shape = .data$significant), size = 4, fill = "white",
                        stroke = 1.3) +
    ggplot2::geom_text(ggplot2::aes(Inf, .data$y, label = .data$label), shares, hjust = 0,
                       size = 4.4, colour = "grey20") +
    ggplot2::scale_shape_manual(values = c("TRUE" = 19, "FALSE" = 21),
                                labels = c("TRUE" = "significant", "FALSE" = "may be chance"),
                                limits = c("TRUE", "FALSE")) +
    ggplot2::scale_y_continuous(NULL, breaks = seq_along(levels(table$boundary)),
                                labels = function(y) wrap_labels(0.43)(levels(table$boundary)[y]),
                                expand = ggplot2::expansion(add = 0.5)) + axis + stage_scales() +
    figure_titles(attribution_title(attributions),
                  paste0("Each boundary condition, present and past: how much worse the remaining ",
                         "error is explained without it. Per cent, of what is significant: the ",
                         "share of the misfit (squared errors, weighed) that it explains",
                         if (length(attributions) > 1) ", before -> after", "."),
                  x = "log10 Bayes factor lost without it, axis compressed") +
    figure_theme() + if (length(attributions) < 2) ggplot2::guides(colour = "none")
  figure <- with_end_labels(figure + ggplot2::coord_cartesian(clip = "off"), shares$label)
  with_height(figure, 2.4 + 0.56 * nlevels(table$boundary))
}
