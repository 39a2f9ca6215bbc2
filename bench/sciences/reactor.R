# The temperature of a stirred reactor with a feed and a cooled jacket, every three minutes. Hidden:
# the jacket fouls; the model lacks besides a corner that mixes badly, a jacket that lags and a
# coolant that warms a little. The truth takes steps of six seconds, the model of a minute, and the
# thermometer rounds to a hundredth.
draw_reactor <- function(seed) {
  set.seed(seed)
  step <- 0.05
  n <- 420
  parts <- 30
  time <- seq_len(n) * step
  held <- function(levels, mean_length) {
    count <- ceiling(4 * n / mean_length)
    rep(sample(levels, count, TRUE), stats::rpois(count, mean_length) + 4)[seq_len(n)]
  }
  flow <- held(c(0.8, 1, 1.2, 1.4), 25)
  feed <- 22 + 5 * sin(2 * pi * time / 9) + stationary(n, 0.97, 1)
  coolant <- 28 - 0.5 * (feed - 22) - 5 * (flow - 1) + held(c(-4, 0, 4), 30)
  ambient <- 20 + 0.6 * (feed - 22) + stationary(n, 0.98, 1.5)
  true <- c(k = 1.1, energy = 6500, rise = 85, ua = 2.2, foul = 0.022)
  dt <- step / parts
  reactor <- corner <- 45
  jacket <- 30
  content <- 0.4
  inside <- matrix(0, parts, n)
  for (i in seq_len(n)) {
    for (j in seq_len(parts)) {
      rate <- true[["k"]] * exp(true[["energy"]] * (1 / 323.15 - 1 / (reactor + 273.15)))
      cooling <- true[["ua"]] * exp(-true[["foul"]] * (i - 1 + j / parts) * step)
      warming <- flow[i] * (feed[i] - reactor) + true[["rise"]] * rate * content +
        cooling * (jacket - reactor) + 1.5 * 0.05 * (corner - reactor)
      corner <- corner + dt * 1.5 * (reactor - corner)
      jacket <- jacket + dt * 60 * (coolant[i] + 0.01 * (reactor - coolant[i]) - jacket)
      content <- content + dt * (flow[i] * (1 - content) - rate * content)
      reactor <- reactor + dt * warming
      inside[j, i] <- reactor
    }
  }
  table <- data.frame(hour = time, temperature = round(colMeans(inside) + noise_of(n, 0.2, 0.5), 2),
                      flow, feed, coolant, ambient)
  stirred <- function(values, drivers, info) {
    n <- nrow(drivers)
    parts <- 3
    dt <- info$step_h / parts
    flow <- drivers[, "flow"]
    feed <- drivers[, "feed"]
    coolant <- drivers[, "coolant"]
    cooling <- values[["ua"]] * term(info, "cooling", 1, n)
    activity <- values[["k"]] * term(info, "activity", 1, n)
    loss <- term(info, "loss", 0, n)
    outside <- term(info, "outside", 0, n)
    reactor <- start_of(info, 45)
    content <- 0.4
    mean <- numeric(n)
    for (i in seq_len(n)) {
      sum <- 0
      for (j in seq_len(parts)) {
        rate <- activity[i] * exp(values[["energy"]] * (1 / 323.15 - 1 / (reactor + 273.15)))
        warming <- flow[i] * (feed[i] - reactor) + values[["rise"]] * rate * content +
          cooling[i] * (coolant[i] - reactor) + loss[i] * (outside[i] - reactor)
        content <- content + dt * (flow[i] * (1 - content) - rate * content)
        reactor <- min(200, max(-20, reactor + dt * warming))
        sum <- sum + reactor
      }
      mean[i] <- sum / parts
    }
    mean
  }
  base <- function_simulator(stirred, free("k", uniform(0.3, 3), "1/h"),
                             free("energy", normal(6500, 1500, 2000, 11000), "K"),
                             free("rise", uniform(40, 180), "K"),
                             free("ua", uniform(0.5, 5), "1/h"),
                             boundary = c("flow", "feed", "coolant"), name = "stirred reactor")
  elapsed <- function(drivers, info) info$step_h * seq_len(nrow(drivers))
  mechanisms <- catalogue(
    new_mechanism("fouling", "coolant", "The cooling jacket fouls and takes less heat away.",
                  free("foul", uniform(0, 0.08), "1/h"), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "cooling", exp(-values[["foul"]] * elapsed(drivers, info))))
    }),
    new_mechanism("catalyst decay", character(), "The catalyst loses activity.",
                  free("decay", uniform(-0.05, 0.05), "1/h"),
                  function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "activity", exp(-values[["decay"]] * elapsed(drivers, info))))
    }),
    new_mechanism("loss to the hall", "ambient", "The vessel loses heat to the hall.",
                  free("hall", uniform(0, 1), "1/h"), function(values, drivers, info, base) {
      base(values, drivers,
           added(added(info, "loss", values[["hall"]]), "outside", drivers[, "ambient"]))
    }),
    new_mechanism("feed thermometer", "feed", "The feed's thermometer has an offset.",
                  free("feed_offset", normal(0, 3), "K"), function(values, drivers, info, base) {
      drivers[, "feed"] <- drivers[, "feed"] + values[["feed_offset"]]
      base(values, drivers, info)
    }),
    new_mechanism("flow meter", "flow", "The flow meter's reading is not in proportion.",
                  free("meter", uniform(0.5, 1.5)), function(values, drivers, info, base) {
      drivers[, "flow"] <- drivers[, "flow"]^values[["meter"]]
      base(values, drivers, info)
    }),
    drifting_sensor(1, "K/10 h", 10))
  measured <- measurements(table, time = "hour", target = "temperature",
                           boundary = ~ flow + feed + coolant + ambient, noise_sd = 0.2, unit = "K",
                           name = "reactor", warmup = 1.5, calibrate = time <= 14.5,
                           validate = time > 14.5)
  list(base = base, measurements = measured, catalogue = mechanisms, hidden = "fouling",
       true = true)
}
