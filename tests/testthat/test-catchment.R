# A program of another science with a measured record: a rainfall-runoff model in awk, and a
# mountain river.
skip_if_not_installed("airGR")
skip_if(Sys.which("awk") == "", "awk is not installed")

river_example <- function(cache = withr::local_tempdir(.local_envir = parent.frame())) {
  example <- new.env()
  source(system.file("examples", "catchment", "model.R", package = "amiss"), local = example)
  example$runoff$cache <- cache
  example
}

# Four years of the record: one to warm up, two to calibrate, one held out.
short_river <- function(example) {
  daily <- example$daily[example$daily$day < "2004-01-01", ]
  measurements(daily, time = "day", target = "flow", boundary = ~ rain + temperature + evaporation,
               noise_sd = 0.1, warmup = 24 * 366, calibrate = daily$day < "2003-01-01",
               validate = daily$day >= "2003-01-01")
}

# The logarithm of the flow that airGR simulates for one row of values, with CemaNeige's snow where
# they have some.
airgr_flow <- function(x, daily, least) {
  snow <- "melt" %in% names(x)
  model <- if (snow) airGR::RunModel_CemaNeigeGR4J else airGR::RunModel_GR4J
  inputs <- list(FUN_MOD = model, DatesR = as.POSIXlt(daily$day, tz = "UTC"), Precip = daily$rain,
                 PotEvap = daily$evaporation, verbose = FALSE)
  if (snow) inputs <- c(inputs, list(TempMean = daily$temperature, NLayers = 1))
  inputs <- do.call(airGR::CreateInputsModel, inputs)
  options <- list(FUN_MOD = model, InputsModel = inputs, IndPeriod_WarmUp = 0L,
                  IndPeriod_Run = seq_len(nrow(daily)), verbose = FALSE, warnings = FALSE)
  # It takes the snow that leaves no ground bare as 0.9 of the snow of a year, and 0.25 is the
  # memory in snow.awk.
  if (snow) options$MeanAnSolidPrecip <- x[["covered"]] / 0.9
  parameters <- c(x[c("production", "exchange", "routing", "lag")], if (snow) c(0.25, x[["melt"]]))
  log(pmax(model(inputs, do.call(airGR::CreateRunOptions, options), unname(parameters))$Qsim,
           least))
}

test_that("the model in awk is GR4J, and with its snow CemaNeige, as airGR has them", {
  example <- river_example()
  daily <- example$daily[1:900, ]
  drivers <- as.matrix(daily[c("rain", "evaporation", "temperature")])
  values <- cbind(production = c(350, 100, 1200, 60), exchange = c(-0.5, 1, -3, 0),
                  routing = c(90, 30, 200, 20), lag = c(1.7, 0.6, 4.3, 2), melt = c(3, 5, 1, 8),
                  covered = c(100, 300, 30, 200))
  agrees <- function(model) {
    x <- values[, names(free_parameters(model))]
    runs <- simulate_runs(model, x, drivers[, driver_names(model)], step_h = 24,
                          time = as.POSIXct(daily$day))
    expected <- apply(x, 1, airgr_flow, daily, example$least)
    expect_gt(min(expected), log(example$least))
    # of a logarithm; airGR's constant 0.9 has single precision
    expect_lt(max(abs(runs - expected)), 1e-5)
    runs
  }
  dry <- agrees(example$runoff)
  snowy <- agrees(example$ideas$snow$edit(example$runoff))
  expect_gt(max(abs(snowy - dry)), 1)
})

test_that("mechanisms of a river stack in any order", {
  example <- river_example()
  edits <- lapply(example$ideas, `[[`, "edit")
  drivers <- as.matrix(example$daily[1:400, c("rain", "evaporation", "temperature")])
  run <- function(order) {
    model <- Reduce(function(model, edit) edit(model), edits[order], example$runoff)
    values <- cbind(production = 350, exchange = -0.5, routing = 90, lag = 1.7, melt = 3,
                    covered = 100, catch = 1.2, demand = 0.8)
    simulate_runs(model, values, drivers[, driver_names(model)], step_h = 24)
  }
  stacked <- run(c("snow", "undercatch", "demand"))
  expect_equal(run(c("demand", "undercatch", "snow")), stacked)
  scaled <- drivers %*% diag(c(1.2, 0.8, 1))
  colnames(scaled) <- colnames(drivers)
  snowy <- edits$snow(example$runoff)
  values <- cbind(production = 350, exchange = -0.5, routing = 90, lag = 1.7, melt = 3,
                  covered = 100)
  expect_equal(simulate_runs(snowy, values, scaled[, driver_names(snowy)], step_h = 24), stacked)
})

# The model with a file that gains a line at each run.
counted_runs <- function(model, log) {
  with_template(
    model,
    list(gr4j.awk = function(lines) c(lines, sprintf("END { print \"ran\" >> \"%s\" }", log))))
}

test_that("failed runs of a river are told and tried again, the others are kept", {
  skip_on_cran()
  example <- river_example()
  log <- withr::local_tempfile()
  stuck <- "NR == 400 && lag > 4.5 { print \"the gate is stuck\" > \"/dev/stderr\"; exit 3 }"
  model <- with_template(counted_runs(example$runoff, log),
                         list(gr4j.awk = function(lines) c(lines, stuck)))
  river <- short_river(example)
  design <- function() simulate_design(model, river, runs = 30, seed = 1)
  expect_warning(expect_warning(made <- design(),
                                "of \"GR4J by awk\" failed.*exit status 3.*the gate is stuck"),
                 "left out")
  expect_gt(made$failed, 1)
  expect_lte(max(made$values[, "lag"]), 4.5)
  expect_length(readLines(log), 30)
  expect_identical(suppressWarnings(design())$outputs, made$outputs)
  expect_length(readLines(log), 30 + made$failed)
})

test_that("snow is decisive on the mountain, and data held out gain by it", {
  skip_on_cran()
  example <- river_example()
  river <- short_river(example)
  log <- withr::local_tempfile()
  # Two parameters are held and the others lie near, so that few runs suffice.
  held <- function(lines)
    sub("{{exchange}}", "-0.5", sub("{{lag}}", "1.5", lines, fixed = TRUE), fixed = TRUE)
  templates <- example$runoff$templates
  templates$gr4j.awk <- held(templates$gr4j.awk)
  dry <- program_simulator(example$runoff$command, free("production", lognormal(7.5, 0.3), "mm"),
                           free("routing", lognormal(5.2, 0.15), "mm"),
                           templates = lapply(templates, I), output = example$runoff$output,
                           boundary = example$runoff$boundary, cache = example$runoff$cache)
  dry <- counted_runs(dry, log)
  snowy <- with_template(dry, c(ground.awk = example$script("snow.awk")),
                         free("melt", uniform(3, 7), "mm/(K d)"),
                         free("covered", lognormal(6.3, 0.2), "mm"), boundary = "temperature")
  quick <- list(calibration = list(check = 8, ais = list(pilot_chains = 48, groups = 4)))
  calibrated <- function(model) {
    runs <- simulate_design(model, river, runs = 40, seed = 1)
    calibrate_refined(runs, river, rounds = 1, runs = 20, control = quick, seed = 1, quiet = TRUE)
  }
  held_out_error <- function(fit) {
    seen <- predict(fit, use = "validate", draws = 10)
    sqrt(mean((seen$observed - seen$mean)^2))
  }
  without <- calibrated(dry)
  with_snow <- calibrated(snowy)
  factor <- bayes_factor(with_snow, without)
  expect_gt(factor$lower95, 10)
  error <- held_out_error(with_snow)
  expect_lt(error, 0.8 * held_out_error(without))  # 0.52 and 0.90 were measured

  made <- length(readLines(log))
  simulate_design(snowy, river, runs = 40, seed = 1)
  expect_identical(held_out_error(with_snow), error)
  expect_length(readLines(log), made)
})

test_that("the loop names the snow of a mountain, and measures the gain", {
  skip_if_not(identical(Sys.getenv("AMISS_EXTENDED_TESTS"), "true"),
              "the long forms (AMISS_EXTENDED_TESTS)")
  if (.Platform$OS.type == "unix") {
    future::plan("multicore", workers = 2)
    withr::defer(future::plan("sequential"))
  }
  example <- new.env()
  loop <- system.file("examples", "catchment", "river.R", package = "amiss")
  utils::capture.output(suppressMessages(source(loop, local = example)))
  upgrade <- example$upgrade
  expect_equal(upgrade$models[[2]]$mechanism, "snow")
  expect_gt(upgrade$candidates$log10_bf[upgrade$candidates$mechanism == "snow"], 10)
  expect_lt(upgrade$gain$rmse_validation[2], 0.7 * upgrade$gain$rmse_validation[1])
})
