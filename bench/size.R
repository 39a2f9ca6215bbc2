#!/usr/bin/env Rscript
# How large a record can be.
# Usage: Rscript bench/size.R --out FILE [--only quarters,minutes]
#
# A year of 15-minute steps (35,040) and one of minutes (525,600), 100 runs each, from the
# measurements to the attribution, each in an R session of its own with one thread. FILE gets a row
# for each stage and their sum: seconds, and the most memory that the session had held by its end
# (MB, resident). Required: a year of minutes below 4 GB and ten minutes, one of 15-minute steps
# below 500 MB and one minute.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
records <- list(quarters = list(steps = 35040, step_h = 0.25, gb = 0.5, minutes = 1),
                minutes = list(steps = 525600, step_h = 1 / 60, gb = 4, minutes = 10))
only <- strsplit(option("only", "quarters,minutes", smallest = "quarters"), ",")[[1]]
runs <- as.integer(option("runs", "100", smallest = "20"))

# Evaluated in a session of its own, which does not hold what another has freed.
whole_line <- function(steps, step_h, runs) {
  suppressPackageStartupMessages(library(amiss))
  rows <- list()
  stage <- function(name, code) {
    seconds <- system.time(value <- code)[["elapsed"]]
    status <- grep("^VmHWM", readLines("/proc/self/status"), value = TRUE)
    rows[[name]] <<- data.frame(stage = name, seconds,
                                peak_mb = as.numeric(gsub("[^0-9]", "", status)) / 1024)
    value
  }
  slow <- function(x, hours) {
    kept <- exp(-step_h / hours)
    as.numeric(stats::filter(x * (1 - kept), kept, "recursive", init = x[1]))
  }
  set.seed(1)
  hour <- step_h * seq_len(steps)
  data <- data.frame(
    hour, Te = 8 + 5 * sin(2 * pi * hour / 24) + 8 * sin(2 * pi * hour / 8760) +
               slow(stats::rnorm(steps, 0, 20), 24),
    Gv = pmax(0, sin(2 * pi * (hour - 6) / 24)) * (300 + 150 * sin(2 * pi * hour / 53)))
  run <- function(values, drivers) 20 + values[["gain"]] * slow(drivers[, "Te"], values[["hours"]])
  data$Ti <- run(c(gain = 0.4, hours = 6), as.matrix(data)) + 0.002 * slow(data$Gv, 3) +
    stats::rnorm(steps, 0, 0.1)
  simulator <- function_simulator(run, free("gain", uniform(0, 1)), free("hours", uniform(2, 12)),
                                  boundary = "Te")
  set <- stage("measurements", measurements(data, time = "hour", target = "Ti",
                                            boundary = ~ Te + Gv, noise_sd = 0.1))
  made <- stage("simulate_design", simulate_design(simulator, set, runs = runs, seed = 1))
  emulator <- stage("train_emulator", train_emulator(made, set))
  fit <- stage("calibrate", calibrate(emulator, set, seed = 1))
  found <- stage("attribute_discrepancy", attribute_discrepancy(fit, seed = 1))
  rows <- do.call(rbind, c(rows, list(make.row.names = FALSE)))
  rbind(rows, data.frame(stage = "all", seconds = sum(rows$seconds), peak_mb = max(rows$peak_mb)))
}

rows <- do.call(rbind, lapply(only, function(name) {
  record <- records[[name]]
  steps <- if (smoke) 2000 else record$steps
  own <- callr::r(whole_line, list(steps, record$step_h, runs), show = TRUE)
  total <- own$stage == "all"
  own$required_s <- ifelse(total, 60 * record$minutes, NA)
  own$required_mb <- ifelse(total, 1000 * record$gb, NA)
  own$holds <- own$seconds <= own$required_s & own$peak_mb <= own$required_mb
  cbind(record = name, steps, runs, own)
}))
print(rows, digits = 4, row.names = FALSE)
write_rows(rows, option("out", "size.json"))
