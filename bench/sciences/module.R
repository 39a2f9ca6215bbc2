# The power of a photovoltaic module, by the hour. Hidden is what the catalogue does not hold: dust
# that rain washes off; the model lacks besides that the module warms within minutes. The truth
# takes steps of six minutes, the model of an hour, and the meter rounds to a watt.
draw_module <- function(seed) {
  set.seed(seed)
  n <- 24 * 24
  parts <- 10
  hour <- (seq_len(n) - 1) %% 24
  day <- (seq_len(n) - 1) %/% 24
  wet <- as.numeric(day %in% c(6, 7, 13, 18))
  rain <- wet * stats::rbinom(n, 1, 0.4) * stats::rexp(n, 0.7)
  cloud <- pmin(1, pmax(0.08, 0.85 - 0.55 * wet + stationary(n, 0.85, 0.2)))
  sun <- 1000 * pmax(0, sin(2 * pi * (hour - 5.5) / 26))^1.2 * (hour >= 6 & hour <= 18) * cloud
  air <- 18 + 6 * sin(2 * pi * (hour - 9) / 24) + 0.004 * (sun - 300) - 3 * wet +
    stationary(n, 0.98, 2)
  wind <- pmax(0.1, 2 + wet + 1.2 * sin(2 * pi * (hour - 10) / 24) + stationary(n, 0.85, 1))
  true <- c(peak = 5, heating = 0.028, gamma = -0.0042, standby = 0.03)
  dust <- 0.02
  cell <- 18
  inside <- matrix(0, parts, n)
  for (t in seq_len(n)) {
    dust <- if (rain[t] > 0.6) 0.3 * dust else min(0.3, dust + 0.03 / 24)
    for (j in seq_len(parts)) {
      cell <- cell + (air[t] + true[["heating"]] * sun[t] - cell) * (1 - exp(-60 / parts / 12))
      inside[j, t] <- true[["peak"]] * sun[t] / 1000 * (1 - dust) *
        (1 + true[["gamma"]] * (cell - 25)) - true[["standby"]]
    }
  }
  table <- data.frame(hour = seq_len(n),
                      power = round(colMeans(inside) + noise_of(n, 0.04, 0.5, 0.4), 3), sun, air,
                      wind, rain)
  yield <- function(values, drivers, info) {
    n <- nrow(drivers)
    cell <- drivers[, "air"] + values[["heating"]] * drivers[, "sun"] * term(info, "warming", 1, n)
    values[["peak"]] * drivers[, "sun"] / 1000 * term(info, "yield", 1, n) *
      (1 + values[["gamma"]] * (cell - 25)) - values[["standby"]]
  }
  base <- function_simulator(
    yield, free("peak", uniform(3, 7), "kW"), free("heating", uniform(0.01, 0.06), "K m2/W"),
    free("gamma", normal(-0.004, 0.001, -0.01, 0), "1/K"), free("standby", uniform(0, 0.2), "kW"),
    boundary = c("sun", "air"), name = "module")
  mechanisms <- catalogue(
    new_mechanism("wind cooling", "wind", "Wind cools the module.",
                  free("cooling", uniform(0, 0.5), "s/m"), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "warming", 1 / (1 + values[["cooling"]] * drivers[, "wind"])))
    }),
    new_mechanism("clipping", "sun", "The inverter limits the power.",
                  free("limit", uniform(2.5, 7), "kW"), function(values, drivers, info, base) {
      power <- base(values, drivers, info)
      power - 0.1 * log1p(exp((power - values[["limit"]]) / 0.1))
    }),
    new_mechanism("ageing", character(), "The module loses power week by week.",
                  free("ageing", uniform(0, 0.1), "1/week"), function(values, drivers, info, base) {
      weeks <- info$step_h * seq_len(nrow(drivers)) / 168
      base(values, drivers, scaled(info, "yield", 1 - values[["ageing"]] * weeks))
    }),
    new_mechanism("morning shade", "sun", "A tree shades the module in the morning.",
                  free("shade", uniform(0, 0.6)), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "yield", 1 - values[["shade"]] * (hour_of_day(info) <= 10)))
    }),
    new_mechanism("low light", "sun", "The module is less efficient in weak light.",
                  free("weak", uniform(-0.1, 0.2)), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "yield", 1 + values[["weak"]] * log(pmax(20, drivers[, "sun"]) / 1000)))
    }),
    drifting_sensor(0.02, "kW/d"))
  measured <- measurements(table, time = "hour", target = "power",
                           boundary = ~ sun + air + wind + rain, noise_sd = 0.04, unit = "kW",
                           name = "module", warmup = 24, calibrate = table$hour <= 408,
                           validate = table$hour > 408)
  list(base = base, measurements = measured, catalogue = mechanisms, hidden = character(),
       true = true)
}
