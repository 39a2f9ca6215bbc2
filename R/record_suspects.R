# Faults of a record that only a simulation shows: clocks that differ, a start that is not
# forgotten, a step of a sensor, a condition whose sensor ends or is coarse. Each changes what the
# base model simulates; it is suspected if the base model's error then falls decisively, by most of
# what exceeds the noise, and no less than with what was adopted.

# The suspects of all records, as record_findings() gives them: `record`, `id`, `column`, `says`.
# `runs`: how many runs of the simulator may be made.
record_suspects <- function(models, measurements, threads, runs = Inf) {
  ends <- models[unique(c(1, length(models)))]
  views <- lapply(ends, each_view, measurements)
  found <- lapply(seq_along(views[[1]]), function(k) {
    of_record <- lapply(views, `[[`, k)
    case <- suspect_case(of_record[[1]], if (length(ends) > 1) of_record[[2]]$model, threads, runs)
    if (is.null(case)) return(NULL)
    suspects <- rbind(suspect_words(strongest_suspect(case), case), coarse_driver_suspects(case))
    if (NROW(suspects)) data.frame(record = names(views[[1]])[k] %||% "", suspects)
  })
  do.call(rbind, found)
}

# What a suspicion is held against, or NULL if no error is there to explain.
suspect_case <- function(base, adopted, threads, runs) {
  fit <- base$model$fit
  m <- base$measurements
  error <- left_at_best(fit)
  if (length(error) < rules$suspect_rows || !all(is.finite(error)) ||
      mean(error^2) < rules$excess_error * m$noise_sd^2)
    return(NULL)
  case <- list(fit = fit, measurements = m, noise = m$noise_sd, y = m$y[fit$rows],
               hours = m$hours[fit$rows], segment = m$segment[fit$rows],
               simulated = m$y[fit$rows] - error, slopes = emulated_slopes(fit), threads = threads,
               runs = runs)
  if (!is.null(adopted)) {
    p <- adopted$prediction[adopted$prediction$use == "calibrate", ]
    case$adopted <- list(
      left = p$observed - p$mean,
      more = length(drawn_parameters(adopted$fit)) - length(drawn_parameters(fit)))
  }
  case$before <- left_with(case)
  case
}

# What is left of the record beside a simulation, by least squares in the model's parameters under
# their priors, and in the amounts of `extra` columns, which are free or have standard normal
# priors; NA where the simulation is.
left_with <- function(case, simulated = case$simulated, slopes = case$slopes, extra = NULL,
                      free = TRUE) {
  r <- case$y - simulated
  x <- cbind(slopes, extra)
  there <- is.finite(r) & rowSums(!is.finite(x)) == 0
  x <- x[there, , drop = FALSE]
  small <- if (free) 1e-9 * max(colSums(x^2), 1e-300) else case$noise^2
  penalty <- c(rep(case$noise^2, ncol(slopes)), rep(small, NCOL(extra) * !is.null(extra)))
  amounts <- solve(crossprod(x) + diag(penalty, ncol(x)), crossprod(x, r[there]))
  left <- rep(NA_real_, length(r))
  left[there] <- r[there] - x %*% amounts
  list(left = left, amounts = amounts[-seq_len(ncol(slopes))])
}

# log10 of how much more probable the errors are when `left` than when `before`, if `more`
# parameters do it; errors count as normal, and as fewer by the autocorrelation that is left.
error_gain <- function(before, left, more) {
  there <- is.finite(left) & is.finite(before)
  left <- left[there]
  lag <- max(0, min(rules$most_correlated, sum(left[-1] * left[-length(left)]) / sum(left^2)))
  n <- length(left) * (1 - lag) / (1 + lag)
  (n / 2 * log(sum(before[there]^2) / sum(left^2)) - more / 2 * log(length(left))) / log(10)
}

# Share of the excess over the noise that goes.
excess_share <- function(before, left, noise) {
  there <- is.finite(left)
  gone <- sum(before[there]^2) - sum(left[there]^2)
  gone / max(sum(before[there]^2) - noise^2 * sum(there), 1e-300)
}

# The suspicion that gains most, or NULL: list(id, column, ..., left). Clocks of drivers cost most
# runs, and are tried last.
strongest_suspect <- function(case) {
  tried <- c(clock_suspects(case), start_suspects(case), step_suspects(case),
             range_suspects(case))
  best_suspect(tried, case) %||% best_suspect(driver_clock_suspects(case), case)
}

# Kinds are as probable as one another, and so are those of a kind.
best_suspect <- function(tried, case) {
  tried <- Filter(Negate(is.null), tried)
  if (!length(tried)) return(NULL)
  kinds <- vapply(tried, `[[`, "", "id")
  gains <- vapply(tried, function(s) error_gain(case$before$left, s$left, s$more), 0) -
    log10(table(kinds)[kinds] * length(unique(kinds)))
  best <- tried[[which.max(gains)]]
  holds <- max(gains) >= rules$decisive &&
    excess_share(case$before$left, best$left, case$noise) >= rules$excess_gone &&
    !is_beaten(best, case)
  if (holds) best
}

# Whether what was adopted explains the error decisively better.
is_beaten <- function(suspect, case) {
  if (is.null(case$adopted)) return(FALSE)
  error_gain(suspect$left, case$adopted$left + 0 * suspect$left,
             case$adopted$more - suspect$more) >= rules$decisive
}

suspect <- function(id, column, found, more, ...)
  list(id = id, column = column, left = found$left, more = more, ...)

# ---- clocks

# Hours by which clocks differ: a few steps, halves and whole hours, half a day and a day.
clock_lags <- function(case) {
  step <- case$measurements$step_h
  lags <- unique(signif(c(step * seq_len(rules$clock_steps), 0.5, 1, 2, 12, 24), 6))
  longest <- rules$longest_lag * diff(range(case$hours))
  lags <- lags[lags >= rules$least_lag * step & lags <= longest]
  c(lags, -lags)
}

# Columns as they were `lag` hours before, by straight lines within unbroken parts.
lagged_by <- function(case, x, lag) {
  x <- as.matrix(x)
  out <- matrix(NA_real_, nrow(x), ncol(x))
  for (rows in split(seq_along(case$hours), case$segment)) {
    if (length(rows) < 2) next
    for (k in seq_len(ncol(x))) {
      out[rows, k] <- stats::approx(case$hours[rows], x[rows, k], case$hours[rows] - lag)$y
    }
  }
  out
}

clock_suspects <- function(case) {
  lags <- clock_lags(case)
  shifted <- lapply(lags, function(lag) {
    list(simulated = lagged_by(case, case$simulated, lag)[, 1],
         slopes = lagged_by(case, case$slopes, lag))
  })
  whole <- Map(function(lag, s) {
    suspect("clock", case$measurements$target, left_with(case, s$simulated, s$slopes), 1, lag = lag)
  }, lags, shifted)
  hour <- abs(lags) == 1
  c(whole, unlist(Map(function(lag, s) changed_clock(case, lag, s), lags[hour], shifted[hour]),
                  recursive = FALSE))
}

# The clock differs from a row on, or up to it, as with daylight saving.
changed_clock <- function(case, lag, shifted) {
  each_part(case, function(other, at, later) {
    slopes <- case$slopes
    slopes[other, ] <- shifted$slopes[other, ]
    found <- left_with(case, ifelse(other, shifted$simulated, case$simulated), slopes)
    suspect("daylight", case$measurements$target, found, 2, lag = lag, at = at, later = later)
  })
}

each_part <- function(case, f) {
  parts <- expand.grid(at = places(case, rules$changed_places), later = c(TRUE, FALSE))
  Map(function(at, later) f((seq_along(case$y) >= at) == later, at, later), parts$at, parts$later)
}

places <- function(case, number) {
  n <- length(case$y)
  margin <- rules$place_margin
  unique(round(seq(margin * n, (1 - margin) * n, length.out = min(number, n))))
}

# One driver: runs with it a step early and late show along what the error falls; if along none, a
# day is tried.
driver_clock_suspects <- function(case) {
  if (!is_unsettled(case)) return(NULL)
  names <- moving_drivers(case)
  steps <- expand.grid(name = names, sign = c(1, -1), stringsAsFactors = FALSE)
  step_h <- case$measurements$raw$step_h
  gains <- mapply(function(name, sign) first_gain(case, name, sign * step_h), steps$name,
                  steps$sign)
  best <- steps[which.max(gains), ]
  lags <- clock_lags(case)
  if (max(gains) < rules$decisive) return(driver_lags(case, names, lags[abs(lags) == 24]))
  driver_lags(case, best$name, lags[sign(lags) == best$sign & abs(lags) < 12])
}

# What is gained along the change that a small lag makes.
first_gain <- function(case, name, lag) {
  moved <- with_driver(case, name, function(v, hours) lagged_driver(v, hours, lag))
  found <- left_with(case, extra = moved - case$simulated)
  if (isTRUE(found$amounts > 0)) error_gain(case$before$left, found$left, 1) else -Inf
}

# The amount is free, as the parameters were calibrated with the wrong clock.
driver_lags <- function(case, names, lags) {
  pairs <- expand.grid(name = names, lag = lags, stringsAsFactors = FALSE)
  unlist(Map(function(name, lag) {
    change <- with_driver(case, name, function(v, hours) lagged_driver(v, hours, lag)) -
      case$simulated
    change[!is_known(case, lag)] <- NA
    of <- function(id, change, more, ...) {
      found <- left_with(case, extra = change)
      if (isTRUE(found$amounts > 0)) suspect(id, name, found, more, lag = lag, ...)
    }
    changed <- if (abs(lag) == 1) each_part(case, function(other, at, later) {
      of("daylight", change * other, 3, at = at, later = later)
    })
    c(list(of("clock", change, 2)), changed)
  }, pairs$name, pairs$lag), recursive = FALSE)
}

# Rows whose driver `lag` hours before is in the record.
is_known <- function(case, lag) {
  raw <- case$measurements$raw
  end <- function(f) vapply(split(raw$hours, raw$segment), f, 0)[as.character(case$segment)]
  case$hours - lag >= end(min) & case$hours - lag <= end(max)
}

lagged_driver <- function(v, hours, lag) stats::approx(hours, v, hours - lag, rule = 2)$y

# Whether an error is left that runs with another driver may explain, and runs are left to make.
# What was adopted may have taken nearly all of it.
is_unsettled <- function(case) {
  excess <- function(left) mean(left^2) / case$noise^2 - 1
  least <- rules$excess_error - 1
  left <- case$before$left
  if (!is.null(case$adopted)) {
    left <- case$adopted$left
    least <- max(least, rules$remains * excess(case$y - case$simulated))
  }
  length(moving_drivers(case)) > 0 && excess(left) > least &&
    case$runs >= rules$driver_runs * length(moving_drivers(case))
}

# Drivers that the simulator reads and that vary.
moving_drivers <- function(case) {
  if (is.null(case$fit$best) || is.null(case$fit$emulator$simulator)) return(character())
  drivers <- case$measurements$raw$drivers
  names <- intersect(driver_names(case$fit$emulator$simulator), colnames(drivers))
  names[vapply(
    names, function(name) all(is.finite(drivers[, name])) && diff(range(drivers[, name])) > 0, NA)]
}

# A run at the base model's best, with a driver that `f` has changed in each segment; NA if it
# fails.
with_driver <- function(case, name, f) {
  m <- case$measurements
  for (rows in split(seq_along(m$raw$hours), m$raw$segment)) {
    if (length(rows) > 1)
      m$raw$drivers[rows, name] <- f(m$raw$drivers[rows, name], m$raw$hours[rows])
  }
  made <- tryCatch(suppress_run_warnings(suppressWarnings(
    simulate_measured(case$fit$emulator$simulator, case$fit$best$values, m, "calibrate",
                      case$threads)[, 1])), error = function(e) case$simulated * NA)
  if (all(is.finite(made))) made else case$simulated
}

# ---- start and steps

start_suspects <- function(case) {
  begins <- c(TRUE, diff(case$segment) != 0)
  since <- case$hours - stats::ave(case$hours, case$segment, FUN = min)
  parts <- cumsum(begins)
  long <- which(tabulate(parts) >= rules$suspect_rows)
  times <- case$measurements$step_h * 2^(0:rules$start_doublings)
  times <- times[times <= max(since) / rules$start_times]
  if (!length(long) || length(long) > rules$start_parts) return(NULL)
  lapply(times, function(time) {
    decay <- vapply(long, function(part) ifelse(parts == part, exp(-since / time), 0), case$y)
    found <- left_with(case, extra = decay)
    if (!is_clear_amount(found, case)) return(NULL)
    suspect("start", case$measurements$target, found, length(long) + 1, time = time,
            warmup = rules$start_warmup * time, amount = found$amounts)
  })
}

# What the noise could not hide.
is_clear_amount <- function(found, case) max(abs(found$amounts)) >= rules$clear_amount * case$noise

step_suspects <- function(case) {
  at_row <- function(at) {
    found <- left_with(case, extra = as.numeric(seq_along(case$y) >= at))
    suspect("step_change", case$measurements$target, found, 2, at = at, amount = found$amounts)
  }
  places <- places(case, rules$step_places)
  best <- places[which.min(vapply(places, function(at) sum(at_row(at)$left^2), 0))]
  width <- ceiling(length(case$y) / rules$step_places)
  tried <- lapply(union(places, intersect(best + (-width):width, seq_along(case$y)[-1])), at_row)
  Filter(function(s) is_clear_amount(list(amounts = s$amount), case), tried)
}

# ---- conditions at the end of a range, or in coarse steps

# A sensor that ends cuts off what lies beyond: each time an amount of its own, level and as an arc
# that goes on as the values came and went.
range_suspects <- function(case) {
  if (!is_unsettled(case)) return(NULL)
  unlist(lapply(moving_drivers(case), function(name) {
    v <- case$measurements$raw$drivers[, name]
    if (has_few_levels(v)) return(NULL)
    piled <- list(piled_rows(v, TRUE), if (min(v) != 0) piled_rows(v, FALSE))
    lapply(Filter(Negate(is.null), piled), function(piled) range_suspect(case, name, piled))
  }), recursive = FALSE)
}

range_suspect <- function(case, name, piled) {
  drivers <- case$measurements$raw$drivers[, name]
  sign <- if (piled$end == max(drivers)) 1 else -1
  outwards <- sign * rules$range_step * diff(range(drivers))
  change <- function(f) with_driver(case, name, f) - case$simulated
  level <- change(function(v, hours) v + outwards * (v == piled$end))
  arc <- change(function(v, hours) beyond_end(v, piled$end))
  began <- case$measurements$raw$hours[piled$rows[c(TRUE, diff(piled$rows) > 1)]]
  part <- findInterval(case$hours, began)
  parts <- lapply(unique(part), function(k) ifelse(part == k, 1, 0))
  extra <- do.call(cbind, c(lapply(parts, `*`, level), lapply(parts, `*`, arc)))
  extra <- extra[, colSums(extra^2) > 0, drop = FALSE]
  if (!ncol(extra) || ncol(extra) > rules$range_amounts * length(case$y)) return(NULL)
  found <- left_with(case, extra = extra, free = FALSE)
  suspect("range_end", name, found, weight_of_amounts(case, extra, found$amounts),
          end = piled$end, rows = piled$rows)
}

# As many free parameters as amounts of standard normal priors weigh: the evidence with them is less
# than the likelihood at their best by their prior there, and by what they may move beside the
# model's parameters.
weight_of_amounts <- function(case, extra, amounts) {
  beside <- qr.resid(qr(case$slopes), extra) / case$noise
  size <- eigen(crossprod(beside), symmetric = TRUE, only.values = TRUE)$values
  (sum(log1p(pmax(size, 0))) + sum(amounts^2)) / log(nrow(extra))
}

beyond_end <- function(v, end) {
  runs <- rle(v == end)
  last <- cumsum(runs$lengths)
  for (k in which(runs$values & runs$lengths > 1)) {
    from <- last[k] - runs$lengths[k]
    to <- last[k] + 1
    before <- if (from > 1) v[from] - v[from - 1] else 0
    after <- if (to < length(v)) v[to + 1] - v[to] else 0
    t <- seq_len(runs$lengths[k])
    n <- runs$lengths[k] + 1
    v[from + t] <- end + (before - after) * t * (n - t) / (2 * n)
  }
  v
}

# Drivers in steps so coarse that half of one moves the simulation by a good part of the noise,
# where the error exceeds the noise by as much.
coarse_driver_suspects <- function(case) {
  if (!is_unsettled(case)) return(NULL)
  do.call(rbind, lapply(moving_drivers(case), function(name) {
    step <- coarse_value_step(case$measurements$raw$drivers[, name])
    if (is.null(step)) return(NULL)
    shaken <- with_driver(
      case, name, function(v, hours) v + step * (with_seed(1, stats::runif(length(v))) - 0.5))
    moves <- rms(shaken - case$simulated)
    excess <- mean(case$before$left^2) - case$noise^2
    if (moves < rules$coarse_moves * case$noise || excess < rules$coarse_excess * moves^2)
      return(NULL)
    data.frame(id = "quantised", column = name, says = sprintf(
      paste("%s comes in steps of %s, which moves the simulation by %s, with a noise of %s: use",
            "finer readings."), name, short(step), short(moves), short(case$noise)))
  }))
}

# Of what moves by one step or two, and is rounded to a hundredth of its range or more.
coarse_value_step <- function(v) {
  step <- value_step(v)
  change <- abs(diff(v))
  if (!is.null(step) && step >= rules$coarse_range * diff(range(v)) &&
      mean(change[change > 0] < rules$coarse_change * step) > rules$coarse_changes)
    step
}

# ---- in words

suspect_words <- function(s, case) {
  if (is.null(s)) return(NULL)
  there <- is.finite(s$left)
  s$told <- condition_label(case$measurements, s$column)
  s$fall <- sprintf("the base model's error falls from %s to %s",
                    short(rms(case$before$left[there])),
                    with_unit(short(rms(s$left[there])), case$measurements$unit))
  data.frame(id = s$id, column = s$column, says = suspect_sentences[[s$id]](s, case))
}

suspect_sentences <- list(
  clock = function(s, case) {
    sprintf("The clock of %s seems to be %s that of the rest: with it set right, %s.", s$told,
            behind_words(s, case), s$fall)
  },
  daylight = function(s, case) {
    sprintf(paste("The clock of %s seems to be %s that of the rest %s %s, as with daylight saving",
                  "in one of them: with it set right, %s."),
            s$told, behind_words(s, case), if (s$later) "from" else "until",
            at_words(s, case), s$fall)
  },
  start = function(s, case) {
    sprintf(paste("The error decays from the first row (by half in %s h): the start is not",
                  "forgotten. Give a warmup of %s h or more."), short(log(2) * s$time),
            short(s$warmup))
  },
  step_change = function(s, case) {
    sprintf(paste("From %s on, %s lies %s %s than before, as if a sensor was moved or exchanged:",
                  "with that taken off, %s."), at_words(s, case), s$told,
            with_unit(short(abs(s$amount)), case$measurements$unit),
            if (s$amount > 0) "higher" else "lower", s$fall)
  },
  range_end = function(s, case) {
    sprintf(paste("%s is %s in %d rows, as at the end of its sensor's range: with what may lie",
                  "beyond, %s."), s$told, format(s$end), length(s$rows), s$fall)
  })

# A target that is late is simulated with a lag; a driver that is late needs a lead.
behind_words <- function(s, case) {
  late <- (s$lag > 0) == (s$column == case$measurements$target)
  paste(short(abs(s$lag)), "h", if (late) "behind" else "ahead of")
}

at_words <- function(s, case) {
  at <- case$measurements$time[case$fit$rows][s$at]
  paste0(if (is.numeric(at)) "hour ", format(at))
}

# ---- what is said of a record as a whole

# All that speaks against a record, in sentences named by what they are.
record_faults <- function(upgrade) {
  suspects <- upgrade$models[[1]]$suspects
  c(read_findings(upgrade$models, upgrade$measurements),
    stats::setNames(paste0(record_prefix(suspects$record), suspects$says, recycle0 = TRUE),
                    suspects$id))
}

record_prefix <- function(record) ifelse(nzchar(record), paste0(record, ": "), "")

# Sentences of the findings on what the models read.
read_findings <- function(models, measurements) {
  each <- each_record(measurements)
  fits <- record_fits(models[[length(models)]]$fit)
  told <- Map(function(m, fit, name) {
    found <- fit_findings(fit, m)
    stats::setNames(paste0(record_prefix(name), found$says, recycle0 = TRUE), found$id)
  }, each, fits, names(each) %||% "")
  do.call(c, unname(told))
}

fault_words <- c(
  missing_code = "a code for missing values", far_outside = "values far outside all others",
  range_end = "readings at the end of a sensor's range", stuck = "a sensor that is stuck",
  at_rest = "a target that hardly ever changes", unit = "a unit that changes",
  quantised = "readings in coarse steps", repeated = "repeated values",
  direction = "a direction that is not given as circular()", counter = "a counter",
  constant = "a condition that is constant in calibration", clock = "clocks that differ",
  daylight = "clocks that differ",
  start = "an initial state that still acts (a warm-up that is too short)",
  step_change = "a sudden shift of a sensor")

record_doubt_words <- function(ids, subject = "the record itself") {
  if (length(ids)) paste(subject, "has", listed(unique(unname(fault_words[ids]))))
}
