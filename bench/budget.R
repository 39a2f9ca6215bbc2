#!/usr/bin/env Rscript
# The verdict against the budget: worlds of each family with budgets of 100, 200, 400 and 800 runs.
# A row for each world and budget; shares of right mechanisms (of those hidden with twice the noise
# or more), of worlds in which something is named that is not there, and of budgets kept to.
# Usage: Rscript bench/budget.R [--family box,network,runoff] [--worlds 60] [--seed 80001]
#                               [--budgets 100,200,400,800] [--workers N] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
split_words <- function(x) strsplit(x, ",", fixed = TRUE)[[1]]
families <- split_words(option("family", "box,network,runoff", smallest = "runoff"))
worlds <- as.integer(option("worlds", "60", smallest = "1"))
first <- as.integer(option("seed", "80001"))
budgets <- as.integer(split_words(option("budgets", "100,200,400,800", smallest = "100")))
workers <- as.integer(option("workers", "1"))
parts <- file.path(
  normalizePath(here), "hidden_effects",
  paste0(c("worlds", "least_squares", "network", "runoff", "wrong", "families", "score"), ".R"))

one_world <- function(family, seed, budget, parts) {
  scope <- new.env(parent = globalenv())
  for (part in parts) sys.source(part, scope)
  world <- scope$family_world(family, seed)
  control <- list(max_steps = 2, runs_total = budget)
  row <- suppressWarnings(scope$score_world(world, control, rivals = FALSE, least_squares = FALSE))
  message(sprintf("%s %d, %d runs: %s %s", family, seed, budget, row$verdict,
                  toString(row$adopted)))
  data.frame(family, seed, budget, runs_total = row$runs_total, verdict = row$verdict,
             strong = length(row$true_mechanism) > 0 && row$achieved >= 1.95,
             right = isTRUE(row$mechanism %in% row$true_mechanism),
             falsely = any(!scope$named_mechanisms(row) %in% row$true_mechanism))
}

if (workers > 1) future::plan(future::multisession, workers = workers)
tasks <- expand.grid(budget = budgets, seed = first + seq_len(worlds) - 1L, family = families,
                     stringsAsFactors = FALSE)
rows <- do.call(rbind, unname(future.apply::future_Map(one_world, tasks$family, tasks$seed,
                                                       tasks$budget, MoreArgs = list(parts = parts),
                                                       future.seed = NULL)))
for (family in families) for (budget in budgets) {
  own <- rows[rows$family == family & rows$budget == budget, ]
  strong <- own[own$strong, ]
  cat(sprintf("%-8s %4d runs: right %d of %d, named falsely %d of %d, at most %d runs\n", family,
              budget, sum(strong$right), nrow(strong), sum(own$falsely), nrow(own),
              max(own$runs_total)))
}
write_rows(rows, option("out", "budget.json"))
