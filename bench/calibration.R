#!/usr/bin/env Rscript
# Can the posteriors and the model probabilities be trusted?
# Usage: Rscript bench/calibration.R --out FILE [--draws 200] [--seed 1] [--workers 2]
#                                    [--figure FILE.png]
#
# Simulation-based calibration of posterior (5) with separate and with one noise precision, of
# posterior (6) and of the joint posterior; calibration of the probabilities of the models M1 to M3;
# evidences against bridge sampling, where that package is installed. Writes JSON, one row a
# quantity: case, quantity, draws, p_value and holds (p-values adjusted by Holm's method over all
# rows stay above 0.05, so that a right implementation fails in one of twenty seeds).

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
out <- option("out", "calibration.json")
draws <- as.integer(option("draws", "200", smallest = "20"))
first <- 1e5 * as.integer(option("seed", "1"))
workers <- as.integer(option("workers", "2"))
figure <- option("figure", sub("(\\.json)?$", ".png", out))
suppressPackageStartupMessages(library(amiss))
for (part in c("world", "prior_predictive", "ranks", "figure", "model_probability", "bridge")) {
  sys.source(file.path(here, "calibration", paste0(part, ".R")), globalenv())
}

started <- proc.time()[["elapsed"]]
said <- function(what) message(sprintf("%5.0f s  %s", proc.time()[["elapsed"]] - started, what))
world <- sbc_world()
separate <- sbc_run("paper", world, draws, first, workers = workers)
said("posteriors (5) and (6)")
shared <- sbc_run("paper", world, draws, first + 1e4, list(shared_lambda = TRUE), workers)
said("posterior (5), one noise precision")
history <- sbc_run("history", world, draws, first + 2e4, workers = workers)
said("joint posterior")
parts <- list(list("posterior (5)", separate, "inside"),
              list("posterior (5), one lambda*", shared, "inside"),
              list("posterior (6)", separate, "outside"), list("joint posterior", history, "joint"))
rows <- do.call(rbind, lapply(parts, do.call, what = sbc_rows))
trusted <- vapply(parts, function(p) mean(vapply(p[[2]], function(r) r$trusted[[p[[3]]]], TRUE)), 0)
rank_figure(parts, rows, figure)

worlds <- box_worlds()
for (name in names(sources)) {
  cases <- do.call(rbind,
                   spread_work(first + 3e4 + seq_len(3 * draws),
                               function(seed) model_case(worlds, sources[[name]], seed), workers))
  rows <- rbind(rows, probability_rows(cases, name))
  said(paste("model probabilities,", name))
}
bridge <- if (requireNamespace("bridgesampling", quietly = TRUE)) bridge_rows(world, first)
rows <- rbind(rows, bridge[names(rows)])
said(if (is.null(bridge)) "bridge sampling left out: its package is not installed"
     else "bridge sampling")

rows$holds <- stats::p.adjust(rows$p_value, "holm") > 0.05
write_rows(rows, out)
print(rows, digits = 3)
cat(sprintf("%d of %d rows hold; trusted by the sampler itself: %s\n", sum(rows$holds), nrow(rows),
            paste(sprintf("%s %.1f %%", vapply(parts, `[[`, "", 1), 100 * trusted),
                  collapse = ", ")))
quit(status = if (all(rows$holds)) 0 else 1)
