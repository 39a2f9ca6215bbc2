#!/usr/bin/env Rscript
# What a run of a program costs beside the program: `true`, started with a template and a file of
# drivers, its output a constant. Milliseconds of a core in the session and in what it starts, and
# of the clock.
# Usage: Rscript bench/program.R [--runs 200] [--rows 48] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
runs <- as.integer(option("runs", "200", smallest = "2"))
rows <- as.integer(option("rows", "48"))

program <- program_simulator("true", free("a", uniform(0, 1)), boundary = "Te",
                             cache = tempfile("runs"), templates = list("in.txt" = I("{{a}}")),
                             output = function(folder) rep(1, rows))
drivers <- cbind(Te = seq_len(rows))
simulate <- function(a) simulate_runs(program, cbind(a = a), drivers, step_h = 1)
invisible(simulate(0))  # what is loaded once
took <- system.time(simulate(seq_len(runs) / runs)) / runs * 1000
found <- system.time(simulate(seq_len(runs) / runs)) / runs * 1000
row <- data.frame(runs, rows, session_ms = sum(took[1:2]), programs_ms = sum(took[4:5]),
                  clock_ms = took[[3]], found_ms = sum(found[1:2]))
cat(sprintf(paste("%d runs: %.1f ms of a core in the session, %.1f ms in the programs,",
                  "%.1f ms by the clock; found: %.1f ms\n"),
            runs, row$session_ms, row$programs_ms, row$clock_ms, row$found_ms))
if (!is.null(out <- option("out"))) write_rows(row, out)
