# Worlds with something hidden in them. A world is drawn from its seed alone: climate and season,
# length, true parameters, noise, the hidden effect and its strength. Truth is simulated on a finer
# grid, in space and time, than the models that are fitted, so that nothing is recovered by sharing
# an error.

catalogue_kinds <- c("wind-driven infiltration", "window transmission", "heater lag",
                     "missing thermal mass", "glazing U-value", "sky exchange",
                     "wind-dependent outside convection", "neighbour coupling")
outside_kinds <- c("door opened daily", "drifting sensor", "unmetered load")
world_kinds <- c("none", catalogue_kinds, "two effects", outside_kinds)

# Conditions that may rightly be named for each mechanism.
true_boundary <- list(
  "wind-driven infiltration" = c("Ws", "Wd", "Te"), "window transmission" = "Gv",
  "heater lag" = "RHP", "missing thermal mass" = c("RHP", "Te", "Gv"), "glazing U-value" = "Te",
  "sky exchange" = c("Lw", "Te"), "wind-dependent outside convection" = c("Ws", "Wd", "Gv", "Te"),
  "neighbour coupling" = "Tn")

climates <- list(
  coast_spring = list(latitude = 36.8, day_of_year = 100, temperature = 17, daily_range = 9,
                      cloudiness = 0.3, wind = 3.5),
  alps_autumn = list(latitude = 47.9, day_of_year = 250, temperature = 13, daily_range = 10,
                     cloudiness = 0.5, wind = 2.0),
  north_winter = list(latitude = 57.0, day_of_year = 330, temperature = 1, daily_range = 4,
                      cloudiness = 0.7, wind = 4.5),
  inland_summer = list(latitude = 40.4, day_of_year = 190, temperature = 25, daily_range = 14,
                       cloudiness = 0.1, wind = 2.5),
  island_spring = list(latitude = 52.0, day_of_year = 80, temperature = 7, daily_range = 6,
                       cloudiness = 0.6, wind = 5.5))

columns <- c("Te", "Gv", "Ws", "Wd", "RHP", "Lw", "Tn")
step_h <- 0.25

draw_weather <- function(days) {
  climate <- climates[[sample.int(length(climates), 1)]]
  data <- do.call(amiss::synthetic_weather,
                  c(list(days = days, step_h = step_h, seed = sample.int(1e9, 1)), climate))
  n <- nrow(data)
  seed <- withr::with_preserve_seed(sample.int(1e9, 1))
  data$RHP <- amiss::rolbs(n, step_h, power = 100, seed = seed)
  slow <- as.numeric(stats::filter(stats::rnorm(n), exp(-step_h / 12), "recursive"))
  data$Tn <- 20 + 2.5 * slow / stats::sd(slow) + 1.5 * (data$hour %% 24 > 7 & data$hour %% 24 < 22)
  data
}

# A gain that no mechanism of the catalogue describes; amplitude in its own unit.
outside_effect <- function(kind, data, amplitude) {
  hour <- data$hour %% 24
  switch(kind,
    "door opened daily" = ifelse(hour > 9 & hour <= 10, amplitude, 0),
    "unmetered load" = ifelse(hour > 18 & hour <= 21, amplitude, 0))
}

simulate_truth <- function(zone, values, data) {
  drivers <- as.matrix(data[setdiff(names(data), "hour")])
  amiss::simulate_zone(zone, t(values), drivers, step_s = 3600 * step_h,
                       control = list(max_substep_s = 150, cells = 2))[, 1]
}

middle_values <- function(zone, low = 0.2, high = 0.8) {
  vapply(amiss::zone_parameters(zone),
         function(p) p$prior$lower + stats::runif(1, low, high) * (p$prior$upper - p$prior$lower),
         0)
}

# What is left of a difference once the base model's parameters have adapted (to first order).
adapted_rms <- function(effect, sensitivity)
  sqrt(mean(stats::lm.fit(sensitivity, effect)$residuals^2))

base_sensitivity <- function(base, values, data, rows) {
  centre <- simulate_truth(base, values, data)
  vapply(names(values), function(n) {
    prior <- amiss::zone_parameters(base)[[n]]$prior
    moved <- replace(values, n, values[[n]] + 0.02 * (prior$upper - prior$lower))
    (simulate_truth(base, moved, data) - centre)[rows]
  }, numeric(length(rows)))
}

# Output of the box with one effect of a given size in (0, 1], everything else at its true value.
effect_output <- function(kind, base, values, data, size) {
  if (kind == "drifting sensor")
    return(simulate_truth(base, values, data) + size * 3 * (data$hour / max(data$hour))^2)
  if (kind %in% outside_kinds) {
    zone <- switch(kind,
      "door opened daily" =
        amiss::add_component(base, amiss::zone_supply("door", flow = "extra", temperature = "Te")),
      "unmetered load" = amiss::add_component(base, amiss::zone_gain("load", power = "extra")))
    data$extra <- outside_effect(kind, data,
                                 size * c("door opened daily" = 40, "unmetered load" = 60)[[kind]])
    return(simulate_truth(zone, values, data))
  }
  effect <- effect_zone(kind, base, size)
  simulate_truth(effect$zone, c(values, effect$value), data)
}

# The mechanism at a size in (0, 1] of its prior; window and glazing leave the base model's own
# value.
effect_zone <- function(kind, base, size) {
  zone <- amiss::box_catalogue(columns)[[kind]]$edit(base)
  new <- setdiff(names(amiss::zone_parameters(zone)), names(amiss::zone_parameters(base)))
  prior <- amiss::zone_parameters(zone)[[new]]$prior
  believed <- c("window transmission" = 0.61 * 0.52^2 / 0.36, "glazing U-value" = 1.5)
  value <-
    if (kind %in% names(believed)) believed[[kind]] + size * (0.95 * prior$upper - believed[[kind]])
    else prior$lower + 0.95 * size * (prior$upper - prior$lower)
  list(zone = zone, value = stats::setNames(value, new))
}

draw_noise <- function(n, sd, ar1) {
  if (ar1 == 0) return(stats::rnorm(n, 0, sd))
  sd * as.numeric(stats::filter(c(stats::rnorm(1), sqrt(1 - ar1^2) * stats::rnorm(n - 1)), ar1,
                                "recursive"))
}

# The size at which the effect's RMS, once the parameters have adapted, is `wanted`; 1 if it is not
# reached.
find_size <- function(rms_at, wanted) {
  if (rms_at(1) <= wanted) return(1)
  stats::uniroot(function(s) rms_at(s) - wanted, c(1e-4, 1), tol = 1e-3)$root
}

#' @param seed Everything follows from it.
#' @param kind,strength,days To fix these; drawn if NULL. Strength is the ratio of the adapted
#'   effect's RMS to the noise.
draw_world <- function(seed, kind = NULL, strength = NULL, days = NULL) {
  set.seed(seed, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
  drawn_kind <- sample(
    c(rep("none", 4), rep(catalogue_kinds, 2), rep("two effects", 2), outside_kinds), 1)
  drawn_strength <- sample(c(0.5, 1, 2, 4, 8), 1)
  kind <- if (is.null(kind)) drawn_kind else kind
  strength <- if (kind == "none") 0 else if (is.null(strength)) drawn_strength else strength
  drawn_days <- sample(4:14, 1)
  days <- if (is.null(days)) drawn_days else days
  data <- draw_weather(days)
  noise <- exp(stats::runif(1, log(0.02), log(0.3)))
  ar1 <- sample(c(0, 0, 0.5, 0.8), 1)
  base <- amiss::paper_box("M2")
  values <- middle_values(base)
  kinds <- if (kind == "two effects") sample(catalogue_kinds, 2) else setdiff(kind, "none")
  calibrate <- data$hour <= 24 + 24 * ceiling(0.6 * (days - 1))
  rows <- which(calibrate & data$hour > 24)
  clean <- plain <- simulate_truth(base, values, data)
  sensitivity <- base_sensitivity(base, values, data, rows)
  rms_at <- function(k, size)
    adapted_rms((effect_output(k, base, values, data, size) - plain)[rows], sensitivity)
  # Where an effect cannot be strong enough, the noise is lowered, to 0.02 K at the least.
  for (k in kinds) noise <- min(noise, max(0.02, rms_at(k, 1) / strength))
  effects <- list()
  for (k in kinds) {
    size <- find_size(function(size) rms_at(k, size), strength * noise)
    effects[[k]] <- c(if (k %in% catalogue_kinds) effect_zone(k, base, size)$value, size = size)
  }
  if (length(kinds) == 1) clean <- effect_output(kinds, base, values, data, effects[[1]][["size"]])
  if (length(kinds) == 2) {
    both <- Reduce(function(zone, k) amiss::box_catalogue(columns)[[k]]$edit(zone), kinds, base)
    own <- unlist(lapply(unname(effects), function(e) e[setdiff(names(e), "size")]))
    clean <- simulate_truth(both, c(values, own)[names(amiss::zone_parameters(both))], data)
  }
  achieved <- if (length(kinds)) adapted_rms((clean - plain)[rows], sensitivity) / noise else 0
  data$Ti <- clean + draw_noise(nrow(data), noise, ar1)
  average <- c(0.25, 0.5, 1)[findInterval(sum(calibrate) - 96, c(0, 500, 1000))]
  measured <- suppressMessages(
    amiss::measurements(data, time = "hour", target = "Ti",
                        boundary = c("Te", "Gv", "Ws", "circular(Wd)", "RHP", "Lw", "Tn"),
                        noise_sd = noise, average = if (average > step_h) average, warmup = 24,
                        calibrate = calibrate, validate = !calibrate, name = kind, unit = "K"))
  # What the walls were before the record is unknown to whoever fits.
  fitted <- amiss::change_component(
    base, "zone",
    initial_wall_offset = amiss::free("initial_wall_offset", amiss::normal(0, 1, -3, 3), "K"))
  list(seed = seed, family = "box", kind = kind, kinds = kinds, strength = strength,
       achieved = achieved, noise = noise, ar1 = ar1, days = days, values = values,
       effects = effects, clean = clean, data = data, measurements = measured, base = fitted,
       catalogue = amiss::box_catalogue(columns),
       true_boundary = as.character(unique(unlist(true_boundary[kinds], use.names = FALSE))))
}
