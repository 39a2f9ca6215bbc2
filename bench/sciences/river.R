# Dissolved oxygen in a river, by the hour. Hidden: reaeration by wind; the model lacks besides a
# slow pool in the gravel, and that the water saturates with a hundredth less of oxygen. The truth
# takes steps of five minutes, the model of a quarter of an hour.
draw_river <- function(seed) {
  set.seed(seed)
  n <- 480
  parts <- 12
  hour <- (seq_len(n) - 1) %% 24
  storm <- pmax(0, stationary(n, 0.96, 1) - 0.6)
  clear <- pmin(1, pmax(0.1, 0.85 - 0.4 * storm + stationary(n, 0.9, 0.15)))
  light <- 800 * pmax(0, sin(2 * pi * (hour - 6) / 24)) * clear
  flow <- 3 + 4 * as.numeric(stats::filter(0.08 * storm, 0.92, method = "recursive")) +
    stationary(n, 0.9, 0.1)
  breeze <- 1.2 * pmax(0, sin(2 * pi * (hour - 9) / 24))
  wind <- pmax(0.2, 1.2 + 2.5 * storm + breeze + stationary(n, 0.8, 0.7))
  warmed <- as.numeric(stats::filter((light - 200) * 0.0006, 0.93, method = "recursive"))
  water <- 17 + warmed - 0.25 * (flow - 3) + stationary(n, 0.99, 1)
  saturation <- function(water)
    14.652 - 0.41022 * water + 0.007991 * water^2 - 0.000077774 * water^3
  true <- c(ka = 0.18, photo = 0.9, resp = 0.38, windk = 0.075)
  oxygen <- 8
  gravel <- 7
  inside <- matrix(0, parts, n)
  for (t in seq_len(n)) {
    for (j in seq_len(parts)) {
      reaeration <- (true[["ka"]] + true[["windk"]] * wind[t]) * 1.024^(water[t] - 20)
      change <- reaeration * (0.99 * saturation(water[t]) - oxygen) +
        true[["photo"]] * light[t] / 500 -
        true[["resp"]] + 0.02 * (gravel - oxygen)
      gravel <- gravel + (0.05 * (oxygen - gravel) - 0.015) / parts
      oxygen <- oxygen + change / parts
      inside[j, t] <- oxygen
    }
  }
  table <- data.frame(hour = seq_len(n), oxygen = colMeans(inside) + noise_of(n, 0.07), light,
                      water, flow, wind)
  balance <- function(values, drivers, info) {
    n <- nrow(drivers)
    parts <- 4
    saturated <- saturation(drivers[, "water"])
    reaeration <- (values[["ka"]] + term(info, "reaeration", 0, n)) *
      1.024^(drivers[, "water"] - 20) * term(info, "turbulence", 1, n)
    gain <- values[["photo"]] * drivers[, "light"] / 500 * term(info, "efficiency", 1, n) -
      values[["resp"]] * term(info, "respiration", 1, n) - term(info, "demand", 0, n)
    oxygen <- start_of(info, 8)
    mean <- numeric(n)
    for (i in seq_len(n)) {
      sum <- 0
      for (j in seq_len(parts)) {
        oxygen <- oxygen + info$step_h / parts * (reaeration[i] * (saturated[i] - oxygen) + gain[i])
        sum <- sum + oxygen
      }
      mean[i] <- max(0, sum / parts)
    }
    mean
  }
  base <- function_simulator(
    balance, free("ka", uniform(0.02, 1), "1/h"), free("photo", uniform(0.1, 3), "mg/L/h"),
    free("resp", uniform(0, 2), "mg/L/h"), boundary = c("light", "water"), name = "oxygen balance")
  mechanisms <- catalogue(
    new_mechanism("wind reaeration", "wind", "Wind ruffles the surface and lets oxygen through.",
                  free("windk", uniform(0, 0.3), "s/m/h"), function(values, drivers, info, base) {
      base(values, drivers, added(info, "reaeration", values[["windk"]] * drivers[, "wind"]))
    }),
    new_mechanism("flow turbulence", "flow", "A fast flow exchanges more oxygen with the air.",
                  free("power", uniform(-0.5, 1.5)), function(values, drivers, info, base) {
      base(values, drivers, scaled(info, "turbulence", (drivers[, "flow"] / 4)^values[["power"]]))
    }),
    new_mechanism("stirred sediment", "flow", "High flow stirs sediment that consumes oxygen.",
                  free("stirred", uniform(0, 0.3), "mg/L/h/(m3/s)"),
                  function(values, drivers, info, base) {
      base(values, drivers,
           added(info, "demand", values[["stirred"]] * pmax(0, drivers[, "flow"] - 3)))
    }),
    new_mechanism("warm respiration", "water", "Bacteria breathe more when it is warm.",
                  free("theta", uniform(1, 1.15)), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "respiration", values[["theta"]]^(drivers[, "water"] - 20)))
    }),
    new_mechanism("light saturation", "light", "Algae cannot use the strongest light.",
                  free("saturated", uniform(0, 4)), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "efficiency", 1 / (1 + values[["saturated"]] * drivers[, "light"] / 1000)))
    }),
    drifting_sensor(0.05, "mg/L/d"))
  measured <- measurements(table, time = "hour", target = "oxygen",
                           boundary = ~ light + water + flow + wind, noise_sd = 0.07, unit = "mg/L",
                           name = "river", warmup = 24, calibrate = table$hour <= 340,
                           validate = table$hour > 340)
  list(base = base, measurements = measured, catalogue = mechanisms, hidden = "wind reaeration",
       true = true)
}
