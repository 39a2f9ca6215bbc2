# The figures of a survey.

survey_figures <- c("causes", "studies", "gain")

state_colours <- c("named" = stage_colours[["after"]], "likely" = "#56B4E9",
                   "stand-in" = stage_colours[["before"]], "unexplained" = "grey45",
                   "nothing decisive" = "grey80", "undecided" = "grey95", "no result" = "white")

# Of each mechanism, in how many studies it was adopted; and how many studies have no cause, named
# or likely.
causes_table <- function(survey) {
  counts <- mechanism_counts(survey)
  counts <- counts[counts$named + counts$likely + counts$stand_in > 0, ]
  states <- c("named", "likely", "stand_in")
  adopted <- expand.grid(row = counts$mechanism, state = states, stringsAsFactors = FALSE)
  adopted$n <- unlist(lapply(states, function(state) counts[[state]]))
  adopted$state <- sub("_", "-", adopted$state)
  open <- c(unexplained = "unexplained", "nothing decisive" = "nothing", undecided = "undecided",
            "no result" = "no result")
  others <- data.frame(row = names(open), state = names(open),
                       n = vapply(open, function(v) sum(survey$studies$verdict == v), 0L))
  table <- rbind(adopted, others)
  table <- table[table$n > 0, ]
  table$row <- factor(table$row, rev(c(counts$mechanism, others$row)))
  table$state <- factor(table$state, names(state_colours))
  droplevels(table)
}

causes_title <- function(survey) {
  counts <- mechanism_counts(survey)
  counts <- counts[counts$named > 0, ]
  if (!nrow(counts)) return(sprintf("No cause is named in %s",
                                    studies_counted(nrow(survey$studies))))
  paste0("Named: ", listed(sprintf("%s in %d", counts$mechanism, counts$named)), " of ",
         studies_counted(nrow(survey$studies)))
}

whole_breaks <- function(limits) unique(round(pretty(limits)))

figure_causes <- function(survey) {
  table <- causes_table(survey)
  sums <- stats::aggregate(n ~ row, table, sum)
  counts <- paste0("  ", sums$n)
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$n, .data$row)) +
    ggplot2::geom_col(ggplot2::aes(fill = .data$state), width = 0.6, colour = "grey45",
                      position = ggplot2::position_stack(reverse = TRUE)) +
    ggplot2::geom_text(ggplot2::aes(label = counts), sums, hjust = 0, size = 4.4,
                       colour = "grey20") +
    ggplot2::scale_fill_manual(values = state_colours) +
    ggplot2::scale_x_continuous(breaks = whole_breaks, expand = ggplot2::expansion(c(0, 0.02)),
                                guide = apart) +
    ggplot2::scale_y_discrete(labels = wrap_labels(0.5)) +
    figure_titles(causes_title(survey),
                  paste("Each mechanism counts the studies that adopted it: a study with two",
                        "counts twice, and one with a stand-in alone is unexplained as well."),
                  x = "studies") +
    figure_theme()
  figure <- with_end_labels(figure + ggplot2::coord_cartesian(clip = "off"), counts)
  figure <- with_keys(figure, levels(table$state))
  with_height(figure, 2.3 + 0.42 * nlevels(table$row))
}

# A row for each study, with its name as long as names can be read; a file holds 50 inches.
named_studies <- 120
rows_height <- function(n) 0.25 * min(n, named_studies)
study_axis <- function(studies) {
  ggplot2::scale_y_discrete(limits = studies,
                            labels = if (length(studies) > named_studies) NULL else identity)
}

figure_studies <- function(survey) {
  states <- c("named", "likely", "stand-in", "not adopted", "not computed")
  table <- survey$trials
  if (!NROW(table)) return(figure_of_nothing("No mechanism was tried"))
  columns <- mechanism_counts(survey)$mechanism
  table$state <- factor(table$state, states)
  shown <- droplevels(table[table$mechanism %in% columns, ])
  of_state <- function(...) stats::setNames(c(...), states)
  figure <- ggplot2::ggplot(shown, ggplot2::aes(.data$mechanism, .data$study, colour = .data$state,
                                                shape = .data$state, size = .data$state)) +
    ggplot2::geom_point(stroke = 1.2) +
    ggplot2::scale_colour_manual(values = of_state(state_colours[1:3], "grey60", "grey60")) +
    ggplot2::scale_shape_manual(values = of_state(18, 19, 17, 3, 4)) +
    ggplot2::scale_size_manual(values = of_state(5, 3.4, 3.4, 0.9, 2)) +
    ggplot2::scale_x_discrete(limits = columns, position = "top") +
    study_axis(rev(studies_words(survey)$study)) +
    figure_titles("What became of each mechanism in each study",
                  paste("Studies with a cause named come first.",
                        if (any(survey$studies$verdict == "no result"))
                          "A row without signs has no result.")) +
    figure_theme() +
    ggplot2::theme(axis.text.x.top = ggplot2::element_text(angle = 90, hjust = 0, vjust = 0.5))
  figure <- with_keys(figure, levels(shown$state))
  with_height(figure, 2.2 + 0.085 * max(nchar(columns)) + rows_height(nrow(survey$studies)))
}

figure_survey_gain <- function(survey) {
  s <- survey$studies[!is.na(survey$studies$error_before), ]
  if (!nrow(s)) return(figure_of_nothing("No study has a result"))
  rows <- data.frame(study = s$study, error = c(s$error_before, s$error_after),
                     stage = factor(rep(c("before", "after"), each = nrow(s)),
                                    c("before", "after")))
  changed <- s[s$error_before != s$error_after, ]
  figure <- ggplot2::ggplot(rows, ggplot2::aes(.data$error, .data$study)) +
    ggplot2::geom_vline(xintercept = 1, linetype = "dashed", colour = "grey20") +
    ggplot2::geom_segment(ggplot2::aes(x = .data$error_before, xend = .data$error_after,
                                       yend = .data$study), changed, colour = "grey60") +
    ggplot2::geom_point(ggplot2::aes(colour = .data$stage, shape = .data$stage), size = 3.2) +
    ggplot2::scale_shape_manual(values = c(before = 17, after = 19)) +
    ggplot2::scale_x_log10(breaks = c(0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000),
                           labels = format_each, guide = apart) +
    study_axis(s$study[order(s$error_before, s$error_after)]) +
    stage_scales() +
    figure_titles(paste("The typical error", median_change(s),
                        "times the noise in the median study"),
                  "Dashed: the stated noise, about the smallest error that can be expected.",
                  x = "typical error over the stated noise") +
    figure_theme()
  figure <- with_keys(figure, c("before", "after"))
  with_height(figure, 2.6 + rows_height(nrow(s)))
}

#' @export
figures_of.amiss_survey <- function(x) survey_figures

#' @rdname figures
#' @export
plot.amiss_survey <- function(x, which = "causes", ...) {
  rlang::check_dots_empty()
  draw(survey_figure(x, which))
}

#' @rdname figures
#' @export
autoplot.amiss_survey <- function(object, which = "causes", ...) {
  rlang::check_dots_empty()
  survey_figure(object, which)
}

survey_figure <- function(survey, which, call = rlang::caller_env()) {
  check_whole(survey, "object", call = call)
  check_input(checkmate::check_choice(which, survey_figures), "which", call = call)
  switch(which, causes = figure_causes(survey), studies = figure_studies(survey),
         gain = figure_survey_gain(survey))
}
