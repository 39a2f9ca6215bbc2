# The level of a water tank, by the hour. Hidden: a leak that grows with the root of the level, and
# a little rain that enters. The truth takes steps of a minute, the tank widens upwards, the sensor
# rounds to a millimetre.
draw_reservoir <- function(seed) {
  set.seed(seed)
  n <- 520
  minutes <- 60
  hour <- (seq_len(n) - 1) %% 24
  weekend <- ((seq_len(n) - 1) %/% 24) %% 7 >= 5
  demand <-
    (14 + 9 * exp(-(hour - 7.5)^2 / 6) + 11 * exp(-(hour - 19)^2 / 8) -
     6 * exp(-(hour - 3)^2 / 8)) * ifelse(weekend, 0.85, 1) * exp(autoregressive(n, 0.6, 0.08))
  air <- 15 + 6 * sin(2 * pi * (hour - 9) / 24) + autoregressive(n, 0.97, 0.6)
  rain <- pmax(0, autoregressive(n, 0.8, 1) - 2.2)
  true <- c(leak = 1.6, roof = 0.05, pump_gain = 0.97, demand_gain = 1, area = 50)
  height <- 2.6
  on <- TRUE
  pump <- numeric(n)
  level <- matrix(0, minutes, n)
  for (t in seq_len(n)) {
    on <- height < 2.1 || (on && height <= 3.6)
    pump[t] <- if (on) 34 + stats::rnorm(1, 0, 0.6) else 0
    for (j in seq_len(minutes)) {
      area <- true[["area"]] * (1 + 0.01 * (height - 2.5))
      flow <- true[["pump_gain"]] * pump[t] - demand[t] - true[["leak"]] * sqrt(height) +
        true[["roof"]] * rain[t]
      height <- height + flow / area / minutes
      level[j, t] <- height
    }
  }
  table <- data.frame(hour = seq_len(n),
                      level = round(colMeans(level) + stats::rnorm(n, sd = 0.012), 3), pump, demand,
                      air, rain)
  balance <- function(values, drivers, info) {
    flow <- values[["pump_gain"]] * drivers[, "pump"] -
      values[["demand_gain"]] * drivers[, "demand"] + term(info, "inflow", 0, nrow(drivers))
    leak <- term(info, "leak", 0, 1)
    height <- values[["start"]]
    level <- numeric(length(flow))
    for (i in seq_along(flow)) {
      after <- height + info$step_h * (flow[i] - leak * sqrt(max(height, 0))) / values[["area"]]
      level[i] <- (height + after) / 2
      height <- after
    }
    level
  }
  base <- function_simulator(
    balance, free("pump_gain", uniform(0.85, 1.1)), free("demand_gain", uniform(0.9, 1.15)),
    free("area", uniform(35, 70), "m2"), free("start", uniform(2, 3.2), "m"),
    boundary = c("pump", "demand"), name = "tank balance")
  mechanisms <- catalogue(
    new_mechanism("leak", character(), "The tank leaks at its foot.",
                  free("leak", uniform(0, 5), "m3/h/m0.5"),
                  function(values, drivers, info, base)
                    base(values, drivers, added(info, "leak", values[["leak"]]))),
    new_mechanism("evaporation", "air", "Water evaporates.",
                  free("evaporation", uniform(0, 0.3), "m3/h/K"),
                  function(values, drivers, info, base) {
      base(values, drivers,
           added(info, "inflow", -values[["evaporation"]] * pmax(0, drivers[, "air"])))
    }),
    new_mechanism("rain inflow", "rain", "Rain enters the tank.",
                  free("roof", uniform(0, 1), "m3/mm"),
                  function(values, drivers, info, base) {
      base(values, drivers, added(info, "inflow", values[["roof"]] * drivers[, "rain"]))
    }),
    new_mechanism("unmetered user", character(), "Someone draws water that no meter counts.",
                  free("draw", uniform(0, 6), "m3/h"),
                  function(values, drivers, info, base) {
      base(values, drivers, added(info, "inflow", -values[["draw"]]))
    }),
    drifting_sensor(0.02, "m/d"))
  measured <- measurements(table, time = "hour", target = "level",
                           boundary = ~ pump + demand + air + rain, noise_sd = 0.012, unit = "m",
                           name = "reservoir", warmup = 6, calibrate = table$hour <= 360,
                           validate = table$hour > 360)
  list(base = base, measurements = measured, catalogue = mechanisms,
       hidden = c("leak", "rain inflow"), true = true)
}
