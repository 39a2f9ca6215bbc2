# Glucose in the blood under meals, insulin and sport, by the quarter of an hour. Hidden: the uptake
# by sport, and the release at dawn; the model lacks besides a third small compartment of the gut
# and the lag of the uptake by sport. The truth takes steps of a minute, the model of five.
draw_glucose <- function(seed) {
  set.seed(seed)
  step <- 0.25
  n <- 96 * 6
  parts <- 15
  time <- seq_len(n) * step
  hour <- (time - step) %% 24
  carbs <- insulin <- activity <- numeric(n)
  meals <- list(c(7.5, 50), c(12.5, 70), c(15.8, 20), c(19, 75))
  for (day in 0:5) {
    for (meal in meals) {
      at <- round((day * 24 + meal[1] + stats::rnorm(1, 0, 0.6)) / step)
      eaten <- meal[2] * exp(stats::rnorm(1, 0, 0.25))
      carbs[at + 0:1] <- carbs[at + 0:1] + eaten / 2
      if (stats::runif(1) < 0.92) {
        injected <- at + sample(-2:1, 1)
        insulin[injected] <- insulin[injected] + eaten / 10 * exp(stats::rnorm(1, 0, 0.15))
      }
    }
    at <- round((day * 24 + stats::runif(1, 14, 18.5)) / step)
    long <- sample(3:7, 1)
    activity[at + seq_len(long)] <- stats::runif(1, 3, 7)
    at <- round((day * 24 + stats::runif(1, 8.5, 11)) / step)
    if (stats::runif(1) < 0.6) activity[at + 0:2] <- stats::runif(1, 2, 4)
  }
  asleep <- as.numeric(hour >= 23 | hour < 6.75)
  activity <- activity + ifelse(asleep > 0, 0, pmax(0, 0.5 + stationary(n, 0.7, 0.3)))
  true <- c(p1 = 0.45, basal = 7.2, gain = 0.22, tau_gut = 0.6, si = 1.15, sport = 0.055,
            dawn = 1.3)
  glucose <- 7.2
  stomach <- gut <- last <- depot <- plasma <- muscle <- 0
  dt <- step / parts
  inside <- matrix(0, parts, n)
  for (i in seq_len(n)) {
    for (j in seq_len(parts)) {
      stomach <- stomach + carbs[i] / parts - dt * stomach / true[["tau_gut"]]
      gut <- gut + dt * (stomach - gut) / true[["tau_gut"]]
      last <- last + dt * (gut - last) / 0.03
      depot <- depot + insulin[i] / parts - dt * depot / 0.9
      plasma <- plasma + dt * (depot - plasma) / 0.9
      muscle <- muscle + dt * (activity[i] - muscle) / 0.08
      clock <- (time[i] - step + j * dt) %% 24
      change <- true[["gain"]] * last / true[["tau_gut"]] -
        true[["p1"]] * (glucose - true[["basal"]]) - true[["si"]] * plasma / 0.9 * glucose / 8 -
        true[["sport"]] * muscle * glucose + true[["dawn"]] * exp(-((clock - 6) / 2)^2)
      glucose <- max(2, glucose + dt * change)
      inside[j, i] <- glucose
    }
  }
  table <- data.frame(hour = time, glucose = colMeans(inside) + noise_of(n, 0.28, 0.7), carbs,
                      insulin, activity, asleep)
  minimal <- function(values, drivers, info) {
    n <- nrow(drivers)
    parts <- 3
    dt <- info$step_h / parts
    uptake <- term(info, "uptake", 0, n)
    release <- term(info, "release", 0, n)
    carbs <- drivers[, "carbs"] / parts
    insulin <- drivers[, "insulin"] / parts
    glucose <- start_of(info, 7)
    stomach <- gut <- depot <- plasma <- 0
    mean <- numeric(n)
    for (i in seq_len(n)) {
      sum <- 0
      for (j in seq_len(parts)) {
        stomach <- stomach + carbs[i] - dt * stomach / values[["tau_gut"]]
        gut <- gut + dt * (stomach - gut) / values[["tau_gut"]]
        depot <- depot + insulin[i] - dt * depot / 0.9
        plasma <- plasma + dt * (depot - plasma) / 0.9
        change <- values[["gain"]] * gut / values[["tau_gut"]] -
          values[["p1"]] * (glucose - values[["basal"]]) -
          values[["si"]] * plasma / 0.9 * glucose / 8 - uptake[i] * glucose + release[i]
        glucose <- max(1, glucose + dt * change)
        sum <- sum + glucose
      }
      mean[i] <- sum / parts
    }
    mean
  }
  base <- function_simulator(
    minimal, free("p1", uniform(0.1, 1.5), "1/h"), free("basal", uniform(3, 12), "mmol/L"),
    free("gain", uniform(0.05, 0.5), "mmol/L/g"), free("tau_gut", uniform(0.2, 1.5), "h"),
    free("si", uniform(0, 3), "mmol/L/U"), boundary = c("carbs", "insulin"), name = "minimal model")
  mechanisms <- catalogue(
    new_mechanism("sport", "activity", "Muscles take up glucose during sport.",
                  free("sport", uniform(0, 0.3), "1/h/MET"), function(values, drivers, info, base) {
      base(values, drivers, added(info, "uptake", values[["sport"]] * drivers[, "activity"]))
    }),
    new_mechanism("dawn effect", character(), "The liver releases glucose before waking.",
                  free("dawn", uniform(0, 4), "mmol/L/h"), function(values, drivers, info, base) {
      early <- exp(-((hour_of_day(info) - 0.125 - 6) / 2)^2)
      base(values, drivers, added(info, "release", values[["dawn"]] * early))
    }),
    new_mechanism("sleep", "asleep", "Less glucose is released in sleep.",
                  free("sleep", uniform(-1.5, 1.5), "mmol/L/h"),
                  function(values, drivers, info, base) {
      base(values, drivers, added(info, "release", -values[["sleep"]] * drivers[, "asleep"]))
    }),
    new_mechanism("sensor lag", character(), "The sensor under the skin lags behind the blood.",
                  free("lag", uniform(0.01, 1), "h"), function(values, drivers, info, base) {
      blood <- base(values, drivers, info)
      keep <- exp(-info$step_h / values[["lag"]])
      as.numeric(stats::filter((1 - keep) * blood, keep, method = "recursive", init = blood[1]))
    }),
    new_mechanism("slow fat", "carbs", "A part of the meals is absorbed slowly.",
                  free("fat", uniform(0, 0.6)), function(values, drivers, info, base) {
      keep <- exp(-info$step_h / 3)
      late <- as.numeric(stats::filter((1 - keep) * drivers[, "carbs"], keep, method = "recursive"))
      drivers[, "carbs"] <- (1 - values[["fat"]]) * drivers[, "carbs"] + values[["fat"]] * late
      base(values, drivers, info)
    }),
    drifting_sensor(0.2, "mmol/L/d"))
  measured <- measurements(table, time = "hour", target = "glucose",
                           boundary = ~ carbs + insulin + activity + asleep, noise_sd = 0.28,
                           unit = "mmol/L", name = "glucose", warmup = 4, calibrate = time <= 96,
                           validate = time > 96)
  list(base = base, measurements = measured, catalogue = mechanisms,
       hidden = c("sport", "dawn effect"), true = true)
}
