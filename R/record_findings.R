# What a record shows by itself: values that cannot be measurements. record_findings() is a function
# of the table alone. What is natural for a condition is none: zeros (night, no rain, off), few
# levels (switches, schedules, set points), and either end of what something controlled can do.

# Codes of loggers and file formats for a value that is missing; any as large as 1e20 counts as one,
# too.
missing_codes <- c(-99, -99.9, -99.99, -999, -999.9, -999.99, -6999, -7999, -9999, -9999.9, -99999,
                   -999999, 999, 999.9, 9999, 9999.9, 99999, 999999, 32767, -32768, 65535,
                   2147483647, -2147483648)
direction_codes <- c(990, 991)  # variable, calm

# Each gives list(value, says), with `rows` if it is of some rows only, or nothing. The next looks
# at what is left: at the other rows, and at nothing if all are concerned.
record_checks <- list(
  missing_code = function(x) code_finding(x),
  far_outside = function(x) far_finding(x),
  unit = function(x) if (may_be_temperature(x)) unit_finding(x),
  direction = function(x) if (x$is_condition && !x$is_circular) direction_finding(x),
  counter = function(x) if (!x$is_circular) counter_finding(x),
  constant = function(x) if (!x$is_target) constant_finding(x),
  at_rest = function(x) if (x$is_target) at_rest_finding(x),
  range_end = function(x) if (x$is_target) range_finding(x),
  stuck = function(x) if (x$is_target || !has_few_levels(x$v)) stuck_finding(x),
  quantised = function(x) if (x$is_target) quantised_finding(x),
  repeated = function(x) if (x$is_target || !has_few_levels(x$v)) repeated_finding(x))

# `record`: list(columns, target, conditions, circular, use, noise_sd, per_step): numeric columns of
# a table by name, the use of each row, the noise of a single reading, and how many rows an average
# takes; `labels` and `units` of columns may be left out. Returns a data frame with a row for each
# finding: its `id`, the `column`, its `rows` (all, if none is listed), the `value`, and what it
# `says`.
record_findings <- function(record) {
  found <- lapply(names(record$columns),
                  function(name) column_findings(record_column(record, name)))
  do.call(rbind, c(list(no_findings()), unlist(found, recursive = FALSE)))
}

no_findings <- function() {
  data.frame(id = character(), column = character(), rows = I(list()), value = numeric(),
             says = character())
}

record_column <- function(record, name) {
  v <- as.numeric(record$columns[[name]])
  v[!is.finite(v)] <- NA
  x <- list(name = name, is_target = name == record$target,
            is_condition = name %in% record$conditions, is_circular = name %in% record$circular)
  # A target that is not compared does no harm.
  if (x$is_target) v[!record$use %in% c("calibrate", "validate")] <- NA
  label <- record$labels[name]
  x$unit <- c(record$units[name], NA)[[1]]
  # For sentences: whoever mends the record needs the name of its column too.
  x$told <- if (length(label) && !is.na(label)) labels_with_names(label, name) else name
  c(list(v = v, no_codes = isTRUE(record$no_codes)), x,
    record[c("use", "noise_sd", "per_step")])
}

# By its unit, if one is stated; a quantity that is often zero is none.
may_be_temperature <- function(x) {
  !x$is_circular && !are_amounts(x$v) && (is.na(x$unit) || x$unit %in% c("", temperature_units))
}

temperature_units <- c("K", "C", "F", "degC", "degF", "\u00b0C", "\u00b0F", "kelvin", "celsius",
                       "Celsius", "Kelvin", "Fahrenheit")

column_findings <- function(x) {
  found <- list()
  for (id in names(record_checks)) {
    one <- record_checks[[id]](x)
    if (is.null(one)) next
    found[[id]] <- data.frame(id = id, column = x$name, rows = I(list(as.integer(one$rows))),
                              value = one$value, says = one$says)
    if (is.null(one$rows)) break
    x$v[one$rows] <- NA
  }
  unname(found)
}

# Those of the target, of the conditions analysed and of what else a simulator reads.
findings_read <- function(measurements, drivers = character()) {
  found <- measurements$findings
  found[found$column %in% c(measurements$target, measurements$conditions, measurements$constant,
                            drivers), ]
}

# ---- codes for what is missing, and values far outside

# Codes that stand apart from all other values: farther than three times what ever lies between two
# of those, or below zero where nothing else is.
coded_rows <- function(v, is_circular = FALSE) {
  at <- which(stands_for_missing(v, c(missing_codes, if (is_circular) direction_codes)))
  rest <- sort(unique(v[is.finite(v) & !seq_along(v) %in% at]))
  if (!length(at) || !length(rest)) return(at[0])
  ends <- rest[c(1, length(rest))]
  apart <- pmax(ends[1] - v[at], v[at] - ends[2])
  at[apart > rules$code_apart * max(diff(rest), 0) | v[at] < 0 & ends[1] >= 0]
}

stands_for_missing <- function(v, codes) {
  near <- codes[match(signif(v, 7), signif(codes, 7))]  # as single precision writes them
  is.finite(v) & (!is.na(near) | abs(v) >= 1e20)
}

code_finding <- function(x) {
  rows <- if (!x$no_codes) coded_rows(x$v, x$is_circular)
  if (!length(rows)) return(NULL)
  codes <- unique(x$v[rows])
  list(rows = rows, value = codes[1],
       says = sprintf("%s is %s in %s: a code for a missing value. Give missing = %s.", x$told,
                      listed(format_each(codes), "or"), rows_words(rows), value_code(codes)))
}

value_code <- function(values) {
  text <- paste(format_each(values), collapse = ", ")
  if (length(values) > 1) sprintf("c(%s)", text) else text
}

far_finding <- function(x) {
  rows <- far_rows(x$v)
  if (!length(rows)) return(NULL)
  values <- unique(x$v[rows])
  usual <- format_each(signif(range(x$v[-rows], na.rm = TRUE), 4))
  told <- if (length(values) > 3) paste(listed(usual_ends(values), "to"))
          else listed(format_each(values), "or")
  list(rows = rows, value = values[1],
       says = sprintf(paste("%s is %s in %s, far outside all other values (%s to %s): correct",
                            "these rows, or set them to NA."),
                      x$told, told, rows_words(rows), usual[1], usual[2]))
}

usual_ends <- function(values) format_each(signif(range(values), 4))

# Rows beyond a gap that is wider than all that lies inside of it, going outwards from the middle
# nine tenths of the distinct values. Amounts (never negative, often zero) have long tails and count
# by their roots.
far_rows <- function(v) {
  size <- if (are_amounts(v)) sqrt(v) else v
  u <- sort(unique(size))
  if (length(u) < rules$few_values) return(integer())
  skip <- ceiling(rules$record_tail * length(u))
  upper <- first_gap(u[-seq_len(skip)], u[length(u) - skip])
  lower <- -first_gap(-rev(u)[-seq_len(skip)], -u[skip + 1])
  rows <- which(size > upper | size < lower)
  if (length(rows) <= rules$few_far * sum(!is.na(v))) rows else integer()
}

# The last of rising values before such a gap, beginning at `from`.
first_gap <- function(u, from) {
  wide <- diff(u) > rules$far_outside * (u[-length(u)] - u[1]) & u[-length(u)] >= from
  if (any(wide)) u[which(wide)[1]] else Inf
}

are_amounts <- function(v) {
  v <- v[!is.na(v)]
  length(v) > 0 && min(v) == 0 && mean(v == 0) > rules$zero_share
}

# ---- the end of a range

# list(rows, end): those of an end at which values pile up, more than at any of the five next to it.
piled_rows <- function(v, upper) {
  levels <- rle(sort(if (upper) -v else v))
  count <- levels$lengths
  least <- max(rules$pile_rows, rules$pile_share * sum(count))
  if (length(count) < 6 || count[1] < least) return(NULL)
  end <- levels$values[1] * if (upper) -1 else 1
  if (count[1] > rules$piled_up * max(count[2:6])) list(rows = which(v == end), end = end)
}

range_finding <- function(x) {
  ends <- list(lower = piled_rows(x$v, FALSE), upper = piled_rows(x$v, TRUE))
  if (identical(ends$lower$end, 0)) ends$lower <- NULL  # nothing flows or falls
  ends <- Filter(Negate(is.null), ends)
  if (!length(ends)) return(NULL)
  rows <- sort(unlist(lapply(ends, `[[`, "rows"), use.names = FALSE))
  at <- vapply(ends, `[[`, 0, "end")
  limits <- c(lower = "-Inf", upper = "Inf")
  limits[names(at)] <- format_each(at)
  extreme <- if (length(at) > 1) "both ends"
             else switch(names(at), lower = "its least value", "its largest value")
  list(rows = rows, value = unname(at[1]),
       says = sprintf(paste("%s is %s, %s, in %d of %d rows: the range of its sensor seems to end",
                            "there. Give range = c(%s, %s) to leave these rows out of the",
                            "comparison."), x$told,
                      listed(format_each(at), "or"), extreme, length(rows), sum(!is.na(x$v)),
                      limits[["lower"]], limits[["upper"]]))
}

# ---- readings that repeat

has_few_levels <- function(v) length(unique(v[!is.na(v)])) <= rules$few_values

# Unbroken runs of one value: list(first, length, value), without those of zero.
value_runs <- function(v) {
  runs <- rle(ifelse(is.na(v), Inf, v))
  first <- cumsum(c(1, runs$lengths))[seq_along(runs$lengths)]
  kept <- is.finite(runs$values) & runs$values != 0
  list(first = first[kept], length = runs$lengths[kept], value = runs$values[kept])
}

# Much longer than nine in ten of the column's runs. What drives has no noise, and may rest at
# either end of its range.
stuck_finding <- function(x) {
  if (!x$is_target && never_falls(x$v)) return(NULL)
  runs <- value_runs(x$v)
  if (length(runs$length) < rules$few_values) return(NULL)
  usual <- stats::quantile(runs$length, 0.9, type = 1)
  long <- runs$length > max(rules$stuck_runs * usual, if (!x$is_target) rules$stuck_rows)
  if (!x$is_target) long <- long & !runs$value %in% range(x$v, na.rm = TRUE)
  if (!any(long)) return(NULL)
  rows <- unlist(Map(function(first, n) seq(first, length.out = n), runs$first[long],
                     runs$length[long]))
  list(rows = rows, value = runs$value[long][1], says = sprintf(
    "%s is %s in all of %s: its sensor seems to be stuck. Set these readings to NA.", x$told,
    listed(format_each(unique(runs$value[long]))), rows_words(rows)))
}

# Nearly all readings of a target are one value, unless it is zero.
at_rest_finding <- function(x) {
  runs <- rle(sort(x$v))
  n <- sum(runs$lengths)
  if (n < rules$suspect_rows) return(NULL)
  most <- which.max(runs$lengths)
  value <- runs$values[most]
  if (value == 0 || runs$lengths[most] < rules$at_rest * n) return(NULL)
  list(value = value,
       says = sprintf(paste("%s is %s in %d of %d rows: its sensor seems to be stuck or coarse.",
                            "Use readings that show changes."),
                      x$told, format(value), runs$lengths[most], n))
}

# As a meter, which stands while nothing is used.
never_falls <- function(v) all(diff(v[!is.na(v)]) >= 0)

# Changes of value stand a whole number of rows apart.
repeated_finding <- function(x) {
  changes <- which(diff(x$v) != 0)
  if (length(changes) < rules$few_values) return(NULL)
  times <- common_spacing(changes)
  if (times < 2 || x$per_step %% times == 0) return(NULL)
  list(value = times, says = sprintf(paste("%s changes every %d rows at most: each value stands in",
                                           "%d rows. Give average as long as these, or readings of",
                                           "every row."), x$told, times, times))
}

# The largest spacing that nineteen in twenty of the places share.
common_spacing <- function(at) {
  for (times in sort(unique(diff(at)), decreasing = TRUE)) {
    most <- max(tabulate(at %% times + 1))
    if (times > 1 && most >= rules$repeated_share * length(at)) return(times)
  }
  1
}

# ---- steps between values

# The step of which all differences between values are multiples, or nothing.
value_step <- function(v) {
  apart <- diff(sort(unique(v)))
  apart <- apart[apart > 1e-9 * max(abs(v), na.rm = TRUE)]
  if (length(apart) < 3) return(NULL)
  step <- stats::median(apart)
  whole <- round(apart / step)
  are_steps <- whole > 0 & abs(apart / step - whole) < rules$step_off
  if (mean(are_steps) > rules$step_share) step
}

quantised_finding <- function(x) {
  step <- value_step(x$v)
  if (is.null(step) || step <= rules$coarse_step * x$noise_sd) return(NULL)
  list(value = step, says = sprintf(paste("%s comes in steps of %s, coarse for a noise of %s: use",
                                          "finer readings, or state a noise of %s at least."),
                                    x$told, short(step), short(x$noise_sd), short(step / sqrt(12))))
}

# ---- what is no quantity of its own

# Degrees jump between the ends of the circle, and neighbours are close when taken around it. Those
# that never do may have the name of a direction.
direction_finding <- function(x) {
  v <- x$v[!is.na(x$v)]
  if (has_few_levels(v) || min(v) < -180 || max(v) > 360 || min(v) < 0 && max(v) > 180) return(NULL)
  is_named <- grepl("^(w|wind)?_?(d|dir)$|direction|dir_|_dir|wind_?dir|azimuth", x$name,
                    ignore.case = TRUE)
  jumps <- circle_jumps(v)
  if (jumps < 2 && !(is_named && diff(range(v)) > 90)) return(NULL)
  list(value = jumps,
       says = sprintf(
         "%s looks like a direction in degrees (%s): write circular(%s) in boundary.", x$told,
         if (jumps) sprintf("it jumps %d times from one end of the circle to the other", jumps)
         else sprintf("its name, and values from %s to %s", short(min(v)), short(max(v))), x$name))
}

# How often neighbours lie at either end of the circle, if they then are close and all its quarters
# occur.
circle_jumps <- function(v) {
  pairs <- cbind(v[-length(v)], v[-1])
  pairs <- pairs[rowSums(pairs == 0) == 0, , drop = FALSE]  # zero is off, or calm
  jump <- abs(pairs[, 2] - pairs[, 1])
  over <- jump > 180
  close <- any(over) && stats::median(360 - jump[over]) < rules$circle_near
  if (close && all(tabulate(floor((v %% 360) / 90) + 1, 4) > 0)) sum(over) else 0
}

# It never falls but to where it began; what rises by equal steps is a clock.
counter_finding <- function(x) {
  v <- x$v[!is.na(x$v)]
  change <- diff(v)
  fall <- which(change < 0)
  rise <- change[change > 0]
  if (!length(fall) || length(rise) < rules$counter_rises ||
      length(fall) > rules$counter_falls * length(rise)) return(NULL)
  if (length(unique(signif(rise, 6))) <= rules$clock_rises) return(NULL)
  to_start <- v[fall + 1] <= min(v) + rules$counter_start * diff(range(v))
  resets <- to_start & -change[fall] > rules$counter_reset * max(rise)
  if (!all(resets)) return(NULL)
  list(value = length(fall), says = sprintf(
    paste("%s only rises, and is reset %s: it is a counter. Give its change over each row."),
    x$told, if (length(fall) > 1) paste(length(fall), "times") else "once"))
}

# What calibration cannot show, though the held-out rows have it.
constant_finding <- function(x) {
  values <- function(use) unique(x$v[x$use == use & !is.na(x$v)])
  seen <- values("calibrate")
  if (!x$is_condition || length(seen) != 1 || all(values("validate") == seen)) return(NULL)
  list(value = seen, says = sprintf(paste("%s is %s in all rows that calibrate, but not in those",
                                          "held out: what it does cannot be learned. Calibrate on",
                                          "rows in which it varies."), x$told, format(seen)))
}

# Row numbers as ranges, the first few of them.
rows_words <- function(rows) {
  part <- cumsum(c(TRUE, diff(rows) != 1))
  ends <- vapply(split(rows, part), function(r) {
    if (length(r) > 1) paste(r[1], "to", r[length(r)]) else paste(r)
  }, "")
  more <- length(ends) - 4
  if (more > 0) ends <- c(ends[1:4], paste(more, "more"))
  paste(if (length(rows) > 1) "rows" else "row", listed(unname(ends)))
}
