# The mechanisms tried.

candidates_title <- function(table, upgrade) {
  decisive <- upgrade$control$decisive
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
  adopted <- adopted_models(upgrade)
  names <- vapply(adopted, `[[`, "", "mechanism")
  stand_in <- vapply(adopted, `[[`, "", "verdict") == "stand-in"
  if (all(stand_in)) paste("Adopted, but only as a stand-in:", listed(names))
  else paste0("The measurements call for ", listed(names[!stand_in]),
              if (any(stand_in)) paste("; adopted only as a stand-in:", listed(names[stand_in])))
}

# Why each was adopted or not, in the order of the legend.
candidate_states <- c("adopted", "another was better", "too uncertain", "refused", "too weak",
                      "estimate rough")

candidate_state <- function(table, decisive) {
  words <- decision_words(table, decisive)
  words[startsWith(words, "refused")] <- "refused"
  words[words == "another one is better"] <- "another was better"
  words[words == "not verified"] <- "too uncertain"
  words[!table$trusted & !table$adopted] <- "estimate rough"
  droplevels(factor(words, candidate_states))
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
  table$state <- candidate_state(table, decisive)
  of_state <- function(...) stats::setNames(c(...), candidate_states)
  grey <- "grey45"
  axis <- signed_log_axis(unlist(table[c("lower95", "upper95")]), decisive)
  figure <- ggplot2::ggplot(
    table, ggplot2::aes(.data$log10_bf, .data$row, colour = .data$state, shape = .data$state)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::geom_vline(xintercept = decisive, linetype = "dashed", colour = "grey20") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower95, xmax = .data$upper95), table,
                            linewidth = 1.1, show.legend = FALSE) +
    ggplot2::geom_point(ggplot2::aes(size = .data$state), fill = "white", stroke = 1.2) +
    ggplot2::scale_size_manual(values = of_state(6, 3.4, 3.4, 3.4, 3.4, 3.4)) +
    ggplot2::geom_text(ggplot2::aes(x = Inf, label = paste0("  ", signed(.data$log10_bf))),
                       hjust = 0, size = 4.4, show.legend = FALSE) +
    ggplot2::scale_colour_manual(
      values = of_state(stage_colours[["after"]], grey, grey, grey, grey, grey)) +
    ggplot2::scale_shape_manual(values = of_state(18, 17, 15, 4, 19, 21)) +
    ggplot2::scale_y_discrete(labels = function(x) wrap_labels(0.43)(sub("^[0-9.]+ ", "", x))) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, scales = "free_y",
                        labeller = wrap_strips()) +
    axis +
    figure_titles(candidates_title(table, upgrade),
                  paste0(sprintf(paste("Right of the dashed line (odds of %s to 1) a mechanism may",
                                       "be adopted. The axis is compressed: 2 is 100 to 1, 10 is",
                                       "ten billion to 1. Lines: 95 %% intervals."),
                                 format(10^decisive, big.mark = ",")),
                         if ("refused" %in% table$state)
                           paste(" Refused: the error does not fall by 1 %, or an unknown",
                                 "response does better.")),
                  x = "evidence for it (log10 Bayes factor)") +
    figure_theme()
  figure <- with_end_labels(figure + ggplot2::coord_cartesian(clip = "off"),
                            paste0("   ", signed(table$log10_bf)))
  figure <- with_keys(figure, unique(table$state))
  with_height(figure, 2.4 + 0.42 * nrow(table) + 0.5 * nlevels(table$panel))
}
