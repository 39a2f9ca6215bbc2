# One small step of each kind that goes through the compiled code, for tools/valgrind: a run of the
# zone simulator and one that is refused, basis, emulator, prediction, calibration and attribution.
# What they find is not judged.
library(amiss)

weather <- synthetic_weather(days = 1, seed = 4)
weather$RHP <- 50
values <- t(c(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 160,
              heater_radiant = 0.79))
drivers <- as.matrix(weather[-1])
air <- simulate_zone(paper_box("M2"), values, drivers, step_s = 900)
stopifnot(is.finite(air))
heat_loss_coefficient(paper_box("M2"), values)

hour <- seq_len(48)
record <- data.frame(hour, Te = 8 + 5 * sin(2 * pi * hour / 24),
                     Gv = pmax(0, sin(2 * pi * (hour - 6) / 24)))
heated <- function(values, drivers)
  20 + values[["a"]] * 0.1 * drivers[, "Te"] + values[["b"]] * drivers[, "Gv"]
record$Ti <- heated(c(a = 0.6, b = 0.8), as.matrix(record)) + 0.05 * sqrt(2) * sin(12.9898 * hour^2)
model <- function_simulator(heated, free("a", uniform(0, 1)), free("b", uniform(0, 2)),
                            boundary = c("Te", "Gv"))
set <- measurements(record, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.05,
                    unit = "K")
emulator <- train_emulator(simulate_design(model, set, 12, seed = 1), set)
predict(emulator, cbind(a = c(0.2, 0.8), b = c(0.5, 1.5)))
small <- list(pilot_chains = 16, groups = 2, max_groups = 2, chains = 8, max_sweeps = 2,
              importance_draws = 50)
fit <- calibrate(emulator, set,
                 list(ais = small, error_ratios = c(0, 1), error_draws = 4, check = 0), seed = 2)
attribute_discrepancy(fit, list(surrogates = 19, ais = small), seed = 3, threads = 2)
