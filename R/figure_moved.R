# Priors against posteriors, and what moved from the first model to the last.

prior_points <- function(prior, from, to) {
  value <- seq(from, to, length.out = 128)
  data.frame(value = value, density = prior_density(prior, value))
}

# Where a prior ends abruptly, values are mirrored, so that the density does not fall to its end.
posterior_points <- function(values, weights, prior) {
  ends <- range(prior$value)
  abrupt <- ends[prior$density[c(1, nrow(prior))] > 0.05 * max(prior$density)]
  mirrored <- lapply(abrupt, function(end) 2 * end - values)
  weights <- rep(weights, 1 + length(abrupt))
  d <- stats::density(c(values, unlist(mirrored)), weights = weights / sum(weights),
                      from = ends[1], to = ends[2], n = 128,
                      bw = max(stats::bw.nrd0(values), diff(ends) / 200))
  data.frame(value = d$x, density = d$y)
}

# Densities of prior and posterior of each parameter of one calibration, each over its greatest
# value.
density_table <- function(fit) {
  rows <- parameter_rows(fit)
  tables <- lapply(seq_len(nrow(rows)), function(k) {
    name <- rows$name[k]
    prior <- prior_points(drawn_parameters(fit)[[name]]$prior, rows$prior_lower[k],
                          rows$prior_upper[k])
    posterior <- posterior_points(fit$values[, name], fit$weights, prior)
    data.frame(panel = axis_label(rows$label[k], rows$unit[k]), value = prior$value,
               prior = prior$density / max(prior$density),
               posterior = posterior$density / max(posterior$density))
  })
  do.call(rbind, tables)
}

figure_priors <- function(fits) {
  table <- stage_table(fits, density_table)
  table$panel <- factor(table$panel, unique(table$panel))
  left <- narrowing(fits[[length(fits)]])
  loose <- names(left)[left > 0.7]
  title <- if (length(loose)) paste("The measurements say little about", listed(loose))
           else "The measurements narrow every parameter"
  figure <- ggplot2::ggplot(
    table, ggplot2::aes(.data$value, colour = .data$stage, linetype = .data$stage)) +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = 0, ymax = .data$prior, group = .data$stage),
                         fill = "grey85", colour = NA, show.legend = FALSE) +
    ggplot2::geom_line(ggplot2::aes(y = .data$posterior), linewidth = 1.1) +
    ggplot2::scale_x_continuous(n.breaks = 4, labels = short_axis, guide = apart) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 3, scales = "free_x",
                        labeller = wrap_strips(3)) + stage_scales() + stage_lines() +
    figure_titles(title, paste("Grey: what was thought possible (prior). Lines: what the",
                               "measurements leave of it; each at its own height.")) +
    figure_theme() + wide_keys() +
    ggplot2::theme(axis.text.y = ggplot2::element_blank(),
                   panel.grid.major.y = ggplot2::element_blank(),
                   strip.text = ggplot2::element_text(size = ggplot2::rel(0.83)))
  with_height(figure, 1.9 + 1.8 * ceiling(nlevels(table$panel) / 3))
}

# Shift of the medians as a share of the prior's range, and the strongest correlation with a
# parameter that is new.
moved_table <- function(upgrade) {
  fits <- lapply(upgrade_stages(upgrade), `[[`, "fit")
  before <- parameter_rows(fits$before)
  after <- parameter_rows(fits$after)
  after <- after[after$name %in% before$name, ]
  before <- before[match(after$name, before$name), ]
  new <- setdiff(colnames(fits$after$values), before$name)
  correlation <- posterior_correlation(fits$after)[after$name, new, drop = FALSE]
  strongest <- apply(correlation, 1, function(r) if (length(r)) r[which.max(abs(r))] else NA_real_)
  data.frame(label = after$label,
             shift = (after$median - before$median) / (after$prior_upper - after$prior_lower),
             clear = after$median < before$lower95 | after$median > before$upper95,
             correlation = strongest)
}

figure_moved <- function(upgrade) {
  if (length(upgrade$models) < 2)
    return(figure_of_nothing("No mechanism was adopted, so that no parameter moved"))
  table <- moved_table(upgrade)
  table$label <- factor(table$label, table$label[order(abs(table$shift))])
  panels <- c("moved by [share of its prior's range]", "correlation with what is new")
  long <- rbind(data.frame(table[c("label", "clear")], value = table$shift, panel = panels[1]),
                data.frame(table[c("label", "clear")], value = table$correlation,
                           panel = panels[2]))
  long$panel <- factor(long$panel, panels)
  long$state <- factor(ifelse(long$clear, "beyond its former 95 % interval", "within it"),
                       c("beyond its former 95 % interval", "within it"))
  gone <- as.character(table$label[table$clear])
  title <- if (length(gone))
             sprintf("With the change, %d of %d parameters leave their former 95 %% intervals",
                     length(gone), nrow(table))
           else "With the change, no parameter leaves its former 95 % interval"
  figure <- ggplot2::ggplot(long[!is.na(long$value), ],
                            ggplot2::aes(.data$value, .data$label, shape = .data$state)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = 0, xmax = .data$value),
                            colour = stage_colours[["after"]], linewidth = 1.1,
                            show.legend = FALSE) +
    ggplot2::geom_point(colour = stage_colours[["after"]], fill = "white", size = 3.6,
                        stroke = 1.2) +
    ggplot2::scale_shape_manual(values = c(19, 21), drop = FALSE) +
    ggplot2::scale_x_continuous(n.breaks = 4, guide = apart) +
    ggplot2::scale_y_discrete(labels = wrap_labels(0.28)) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 2, scales = "free_x",
                        labeller = wrap_strips(2.6)) +
    figure_titles(title, paste("A parameter that moved far had made up for what was missing. If",
                               "one is strongly correlated with a new parameter, measure next",
                               "what distinguishes the two.")) +
    figure_theme()
  with_height(figure, 2.4 + 0.5 * nrow(table))
}
