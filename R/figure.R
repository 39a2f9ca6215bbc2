# What the figures share: words, numbers, axes, tables.

# The first and the last model, or the only one.
upgrade_stages <- function(upgrade) {
  k <- length(upgrade$models)
  if (k < 2) list("the model" = upgrade$models[[1]]) else list(before = upgrade$models[[1]],
                                                               after = upgrade$models[[k]])
}

# One table for each stage, bound with a factor `stage` in front.
stage_table <- function(stages, table_of) {
  tables <- Map(function(s, name) cbind(stage = name, table_of(s)), stages, names(stages))
  table <- do.call(rbind, unname(tables))
  table$stage <- factor(table$stage, names(stage_colours))
  droplevels(table)
}

with_height <- function(figure, inches) {
  attr(figure, "height_in") <- inches
  if (!inherits(figure, "amiss_figure")) class(figure) <- c("amiss_figure", class(figure))
  figure
}

# Inches; on a canvas narrower than usual, panels go below each other and titles take more lines.
figure_height <- function(figure, width = canvas_width) {
  columns <- figure$facet$params$ncol %||% 1
  (attr(figure, "height_in") %||% 5) * columns / narrow_columns(columns, width) + 0.3 * max(0, canvas_width - width)
}

# Where there is nothing to draw, the title says so.
figure_of_nothing <- function(title) with_height(ggplot2::ggplot() + figure_titles(title) + figure_theme(), 1.5)

stage_lines <- function() ggplot2::scale_linetype_manual(values = c("before" = "longdash", "after" = "solid",
                                                                    "the model" = "solid"))

title_size <- 1.13  # of the letters
subtitle_size <- 0.9

figure_theme <- function() {
  ggplot2::theme_minimal(base_size = letter_points, base_family = figure_family()) +
    ggplot2::theme(plot.title = ggplot2::element_text(face = "bold", size = ggplot2::rel(title_size),
                                                      lineheight = 1.05),
                   plot.subtitle = ggplot2::element_text(colour = "grey30", size = ggplot2::rel(subtitle_size),
                                                         lineheight = 1.1),
                   plot.title.position = "plot", panel.grid.minor = ggplot2::element_blank(),
                   panel.spacing = ggplot2::unit(14, "pt"),
                   strip.text = ggplot2::element_text(face = "bold", hjust = 0), strip.placement = "outside",
                   strip.text.y.left = ggplot2::element_text(angle = 90, hjust = 0.5), strip.clip = "off",
                   axis.text = ggplot2::element_text(colour = "grey20"), legend.position = "top",
                   legend.justification = "left",
                   legend.title = ggplot2::element_blank(), legend.margin = ggplot2::margin(0, 0, 0, 0))
}

figure_titles <- function(title, subtitle = NULL, x = NULL, y = NULL) {
  ggplot2::labs(title = title, subtitle = subtitle, x = x, y = y)
}

stage_scales <- function() ggplot2::scale_colour_manual(values = stage_colours, aesthetics = c("colour", "fill"))

# Labels of an axis that would touch are left out.
apart <- ggplot2::guide_axis(check.overlap = TRUE)

# Reads 2 and 500 on one axis, either side of zero.
signed_log_axis <- function(values, extra = NULL) {
  steps <- c(1, 3, 10, 30, 100, 300, 1000, 3000, 10000)
  if (!is.null(extra)) steps <- c(steps[abs(log(steps / extra)) > 0.6], extra)
  breaks <- sort(c(-steps, 0, steps))
  reach <- range(values, 0, na.rm = TRUE)
  ggplot2::scale_x_continuous(trans = "pseudo_log", breaks = breaks[breaks >= reach[1] - 1 & breaks <= reach[2] + 1],
                              guide = apart)
}

pretty_unit <- function(unit) gsub("m3", "m\u00b3", gsub("m2", "m\u00b2", unit, fixed = TRUE), fixed = TRUE)

axis_label <- function(name, unit) ifelse(nzchar(unit), paste0(name, " [", pretty_unit(unit), "]"), name)

# Temperatures whose differences are in K are themselves recorded in degrees Celsius, unless they are far above.
level_unit <- function(unit, values) if (identical(unit, "K") && max(values, na.rm = TRUE) < 150) "\u00b0C" else unit

signed <- function(x) ifelse(abs(x) < 9.95, sprintf("%+.1f", x), sprintf("%+.0f", x))

# A few significant digits, not in powers of ten unless very far from one.
short <- function(x, digits = 2) {
  far <- abs(x) >= 1e7 | (abs(x) < 1e-4 & x != 0)
  text <- ifelse(far, format_each(signif(x, digits)),
                 formatC(signif(x, digits), digits = digits, format = "fg", flag = "#", big.mark = ","))
  ifelse(is.na(x), "\u2013", sub("\\.$", "", text))
}

format_each <- function(x) vapply(x, format, "")

short_axis <- function(x) {
  largest <- max(abs(x), na.rm = TRUE)
  if (largest >= 1e6) ifelse(x == 0, "0", paste0(format_each(x / 1e6), "M"))
  else if (largest >= 1e4) ifelse(x == 0, "0", paste0(format_each(x / 1e3), "k"))
  else format_each(x)
}

percent <- function(x) {
  digits <- trimws(formatC(100 * x, digits = 2, format = "fg"))
  text <- ifelse(x > 0.999, "over 99.9 %",
                 ifelse(x > 0.99, "over 99 %", ifelse(x < 0.001, "below 0.1 %", paste(digits, "%"))))
  ifelse(is.na(x), "\u2013", text)
}

listed <- function(x, last = "and", none = "nothing") {
  if (!length(x)) none else if (length(x) == 1) x else paste(paste(x[-length(x)], collapse = ", "), last, x[length(x)])
}

change_words <- function(before, after, unit) {
  pair <- short(c(before, after))
  unit <- if (nzchar(unit)) paste0(" ", pretty_unit(unit)) else ""
  if (pair[1] == pair[2]) paste0("stays at ", pair[1], unit)
  else paste0(if (after < before) "falls" else "rises", " from ", pair[1], " to ", pair[2], unit)
}

time_label <- function(time) if (is.numeric(time)) "time [h]"

time_axis <- function(time) {
  if (!is.numeric(time))
    ggplot2::scale_x_datetime(breaks = function(limits) pretty(limits, 6), date_labels = "%d %b", guide = apart)
}

# Middle of the clock hour in which an interval lies that ends at `time`.
hour_of_day <- function(time, step_h) {
  if (is.numeric(time)) return(floor((time - step_h / 2) %% 24) + 0.5)
  as.POSIXlt(time - 1800 * step_h)$hour + 0.5
}

use_names <- c(calibrate = "calibration", validate = "held out")

# Prediction of a model at its calibration and held-out rows, with the residual.
prediction_rows <- function(model) {
  p <- model$prediction
  data.frame(time = p$time, use = factor(use_names[p$use], use_names), part = paste(p$use, p$segment),
             observed = p$observed, simulated = p$mean, lower95 = p$lower95, upper95 = p$upper95,
             residual = p$observed - p$mean,
             row = seq_len(nrow(p)))
}

leading_condition <- function(upgrade) {
  m <- upgrade$measurements
  name <- upgrade$models[[1]]$attribution$table$boundary[1]
  list(name = name, time = m$time, value = condition_values(m, name))
}

condition_values <- function(measurements, name) {
  own <- measurements$boundary[, measurements$condition == match(name, measurements$conditions), drop = FALSE]
  if (ncol(own) == 1) own[, 1] else (atan2(own[, 1], own[, 2]) * 180 / pi) %% 360
}

score_of <- function(upgrade, use, score) vapply(upgrade_stages(upgrade), function(s) s$scores[[use]][[score]], 0)

has_validation <- function(upgrade) !anyNA(score_of(upgrade, "validate", "rmse"))
