# The concentration of a drug under doses and infusion, by the half hour. Hidden: tissue that takes
# up the drug and gives it back, a mechanism of two parameters and no boundary condition; the model
# lacks besides a short transit before absorption and a bit of bile that returns. The truth takes
# steps of a minute, the model of ten.
draw_drug <- function(seed) {
  set.seed(seed)
  step <- 0.5
  n <- 384
  parts <- 30
  time <- seq_len(n) * step
  hour <- (time - step) %% 24
  dose <- numeric(n)
  for (day in 0:7) {
    for (planned in c(8, 20)) {
      if (stats::runif(1) < 0.9) {
        at <- round((24 * day + planned + stats::rnorm(1, 0, 0.7)) / step)
        dose[at] <- sample(c(50, 100, 150), 1)
      }
    }
  }
  infusion <- rep(sample(c(0, 0, 4, 8), 32, TRUE), each = 12)[seq_len(n)]
  infused <- as.numeric(stats::filter(0.05 * infusion, 0.95, method = "recursive"))
  renal <- 90 + 10 * sin(2 * pi * (hour - 9) / 24) - 2 * infused + stationary(n, 0.98, 12)
  taken <- rep(as.numeric(stats::runif(16) < 0.4), each = 24)
  helper <- as.numeric(stats::filter(taken * 0.1, 0.9, method = "recursive"))[seq_len(n)]
  true <- c(cl = 5, volume = 30, ka = 0.9, share = 0.7, k12 = 0.15, k21 = 0.1)
  transit <- gut <- blood <- tissue <- bile <- 0
  dt <- step / parts
  inside <- matrix(0, parts, n)
  for (i in seq_len(n)) {
    for (j in seq_len(parts)) {
      transit <- transit + dose[i] / parts - dt * transit / 0.05
      gut <- gut + dt * (transit / 0.05 + 0.03 * bile - true[["ka"]] * gut)
      bile <- bile + dt * (0.005 * blood - 0.03 * bile)
      change <- true[["share"]] * true[["ka"]] * gut + infusion[i] -
        true[["cl"]] / true[["volume"]] * blood - true[["k12"]] * blood + true[["k21"]] * tissue -
        0.005 * blood
      blood <- blood + dt * change
      tissue <- tissue + dt * (true[["k12"]] * blood - true[["k21"]] * tissue)
      inside[j, i] <- blood / true[["volume"]]
    }
  }
  table <- data.frame(hour = time, concentration = colMeans(inside) + noise_of(n, 0.06, 0.6), dose,
                      infusion, renal, helper)
  compartment <- function(values, drivers, info) {
    n <- nrow(drivers)
    parts <- 3
    dt <- info$step_h / parts
    clearance <- values[["cl"]] * term(info, "clearance", 1, n)
    half <- term(info, "half", Inf, 1)
    k12 <- term(info, "k12", 0, 1)
    k21 <- term(info, "k21", 0, 1)
    dose <- drivers[, "dose"] / parts
    infusion <- drivers[, "infusion"]
    gut <- blood <- tissue <- 0
    mean <- numeric(n)
    for (i in seq_len(n)) {
      sum <- 0
      for (j in seq_len(parts)) {
        gut <- gut + dose[i] - dt * values[["ka"]] * gut
        concentration <- blood / values[["volume"]]
        change <- values[["share"]] * values[["ka"]] * gut + infusion[i] -
          clearance[i] * concentration / (1 + concentration / half) - k12 * blood + k21 * tissue
        blood <- blood + dt * change
        tissue <- tissue + dt * (k12 * blood - k21 * tissue)
        sum <- sum + blood / values[["volume"]]
      }
      mean[i] <- sum / parts
    }
    mean
  }
  base <- function_simulator(compartment, free("cl", uniform(1, 15), "L/h"),
                             free("volume", lognormal(log(30), 0.5), "L"),
                             free("ka", uniform(0.2, 2), "1/h"), free("share", beta_prior(4, 2)),
                             boundary = c("dose", "infusion"), name = "one compartment")
  mechanisms <- catalogue(
    mechanism("tissue", boundary = character(),
              sentence = "Tissue takes up the drug and gives it back.", edit = function(model) {
      with_parameters(model, free("k12", uniform(0, 0.6), "1/h"),
                      free("k21", uniform(0.02, 0.5), "1/h"),
                      f = function(values, drivers, info, base) {
        base(values, drivers, added(added(info, "k12", values[["k12"]]), "k21", values[["k21"]]))
      })
    }),
    new_mechanism("saturable clearance", character(), "The liver's capacity is limited.",
                  free("inverse_half", uniform(0.001, 1), "L/mg"),
                  function(values, drivers, info, base) {
      info$half <- 1 / values[["inverse_half"]]
      base(values, drivers, info)
    }),
    new_mechanism("renal clearance", "renal", "The kidneys' state moves the clearance.",
                  free("renal_part", uniform(0, 2)), function(values, drivers, info, base) {
      state <- 1 + values[["renal_part"]] * (drivers[, "renal"] - 90) / 90
      base(values, drivers, scaled(info, "clearance", pmax(0.05, state)))
    }),
    new_mechanism("inhibitor", "helper", "A second drug slows the clearance.",
                  free("inhibited", uniform(0, 0.8)), function(values, drivers, info, base) {
      base(values, drivers,
           scaled(info, "clearance", 1 - values[["inhibited"]] * drivers[, "helper"]))
    }),
    new_mechanism("induction", character(), "The liver learns to clear the drug faster.",
                  free("induced", uniform(0, 1)), function(values, drivers, info, base) {
      learnt <- 1 - exp(-info$step_h * seq_len(nrow(drivers)) / 60)
      base(values, drivers, scaled(info, "clearance", 1 + values[["induced"]] * learnt))
    }),
    drifting_sensor(0.05, "mg/L/d"))
  measured <- measurements(
    table, time = "hour", target = "concentration", boundary = ~ dose + infusion + renal + helper,
    noise_sd = 0.06, unit = "mg/L",
    name = "drug", warmup = 0, calibrate = time <= 130, validate = time > 130)
  list(base = base, measurements = measured, catalogue = mechanisms, hidden = "tissue", true = true)
}
