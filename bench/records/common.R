# A room with nothing hidden, and what the loop says of its record.

one_pole <- function(x, hours, step_h) {
  kept <- exp(-step_h / hours)
  as.numeric(stats::filter((1 - kept) * x, kept, method = "recursive", init = x[1]))
}

# Steps of an hour or less; rain, a schedule, a valve that rests at its ends and a heater at full
# power are conditions too, and are no faults.
draw_room <- function(seed) {
  set.seed(seed)
  step_h <- sample(c(1, 1, 0.5, 0.25), 1)
  days <- sample(9:14, 1)
  data <- synthetic_weather(days = days, step_h = step_h, seed = sample.int(1e6, 1),
                            day_of_year = sample(365, 1), temperature = stats::runif(1, 2, 20))
  n <- nrow(data)
  data$Te <- round(data$Te, sample(1:6, 1))
  data$rain <- ifelse(stats::runif(n) < 0.06, round(stats::rexp(n, 0.7), 1), 0)
  data$set <- ifelse(data$hour %% 24 > 7 & data$hour %% 24 <= 22, 21, 17)
  need <- stats::runif(1, 0.5, 1.5) * (data$set - data$Te) / 12 + stats::rnorm(n, sd = 0.03)
  data$valve <- 100 * pmin(1, pmax(0, need))
  data$P <- 1000 * pmin(1, pmax(0, need))
  memory <- sample(c(0, 3, 8), 1)
  noise <- stats::runif(1, 0.05, 0.2)
  true <- c(o = stats::runif(1, 16, 20), g = stats::runif(1, 0.3, 0.7),
            s = stats::runif(1, 0.003, 0.008), h = stats::runif(1, 1, 4))
  ar <- sample(c(0, 0, 0.5), 1)
  error <- noise * sqrt(1 - ar^2) * as.numeric(stats::filter(stats::rnorm(n), ar, "recursive"))
  world <- list(data = data, step_h = step_h, memory = memory, noise = noise, true = true,
                warmup = 5 * memory,
                conditions = c("Te", "Gv", "P", "Ws", "circular(Wd)", "Lw", "rain", "set", "valve"))
  world$clean <- simulate_room(true, data, memory, step_h)
  world$error <- error
  world$data$Ti <- world$clean + error
  world
}

simulate_room <- function(values, drivers, memory, step_h) {
  driven <- values[["g"]] * drivers[, "Te"] + values[["s"]] * drivers[, "Gv"] +
    values[["h"]] * drivers[, "P"] / 1000
  values[["o"]] + if (memory > 0) one_pole(driven, memory, step_h) else driven
}

room_model <- function(world) {
  memory <- world$memory
  step_h <- world$step_h
  function_simulator(function(values, drivers) simulate_room(values, drivers, memory, step_h),
                     free("o", uniform(14, 22)), free("g", uniform(0, 1)),
                     free("s", uniform(0, 0.02)), free("h", uniform(0, 8)),
                     boundary = c("Te", "Gv", "P"))
}

added <- function(name, boundary, parameter, f) {
  mechanism(name, boundary = boundary, sentence = paste(name, "acts."), edit = function(model) {
    do.call(with_parameters, c(list(model), parameter, list(boundary = boundary, f = f)))
  })
}

room_catalogue <- function(step_h) {
  slow <- c("Te", "Gv", "P")
  catalogue(
    added("wind", "Ws", list(free("w", normal(0, 0.2))), function(values, drivers, base) {
      base(values) + values[["w"]] * drivers[, "Ws"]
    }),
    added("mass", slow, list(free("tau", uniform(0.25, 10))), function(values, drivers, base) {
      for (name in slow) drivers[, name] <- one_pole(drivers[, name], values[["tau"]], step_h)
      base(values, drivers = drivers)
    }),
    added("sky", "Lw", list(free("sky", normal(0, 0.02))), function(values, drivers, base) {
      base(values) + values[["sky"]] * drivers[, "Lw"]
    }),
    added("windows", "Te", list(free("open", uniform(0, 1.5)), free("above", uniform(15, 35))),
          function(values, drivers, base) {
      y <- base(values)
      y - values[["open"]] * pmax(0, y - values[["above"]])
    }),
    added("drift", character(), list(free("dr", normal(0, 0.1))), function(values, drivers, base) {
      base(values) + values[["dr"]] * seq_len(nrow(drivers)) * step_h / 24
    }))
}

judge_room <- function(world) {
  data <- world$data
  m <- measurements(data, time = "hour", target = "Ti", boundary = world$conditions,
                    noise_sd = world$noise, warmup = world$warmup,
                    validate = data$hour > 0.75 * max(data$hour))
  quick <- list(max_steps = 1, calibration = list(ais = list(precision = 0.3)),
                attribution = list(surrogates = 19))
  upgrade <- upgrade_model(room_model(world), m, room_catalogue(world$step_h), control = quick,
                           seed = 1, quiet = TRUE)
  told <- summary(upgrade)
  list(verdict = told$verdict, faults = names(told$record), says = unname(told$record))
}
