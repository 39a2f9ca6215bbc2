# The benchmark at a glance: how often each rule names the right condition, against the strength of
# the effect; and what was told of each kind of world.

rules <- c("amiss: mechanism named" = "mechanism", "amiss: condition" = "condition",
           "the paper's rule" = "paper_condition",
           "correlation of residuals" = "correlation_condition",
           "random forest of residuals" = "forest_condition",
           "ARD lengthscales of residuals" = "ard_condition")

# Strength as it was reached, to the nearest power of two: not every effect can be made as strong as
# was wanted.
reached <- function(row) 2^round(log2(max(row$achieved, 0.25)))

detection_table <- function(rows) {
  with_effect <- Filter(function(r) length(r$true_mechanism) > 0, rows)
  if (!length(with_effect)) return(NULL)
  one <- function(rule, strength) {
    own <- Filter(function(r) reached(r) == strength, with_effect)
    right <- vapply(
      own,
      if (rules[[rule]] == "mechanism") named_right
      else function(r) condition_right(r, rules[[rule]]), NA)
    found <- rate(right)
    data.frame(rule = rule, strength = strength, share = found$rate, lower95 = found$lower95,
               upper95 = found$upper95, n = found$n)
  }
  strengths <- sort(unique(vapply(with_effect, reached, 0)))
  grid <- expand.grid(rule = names(rules), strength = strengths, stringsAsFactors = FALSE)
  do.call(rbind, Map(one, grid$rule, grid$strength))
}

detection_figure <- function(rows) {
  tables <- by_family(rows, detection_table)
  table <- do.call(rbind,
                   lapply(names(tables),
                          function(f) if (!is.null(tables[[f]])) cbind(family = f, tables[[f]])))
  if (is.null(table)) return(NULL)
  table <- table[table$n > 0, ]  # rivals are not asked in every family
  table$family <- factor(table$family, intersect(names(families), table$family))
  table$rule <- factor(table$rule, names(rules))
  colours <- stats::setNames(c("#08519C", "#3182BD", "#E6550D", "grey35", "grey55", "grey70"),
                             names(rules))
  ggplot2::ggplot(table, ggplot2::aes(.data$strength, 100 * .data$share, colour = .data$rule)) +
    ggplot2::geom_linerange(ggplot2::aes(ymin = 100 * .data$lower95, ymax = 100 * .data$upper95),
                            alpha = 0.35, position = ggplot2::position_dodge(0.05)) +
    ggplot2::geom_line(linewidth = 1) +
    ggplot2::geom_point(size = 2.4) +
    ggplot2::scale_x_continuous(
      "strength of the hidden effect (RMS over the noise, once the parameters have adapted)",
      trans = "log2", breaks = 2^(-2:4), labels = c("0.25", "0.5", "1", "2", "4", "8", "16")) +
    ggplot2::facet_wrap(~family) +
    ggplot2::scale_y_continuous("worlds in which the right one is named, per cent",
                                limits = c(0, 100)) +
    ggplot2::scale_colour_manual(NULL, values = colours) +
    ggplot2::labs(
      title = "How often each rule names the right cause",
      subtitle = sprintf("%d worlds with an effect of the catalogue. Lines: 95 %% intervals.",
                         sum(table$n[table$rule == names(rules)[1]]))) +
    ggplot2::theme_minimal(base_size = 13) +
    ggplot2::theme(legend.position = "right", plot.title.position = "plot",
                   panel.grid.minor = ggplot2::element_blank())
}

told_kind <- function(row) {
  if (row$verdict == "named") return(row$mechanism)
  told <- c(likely = "likely cause only", "stand-in" = "stand-in", unexplained = "unexplained",
            nothing = "nothing")
  if (row$verdict %in% names(told)) told[[row$verdict]] else row$verdict
}

confusion_figure <- function(rows, name = rows[[1]]$family, family = families[[name]]) {
  rows <- Filter(function(r) r$kind == "none" || r$achieved >= 1.95, rows)
  if (!length(rows)) return(NULL)
  table <- data.frame(kind = vapply(rows, `[[`, "", "kind"), told = vapply(rows, told_kind, ""))
  stood_in <- if ("stand-in" %in% table$told) "stand-in"
  told_levels <- union(
    c("nothing", family$mechanisms, "likely cause only", stood_in, "unexplained"), table$told)
  counts <- as.data.frame(table(kind = factor(table$kind, rev(family$kinds)),
                                told = factor(table$told, told_levels)))
  counts$share <- counts$Freq / stats::ave(counts$Freq, counts$kind, FUN = sum)
  counts <- counts[counts$Freq > 0, ]
  subtitle <- sprintf(
    "Number of worlds of the family %s, of %d with an effect at least twice the noise, or none.",
    name, nrow(table))
  ggplot2::ggplot(counts, ggplot2::aes(.data$told, .data$kind, fill = .data$share)) +
    ggplot2::geom_tile(colour = "white") +
    ggplot2::geom_text(ggplot2::aes(label = .data$Freq, colour = .data$share > 0.5), size = 4,
                       show.legend = FALSE) +
    ggplot2::scale_fill_gradient(low = "#DEEBF7", high = "#08519C", limits = c(0, 1),
                                 guide = "none") +
    ggplot2::scale_colour_manual(values = c("FALSE" = "grey20", "TRUE" = "white")) +
    ggplot2::scale_x_discrete("what was told", drop = FALSE, position = "top") +
    ggplot2::scale_y_discrete("what was hidden", drop = FALSE) +
    ggplot2::labs(title = "What was hidden and what was told", subtitle = subtitle) +
    ggplot2::theme_minimal(base_size = 13) +
    ggplot2::theme(axis.text.x = ggplot2::element_text(angle = 40, hjust = 0),
                   panel.grid = ggplot2::element_blank(), plot.title.position = "plot",
                   plot.margin = ggplot2::margin(6, 50, 6, 6))
}

write_figures <- function(rows, out) {
  stem <- sub("(\\.json)?$", "", out)
  count <- length(unique(vapply(rows, `[[`, "", "family")))
  save <- function(figure, name, height, width = 11) {
    if (is.null(figure)) return()
    ggplot2::ggsave(paste0(stem, "-", name, ".png"), figure, width = width, height = height,
                    dpi = 110, bg = "white")
  }
  save(detection_figure(rows), "detection", if (count > 2) 8 else 5.5, if (count > 1) 12 else 10)
  figures <- by_family(rows, confusion_figure)
  for (family in names(figures))
    save(figures[[family]], paste0("confusion-", family), if (family == "wrong") 8 else 7)
}
