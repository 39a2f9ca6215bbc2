skip_without_fmus()

test_that("both versions give what the same linear system gives exactly", {
  drivers <- house_drivers()
  values <- cbind(R_out = c(0.008, 0.015))
  for (version in 2:3) {
    file <- house_file(version)
    mean <- simulate_runs(house_fmu(file, steps_per_row = 4), values, drivers, 1)
    end <- simulate_runs(house_fmu(file, averaged = FALSE), values, drivers, 0.5)
    for (m in 1:2) {
      # The house's own steps of fourth order are 30 s long, its fastest time constant 900 s: 1e-8
      # K.
      exact <- house_exact(drivers[, -3], 1, 4, R_out = values[m])
      expect_lt(max(abs(mean[, m] - row_means(exact, 4))), 1e-6)
      expect_lt(max(abs(end[, m] - house_exact(drivers[, -3], 0.5, R_out = values[m])[-1])), 1e-6)
    }
  }
})

test_that("more steps in a row come closer to its mean", {
  drivers <- house_drivers(24)
  fine <- row_means(house_exact(drivers[, -3], 1, 256, R_out = 0.01), 256)
  off <- vapply(c(1, 4, 16), function(steps) {
    simulator <- house_fmu(house_file(), steps_per_row = steps)
    max(abs(simulate_runs(simulator, cbind(R_out = 0.01), drivers, 1) - fine))
  }, 0)
  # Second order: four times the steps, a sixteenth of the error, once they resolve the heater.
  expect_gt(off[2] / off[3], 12)
  expect_gt(off[1] / off[2], 4)
})

test_that(
  "fixed values, undriven inputs and starts of states are the FMU's own, or those that are given", {
  drivers <- house_drivers(12)
  run <- function(...)
    simulate_runs(house_fmu(file, ..., averaged = FALSE), cbind(R_out = 0.01), drivers, 1)[, 1]
  exact <- function(drivers, ...) house_exact(drivers, 1, R_out = 0.01, ...)[-1]
  for (version in 2:3) {
    file <- house_file(version)
    unheated <- replace(drivers[, -3], cbind(1:12, 2), 0)
    expect_equal(run(fixed = list(heating_allowed = FALSE)), exact(unheated), tolerance = 1e-7)
    expect_equal(run(inputs = c(To = "Te")), exact(unheated), tolerance = 1e-7)
    expect_equal(run(fixed = c(aperture = 5), inputs = c(To = "Te", "P", "Gv")),
                 exact(drivers, aperture = 5), tolerance = 1e-7)
    expect_equal(run(fixed = list(P = 500), inputs = c(To = "Te")),
                 exact(replace(drivers[, -3], cbind(1:12, 2), 500)), tolerance = 1e-7)
    expect_equal(run(fixed = list(T_wall = 10)), exact(drivers[, -3], start = c(20, 10, 20)),
                 tolerance = 1e-7)
  }
  cold <- fmu_simulator(file, free("T_wall", uniform(0, 30)), output = "T_air",
                        inputs = c("Te", "P"), averaged = FALSE)
  expect_equal(simulate_runs(cold, cbind(T_wall = 12), cbind(Te = drivers[, "To"], P = 0), 1)[, 1],
               house_exact(unheated, 1, start = c(20, 12, 20))[-1], tolerance = 1e-7)
})

test_that("an input may have a column of another name, and one column may drive two inputs", {
  drivers <- cbind(outside = house_drivers(6)[, "To"])
  both <- house_fmu(house_file(), inputs = c(outside = "Te", outside = "Gv"))
  expect_identical(driver_names(both), "outside")
  runs <- simulate_runs(both, cbind(R_out = 0.01), drivers, 1)
  expect_true(all(is.finite(runs)))
})

test_that("print says what is free, fixed, driven and not driven", {
  said <- printed(house_fmu(house_file(3), fixed = list(leak = 3)))
  for (pattern in c("FMI 3.0", "1 free parameter", "R_out", "leak = 3 W/K", "Te from To, P",
                    "keep their start value: Gv \\(0.0 W/m", "output: T_air °C, mean"))
    expect_match(said, pattern)
})

test_that("names that the FMU does not have, or uses otherwise, are refused with near ones", {
  file <- house_file()
  refuses <- function(pattern, ...)
    expect_error(fmu_simulator(file, ...), pattern, class = "amiss_error_input")
  some <- free("R_out", uniform(0.005, 0.02))
  refuses("no variable \"Rout\".*R_out", free("Rout", uniform(0, 1)), output = "T_air")
  refuses("\"Te\" of the FMU is no parameter.*\"input\"", free("Te", uniform(0, 1)),
          output = "T_air")
  refuses("\"T_heater\" of the FMU is no parameter", free("T_heater", uniform(0, 1)),
          output = "T_air")
  refuses("only real numbers", free("heating_allowed", uniform(0, 1)), output = "T_air")
  refuses("\"C_air\" of the FMU is no input.*inputs", some, output = "T_air", inputs = "C_air")
  refuses("no variable \"T_out\"", some, output = "T_air", inputs = c(Te = "T_out"))
  refuses("\"Te\" of the FMU is no variable", some, output = "Te")
  refuses("no variable \"Tair\".*T_air", some, output = "Tair")
  refuses("drives \"Te\" twice", some, output = "T_air", inputs = c("Te", To = "Te"))
  refuses("R_out.*free and in", some, output = "T_air", fixed = list(R_out = 0.01))
  refuses("\"P\" and \"P\": give it once", some, output = "T_air", inputs = "P",
          fixed = list(P = 1))
  refuses("no variable \"k\"", some, output = "T_air", fixed = list(k = 1))
  refuses("fixed\\$heating_allowed.*TRUE or FALSE", some, output = "T_air",
          fixed = list(heating_allowed = 1))
  refuses("fixed\\$leak. = -1 is beyond", some, output = "T_air", fixed = list(leak = -1))
  refuses("fixed\\$leak.*a number", some, output = "T_air", fixed = list(leak = "much"))
})

test_that("a prior beyond the limits of the FMU is refused", {
  file <- house_file(3)
  with <- function(prior) fmu_simulator(file, free("aperture", prior), output = "T_air")
  for (prior in list(uniform(-1, 5), uniform(0, 101), normal(5, 1))) {
    expect_error(with(prior), "aperture.*limits of the FMU.*lower", class = "amiss_error_input")
  }
  expect_s3_class(with(normal(5, 1, lower = 0, upper = 100)), "amiss_fmu_simulator")
  # The limits of T_wall are those of its declared type.
  expect_error(fmu_simulator(file, free("T_wall", uniform(0, 300)), output = "T_air"), "-100.*200",
               class = "amiss_error_input")
})

test_that("a mechanism that is switched off is the base; mechanisms stack and drop nothing", {
  base <- house_fmu(house_file(), fixed = list(aperture = 0))
  sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
    with_fmu(model, free("aperture", uniform(0, 10), "m2"), inputs = "Gv")
  })
  leaks <- mechanism("leaks", boundary = "To", sentence = "Air leaks.", edit = function(model) {
    with_fmu(model, free("leak", uniform(0, 100), "W/K"))
  })
  both <- amiss:::extend(amiss:::extend(base, sun), leaks)
  expect_named(free_parameters(both), c("R_out", "aperture", "leak"))
  expect_setequal(driver_names(both), c("To", "P", "Gv"))
  drivers <- house_drivers()
  off <- cbind(R_out = 0.01, aperture = 0, leak = 0)
  expect_identical(simulate_runs(both, off, drivers, 1),
                   simulate_runs(base, off[, 1, drop = FALSE], drivers, 1))
  on <- simulate_runs(both, cbind(R_out = 0.01, aperture = 3, leak = 20), drivers, 1)[, 1]
  expect_equal(on, row_means(house_exact(drivers, 1, R_out = 0.01, aperture = 3, leak = 20), 1),
               tolerance = 1e-7)
  expect_error(with_fmu(both, fixed = list(leak = 1)), "leak.*is free in the model",
               class = "amiss_error_input")
  expect_error(with_fmu(both, free("leak", uniform(0, 5))), "leak.*another prior",
               class = "amiss_error_input")
  expect_error(with_fmu(both, free("draught", uniform(0, 5))), "no variable \"draught\"",
               class = "amiss_error_input")
  expect_identical(with_fmu(base, inputs = c(Ta = "Te"))$inputs, c(P = "P", Ta = "Te"))
  expect_named(with_fmu(with_fmu(base, fixed = list(Gv = 3)), inputs = "Gv")$fixed, "aperture")
})

test_that("an FMU is calibrated", {
  skip_on_cran()  # second tier: tools/test --quick
  drivers <- house_drivers(120)
  truth <- row_means(house_exact(drivers[, -3], 1, R_out = 0.012), 1)
  record <- data.frame(hour = 1:120, drivers,
                       Ti = truth + withr::with_seed(3, stats::rnorm(120, 0, 0.05)))
  room <- measurements(record, time = "hour", target = "Ti", boundary = ~ To + P, noise_sd = 0.05)
  ensemble <- simulate_design(house_fmu(house_file()), room, runs = 12, seed = 1)
  fit <- calibrate(train_emulator(ensemble, room), room, c(quick_ais, check = 4), seed = 1)
  expect_equal(coef(fit)[["R_out"]], 0.012, tolerance = 0.02)  # ten times the posterior's width
})

test_that("times begin where they are said to", {
  at <- function(start, time = 3) amiss:::segment_start(start, time, 1, NULL)
  expect_identical(at(5), 5)
  expect_identical(at(function(hours) 3600 * hours), 7200)
  midnight <- as.POSIXct("2024-03-01", tz = "UTC")
  expect_identical(
    at(function(time) as.numeric(difftime(time, midnight, units = "secs")), midnight + 7200), 3600)
  expect_error(at(function(time) "noon"), "returned \"noon\"", class = "amiss_error_input")
})

test_that("a record whose steps the FMU cannot take is refused", {
  own <- function(lines)
    sub("canHandleVariableCommunicationStepSize=\"true\"", "fixedInternalStepSize=\"900\"", lines)
  file <- house_file(3, own)
  simulator <- function(steps) house_fmu(file, steps_per_row = steps)
  expect_error(simulate_runs(simulator(5), cbind(R_out = 0.01), house_drivers(3), 1),
               "720 s.*own step, 900 s", class = "amiss_error_input")
  expect_true(all(is.finite(simulate_runs(simulator(4), cbind(R_out = 0.01), house_drivers(3), 1))))
})

test_that("runs in parallel are the same", {
  skip_on_cran()  # second tier: tools/test --quick
  skip_if_not_installed("future")
  house <- house_fmu(house_file())
  values <- cbind(R_out = seq(0.006, 0.018, length.out = 6))
  serial <- simulate_runs(house, values, house_drivers(), 1)
  withr::defer(future::plan(future::sequential))
  future::plan(future::multisession, workers = 2)
  expect_identical(simulate_runs(house, values, house_drivers(), 1), serial)
})

test_that("every type of variable arrives as it is", {
  for (version in 2:3) {
    file <- types_fmu(version)
    simulator <- fmu_simulator(file, free("real", uniform(0, 1)), output = "sum", inputs = "count",
                               averaged = FALSE,
                               fixed = list(whole = -7, flag = TRUE, text = "\u00e4bc", choice = 2))
    # The text counts its bytes, the flag 1000.
    expect_identical(simulate_runs(simulator, cbind(real = 0.25), cbind(count = c(10, 20)), 1)[, 1],
                     0.25 - 7 + 1000 + 4 + 2 + c(10, 20))
    expect_error(fmu_simulator(file, free("real", uniform(0, 1)), output = "sum",
                               fixed = list(whole = 1.5)),
                 "needs a whole number", class = "amiss_error_input")
  }
  sizes <- list(f32 = 0.5, i8 = -128, u8 = 255, i16 = -32768, u16 = 65535, u32 = 4294967295,
                i64 = -2^50, u64 = 2^50)
  simulator <- fmu_simulator(file, free("real", uniform(0, 1)), output = "sizes", averaged = FALSE,
                             fixed = sizes)
  expect_identical(simulate_runs(simulator, cbind(real = 0.25), matrix(0, 1, 0), 1)[1, 1],
                   sum(unlist(sizes)))
  bad <- fmu_simulator(file, free("real", uniform(0, 1)), output = "sizes", fixed = list(i8 = 128))
  expect_warning(simulate_runs(bad, cbind(real = 0.25), matrix(0, 1, 0), 1), "128.*whole numbers")
})
