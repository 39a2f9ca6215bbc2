# Whether a column of temperatures changes its unit at some row. What that does to all that follows
# is known, and neither weather nor a plant does it from one reading to the next. Factors of a
# thousand (W and kW) are not looked for: a heater at rest may take that much less, too.
unit_changes <- list(list(units = c("Celsius", "Fahrenheit"), slope = 1.8, shift = 32),
                     list(units = c("Celsius", "kelvin"), slope = 1, shift = 273.15))

unit_finding <- function(x) {
  for (change in unit_changes) {
    at <- changed_unit(x$v, change)
    if (is.null(at)) next
    units <- if (at$rises) change$units else rev(change$units)
    return(list(value = x$v[at$row], says = sprintf(
      "%s seems to change its unit at row %d, from %s to %s: give all rows in one unit.",
      x$told, at$row, units[1], units[2])))
  }
}

# list(row, rises) of the first reading in another unit, or nothing. The two parts are those whose
# means lie farthest apart. The lower one, converted, is where the upper one is and spreads like it,
# and the change comes from one reading to the next.
changed_unit <- function(v, change) {
  rows <- which(!is.na(v))
  u <- v[rows]
  n <- length(u)
  if (n < 2 * rules$suspect_rows) return(NULL)
  k <- seq(rules$suspect_rows, n - rules$suspect_rows)
  sums <- cumsum(u)
  at <- k[which.max((sums[k] - k * sums[n] / n)^2 / (k * (n - k)))]
  parts <- list(u[seq_len(at)], u[-seq_len(at)])
  rises <- stats::median(parts[[2]]) > stats::median(parts[[1]])
  quarters <- lapply(if (rises) parts else rev(parts), stats::quantile, c(0.25, 0.5, 0.75))
  expected <- change$slope * quarters[[1]] + change$shift
  spread <- c(diff(expected[c(1, 3)]), diff(quarters[[2]][c(1, 3)]))
  moves <- expected[2] - quarters[[1]][2]
  if (min(spread) > 0 && max(spread) < rules$unit_spread * min(spread) &&
      abs(quarters[[2]][2] - expected[2]) < rules$unit_off * moves &&
      abs(u[at + 1] - u[at]) > rules$unit_jump * moves)
    list(row = rows[at + 1], rises = rises)
}
