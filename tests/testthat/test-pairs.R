skip_on_cran()  # second tier: tools/test --quick

# The air gains heat from the sun at once and loses as much to a wall that the sun warms later. Both
# effects have one driver and nearly cancel: each alone would be far too large.
sun_and_wall <- function(n = 120, effect = 0.05) {
  withr::with_seed(11, {
    hour <- seq_len(n)
    sun <- 100 + 60 * stats::filter(stats::rnorm(n), 0.97, method = "recursive")
    Te <- 5 + 4 * sin(2 * pi * (hour - 3) / 24) + cumsum(stats::rnorm(n, 0, 0.3))
    Ti <- 20 + 0.4 * Te + effect * (sun - lagged(sun, 1)) + stats::rnorm(n, 0, 0.05)
  })
  measurements(data.frame(hour, Te, sun = as.numeric(sun), Ti), time = "hour", target = "Ti",
               boundary = ~ Te + sun, noise_sd = 0.05, validate = hour > 90)
}

sunny <- function(name, parameter, effect) {
  mechanism(name, boundary = "sun", sentence = paste("The", name, "acts."),
            edit = function(model) {
    with_parameters(model, free(parameter, uniform(0, 0.1)), boundary = "sun",
                    f = function(values, drivers, base)
                      base(values) + values[[parameter]] * effect(drivers[, "sun"]))
  })
}

of_both <- function(effect = 0.05) {
  base <- function_simulator(function(values, drivers)
                               values[["offset"]] + values[["gain"]] * drivers[, "Te"],
                             free("offset", uniform(10, 30)), free("gain", uniform(0, 1)),
                             boundary = "Te")
  entries <- catalogue(sunny("gain", "sun_gain", function(x) x),
                       sunny("wall", "wall_loss", function(x) -lagged(x, 1)))
  control <- list(calibration = quick_ais, attribution = list(surrogates = 19), max_steps = 2)
  upgrade_model(base, sun_and_wall(effect = effect), entries, control = control, seed = 1,
                quiet = TRUE)
}

test_that("two mechanisms are adopted together if neither suffices alone", {
  upgrade <- of_both()
  expect_named(upgrade$catalogue, c("gain", "wall", "gain + wall"))
  table <- upgrade$candidates[upgrade$candidates$from == "base", ]
  expect_true(all(table$error_ratio[1:2] > 0.9))
  expect_gt(table$log10_bf[3], 4)
  pair <- upgrade$models[[2]]
  expect_identical(pair$mechanism, "gain + wall")
  expect_identical(pair$verdict, "named")
  found <- parameter_table(pair$fit)
  expect_true(all(found$lower[3:4] < 0.05 & found$upper[3:4] > 0.05))
  expect_identical(upgrade$stopped_id, "all")
  expect_lte(upgrade$runs_total, 220)
})

test_that("no pair is tried if little of the error is left", {
  upgrade <- of_both(effect = 0)
  expect_named(upgrade$catalogue, c("gain", "wall"))
  expect_length(upgrade$models, 1)
})
