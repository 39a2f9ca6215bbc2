finds <- function(upgrade, mechanism) {
  expect_equal(upgrade$named_cause$mechanism, mechanism)
  expect_gt(upgrade$named_cause$log10_bf, 2)
  expect_lt(upgrade$gain$rmse_validation[2], upgrade$gain$rmse_validation[1])
}

test_that("wind-driven infiltration is found", {
  world <- box_world("wind-driven infiltration", c(leak_area = 700), seed = world_seed(101))
  finds(upgrade_world(world), "wind-driven infiltration")
})

test_that("another window transmission is found, with its value", {
  world <- box_world("window transmission", c(transmission = 0.30), seed = world_seed(102))
  upgrade <- upgrade_world(world)
  finds(upgrade, "window transmission")
  own <- subset(tidy(upgrade$models[[2]]$fit), name == "transmission")
  expect_true(own$lower95 <= 0.30 && own$upper95 >= 0.30)
})

test_that("the heat capacity of the heater is found", {
  world <- box_world("heater lag", c(heater_capacity = 15000), seed = world_seed(103))
  finds(upgrade_world(world), "heater lag")
})

test_that("where nothing is hidden nothing is named", {
  upgrade <- upgrade_world(box_world(seed = world_seed(104)))
  expect_null(upgrade$named_cause)
  expect_false(any(upgrade$models[[1]]$attribution$table$significant))
})

test_that("house O5: the open south blinds are found in real data", {
  study <- read_study(twinhouse_study("O5"))
  upgrade <- upgrade_model(study$model, study$measurements, study$catalogue, seed = 7, threads = 2, quiet = TRUE,
                           control = list(max_steps = 1))
  expect_equal(upgrade$models[[1]]$attribution$table$boundary[1], "Gv_S")
  expect_equal(upgrade$named_cause$mechanism, "south solar aperture")
  expect_gt(upgrade$named_cause$log10_bf, 100)
  expect_lt(upgrade$gain$rmse_calibration[2], 0.20)
  expect_lt(upgrade$gain$rmse_validation[2], 0.50)
})
