values <- c(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 179,
            heater_radiant = 0.79)

# Walls that are all alike exchange no net radiation: film, layers and film in series, and the
# window beside them.
box_loss <- function(values) {
  resistance <- 1 / 3 + 2 * 0.03 / values[["outer_k"]] + 0.06 / values[["insulation_k"]] + 1 / 25
  (6 * 0.96^2 - 0.36) / resistance + 1.5 * 0.36
}

test_that("a sealed box loses what its closed form says", {
  expect_equal(heat_loss_coefficient(paper_box("M2"), values), box_loss(values), tolerance = 1e-6)
  two <- rbind(values, replace(values, "insulation_k", 0.06))
  expect_equal(heat_loss_coefficient(paper_box("M2"), two), unname(apply(two, 1, box_loss)),
               tolerance = 1e-6)
})

test_that("sun, gains and sky do not count; infiltration adds its air", {
  ach <- 0.7
  leaky <- add_component(paper_box("M2"), zone_infiltration("leaks", ach, outside = "Te"))
  leaky <- change_component(leaky, "roof", sky = "Lw", outside_emissivity = 0)
  sealed <- change_component(paper_box("M2"), "roof", outside_emissivity = 0)
  # density of either side
  per_air_change <- 0.96^3 * 1006 / 3600 * 1.1881 * 293.15 / (273.15 + c(10, 30))
  added <- heat_loss_coefficient(leaky, values) - heat_loss_coefficient(sealed, values)
  # Density of the outside or the inside air: the two differ by 7 %.
  expect_gte(added, ach * min(per_air_change) * 0.999)
  expect_lte(added, ach * max(per_air_change) * 1.001)
})

test_that("openings lose what wind and buoyancy drive through two orifices in series", {
  opened <- function(drivers)
    heat_loss_coefficient(paper_box("M3"), c(values, crack_area = 790), drivers) - box_loss(values)
  density <- 1.1881 * 293.15 / (273.15 + c(10, 30))
  flow <- function(dp) 0.65 * 790e-6 * sqrt(2 * mean(density) * abs(dp) / 2)
  buoyancy <- diff(rev(density)) * 9.81 * 0.6
  # Both orifices take half of the pressure difference, but for densities that differ by 7 %.
  expect_equal(opened(c(Ws = 0, Wd = 0)), 1006 * flow(buoyancy), tolerance = 0.03)
  # South wind on the low front, semi-exposed: Cp 0.40 against -0.20; wind and buoyancy push the
  # same way.
  expect_equal(opened(c(Ws = 5, Wd = 180)), 1006 * flow(buoyancy + 0.6 * 0.5 * density[1] * 25),
               tolerance = 0.03)
})

test_that("bad arguments are refused", {
  expect_error(heat_loss_coefficient(linear_simulator(), values), "zone",
               class = "amiss_error_input")
  expect_error(heat_loss_coefficient(paper_box("M3"), values), "crack_area",
               class = "amiss_error_input")
  expect_error(heat_loss_coefficient(paper_box("M2"), values, outside = 20, inside = 20), "inside",
               class = "amiss_error_input")
})
