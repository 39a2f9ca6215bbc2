#!/usr/bin/env Rscript
# How often the 95 % intervals of the true model's parameters hold the truth.
# Usage: Rscript bench/parameter_coverage.R --out FILE [--family network] [--worlds 24]
#                                           [--seed 71001] [--workers N]
#
# The worlds are those of bench/hidden_effects, each with a mechanism at four times the noise; the
# model that made the record is calibrated by calibrate_refined(). FILE gets a row for each
# parameter: whether its interval holds the truth, whether it is the mechanism's, runs made and
# seconds. Effects are scaled to their strength, often to the end of a prior, so that truths are no
# draws from the priors and 95 % need not be reached.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
source(file.path(here, "intervals.R"))
family <- option("family", "network")
seeds <- as.integer(option("seed", "71001")) +
  seq_len(as.integer(option("worlds", "24", smallest = "1"))) - 1L
workers <- option("workers")
parts <- file.path(normalizePath(here), "hidden_effects",
                   paste0(c("worlds", "least_squares", "network", "runoff", "wrong", "families"),
                          ".R"))

one_world <- function(seed, family, parts) {
  suppressPackageStartupMessages(library(amiss))
  scope <- new.env(parent = globalenv())
  for (part in parts) sys.source(part, scope)
  draw <- function(...) scope$family_world(family, seed, strength = 4, ...)
  world <- draw()
  if (!length(world$kinds))
    world <- draw(kind = names(world$catalogue)[1 + seed %% length(world$catalogue)])
  model <- Reduce(function(model, kind) world$catalogue[[kind]]$edit(model), world$kinds,
                  world$base)
  hidden <- unlist(lapply(unname(world$effects), function(effect) effect[names(effect) != "size"]))
  truth <- c(world$values, hidden)
  runs <- simulate_design(model, world$measurements, 80, seed = seed + 77)
  start <- proc.time()[[3]]
  fit <- calibrate_refined(runs, world$measurements, seed = 1)
  table <- tidy(fit)
  truth <- truth[intersect(names(truth), table$term)]
  data.frame(family = family, seed = seed, name = names(truth),
             mechanism = names(truth) %in% names(hidden), held = holds(table, truth),
             physical = holds(table, truth, "physical"),
             passed = fit$check$passed, runs = fit$runs_made, seconds = proc.time()[[3]] - start)
}

if (!is.null(workers)) future::plan(future::multisession, workers = as.integer(workers))
rows <- do.call(rbind, future.apply::future_lapply(seeds, one_world, family, parts,
                                                   future.seed = NULL, future.scheduling = Inf))
write_rows(rows, option("out", "parameter_coverage.json"))
cat(sprintf(paste("%s: intervals hold %.1f %% of %d parameters, %.1f %% of %d of mechanisms;",
                  "of physical values %.1f %% and %.1f %%; %.0f runs and %.1f s a world\n"),
            family, 100 * mean(rows$held), nrow(rows), 100 * mean(rows$held[rows$mechanism]),
            sum(rows$mechanism), 100 * mean(rows$physical),
            100 * mean(rows$physical[rows$mechanism]), mean(rows$runs), mean(rows$seconds)))
