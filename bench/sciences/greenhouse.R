# Carbon dioxide in a greenhouse, by the hour. Hidden is what the catalogue does not hold: vents
# that open when it is warm. The truth takes steps of five minutes.
draw_greenhouse <- function(seed) {
  set.seed(seed)
  n <- 540
  parts <- 12
  hour <- (seq_len(n) - 1) %% 24
  clear <- rep(stats::runif(ceiling(n / 24), 0.15, 1), each = 24)[seq_len(n)] *
    exp(autoregressive(n, 0.5, 0.1))
  light <- pmax(0, sin(2 * pi * (hour - 6) / 24)) * 900 * clear
  recent <- as.numeric(stats::filter(c(0, 0, light), rep(1 / 3, 3), sides = 1))[-(1:2)]
  warmth <- 18 + 0.009 * recent + autoregressive(n, 0.95, 0.4)
  wind <- exp(1 + autoregressive(n, 0.93, 0.2))
  vent <- pmin(1, pmax(0, (warmth - 22) / 5)) * stats::rbinom(n, 1, 0.85)
  dose <- ifelse(light > 60, 55 * stats::rbinom(n, 1, 0.7), 0)
  true <- c(leak = 0.25, uptake = 0.22, dosing = 2.2)
  carbon <- 500
  inside <- matrix(0, parts, n)
  for (t in seq_len(n)) {
    for (j in seq_len(parts)) {
      change <- true[["dosing"]] * dose[t] - true[["uptake"]] * light[t] * carbon / (carbon + 350) +
        12 * 1.07^(warmth[t] - 20) + (true[["leak"]] + 1.5 * vent[t]) * (410 - carbon)
      carbon <- carbon + change / parts
      inside[j, t] <- carbon
    }
  }
  table <- data.frame(hour = seq_len(n), co2 = colMeans(inside) + autoregressive(n, 0.7, 6), light,
                      warmth, wind, vent, dose)
  balance <- function(values, drivers, info) {
    n <- nrow(drivers)
    exchange <- values[["leak"]] + term(info, "exchange", 0, n)
    source <- values[["dosing"]] * drivers[, "dose"] + values[["respiration"]] +
      term(info, "source", 0, n)
    uptake <- values[["uptake"]] * drivers[, "light"] * term(info, "efficiency", 1, n)
    carbon <- 500
    parts <- 4
    vapply(seq_len(n), function(i) {
      sum <- 0
      for (j in seq_len(parts)) {
        change <- source[i] - uptake[i] * carbon / (carbon + 350) + exchange[i] * (410 - carbon)
        carbon <<- carbon + info$step_h / parts * change
        sum <- sum + carbon
      }
      sum / parts
    }, 0)
  }
  base <- function_simulator(
    balance, free("leak", uniform(0.05, 2), "1/h"), free("uptake", uniform(0.02, 0.6)),
    free("respiration", uniform(0, 40), "ppm/h"), free("dosing", uniform(0.5, 4)),
    boundary = c("light", "dose"), name = "carbon balance")
  mechanisms <- catalogue(
    new_mechanism("wind leakage", "wind", "Wind drives air through the cracks.",
                  free("draught", uniform(0, 0.3), "1/m"), function(values, drivers, info, base) {
      base(values, drivers, added(info, "exchange", values[["draught"]] * drivers[, "wind"]))
    }),
    new_mechanism("warm respiration", "warmth", "Plants breathe more when it is warm.",
                  free("q10", uniform(1, 3)), function(values, drivers, info, base) {
      more <- values[["q10"]]^((drivers[, "warmth"] - 20) / 10) - 1
      base(values, drivers, added(info, "source", values[["respiration"]] * more))
    }),
    new_mechanism("light saturation", "light", "Leaves cannot use the strongest light.",
                  free("saturation", uniform(0, 3)), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "efficiency", 1 / (1 + values[["saturation"]] * drivers[, "light"] / 1000)))
    }),
    drifting_sensor(3, "ppm/d"))
  measured <- measurements(table, time = "hour", target = "co2",
                           boundary = ~ light + warmth + wind + vent + dose, noise_sd = 8,
                           unit = "ppm", name = "greenhouse", warmup = 24,
                           calibrate = table$hour <= 380, validate = table$hour > 380)
  list(base = base, measurements = measured, catalogue = mechanisms, hidden = character(),
       true = true)
}
