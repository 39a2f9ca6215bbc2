# The voltage of a battery cell under a changing current. Hidden: hysteresis, and a resistance that
# grows in the cold. The truth takes steps of six minutes, the model of half an hour.
draw_cell <- function(seed) {
  set.seed(seed)
  n <- 2900
  step <- 0.1
  time <- seq_len(n) * step
  wanted <- 4 * rep(sample(c(-1, -0.5, 0, 0, 0.6, 1), ceiling(n / 15), TRUE), each = 15)[seq_len(n)]
  air <- 12 + 7 * sin(2 * pi * (time - 9) / 24) + autoregressive(n, 0.995, 0.25)
  open_voltage <- function(charge)
    3.2 + 0.55 * charge + 0.04 * log((charge + 0.02) / (1.02 - charge))
  true <- c(cold = 0.035, hysteresis = 0.018, capacity = 20, r0 = 0.022, r1 = 0.012)
  charge <- 0.5
  lag <- polarised <- 0
  current <- voltage <- numeric(n)
  for (i in seq_len(n)) {
    now <- wanted[i]
    if (charge > 0.9 && now > 0) now <- -2
    if (charge < 0.12 && now < 0) now <- 2.5
    charge <- min(0.99, max(0.01, charge + now * step / true[["capacity"]]))
    keep <- exp(-25 * abs(now) * step / true[["capacity"]])
    lag <- keep * lag + (1 - keep) * sign(now) * true[["hysteresis"]]
    polarised <- polarised * exp(-step / 0.4) + (1 - exp(-step / 0.4)) * now * true[["r1"]]
    voltage[i] <- open_voltage(charge) + now * true[["r0"]] * exp(true[["cold"]] * (20 - air[i])) +
      polarised + lag
    current[i] <- now
  }
  table <- data.frame(time = as.POSIXct("2024-02-01", tz = "UTC") + 3600 * time,
                      voltage = voltage + stats::rnorm(n, sd = 0.006), current, air)
  circuit <- function(values, drivers, info) {
    current <- drivers[, "current"]
    charge <- values[["start"]] + cumsum(current) * info$step_h / values[["capacity"]]
    keep <- exp(-info$step_h / 0.4)
    polarised <- as.numeric(stats::filter((1 - keep) * current * values[["r1"]], keep,
                                          method = "recursive"))
    open_voltage(pmin(0.99, pmax(0.01, charge))) + polarised +
      current * values[["r0"]] * term(info, "resistance", 1, nrow(drivers))
  }
  base <- function_simulator(
    circuit, free("start", uniform(0.3, 0.7)), free("capacity", uniform(15, 27), "Ah"),
    free("r0", uniform(0.005, 0.06), "Ohm"), free("r1", uniform(0, 0.05), "Ohm"),
    boundary = "current", name = "equivalent circuit")
  mechanisms <- catalogue(
    new_mechanism("cold resistance", c("air", "current"),
                  "The cell's resistance grows in the cold.", free("cold", uniform(0, 0.08), "1/K"),
                  function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "resistance", exp(values[["cold"]] * (20 - drivers[, "air"]))))
    }),
    new_mechanism("hysteresis", "current", "The voltage remembers the way the cell was charged.",
                  free("hysteresis", uniform(0, 0.06), "V"), function(values, drivers, info, base) {
      keep <- exp(-25 * abs(drivers[, "current"]) * info$step_h / 20)
      toward <- (1 - keep) * sign(drivers[, "current"]) * values[["hysteresis"]]
      base(values, drivers, info) + Reduce(function(lag, i) keep[i] * lag + toward[i],
                                           seq_along(keep), 0, accumulate = TRUE)[-1]
    }),
    new_mechanism("entropic voltage", "air", "The open voltage depends on temperature.",
                  free("entropic", normal(0, 0.001), "V/K"), function(values, drivers, info, base) {
      base(values, drivers, info) + values[["entropic"]] * (drivers[, "air"] - 20)
    }),
    new_mechanism("current offset", "current", "The current's sensor has an offset.",
                  free("offset", normal(0, 0.1), "A"), function(values, drivers, info, base) {
      drivers[, "current"] <- drivers[, "current"] + values[["offset"]]
      base(values, drivers, info)
    }),
    drifting_sensor(0.002, "V/d"))
  measured <- measurements(table, time = "time", target = "voltage", boundary = ~ current + air,
                           noise_sd = 0.0035, average = 0.5, unit = "V", name = "cell", warmup = 2,
                           calibrate = time <= 200, validate = time > 200)
  list(base = base, measurements = measured, catalogue = mechanisms,
       hidden = c("cold resistance", "hysteresis"), true = true)
}
