#!/usr/bin/env Rscript
# A year of 15-minute data (35,040 rows) of a house, from the record to the verdict: a network of
# three nodes, truth on a grid five times as fine with sun on the air, which the model leaves out,
# and a catalogue of five mechanisms. Seconds by the clock, and the most memory that a session of
# its own held. Required: two minutes, 1 GB.
# Usage: Rscript bench/year.R [--days 365] [--averages 0.25,1] [--threads 2] [--seed 1] [--out FILE]
# Averages of the target in hours; an average of a quarter of an hour is the reading itself.
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
days <- as.integer(option("days", "365", smallest = "10"))
averages <- as.numeric(strsplit(option("averages", "0.25,1", smallest = "1"), ",")[[1]])
threads <- as.integer(option("threads", "2"))
seed <- as.integer(option("seed", "1"))

# Evaluated in a session of its own, which holds nothing else.
whole_year <- function(here, days, average, threads, seed) {
  suppressPackageStartupMessages(library(amiss))
  source(file.path(here, "options.R"))
  scope <- worlds_scope(here)
  set.seed(seed)
  step <- 0.25
  fine <- 5L
  weather <- scope$draw_network_weather(days, step, fine)
  described <- scope$with_past(scope$base_network("lined wall"), 20,
                               mean(weather[seq_len(24 * fine / step), "Te"]))
  base <- scope$network_simulator(described, step)
  values <- amiss:::unit_to_values(t(scope$true_unit(free_parameters(base))),
                                   free_parameters(base))[1, ]
  weather[, "P"] <- weather[, "P"] * 20 / scope$lift_per_kw(described, values)
  real <- scope$network_with(base, "solar gain on the air")
  truth <- scope$network_output(scope$network_plan(real$network), c(values, A_window = 1), weather,
                                step / fine)
  drivers <- scope$block_means(weather, fine)
  data <- data.frame(hour = seq_len(nrow(drivers)) * step, drivers,
                     Ti = scope$block_means(truth, fine) + stats::rnorm(nrow(drivers), 0, 0.1))
  seconds <- system.time({
    house <- measurements(data, time = "hour", target = "Ti", unit = "K",
                          boundary = scope$network_conditions, average = average,
                          noise_sd = 0.1 * sqrt(step / average), warmup = 48,
                          validate = data$hour > 0.8 * 24 * days)
    upgrade <- upgrade_model(base, house, scope$network_catalogue(), seed = seed,
                             threads = threads)
    words <- summary(upgrade)
  })[["elapsed"]]
  status <- grep("^VmHWM", readLines("/proc/self/status"), value = TRUE)
  adopted <- vapply(upgrade$models[-1], `[[`, "", "mechanism")
  verdicts <- vapply(upgrade$models[-1], `[[`, "", "verdict")
  data.frame(rows = nrow(data), average_h = average, threads, seconds,
             peak_mb = as.numeric(gsub("[^0-9]", "", status)) / 1024, runs = upgrade$runs_total,
             adopted = paste0(adopted, " (", verdicts, ")", collapse = ", "))
}
rows <- do.call(rbind, lapply(averages, function(average) {
  callr::r(whole_year, list(normalizePath(here), days, average, threads, seed), show = TRUE)
}))
rows$holds <- rows$seconds <= 120 & rows$peak_mb <= 1000
print(rows, row.names = FALSE)
write_rows(rows, option("out", "year.json"))
