#!/usr/bin/env Rscript
# What a verdict costs: the Twin House studies with fewer and with more runs for each model. A row each: runs of the
# simulator in all (designs, searches, rounds of refinement and checks of all models), what was adopted and what is said
# of it, and the error held out.
# Usage: Rscript bench/runs.R [--houses O5,N2] [--runs 30,45,60,90,150] [--threads 2] [--seed 1] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
`%or%` <- function(x, y) if (is.null(x)) y else x
houses <- strsplit(option("houses", "O5,N2", "O5"), ",", fixed = TRUE)[[1]]
designs <- as.integer(strsplit(option("runs", "30,45,60,90,150", "30"), ",", fixed = TRUE)[[1]])
threads <- as.integer(option("threads", 2))
seed <- as.numeric(option("seed", 1))
quick <- if (smoke) list(max_steps = 1, rounds = 0, calibration = list(ais = list(pilot_chains = 48, groups = 4)),
                         attribution = list(surrogates = 19))

one_study <- function(house, runs) {
  study <- read_study(system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss"))
  catalogue <- if (smoke) study$catalogue["south solar aperture"] else study$catalogue
  class(catalogue) <- class(study$catalogue)
  began <- proc.time()[["elapsed"]]
  upgrade <- suppressWarnings(upgrade_model(study$model, study$measurements, catalogue, runs = runs, control = quick,
                                            seed = seed, threads = threads, quiet = TRUE))
  last <- upgrade$models[[length(upgrade$models)]]
  adopted <- vapply(upgrade$models[-1], function(m) paste0(m$mechanism, " (", m$verdict, ")"), "")
  message(house, ", ", runs, " runs a model: ", toString(adopted))
  data.frame(house, runs, runs_total = upgrade$runs_total, adopted = toString(adopted),
             cause = upgrade$named_cause$mechanism %or% NA_character_,
             log10_bf = upgrade$gain$log10_bf, trusted = last$fit$trust$trusted,
             rmse_validation = last$scores$validate[["rmse"]], wall_s = proc.time()[["elapsed"]] - began)
}

cases <- expand.grid(runs = designs, house = houses, stringsAsFactors = FALSE)
table <- do.call(rbind, Map(one_study, cases$house, cases$runs))
rownames(table) <- NULL
print(table, digits = 3)
write_rows(table, option("out", "runs.json"))
