#!/usr/bin/env Rscript
# Faults of a record in worlds with nothing hidden: of each kind, how often a cause is named, and
# how often the fault is reported; of clean worlds, and of those that hide an effect (`hidden`), how
# often anything is reported. Rooms follow outdoor air, sun and a heater, at once or with a memory;
# mechanisms that would take a fault for a cause are in the catalogue.
# Usage: Rscript bench/records.R [--kinds clean,code,...] [--worlds 40] [--seed 1] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
for (part in c("common", "faults")) source(file.path(here, "records", paste0(part, ".R")))

kinds <- c("clean", names(faults))
chosen <- strsplit(option("kinds", toString(kinds), "clean,stuck_target"), ",\\s*")[[1]]
if (!all(chosen %in% kinds)) stop("--kinds: choose from ", toString(kinds), call. = FALSE)
worlds <- as.integer(option("worlds", 40, 1))
first <- as.integer(option("seed", 1))

score_world <- function(kind, seed) {
  world <- draw_room(seed)
  if (kind != "clean") world <- faults[[kind]]$put(world)
  heard <- tryCatch(suppressMessages(suppressWarnings(judge_room(world))),
                    amiss_error_input = function(e) {
    if (!grepl("code for a", conditionMessage(e))) stop(e)
    list(verdict = "refused", faults = "refused", says = conditionMessage(e))
  })
  message(sprintf("%s, world %d: %s; %s", kind, seed, heard$verdict, toString(heard$faults)))
  data.frame(kind = kind, seed = seed, verdict = heard$verdict, named = heard$verdict == "named",
             reported = length(heard$faults) > 0,
             right = any(heard$faults %in% c("refused", faults[[kind]]$right)),
             faults = toString(heard$faults), says = paste(heard$says, collapse = " "))
}

tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, kind = chosen, stringsAsFactors = FALSE)
rows <- do.call(rbind, Map(score_world, tasks$kind, tasks$seed))
of_kind <- split(rows, factor(rows$kind, chosen))
rates <- do.call(rbind, lapply(of_kind, function(r) {
  data.frame(kind = r$kind[1], worlds = nrow(r), named = sum(r$named), reported = sum(r$reported),
             right = sum(r$right))
}))
print(rates, row.names = FALSE)
write_rows(list(rates = rates, worlds = rows), option("out", "records.json"))
