# Emulators of the borehole function (8 inputs) on Latin hypercubes of 200 and 500 runs: ours
# against those of other packages, each as its users would fit it (bench/peers/borehole.R), with
# OpenBLAS. CPU seconds of one core; medians of ten designs of 200 runs and three of 500, 1000
# held-out points each; of how often intervals hold, the mean.

source(file.path(root, "bench", "peers", "install.R"), local = TRUE)
all <- run_with_peers(root, "borehole.R",
                      c("rlibkriging", "hetGP", "laGP", "DiceKriging", "RobustGaSP"))
over_seeds <- function(column, f) stats::aggregate(all[column], all[c("runs", "emulator")], f,
                                                   na.action = stats::na.pass)
table <- merge(over_seeds(c("seconds", "error"), stats::median), over_seeds("coverage", mean))
table$worked <- stats::complete.cases(table)
if (!any(table$worked[table$emulator != "amiss"]))
  stop("there is no peer to compare with", call. = FALSE)

for (runs in unique(table$runs)) {
  rows <- table[table$runs == runs, ]
  ours <- rows[rows$emulator == "amiss", ]
  peers <- rows[rows$emulator != "amiss", ]
  name <- function(what, emulator) sprintf("%s, M = %d, %s", what, as.integer(runs), emulator)
  for (i in seq_len(nrow(peers))) scaled(name("fit", peers$emulator[i]), peers$seconds[i], "s")
  scaled(name("fit", "amiss"), ours$seconds, "s")
  measured(name("fit", "fastest peer over amiss"), min(peers$seconds[peers$worked]) / ours$seconds,
           "", 3, above = TRUE)
  for (i in seq_len(nrow(peers)))
    measured(name("error", peers$emulator[i]), peers$error[i], "sd(y)")
  measured(name("error", "amiss"), ours$error, "sd(y)", min(peers$error[peers$worked]))
  for (i in seq_len(nrow(peers)))
    measured(name("95 % intervals hold", peers$emulator[i]), 100 * peers$coverage[i], "%")
  measured(name("95 % intervals hold", "amiss"), 100 * ours$coverage, "%")
  measured(name("how far from 92 to 97 %", "amiss"),
           100 * max(0, 0.92 - ours$coverage, ours$coverage - 0.97), "%", 0)
}

# Labels beside their points: on the left of those with another point close on their right, and
# drawn apart vertically until no two overlap (both axes are logarithmic).
apart <- function(y, gap) {
  placed <- sort(y)
  for (pass in 1:100) {
    short <- pmax(0, gap - diff(placed)) / 2
    placed <- placed - c(short, 0) + c(0, short)
  }
  placed[rank(y, ties.method = "first")]
}
drawn <- table[table$worked, ]
drawn$seconds <- drawn$seconds / slower
drawn$panel <- sprintf("%d runs", as.integer(drawn$runs))
x <- log10(drawn$seconds)
y <- log10(drawn$error)
drawn$label <- 10^stats::ave(y, drawn$panel, FUN = function(y) apart(y, 0.045 * diff(range(y))))
crowded <- function(i)
  any(drawn$runs == drawn$runs[i] & x > x[i] & x < x[i] + 1 & abs(y - y[i]) < 0.035)
drawn$side <- ifelse(vapply(seq_along(x), crowded, NA), -1, 1)
drawn$text <- sub("gauss + ", "", drawn$emulator, fixed = TRUE)
drawn$ours <- drawn$emulator == "amiss"
plain <- function(x) format(x, drop0trailing = TRUE, scientific = FALSE, trim = TRUE)
figure <- ggplot2::ggplot(drawn, ggplot2::aes(.data$seconds, .data$error, colour = .data$ours)) +
  ggplot2::facet_wrap(~panel, scales = "free") +
  ggplot2::geom_segment(ggplot2::aes(xend = .data$seconds * 1.2^.data$side, yend = .data$label),
                        linewidth = 0.3) + ggplot2::geom_point(size = 2.4) +
  ggplot2::geom_text(ggplot2::aes(.data$seconds * 1.25^.data$side, .data$label, label = .data$text,
                                  hjust = (1 - .data$side) / 2),
                     size = 3.4) +
  ggplot2::scale_x_log10("seconds to fit, one core of 60 GFLOP/s",
                         expand = ggplot2::expansion(c(0.4, 0.45)), labels = plain) +
  ggplot2::scale_y_log10("error at held-out points over the standard deviation", labels = plain) +
  ggplot2::scale_colour_manual(values = c("FALSE" = "grey35", "TRUE" = "#08519C"), guide = "none") +
  ggplot2::labs(title = "Emulators of the borehole function", subtitle = paste(
    "Medians of ten designs of 200 runs and three of 500; down and to the left is better.",
    "Nugget: gauss with an estimated one.")) +
  ggplot2::theme_minimal(base_size = 13) +
  ggplot2::theme(plot.title.position = "plot", panel.grid.minor = ggplot2::element_blank(),
                 panel.spacing = ggplot2::unit(2, "lines"))
ggplot2::ggsave(paste0(sub("[.]json$", "", out), "-emulator.png"), figure, width = 12, height = 7,
                dpi = 110, bg = "white")
