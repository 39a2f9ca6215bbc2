#!/usr/bin/env Rscript
# What a slow simulator costs: the Twin House studies, as if a run took so many seconds and workers
# made those of one batch side by side. Runs are counted batch by batch as the loop asks for them;
# the package's own time is added. A row for each house and number of workers: runs, batches, and
# minutes by that clock.
# Usage: Rscript bench/clock.R [--houses O5,N2] [--seconds 60] [--workers 1,8] [--seed 1]
#                              [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
houses <- strsplit(option("houses", "O5,N2", "O5"), ",", fixed = TRUE)[[1]]
seconds <- as.numeric(option("seconds", "60"))
workers <- as.integer(strsplit(option("workers", "1,8", "8"), ",", fixed = TRUE)[[1]])
seed <- as.integer(option("seed", "1"))
quick <- if (smoke) list(max_steps = 1, rounds = 2, attribution = list(surrogates = 19))

batches <- integer()
invisible(trace("simulate_measured", quote(note_batch(nrow(values))), print = FALSE,
                where = asNamespace("amiss")))
note_batch <- function(n) batches <<- c(batches, n)

one_house <- function(house) {
  study <- read_study(
    system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss"), trust = TRUE)
  catalogue <- if (smoke) study$catalogue["south solar aperture"] else study$catalogue
  batches <<- integer()
  began <- proc.time()[["elapsed"]]
  upgrade <- suppressWarnings(upgrade_model(study$model, study$measurements, catalogue, runs = 20,
                                            control = quick, seed = seed, quiet = TRUE))
  own <- proc.time()[["elapsed"]] - began
  data.frame(house, workers, runs = upgrade$runs_total, batches = length(batches),
             minutes = vapply(workers, function(w) {
               (own + seconds * sum(ceiling(batches / w))) / 60
             }, 0))
}

table <- do.call(rbind, lapply(houses, one_house))
print(table, digits = 3, row.names = FALSE)
write_rows(table, option("out", "clock.json"))
