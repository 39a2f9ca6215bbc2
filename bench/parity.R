#!/usr/bin/env Rscript
# What every stage gives for small cases.
# Usage: Rscript bench/parity.R --out FILE [--against FILE [--unchanged]]
#
# FILE gets a row for each number. With --against, rows that differ from an earlier FILE by more
# than their kind allows (bench/parity/cases.R says how far and why) are shown, and the exit status
# is 1; with --unchanged, by more than the 15 digits of the file: for a change that is to change
# nothing, on one machine. tests/testthat/test-parity.R compares with bench/parity/reference.json.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
unchanged <- "--unchanged" %in% arguments
arguments <- arguments[arguments != "--unchanged"]
suppressPackageStartupMessages(library(amiss))
source(file.path(here, "parity", "cases.R"))
rows <- parity_rows()
write_rows(rows, option("out", "parity.json"))
against <- option("against")
if (!is.null(against)) {
  differences <- parity_differences(rows, jsonlite::read_json(against, simplifyVector = TRUE),
                                    unchanged)
  if (nrow(differences)) print(differences, digits = 15)
  cat(nrow(differences), "of", nrow(rows), "numbers differ\n")
  quit(status = as.integer(nrow(differences) > 0))
}
