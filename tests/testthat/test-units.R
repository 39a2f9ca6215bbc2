# A unit and an origin are names: what is measured in them may change, and nothing else.
skip_on_cran()  # second tier: tools/test --quick

# Measurements and simulator with the target at `origin + scale * target` and the conditions `driver` times as large;
# noise and priors follow. The sun is not known to the simulator.
world_in <- function(scale = 1, origin = 0, driver = 1) {
  data <- linear_data(96)
  run <- function(values, drivers) {
    values[["offset"]] + scale * exp(values[["a"]]) * 0.1 * lagged(drivers[, "Te"] / driver, 4 + values[["a"]])
  }
  truth <- run(c(offset = 20 * scale, a = 0.6), cbind(Te = driver * data$Te))
  data$Ti <- origin + truth + scale * (0.002 * lagged(data$Gv, 2) + withr::with_seed(1, stats::rnorm(96, 0, 0.05)))
  data[c("Te", "Gv")] <- driver * data[c("Te", "Gv")]
  m <- linear_measurements(data, noise_sd = 0.05 * scale, calibrate = data$hour <= 72, validate = data$hour > 72)
  simulator <- function_simulator(run, free("offset", uniform(origin + 10 * scale, origin + 30 * scale)),
                                  free("a", uniform(0, 1)), boundary = "Te", name = "in units")
  list(scale = scale, origin = origin, measurements = m,
       emulator = train_emulator(simulate_design(simulator, m, runs = 20, seed = 3), m))
}

# All that a world leads to, in the units of the first.
without_units <- function(world) {
  of <- function(x) (x - world$origin) / world$scale
  m <- world$measurements
  emulator <- world$emulator
  fit <- calibrate(emulator, m, quick_ais, seed = 3)
  attributed <- attribute_discrepancy(fit, list(surrogates = 39), seed = 1)
  seen <- predict(emulator, cbind(offset = world$origin + world$scale * c(12, 25), a = c(0.2, 0.8)))
  ahead <- predict(fit, use = "validate")
  list(emulator = list(trusted = emulator$trust$trusted, coefficients = emulator$diagnostics$coefficients[-1],
                       rmse = emulator$diagnostics$series_rmse / world$scale, mean = of(seen$mean),
                       sd = seen$sd / world$scale),
       evidence = fit$log_evidence + length(fit$rows) * log(world$scale),
       fit = list(reach = fit$reach, trusted = fit$trust$trusted, ratio = fit$check$ratio,
                  parameters = colSums(fit$weights * posterior_unit(fit))),
       prediction = list(mean = of(ahead$mean), lower = of(ahead$lower95), crps = ahead$crps / world$scale),
       attribution = attributed$table[order(attributed$table$boundary), c("boundary", "log10_bf_dropped", "share",
                                                                          "p_value", "significant")])
}

expect_same <- function(a, b, tolerance) {
  for (part in setdiff(names(a), "evidence"))
    expect_equal(b[[part]], a[[part]], tolerance = tolerance, ignore_attr = TRUE, info = part)
  expect_lt(abs(b$evidence - a$evidence), tolerance)
}

# Powers of two round nothing, so that chains run alike. What other factors round away in the last digits chains
# amplify, but to far less than the standard error of the evidence, 0.1.
alike <- 1e-7
near <- 2e-2

test_that("the unit and the origin of the target change nothing else", {
  reference <- without_units(world_in())
  for (scale in 2^c(-40, 40)) expect_same(reference, without_units(world_in(scale)), alike)
  for (scale in c(1e-12, 1e12)) expect_same(reference, without_units(world_in(scale)), near)
  expect_same(reference, without_units(world_in(origin = 1e6)), near)
})

test_that("the unit of the boundary conditions changes nothing", {
  reference <- without_units(world_in())
  for (driver in 2^c(-50, 50)) expect_same(reference, without_units(world_in(driver = driver)), alike)
  for (driver in c(1e-12, 1e12)) expect_same(reference, without_units(world_in(driver = driver)), near)
})

test_that("the method of the paper knows no unit but the one it is told", {
  told <- function(scale = 1, origin = 0, driver = 1) {
    world <- world_in(scale, origin, driver)
    m <- world$measurements
    fit <- calibrate_paper(world$emulator, m, list(unit = scale, ais = quick_ais$ais), seed = 2)
    away <- discrepancy(fit)$series
    list(evidence = fit$log_evidence + length(fit$rows) * log(scale), index = fit$index,
         t2 = fit$hyperparameters$t2, parameters = colSums(fit$weights * posterior_unit(fit)),
         discrepancy = as.list(away[c("discrepancy", "lower95", "upper95")] / scale))
  }
  reference <- told()
  for (scale in 2^c(-40, 40)) expect_same(reference, told(scale), alike)
  for (driver in 2^c(-50, 50)) expect_same(reference, told(driver = driver), alike)
})
