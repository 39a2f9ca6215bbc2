# Whether a column of temperatures changes its unit at some row. What that does to all that follows
# is known, and neither weather nor a plant does it from one reading to the next. Factors of a
# thousand (W and kW) are not looked for: a heater at rest may take that much less, too. `lower`:
# between what the part in the first unit may lie.
unit_changes <- list(
  list(units = c("Celsius", "Fahrenheit"), slope = 1.8, shift = 32, lower = c(-60, 100)),
  list(units = c("Celsius", "kelvin"), slope = 1, shift = 273.15, lower = c(-60, 100)),
  list(units = c("Fahrenheit", "kelvin"), slope = 1 / 1.8, shift = 255.372, lower = c(-76, 212)))

unit_finding <- function(x) {
  parts <- two_parts(x$v)
  if (is.null(parts)) return(NULL)
  off <- vapply(unit_changes, function(change) distance_after(parts, change), 0)
  if (!any(is.finite(off))) return(NULL)
  units <- unit_changes[[which.min(off)]]$units
  if (!parts$rises) units <- rev(units)
  list(value = x$v[parts$row], says = sprintf(
    "%s seems to change its unit at row %d, from %s to %s: give all rows in one unit.",
    x$told, parts$row, units[1], units[2]))
}

# The parts of a column whose means lie farthest apart: list(row, rises, jump, lower, upper): the
# first row of the second part, whether that is the upper one, the change to it from one reading to
# the next, and the quartiles of either; nothing if the column is short, or changes elsewhere nearly
# as much from one reading to the next.
two_parts <- function(v) {
  rows <- which(!is.na(v) & abs(v) < 1e20)
  u <- v[rows]
  n <- length(u)
  if (n < 2 * rules$suspect_rows) return(NULL)
  k <- as.numeric(seq(rules$suspect_rows, n - rules$suspect_rows))
  sums <- cumsum(u)
  at <- k[which.max((sums[k] - k * sums[n] / n)^2 / (k * (n - k)))]
  jumps <- abs(diff(u))
  if (!isTRUE(jumps[at] > rules$unit_alone * max(jumps[-at]))) return(NULL)
  quarters <- lapply(list(u[seq_len(at)], u[-seq_len(at)]), stats::quantile, c(0.25, 0.5, 0.75))
  rises <- quarters[[2]][2] > quarters[[1]][2]
  if (!rises) quarters <- rev(quarters)
  list(row = rows[at + 1], rises = rises, jump = jumps[at], lower = quarters[[1]],
       upper = quarters[[2]])
}

# How far the upper part is off the lower one in the other unit, over what the change does to it;
# infinite if that is no explanation, or the lower part is no weather and no room.
distance_after <- function(parts, change) {
  expected <- change$slope * parts$lower + change$shift
  moves <- expected[[2]] - parts$lower[[2]]
  spread <- c(diff(expected[c(1, 3)]), diff(parts$upper[c(1, 3)]))
  off <- abs(parts$upper[[2]] - expected[[2]]) / moves
  fits <- parts$lower[1] > change$lower[1] && parts$lower[3] < change$lower[2] &&
    off < rules$unit_off && parts$jump > rules$unit_jump * moves && min(spread) > 0 &&
    max(spread) < rules$unit_spread * min(spread)
  if (isTRUE(fits)) off else Inf
}
