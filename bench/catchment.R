#!/usr/bin/env Rscript
# The loop on measured rivers: a rainfall-runoff model without snow (GR4J) on two catchments of the
# package airGR, a mountain whose winters store snow and a valley with little of it. Nothing is
# hidden by anybody; that snow matters on the mountain, and how much, is what hydrologists know.
# Usage: Rscript bench/catchment.R [--catchments L0123002,L0123001] [--from 2001] [--seed 1]
#                                  [--runs 150] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
source(file.path(here, "sciences", "common.R"))
chosen <- strsplit(option("catchments", "L0123002,L0123001", "L0123002"), ",")[[1]]
from <- as.integer(option("from", 2001))
seed <- as.numeric(option("seed", 1))
runs <- as.integer(option("runs", 150, 40))
quick <- if (smoke) list(max_steps = 1, rounds = 1,
                         calibration = list(ais = list(pilot_chains = 48, groups = 4)),
                         attribution = list(surrogates = 19))

years <- c(warmup = 1, calibrate = 3, validate = 2)
noise <- 0.1  # of the logarithm: a rating curve knows a river to about ten per cent
least <- 0.01  # mm/d, so that a dry river has a logarithm

# GR4J, or GR4J below the snow of CemaNeige, driven by rows of precipitation, evaporation and
# temperature. airGR wants dates; of the record's own it needs the season, which snow alone looks
# at.
runoff <- function(drivers, time, basin, parameters, snow = NULL) {
  days <- as.POSIXct(time, origin = "1970-01-01", tz = "UTC")
  model <- if (is.null(snow)) airGR::RunModel_GR4J else airGR::RunModel_CemaNeigeGR4J
  inputs <- list(FUN_MOD = model, DatesR = days, Precip = drivers[, "rain"],
                 PotEvap = drivers[, "evaporation"])
  if (!is.null(snow)) {
    inputs <- c(inputs,
                list(TempMean = drivers[, "temperature"], ZInputs = stats::median(basin$HypsoData),
                     HypsoData = basin$HypsoData, NLayers = 5))
  }
  inputs <- do.call(airGR::CreateInputsModel, c(inputs, list(verbose = FALSE)))
  options <- airGR::CreateRunOptions(FUN_MOD = model, InputsModel = inputs, IndPeriod_WarmUp = 0L,
                                     IndPeriod_Run = seq_along(days), verbose = FALSE,
                                     warnings = FALSE)
  model(inputs, options, c(parameters, snow))$Qsim
}

draw_catchment <- function(code) {
  scope <- new.env()
  utils::data(list = code, package = "airGR", envir = scope)
  basin <- scope$BasinInfo
  year <- as.integer(format(scope$BasinObs$DatesR, "%Y", tz = "UTC"))
  first <- from - years[["warmup"]]
  kept <- year >= first & year < first + sum(years)
  observed <- scope$BasinObs[kept, ]
  year <- year[kept]
  table <- data.frame(day = observed$DatesR, flow = log(pmax(observed$Qmm, least)),
                      rain = observed$P, temperature = observed$T, evaporation = observed$E)
  warm <- year < from
  until <- from + years[["calibrate"]]
  measured <- measurements(table, time = "day", target = "flow",
                           boundary = ~ rain + temperature + evaporation, noise_sd = noise,
                           unit = "ln(mm/d)", name = basin$BasinName, warmup = 24 * sum(warm),
                           calibrate = !warm & year < until, validate = year >= until)
  list(base = gr4j(basin), measurements = measured, catalogue = river_mechanisms())
}

gr4j <- function(basin) {
  flow <- function(values, drivers, info) {
    drivers[, "rain"] <- drivers[, "rain"] * term(info, "catch", 1, 1)
    drivers[, "evaporation"] <- drivers[, "evaporation"] * term(info, "demand", 1, 1)
    parameters <- c(exp(values[["production"]]), values[["exchange"]], exp(values[["routing"]]),
                    values[["lag"]])
    flow <- runoff(cbind(drivers, temperature = info$temperature), info$time, basin, parameters,
                   info$snow)
    log(pmax(flow - term(info, "abstraction", 0, 1), least))
  }
  function_simulator(flow, free("production", normal(5.9, 0.8), "ln mm", "production store"),
                     free("exchange", normal(0, 1.5), "mm/d", "groundwater exchange"),
                     free("routing", normal(4.5, 0.7), "ln mm", "routing store"),
                     free("lag", uniform(0.6, 5), "d", "time base of the unit hydrograph"),
                     boundary = c("rain", "evaporation"), name = "GR4J")
}

river_mechanisms <- function() {
  snow <- mechanism("snow", boundary = c("rain", "temperature"),
                    sentence = "Precipitation waits as snow and melts.", edit = function(model) {
    with_parameters(model, free("cold", uniform(0, 1), "", "memory of the snow's cold"),
                    free("melt", uniform(0.5, 10), "mm/(K d)", "melt"), boundary = "temperature",
                    f = function(values, drivers, info, base) {
      info$temperature <- drivers[, "temperature"]
      info$snow <- c(values[["cold"]], values[["melt"]])
      base(values, info = info)
    })
  })
  catalogue(
    snow,
    new_mechanism("undercatch", "rain", "Gauges catch less than falls, or more.",
                  free("catch", uniform(0.7, 1.6), "", "rain over what was caught"),
                  function(values, drivers, info, base) {
      base(values, info = scaled(info, "catch", values[["catch"]]))
    }),
    new_mechanism("evaporative demand", "evaporation",
                  "Plants need more water than the formula says, or less.",
                  free("demand", uniform(0.5, 1.6), "", "demand over the formula's"),
                  function(values, drivers, info, base) {
      base(values, info = scaled(info, "demand", values[["demand"]]))
    }),
    new_mechanism("abstraction", character(), "A steady flow is taken from the river.",
                  free("taken", uniform(0, 0.3), "mm/d", "flow taken"),
                  function(values, drivers, info, base) {
      base(values, info = added(info, "abstraction", values[["taken"]]))
    }),
    new_mechanism("gauge offset", character(), "The rating curve is off by a factor.",
                  free("offset", normal(0, 0.2), "", "offset of the logarithm"),
                  function(values, drivers, info, base)
                    base(values, info = info) + values[["offset"]]))
}

score_catchment <- function(code) {
  record <- draw_catchment(code)
  started <- proc.time()[["elapsed"]]
  upgrade <- upgrade_model(record$base, record$measurements, record$catalogue, control = quick,
                           seed = seed, quiet = TRUE)
  listed <- function(x) if (length(x)) paste(x, collapse = ", ") else "nothing"
  answers <- upgrade$models[[1]]$attribution$table
  told <- summary(upgrade)
  print(told)
  rmse <- function(use) vapply(upgrade$models, function(m) m$scores[[use]][["rmse"]], 0)
  data.frame(catchment = code, river = record$measurements$name, from = from,
             adopted = listed(vapply(upgrade$models[-1],
                                     function(m) sprintf("%s (%s)", m$mechanism, m$verdict), "")),
             log10_bf = upgrade$gain$log10_bf,
             answers_to = listed(answers$boundary[answers$significant]), verdict = told$verdict,
             rmse_calibration = listed(signif(rmse("calibrate"), 3)),
             rmse_held_out = listed(signif(rmse("validate"), 3)), noise = noise,
             emulator = upgrade$models[[length(upgrade$models)]]$fit$check$ratio,
             runs = upgrade$runs_total, seconds = proc.time()[["elapsed"]] - started)
}
rows <- do.call(rbind, lapply(chosen, score_catchment))
print(rows, digits = 3)
write_rows(rows, option("out", "catchment.json"))
