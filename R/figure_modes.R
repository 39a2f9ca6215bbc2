# Parameters whose posterior has several modes: where they are, their shares, and how high searches
# saw them.

figure_modes <- function(fit) {
  label <- distinct_labels(drawn_parameters(fit))
  modes <- lapply(stats::setNames(nm = names(label)), function(name) parameter_modes(fit, name))
  modes <- modes[lengths(modes) > 1]
  if (!length(modes)) return(figure_of_nothing(one_mode_title(fit$modes)))
  names <- names(modes)
  unit <- vapply(drawn_parameters(fit)[names], `[[`, "", "unit")
  panels <- stats::setNames(axis_label(label[names], unit), names)
  bind <- function(table_of) do.call(rbind, lapply(names, function(name) {
    table <- table_of(name)
    cbind(table, panel = factor(rep(panels[[name]], nrow(table)), panels))
  }))
  curves <- bind(function(name) mode_curves(fit, name))
  ends <- bind(function(name) search_ends(fit, name, curves$x[curves$panel == panels[[name]]]))
  peaks <- bind(function(name) mode_peaks(modes[[name]], curves[curves$panel == panels[[name]], ]))
  colour <- stage_colours[["the model"]]
  columns <- min(2, length(names))
  figure <- ggplot2::ggplot(curves, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_area(ggplot2::aes(group = .data$mode), position = "identity", fill = colour,
                       alpha = 0.3) +
    ggplot2::geom_line(ggplot2::aes(group = .data$mode), colour = colour, linewidth = 0.9) +
    ggplot2::geom_text(ggplot2::aes(label = .data$label), peaks, vjust = -0.5) +
    ggplot2::geom_point(data = ends, shape = 17, size = 3.4) +
    ggplot2::geom_text(ggplot2::aes(label = .data$label), ends, vjust = 1.9, size = 3.9,
                       check_overlap = TRUE) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), scales = "free",
                        ncol = columns, labeller = wrap_strips(columns)) +
    ggplot2::scale_x_continuous(n.breaks = 5, labels = short_axis, guide = apart,
                                expand = ggplot2::expansion(mult = 0.12)) +
    ggplot2::scale_y_continuous(breaks = NULL,
                                expand = ggplot2::expansion(mult = c(0.22, 0.18))) +
    figure_titles(modes_title(modes, label),
                  paste(c("The posterior of each parameter that has several modes, with the share",
                          "of each mode.",
                          if (nrow(ends)) paste("Triangles: where searches ended; below them, how",
                                                "much lower than the highest their log posterior",
                                                "is."),
                          "The record does not tell which mode is right."), collapse = " ")) +
    figure_theme() + ggplot2::theme(panel.grid.major.y = ggplot2::element_blank())
  with_height(figure, 2 + 2.4 * ceiling(length(names) / 2))
}

modes_title <- function(modes, label) {
  names <- names(modes)
  if (length(names) > 1) return(sprintf("The posteriors of %s have several modes",
                                        listed(label[names])))
  share <- vapply(modes[[1]], `[[`, 0, "share")
  sprintf("The posterior of %s has %d modes, with shares of %s", label[[names]], length(share),
          listed(percent(share)))
}

one_mode_title <- function(modes) {
  if (is.null(modes)) return("One mode: the draws of no parameter fall into parts")
  if (isTRUE(modes$lost > 0))
    return(sprintf("One mode holds the draws, though searches found %d more: do not trust it",
                   modes$lost))
  if (!isTRUE(modes$agree))
    return(if (modes$searches < 2) "One mode was found, but only one search was made"
           else sprintf("One mode holds the draws, but no two of %d searches ended at one mode",
                        modes$searches))
  sprintf("One mode: %s searches ended there",
          if (modes$searches > 2) paste("2 of", modes$searches) else modes$searches)
}

# Density of the draws of each mode, times its share; each as wide as its own draws are.
mode_curves <- function(fit, name) {
  draws <- draws_of_modes(fit, name)
  whole <- diff(range(unlist(lapply(draws, `[[`, "x"))))
  do.call(rbind, lapply(seq_along(draws), function(mode) {
    x <- draws[[mode]]$x
    share <- sum(draws[[mode]]$w)
    w <- draws[[mode]]$w / share
    spread <- sqrt(sum(w * (x - sum(w * x))^2))
    width <- max(0.9 * spread * sum(w^2)^0.2, whole / 200)
    curve <- stats::density(x, bw = width, weights = w, n = 128)
    data.frame(x = curve$x, y = share * curve$y, mode)
  }))
}

# Where the curve of each mode is highest, and its share of the posterior.
mode_peaks <- function(modes, curves) {
  do.call(rbind, lapply(seq_along(modes), function(mode) {
    own <- curves[curves$mode == mode, ]
    cbind(own[which.max(own$y), c("x", "y")], label = percent(modes[[mode]]$share))
  }))
}

# Of searches that are remembered with their height; those that ended near each other are one.
search_ends <- function(fit, name, reach) {
  points <- fit$modes$points
  if (!name %in% colnames(points))
    return(data.frame(x = numeric(), y = numeric(), label = character()))
  x <- points[, name]
  height <- fit$modes$heights
  order <- order(-height, na.last = TRUE)
  x <- x[order]
  height <- height[order]
  near <- vapply(seq_along(x), function(i)
    any(abs(x[seq_len(i - 1)] - x[i]) < 0.02 * diff(range(reach))), NA)
  below <- max(height) - height
  told <- ifelse(is.na(below), "", ifelse(below < 0.05, "highest", paste(short(below), "lower")))
  data.frame(x = x, y = rep(0, length(x)), label = told)[!near, ]
}
