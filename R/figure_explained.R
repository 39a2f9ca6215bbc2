# What each mechanism leaves of the error's responses to the boundary conditions that drive it.

explained_title <- function(table, adopted) {
  if (!length(adopted))
    return("How much of the error's response to its conditions each mechanism explains")
  own <- table[table$step == 1 & table$mechanism == adopted[1], ]
  if (!nrow(own)) return(paste(adopted[1], "is driven by no boundary condition"))
  sprintf("With %s, the evidence for a response to %s falls from %s to %s powers of ten",
          adopted[1], listed(own$condition), decades_label(own$before[1]),
          decades_label(own$left[1]))
}

# Tenths below ten; nothing is left below a twentieth.
decades_label <- function(x)
  ifelse(x < 0.05, "0", ifelse(x < 9.95, sprintf("%.1f", x), sprintf("%.0f", x)))

figure_explained <- function(upgrade) {
  table <- upgrade$responses
  if (!NROW(table)) return(figure_of_nothing("No mechanism was tried"))
  adopted <- vapply(adopted_models(upgrade), `[[`, "", "mechanism")
  table$step <- match(table$from, unique(table$from))
  before <- c("the base model", adopted)
  panels <- ifelse(table$step == 1, "added to the base model",
                   paste("added after", before[table$step]))
  table$panel <- factor(panels, unique(panels))
  table$row <- explained_rows(table, upgrade$candidates)
  # Ten powers of ten are as dark as it gets.
  table$evidence <- pmin(1, log1p(pmax(table$left, 0)) / log1p(10))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$condition, .data$row)) +
    ggplot2::geom_tile(ggplot2::aes(fill = .data$evidence), colour = "white", linewidth = 1) +
    ggplot2::geom_text(ggplot2::aes(label = decades_label(.data$left)), size = 4.2,
                       colour = ifelse(table$evidence > 0.6, "white", "grey20")) +
    ggplot2::scale_fill_gradient(low = "grey92", high = stage_colours[["after"]], limits = c(0, 1),
                                 guide = "none") +
    ggplot2::scale_x_discrete(position = "top", limits = unique(table$condition),
                              labels = wrap_labels(1.1 / length(unique(table$condition)))) +
    ggplot2::scale_y_discrete(labels = function(x) wrap_labels(0.3)(sub("^[0-9]+ ", "", x))) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, scales = "free_y",
                        labeller = wrap_strips()) +
    figure_titles(explained_title(table, adopted),
                  paste("Evidence that the error responds to a boundary condition, in powers of",
                        "ten: without a change, and with each mechanism for the conditions that",
                        "drive it (together). Light: the mechanism explains the response, or there",
                        "was none."), x = NULL, y = NULL) +
    figure_theme() + ggplot2::theme(panel.grid.major.x = ggplot2::element_blank())
  with_height(figure, 2.4 + 0.36 * length(unique(paste(table$panel, table$row))) +
                0.6 * nlevels(table$panel))
}

# No change on top, then the mechanisms by their standing.
explained_rows <- function(table, candidates) {
  key <- paste(table$from, table$mechanism)
  standing <- candidates$standing[match(key, paste(candidates$from, candidates$mechanism))]
  standing[table$mechanism == "no change"] <- Inf
  standing[is.na(standing)] <- -Inf
  paste(formatC(as.integer(factor(standing, sort(unique(standing)))), width = 4, flag = "0"),
        table$mechanism)
}
