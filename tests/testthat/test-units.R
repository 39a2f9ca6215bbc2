# A unit and an origin are names: what is measured in them may change, and nothing else.
skip_on_cran()  # second tier: tools/test --quick

# Measurements and simulator with the target at `origin + scale * target` and the conditions
# `driver` times as large; noise and priors follow. The sun is not known to the simulator.
world_in <- function(scale = 1, origin = 0, driver = 1) {
  data <- linear_data(96)
  run <- function(values, drivers) {
    values[["offset"]] +
      scale * exp(values[["a"]]) * 0.1 * lagged(drivers[, "Te"] / driver, 4 + values[["a"]])
  }
  truth <- run(c(offset = 20 * scale, a = 0.6), cbind(Te = driver * data$Te))
  data$Ti <- origin + truth +
    scale * (0.002 * lagged(data$Gv, 2) + withr::with_seed(1, stats::rnorm(96, 0, 0.05)))
  data[c("Te", "Gv")] <- driver * data[c("Te", "Gv")]
  m <- linear_measurements(data, noise_sd = 0.05 * scale, calibrate = data$hour <= 72,
                           validate = data$hour > 72)
  simulator <- function_simulator(run,
                                  free("offset", uniform(origin + 10 * scale, origin + 30 * scale)),
                                  free("a", uniform(0, 1)), boundary = "Te", name = "in units")
  list(scale = scale, origin = origin, measurements = m,
       emulator = train_emulator(simulate_design(simulator, m, runs = 20, seed = 3), m))
}

# So many draws, and runs at them, that what chains amplify shows as little as below.
many_draws <- list(ais = c(quick_ais$ais, importance_draws = 10000, precision = 0.02), check = 400,
                   exact = 400)
exact_ais <- list(pilot_chains = 200, chains = 100, max_groups = 64, precision = 0.05)

# All that a world leads to, in the units of the first.
without_units <- function(world) {
  of <- function(x) (x - world$origin) / world$scale
  m <- world$measurements
  emulator <- world$emulator
  fit <- calibrate(emulator, m, many_draws, seed = 3)
  attributed <- attribute_discrepancy(fit, list(surrogates = 39, ais = exact_ais), seed = 1)
  seen <- predict(emulator, cbind(offset = world$origin + world$scale * c(12, 25), a = c(0.2, 0.8)))
  ahead <- predict(fit, use = "validate", draws = 1600)
  list(emulator = list(trusted = emulator$trust$trusted,
                       coefficients = emulator$diagnostics$coefficients[-1],
                       rmse = emulator$diagnostics$series_rmse / world$scale, mean = of(seen$mean),
                       sd = seen$sd / world$scale),
       evidence = fit$log_evidence + length(fit$rows) * log(world$scale),
       fit = list(reach = fit$reach, trusted = fit$trust$trusted, ratio = fit$check$ratio,
                  parameters = colSums(fit$weights * posterior_unit(fit))),
       prediction = list(mean = of(ahead$mean), lower = of(ahead$lower95),
                         crps = ahead$crps / world$scale),
       attribution = attributed$table[order(attributed$table$boundary),
                                      c("boundary", "log10_bf_dropped", "share", "p_value",
                                        "significant")])
}

values_of <- function(x, classes) rapply(list(x), identity, classes, how = "unlist")

# Largest difference of each part's numbers; what is no number is the same.
expect_same <- function(a, b, allowed) {
  for (part in names(a)) {
    words <- lapply(list(a, b), function(x) values_of(x[[part]], c("character", "logical")))
    expect_identical(words[[2]], words[[1]])
    difference <- abs(values_of(b[[part]], c("numeric", "integer")) -
                      values_of(a[[part]], c("numeric", "integer")))
    expect_lt(max(difference), if (length(allowed) > 1) allowed[[part]] else allowed, label = part)
  }
}

# Powers of two round nothing but logarithms of the target's unit. What else is rounded in the last
# digit chains amplify until they have nothing in common: what is allowed is some standard errors of
# what they give, of the evidence four (0.02 each). An end of a band has 0.004 (1600 draws).
bits <- 1e-12
chains <- c(emulator = 1e-4, evidence = 0.1, fit = 0.15, prediction = 0.03, attribution = 0.15)

test_that("the unit and the origin of the target change nothing else", {
  reference <- without_units(world_in())
  for (scale in c(2^-40, 1e-12, 1e12))
    expect_same(reference, without_units(world_in(scale)), chains)
  expect_same(reference, without_units(world_in(origin = 1e6)), chains)
})

test_that("the unit of the boundary conditions changes nothing", {
  reference <- without_units(world_in())
  expect_same(reference, without_units(world_in(driver = 2^-50)), bits)
  for (driver in c(1e-12, 1e12))
    expect_same(reference, without_units(world_in(driver = driver)), chains)
})

test_that("the method of the paper knows no unit but the one it is told", {
  told <- function(scale = 1, driver = 1) {
    world <- world_in(scale, driver = driver)
    m <- world$measurements
    fit <- calibrate_paper(world$emulator, m, list(unit = scale, ais = quick_ais$ais), seed = 2)
    away <- discrepancy(fit)$series
    own <- fit$hyperparameters
    list(evidence = fit$log_evidence + length(fit$rows) * log(scale),
         index = fit$index[order(fit$index$boundary), 1:3],
         t2 = stats::weighted.mean(own$t2, own$weights),
         parameters = colSums(fit$weights * posterior_unit(fit)),
         discrepancy = as.list(away[c("discrepancy", "lower95", "upper95")] / scale))
  }
  reference <- told()
  expect_same(reference, told(driver = 2^-50), bits)
  allowed <- c(evidence = 0.1, index = 0.05, t2 = 0.02, parameters = 0.05, discrepancy = 0.02)
  for (scale in c(2^-40, 1e12)) expect_same(reference, told(scale), allowed)
})
