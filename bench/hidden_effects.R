#!/usr/bin/env Rscript
# Hidden-effect benchmark: Rscript bench/hidden_effects.R --worlds N --seed S --out FILE [--workers N]
# Worlds S, S+1, ... are drawn, scored and written as JSON, with two figures beside it (FILE-detection.png and
# FILE-confusion.png). Each finished world is kept in FILE.worlds/, so that a stopped run goes on where it was; worlds
# that failed are tried again. Work goes through the user's future plan if --workers is not given.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
worlds <- as.integer(option("worlds", "24"))
first <- as.integer(option("seed", "1"))
out <- option("out", "hidden_effects.json")
workers <- option("workers")
suppressPackageStartupMessages(library(amiss))

keep <- paste0(out, ".worlds")
dir.create(keep, showWarnings = FALSE, recursive = TRUE)
file_of <- function(seed) file.path(keep, sprintf("%09d.rds", seed))
finished <- function(seed) file.exists(file_of(seed)) && is.null(readRDS(file_of(seed))$error)
one_world <- function(seed, here, keep, file, worlds) {
  suppressPackageStartupMessages(library(amiss))
  scope <- new.env(parent = globalenv())
  for (part in c("worlds.R", "score.R")) sys.source(file.path(here, "hidden_effects", part), scope)
  row <- tryCatch(scope$score_world(scope$draw_world(seed)), error = function(e) list(seed = seed, error = conditionMessage(e)))
  part <- tempfile("part-", keep)
  saveRDS(row, part)
  file.rename(part, file)
  said <- if (is.null(row$error)) sprintf("%s x%g: %s %s", row$kind, row$strength, row$verdict, row$mechanism) else row$error
  message(sprintf("%d of %d, world %d, %s", length(list.files(keep, "rds$")), worlds, seed, said))
}

if (!is.null(workers)) future::plan(future::multisession, workers = as.integer(workers))
keep <- normalizePath(keep)
seeds <- first + seq_len(worlds) - 1L
missing <- Filter(Negate(finished), seeds)
invisible(future.apply::future_mapply(one_world, missing, file = vapply(missing, file_of, ""), MoreArgs = list(here = normalizePath(here), keep = keep, worlds = worlds),
                                      future.seed = NULL, future.scheduling = Inf))
rows <- lapply(seeds, function(seed) readRDS(file_of(seed)))
scope <- new.env(parent = globalenv())
for (part in c("worlds.R", "score.R", "figures.R")) sys.source(file.path(here, "hidden_effects", part), scope)
failed <- Filter(function(r) !is.null(r$error), rows)
scored <- Filter(function(r) is.null(r$error), rows)
rates <- scope$score_rates(scored)
as_arrays <- function(row) {  # also where there is one value, or none
  for (name in intersect(names(row), c("true_boundary", "true_mechanism", "adopted", "rmse"))) row[[name]] <- as.list(row[[name]])
  row
}
write_rows(list(worlds = lapply(rows, as_arrays), failed = length(failed), rates = rates, means = scope$score_means(scored)), out)
if (length(scored)) scope$write_figures(scored, out)
for (name in names(rates)) cat(sprintf("%-28s %5.1f %% of %d [%.0f, %.0f]\n", name, 100 * rates[[name]]$rate, rates[[name]]$n, 100 * rates[[name]]$lower95, 100 * rates[[name]]$upper95))
if (length(failed)) cat(length(failed), "worlds failed:", failed[[1]]$error, "\n")
