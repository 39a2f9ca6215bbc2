#!/usr/bin/env Rscript
# How far does the evidence of a coarse calibration, by which the loop chooses what to calibrate in full, lie from that
# of a full one, and does its standard error say so?
# Usage: Rscript bench/coarse.R [--worlds 20013,20105] [--seeds 20] [--out FILE]
#
# Worlds of the family `wrong` (hidden_effects/wrong.R), whose base model is wrong in structure: the base model and that
# with the hidden mechanism, if there is one. For each the emulator of its coarse calibration is sampled anew by as many
# seeds, coarsely and, by a fifth of them, in full; no run of the simulator is made for that. In decades.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
scope <- new.env(parent = globalenv())
for (part in c("worlds", "least_squares", "network", "runoff", "wrong", "families"))
  sys.source(file.path(here, "hidden_effects", paste0(part, ".R")), scope)
worlds <- as.integer(strsplit(option("worlds", "20013,20105", smallest = "20013"), ",")[[1]])
seeds <- seq_len(as.integer(option("seeds", "20", smallest = "2")))

unchecked <- list(check = 0, exact = 0)
control <- amiss:::fill_upgrade_control(NULL, scope$draw_wrong_world(worlds[1])$measurements)

coarse_and_full <- function(name, model, world) {
  settings <- list(calibrate = calibrate, measurements = world$measurements, runs = 120, control = control,
                   seed = world$seed + 77L, threads = 1, keep = function(key, code) code)
  emulator <- amiss:::screen_model(model, name, settings)$fit$emulator
  evidence <- function(seed, ais = NULL) {
    fit <- calibrate(emulator, world$measurements, c(unchecked, list(ais = ais)), seed = seed)
    c(fit$log_evidence, fit$standard_error) / log(10)
  }
  coarse <- vapply(seeds, evidence, numeric(2), ais = control$screening)
  full <- vapply(utils::head(seeds, ceiling(length(seeds) / 5)), evidence, numeric(2))
  off <- coarse[1, ] - mean(full[1, ])
  data.frame(world = world$seed, model = name, seeds = length(seeds), full = mean(full[1, ]), sd_full = sd(full[1, ]),
             median = stats::median(off), sd = stats::sd(off), lowest = min(off), highest = max(off),
             beyond_1 = sum(abs(off) > 1), beyond_3_errors = sum(abs(off) > 3 * coarse[2, ] + 0.1))
}

rows <- do.call(rbind, lapply(worlds, function(seed) {
  world <- scope$draw_wrong_world(seed)
  models <- c(list(base = world$base), lapply(world$catalogue[world$kinds], function(m) m$edit(world$base)))
  do.call(rbind, Map(coarse_and_full, names(models), models, list(world)))
}))
print(rows, row.names = FALSE, digits = 3)
cat(sprintf("beyond one decade: %d of %d\n", sum(rows$beyond_1), sum(rows$seeds)))
write_rows(rows, option("out", "coarse.json"))
