# An R session: data, model, calibration, cause, report. Runs in seconds: `quick` is for speed. For real work leave it
# out. Usage: Rscript session.R [FILE.html], or line by line.
library(amiss)

# 1. What was measured: ten days, hourly. Here they are made; read your own table instead.
set.seed(1)
hours <- 1:240
record <- data.frame(hour = hours, Te = 5 + 4 * sin(2 * pi * (hours - 9) / 24) + rnorm(240, sd = 0.5))
record$Gv <- 500 * pmax(0, sin(2 * pi * (hours - 6) / 24)) * rep(runif(10, 0.1, 1), each = 24)
record$Ti <- 15 + 0.8 * record$Te + 0.006 * record$Gv + rnorm(240, sd = 0.1)
room <- measurements(record, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1, unit = "K",
                     calibrate = record$hour <= 168, validate = record$hour > 168)

# 2. A model that knows no sun.
model <- function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
                            free("offset", uniform(10, 20), "K"), free("gain", uniform(0, 2)), boundary = "Te")

# 3. Calibrate it, and see what its error responds to. Six runs are enough to begin: the calibration makes more.
quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)), attribution = list(surrogates = 39))
fit <- calibrate_refined(simulate_design(model, room, runs = 6, seed = 1), room, seed = 1,
                         control = quick["calibration"])
print(fit)
print(attribute_discrepancy(fit, quick$attribution, seed = 1))

# 4. Say what could be missing, and let the evidence choose.
sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters that the model leaves out.", edit = function(model) {
  with_parameters(model, free("sun", uniform(0, 0.02), "K m2/W"), boundary = "Gv",
                  f = function(values, drivers, base) base(values) + values[["sun"]] * drivers[, "Gv"])
})
drift <- mechanism("drift", boundary = character(), sentence = "The sensor drifts.", edit = function(model) {
  with_parameters(model, free("drift", normal(0, 0.1), "K/d"), f = function(values, drivers, info, base) {
    base(values) + values[["drift"]] * info$step_h * seq_len(nrow(drivers)) / 24
  })
})
upgrade <- upgrade_model(model, room, catalogue(sun, drift), control = quick, seed = 1, quiet = TRUE)
print(summary(upgrade))
print(tidy(upgrade))

# 5. Write it down.
file <- commandArgs(trailingOnly = TRUE)
if (length(file)) report(upgrade, file[1])
