# Faults put into the record of a room: `put`, and the findings that are `right` about it.

in_target <- function(f) function(world) {
  world$data$Ti <- f(world$data$Ti, world)
  world
}

in_driver <- function(f, driver = "Te") function(world) {
  world$data[[driver]] <- f(world$data[[driver]], world)
  world
}

some_rows <- function(v, share = 0.015) sort(sample(length(v), max(3, ceiling(share * length(v)))))

coded <- function(codes) function(v, world) replace(v, some_rows(v), sample(codes, 1))

stuck <- function(v, world) {
  rows <-
    sample(which(seq_along(v) > world$warmup / world$step_h & seq_along(v) < 0.55 * length(v)), 1) +
      seq_len(round(30 / world$step_h))
  replace(v, rows, v[rows[1]])
}

at_step <- function(v) round(stats::runif(1, 0.3, 0.6) * length(v))

# As if read `hours` late; from a row on, if one is given.
late <- function(v, world, hours, from = 1) {
  k <- round(hours / world$step_h)
  index <- abs(seq_along(v) - k - 0.5) + 0.5  # mirrored at either end
  index <- ifelse(index > length(v), 2 * length(v) + 1 - index, index)
  ifelse(seq_along(v) >= from, v[index], v)
}

clock_hours <- function(world) sample(c(-1, 1), 1) * sample(c(1, 1, 2, 24), 1)

repeated <- function(v, world) v[4 * ((seq_along(v) - 1) %/% 4) + 1]

# With noise so small that what a fault changes is three times as large, as what does not show is no
# fault.
visible <- function(put) function(world) {
  faulty <- put(world)
  changed <- faulty$data$Ti - world$data$Ti +
    simulate_room(world$true, world$data, world$memory, world$step_h) -
    simulate_room(world$true, faulty$data, world$memory, world$step_h)
  smaller <- min(1, sqrt(mean(changed^2)) / (3 * world$noise))
  faulty$data$Ti <- faulty$data$Ti - (1 - smaller) * world$error
  faulty$noise <- smaller * world$noise
  faulty
}

# An effect that the base model lacks, three times as large as the noise, in a record without fault.
hidden_effect <- function(world) {
  simulated <- function(drivers) simulate_room(world$true, drivers, world$memory, world$step_h)
  data <- world$data
  slow <- data
  for (name in c("Te", "Gv", "P")) slow[[name]] <- one_pole(data[[name]], 3, world$step_h)
  base <- simulated(data)
  effect <- switch(
    sample(c("wind", "sky", "mass", "windows", "drift"), 1), wind = data$Ws, sky = data$Lw,
    drift = data$hour, windows = -pmax(0, base - stats::quantile(base, 0.7)),
    mass = simulated(slow) - base)
  world$data$Ti <- world$data$Ti + 3 * world$noise / stats::sd(effect) * (effect - mean(effect))
  world
}

faults <- list(
  hidden = list(put = hidden_effect, right = character()),
  code_target = list(put = in_target(coded(c(-9999, -999, -99.9, 9999, 32767, 1e30, 85))),
                     right = c("missing_code", "far_outside")),
  code_driver = list(put = in_driver(coded(c(-9999, -999, -99.9, 9999, 32767, 1e30, 150))),
                     right = c("missing_code", "far_outside")),
  code_direction = list(put = in_driver(coded(c(990, 999, -999)), "Wd"), right = "missing_code"),
  range_target = list(
    put = in_target(function(v, world) pmin(v, stats::quantile(v, stats::runif(1, 0.5, 0.85)))),
    right = "range_end"),
  range_driver = list(put = visible(in_driver(function(v, world) {
    pmin(v, stats::quantile(v, stats::runif(1, 0.6, 0.8)))
  })),
                      right = "range_end"),
  stuck_target = list(put = in_target(stuck), right = "stuck"),
  stuck_driver = list(put = in_driver(stuck), right = "stuck"),
  coarse_target = list(put = in_target(function(v, world) {
    step <- stats::runif(1, 3, 6) * world$noise
    step * round(v / step)
  }), right = "quantised"),
  coarse_driver = list(put = visible(in_driver(function(v, world) {
    step <- stats::runif(1, 4, 6) * world$noise / world$true[["g"]]
    step * round(v / step)
  })), right = "quantised"),
  repeated_target = list(put = in_target(repeated), right = "repeated"),
  repeated_driver = list(put = in_driver(repeated), right = "repeated"),
  counter = list(put = in_driver(function(v, world) {
    total <- cumsum(v)
    total - floor(total / (max(total) / 3.5)) * (max(total) / 3.5)
  }, "P"), right = "counter"),
  step_target = list(put = in_target(function(v, world) {
    v + ifelse(seq_along(v) >= at_step(v), stats::runif(1, 4, 10) * world$noise, 0)
  }), right = "step_change"),
  unit_target = list(put = in_target(function(v, world) {
    ifelse(seq_along(v) >= at_step(v), 32 + 1.8 * v, v)
  }), right = "unit"),
  unit_driver = list(put = in_driver(function(v, world) {
    ifelse(seq_along(v) >= at_step(v), 273.15 + v, v)
  }), right = "unit"),
  clock_target = list(
    put = visible(in_target(function(v, world) late(v, world, clock_hours(world)))),
    right = "clock"),
  clock_driver = list(put = visible(function(world) {
    in_driver(function(v, world) late(v, world, clock_hours(world)),
              sample(c("Te", "Gv"), 1))(world)
  }), right = "clock"),
  daylight = list(put = visible(function(world) {
    change <- function(v, world) late(v, world, sample(c(-1, 1), 1), at_step(v))
    if (stats::runif(1) < 0.5) in_target(change)(world) else in_driver(change, "Gv")(world)
  }), right = c("daylight", "clock")),
  start = list(put = function(world) {
    since <- world$data$hour - world$warmup
    away <- sample(c(-1, 1), 1) * stats::runif(1, 8, 20) * world$noise
    world$data$Ti <- world$data$Ti +
      ifelse(since > 0, away * exp(-since / stats::runif(1, 4, 15)), 0)
    world
  }, right = "start"),
  direction = list(put = function(world) {
    world$conditions <- sub("circular(Wd)", "Wd", world$conditions, fixed = TRUE)
    world
  }, right = "direction"),
  constant = list(put = function(world) {
    world$data$Ws[world$data$hour <= 0.75 * max(world$data$hour)] <- 2
    world
  }, right = "constant"))
