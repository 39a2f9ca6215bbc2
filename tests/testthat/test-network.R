# Networks of nodes, links, flows and gains, against computations of other kinds. Formulas of the
# engine are tested in tests/cpp/network.

house <- function(...) {
  network(network_node("air", free("C_air", uniform(0.2, 5), "kWh/K")),
          network_node("wall", free("C_wall", uniform(1, 20), "kWh/K")),
          network_link("air", "wall", resistance = free("R_inside", uniform(0.2, 5), "K/kW")),
          network_link("wall", "Te", resistance = free("R_outside", uniform(2, 20), "K/kW")),
          network_gain("air", "P"), ..., output = "air")
}

house_drivers <- function(n = 48) {
  hour <- seq_len(n)
  cbind(Te = 5 + 4 * sin(hour / 4), P = ifelse(hour %% 8 < 3, 2, 0),
        Gv = pmax(0, 400 * sin(hour / 4 - 1)), wind = 3 + 2 * cos(hour / 5))
}

house_values <- function(...) rbind(c(C_air = 0.8, C_wall = 6, R_inside = 0.7, R_outside = 6, ...))

test_that("a house follows lsoda of deSolve", {
  skip_if_not_installed("deSolve")
  drivers <- house_drivers()
  leak <- network_link("air", "Te", conductance = free("leak", uniform(0, 0.1)), by = "wind",
                       name = "leak")
  sun <- network_gain("wall", "Gv", free("A", uniform(0, 10), "m2") * 1e-3)
  model <- change_component(change_component(house(leak, sun), "air", start = 20), "wall",
                            start = 12)
  model <- change_component(model, "network", output_at = "end")
  v <- house_values(leak = 0.01, A = 4)
  change <- function(t, x, p) {
    d <- drivers[min(floor(t) + 1, nrow(drivers)), ]
    inside <- (x[2] - x[1]) / v[, "R_inside"]
    air <- inside + v[, "leak"] * d["wind"] * (d["Te"] - x[1]) + d["P"]
    wall <- -inside + (d["Te"] - x[2]) / v[, "R_outside"] + v[, "A"] * 1e-3 * d["Gv"]
    list(c(air / v[, "C_air"], wall / v[, "C_wall"]))
  }
  x <- c(20, 12)
  # restarted at each row, where the drivers jump
  other <- vapply(seq_len(nrow(drivers)), function(k) {
    x <<- deSolve::lsoda(x, c(k - 1, k - 1e-9), change, NULL, rtol = 1e-10, atol = 1e-10)[2, -1]
    x[1]
  }, 0)
  # The rows end 1e-9 h early, and lsoda errs by some 1e-9 of 20 K.
  expect_lt(max(abs(simulate_runs(model, v, drivers, 1)[, 1] - other)), 1e-6)
})

test_that("slopes are those of differences, in units of the parameters", {
  sun <- network_gain("wall", "Gv", free("A", uniform(0, 10), "m2") * 1e-3)
  ground <- network_node("ground", Inf, start = free("T_ground", normal(12, 2)))
  below <- network_link("air", "ground", conductance = 0.05)
  model <- change_component(house(sun, ground, below), "network",
                            before = list(Te = free("Te_before", normal(5, 2))))
  v <- house_values(A = 4, T_ground = 11, Te_before = 3)
  drivers <- house_drivers()
  hold <- c(rep(20.5, 6), rep(NA, 42))
  given <- slopes(model, v, drivers, 1, hold)
  expect_identical(colnames(given), names(free_parameters(model)))
  for (name in colnames(given)) {
    moved <- v[c(1, 1), ]
    moved[, name] <- v[, name] + c(-1, 1) * 1e-4
    runs <- simulate_runs(model, moved, drivers, 1, hold)
    # The third derivative times 1e-8, and rounding of 1e-13 over 2e-4.
    expect_equal(given[, name], (runs[, 2] - runs[, 1]) / 2e-4, tolerance = 1e-5, info = name)
  }
  renamed <- rename_parameters(model, A = "aperture")
  colnames(v)[colnames(v) == "A"] <- "aperture"
  expect_equal(slopes(renamed, v, drivers, 1, hold)[, "aperture"], given[, "A"])
})

test_that("water that rains into two stores leaves by the river or is still there", {
  rain <- cbind(rain = c(rep(0, 5), 4, 2, rep(0, 500)))
  catchment <- function(output) {
    network(network_node("soil", 1, start = 20), network_node("ground", 1, start = 30),
            network_gain("soil", "rain"),
            network_flow("soil", "ground", rate = free("k", uniform(0, 1), "1/h")),
            network_flow("ground", NULL, rate = 0.03, name = "river"), output = output,
            output_at = "mean")
  }
  k <- cbind(k = 0.1)
  flowed <- sum(simulate_runs(catchment("river"), k, rain, 1))
  left <- vapply(c("soil", "ground"), function(node) {
    model <- change_component(catchment(node), "network", output_at = "end")
    utils::tail(simulate_runs(model, k, rain, 1)[, 1], 1)
  }, 0)
  expect_equal(flowed + sum(left), 20 + 30 + 6, tolerance = 1e-10)
  # The soil empties as exp(-k t) until it rains.
  expect_equal(simulate_runs(change_component(catchment("soil"), "network", output_at = "end"), k,
                             rain, 1)[1:5, 1], 20 * exp(-0.1 * 1:5))
})

test_that("a tracer that flows through two tanks keeps its amount", {
  tanks <- network(network_node("first", 4, start = 10), network_node("second", 2, start = 0),
                   network_flow("first", "second", rate = 0.5),
                   network_flow("second", NULL, rate = 0.5, name = "out"),
                   network_flow("inlet", "first", rate = free("q", uniform(0, 1), "m3/h")),
                   output = "out")
  inlet <- cbind(inlet = rep(0, 400))
  expect_equal(sum(simulate_runs(tanks, cbind(q = 0.5), inlet, 1)), 40, tolerance = 1e-9)
})

test_that("a run does not depend on threads, nor on runs beside it", {
  values <- house_values()[rep(1, 5), ]
  values[, "C_air"] <- 1:5 / 2
  drivers <- house_drivers()
  all <- simulate_runs(house(), values, drivers, 1)
  expect_identical(simulate_runs(house(), values, drivers, 1, threads = 2), all)
  expect_identical(simulate_runs(house(), values[3, , drop = FALSE], drivers, 1)[, 1], all[, 3])
})

test_that("rows half as long give the same means", {
  v <- house_values()
  drivers <- house_drivers()
  half <- simulate_runs(house(), v, drivers[rep(1:48, each = 2), ], 0.5)[, 1]
  expect_equal(colMeans(matrix(half, 2)), simulate_runs(house(), v, drivers, 1)[, 1],
               tolerance = 1e-12)
})

test_that("edits add, change and take away", {
  model <- house()
  heater <- add_component(model, network_node("heater", free("C_heater", uniform(0, 1), "kWh/K")),
                          network_link("heater", "air", conductance = 0.5))
  heater <- change_component(heater, "P to air", to = "heater")
  expect_identical(component(heater, "P to air")$to, "heater")
  v <- house_values()
  # A heater without capacity passes its heat on: to 1e-5 of a row.
  expect_equal(simulate_runs(heater, cbind(v, C_heater = 0), house_drivers(), 1),
               simulate_runs(model, v, house_drivers(), 1), tolerance = 1e-4)
  opened <- change_component(model, "wall-Te", conductance = 0.2)
  expect_null(component(opened, "wall-Te")$resistance)
  expect_false("R_outside" %in% names(free_parameters(opened)))
  gone <- drop_component(heater, "heater-air")
  expect_false("heater-air" %in% names(gone$components))
  expect_setequal(driver_names(heater), c("Te", "P"))
})

test_that("what does not fit together is refused, by name", {
  refused <- function(code, words) expect_error(code, words, class = "amiss_error_input")
  refused(network(network_node("air", 1), output = "wall"), "no such part")
  refused(network(network_link("air", "Te", 1), output = "air-Te"), "at least one")
  refused(network(network_node("air", 1), network_link("wall", "Te", 1), output = "air"),
          "no such node")
  refused(network(network_node("air", 1), network_node("air", 2), output = "air"), "more than once")
  refused(network(network_node("air", 1), network_node("wall", 1), network_gain("air", "wall"),
                  output = "air"), "is a node")
  refused(network_link("air", "Te"), "one of")
  refused(network_link("air", "air", 1), "to itself")
  refused(network_link("air", "Te", free("H", normal(0, 1))), "reaches")
  refused(network_node("air", -1), "at least 0")
  refused(house(before = list(Tx = 3)), "drives nothing")
  refused(change_component(house(), "air", conductance = 1), "no field")
  refused(component(house(), "attic"), "no part")
  loose <- add_component(house(), network_node("mass", 2))
  refused(simulate_runs(loose, house_values(), house_drivers(), 1), "no steady state")
  store <- network(network_node("soil", 1), network_gain("soil", "rain"), output = "soil")
  refused(simulate_runs(store, matrix(0, 1, 0), cbind(rain = c(0, 3)), 1), "no steady state")
  expect_true(all(is.finite(simulate_runs(store, matrix(0, 1, 0), cbind(rain = c(0, 3)), 1,
                                          hold = c(2, NA)))))
  gap <- house_drivers()
  gap[3, "Te"] <- NA
  refused(simulate_runs(house(), house_values(), gap, 1), "missing or infinite")
})

test_that(
  "the catalogue has ten mechanisms, each extends the house, and what is there is left out", {
  all <- network_catalogue(house(), envelope = "wall", outdoors = "Te", sun = "Gv", heating = "P",
                           wind = "wind", neighbour = "Tn")
  expect_length(all, 10)
  for (one in all) {
    extended <- one$edit(house())
    expect_true(all(names(free_parameters(house())) %in% names(free_parameters(extended))),
                info = one$name)
    expect_gt(length(free_parameters(extended)), length(free_parameters(house())))
  }
  sunny <- house(network_gain("air", "Gv", 1e-3))
  expect_false("sun on the air" %in% names(network_catalogue(sunny, sun = "Gv")))
  expect_named(network_catalogue(house()), c("interior mass", "heat to the ground"))
  expect_output(print(house()), "2 nodes, 2 links, and 1 gain")
})

test_that("a hidden sun is found with exact slopes, in fewer runs than differences would take", {
  skip_on_cran()
  truth <- house(network_gain("air", "Gv", 3e-3))
  set.seed(4)
  n <- 24 * 12
  weather <- synthetic_weather(12, step_h = 1, seed = 3)
  data <- data.frame(hour = seq_len(n), Te = weather$Te, Gv = weather$Gv,
                     P = rolbs(n, 1, power = 2, seed = 2))
  data$Ti <- simulate_runs(truth, house_values(), as.matrix(data[c("Te", "P", "Gv")]), 1)[, 1] +
    rnorm(n, 0, 0.1)
  m <- suppressMessages(measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv + P,
                                     noise_sd = 0.1, warmup = 24, calibrate = seq_len(n) <= 200,
                                     validate = seq_len(n) > 200))
  causes <- network_catalogue(house(), outdoors = "Te", sun = "Gv", heating = "P")
  found <- suppressWarnings(upgrade_model(house(), m, causes, seed = 1, quiet = TRUE))
  expect_identical(found$models[[length(found$models)]]$mechanism, "sun on the air")
  expect_lt(found$runs_total, 400)
  aperture <- tidy(found)
  aperture <- aperture[aperture$term == "A_air", ]
  expect_true(aperture$conf.low < 3 && aperture$conf.high > 3)
})
