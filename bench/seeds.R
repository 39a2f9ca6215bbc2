#!/usr/bin/env Rscript
# What depends on the seed: base models, and models with the mechanism that is hidden, calibrated as
# the loop does it, with several seeds each. A row for each calibration: runs, whether the check by
# runs passed, the emulator's error over the noise, the effective share, the evidence, and whether
# it is trusted. The last line counts models of which two trusted evidences lie half a decade apart
# or more.
# Usage: Rscript bench/seeds.R [--houses O5,N2] [--family network,runoff,wrong] [--worlds 3]
#                              [--first 60001] [--seeds 12] [--threads 2] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
scope <- worlds_scope(here)
split_words <- function(x) strsplit(x, ",", fixed = TRUE)[[1]]
houses <- split_words(option("houses", "O5,N2", "O5"))
families <- split_words(option("family", "network,runoff,wrong", smallest = "runoff"))
worlds <- as.integer(option("worlds", "3", smallest = "1"))
first <- as.integer(option("first", "60001"))
seeds <- seq_len(as.integer(option("seeds", "12", smallest = "2")))
threads <- as.integer(option("threads", 2))

house_models <- function(house) {
  study <- read_study(
    system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss"), trust = TRUE)
  list(list(name = house, model = study$model, measurements = study$measurements))
}

world_models <- function(family, seed) {
  world <- scope$family_world(family, seed)
  edits <- lapply(world$catalogue[intersect(world$kinds, names(world$catalogue))], `[[`, "edit")
  full <- Reduce(function(model, edit) edit(model), edits, world$base)
  models <- list(base = world$base, full = if (length(edits)) full)
  models <- Filter(Negate(is.null), models)
  Map(function(model, what) list(name = paste(family, seed, what), model = model,
                                 measurements = world$measurements),
      models, names(models))
}

one_seed <- function(case, seed) {
  runs <- simulate_design(case$model, case$measurements,
                          2 * length(free_parameters(case$model)) + 2, seed = seed,
                          threads = threads, quiet = TRUE)
  fit <- suppressWarnings(calibrate_refined(runs, case$measurements, seed = seed, threads = threads,
                                            quiet = TRUE))
  row <- data.frame(model = case$name, seed, runs = fit$runs_made + ncol(runs$outputs),
                    passed = fit$check$passed, ratio = fit$check$ratio,
                    effective = fit$check$effective, border = fit$check$border,
                    log10_evidence = fit$log_evidence / log(10), trusted = fit$trust$trusted)
  message(sprintf("%s, seed %d: %d runs, log10 evidence %.2f%s", case$name, seed, row$runs,
                  row$log10_evidence, if (row$trusted) "" else ", not trusted"))
  row
}

# 0: none
tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, family = families,
                     stringsAsFactors = FALSE)
cases <- c(unlist(lapply(houses, house_models), recursive = FALSE),
           unlist(unname(Map(world_models, tasks$family, tasks$seed)), recursive = FALSE))
table <- do.call(rbind,
                 unlist(lapply(cases, function(case) lapply(seeds, function(s) one_seed(case, s))),
                        recursive = FALSE))
spread <- vapply(split(table, table$model), function(t) {
  if (sum(t$trusted) > 1) diff(range(t$log10_evidence[t$trusted])) else 0
}, 0)
print(data.frame(model = names(spread), spread = round(spread, 2),
                 trusted = tapply(table$trusted, table$model, sum)[names(spread)],
                 runs = tapply(table$runs, table$model, stats::median)[names(spread)],
                 row.names = NULL))
cat(sprintf("%d of %d models have trusted evidences half a decade apart or more\n",
            sum(spread >= 0.5),
            length(spread)))
write_rows(table, option("out", "seeds.json"))
