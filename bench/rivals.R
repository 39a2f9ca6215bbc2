#!/usr/bin/env Rscript
# What others would find in the worlds of the hidden-effect benchmark (hidden_effects.R): each rival
# chooses mechanisms of the same catalogue for the same record, at most two.
# Usage: Rscript bench/rivals.R [--family F,F] --worlds N --seed S --out FILE [--workers N]
#                               [--amiss DIR,DIR] [--rivals NAME,NAME]
#
# Rivals (bench/rivals): bic, least squares with AR(1) errors and the least BIC; bic10, the same if
# BIC falls by more than ten; importance, Bayes factors by importance sampling without an emulator,
# with 50 (P + 2) runs a model; kalman, likelihood ratio tests on stochastic grey-box models
# (networks only). --amiss names folders of worlds that hidden_effects.R has scored (FILE.worlds):
# their rows stand beside the rivals' for the same seeds. FILE gets a row for each world and rival,
# and a table of each family. Finished worlds are kept in FILE.worlds/.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
families <- strsplit(option("family", "box,network,runoff,wrong", "network"), ",")[[1]]
worlds <- as.integer(option("worlds", "24", smallest = "1"))
first <- as.integer(option("seed", "1"))
out <- option("out", "rivals.json")
workers <- option("workers")
asked <- strsplit(option("rivals", "bic,bic10,importance,kalman", "importance"), ",")[[1]]
amiss_folders <- strsplit(option("amiss", ""), ",")[[1]]
suppressPackageStartupMessages(library(amiss))

parts <- c(file.path("hidden_effects", c("worlds", "least_squares", "network", "runoff", "wrong",
                                         "families", "score")),
           file.path("rivals", c("choose", "autoregressive", "importance", "kalman", "score")))
parts <- file.path(normalizePath(here), paste0(parts, ".R"))
keep <- paste0(out, ".worlds")
dir.create(keep, showWarnings = FALSE, recursive = TRUE)
keep <- normalizePath(keep)
tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, family = families,
                     stringsAsFactors = FALSE)
tasks$file <- file.path(keep, sprintf("%s-%09d.rds", tasks$family, tasks$seed))

one_world <- function(seed, family, file, parts, asked) {
  suppressPackageStartupMessages(library(amiss))
  scope <- new.env(parent = globalenv())
  for (part in parts) sys.source(part, scope)
  rows <- scope$score_rivals(scope$family_world(family, seed), asked)
  part <- tempfile("part-", dirname(file))
  saveRDS(rows, part)
  file.rename(part, file)
  message(sprintf("%s world %d, %s: %s", family, seed, rows$kind[1],
                  paste(rows$rival, rows$first, collapse = ", ")))
}
if (!is.null(workers)) future::plan(future::multisession, workers = as.integer(workers))
missing <- tasks[!file.exists(tasks$file), ]
invisible(future.apply::future_mapply(one_world, missing$seed, missing$family, missing$file,
                                      MoreArgs = list(parts = parts, asked = asked),
                                      future.seed = NULL, future.scheduling = Inf))

scope <- new.env(parent = globalenv())
for (part in parts) sys.source(part, scope)
rows <- do.call(rbind, lapply(tasks$file, readRDS))
rows <- rbind(scope$amiss_rows(amiss_folders, rows), rows)
table <- scope$rival_table(rows)
print(table, digits = 3, row.names = FALSE)
write_rows(list(rows = rows, table = table), out)
