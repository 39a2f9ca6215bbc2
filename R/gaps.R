# The record on equal steps: rows that were lost, stamps that stray, and values that drivers lack.


# The rows of the record: list(row, hours, segment, step), `row` the row of the data, NA where it
# was lost. A segment goes on over lost rows that together last no longer than `bridge` hours, over
# one in any case, unless the steps are others after them: shifted by more than stamps stray
# elsewhere.
regular_grid <- function(hours, bridge, name, call = rlang::caller_env()) {
  step <- stats::median(diff(hours))
  steps <- diff(hours) / step
  apart <- abs(steps - round(steps))
  ends <- (round(steps) - 1.1) * step > max(step, bridge) | steps > 1.5 &
    apart > max(0.02, 2 * stats::quantile(apart, 0.9))
  segment <- cumsum(c(1L, ends))
  row <- seq_along(hours)
  if (any(!ends & (apart > 1e-6 * steps | steps < 0.5))) {
    snapped <- snap(hours, segment, step)
    row <- which(snapped$keep)
    if (length(row) < (1 - rules$stray_share) * length(hours))
      refuse_unequal(steps, step, ends, name, call)
    if (any(!ends & (apart > 0.01 * steps | steps < 0.5))) tell_stray(hours, snapped, name)
    hours <- snapped$hours[row]
    segment <- segment[row]
    step <- snapped$step
  }
  insert_lost(row, hours, segment, step)
}

refuse_unequal <- function(steps, step, ends, name, call) {
  off <- which(!ends & abs(steps - 1) > 0.01)[1]
  abort_input(c(paste("Time column {.val {name}} has unequal steps: {signif(steps[off] * step, 4)}",
                      "h after row {off}, while the usual step is {signif(step, 4)} h; more than",
                      "{100 * rules$stray_share} % of the rows are at no step."),
                i = paste("Interpolate or average the record to equal steps; gaps and stamps that",
                          "stray a little may stay.")), call = call)
}

# Every stamp at the nearest of equal steps: list(hours, step, keep). The median of stamps that
# stray is not exactly their step; whole minutes and the slope over the longest segment are tried
# beside it.
snap <- function(hours, segment, step) {
  longest <- hours[segment == which.max(tabulate(segment))]
  count <- cumsum(c(0, round(diff(longest) / step)))
  tried <- c(round(60 * step) / 60, step, stats::cov(count, longest) / stats::var(count))
  tried <- tried[tried > 0 & abs(tried / step - 1) < 0.02]
  placed <- lapply(tried, function(step) snap_to(hours, segment, step))
  placed[[which.max(vapply(placed, function(p) sum(p$keep), 0))]]
}

snap_to <- function(hours, segment, step) {
  origin <- floor(hours[1])
  phase <- stats::ave(hours - origin, segment, FUN = function(h) {
    angle <- 2 * pi * h / step
    phase <- step / (2 * pi) * atan2(mean(sin(angle)), mean(cos(angle)))
    if (abs(phase) < 0.1 * step) 0 else phase  # the clock's own steps, if it is near them
  })
  index <- round((hours - origin - phase) / step)
  at <- origin + phase + index * step
  stray <- abs(hours - at)
  nearest <- logical(length(hours))
  nearest[order(stray)] <- !duplicated(data.frame(segment, index)[order(stray), ])
  list(hours = at, step = step, keep = stray <= rules$stray_limit * step & nearest)
}

insert_lost <- function(row, hours, segment, step) {
  n <- length(hours)
  lost <- ifelse(diff(segment) == 0, pmax(round(diff(hours) / step) - 1, 0), 0)
  at <- seq_len(n) + c(0, cumsum(lost))
  grid <- list(row = rep(NA_integer_, n + sum(lost)),
               hours = stats::approx(at, hours, seq_len(n + sum(lost)))$y,
               segment = rep(segment, c(lost, 0) + 1), step = step)
  grid$row[at] <- row
  grid$hours[at] <- hours
  if (sum(lost)) {
    first <- row[which(lost > 0)[1]]
    cli::cli_inform(c(paste("{sum(lost)} lost row{?s} in {sum(lost > 0)} gap{?s}",
                            "{cli::qty(sum(lost))}{?is/are} bridged, the first after row {first}."),
                      i = paste("There the target is left out of the comparison; drivers are",
                                "interpolated linearly.")), class = "amiss_message_gap")
  }
  grid
}

tell_stray <- function(hours, snapped, name) {
  far <- max(abs(hours - snapped$hours)[snapped$keep])
  left_out <- which(!snapped$keep)
  cli::cli_inform(
    c(paste("Time column {.val {name}} has unequal steps; each row is taken at the nearest of",
            "equal steps of {signif(snapped$step, 4)} h, {signif(3600 * far, 3)} s away at most."),
      i = if (length(left_out)) paste("{length(left_out)} row{?s} between two steps {?is/are} left",
                                      "out; the first is row {left_out[1]}.")),
    class = "amiss_message_gap")
}

# Time at the hours of the grid, rounded to milliseconds, as hours are not whole: a second before
# 00:10:00 is in another minute.
grid_time <- function(time, grid) {
  if (is.numeric(time)) return(grid$hours)
  at <- utc(round(3600 * grid$hours, 3))
  attr(at, "tzone") <- attr(time, "tzone")
  at
}

# Gaps of the drivers that last at most `longest` hours, by straight lines; directions (degrees) by
# way of sine and cosine. Lost rows are filled in any case.
fill_drivers <- function(drivers, grid, longest, turning) {
  for (name in colnames(drivers)) {
    v <- drivers[, name]
    gap <- !is.finite(v)
    if (!any(gap) || all(gap)) next
    run <- cumsum(c(TRUE, diff(gap) != 0 | diff(grid$segment) != 0))
    lasts <- grid$step * tabulate(run)[run]
    bounded <- !run %in% run[segment_ends(grid$segment)]
    only_lost <- stats::ave(is.na(grid$row), run, FUN = all) == 1
    fill <- gap & bounded & (only_lost | lasts <= longest + 0.01 * grid$step)
    drivers[fill, name] <- interpolated(v, gap, fill, grid$hours, name %in% turning)
    tell_filled(name, fill & !is.na(grid$row), run, lasts)
  }
  drivers
}

segment_ends <- function(segment) which(c(TRUE, diff(segment) != 0) | c(diff(segment) != 0, TRUE))

interpolated <- function(v, gap, fill, hours, turning) {
  line <- function(v) stats::approx(hours[!gap], v[!gap], hours[fill])$y
  if (turning) (atan2(line(sin(v * pi / 180)), line(cos(v * pi / 180))) * 180 / pi) %% 360
  else line(v)
}

tell_filled <- function(name, filled, run, lasts) {
  if (!any(filled)) return(invisible())
  gaps <- length(unique(run[filled]))
  cli::cli_inform(paste("{sum(filled)} value{?s} of {.val {name}} in {gaps} gap{?s} of at most",
                        "{signif(max(lasts[filled]), 3)} h {cli::qty(sum(filled))}{?is/are} filled",
                        "by straight lines."), class = "amiss_message_gap")
}
