#!/usr/bin/env Rscript
# Do 95 % intervals hold the truth if nothing is wrong but the sensor, whose error wanders? Two
# simulators (a reservoir, a heat pump), hourly records of 480 values made by the simulator itself,
# with an error that keeps `phi` of itself in an hour. A line for each simulator and phi: the share
# of intervals that hold the truth, their mean half width over 1.96 standard deviations of the
# estimates, and how many results were trusted.
# Usage: Rscript bench/slow_noise.R [--records 20] [--seed 1] [--times 2,32] [--workers 1]
#        [--out FILE]
# `times`: time constants of the error in steps, instead of the default.
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
records <- as.integer(option("records", "20", smallest = "2"))
first <- as.integer(option("seed", "1"))
workers <- as.integer(option("workers", "1"))
times <- option("times", "")
error <- if (nzchar(times)) list(error_times = as.numeric(strsplit(times, ",")[[1]])) else list()

wandering <- function(n, sd, keep) {
  jumps <- stats::rnorm(n, 0, sd * c(1, rep(sqrt(1 - keep^2), n - 1)))
  as.numeric(stats::filter(jumps, keep, "recursive"))
}

n <- 480
weather <- function() {
  hour <- seq_len(n)
  outdoor <- 2 + wandering(n, 4, 0.985) + 3 * sin(2 * pi * (hour - 9) / 24)
  data.frame(hour, outdoor, load = pmax(2, 6.5 - 0.22 * outdoor + wandering(n, 0.6, 0.8)),
             supply = 38 - 0.5 * outdoor + ifelse(hour %% 24 %in% c(5, 6, 18), 12, 0),
             rain = stats::rgamma(n, 0.2, 0.5))
}

cases <- list(
  reservoir = list(
    truth = c(store = 30, share = 0.6, second = 5), noise_sd = 0.05,
    simulator = function_simulator(function(values, drivers) {
      fast <- stats::filter(drivers[, "rain"] / values[["second"]],
                            exp(-1 / values[["second"]]), "recursive")
      slow <- stats::filter(drivers[, "rain"] / values[["store"]],
                            exp(-1 / values[["store"]]), "recursive")
      as.numeric(values[["share"]] * slow + (1 - values[["share"]]) * fast)
    }, free("store", uniform(10, 200)), free("share", uniform(0, 1)),
    free("second", uniform(1, 10)), boundary = "rain")),
  "heat pump" = list(
    truth = c(efficiency = 0.46, evaporator = 4.5, condenser = 3.2), noise_sd = 25,
    simulator = function_simulator(function(values, drivers) {
      load <- drivers[, "load"]
      cold <- drivers[, "outdoor"] - values[["evaporator"]] * load / 6
      warm <- drivers[, "supply"] + values[["condenser"]]
      1000 * load * (warm - cold) / (values[["efficiency"]] * (warm + 273.15))
    }, free("efficiency", uniform(0.3, 0.6)), free("evaporator", uniform(1, 10)),
    free("condenser", uniform(1, 8)), boundary = c("outdoor", "load", "supply"))))

one_record <- function(name, phi, seed) {
  case <- cases[[name]]
  set.seed(seed)
  data <- weather()
  values <- matrix(case$truth, 1, dimnames = list(NULL, names(case$truth)))
  drivers <- as.matrix(data[, -1])
  data$y <- simulate_runs(case$simulator, values, drivers, step_h = 1)[, 1] +
    wandering(n, case$noise_sd, phi)
  record <- measurements(data, time = "hour", target = "y",
                         boundary = ~ outdoor + load + supply + rain, noise_sd = case$noise_sd)
  scouts <- simulate_design(case$simulator, record, runs = 8, seed = seed)
  fit <- suppressWarnings(calibrate_refined(scouts, record, control = list(calibration = error),
                                            seed = seed))
  ends <- confint(fit, names(case$truth))
  data.frame(simulator = name, phi, seed, term = names(case$truth),
             off = coef(fit)[names(case$truth)] - case$truth,
             half_width = (ends[, 2] - ends[, 1]) / 2, trusted = fit$trust$trusted,
             inside = case$truth >= ends[, 1] & case$truth <= ends[, 2])
}

jobs <- expand.grid(seed = first + seq_len(records) - 1L, phi = c(0, 0.6, 0.9, 0.97, 0.99),
                    simulator = names(cases), stringsAsFactors = FALSE)
rows <- do.call(rbind, parallel::mclapply(seq_len(nrow(jobs)), function(k) {
  one_record(jobs$simulator[k], jobs$phi[k], jobs$seed[k])
}, mc.cores = workers))
for (part in split(rows, list(rows$phi, rows$simulator))) {
  sds <- tapply(part$off, part$term, stats::sd)
  cat(sprintf("%-10s phi %.2f: inside %.2f, width %.2f of the spread, trusted %d of %d\n",
              part$simulator[1], part$phi[1], mean(part$inside),
              mean(tapply(part$half_width, part$term, mean) / (1.96 * sds)),
              sum(part$trusted) / length(sds), records))
}
write_rows(rows, option("out", "slow_noise.json"))
