#!/usr/bin/env Rscript
# Worlds S, S+1, ... of the hidden-effect benchmark, without the rivals: Rscript
# bench/cluster/score.R --worlds N --seed S --chunk C --keep FOLDER [--plan FILE.R]. C worlds go
# into one future of the plan that FILE.R sets. Each finished world is kept in FOLDER, and only
# those that are missing there are computed. When each began and ended goes to $AMISS_TIMES.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "..", "options.R"))
keep <- option("keep")
dir.create(keep, showWarnings = FALSE, recursive = TRUE)
if (!is.null(option("plan"))) source(option("plan"))

one_world <- function(seed, file, bench) {
  note <- function(what) {
    cat(sprintf("%s %d %.3f\n", what, seed, as.numeric(Sys.time())),
        file = Sys.getenv("AMISS_TIMES"), append = TRUE)
  }
  note("begun")
  scope <- new.env(parent = globalenv())
  for (part in c("worlds.R", "least_squares.R", "score.R"))
    sys.source(file.path(bench, "hidden_effects", part), scope)
  row <- scope$score_world(scope$draw_world(seed), rivals = FALSE)
  part <- tempfile("part-", dirname(file))
  saveRDS(row, part)
  file.rename(part, file)
  note("done")
}

seeds <- as.integer(option("seed")) + seq_len(as.integer(option("worlds"))) - 1L
files <- file.path(normalizePath(keep), sprintf("%09d.rds", seeds))
missing <- which(!file.exists(files))
cat("finished before:", length(seeds) - length(missing), "worlds; computed now:", length(missing),
    "\n")
invisible(future.apply::future_mapply(one_world, seeds[missing], files[missing],
                                      MoreArgs = list(bench = normalizePath(file.path(here, ".."))),
                                      future.seed = NULL,
                                      future.chunk.size = as.integer(option("chunk"))))
