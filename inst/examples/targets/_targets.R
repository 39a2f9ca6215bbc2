# A pipeline of the package targets: each stage is kept, and made again only when something that it depends on changed.
# Usage: copy this folder, then targets::tar_make() in it; library(amiss); targets::tar_read(cause)
# shows a result.
# `runs`, `quick` and `surrogates` are small, for speed: for real work leave all three out.
library(targets)
tar_option_set(packages = "amiss")

quick <- list(ais = list(pilot_chains = 48, groups = 4))

linear_model <- function() {
  function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"], free("gain", uniform(0, 1)),
                     boundary = "Te")
}

list(
  tar_target(file, "record.csv", format = "file"),
  tar_target(room, measurements(read.csv(file), time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1)),
  tar_target(runs, simulate_design(linear_model(), room, runs = 30, seed = 1)),
  tar_target(emulator, train_emulator(runs, room)),
  tar_target(fit, calibrate(emulator, room, quick, seed = 1)),
  tar_target(cause, attribute_discrepancy(fit, list(surrogates = 19), seed = 1)),
  tar_target(parameters, tidy(fit))
)
