#!/usr/bin/env Rscript
# How often it is said that from some moment on the error changes by much more, or less. Worlds S,
# S+1, ... of each family are fitted by least squares; what is left of each record is looked at,
# with whatever is hidden in it. Then the noise of each is made k times as large in the last
# quarter.
# Usage: Rscript bench/parts.R [--family F,F] [--worlds 40] [--seed 1] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
families <- strsplit(option("family", "box,network,runoff"), ",", fixed = TRUE)[[1]]
worlds <- as.integer(option("worlds", "40", smallest = "1"))
first <- as.integer(option("seed", "1"))
suppressPackageStartupMessages(library(amiss))
scope <- worlds_scope(here)
times <- c(2, 4, 8)

one_world <- function(family, seed) {
  world <- scope$family_world(family, seed)
  m <- world$measurements
  rows <- which(m$use %in% c("calibrate", "validate") & !is.na(m$y))
  best <- scope$best_on_record(world$base, m, seed, starts = 1)
  values <- amiss:::unit_to_values(t(best$unit), free_parameters(world$base))
  left <- rep(NA_real_, length(m$y))
  for (use in unique(m$use[rows])) {
    own <- amiss:::used_rows(m, use)
    left[own] <- m$y[own] - amiss:::simulate_measured(world$base, values, m, use, 1L)[, 1]
  }
  said <- function(more) {
    late <- seq_along(rows) > 0.75 * length(rows)
    noise <- amiss:::with_seed(seed, stats::rnorm(length(rows), 0, world$noise))
    !is.null(amiss:::changed_size(left[rows] + sqrt(more^2 - 1) * noise * late, m$hours[rows],
                                  m$step_h))
  }
  found <- vapply(c(1, times), said, NA)
  names(found) <- c("as_it_is", paste0("times_", times))
  data.frame(family, seed, hidden = length(world$kinds) > 0, kind = world$kind, t(found))
}

tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, family = families,
                     stringsAsFactors = FALSE)
rows <- do.call(rbind, parallel::mclapply(
  seq_len(nrow(tasks)), function(i) one_world(tasks$family[i], tasks$seed[i]), mc.cores = 2,
  mc.preschedule = FALSE))
shown <- c("as_it_is", paste0("times_", times))
print(stats::aggregate(rows[shown], rows["family"], mean))
print(rows[rows$as_it_is, c("family", "seed", "kind")], row.names = FALSE)
write_rows(rows, option("out", "parts.json"))
