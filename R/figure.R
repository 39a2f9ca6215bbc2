# What the figures share: words, numbers, axes, tables.

with_height <- function(figure, inches) {
  attr(figure, "height_in") <- inches
  if (!inherits(figure, "amiss_figure")) class(figure) <- c("amiss_figure", class(figure))
  figure
}

# Inches; on a canvas narrower than usual, panels go below each other, and titles take more lines.
figure_height <- function(figure, width = canvas_width) {
  columns <- figure$facet$params$ncol %||% 1
  (attr(figure, "height_in") %||% 5) * columns / narrow_columns(columns, width) +
    if (width < canvas_width)
      0.4 * (canvas_width - width) + title_inches(figure, width) -
        title_inches(figure, canvas_width)
    else 0
}

# Height of title and subtitle, whose letters are about 0.6 times as wide as they are high.
title_inches <- function(figure, width) {
  size <- letter_points * letter_scale(width) * c(title_size, subtitle_size) / 72.27
  letters <- vapply(figure$labels[c("title", "subtitle")],
                    function(text) if (is.character(text)) sum(nchar(text)) else 0, 0)
  sum(ceiling(letters * 0.6 * size / width) * 1.2 * size)
}

# Where there is nothing to draw, the title says so.
figure_of_nothing <- function(title)
  with_height(ggplot2::ggplot() + figure_titles(title) + figure_theme(), 1.5)

# Okabe and Ito's colours: colour-blind readers can distinguish them. One is light and one dark, so
# that they differ in grey too.
stage_colours <- c("before" = "#E69F00", "after" = "#0072B2", "the model" = "#0072B2")

# What time steps are used for: colours that no stage has.
use_colours <- c("warm-up" = "#999999", "calibration" = "#333333", "held out" = "#009E73",
                 "not used" = "#CCCCCC")

stage_lines <- function() ggplot2::scale_linetype_manual(
  values = c("before" = "longdash", "after" = "solid", "the model" = "solid"))

# Where dashed and solid lines are to be told apart.
wide_keys <- function() ggplot2::theme(legend.key.width = ggplot2::unit(36, "pt"))

figure_theme <- function() {
  ggplot2::theme_minimal(base_size = letter_points, base_family = figure_family()) +
    ggplot2::theme(
      plot.title = ggplot2::element_text(face = "bold", size = ggplot2::rel(title_size),
                                         lineheight = 1.05),
      plot.subtitle = ggplot2::element_text(colour = "grey30", size = ggplot2::rel(subtitle_size),
                                            lineheight = 1.1),
      plot.title.position = "plot", panel.grid.minor = ggplot2::element_blank(),
      panel.spacing = ggplot2::unit(14, "pt"),
      strip.text = ggplot2::element_text(face = "bold", hjust = 0), strip.placement = "outside",
      strip.text.y.left = ggplot2::element_text(angle = 90, hjust = 0.5), strip.clip = "off",
      axis.text = ggplot2::element_text(colour = "grey20"), legend.position = "top",
      legend.justification = "left", legend.title = ggplot2::element_blank(),
      legend.margin = ggplot2::margin(0, 0, 0, 0))
}

figure_titles <- function(title, subtitle = NULL, x = NULL, y = NULL) {
  ggplot2::labs(title = capital(title), subtitle = subtitle, x = x, y = y)
}

stage_scales <- function()
  ggplot2::scale_colour_manual(values = stage_colours, aesthetics = c("colour", "fill"))

# Labels of an axis that would touch are left out.
apart <- ggplot2::guide_axis(check.overlap = TRUE)

# Reads 2 and 500 on one axis, either side of zero.
signed_log_axis <- function(values, extra = NULL) {
  steps <- c(1, 3, 10, 30, 100, 300, 1000, 3000, 10000)
  if (!is.null(extra)) steps <- c(steps[abs(log(steps / extra)) > 0.6], extra)
  breaks <- sort(c(-steps, 0, steps))
  reach <- range(values, 0, na.rm = TRUE)
  ggplot2::scale_x_continuous(trans = "pseudo_log",
                              breaks = breaks[breaks >= reach[1] - 1 & breaks <= reach[2] + 1],
                              guide = apart)
}

# Temperatures whose differences are in K are themselves recorded in degrees Celsius, unless they
# are far above.
level_unit <- function(unit, values)
  if (identical(unit, "K") && max(values, na.rm = TRUE) < 150) "\u00b0C" else unit

short_axis <- function(x) {
  largest <- max(abs(x), na.rm = TRUE)
  if (largest >= 1e6) ifelse(x == 0, "0", paste0(format_each(x / 1e6), "M"))
  else if (largest >= 1e4) ifelse(x == 0, "0", paste0(format_each(x / 1e3), "k"))
  else format_each(x)
}

time_label <- function(time) if (is.numeric(time)) "time [h]"

time_axis <- function(time) {
  if (is.numeric(time)) return(NULL)
  few <- function(limits) pretty(limits, if (canvas_inches()[["width"]] < 6) 3 else 6)
  ggplot2::scale_x_datetime(breaks = few, date_labels = "%d %b", guide = apart)
}

# Middle of the clock hour in which an interval lies that ends at `time`.
hour_of_day <- function(time, step_h) {
  if (is.numeric(time)) return(floor((time - step_h / 2) %% 24) + 0.5)
  as.POSIXlt(time - 1800 * step_h)$hour + 0.5
}
