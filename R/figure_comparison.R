# Figures of a comparison: one row or panel for each model, the model of highest evidence in colour.

comparison_figures <- c("evidence", "criteria", "attribution", "fit", "discrepancy", "parameters",
                        "heat_loss", "held_out")

#' @export
figures_of.amiss_comparison <- function(x) {
  missing <- c(if (!any(lengths(lapply(x$models, `[[`, "heat_loss")))) "heat_loss",
               if (!validates(x)) "held_out")
  setdiff(comparison_figures, missing)
}

#' @rdname figures
#' @export
plot.amiss_comparison <- function(x, which = "evidence", ...) {
  rlang::check_dots_empty()
  draw(comparison_figure(x, which))
}

#' @rdname figures
#' @export
autoplot.amiss_comparison <- function(object, which = "evidence", ...) {
  rlang::check_dots_empty()
  comparison_figure(object, which)
}

comparison_figure <- function(comparison, which, call = rlang::caller_env()) {
  check_whole(comparison, "object", call = call)
  comparison <- labelled(comparison)
  check_input(checkmate::check_choice(which, figures_of(comparison)), "which", call = call)
  switch(which,
         evidence = figure_evidence(comparison),
         criteria = figure_criteria(comparison),
         attribution = if (comparison$method == "paper") figure_index(comparison)
                       else figure_dropped(comparison),
         fit = figure_models_in_time(comparison, "calibrate"),
         held_out = figure_models_in_time(comparison, "validate"),
         discrepancy = figure_discrepancies(comparison),
         parameters = figure_models_parameters(comparison),
         heat_loss = figure_heat_loss(comparison))
}

model_colours <- c("highest evidence" = "#0072B2", "other models" = "#E69F00")

model_scales <- function() ggplot2::scale_colour_manual(
  values = model_colours, aesthetics = c("colour", "fill"), drop = FALSE)

# Models in their order, and which is best.
mark_models <- function(table, comparison) {
  table$standing <- factor(ifelse(table$model == best_model(comparison), names(model_colours)[1],
                                  names(model_colours)[2]), names(model_colours))
  table$model <- factor(table$model, names(comparison$models))
  table
}

figure_evidence <- function(comparison) {
  table <- mark_models(comparison$tables$evidence, comparison)
  told <- paste0(table$model, ": ", sprintf("%.1f", table$log10_evidence), ", probability ",
                 percent(table$probability), ifelse(table$trusted, "", " (rough)"))
  names(told) <- table$model
  figure <- ggplot2::ggplot(
    table, ggplot2::aes(.data$log10_evidence, .data$model, colour = .data$standing)) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower95, xmax = .data$upper95),
                            linewidth = 1.4) + ggplot2::geom_point(size = 4) +
    ggplot2::scale_x_continuous(guide = apart) +
    ggplot2::scale_y_discrete(limits = rev, labels = function(x) wrap_labels(0.36)(told[x])) +
    model_scales() +
    figure_titles(sub(":.*", "", evidence_sentences(comparison)[1]),
                  paste("How well each model predicts the record before it is seen, with the price",
                        "of its freedom. Lines: 95 % intervals. 2 more: 100 times more probable."),
                  x = "log10 evidence") +
    figure_theme()
  with_height(figure, 2.2 + 0.6 * nrow(table))
}

figure_criteria <- function(comparison) {
  ranks <- comparison$tables$ranking
  criteria <- setdiff(names(ranks), "model")
  table <- do.call(rbind, lapply(criteria, function(name) data.frame(
    model = ranks$model, criterion = criterion_names[[name]], rank = ranks[[name]])))
  table$criterion <- factor(table$criterion, criterion_names[criteria])
  table$model <- factor(table$model, rev(names(comparison$models)))
  table$first <- factor(ifelse(table$rank == 1, "first", "not first"), c("first", "not first"))
  first <- disagreements(comparison)
  title <- if (length(first)) paste("Not the choice of the evidence:", listed(
    unname(criterion_names[names(first)]))) else "All criteria choose the same model first"
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$criterion, .data$model, fill = .data$first)) +
    ggplot2::geom_tile(colour = "white", linewidth = 2) +
    ggplot2::geom_text(ggplot2::aes(label = format(.data$rank), colour = .data$first), size = 5.2,
                       fontface = "bold") +
    ggplot2::scale_fill_manual(values = c("first" = "#0072B2", "not first" = "grey92")) +
    ggplot2::scale_colour_manual(values = c("first" = "white", "not first" = "grey20")) +
    ggplot2::scale_x_discrete(NULL, position = "top") +
    figure_titles(title, "Rank of each model by each criterion; blue is first.", y = NULL) +
    figure_theme() +
    ggplot2::theme(legend.position = "none", panel.grid = ggplot2::element_blank(),
                   axis.text.x.top = ggplot2::element_text(angle = 90, hjust = 0, vjust = 0.5))
  with_height(figure, 3.2 + 0.5 * nlevels(table$model))
}

attribution_words <- function(comparison) {
  named <- lapply(split(comparison$tables$attribution,
                        factor(comparison$tables$attribution$model, names(comparison$models))),
                  significant_conditions)
  best <- best_model(comparison)
  sprintf("%s, of highest evidence, leaves an error that responds to %s", best,
          listed(named[[best]], none = "no boundary condition"))
}

condition_panels <- function(table, comparison, value) {
  table <- mark_models(table, comparison)
  table$boundary <- factor(table$boundary, rev(comparison$measurements$conditions))
  table$state <- ifelse(table$significant, "significant", "may be chance")
  ggplot2::ggplot(table, ggplot2::aes(.data[[value]], .data$boundary, colour = .data$standing,
                                      shape = .data$state)) +
    ggplot2::geom_vline(xintercept = 0, colour = "grey40") +
    ggplot2::scale_shape_manual(values = c("significant" = 19, "may be chance" = 21)) +
    ggplot2::facet_wrap(ggplot2::vars(.data$model), ncol = min(3, nlevels(table$model)),
                        labeller = wrap_strips(3)) + model_scales() + figure_theme()
}

panel_height <- function(comparison) 2.3 +
  ceiling(length(comparison$models) / 3) * (0.6 + 0.3 * length(comparison$measurements$conditions))

figure_index <- function(comparison) {
  figure <- condition_panels(comparison$tables$attribution, comparison, "difference") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower95, xmax = .data$upper95),
                            linewidth = 1.3, show.legend = FALSE) +
    ggplot2::geom_point(size = 3.2, fill = "white", stroke = 1.1) +
    figure_titles(attribution_words(comparison),
                  paste("Share of the discrepancy's variance that one condition explains alone,",
                        "less that of white noise; lines: 95 % highest-density intervals."),
                  x = "variance index", y = NULL)
  with_height(figure, panel_height(comparison))
}

figure_dropped <- function(comparison) {
  table <- comparison$tables$attribution
  figure <- condition_panels(table, comparison, "log10_bf_dropped") +
    ggplot2::geom_linerange(ggplot2::aes(xmin = 0, xmax = .data$log10_bf_dropped), linewidth = 1.1,
                            show.legend = FALSE) +
    ggplot2::geom_point(size = 3.2, fill = "white", stroke = 1.1) +
    signed_log_axis(table$log10_bf_dropped) +
    figure_titles(attribution_words(comparison),
                  paste("Each boundary condition, present and past: how much worse the",
                        "discrepancy is explained without it."),
                  x = "log10 Bayes factor lost without it, axis compressed")
  with_height(figure, panel_height(comparison))
}

# Measured and simulated rows of one use, a panel for each model.
figure_models_in_time <- function(comparison, use) {
  m <- comparison$measurements
  table <- mark_models(
    bind_models(comparison$models,
                function(model) prediction_rows(model)[model$prediction$use == use, ]),
    comparison)
  score <- if (use == "calibrate") "rmse_calibration" else "rmse_validation"
  criteria <- comparison$tables$criteria
  labels <- stats::setNames(paste0(criteria$model, "\n",
                                   with_unit(short(criteria[[score]]), m$unit)),
                            criteria$model)
  lead <- criteria$model[which.min(criteria[[score]])]
  title <- sprintf("%s %s is typically wrong by least: %s",
                   if (use == "calibrate") "In calibration" else "On data not seen", lead,
                   with_unit(short(min(criteria[[score]])), m$unit))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time, group = .data$part)) +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$lower95, ymax = .data$upper95,
                                      fill = .data$standing), alpha = 0.25) +
    ggplot2::geom_point(ggplot2::aes(y = .data$observed), colour = "grey45", size = 0.9) +
    ggplot2::geom_line(ggplot2::aes(y = .data$simulated, colour = .data$standing),
                       linewidth = 0.7) +
    ggplot2::facet_grid(ggplot2::vars(.data$model),
                        labeller = function(strip)
                          lapply(strip, function(x) wrap_labels(0.2)(labels[x]))) +
    model_scales() +
    figure_titles(title,
                  paste("Grey: measured. Coloured: simulated, with the band that should hold 95 %",
                        "of the measurements. At the right: root mean squared error."),
                  x = time_label(table$time),
                  y = axis_label(target_label(m), level_unit(m$unit, table$observed))) +
    time_axis(table$time) + figure_theme() +
    ggplot2::theme(strip.text.y = ggplot2::element_text(angle = 0))
  with_height(figure, 2 + 1.15 * length(comparison$models))
}

figure_discrepancies <- function(comparison) {
  m <- comparison$measurements
  table <- mark_models(bind_models(comparison$models, function(model) {
    d <- discrepancy(model$fit)
    transform(d$series, part = d$segment)
  }), comparison)
  size <- vapply(split(table$discrepancy, table$model), function(d) sqrt(mean(d^2)), 0)
  title <- sprintf("The discrepancy is least in %s: typically %s", names(size)[which.min(size)],
                   with_unit(short(min(size)), m$unit))
  labels <- stats::setNames(paste0(names(size), "\n", with_unit(short(size), m$unit)), names(size))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$time, group = .data$part)) +
    ggplot2::geom_hline(yintercept = 0, colour = "grey40") +
    discrepancy_layers("standing") +
    ggplot2::facet_grid(ggplot2::vars(.data$model),
                        labeller = function(strip)
                          lapply(strip, function(x) wrap_labels(0.2)(labels[x]))) +
    model_scales() +
    figure_titles(title, paste("Points: measured - simulated. Coloured: the discrepancy that",
                               "responds to boundary conditions, with its 95 % band; at the right",
                               "its root mean square."),
                  x = time_label(table$time), y = axis_label("error", m$unit)) +
    time_axis(table$time) + figure_theme() +
    ggplot2::theme(strip.text.y = ggplot2::element_text(angle = 0))
  with_height(figure, 2 + 1.15 * length(comparison$models))
}

figure_models_parameters <- function(comparison) {
  table <- mark_models(comparison$tables$parameters, comparison)
  table$panel <- axis_label(table$label, table$unit)
  table$panel <- factor(table$panel, unique(table$panel))
  table$true <- true_values(comparison, table$name)
  known <- table[!is.na(table$true), ]
  inside <- known$lower95 <= known$true & known$true <= known$upper95
  best <- known$model == best_model(comparison)
  title <- if (!any(best)) "What the measurements say of the parameters"
           else sprintf("%s: %d of %d parameters have the truth inside their 95 %% interval",
                        best_model(comparison), sum(inside[best]), sum(best))
  figure <- ggplot2::ggplot(table, ggplot2::aes(y = .data$model, colour = .data$standing)) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$prior_lower, xmax = .data$prior_upper),
                            colour = "grey90", linewidth = 6) +
    ggplot2::geom_linerange(ggplot2::aes(xmin = .data$lower95, xmax = .data$upper95),
                            linewidth = 1.4) +
    ggplot2::geom_point(ggplot2::aes(.data$median), size = 2.8) +
    ggplot2::geom_point(ggplot2::aes(.data$true, shape = "true value"), known, colour = "black",
                        size = 3, stroke = 1.3) +
    ggplot2::scale_shape_manual(values = c("true value" = 4)) +
    ggplot2::scale_x_continuous(n.breaks = 4, labels = short_axis, guide = apart) +
    ggplot2::scale_y_discrete(NULL, limits = rev, labels = wrap_labels(0.25)) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 3, scales = "free",
                        labeller = wrap_strips(3)) + model_scales() +
    figure_titles(title, paste("Grey: what was thought possible (prior). Points and",
                               "lines: what the measurements say, with 95 %",
                               "intervals.", if (nrow(known)) "Crosses: true values.")) +
    figure_theme() + ggplot2::theme(strip.text = ggplot2::element_text(size = ggplot2::rel(0.83)))
  rows <- tapply(as.character(table$model), table$panel, function(x) length(unique(x)))
  with_height(figure, 1.9 + ceiling(nlevels(table$panel) / 3) * (0.7 + 0.23 * max(rows)))
}

heat_loss_table <- function(comparison) {
  table <- do.call(rbind, lapply(comparison$models, function(model)
    if (length(model$heat_loss)) data.frame(model = model$name, value = model$heat_loss)))
  rownames(table) <- NULL
  table
}

figure_heat_loss <- function(comparison) {
  table <- mark_models(heat_loss_table(comparison), comparison)
  true <- true_heat_loss(comparison)
  best <- table$value[table$model == best_model(comparison)]
  title <- if (!length(best)) "Heat loss coefficients of the models"
           else paste0(best_model(comparison), " finds a heat loss coefficient of ",
                       short(mean(best), 3), " W/K",
                       if (!is.na(true)) paste0("; the true one is ", short(true, 3), " W/K"))
  figure <- ggplot2::ggplot(table,
                            ggplot2::aes(.data$value, .data$model, colour = .data$standing,
                                         fill = .data$standing)) +
    (if (!is.na(true)) ggplot2::geom_vline(xintercept = true, colour = "black", linetype = "dashed",
                                           linewidth = 0.9)) +
    ggplot2::geom_violin(alpha = 0.35, scale = "width", width = 0.8) +
    ggplot2::stat_summary(fun = mean, geom = "point", size = 3, show.legend = FALSE) +
    ggplot2::scale_y_discrete(NULL, limits = rev, labels = wrap_labels(0.25)) +
    model_scales() +
    figure_titles(title, paste("Shapes: the posterior, from the simulator at its draws, in the",
                               "steady state and the mean wind of the calibration. Points:",
                               "means.", if (!is.na(true)) "Dashed: the truth."),
                  x = "heat loss coefficient [W/K]") +
    figure_theme()
  with_height(figure, 2.2 + 0.55 * nlevels(droplevels(table$model)))
}
