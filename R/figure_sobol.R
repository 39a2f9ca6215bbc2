# What moves the simulation.

sobol_title <- function(table) {
  leading <- table[which.max(table$total), ]
  share <- function(x) percent(min(max(x, 0), 1))
  sprintf("%s moves the simulation most: %s of its variance by itself, %s with interactions",
          leading$label, share(leading$first), share(leading$total))
}

figure_sobol <- function(indices) {
  table <- generics::tidy(indices)
  ranked <- order(indices$table$total)
  table$y <- match(table$term, indices$table$parameter[ranked]) +
    ifelse(table$order == "first", 0.15, -0.15)
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$estimate, .data$y, colour = .data$order)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$conf.low, xmax = .data$conf.high),
                            linewidth = 1.1) +
    ggplot2::geom_point(ggplot2::aes(shape = .data$order), size = 4, fill = "white", stroke = 1.3) +
    ggplot2::scale_colour_manual(values = sobol_colours, labels = sobol_orders) +
    ggplot2::scale_shape_manual(values = c(first = 19, total = 21), labels = sobol_orders) +
    ggplot2::scale_y_continuous(
      NULL, breaks = seq_along(ranked), expand = ggplot2::expansion(add = 0.5),
      labels = function(y) wrap_labels(0.43)(indices$table$label[ranked][y])) +
    ggplot2::scale_x_continuous(guide = apart) +
    figure_titles(sobol_title(indices$table),
                  "Sobol indices over the priors, all steps together, with 95 % intervals.",
                  x = "share of the variance") +
    figure_theme()
  with_height(figure, 2.4 + 0.48 * length(ranked))
}

sobol_orders <- c(first = "alone (first order)", total = "with interactions (total)")
sobol_colours <- c(first = "#0072B2", total = "#E69F00")

#' @rdname figures
#' @export
plot.amiss_sobol <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  draw(figure_sobol(x))
}

#' @rdname figures
#' @export
autoplot.amiss_sobol <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  figure_sobol(object)
}
