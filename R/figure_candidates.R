# The mechanisms tried.

candidates_title <- function(table, decisive) {
  if (!any(table$adopted)) {
    best <- table[which.max(table$log10_bf), ]
    return(if (best$log10_bf >= decisive && keeps_error(best))
             "No mechanism was adopted: the best does not lower the error"
           else if (best$log10_bf >= decisive && is_refuted(best))
             "No mechanism was adopted: an unknown response does better than the best"
           else if (best$log10_bf >= decisive && best$judged_by == "trial")
             "No mechanism was adopted: no runs were left to verify the best"
           else if (best$log10_bf >= decisive)
             "No mechanism was adopted: the interval of the best reaches to zero"
           else "No mechanism explains the measurements decisively better than no change")
  }
  paste("The measurements call for", listed(table$mechanism[table$adopted]))
}

figure_candidates <- function(upgrade) {
  table <- if (!is.null(upgrade$candidates)) candidate_table(upgrade)
  if (!NROW(table)) return(figure_of_nothing("No mechanism was tried"))
  decisive <- upgrade$control$decisive
  adopted <- c("no change", table$mechanism[table$adopted])
  table$panel <- factor(ifelse(table$step == 1, "added to the base model",
                               paste("added after", adopted[table$step])))
  table$panel <- factor(table$panel, unique(table$panel[order(table$step)]))
  table$row <- paste(formatC(rank(table$log10_bf), width = 4, flag = "0"), table$mechanism)
  refused <- table$log10_bf >= decisive & table$trusted & !table$adopted &
    (keeps_error(table) | is_refuted(table))
  states <- c("adopted", "tried", "tried, estimate rough", if (any(refused)) "refused")
  table$state <- ifelse(table$adopted, states[1], ifelse(table$trusted, states[2], states[3]))
  table$state <- factor(ifelse(refused, "refused", table$state), states)
  of_state <- function(...) stats::setNames(c(...)[seq_along(states)], states)
  grey <- "grey45"
  axis <- signed_log_axis(unlist(table[c("lower95", "upper95")]), decisive)
  figure <- ggplot2::ggplot(
    table, ggplot2::aes(.data$log10_bf, .data$row, colour = .data$state, shape = .data$state)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::geom_vline(xintercept = decisive, linetype = "dashed", colour = "grey20") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower95, xmax = .data$upper95), table,
                            linewidth = 1.1, show.legend = FALSE) +
    ggplot2::geom_point(ggplot2::aes(size = .data$state), fill = "white", stroke = 1.2) +
    ggplot2::scale_size_manual(values = of_state(6, 3.4, 3.4, 3.4), limits = states) +
    ggplot2::geom_text(ggplot2::aes(x = Inf, label = paste0("  ", signed(.data$log10_bf))),
                       hjust = 0, size = 4.4, show.legend = FALSE) +
    ggplot2::scale_colour_manual(values = of_state(stage_colours[["after"]], grey, grey, grey),
                                 limits = states) +
    ggplot2::scale_shape_manual(values = of_state(18, 19, 21, 4), limits = states) +
    ggplot2::scale_y_discrete(labels = function(x) wrap_labels(0.36)(sub("^[0-9.]+ ", "", x))) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, scales = "free_y",
                        labeller = wrap_strips()) +
    axis +
    figure_titles(candidates_title(table, decisive),
                  paste0(sprintf(paste("Right of the dashed line (odds of %s to 1) a mechanism may",
                                       "be adopted. The axis is compressed: 2 is 100 to 1, 10 is",
                                       "10^10 to 1. Lines: 95 %% intervals."),
                                 format(10^decisive, big.mark = ",")),
                         if (any(refused)) " Refused: the error does not fall by 1 %, or an ",
                         if (any(refused)) "unknown response does better."),
                  x = "evidence for it (log10 Bayes factor)") +
    figure_theme()
  figure <- with_end_labels(figure + ggplot2::coord_cartesian(clip = "off"),
                            paste0("   ", signed(table$log10_bf)))
  with_height(figure, 2.4 + 0.31 * nrow(table) + 0.5 * nlevels(table$panel))
}
