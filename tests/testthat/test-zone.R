room <- function(...) {
  zone(
    zone_wall("facade", 12, zone_layer(0.02, 0.8, 1.4e6), zone_layer(0.2, 0.2, 8e5), outside = "Te",
              sun = "Gv"),
    zone_window("window", 2, outside = "Te"),
    zone_heater("heater", power = "P"),
    ..., volume = 40)
}

weather <- function(n = 96) {
  t <- 2 * pi * seq_len(n) / 96
  cbind(Te = 8 + 6 * sin(t), Gv = pmax(0, 400 * sin(t)), P = 300 * (seq_len(n) %% 24 < 12),
        Ws = 3 + cos(t), Wd = 200)
}

k <- function(prior = uniform(0.1, 0.3)) free("k", prior, "W/mK")

test_that("a zone says what it needs", {
  x <- room(zone_infiltration("leaks", free("ach", uniform(0, 1)), outside = "Te"))
  expect_s3_class(x, "amiss_zone")
  expect_identical(names(zone_parameters(x)), "ach")
  expect_setequal(zone_boundary(x), c("Te", "Gv", "P"))
  expect_lte(length(capture.output(print(x))), 15)
  expect_output(print(x), "Free parameters: ach")
})

test_that("components are edited by name", {
  x <- add_component(room(), zone_coupling("door", 10, "T_hall"))
  expect_true("T_hall" %in% zone_boundary(x))
  expect_identical(component(x, "door")$conductance, 10)
  x <- change_component(x, "door", conductance = 20)
  expect_identical(component(x, "door")$conductance, 20)
  expect_false("T_hall" %in% zone_boundary(drop_component(x, "door")))
  x <- change_component(x, "facade", layers = list(zone_layer(0.1, k(), 1e6)), sun = NULL)
  expect_identical(names(zone_parameters(x)), "k")
  expect_null(component(x, "facade")$sun)
  expect_true("sun" %in% names(component(x, "facade")))
  expect_identical(change_component(x, "zone", air_capacity_factor = 3)$air_capacity_factor, 3)
})

test_that("misuse is a classed error that names component, field and value", {
  expect_error(zone_layer(-0.1, 1, 1e6), "thickness.*-0.1", class = "amiss_error_input")
  expect_error(zone_wall("w", -2, zone_layer(0.1, 1, 1e6)), "'w'.*area.*-2",
               class = "amiss_error_input")
  expect_error(zone_wall("w", 2), "layer", class = "amiss_error_input")
  expect_error(zone_wall("w", 2, zone_layer(0.1, 1, 1e6), wind_film = 1), "wind_speed",
               class = "amiss_error_input")
  expect_error(zone_opening("o", 1, "Te", exposure = "windy"), "windy", class = "amiss_error_input")
  expect_error(room(zone_heater("heater", "P")), "heater", class = "amiss_error_input")
  expect_error(zone_heater("zone", "P"), "zone", class = "amiss_error_input")
  expect_error(component(room(), "attic"), "attic.*facade", class = "amiss_error_input")
  expect_error(drop_component(room(), "attic"), "attic", class = "amiss_error_input")
  expect_error(change_component(room(), "heater", lag = 3), "lag.*capacity",
               class = "amiss_error_input")
  expect_error(change_component(room(), "heater", 3), class = "amiss_error_input")
  expect_error(change_component(room(), "heater", radiant_fraction = 1.5), "1.5",
               class = "amiss_error_input")
  expect_error(change_component(room(), "zone", volume = 0), "volume", class = "amiss_error_input")
})

test_that("a free parameter may stand in several places with one prior only", {
  x <- zone(zone_wall("w", 1, zone_layer(0.1, k(), 1e6), zone_layer(0.2, k(), 1e6)), volume = 1)
  expect_length(zone_parameters(x), 1)
  x <- zone(zone_wall("w", 1, zone_layer(0.1, k(), 1e6), zone_layer(0.2, k(uniform(0, 1)), 1e6)),
            volume = 1)
  expect_error(zone_parameters(x), "two different priors", class = "amiss_error_input")
})

test_that("resolving puts numbers in, in the unit of the field", {
  area <- free("area", uniform(700, 1300), "mm2")
  x <- room(zone_opening("low", area * 1e-6, "Te"),
            zone_opening("high", 2 * (area / 1e6), "Te", height = 2))
  expect_identical(zone_parameters(x)$area$unit, "mm2")
  y <- zone_resolve(x, c(area = 1000))
  expect_length(zone_parameters(y), 0)
  expect_equal(component(y, "low")$area, 1e-3)
  expect_equal(component(y, "high")$area, 2e-3)
  expect_error(zone_resolve(x, c(other = 1)), "area", class = "amiss_error_input")
  expect_error(zone_resolve(x, c(area = -5)), "low.*area", class = "amiss_error_input")
  expect_error(area + 1, "multiplied", class = "amiss_error_input")
  expect_error(1 / area, "multiplied", class = "amiss_error_input")
})

test_that("runs follow their parameters and do not depend on threads", {
  x <- room(zone_infiltration("leaks", free("ach", uniform(0, 1)), outside = "Te"))
  values <- cbind(ach = c(0.1, 0.5, 0.9, 0.1, 0.3))
  air <- simulate_zone(x, values, weather(), 900)
  expect_identical(dim(air), c(96L, 5L))
  expect_true(all(is.finite(air)))
  expect_identical(air[, 1], air[, 4])
  expect_true(mean(air[, 1]) > mean(air[, 2]) && mean(air[, 2]) > mean(air[, 3]))
  expect_identical(air, simulate_zone(x, values, weather(), 900, threads = 2))
  expect_identical(air[, 3], simulate_zone(zone_resolve(x, values[3, ]), NULL, weather(), 900)[, 1])
  expect_error(simulate_zone(x, cbind(ach = c(0.1, -2, 0.3)), weather(), 900), "leaks.*ach.*-2",
               class = "amiss_error_input")
})

test_that("held intervals return what they are held at", {
  hold <- c(rep(21, 40), rep(NA, 56))
  air <- simulate_zone(room(), NULL, weather(), 900, hold = hold, control = list(spinup = 2))
  expect_equal(air[1:40, 1], hold[1:40])
  expect_false(any(air[41:96, 1] == 21))
})

test_that("a steady zone loses what it is given, and the energy balance closes", {
  x <- zone(zone_coupling("door", 10, "Te"), zone_heater("heater", "P"), volume = 20)
  drivers <- cbind(Te = rep(5, 300), P = 200)
  expect_equal(simulate_zone(x, NULL, drivers, 3600)[300, 1], 25, tolerance = 1e-8)
  indexed <- index_zone(room(), colnames(weather()))
  run <- zone_balance_(indexed, weather(), 900, numeric(), zone_control)
  expect_equal(sum(run$through) + run$hold, sum(run$stored), tolerance = 1e-9)
  expect_equal(run$through[["heater"]], sum(weather()[, "P"]) * 900)
})

test_that("data that cannot be simulated are refused", {
  expect_error(simulate_zone(room(), NULL, weather()[, -1], 900), "Te", class = "amiss_error_input")
  gap <- weather()
  gap[3, "P"] <- NA
  expect_error(simulate_zone(room(), NULL, gap, 900), "P", class = "amiss_error_input")
  gap <- weather()
  gap[3, "Ws"] <- NA
  expect_true(all(is.finite(simulate_zone(room(), NULL, gap, 900))))
  expect_error(simulate_zone(room(), NULL, weather(), 900, hold = 1:3), "hold",
               class = "amiss_error_input")
  expect_error(simulate_zone(room(), NULL, weather(), 900, control = list(cell = 2)), "cells",
               class = "amiss_error_input")
  free_room <- room(zone_infiltration("leaks", free("ach", uniform(0, 1)), outside = "Te"))
  expect_error(simulate_zone(free_room, NULL, weather(), 900), "ach", class = "amiss_error_input")
})

test_that("the paper's box has the paper's parameters and runs", {
  drivers <- weather()
  colnames(drivers)[3] <- "RHP"
  middle <- function(p) (p$prior$lower + p$prior$upper) / 2
  outer <- c("outer_k", "outer_c", "insulation_k", "insulation_c", "heater_radiant")
  expected <- list(M1 = c("wall_k", "wall_c", "heater_radiant"), M2 = outer,
                   M3 = c(outer, "crack_area"), M4 = c(outer, "window_transmission"),
                   M5 = c(outer, "crack_area"), M6 = c(outer, "crack_area"))
  for (model in names(expected)) {
    box <- paper_box(model)
    expect_setequal(names(zone_parameters(box)), expected[[model]])
    values <- t(vapply(zone_parameters(box), middle, 0))
    expect_true(all(is.finite(simulate_zone(box, values, drivers, 900))))
  }
  expect_identical(zone_parameters(paper_box("M6"))$outer_c$prior$upper, 3360)
  expect_setequal(zone_boundary(paper_box("M3")), c("Te", "Gv", "Ws", "Wd", "RHP"))
  expect_error(paper_box("M7"), "M7", class = "amiss_error_input")
})

test_that("the paper's box loses heat as measured, and more with a crack", {
  drivers <- cbind(Te = rep(0, 2000), Gv = 0, Ws = 3, Wd = 180, RHP = 100)
  loss <- function(model, ...) {
    values <- cbind(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 179,
                    heater_radiant = 0.79, ...)
    100 / simulate_zone(paper_box(model), values, drivers, 3600)[2000, 1]
  }
  expect_gt(loss("M2"), 3.6)
  expect_lt(loss("M2"), 4.3)
  expect_gt(loss("M3", crack_area = 790), loss("M2") + 0.1)
})

test_that(
  "the initial offset of the walls is forgotten at the walls' own pace, and only they feel it", {
  room <- function(offset) {
    zone(zone_wall("facade", 10, zone_layer(0.1, 1, 2e6), outside = "Te"), volume = 50,
         initial_wall_offset = offset)
  }
  drivers <- cbind(Te = rep(10, 96))
  difference <- simulate_zone(room(2), drivers = drivers, step_s = 900)[, 1] -
    simulate_zone(room(0), drivers = drivers, step_s = 900)[, 1]
  expect_true(all(difference > 0) && all(diff(difference[10:96]) < 0))
  expect_lt(difference[96], 0.2 * max(difference))
})

test_that(paste("the engine reads every field of the table, and refuses a component or an exposure",
                "that it does not know"), {
  drivers <- cbind(Te = c(5, 6), P = 100, V = 3, Wd = 90)
  components <- list(
    zone_wall("w", 10, zone_layer(0.1, 1, 1e6), outside = "Te", sun = "P", sky = "P",
              wind_speed = "V", wind_direction = "Wd", wind_film = 0.5),
    zone_window("w", 2, "Te", sun = "P"), zone_opening("o", 0.1, "Te"),
    zone_crack("c", 0.001, 1, "Te"), zone_infiltration("i", 0.5, "Te"), zone_heater("h", "P"),
    zone_supply("s", "V", "Te"), zone_coupling("c", 5, "Te"), zone_gain("g", "P"))
  fields <- amiss:::zone_fields
  expect_setequal(vapply(components, `[[`, "", "type"), setdiff(names(fields), c("layer", "zone")))
  run <- function(zone) {
    amiss:::zone_simulate_(zone, list(), matrix(0, 1, 0), drivers, 900, numeric(),
                           amiss:::zone_control, list(seed = 0, threads = 1))
  }
  for (component in components) {
    one <- amiss:::index_zone(unclass(zone(component, volume = 40)), colnames(drivers))
    expect_setequal(setdiff(names(component), c("type", "name")), names(fields[[component$type]]))
    expect_true(all(is.finite(run(one))))
    for (field in c("type", "name", names(fields[[component$type]]))) {
      broken <- one
      broken$components[[1]][[field]] <- NULL
      expect_error(run(broken), info = paste(component$type, field))
    }
    one$components[[1]]$type <- "chimney"
    expect_error(run(one), "unknown component 'chimney'")
  }
  opening <- amiss:::index_zone(unclass(zone(components[[3]], volume = 40)), colnames(drivers))
  opening$components[[1]]$exposure <- "windy"
  expect_error(run(opening), "unknown exposure 'windy'")
})

test_that("drivers that seem to be no measurements are told of", {
  room <- zone(zone_infiltration("leak", 0.5, "Te"), volume = 10)
  te <- 5 + sin(1:96 / 4)
  expect_no_warning(simulate_zone(room, drivers = cbind(Te = te, unread = -9999), step_s = 900))
  for (value in c(-9999, 700)) {
    expect_warning(simulate_zone(room, drivers = cbind(Te = replace(te, 5, value)), step_s = 900),
                   paste0("Te is ", value, " in row 5"), class = "amiss_warning_input")
  }
  # A record has checked its own.
  expect_no_warning(simulate_runs(room, matrix(0, 1, 0), cbind(Te = replace(te, 5, 700)),
                                  step_h = 0.25))
})
