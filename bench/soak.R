#!/usr/bin/env Rscript
# Does it last?
# Usage: Rscript bench/soak.R --out FILE [--studies 200] [--seed 1]
#
# Random small studies one after the other in one R session, some of them with nothing to find in
# them or with data that have to be refused: records with gaps, lost values, copied and constant
# conditions, targets of any unit, simulators that fail or know nothing. FILE gets a row for each
# study: seconds, resident memory after it (MB), what came of it, and the class of the condition
# that ended it. It holds if every condition is one of the package's own (class `amiss_error`) and
# the memory of the last quarter is within 5 % of that of the second.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
studies <- as.integer(option("studies", "200", smallest = "4"))
first <- as.integer(option("seed", "1"))
out <- option("out", "soak.json")

chance <- function(share) stats::runif(1) < share
one_of <- function(...) sample(c(...), 1)
slow <- function(x, hours) {
  as.numeric(stats::filter(x * (1 - exp(-1 / hours)), exp(-1 / hours), "recursive", init = x[1]))
}

random_record <- function(scale) {
  n <- sample(30:240, 1)
  hour <- seq_len(n)
  data <- data.frame(hour, Te = 8 + 5 * sin(2 * pi * hour / 24) + slow(stats::rnorm(n, 0, 3), 5),
                     Gv = pmax(0, sin(2 * pi * (hour - 6) / 24)) * stats::runif(n, 50, 500),
                     Wd = stats::runif(1, 0, 360) + 30 * slow(stats::rnorm(n), 10))
  noise <- one_of(1e-6, 0.01, 0.1, 1)
  data$Ti <- scale * (20 + stats::runif(1) * slow(data$Te, 4) +
                      one_of(0, 0.002, 0.01) * slow(data$Gv, 2) + stats::rnorm(n, 0, noise))
  if (chance(0.1)) data$Ti <- scale * stats::rnorm(n)
  if (chance(0.05)) data$Ti <- scale
  if (chance(0.2)) data$Gv <- data$Te * one_of(1, 2) + one_of(0, 0.1) * stats::rnorm(n)
  if (chance(0.1)) data$Gv <- 0
  if (chance(0.2)) data$Ti[sample(n, sample(n, 1) %/% 4)] <- NA
  if (chance(0.1)) data$Te[sample(n, 1)] <- NA
  if (chance(0.2)) data <- data[-sample(n, sample(5, 1)), ]
  list(data = data, noise_sd = scale * noise * one_of(0.1, 1, 1, 1, 10))
}

random_simulator <- function(scale) {
  fails <- one_of("never", "never", "never", "sometimes", "always", "stops")
  knows <- one_of("gain", "gain", "gain", "step", "nothing")
  function_simulator(function(values, drivers) {
    if (fails == "stops" && values[["gain"]] > 0.5) stop("did not converge")
    if (fails == "always" || fails == "sometimes" && values[["gain"]] > 0.9)
      return(rep(NaN, nrow(drivers)))
    gain <- switch(knows, gain = values[["gain"]], step = values[["gain"]] > 0.5, nothing = 0)
    values[["offset"]] + scale * gain * slow(drivers[, "Te"], 4)
  }, free("offset", uniform(10 * scale, 30 * scale)), free("gain", uniform(0, 1)), boundary = "Te")
}

sun <- function(scale)
  mechanism("sun", boundary = "Gv", sentence = "The sun shines in.", edit = function(model) {
    with_parameters(model, free("sun", uniform(0, 0.02)), boundary = "Gv",
                    f = function(values, drivers, base) {
      base(values) + scale * values[["sun"]] * slow(drivers[, "Gv"], 2)
    })
  })

quick <- list(pilot_chains = 24, groups = 4, chains = 8, importance_draws = 200)

random_study <- function() {
  scale <- one_of(1, 1, 1e-6, 1e6)
  record <- random_record(scale)
  n <- nrow(record$data)
  held_out <- chance(0.5)
  set <- measurements(record$data, time = "hour", target = "Ti",
                      boundary = ~ Te + Gv + circular(Wd), noise_sd = record$noise_sd,
                      average = if (chance(0.2)) 2, warmup = one_of(0, 0, 6),
                      validate = if (held_out) seq_len(n) > 0.7 * n, fill_gaps = one_of(0, 3))
  runs <- sample(15:40, 1)
  seed <- sample(1e6, 1)
  simulator <- random_simulator(scale)
  if (chance(0.5)) {
    made <- upgrade_model(simulator, set, catalogue(sun(scale)), runs = runs, seed = seed,
                          quiet = TRUE,
                          control = list(max_steps = 1, rounds = 1, calibration = list(ais = quick),
                                         attribution = list(surrogates = 19, ais = quick)))
    return(made$stopped_because)
  }
  emulator <- train_emulator(simulate_design(simulator, set, runs = runs, seed = seed), set)
  if (chance(0.2)) return(calibrate_paper(emulator, set, list(unit = scale, ais = quick),
                                          seed = seed)$trust$verdict)
  fit <- calibrate(emulator, set, list(ais = quick), seed = seed)
  attribute_discrepancy(fit, list(surrogates = 19, ais = quick), seed = seed)
  if (held_out) stats::predict(fit, use = "validate")
  fit$trust$verdict
}

resident_mb <- function() {
  gc()
  as.numeric(sub("[^0-9]*([0-9]+).*", "\\1",
                 grep("^VmRSS", readLines("/proc/self/status"), value = TRUE))) / 1024
}

rows <- lapply(seq_len(studies), function(k) {
  set.seed(first + k)
  started <- proc.time()[["elapsed"]]
  ended <- tryCatch(suppressWarnings(suppressMessages(random_study())), error = identity)
  stopped <- inherits(ended, "error")
  row <- data.frame(study = first + k, seconds = proc.time()[["elapsed"]] - started,
                    resident_mb = resident_mb(),
                    outcome = if (stopped) conditionMessage(ended) else ended,
                    condition = if (stopped) class(ended)[1] else NA,
                    ours = !stopped || inherits(ended, "amiss_error"))
  cat(sprintf("%4d %6.1f s %6.0f MB  %s%s\n", k, row$seconds, row$resident_mb,
              if (row$ours) "" else "FAILS ", substr(gsub("\\s+", " ", row$outcome), 1, 90)))
  row
})
rows <- do.call(rbind, rows)
quarter <- ceiling(4 * seq_len(studies) / studies)
memory <- tapply(rows$resident_mb, factor(quarter, 1:4), stats::median)
cat(sprintf("%d of %d studies ended with a condition that is not the package's own\n",
            sum(!rows$ours), studies))
cat(sprintf("memory of the last quarter over that of the second: %.3f\n",
            memory[[4]] / memory[[2]]))
write_rows(rows, out)
