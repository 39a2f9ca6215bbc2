figure_names <- c("fit", "attribution", "candidates", "parameters", "discrepancy", "response", "gain", "mean_day")

# Okabe and Ito's colours: told apart by colour-blind readers and in print.
stage_colours <- c("before" = "#D55E00", "after" = "#0072B2", "the model" = "#0072B2")

#' Figures
#'
#' `plot()` draws a figure and returns it invisibly; `autoplot()` of ggplot2 returns it undrawn, to be changed or saved.
#'
#' @param x,object An object of this package.
#' @param which Which figure of an upgrade: `"fit"` (measured and simulated), `"attribution"` (what the error answers
#'   to), `"candidates"` (mechanisms tried), `"parameters"`, `"discrepancy"` (over time), `"response"` (error against
#'   the leading boundary condition), `"gain"` (scores before and after) or `"mean_day"`. Of a comparison: `"evidence"`,
#'   `"criteria"` (ranks by each), `"attribution"`, `"fit"` (measured and simulated), `"discrepancy"` (over time), `"parameters"`,
#'   `"heat_loss"` (of zones) or `"held_out"` (where rows validate).
#' @param ... Not used.
#' @return A ggplot.
#' @examples
#' table <- data.frame(hour = 1:96, Ti = 20 + sin(1:96 / 4), Te = 5 + 3 * sin(1:96 / 4))
#' plot(measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1, warmup = 6))
#' @name figures
NULL

#' @rdname figures
#' @export
plot.amiss_upgrade <- function(x, which = "fit", ...) draw(upgrade_figure(x, which))

#' @rdname figures
#' @export
plot.amiss_attribution <- function(x, ...) draw(figure_attribution(list("the model" = x)))

#' @rdname figures
#' @export
plot.amiss_discrepancy <- function(x, ...) draw(figure_discrepancy(list("the model" = x)))

#' @rdname figures
#' @export
plot.amiss_calibration <- function(x, ...) draw(figure_parameters(list("the model" = x)))

#' @rdname figures
#' @export
plot.amiss_measurements <- function(x, ...) draw(figure_measurements(x))

#' @rdname figures
#' @export
autoplot.amiss_upgrade <- function(object, which = "fit", ...) upgrade_figure(object, which)

#' @rdname figures
#' @export
autoplot.amiss_attribution <- function(object, ...) figure_attribution(list("the model" = object))

#' @rdname figures
#' @export
autoplot.amiss_discrepancy <- function(object, ...) figure_discrepancy(list("the model" = object))

#' @rdname figures
#' @export
autoplot.amiss_calibration <- function(object, ...) figure_parameters(list("the model" = object))

#' @rdname figures
#' @export
autoplot.amiss_measurements <- function(object, ...) figure_measurements(object)

draw <- function(figure) {
  print(figure)
  invisible(figure)
}

upgrade_figure <- function(upgrade, which, call = rlang::caller_env()) {
  check_input(checkmate::check_choice(which, figure_names), "which", call = call)
  stages <- upgrade_stages(upgrade)
  switch(which,
    fit = figure_fit(upgrade),
    attribution = figure_attribution(lapply(stages, `[[`, "attribution")),
    candidates = figure_candidates(upgrade),
    parameters = figure_parameters(lapply(stages, `[[`, "fit")),
    discrepancy = figure_discrepancy(lapply(stages, function(s) discrepancy(s$fit)), leading_condition(upgrade)),
    response = figure_response(upgrade),
    gain = figure_gain(upgrade),
    mean_day = figure_mean_day(upgrade))
}

# Names of the figures that an object has.
figures_of <- function(x) UseMethod("figures_of")

#' @export
figures_of.amiss_upgrade <- function(x) figure_names

# Writes every figure as a PNG; returns the paths.
save_figures <- function(x, folder, width = 9, dpi = 120) {
  vapply(figures_of(x), function(which) {
    figure <- ggplot2::autoplot(x, which)
    path <- file.path(folder, paste0(which, ".png"))
    ggplot2::ggsave(path, figure, width = width, height = figure_height(figure), dpi = dpi, bg = "white")
    path
  }, "")
}

# ---- what the figures share

# The first and the last model, or the only one.
upgrade_stages <- function(upgrade) {
  k <- length(upgrade$models)
  if (k < 2) list("the model" = upgrade$models[[1]]) else list(before = upgrade$models[[1]], after = upgrade$models[[k]])
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
  figure
}

figure_height <- function(figure) attr(figure, "height_in") %||% 5

figure_theme <- function() {
  ggplot2::theme_minimal(base_size = 15) +
    ggplot2::theme(plot.title = ggplot2::element_text(face = "bold", size = 17, lineheight = 1.05),
                   plot.subtitle = ggplot2::element_text(colour = "grey30", size = 13.5, lineheight = 1.1),
                   plot.title.position = "plot", plot.margin = ggplot2::margin(8, 14, 8, 8),
                   panel.grid.minor = ggplot2::element_blank(), panel.spacing = ggplot2::unit(14, "pt"),
                   strip.text = ggplot2::element_text(face = "bold", hjust = 0), strip.placement = "outside",
                   strip.text.y.left = ggplot2::element_text(angle = 90, hjust = 0.5),
                   axis.text = ggplot2::element_text(colour = "grey20"), legend.position = "top", legend.justification = "left",
                   legend.title = ggplot2::element_blank(), legend.margin = ggplot2::margin(0, 0, 0, 0))
}

figure_titles <- function(title, subtitle = NULL, x = NULL, y = NULL) {
  wrap <- function(text, width) {  # a number stays beside its "%"
    if (!is.null(text)) gsub("\001", " ", paste(strwrap(gsub("([0-9]) %", "\\1\001%", text), width), collapse = "\n"), fixed = TRUE)
  }
  ggplot2::labs(title = wrap(title, 64), subtitle = wrap(subtitle, 92), x = x, y = y)
}

stage_scales <- function() ggplot2::scale_colour_manual(values = stage_colours, aesthetics = c("colour", "fill"))

# Reads 2 and 500 on one axis, either side of zero.
signed_log_axis <- function(name, values, extra = NULL) {
  steps <- c(1, 3, 10, 30, 100, 300, 1000, 3000, 10000)
  if (!is.null(extra)) steps <- c(steps[abs(log(steps / extra)) > 0.6], extra)
  breaks <- sort(c(-steps, 0, steps))
  reach <- range(values, 0, na.rm = TRUE)
  ggplot2::scale_x_continuous(name, trans = "pseudo_log", breaks = breaks[breaks >= reach[1] - 1 & breaks <= reach[2] + 1],
                              expand = ggplot2::expansion(mult = c(0.04, 0.16)))
}

pretty_unit <- function(unit) gsub("m3", "m\u00b3", gsub("m2", "m\u00b2", unit, fixed = TRUE), fixed = TRUE)

axis_label <- function(name, unit) ifelse(nzchar(unit), paste0(name, " [", pretty_unit(unit), "]"), name)

# Temperatures whose differences are in K are themselves recorded in degrees Celsius, unless they are far above.
level_unit <- function(unit, values) if (identical(unit, "K") && max(values, na.rm = TRUE) < 150) "\u00b0C" else unit

# A few significant digits, not in powers of ten unless very far from one.
short <- function(x, digits = 2) {
  far <- abs(x) >= 1e7 | (abs(x) < 1e-4 & x != 0)
  text <- ifelse(far, format_each(signif(x, digits)), formatC(signif(x, digits), digits = digits, format = "fg", flag = "#", big.mark = ","))
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
  text <- ifelse(x > 0.999, "over 99.9 %", ifelse(x > 0.99, "over 99 %", ifelse(x < 0.001, "below 0.1 %", paste(digits, "%"))))
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

clock <- function(time) {
  if (is.numeric(time) || inherits(time, "POSIXct")) return(time)
  # Rounded to milliseconds, as hours are not whole: a second before 00:10:00 is in another minute.
  as.POSIXct(round(3600 * read_time(time, "time"), 3), origin = "1970-01-01", tz = "UTC")
}

time_label <- function(time) if (is.numeric(time)) "time [h]"

time_axis <- function(time) {
  if (!is.numeric(time)) ggplot2::scale_x_datetime(breaks = function(limits) pretty(limits, 6), date_labels = "%d %b")
}

# Middle of the clock hour in which an interval lies that ends at `time`.
hour_of_day <- function(time, step_h) {
  if (is.numeric(time)) return(floor((time - step_h / 2) %% 24) + 0.5)
  as.POSIXlt(clock(time) - 1800 * step_h)$hour + 0.5
}

use_names <- c(calibrate = "calibration", validate = "held out")

# Prediction of a model at its calibration and held-out rows, with the residual.
prediction_rows <- function(model) {
  p <- model$prediction
  data.frame(time = clock(p$time), use = factor(use_names[p$use], use_names), part = paste(p$use, p$segment),
             observed = p$observed, simulated = p$mean, lower95 = p$lower95, upper95 = p$upper95, residual = p$observed - p$mean,
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

# ---- figures

fit_title <- function(upgrade) {
  unit <- upgrade$measurements$unit
  seen <- score_of(upgrade, "calibrate", "rmse")
  held <- score_of(upgrade, "validate", "rmse")
  if (length(seen) < 2) {
    title <- paste("The calibrated model is typically wrong by", short(seen), pretty_unit(unit))
    return(if (anyNA(held)) title else paste0(title, "; on data it has not seen, by ", short(held), " ", pretty_unit(unit)))
  }
  title <- paste("The typical error", change_words(seen[1], seen[2], unit))
  if (anyNA(held)) title else paste0(title, "; on data the model has not seen it ", change_words(held[1], held[2], unit))
}

figure_fit <- function(upgrade) {
  m <- upgrade$measurements
  table <- stage_table(upgrade_stages(upgrade), prediction_rows)
  panels <- c(axis_label(m$target, level_unit(m$unit, table$observed)), axis_label("error", m$unit))
  in_panel <- function(i, table) cbind(table, panel = factor(panels[i], panels))
  measured <- table[table$stage == levels(table$stage)[1], ]
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time)) +
    ggplot2::geom_hline(ggplot2::aes(yintercept = 0), in_panel(2, data.frame(zero = 0)), colour = "grey40") +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$lower95, ymax = .data$upper95, fill = .data$stage, group = interaction(.data$stage, .data$part)),
                         in_panel(1, table), alpha = 0.18) +
    ggplot2::geom_line(ggplot2::aes(y = .data$observed, group = .data$part), in_panel(1, measured), colour = "grey15", linewidth = 1.5) +
    ggplot2::geom_line(ggplot2::aes(y = .data$simulated, colour = .data$stage, group = interaction(.data$stage, .data$part)),
                       in_panel(1, table), linewidth = 0.7) +
    ggplot2::geom_line(ggplot2::aes(y = .data$residual, colour = .data$stage, group = interaction(.data$stage, .data$part)),
                       in_panel(2, table), linewidth = 0.7) +
    ggplot2::facet_grid(panel ~ use, scales = "free", space = "free_x", switch = "y") +
    stage_scales() +
    figure_titles(fit_title(upgrade), "Above, black: measured; coloured: simulated, with the band that should hold 95 % of the measurements. Below: error = measured - simulated.",
                  x = time_label(table$time)) +
    time_axis(table$time) + figure_theme()
  with_height(figure, 6.4)
}

attribution_title <- function(attributions) {
  named <- lapply(attributions, function(a) significant_conditions(a$table))
  if (length(named) < 2) return(paste("The discrepancy of the model follows", listed(named[[1]], none = "no boundary condition")))
  if (!length(named[[1]]) && !length(named[[2]])) return("The remaining error follows no boundary condition, neither before nor after")
  sprintf("Before, the remaining error follows %s; after the change it follows %s", listed(named[[1]]), listed(named[[2]]))
}

figure_attribution <- function(attributions) {
  table <- stage_table(attributions, function(a) a$table)
  strength <- tapply(table$log10_bf_dropped, table$boundary, max)
  table$boundary <- factor(table$boundary, names(sort(strength)))
  table$label <- ifelse(table$significant, paste0("   ", percent(pmax(table$share, 0)), " of it"), "")
  table$y <- as.integer(table$boundary) + if (length(attributions) > 1) ifelse(table$stage == "before", 0.18, -0.18) else 0
  axis <- signed_log_axis("evidence lost when it is ignored (log10 Bayes factor)", table$log10_bf_dropped)
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$log10_bf_dropped, .data$y, colour = .data$stage)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = 0, xmax = .data$log10_bf_dropped), linewidth = 1.1) +
    ggplot2::geom_point(ggplot2::aes(shape = .data$significant), size = 4, fill = "white", stroke = 1.3) +
    ggplot2::geom_text(ggplot2::aes(label = .data$label), hjust = 0, size = 4.6, show.legend = FALSE) +
    ggplot2::scale_shape_manual(values = c("TRUE" = 19, "FALSE" = 21), labels = c("TRUE" = "significant", "FALSE" = "may be chance"),
                                limits = c("TRUE", "FALSE")) +
    ggplot2::scale_y_continuous(NULL, breaks = seq_along(levels(table$boundary)), labels = levels(table$boundary)) +
    axis + stage_scales() +
    figure_titles(attribution_title(attributions), "Each boundary condition, present and past: how much worse the remaining error is explained without it. Per cent: its part of that error.") +
    figure_theme()
  with_height(figure, 2.4 + 0.48 * nlevels(table$boundary))
}

# Every trial, with its step and whether it was adopted there.
candidate_table <- function(upgrade) {
  table <- upgrade$candidates
  steps <- unique(table$from)
  adopted <- as.character(unlist(lapply(upgrade$models, `[[`, "mechanism")))
  table$step <- match(table$from, steps)
  table$adopted <- table$mechanism == adopted[table$step] & !is.na(adopted[table$step])
  table
}

candidates_title <- function(table, decisive) {
  if (!any(table$adopted)) {
    best <- table[which.max(table$log10_bf), ]
    return(if (best$log10_bf >= decisive) "No mechanism was adopted: the interval of the best reaches to zero" else "No mechanism explains the measurements decisively better than no change")
  }
  paste0("The measurements call for ", listed(table$mechanism[table$adopted]))
}

figure_candidates <- function(upgrade) {
  if (is.null(upgrade$candidates)) return(with_height(ggplot2::ggplot() + figure_titles("No mechanism was tried") + figure_theme(), 1.5))
  decisive <- upgrade$control$decisive
  table <- candidate_table(upgrade)
  adopted <- c("no change", table$mechanism[table$adopted])
  table$panel <- factor(ifelse(table$step == 1, "added to the base model", paste("added after", adopted[table$step])))
  table$panel <- factor(table$panel, unique(table$panel[order(table$step)]))
  table$row <- paste(formatC(rank(table$log10_bf), width = 4, flag = "0"), table$mechanism)
  table$state <- factor(ifelse(table$adopted, "adopted", ifelse(table$trusted, "tried", "tried, estimate rough")), c("adopted", "tried", "tried, estimate rough"))
  grey <- "grey45"
  axis <- signed_log_axis("evidence for it (log10 Bayes factor)", unlist(table[c("lower95", "upper95")]), decisive)
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$log10_bf, .data$row, colour = .data$state, shape = .data$state)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::geom_vline(xintercept = decisive, linetype = "dashed", colour = "grey20") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower95, xmax = .data$upper95), linewidth = 1.1, show.legend = FALSE) +
    ggplot2::geom_point(ggplot2::aes(size = .data$state), fill = "white", stroke = 1.2) +
    ggplot2::scale_size_manual(values = c("adopted" = 6, "tried" = 3.4, "tried, estimate rough" = 3.4), drop = FALSE) +
    ggplot2::geom_text(ggplot2::aes(x = pmax(.data$upper95, .data$log10_bf), label = paste0("   ", signed(.data$log10_bf))), hjust = 0, size = 4.4, show.legend = FALSE) +
    ggplot2::scale_colour_manual(values = c("adopted" = stage_colours[["after"]], "tried" = grey, "tried, estimate rough" = grey), drop = FALSE) +
    ggplot2::scale_shape_manual(values = c("adopted" = 18, "tried" = 19, "tried, estimate rough" = 21), drop = FALSE) +
    ggplot2::scale_y_discrete(labels = function(x) sub("^[0-9.]+ ", "", x)) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, scales = "free_y") +
    axis +
    figure_titles(candidates_title(table, decisive),
                  sprintf("Right of the dashed line (odds of %s to 1) a mechanism may be adopted, the best one first. Scale in powers of ten: 2 is 100 to 1. Lines: 95 %% intervals.", format(10^decisive, big.mark = ",")),
                  y = NULL) +
    figure_theme()
  with_height(figure, 2.4 + 0.31 * nrow(table) + 0.5 * nlevels(table$panel))
}

signed <- function(x) ifelse(abs(x) < 9.95, sprintf("%+.1f", x), sprintf("%+.0f", x))

# Parameters of a calibration with their priors; `at_edge` where the median lies in the outer 5 % of the prior.
parameter_rows <- function(fit) {
  table <- parameter_table(fit)
  declared <- fit$emulator$parameters[table$name]
  side <- function(u, fallback) vapply(declared, function(p) {
    limit <- prior_quantile(p$prior, u)
    if (is.finite(limit)) limit else prior_quantile(p$prior, fallback)
  }, 0)
  cbind(table, label = vapply(declared, `[[`, "", "label"), prior_lower = side(0, 0.001), prior_upper = side(1, 0.999),
        at_edge = unname(edge_of_prior(fit)[table$name]))
}

parameters_title <- function(table) {
  count <- vapply(split(table$at_edge, table$stage), function(e) sprintf("%d of %d", sum(e), length(e)), "")
  if (length(count) < 2) paste("At the edge of what was thought possible:", count, "parameters")
  else sprintf("At the edge of what was thought possible: %s parameters before, %s after", count[1], count[2])
}

figure_parameters <- function(fits) {
  table <- stage_table(fits, parameter_rows)
  table$panel <- axis_label(table$label, table$unit)
  table$panel <- factor(table$panel, unique(table$panel))
  table$row <- factor(table$stage, rev(levels(table$stage)))
  edge <- table[table$at_edge, ]
  figure <- ggplot2::ggplot(table, ggplot2::aes(y = .data$row, colour = .data$stage)) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$prior_lower, xmax = .data$prior_upper), colour = "grey88", linewidth = 9) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower95, xmax = .data$upper95), linewidth = 1.6) +
    ggplot2::geom_point(ggplot2::aes(.data$median), size = 3.6) +
    ggplot2::geom_point(ggplot2::aes(.data$median, shape = "at the edge of its prior"), edge, colour = "black", size = 6, stroke = 1.1) +
    ggplot2::scale_shape_manual(values = c("at the edge of its prior" = 1)) +
    ggplot2::scale_x_continuous(n.breaks = 4, labels = short_axis) +
    ggplot2::coord_cartesian(clip = "off") +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 2, scales = "free", labeller = ggplot2::label_wrap_gen(38)) +
    stage_scales() +
    figure_titles(parameters_title(table), "Grey: what was thought possible (prior). Points and lines: what the measurements say, with 95 % intervals.") +
    figure_theme() +
    ggplot2::theme(panel.grid.major.y = ggplot2::element_blank(), axis.text.y = ggplot2::element_blank(), strip.text = ggplot2::element_text(size = 13))
  with_height(figure, 1.9 + 1.02 * ceiling(nlevels(table$panel) / 2))
}

discrepancy_title <- function(table) {
  size <- vapply(split(table$discrepancy, table$stage), function(d) sqrt(mean(d^2)), 0)
  unit <- attr(table, "unit")
  if (length(size) < 2) paste("The part of the error that answers to boundary conditions is typically", short(size), pretty_unit(unit))
  else paste("The part of the error that answers to boundary conditions", change_words(size[1], size[2], unit))
}

# Discrepancies over time, one panel each on a common scale, and the leading boundary condition below them.
figure_discrepancy <- function(discrepancies, leading = NULL) {
  unit <- discrepancies[[1]]$unit
  table <- stage_table(discrepancies, function(d) {
    table <- cbind(d$series, segment = d$segment)
    table$time <- clock(table$time)
    table
  })
  attr(table, "unit") <- unit
  stage_panel <- paste0(ifelse(levels(table$stage) == "the model", "error", levels(table$stage)), if (nzchar(unit)) paste0(" [", pretty_unit(unit), "]"))
  panels <- c(stage_panel, leading$name)
  table$panel <- factor(stage_panel[as.integer(table$stage)], panels)
  reach <- range(table$residual, table$lower95, table$upper95)
  corners <- expand.grid(time = table$time[1], y = reach, panel = factor(stage_panel, panels))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time)) +
    ggplot2::geom_blank(ggplot2::aes(y = .data$y), corners) +
    ggplot2::geom_hline(ggplot2::aes(yintercept = 0), corners, colour = "grey40") +
    ggplot2::geom_line(ggplot2::aes(y = .data$residual, group = .data$segment), colour = "grey60", linewidth = 0.6) +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$lower95, ymax = .data$upper95, fill = .data$stage, group = .data$segment), alpha = 0.3) +
    ggplot2::geom_line(ggplot2::aes(y = .data$discrepancy, colour = .data$stage, group = .data$segment), linewidth = 0.9) +
    leading_layer(leading, table, panels) +
    ggplot2::facet_grid(panel ~ ., scales = "free_y", switch = "y") +
    stage_scales() +
    figure_titles(discrepancy_title(table), paste0("Grey: measured - simulated. Coloured: the discrepancy, which answers to boundary conditions, with 95 % band.",
                                                   if (!is.null(leading)) paste0(" Below: ", leading$name, ", which leads.")), x = time_label(table$time)) +
    time_axis(table$time) + figure_theme() + ggplot2::theme(legend.position = "none")
  with_height(figure, 1.8 + 1.9 * length(panels))
}

leading_layer <- function(leading, table, panels) {
  if (is.null(leading)) return(NULL)
  time <- clock(leading$time)
  shown <- time %in% table$time
  series <- data.frame(time = time[shown], value = leading$value[shown], panel = factor(leading$name, panels))
  series$part <- cumsum(c(TRUE, diff(as.numeric(series$time)) > 1.5 * stats::median(diff(as.numeric(series$time)))))
  ggplot2::geom_line(ggplot2::aes(y = .data$value, group = .data$part), series, colour = "grey25", linewidth = 0.7)
}

response_title <- function(binned, name, noise) {
  swing <- vapply(split(binned$residual, binned$stage), function(r) diff(range(r)), 0)
  if (all(swing < 2 * noise)) return(paste("The error hardly depends on", name))
  if (length(swing) < 2) return(paste("How the error changes with", name))
  if (swing[2] < 0.7 * swing[1]) paste("The error depends on", name, "before the change, and less after it")
  else paste("The error depends on", name, "about as much after the change as before")
}

# Mean error in classes of the leading boundary condition; classes of fewer than five steps are left out.
figure_response <- function(upgrade, classes = 10) {
  leading <- leading_condition(upgrade)
  m <- upgrade$measurements
  table <- stage_table(upgrade_stages(upgrade), prediction_rows)
  table$value <- leading$value[match(table$time, clock(leading$time))]
  table$class <- cut(table$value, classes)
  binned <- stats::aggregate(cbind(residual, value) ~ class + stage, table, mean)
  binned <- binned[stats::aggregate(residual ~ class + stage, table, length)$residual >= 5, ]
  figure <- ggplot2::ggplot(binned, ggplot2::aes(.data$value, .data$residual, colour = .data$stage)) +
    ggplot2::geom_point(data = table, alpha = 0.18, size = 1.4, shape = 16) +
    ggplot2::geom_hline(yintercept = 0, colour = "grey40") +
    ggplot2::geom_line(linewidth = 1.2) +
    ggplot2::geom_point(size = 3.6) +
    stage_scales() +
    figure_titles(response_title(binned, leading$name, m$noise_sd), paste0("Small points: every time step. Large points: means over classes of ", leading$name, "."),
                  x = leading$name, y = axis_label("measured - simulated", m$unit)) +
    figure_theme()
  with_height(figure, 5)
}

gain_title <- function(upgrade) {
  use <- if (has_validation(upgrade)) "validate" else "calibrate"
  where <- if (use == "validate") "On data the model has not seen" else "In calibration"
  rmse <- score_of(upgrade, use, "rmse")
  inside <- score_of(upgrade, use, "coverage95")
  band <- paste(round(100 * inside[length(inside)]), "% of the measurements lie in the 95 % band")
  if (length(rmse) < 2) return(paste0(where, ", ", band))
  change <- 1 - rmse[2] / rmse[1]
  sprintf("%s the error %s by %s %%; %s", where, if (change >= 0) "falls" else "rises", round(100 * abs(change)), band)
}

gain_table <- function(upgrade) {
  unit <- pretty_unit(upgrade$measurements$unit)
  panels <- c(rmse = axis_label("typical error, RMSE", unit), crps = axis_label("error of the prediction with its band, CRPS", unit),
              coverage95 = "measurements inside the 95 % band [%]")
  table <- stage_table(upgrade_stages(upgrade), function(s) {
    rows <- expand.grid(score = names(panels), use = names(use_names), stringsAsFactors = FALSE)
    rows$value <- mapply(function(score, use) s$scores[[use]][[score]], rows$score, rows$use)
    rows
  })
  percent_rows <- table$score == "coverage95"
  table$value[percent_rows] <- 100 * table$value[percent_rows]
  table$label <- ifelse(percent_rows, round(table$value), short(table$value))
  table$panel <- factor(panels[table$score], panels)
  table$use <- factor(use_names[table$use], use_names)
  table[!is.na(table$value), ]
}

figure_gain <- function(upgrade) {
  table <- gain_table(upgrade)
  target <- data.frame(panel = factor(levels(table$panel)[3], levels(table$panel)), value = 95)
  dodge <- ggplot2::position_dodge(width = 0.8)
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$use, .data$value, fill = .data$stage)) +
    ggplot2::geom_col(position = dodge, width = 0.74) +
    ggplot2::geom_text(ggplot2::aes(label = .data$label, vjust = ifelse(.data$score == "coverage95", 3, -0.35),
                                    colour = ifelse(.data$score == "coverage95", "white", "black")), position = dodge, size = 4.3) +
    ggplot2::scale_colour_identity() +
    ggplot2::geom_hline(ggplot2::aes(yintercept = .data$value), target, linetype = "dashed", colour = "grey20") +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), scales = "free_y", labeller = ggplot2::label_wrap_gen(25)) +
    ggplot2::scale_y_continuous(expand = ggplot2::expansion(mult = c(0, 0.14))) +
    ggplot2::scale_fill_manual(values = stage_colours) +
    figure_titles(gain_title(upgrade), "Lower is better for the two errors; the third should come near 95.") +
    figure_theme() +
    ggplot2::theme(panel.grid.major.x = ggplot2::element_blank(), strip.text = ggplot2::element_text(vjust = 1))
  with_height(figure, 5)
}

mean_day_title <- function(binned, unit, noise) {
  stages <- split(binned[binned$use == "calibration", ], binned$stage[binned$use == "calibration"])
  worst <- stages[[1]][which.max(abs(stages[[1]]$residual)), ]
  if (abs(worst$residual) < noise) return("No time of day stands out from the noise")
  told <- function(r) paste(short(abs(r)), pretty_unit(unit), if (r > 0) "too low" else "too high")
  title <- sprintf("In calibration, around %02d:30, the simulation is on average %s", floor(worst$hour), told(worst$residual))
  if (length(stages) < 2) return(title)
  after <- stages[[2]]$residual[stages[[2]]$hour == worst$hour]
  paste0(title, " before, ", told(after), " after")
}

figure_mean_day <- function(upgrade) {
  m <- upgrade$measurements
  table <- stage_table(upgrade_stages(upgrade), prediction_rows)
  table$hour <- hour_of_day(table$time, m$step_h)
  binned <- stats::aggregate(residual ~ hour + use + stage, table, mean)
  spread <- stats::aggregate(residual ~ hour + use + stage, table, stats::quantile, probs = c(0.1, 0.9))
  binned[c("low", "high")] <- spread$residual
  figure <- ggplot2::ggplot(binned, ggplot2::aes(.data$hour, .data$residual, colour = .data$stage, fill = .data$stage)) +
    ggplot2::geom_hline(yintercept = 0, colour = "grey40") +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$low, ymax = .data$high), alpha = 0.18, colour = NA) +
    ggplot2::geom_line(linewidth = 1.2) +
    ggplot2::scale_x_continuous(breaks = seq(0, 24, 6), limits = c(0, 24)) +
    ggplot2::facet_wrap(ggplot2::vars(.data$use)) +
    stage_scales() +
    figure_titles(mean_day_title(binned, m$unit, m$noise_sd), "Lines: mean of all days. Bands: eight days of ten.", x = "hour of day",
                  y = axis_label("measured - simulated", m$unit)) +
    figure_theme()
  with_height(figure, 4.6)
}

figure_measurements <- function(measurements) {
  m <- measurements
  series <- c(list(m$y), lapply(m$conditions, function(name) condition_values(m, name)))
  panels <- c(axis_label(m$target, level_unit(m$unit, m$y)), m$conditions)
  uses <- c(warmup = "warm-up", use_names, none = "not used")
  table <- data.frame(time = rep(clock(m$time), length(panels)), value = unlist(series),
                      use = factor(uses[rep(m$use, length(panels))], uses), panel = factor(rep(panels, each = length(m$y)), panels),
                      part = rep(paste(m$segment, cumsum(c(TRUE, m$use[-1] != m$use[-length(m$use)]))), length(panels)))
  count <- function(use) sum(m$use == use & !is.na(m$y))
  title <- sprintf("%s: %d steps of %s h to calibrate, %d held out", m$name, count("calibrate"), format(m$step_h), count("validate"))
  figure <- ggplot2::ggplot(table[!is.na(table$value), ], ggplot2::aes(.data$time, .data$value, colour = .data$use, group = .data$part)) +
    ggplot2::geom_line(linewidth = 0.6) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1, scales = "free_y") +
    ggplot2::scale_colour_manual(values = stats::setNames(c("#999999", "#0072B2", "#009E73", "#CCCCCC"), uses)) +
    figure_titles(title, "The target above, the boundary conditions below it.", x = time_label(table$time)) +
    time_axis(table$time) + figure_theme()
  with_height(figure, 1.6 + 1.15 * length(panels))
}
