# Whether the residuals are what the error model says of them: independent and N(0, 1) once the
# fitted error and discrepancy are taken into account.

residual_level <- 0.01   # of each check that the title tells of
most_residuals <- 1500   # points of a panel
residual_conditions <- 2  # that are drawn

residual_subtitle <- paste(
  "What each measurement does beyond what the model expects of it given those before, in standard",
  "deviations. If the error model is right, points have no pattern, 95 % of them lie between the",
  "dashed lines, and lines and bars stay within the grey bands (95 %).")

figure_residuals <- function(fit) {
  m <- fit$measurements
  found <- innovations(fit)
  z <- found$innovation
  means <- condition_means(m, found)
  drawn <- utils::head(names(means)[order(vapply(means, `[[`, 0, "p_value"))], residual_conditions)
  panels <- c(time = paste("residual over time", if (is.numeric(found$time)) "[h]" else "[days]"),
              stats::setNames(paste("residual by", condition_titles(m, drawn)), drawn),
              quantile = "residual by normal quantile",
              lag = "correlation of residuals by lag [h]",
              frequency = "share of variance below a frequency [1/day]")
  table_of <- function(name, ...) data.frame(panel = factor(panels[[name]], unname(panels)), ...)
  bind <- function(names, table) do.call(rbind, lapply(names, table))
  thin <- evenly_kept(length(z))
  by_condition <- function(name) table_of(name, x = means[[name]]$x[thin], y = z[thin])
  points <- rbind(table_of("time", x = since_first(found$time)[thin], y = z[thin]),
                  bind(drawn, by_condition))
  classes <- bind(drawn, function(name) table_of(name, means[[name]]$classes))
  quantiles <- table_of("quantile", normal_quantiles(z)[thin, ])
  lags <- table_of("lag", correlations(z, m$step_h))
  spectrum <- table_of("frequency", cumulated_periodogram(z, m$step_h)$table)
  colour <- stage_colours[["the model"]]
  limits <- bind(c("time", drawn), function(name) table_of(name, y = c(-1.96, 1.96)))
  zero <- bind(c("time", drawn, "lag"), function(name) table_of(name, y = 0))
  bands <- rbind(quantiles, spectrum)
  figure <- ggplot2::ggplot(points, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$lower, ymax = .data$upper), bands,
                         fill = "grey85") +
    ggplot2::geom_rect(ggplot2::aes(ymin = .data$lower, ymax = .data$upper), lags[1, ],
                       xmin = -Inf, xmax = Inf, fill = "grey85") +
    ggplot2::geom_hline(ggplot2::aes(yintercept = .data$y), zero, colour = "grey40") +
    ggplot2::geom_hline(ggplot2::aes(yintercept = .data$y), limits, colour = "grey40",
                        linetype = "dashed") +
    ggplot2::geom_line(ggplot2::aes(y = .data$expected), bands, colour = "grey40") +
    ggplot2::geom_point(colour = colour, alpha = 0.35, size = 1.2, shape = 16) +
    ggplot2::geom_point(data = quantiles, colour = colour, size = 1.2, shape = 16) +
    ggplot2::geom_linerange(ggplot2::aes(ymin = .data$lower, ymax = .data$upper), classes,
                            linewidth = 0.9) +
    ggplot2::geom_point(data = classes, size = 2) +
    ggplot2::geom_segment(ggplot2::aes(xend = .data$x, yend = 0), lags, colour = colour,
                          linewidth = 1) +
    ggplot2::geom_line(data = spectrum, colour = colour, linewidth = 0.9) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), scales = "free", ncol = 3,
                        labeller = wrap_strips(3)) +
    ggplot2::scale_x_continuous(n.breaks = 4, labels = short_axis, guide = apart) +
    figure_titles(residual_title(z, m, means),
                  paste(residual_subtitle, "Black: means of classes, with 95 % intervals.")) +
    figure_theme()
  with_height(figure, 6.6)
}

evenly_kept <- function(n) unique(round(seq(1, n, length.out = min(n, most_residuals))))

# Hours, or days where there is a date.
since_first <- function(time)
  if (is.numeric(time)) time else as.numeric(difftime(time, time[1], units = "days"))

# For each condition list(x, classes, p_value): means of the residuals in up to eight classes of
# about equally many rows, and how probable means as large are by chance.
condition_means <- function(m, found) {
  lapply(stats::setNames(nm = m$conditions), function(name) {
    x <- condition_values(m, name)[found$row]
    ends <- unique(stats::quantile(x, seq(0, 1, length.out = 9)))
    class <- if (length(unique(x)) <= 8) factor(x)
             else droplevels(cut(x, ends, include.lowest = TRUE))
    n <- as.numeric(table(class))
    mean <- as.numeric(tapply(found$innovation, class, mean))
    half <- 1.96 / sqrt(n)
    list(x = x, p_value = stats::pchisq(sum(n * mean^2), length(n), lower.tail = FALSE),
         classes = data.frame(x = as.numeric(tapply(x, class, mean)), y = mean,
                              lower = mean - half, upper = mean + half))
  })
}

# Of n independent N(0, 1) values the i-th smallest is a quantile at a probability that is
# beta(i, n + 1 - i).
normal_quantiles <- function(z) {
  n <- length(z)
  i <- seq_len(n)
  expected <- stats::qnorm(stats::ppoints(n))
  data.frame(x = expected, y = sort(z), expected = expected,
             lower = stats::qnorm(stats::qbeta(0.025, i, n + 1 - i)),
             upper = stats::qnorm(stats::qbeta(0.975, i, n + 1 - i)))
}

# Over a day at least, if there are as many rows; about zero, which is their mean if all is right.
correlations <- function(z, step_h) {
  n <- length(z)
  lags <- min(n %/% 4, max(24, min(200, ceiling(25 / step_h))))
  r <- stats::acf(z, lags, plot = FALSE, demean = FALSE)$acf[-1]
  data.frame(x = seq_along(r) * step_h, y = r, lower = -1.96 / sqrt(n), upper = 1.96 / sqrt(n))
}

# As stats::cpgram() has it, with the band of Kolmogorov and Smirnov; `excess`: its largest distance
# from the line in units of what is exceeded by chance with the probability residual_level.
cumulated_periodogram <- function(z, step_h) {
  n <- length(z)
  frequencies <- seq_len((n - 1) %/% 2)
  power <- Mod(stats::fft(z)[1 + frequencies])^2
  seen <- cumsum(power) / sum(power)
  expected <- frequencies / length(frequencies)
  root <- sqrt(length(frequencies) - 1)
  limit <- function(quantile) quantile / (root + 0.12 + 0.11 / root)
  away <- which.max(abs(seen - expected))
  list(table = data.frame(x = 24 * frequencies / (n * step_h), y = seen, expected,
                          lower = pmax(0, expected - limit(1.358)),
                          upper = pmin(1, expected + limit(1.358))),
       excess = (seen - expected)[away] / limit(1.628))
}

# The first check that fails, or that none does.
residual_title <- function(z, m, means) {
  n <- length(z)
  r <- correlations(z, m$step_h)
  limit <- function(of) stats::qnorm(1 - residual_level / 2 / of) / sqrt(n)
  if (abs(r$y[1]) > limit(1)) return(neighbour_words(r$y[1]))
  far <- which.max(abs(r$y))
  if (abs(r$y[far]) > limit(nrow(r)))
    return(sprintf("Residuals %s h apart %s (correlation %s): the error model does not expect that",
                   format(r$x[far]), agree_words(r$y[far]), short(r$y[far])))
  excess <- cumulated_periodogram(z, m$step_h)$excess
  if (abs(excess) > 1)
    return(sprintf("Residuals vary too much at %s frequencies: the error model misses %s parts",
                   if (excess > 0) "low" else "high", if (excess > 0) "slow" else "fast"))
  p <- vapply(means, `[[`, 0, "p_value")
  if (any(p < residual_level / length(p)))
    return(paste("Residuals are white, but they depend on",
                 condition_label(m, names(p)[which.min(p)])))
  white_words(z)
}

agree_words <- function(r) if (r > 0) "agree" else "oppose each other"

neighbour_words <- function(r)
  sprintf("Neighbouring residuals %s (correlation %s): the error %s than the error model says",
          agree_words(r), short(r), if (r > 0) "lasts longer" else "changes faster")

# Of white residuals: outliers beside the size of the others, their size, their distribution.
white_words <- function(z) {
  n <- length(z)
  limit <- stats::qnorm(1 - residual_level / 2 / n) * max(1, stats::mad(z, 0))
  outliers <- sum(abs(z) > limit)
  if (outliers)
    return(sprintf("Residuals are white, but %d of %s %s too large for a normal error (up to %s)",
                   outliers, format(n, big.mark = ","), if (outliers > 1) "are" else "is",
                   short(max(abs(z)))))
  size <- sqrt(mean(z^2))
  tail <- stats::pchisq(n * size^2, n)
  if (min(tail, 1 - tail) < residual_level / 2)
    return(sprintf("Residuals are white, but %s times as large as the error model says",
                   short(size)))
  if (stats::ks.test(z, "pnorm")$p.value < residual_level)
    return("Residuals are white, but not normal")
  "Residuals are white and normal, as the error model says"
}
