#!/usr/bin/env Rscript
# Does the evidence depend on the basis or on the design?
# Usage: Rscript bench/basis.R --out FILE [--threads N]
#
# log10 evidence of five models of the Twin Houses with 8, 10, 12 and 16 basis vectors, with the
# package's own choice and twice as many, and with 100, 150 and 250 runs (own choice of vectors);
# refined where the check by runs fails.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
out <- option("out", "basis.json")
threads <- as.integer(option("threads", "2"))
suppressPackageStartupMessages(library(amiss))

with_mechanisms <- function(study, names)
  Reduce(function(model, name) study$catalogue[[name]]$edit(model), names, study$model)
cases <- list(list(house = "N2"), list(house = "N2", added = "neighbour coupling"),
              list(house = "O5"), list(house = "O5", added = "south solar aperture"),
              list(house = "O5", added = c("south solar aperture", "neighbour coupling")))
if (smoke) cases <- cases[1]

evidence <- function(case, label, runs, vectors = NULL, rounds = 2) {
  study <- read_study(system.file("studies", sprintf("twinhouse_%s.yml", case$house),
                                  package = "amiss"))
  model <- with_mechanisms(study, case$added)
  first <- simulate_design(model, study$measurements, runs, seed = 1, threads = threads)
  emulator <- if (is.null(vectors)) list()
              else list(explained = 1, noise_fraction = 1e-6, max_vectors = vectors)
  fit <- suppressWarnings(calibrate_refined(first, study$measurements, rounds = rounds,
                                            control = list(emulator = emulator),
                                            seed = 1, threads = threads))
  row <- data.frame(
    model = paste(c(case$house, "base"[is.null(case$added)], case$added), collapse = " + "),
    varied = label, vectors = ncol(fit$emulator$basis$vectors), runs = runs,
    log10_evidence = fit$log_evidence / log(10), standard_error = fit$standard_error / log(10),
    emulated = fit$posterior$log_evidence / log(10), emulator_error = fit$check$ratio,
    trusted = fit$trust$trusted, refined = fit$rounds)
  message(sprintf("%-50s Q = %2d, M = %3d: %.2f (se %.2f), emulator's error %.2f of the noise",
                  row$model, row$vectors, runs, row$log10_evidence, row$standard_error,
                  row$emulator_error))
  row
}

rows <- do.call(rbind, lapply(cases, function(case) {
  own <- evidence(case, "own choice", 150)
  rbind(own, evidence(case, "twice as many", 150, 2 * own$vectors),
        do.call(rbind, lapply(c(8, 10, 12, 16), function(q) evidence(case, "Q", 150, q))),
        do.call(rbind, lapply(c(100, 150, 250), function(m) evidence(case, "M", m))))
}))
write_rows(rows, out)
spread <- function(x) diff(range(x))
for (model in unique(rows$model)) {
  own <- rows[rows$model == model, ]
  cat(sprintf(
    "%-50s own choice to twice as many: %.2f (bound 0.3); over Q: %.2f (1.0); over M: %.2f (1.0)\n",
    model, spread(own$log10_evidence[own$varied %in% c("own choice", "twice as many")]),
    spread(own$log10_evidence[own$varied == "Q"]), spread(own$log10_evidence[own$varied == "M"])))
}
