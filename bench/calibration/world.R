# The world of the calibration checks: a short record, two boundary conditions, a simulator of two
# parameters whose emulator is uncertain (eight runs), so that every term of the posteriors counts.

sbc_steps <- 48
sbc_ais <- list(pilot_chains = 96, groups = 4, chains = 32, importance_draws = 800)

sbc_world <- function() {
  hour <- seq_len(sbc_steps)
  Te <- 10 + 5 * sin(2 * pi * hour / 24) + 2 * sin(hour^2 / 7)
  Gv <- pmax(0, 3 * sin(2 * pi * (hour - 6) / 24) * (1 + 0.4 * cos(hour^2 / 3)))
  filtered <- function(x, hours)
    as.numeric(stats::filter(x * (1 - exp(-1 / hours)), exp(-1 / hours), method = "recursive",
                             init = x[1]))
  simulator <- amiss::function_simulator(
    function(values, drivers) 15 + values[["gain"]] * filtered(drivers[, "Te"], values[["lag"]]),
    amiss::free("gain", amiss::uniform(0.2, 0.8)), amiss::free("lag", amiss::uniform(1, 8), "h"),
    boundary = "Te")
  record <- amiss::measurements(data.frame(hour, Te, Gv, Ti = 20 + sin(hour)), time = "hour",
                                target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.3, unit = "K",
                                name = "calibration check")
  runs <- amiss::simulate_design(simulator, record, runs = 8, seed = 1)
  emulator <- amiss::train_emulator(runs, record)
  list(measurements = record, emulator = emulator, spread = simulator_spread(emulator))
}

observed <- function(measurements, y) {
  measurements$y[measurements$use == "calibrate"] <- y
  measurements
}

# Emulator's mean and variance of the coefficients at one point of the unit cube.
coefficients_at <- function(emulator, unit) {
  w <- amiss:::emulated_coefficients(emulator, matrix(unit, 1))
  list(mean = w$mean[1, ], variance = w$variance[1, ])
}
