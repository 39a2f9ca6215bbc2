# Histograms of the ranks, one panel a quantity; the band holds 95 % of the counts of uniform ranks.
rank_figure <- function(parts, rows, file) {
  ranks <- do.call(rbind, lapply(parts, function(p) {
    all <- do.call(rbind, lapply(p[[2]], `[[`, p[[3]]))
    data.frame(case = p[[1]], quantity = rep(colnames(all), each = nrow(all)),
               rank = as.vector(all))
  }))
  label <- function(d) paste0(d$case, "\n", d$quantity)
  panel <- unique(label(ranks))
  ranks$panel <- factor(label(ranks), panel)
  rows$panel <- factor(label(rows), panel)
  n <- rows$draws[1]
  band <- stats::qbinom(c(0.025, 0.975), n, 1 / (sbc_draws + 1))
  plot <- ggplot2::ggplot(ranks, ggplot2::aes(rank)) +
    ggplot2::annotate("rect", xmin = -0.5, xmax = sbc_draws + 0.5, ymin = band[1], ymax = band[2],
                      fill = "grey85") + ggplot2::geom_bar(width = 0.9, fill = "#2b6c8f") +
    ggplot2::geom_hline(yintercept = band[1], colour = "white", linewidth = 0.3) +
    ggplot2::geom_text(data = rows,
                       ggplot2::aes(sbc_draws / 2, Inf, label = sprintf("p = %.2g", p_value)),
                       vjust = 1.4, size = 2.7) +
    ggplot2::facet_wrap(~panel, ncol = 6) +
    ggplot2::scale_y_continuous(expand = ggplot2::expansion(c(0, 0.18))) +
    ggplot2::labs(
      x = sprintf("rank of the true value among %d draws from its posterior", sbc_draws),
      y = "records", title = sprintf("Simulation-based calibration: %d records from the prior", n),
      subtitle = paste(
        "Uniform ranks: the posterior is right. The grey band holds 95 % of the counts of",
        "uniform ranks; p-values before Holm's adjustment.")) +
    ggplot2::theme_minimal(base_size = 9) +
    ggplot2::theme(panel.grid.minor = ggplot2::element_blank(), plot.title.position = "plot")
  ggplot2::ggsave(file, plot, width = 11, height = 1.4 * ceiling(length(panel) / 6) + 1.2,
                  dpi = 110, bg = "white")
}
