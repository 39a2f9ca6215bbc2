#!/usr/bin/env Rscript
# How exact the evidence of a search and its local runs is: base models and models with the
# mechanism that is hidden, of worlds of each family. Each is calibrated as the loop does it, and
# then run at a thousand draws of its posterior. These give its evidence by importance sampling,
# whatever the emulator is. A row for each model: runs of the calibration, whether it is trusted,
# its evidence and that by the thousand runs in decades, and the standard error of the latter. The
# last line counts trusted models within a tenth of a decade.
# Usage: Rscript bench/local_evidence.R [--family box,network,runoff,wrong] [--worlds 8]
#                                       [--first 83001] [--runs 1000] [--threads 2] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
scope <- worlds_scope(here)
families <- strsplit(option("family", "box,network,runoff,wrong", smallest = "runoff"), ",",
                     fixed = TRUE)[[1]]
worlds <- as.integer(option("worlds", "8", smallest = "1"))
first <- as.integer(option("first", "83001"))
runs <- as.integer(option("runs", "1000", smallest = "50"))
threads <- as.integer(option("threads", 2))

by_runs <- function(fit, model, measurements) {
  drawn <- amiss:::even_draws(fit, runs)
  draws <- unique(drawn)
  outputs <- amiss:::simulate_measured(model, fit$values[draws, , drop = FALSE], measurements,
                                       "calibrate", threads)
  fit$log_evidence <- fit$log_evidence - fit$check$correction
  made <- list(draws = draws, times = tabulate(match(drawn, draws)), runs = outputs)
  exact <- amiss:::exact_evidence(list(fit), list(made), threads)[[1]]
  # The part of the error that the thousand runs have; the sampler's own is in both.
  n <- length(drawn)
  list(log_evidence = exact$log_evidence, error = sqrt((1 / exact$check$effective - 1) / (n - 1)))
}

one_model <- function(model, measurements, name, seed) {
  scouts <- simulate_design(model, measurements, 2 * length(free_parameters(model)) + 2,
                            seed = seed, threads = threads, quiet = TRUE)
  fit <- suppressWarnings(calibrate_refined(scouts, measurements, seed = seed, threads = threads,
                                            quiet = TRUE))
  exact <- by_runs(fit, model, measurements)
  row <- data.frame(model = name, runs = fit$runs_made + ncol(scouts$outputs),
                    trusted = fit$trust$trusted, log10_evidence = fit$log_evidence / log(10),
                    by_runs = exact$log_evidence / log(10), error = exact$error / log(10))
  message(sprintf("%s: %d runs, %.2f, by %d runs %.2f +- %.2f%s", name, row$runs,
                  row$log10_evidence, runs, row$by_runs, row$error,
                  if (row$trusted) "" else ", not trusted"))
  row
}

one_world <- function(family, seed) {
  world <- scope$family_world(family, seed)
  known <- intersect(world$kinds, names(world$catalogue))
  full <- Reduce(function(model, kind) world$catalogue[[kind]]$edit(model), known, world$base)
  models <- list(base = world$base, full = if (length(known)) full)
  models <- Filter(Negate(is.null), models)
  rows <- Map(one_model, models, list(world$measurements), paste(family, seed, names(models)),
              seed)
  do.call(rbind, unname(rows))
}

tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, family = families,
                     stringsAsFactors = FALSE)
table <- do.call(rbind, unname(Map(one_world, tasks$family, tasks$seed)))
table$off <- table$log10_evidence - table$by_runs
print(table, digits = 3, row.names = FALSE)
trusted <- table[table$trusted, ]
cat(sprintf("%d models, %d trusted: %d within 0.1 decades of the evidence by %d runs, worst %.2f\n",
            nrow(table), nrow(trusted), sum(abs(trusted$off) <= 0.1), runs,
            max(abs(trusted$off))))
write_rows(table, option("out", "local_evidence.json"))
