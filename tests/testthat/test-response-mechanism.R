# The room of helper-upgrade.R, whose sun the given runs know nothing of: its gain is 0.006 K m2/W,
# its lag 3 h.
room_data <- small_record()
room <- measurements(room_data, time = "time", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.05,
                     unit = "K", calibrate = 1:240 <= 168, validate = 1:240 > 168, warmup = 12)
room_parameters <- list(free("offset", uniform(10, 20), "K"), free("gain", uniform(0, 2)))
room_design <- amiss:::unit_to_values(withr::with_seed(2, lhs::randomLHS(60, 2)),
                                      amiss:::named_parameters(room_parameters))
room_runs <- sweep(tcrossprod(lagged(room_data$Te, 6), room_design[, "gain"]), 2,
                   room_design[, "offset"], "+")
given <- ensemble(room_design, room_runs, room_parameters, measurements = room)
room_model <- function_simulator(function(values, drivers) values[["offset"]] +
                                 values[["gain"]] * lagged(drivers[, "Te"], 6),
                                 room_parameters[[1]], room_parameters[[2]], boundary = "Te")
sun <- response_mechanism("Gv", room, unit = "W/m2")

test_that("a response is the gain times the condition behind a low-pass", {
  step <- cbind(Te = rep(0, 20), Gv = c(0, rep(100, 19)))
  values <- cbind(offset = 15, gain = 0, gain_Gv = c(0.01, -0.02), time_constant_Gv = c(3, 6))
  runs <- simulate_runs(sun$edit(room_model), values, step, step_h = 0.5)
  risen <- function(gain, hours) 15 + 100 * gain * (1 - exp(-0.5 * 0:19 / hours))
  expect_equal(runs, cbind(risen(0.01, 3), risen(-0.02, 6)), tolerance = 1e-12)
})

test_that("given runs with a response are those that the simulator with it would give", {
  for (average in list(NULL, 2)) {
    rows <- setdiff(1:240, 100)
    m <- suppressMessages(measurements(room_data[rows, ], time = "time", target = "Ti",
                                       boundary = ~ Te + Gv, noise_sd = 0.05, average = average,
                                       calibrate = rows <= 168, validate = rows > 168, warmup = 12))
    base <- simulate_design(room_model, m, runs = 20, seed = 1)
    runs <- amiss:::simulate_measured(room_model, base$values, m, c("calibrate", "validate"), 1)
    entry <- response_mechanism("Gv", m)
    with_sun <- entry$edit(ensemble(base$values, runs, room_parameters, measurements = m))
    expect_named(with_sun$parameters, c("offset", "gain", "gain_Gv", "time_constant_Gv"))
    made <- function(use)
      amiss:::simulate_measured(entry$edit(room_model), with_sun$values, m, use, 1)
    expect_equal(with_sun$outputs, made("calibrate"), tolerance = 1e-12)
    expect_equal(with_sun$held_out$outputs, made("validate"), tolerance = 1e-12)
  }
})

test_that("the priors have the scale of the record", {
  rows <- 13:168
  gain <- sun$response$parameters$gain_Gv
  largest <- 2 * sd(room_data$Ti[rows]) / sd(room_data$Gv[rows])
  expect_equal(gain$prior, uniform(-largest, largest))
  expect_equal(gain$unit, "K per W/m2")
  lag <- sun$response$parameters$time_constant_Gv$prior
  expect_equal(c(lag$lower, lag$upper), c(0.25, 156 / 6))
  middle <- exp(mean(log(c(0.25, 156 / 6))))
  expect_equal(amiss:::prior_cdf(lag, middle), 0.5)
  expect_equal(amiss:::prior_cdf(lag, sqrt(0.25 * middle)), 0.25, tolerance = 1e-3)
  expect_equal(sun$response$reference, 0)  # the sun is off at night
  expect_equal(response_mechanism("Te", room)$response$reference, mean(room_data$Te[rows]))
  expect_equal(response_mechanism("Te", room, reference = 18)$response$reference, 18)
  narrow <- response_mechanism("Gv", room, gain = uniform(0, 1),
                               time_constant = uniform(2, 5))$response$parameters
  expect_equal(unname(lapply(narrow, `[[`, "prior")), list(uniform(0, 1), uniform(2, 5)))
})

test_that("a circular condition acts by its sine and its cosine", {
  data <- room_data
  data$Wd <- (1:240 * 37) %% 360
  m <- measurements(data, time = "time", target = "Ti", boundary = ~ Te + circular(Wd),
                    noise_sd = 0.05)
  wind <- response_mechanism("Wd", m, time_constant = uniform(1, 2))
  model <- wind$edit(room_model)
  values <- cbind(offset = 0, gain = 0, gain_sine_of_Wd = 2, gain_cosine_of_Wd = 3,
                  time_constant_Wd = 1e-9)
  drivers <- cbind(Te = 0, Wd = c(10, 100, 350))
  at <- drivers[, "Wd"] * pi / 180
  reference <- c(mean(sin(data$Wd * pi / 180)), mean(cos(data$Wd * pi / 180)))
  expect_equal(simulate_runs(model, values, drivers, step_h = 1)[, 1],
               2 * (sin(at) - reference[1]) + 3 * (cos(at) - reference[2]))
  expect_named(responses(m), c("response to Te", "response to Wd"))
})

test_that("responses stack with other edits of any simulator, in any order", {
  Te <- response_mechanism("Te", room)
  both <- function(model, other) {
    expect_setequal(names(free_parameters(sun$edit(other(model)))),
                    names(free_parameters(other(sun$edit(model)))))
    drivers <- cbind(Te = 5 + sin(1:30), Gv = 100 * cos(1:30)^2, P = 50)
    values <- t(vapply(free_parameters(sun$edit(other(model))),
                       function(p) amiss:::prior_quantile(p$prior, 0.6), 0))
    expect_equal(simulate_runs(sun$edit(other(model)), values, drivers, step_h = 1),
                 simulate_runs(other(sun$edit(model)), values, drivers, step_h = 1))
    plain <- simulate_runs(other(model), values, drivers, step_h = 1)
    added <- amiss:::response_runs(sun$response, drivers[, "Gv"], 1:30, 1:30 == 1, values)
    expect_equal(simulate_runs(sun$edit(other(model)), values, drivers, step_h = 1), plain + added)
  }
  more <- function(values, drivers, base) base(values) + values[["more"]]
  both(room_model, function(model) with_parameters(model, free("more", uniform(0, 1)), f = more))
  both(room_model, Te$edit)
  box <- zone(zone_wall("wall", 10, zone_layer(0.1, 1, 1e6), outside = "Te"),
              zone_heater("heater", "P"),
              zone_infiltration("leak", free("ach", uniform(0, 1)), "Te"), volume = 30)
  both(box,
       function(model)
         add_component(model, zone_coupling("door", free("door", uniform(0, 10)), "Te")))
  skip_if(Sys.which("awk") == "")
  line <- "BEGIN { FS = \",\"; print \"Ti\" } NR > 1 { print {{a}} * $3 }"
  program <- program_simulator(c("awk", "-f", "model.awk", "drivers.csv"), free("a", uniform(0, 2)),
                               boundary = "Te", templates = list(model.awk = I(line)),
                               cache = withr::local_tempdir(),
                               output = c(file = "stdout.txt", column = "Ti"))
  both(program, function(model) {
    with_template(
      model, list(model.awk = function(lines) sub("* $3", "* $3 + {{b}}", lines, fixed = TRUE)),
      free("b", uniform(0, 1)))
  })
  expect_match(printed(sun$edit(program)),
               "program.*response to Gv, which describes and does not explain")
})

test_that("a response is refused where it cannot be added", {
  expect_error(sun$edit(sun$edit(given)), "gain_Gv.*already", class = "amiss_error_input")
  other <- measurements(room_data, time = "time", target = "Ti", boundary = ~ Te + Gv,
                        noise_sd = 0.05, warmup = 20)
  expect_error(response_mechanism("Gv", other)$edit(given), "other rows",
               class = "amiss_error_input")
  expect_error(response_mechanism("steady",
                                  measurements(cbind(room_data, steady = 1), time = "time",
                                               target = "Ti", boundary = ~Te, noise_sd = 0.05)),
               "does not vary", class = "amiss_error_input")
})

skip_on_cran()  # second tier: tools/test --quick

described <- function() {
  control <- list(calibration = quick_ais, attribution = list(surrogates = 19), max_steps = 1)
  upgrade_model(given, room, responses(room, c(Gv = "W/m2")), control = control, seed = 1,
                quiet = TRUE)
}

test_that(paste("the loop extends given runs by the response that lacks, measures it and says that",
                "it describes"), {
  upgrade <- described()
  expect_equal(upgrade$models[[2]]$mechanism, "response to Gv")
  expect_equal(upgrade$runs_total, 0)
  expect_lt(upgrade$gain$rmse_validation[2], 0.2 * upgrade$gain$rmse_validation[1])
  found <- coef(upgrade)
  expect_equal(found[["gain_Gv"]], 0.006, tolerance = 0.1)
  expect_equal(found[["time_constant_Gv"]], 3, tolerance = 0.15)
  # No cause is named by it, whatever the evidence.
  expect_equal(upgrade$models[[2]]$verdict, "likely")
  expect_null(upgrade$named_cause)
  told <- summary(upgrade)
  expect_equal(told$tag, "Described, not explained")
  sentence <- paste(
    "describes and does not explain: Ti responds to Gv with a gain of 0.006.* K per W/m\u00b2",
    ".*time constant of .* h .*store")
  expect_match(paste(told$change, collapse = " "), sentence)
  expect_match(told$mechanisms[[1]]$sentence, sentence)
  expect_match(printed(upgrade), "describes and does not explain")
  expect_match(paste(told$inspect, collapse = " "), "Look for what lets Gv act on Ti")
})

test_that("a study of given runs and responses runs from its file", {
  folder <- withr::local_tempdir()
  write <- function(x, name) utils::write.csv(x, file.path(folder, name), row.names = FALSE)
  table <- room_data
  table$time <- format(table$time, "%Y-%m-%dT%H:%M:%SZ")
  table$hour <- 1:240
  write(table, "record.csv")
  write(room_design, "design.csv")
  write(room_runs, "runs.csv")
  writeLines(c(
    "function(measurements) {",
    "  ensemble(read.csv(\"design.csv\"), read.csv(\"runs.csv\"), measurements = measurements,",
    paste("           parameters = list(free(\"offset\", uniform(10, 20)),",
          "free(\"gain\", uniform(0, 2))))"),
    "}"), file.path(folder, "model.R"))
  writeLines("responses", file.path(folder, "catalogue.R"))
  writeLines(c("study: given", "data: record.csv", "time: time", "target: Ti", "unit: K",
               "boundary: [Te, Gv]", "noise_sd: 0.05", "calibrate: hour <= 168",
               "validate: hour > 168", "warmup_h: 12", "model: model.R", "catalogue: catalogue.R",
               "seed: 1", "control:", "  max_steps: 1", "  attribution: {surrogates: 19}",
               "  calibration: {ais: {pilot_chains: 48, groups: 4, chains: 24, sweeps: 3}}"),
             file.path(folder, "study.yml"))
  out <- file.path(folder, "out")
  expect_equal(amiss:::run_command(c("run", file.path(folder, "study.yml"), "--out", out, "--trust",
                                     "--quiet")), 0)
  result <- jsonlite::read_json(file.path(out, "result.json"))
  expect_equal(result$models[[2]]$mechanism, "response to Gv")
  page <- paste(readLines(file.path(out, "report.html"), warn = FALSE), collapse = " ")
  expect_on_page(page, "describes and does not explain")
})
