#!/usr/bin/env Rscript
# Accuracy of the evidence.
# Usage: Rscript bench/evidence.R --out FILE [--repeats N] [--seed S]
#
# Every case of bench/evidence/cases.R, whose evidence is known, is run N times (23: 207 intervals
# in all); rows are written as JSON.
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
for (part in c("options.R", "evidence/cases.R")) source(file.path(here, part))
suppressPackageStartupMessages(library(amiss))

repeats <- as.integer(option("repeats", "23", smallest = "2"))
first <- as.integer(option("seed", "1"))
out <- option("out", "evidence.json")

runs <- list()
rows <- list()
for (case in evidence_cases()) {
  own <- do.call(rbind,
                 lapply(first + seq_len(repeats) - 1L, function(seed) evidence_run(case, seed)))
  row <- evidence_row(case, own)
  message(sprintf("%-17s d %2d  exact %9.4f  bias %7.3f  sd %6.3f  coverage %3.0f %%  %s", row$case,
                  row$d, row$exact, row$bias, row$sd, 100 * row$coverage,
                  if (row$holds) "holds" else "DOES NOT HOLD"))
  runs <- c(runs, list(own))
  rows <- c(rows, list(row))
}
rows <- c(rows, list(coverage_row(do.call(rbind, runs))))
message(sprintf("interval: covers in %.1f %% of %d", 100 * rows[[length(rows)]]$coverage,
                rows[[length(rows)]]$repeats))
write_rows(rows, out)
