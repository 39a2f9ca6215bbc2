# What the runs of the simulator were spent on.

# Runs of the base model, of each trial, and the rest: checks of trials that may win, and whether
# what was adopted is still needed. `to`: the model that a mechanism was added to.
runs_table <- function(upgrade) {
  trials <- upgrade$candidates
  adopted <- as.character(unlist(lapply(upgrade$models, `[[`, "mechanism")))
  step <- match(trials$from, unique(trials$from))
  to <- c("added to the base model", paste("added after", adopted, recycle0 = TRUE))
  base <- upgrade$models[[1]]$fit$runs_made %||% 0
  rest <- upgrade$runs_total - base - sum(trials$runs)
  table <- data.frame(row = c("the base model", trials$mechanism, "checks and comparisons"),
                      to = c("models as a whole", to[step], "models as a whole"),
                      runs = c(base, trials$runs, rest))
  table$to <- factor(table$to, c("models as a whole", to))
  droplevels(table[table$runs > 0, ])
}

runs_title <- function(upgrade, table) {
  told <- function(n, one, many) paste(format(n, big.mark = ","), if (n == 1) one else many)
  total <- told(upgrade$runs_total, "run", "runs")
  of_trials <- table$runs[table$to != "models as a whole"]
  if (!length(of_trials)) return(paste(total, "of the simulator, all for the base model"))
  sprintf("%s of the simulator, %s in %s", total, format(sum(of_trials), big.mark = ","),
          told(length(of_trials), "trial of a mechanism", "trials of mechanisms"))
}

figure_runs <- function(upgrade) {
  if (!isTRUE(upgrade$runs_total > 0))
    return(figure_of_nothing("No run of the simulator was made"))
  table <- runs_table(upgrade)
  sums <- stats::aggregate(runs ~ row, table, sum)
  ends <- c("checks and comparisons", "the base model")
  tried <- sums[!sums$row %in% ends, ]
  table$row <- factor(table$row, c(ends[1], tried$row[order(tried$runs)], ends[2]))
  shades <- c("grey35", stage_colours[["after"]],
              grDevices::colorRampPalette(c("#56B4E9", "grey85"))(nlevels(table$to)))
  counts <- paste0("  ", format(sums$runs, big.mark = ",", trim = TRUE))
  figure <- ggplot2::ggplot(table, ggplot2::aes(.data$runs, .data$row)) +
    ggplot2::geom_col(ggplot2::aes(fill = .data$to), width = 0.6,
                      position = ggplot2::position_stack(reverse = TRUE)) +
    ggplot2::geom_text(ggplot2::aes(label = counts), sums, hjust = 0, size = 4.4,
                       colour = "grey20") +
    ggplot2::scale_fill_manual(
      values = stats::setNames(shades[seq_len(nlevels(table$to))], levels(table$to))) +
    ggplot2::scale_x_continuous(expand = ggplot2::expansion(c(0, 0.02)), guide = apart) +
    ggplot2::scale_y_discrete(labels = wrap_labels(0.5)) +
    figure_titles(runs_title(upgrade, table),
                  paste("A trial that cannot win is given up after a few runs. Checks and",
                        "comparisons verify those that may."), x = "runs of the simulator") +
    figure_theme()
  figure <- with_end_labels(figure + ggplot2::coord_cartesian(clip = "off"), counts)
  figure <- with_keys(figure, levels(table$to))
  with_height(figure, 2.3 + 0.42 * nlevels(table$row))
}
