# What each mechanism leaves of the error's responses to the boundary conditions that drive it.

explained_title <- function(table, adopted, catalogue) {
  if (!length(adopted))
    return("How much of the error's response to its conditions each mechanism explains")
  own <- table[table$step == 1 & table$mechanism == adopted[1], ]
  if (!nrow(own)) {
    drivers <- catalogue[[adopted[1]]]$boundary
    return(if (length(drivers)) paste("The numbers of", adopted[1], "are not trusted")
           else paste(adopted[1], "is driven by no boundary condition"))
  }
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
  darkness <- function(x) pmin(1, log1p(pmax(x, 0)) / log1p(10))
  alone <- table[table$mechanism == "no change", ]
  together <- unique(table[table$mechanism != "no change", c("panel", "row", "before", "left")])
  together$label <- sprintf("   %s -> %s", decades_label(together$before),
                            decades_label(together$left))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$condition, .data$row)) +
    ggplot2::geom_tile(ggplot2::aes(fill = darkness(.data$left)), colour = "white", linewidth = 1) +
    ggplot2::geom_text(ggplot2::aes(label = decades_label(.data$left)), alone, size = 3.8,
                       colour = ifelse(darkness(alone$left) > 0.85, "white", "black")) +
    ggplot2::geom_text(ggplot2::aes(x = Inf, label = .data$label), together, hjust = 0,
                       size = 4.2) +
    ggplot2::scale_fill_gradient(
      "evidence left", low = "grey92", high = stage_colours[["after"]], limits = c(0, 1),
      breaks = darkness(c(0, 1, 3, 10)), labels = c("0", "1", "3", "10+"),
      guide = ggplot2::guide_colourbar(barwidth = 7, barheight = 0.7, direction = "horizontal")) +
    ggplot2::scale_x_discrete(position = "top", limits = unique(table$condition),
                              labels = wrap_labels(0.7)) +
    ggplot2::scale_y_discrete(labels = function(x) wrap_labels(0.36)(sub("^[0-9]+ ", "", x))) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, scales = "free_y",
                        labeller = wrap_strips()) +
    ggplot2::coord_cartesian(clip = "off") +
    figure_titles(explained_title(table, adopted, upgrade$catalogue),
                  paste("Evidence that the error responds to boundary conditions, in powers of",
                        "ten. First row: to each by itself, without a change. Below: to all that",
                        "drive a mechanism together, without -> with it."),
                  x = NULL, y = NULL) +
    figure_theme() +
    ggplot2::theme(panel.grid.major.x = ggplot2::element_blank(),
                   legend.title = ggplot2::element_text(size = ggplot2::rel(0.8), vjust = 1),
                   axis.text.x.top = ggplot2::element_text(angle = 90, hjust = 0, vjust = 0.5))
  figure <- with_end_labels(figure, together$label)
  with_height(figure, 2.8 + 0.09 * min(30, max(nchar(table$condition))) +
                0.42 * length(unique(paste(table$panel, table$row))) + 0.6 * nlevels(table$panel))
}

# No change on top, then the mechanisms by their evidence, as where the candidates are drawn.
explained_rows <- function(table, candidates) {
  key <- paste(table$from, table$mechanism)
  evidence <- candidates$log10_bf[match(key, paste(candidates$from, candidates$mechanism))]
  evidence[table$mechanism == "no change"] <- Inf
  evidence[is.na(evidence)] <- -Inf
  paste(formatC(as.integer(factor(evidence, sort(unique(evidence)))), width = 4, flag = "0"),
        table$mechanism)
}
