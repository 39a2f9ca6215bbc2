#!/usr/bin/env Rscript
# What a verdict costs: the Twin House studies with several seeds and with more runs over the
# priors. A row each: runs of the simulator in all (scouts, searches, regions and checks of all
# models), what was adopted and what is said of it, the error held out, and seconds by the clock.
# Usage: Rscript bench/runs.R [--houses O5,N2] [--seeds 5] [--scouts 20,40,100] [--threads 2]
#                             [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
`%or%` <- function(x, y) if (is.null(x)) y else x
houses <- strsplit(option("houses", "O5,N2", "O5"), ",", fixed = TRUE)[[1]]
seeds <- seq_len(as.integer(option("seeds", "5", "1")))
scouts <- as.integer(strsplit(option("scouts", "20,40,100", "20"), ",", fixed = TRUE)[[1]])
threads <- as.integer(option("threads", 2))
quick <- if (smoke) list(max_steps = 1, rounds = 2, attribution = list(surrogates = 19))

one_study <- function(house, seed, scouts) {
  study <- read_study(
    system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss"), trust = TRUE)
  catalogue <- if (smoke) study$catalogue["south solar aperture"] else study$catalogue
  began <- proc.time()[["elapsed"]]
  upgrade <- suppressWarnings(upgrade_model(study$model, study$measurements, catalogue,
                                            runs = scouts, control = quick, seed = seed,
                                            threads = threads, quiet = TRUE))
  last <- upgrade$models[[length(upgrade$models)]]
  adopted <- vapply(upgrade$models[-1], function(m) paste0(m$mechanism, " (", m$verdict, ")"), "")
  message(house, ", seed ", seed, ", ", scouts, " scouts: ", upgrade$runs_total, " runs; ",
          toString(adopted))
  data.frame(house, seed, scouts, runs_total = upgrade$runs_total, adopted = toString(adopted),
             cause = upgrade$named_cause$mechanism %or% NA_character_,
             log10_bf = upgrade$gain$log10_bf,
             log10_evidence = upgrade$models[[1]]$fit$log_evidence / log(10),
             trusted = last$fit$trust$trusted, rmse_validation = last$scores$validate[["rmse"]],
             wall_s = proc.time()[["elapsed"]] - began)
}

cases <- unique(
  rbind(expand.grid(seed = seeds, scouts = scouts[1], house = houses, stringsAsFactors = FALSE),
        expand.grid(seed = 1, scouts = scouts, house = houses, stringsAsFactors = FALSE)))
table <- do.call(rbind, Map(one_study, cases$house, cases$seed, cases$scouts))
rownames(table) <- NULL
print(table, digits = 4)
write_rows(table, option("out", "runs.json"))
