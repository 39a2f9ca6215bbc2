#!/usr/bin/env Rscript
# What a slow simulator costs: the Twin House studies, as if a run took so many seconds and workers
# made those of one batch side by side, and the trials of a step likewise, each in a worker of its
# own. Runs are counted batch by batch as the loop asks for them; the package's own time is added,
# as one process takes it. A row for each house and number of workers: runs, batches, and minutes
# by that clock.
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

# What is asked for one after the other: batches of runs, and trials side by side as a list of the
# runs of each.
asked <- list()
trials <- NULL
note_batch <- function(n) {
  if (is.null(trials)) asked <<- c(asked, list(n))
  else trials[length(trials)] <<- trials[length(trials)] + n
}
begin_trials <- function() trials <<- integer()
begin_trial <- function() trials <<- c(trials, 0)
end_trials <- function() {
  asked <<- c(asked, list(as.list(trials)))
  trials <<- NULL
}
inside <- asNamespace("amiss")
invisible(trace("simulate_measured", quote(note_batch(nrow(values))), print = FALSE,
                where = inside))
invisible(trace("side_by_side", quote({
  begin_trials()
  counted_work <- work
  work <- function(item, context) {
    begin_trial()
    counted_work(item, context)
  }
}), exit = quote(end_trials()), print = FALSE, where = inside))

# Runs one after the other, for what the workers do at once.
turns_of <- function(item, workers) {
  if (!is.list(item)) return(ceiling(item / workers))
  busy <- numeric(workers)
  for (runs in item) {
    free <- which.min(busy)
    busy[free] <- busy[free] + runs
  }
  max(busy)
}

one_house <- function(house) {
  study <- read_study(
    system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss"), trust = TRUE)
  catalogue <- if (smoke) study$catalogue["south solar aperture"] else study$catalogue
  asked <<- list()
  began <- proc.time()[["elapsed"]]
  upgrade <- suppressWarnings(upgrade_model(study$model, study$measurements, catalogue, runs = 20,
                                            control = quick, seed = seed, quiet = TRUE))
  own <- proc.time()[["elapsed"]] - began
  data.frame(house, workers, runs = upgrade$runs_total, batches = length(asked),
             minutes = vapply(workers, function(w) {
               (own + seconds * sum(vapply(asked, turns_of, 0, w))) / 60
             }, 0))
}

table <- do.call(rbind, lapply(houses, one_house))
print(table, digits = 3, row.names = FALSE)
write_rows(table, option("out", "clock.json"))
