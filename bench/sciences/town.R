# The electricity that a town uses, by the hour. Nothing is hidden; the noise is autocorrelated, of
# the size stated.
draw_town <- function(seed) {
  set.seed(seed)
  n <- 600
  hour <- (seq_len(n) - 1) %% 24
  workday <- as.numeric(((seq_len(n) - 1) %/% 24) %% 7 < 5)
  outside <- 6 + 3.5 * sin(2 * pi * (hour - 9) / 24) + autoregressive(n, 0.98, 0.7)
  sun <- pmax(0, 420 * sin(2 * pi * (hour - 6.5) / 24)) * rep(stats::runif(25, 0.2, 1), each = 24)
  wind <- exp(1.2 + autoregressive(n, 0.95, 0.15))
  activity <- 0.7 * exp(-(hour - 8)^2 / 8) + exp(-(hour - 19)^2 / 12)
  load <- function(values, drivers) {
    keep <- exp(-1 / values[["lag"]])
    felt <- as.numeric(stats::filter((1 - keep) * drivers[, "outside"], keep, method = "recursive",
                                     init = drivers[1, "outside"]))
    values[["base"]] +
      values[["peak"]] * drivers[, "activity"] * (1 + values[["work"]] * drivers[, "workday"]) +
      values[["heating"]] * log1p(exp(15 - felt))
  }
  true <- c(base = 5.2, peak = 3.1, work = 0.35, heating = 0.28, lag = 9)
  noise <- autoregressive(n, 0.6, 1)
  table <- data.frame(hour = seq_len(n), load = load(true, cbind(outside, activity, workday)) +
                        0.15 * sqrt(0.5) * (noise / stats::sd(noise) + stats::rnorm(n)),
                      outside, activity, workday, sun, wind)
  base <- function_simulator(
    load, free("base", uniform(2, 9), "MW"), free("peak", uniform(0, 8), "MW"),
    free("work", uniform(0, 1)), free("heating", uniform(0, 1), "MW/K"),
    free("lag", uniform(1, 36), "h"), boundary = c("outside", "activity", "workday"), name = "load")
  cold <- function(drivers) pmax(0, 15 - drivers[, "outside"])
  mechanisms <- catalogue(
    new_mechanism("photovoltaics", "sun", "Roofs make a part of the power.",
                  free("roofs", uniform(0, 0.02)), function(values, drivers, info, base) {
      base(values, drivers, info) - values[["roofs"]] * drivers[, "sun"]
    }),
    new_mechanism("wind chill", c("wind", "outside"), "Wind cools the houses.",
                  free("chill", uniform(0, 0.1)), function(values, drivers, info, base) {
      base(values, drivers, info) + values[["chill"]] * drivers[, "wind"] * cold(drivers) / 10
    }),
    new_mechanism("night setback", c("activity", "outside"), "Heating is lowered at night.",
                  free("setback", uniform(0, 0.5)), function(values, drivers, info, base) {
      base(values, drivers, info) -
        values[["setback"]] * values[["heating"]] * cold(drivers) *
          (1 - pmin(1, drivers[, "activity"]))
    }),
    drifting_sensor(0.05, "MW/d"))
  measured <- measurements(table, time = "hour", target = "load",
                           boundary = ~ outside + activity + workday + sun + wind, noise_sd = 0.15,
                           unit = "MW", name = "town", warmup = 24, calibrate = table$hour <= 420,
                           validate = table$hour > 420)
  list(base = base, measurements = measured, catalogue = mechanisms, hidden = character(),
       true = true)
}
