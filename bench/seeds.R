#!/usr/bin/env Rscript
# What hangs on the seed: the base model of a Twin House, calibrated and refined as the loop does it. A row each: runs,
# whether the check by runs passed, the emulator's error over the noise, the effective share, the evidence.
# Usage: Rscript bench/seeds.R [--house O5] [--seeds 24] [--threads 2] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
house <- option("house", "O5")
seeds <- seq_len(as.integer(option("seeds", "24", smallest = "1")))
threads <- as.integer(option("threads", 2))
study <- read_study(system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss"), trust = TRUE)
control <- list(max_steps = 0)
if (smoke) control <- c(control, list(rounds = 0, attribution = list(surrogates = 19)))

one_seed <- function(seed) {
  upgrade <- upgrade_model(study$model, study$measurements, study$catalogue, runs = if (smoke) 30 else 150,
                           control = control, seed = seed, threads = threads, quiet = TRUE)
  fit <- upgrade$models[[1]]$fit
  row <- data.frame(house, seed, runs_total = upgrade$runs_total, passed = fit$check$passed, ratio = fit$check$ratio,
                    effective = fit$check$effective, border = fit$check$border,
                    log10_evidence = fit$log_evidence / log(10))
  message(sprintf("seed %d: %d runs, %s, log10 evidence %.2f", seed, row$runs_total,
                  if (row$passed) "passed" else "not passed", row$log10_evidence))
  row
}

table <- do.call(rbind, lapply(seeds, one_seed))
print(table, digits = 3)
cat(sprintf("passed %d of %d; at most %d runs; log10 evidence %.2f to %.2f\n", sum(table$passed), nrow(table),
            max(table$runs_total), min(table$log10_evidence), max(table$log10_evidence)))
write_rows(table, option("out", "seeds.json"))
