# Rainfall-runoff of a small catchment: a soil store that overflows, a quick and a slow reservoir.
# Conditions: rain (mm/h), potential evaporation pe (mm/h) and temperature (degC). The target is the
# square root of the discharge in mm/h: a gauge's error grows with the flow, and on this scale
# (Box-Cox with 1/2, usual in hydrology) it is about the same everywhere, so that low flows count as
# well. Base models lack five things, which are the mechanisms. Loops over the steps are compiled
# here: R would compile them again at each call once this file is read a second time.

runoff_conditions <- c("rain", "pe", "temperature")

runoff_boundary <- list("overflow threshold" = "rain", "snow store" = c("temperature", "rain"),
                        "groundwater leak" = "rain", "evaporation of dry soil" = c("pe", "rain"),
                        "delayed routing" = "rain")

runoff_sentences <- c(
  "overflow threshold" = "Above a level, the quick store empties by a second and faster way.",
  "snow store" = "In part of the catchment precipitation lies as snow until it melts.",
  "groundwater leak" = "Part of the water that percolates never reaches the gauge.",
  "evaporation of dry soil" = "Soil that dries evaporates less than the potential.",
  "delayed routing" = "Quick flow reaches the gauge later than it leaves the slopes.")

# Parameters of the mechanisms; the first of each is its extent, zero where the mechanism is absent.
runoff_parameters <- function(piece, flat) {
  switch(piece,
    "overflow threshold" = list(
      extent("overflow_rate", 0.5, "1/h", "rate of the overflow of the quick store"),
      decade("overflow_level", 4, "mm", "level above which the quick store overflows", flat)),
    "snow store" = list(extent("snow_share", 1, "", "share of the catchment where snow lies"),
                        decade("degree_day", 3, "mm/K/d",
                               "melt for each degree above zero and day", flat)),
    "groundwater leak" = list(extent("leak_share", 0.9, "", "share of percolation that leaks")),
    "evaporation of dry soil" = list(
      extent("dry_level", 1, "", "share of the capacity below which evaporation falls")),
    "delayed routing" = list(extent("delay", 48, "h", "mean delay of quick flow")))
}

# Base models differ in what feeds the slow reservoir (percolation from the soil, or a share of its
# overflow) and in what is known of the start.
runoff_structures <- c("percolation", "split")

base_runoff <- function(structure, flat, known) {
  parameters <- list(
    decade("soil_capacity", 80, "mm", "capacity of the soil", flat),
    if (structure == "percolation")
      decade("percolation", 0.08, "mm/h", "percolation of a full soil", flat)
    else amiss::free("slow_share", amiss::uniform(0.1, 0.9), "",
                     "share of the overflow that feeds the slow reservoir"),
    decade("quick_time", 16, "h", "time constant of the quick reservoir", flat),
    decade("slow_time", 400, "h", "time constant of the slow reservoir", flat),
    amiss::free("start_soil", amiss::uniform(0.1, 0.9), "", "filling of the soil at the start"),
    decade("start_flow", 0.02, "mm/h", "slow flow at the start", flat))
  parameters <- stats::setNames(parameters, vapply(parameters, `[[`, "", "name"))
  list(structure = structure, flat = flat, pieces = character(), known = known,
       parameters = parameters[setdiff(names(parameters), names(known))])
}

# Outflow of a linear reservoir averaged over each step, for an inflow constant over a step; `start`
# is its first outflow.
linear_reservoir <- function(inflow, time, step, start = 0) {
  kept <- exp(-step / max(time, 1e-6))
  end <- as.numeric(stats::filter((1 - kept) * inflow, kept, "recursive", init = start))
  begun <- c(start, end[-length(end)])
  share <- (1 - kept) * max(time, 1e-6) / step
  begun * share + (1 - share) * inflow
}

# The same with a second outlet above a level: each step is solved exactly on either side, with one
# crossing at most.
overflowing_reservoir <- compiler::cmpfun(function(inflow, time, level, rate, step) {
  above <- 1 / time + rate
  low <- inflow * time  # where the store tends to, below the level and above it
  high <- (inflow + rate * level) / above
  kept_low <- exp(-step / time)
  kept_high <- exp(-above * step)
  store <- 0
  stores <- numeric(length(inflow) + 1)
  for (k in seq_along(inflow)) {
    if (store < level || store == level && low[k] <= level) {
      after <- low[k] + (store - low[k]) * kept_low
      if (after > level) {
        crossed <- time * log((store - low[k]) / (level - low[k]))
        after <- high[k] + (level - high[k]) * exp(-above * (step - crossed))
      }
    } else {
      after <- high[k] + (store - high[k]) * kept_high
      if (after < level) {
        crossed <- log((store - high[k]) / (level - high[k])) / above
        after <- low[k] + (level - low[k]) * exp(-(step - crossed) / time)
      }
    }
    stores[k + 1] <- store <- after
  }
  inflow - diff(stores) / step
})

# Water that reaches the ground: where snow lies, what falls below zero waits for a melt of so much
# a degree.
snow_store <- compiler::cmpfun(function(rain, temperature, degree_hour, step) {
  melt <- degree_hour * pmax(temperature, 0) * step
  fall <- ifelse(temperature <= 0, rain * step, 0)
  store <- 0
  out <- numeric(length(rain))
  for (k in seq_along(rain)) {
    store <- store + fall[k]
    gone <- if (melt[k] < store) melt[k] else store
    store <- store - gone
    out[k] <- gone
  }
  (rain * step - fall + out) / step
})

# The soil: rain in, evaporation and percolation out, overflow above the capacity; evaporation falls
# below `dry`.
soil_store <- compiler::cmpfun(function(rain, pe, capacity, percolation, dry, start, step) {
  n <- length(rain)
  overflow <- percolated <- numeric(n)
  store <- start * capacity
  wet <- max(dry * capacity, 1e-9)
  into <- rain * step
  demand <- pe * step
  drain <- percolation * step / capacity
  for (k in seq_len(n)) {
    evaporated <- if (store < wet) demand[k] * store / wet else demand[k]
    drained <- drain * store
    there <- store + into[k]
    lost <- evaporated + drained
    if (lost > there) {
      drained <- drained * there / lost
      lost <- there
    }
    store <- there - lost
    if (store > capacity) {
      overflow[k] <- store - capacity
      store <- capacity
    }
    percolated[k] <- drained
  }
  list(overflow = overflow / step, percolated = percolated / step)
})

# Quick and slow flow in mm/h, averaged over each step.
runoff_flows <- function(model, values, drivers, step) {
  values <- c(values, model$known)
  of <- function(name, absent = 0) if (name %in% names(values)) values[[name]] else absent
  rain <- unname(drivers[, "rain"])  # arithmetic on values with names takes ten times as long
  share <- of("snow_share")
  if (share > 0) {
    melted <- snow_store(rain, unname(drivers[, "temperature"]), of("degree_day") / 24, step)
    rain <- (1 - share) * rain + share * melted
  }
  soil <- soil_store(rain, unname(drivers[, "pe"]), of("soil_capacity"), of("percolation"),
                     of("dry_level"), of("start_soil"), step)
  split <- of("slow_share")
  quick <- (1 - split) * soil$overflow
  slow <- (soil$percolated + split * soil$overflow) * (1 - of("leak_share"))
  quick <- if (of("overflow_rate") > 0) {
    overflowing_reservoir(quick, of("quick_time"), of("overflow_level"), of("overflow_rate"), step)
  } else {
    linear_reservoir(quick, of("quick_time"), step)
  }
  if (of("delay") > 0) quick <- linear_reservoir(quick, of("delay"), step)
  list(quick = quick, slow = linear_reservoir(slow, of("slow_time"), step, of("start_flow")))
}

# The same for conditions that are constant over a step, computed in so many parts of it and
# averaged again: a store that reaches its threshold does so within a step.
runoff_in_parts <- function(model, values, drivers, step, parts) {
  flows <- runoff_flows(
    model, values, drivers[rep(seq_len(nrow(drivers)), each = parts), , drop = FALSE], step / parts)
  lapply(flows, block_means, parts)
}

runoff_part <- 0.5  # hours, in the models; truth has six parts in each

root_flow <- function(flows) sqrt(flows$quick + flows$slow)

#' A simulator of a catchment: a function_simulator() that carries the model it was built from.
runoff_simulator <- function(model, step, parameters = model$parameters) {
  f <- runoff_function(model, step)
  named <- list(boundary = runoff_conditions, name = model$structure)
  built <- do.call(amiss::function_simulator, c(list(f), unname(parameters), named))
  built$model <- model
  built$step <- step
  built
}

runoff_function <- function(model, step) {
  model <- model[c("structure", "known")]
  force(step)
  function(values, drivers)
    root_flow(runoff_in_parts(model, values, drivers, step, step / runoff_part))
}

# The model with one more piece; parameters that it has stay as they are.
runoff_with <- function(simulator, piece) {
  model <- simulator$model
  new <- runoff_parameters(piece, model$flat)
  names(new) <- vapply(new, `[[`, "", "name")
  model$pieces <- c(model$pieces, piece)
  model$parameters <- c(simulator$parameters, new[setdiff(names(new), names(simulator$parameters))])
  runoff_simulator(model, simulator$step)
}

runoff_catalogue <- function() {
  one <- function(piece) {
    amiss::mechanism(piece, boundary = runoff_boundary[[piece]],
                     edit = function(model) runoff_with(model, piece),
                     sentence = runoff_sentences[[piece]])
  }
  do.call(amiss::catalogue, lapply(names(runoff_boundary), one))
}

# Mean temperature and its yearly swing (degC), latitude, hours from storm to storm, their mean
# length (h) and rain (mm/h).
runoff_climates <- list(
  maritime = list(latitude = 52, mean = 10, swing = 6, between = 60, length = 10, rain = 1.0),
  alpine = list(latitude = 47, mean = 4, swing = 9, between = 70, length = 9, rain = 1.6),
  continental = list(latitude = 50, mean = 8, swing = 12, between = 90, length = 7, rain = 1.5),
  mediterranean = list(latitude = 40, mean = 15, swing = 8, between = 130, length = 8, rain = 2.5))

# Storms come at random and rain in gusts; evaporation follows the sun and the temperature (Oudin et
# al., 2005).
draw_runoff_weather <- function(n, step, climate, first_day) {
  hour <- seq_len(n) * step
  day <- first_day + (hour - step / 2) / 24
  season <- cos(2 * pi * (day - 200) / 365)
  temperature <- climate$mean + climate$swing * season + 3.5 * cos(2 * pi * (day %% 1 - 15 / 24)) +
    3 * amiss:::red_noise(n, 72, step)
  rain <- numeric(n)
  storms <- stats::rpois(1, n * step / climate$between)
  begin <- stats::runif(storms, 0, n * step)
  end <- begin + stats::rexp(storms, 1 / climate$length)
  intensity <- stats::rgamma(storms, 1.5, 1.5 / climate$rain)
  for (s in seq_len(storms)) {
    covered <- pmax(0, pmin(hour, end[s]) - pmax(hour - step, begin[s])) / step
    rain <- rain + intensity[s] * covered
  }
  rain <- rain * exp(0.6 * amiss:::red_noise(n, 2, step) - 0.18)
  sun <- 1367 * pmax(sin(amiss:::sun_position(day, climate$latitude)$elevation), 0)
  pe <- sun * 3600 / 2.45e6 * pmax(temperature + 5, 0) / 100 * ifelse(rain > 0.05, 0.4, 1)
  cbind(rain = rain, pe = pe, temperature = temperature)
}

#' As draw_world(): seed, and what may be fixed; `days` sets the length at the step that was drawn.
draw_runoff_world <- function(seed, kind = NULL, strength = NULL, days = NULL) {
  set.seed(seed, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
  effects <- names(runoff_boundary)
  drawn_kind <- sample(c("none", effects), 1, prob = c(1 / 8, rep(7 / 40, 5)))
  drawn_strength <- sample(c(0.5, 1, 2, 4, 8), 1)
  kind <- if (is.null(kind)) drawn_kind else kind
  strength <- if (kind == "none") 0 else if (is.null(strength)) drawn_strength else strength
  step <- sample(c(2, 4, 6), 1)
  drawn_steps <- sample(300:700, 1)
  steps <- if (is.null(days)) drawn_steps else round(24 * days / step)
  ar1 <- sample(c(0, 0, 0.5, 0.8), 1)
  # Snow can hide only where it falls.
  cold <- kind == "snow store"
  climate <-
    runoff_climates[[sample(if (cold) c("alpine", "continental") else names(runoff_climates), 1)]]
  structure <- sample(runoff_structures, 1)
  flat <- stats::runif(1) < 0.5
  starts <- c(start_soil = stats::runif(1, 0.3, 0.8),
              start_flow = 0.02 * exp(stats::runif(1, -1, 1)))
  base <- runoff_simulator(base_runoff(structure, flat, starts[stats::runif(2) < 0.5]), step)
  calibrate <- seq_len(steps) <= round(0.6 * steps)
  rows <- setdiff(which(calibrate), 1:10)
  fine <- 6L
  true <- if (kind == "none") base else runoff_with(base, kind)
  new <- true$parameters[setdiff(names(true$parameters), names(base$parameters))]
  # A record with weather and true values of its own; NULL where it says nothing: where the
  # catchment hardly ever overflows, so that nobody would model its floods, or where the mechanism
  # at its largest hardly acts (no frost, or soil that never dries).
  draw_record <- function() {
    first_day <- if (cold) stats::runif(1, 320, 400) else stats::runif(1, 1, 365)
    drivers <- block_means(draw_runoff_weather(steps * fine, step / fine, climate, first_day), fine)
    colnames(drivers) <- runoff_conditions
    unit <- true_unit(base$parameters)
    values <- amiss:::unit_to_values(t(unit), base$parameters)[1, ]
    other <- if (length(new)) amiss:::unit_to_values(t(true_unit(new)), new)[1, ]
    truth <- function(simulator, v)
      runoff_in_parts(simulator$model, v, drivers, step, fine * step / runoff_part)
    flows <- truth(base, values)
    if (sum(flows$quick[rows]) < 0.2 * sum(flows$slow[rows] + flows$quick[rows])) return(NULL)
    plain <- root_flow(flows)
    at_size <- function(size) replace(other, 1, 0.95 * size * new[[1]]$prior$upper)
    effect_at <- function(size) root_flow(truth(true, c(values, at_size(size)))) - plain
    largest <- if (length(new)) effect_at(1) else 0 * plain
    # Noise of 2 to 20 % of the target's standard deviation: gauges are this good or bad. It hides
    # the models' coarser steps.
    spread <- min(stats::sd(plain[rows]), stats::sd((plain + largest)[rows]))
    resolution <- sqrt(mean((base$f(values, drivers) - plain)[rows]^2))
    limits <- pmax(c(0.02, 0.2) * spread, 4 * resolution)
    if (sqrt(mean(largest[rows]^2)) < strength * limits[1]) return(NULL)
    most <- if (length(new)) most_left(effect_at, base, unit, drivers, rows) else 0
    list(drivers = drivers, unit = unit, values = values, plain = plain, at_size = at_size,
         effect_at = effect_at, limits = limits, most = most, enough = most >= strength * limits[1])
  }
  drawn <- list()
  for (attempt in 1:300) {
    record <- draw_record()
    drawn <- c(drawn, list(record)[!is.null(record)])
    if (length(drawn) && (isTRUE(record$enough) || length(drawn) == 10)) break
  }
  if (!length(drawn)) stop("no record in which anything happens was drawn", call. = FALSE)
  record <- drawn[[length(drawn)]]
  hours <- seq_len(steps) * step
  warmup <- 10 * step
  noise <- exp(stats::runif(1, log(record$limits[1]), log(record$limits[2])))
  hidden <- list(noise = noise, achieved = 0, effect = 0)
  effect_values <- list()
  if (kind != "none") {
    hidden <- hide_effect(record$effect_at, base, record$unit, record$drivers, rows, strength,
                          noise, record$limits, record$most)
    effect_values[[kind]] <- c(record$at_size(hidden$size), size = hidden$size)
  }
  clean <- record$plain + hidden$effect
  data <- data.frame(hour = hours, record$drivers,
                     flow = clean + draw_noise(length(clean), hidden$noise, ar1))
  measured <- suppressMessages(
    amiss::measurements(data, time = "hour", target = "flow", boundary = runoff_conditions,
                        noise_sd = hidden$noise, warmup = warmup, calibrate = calibrate,
                        validate = !calibrate, name = kind, unit = "sqrt(mm/h)"))
  list(seed = seed, family = "runoff", kind = kind, kinds = setdiff(kind, "none"),
       strength = strength, achieved = hidden$achieved, noise = hidden$noise, ar1 = ar1,
       days = steps * step / 24, values = record$values, effects = effect_values, clean = clean,
       data = data, measurements = measured, base = base, catalogue = runoff_catalogue(),
       true_boundary = as.character(unlist(runoff_boundary[setdiff(kind, "none")],
                                           use.names = FALSE)))
}
