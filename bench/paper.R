#!/usr/bin/env Rscript
# The paper's synthetic experiment, again and again.
# Usage: Rscript bench/paper.R --seeds N --out FILE [--rivals R] [--samplers K] [--workers W]
#
# N noise seeds: do the intervals of M3 hold the truth? On R of them (all), M1 and M2 too: does what
# the paper found come out? K seeds of the sampler on one record (10): how far does the evidence
# scatter? Each finished fit is kept in FILE.fits/, so that a stopped run goes on where it was. FILE
# gets rows of name, value, required, holds.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
noise_seeds <- seq_len(as.integer(option("seeds", "20", smallest = "1")))
rivals <- utils::head(noise_seeds, as.integer(option("rivals", length(noise_seeds))))
sampler_seeds <- seq_len(as.integer(option("samplers", "10", smallest = "1")))
out <- option("out", "paper.json")
keep <- paste0(out, ".fits")
dir.create(keep, showWarnings = FALSE, recursive = TRUE)

# One model, calibrated on the study's record with the noise of one seed, by a sampler of another;
# only what is scored.
one_fit <- function(job, keep) {
  file <- file.path(keep, sprintf("%s_%03d_%03d.rds", job$model, job$noise, job$sampler))
  if (file.exists(file)) return(readRDS(file))
  suppressPackageStartupMessages(library(amiss))
  study <- read_study(system.file("studies", "paper_synthetic.yml", package = "amiss"))
  m <- study$measurements
  clean <- m$raw$drivers[, "Ti_clean"]
  set.seed(job$noise, kind = "Mersenne-Twister", normal.kind = "Inversion")
  m$y <- m$raw$y <- clean + sqrt(0.01 * var(clean[m$use == "calibrate"])) * rnorm(length(clean))
  emulator <- train_emulator(
    simulate_design(study$models[[job$model]], m, study$runs, seed = study$seed), m)
  fit <- calibrate_paper(emulator, m, seed = job$sampler)
  ten <- log(10)
  result <- c(job, list(log10_evidence = fit$log_evidence / ten,
                        standard_error = fit$standard_error / ten, trusted = fit$trust$trusted,
                        parts = fit$evidence, index = fit$index,
                        parameters = amiss:::parameter_table(fit), truth = study$truth$values))
  part <- tempfile("part-", keep)
  saveRDS(result, part)
  file.rename(part, file)
  message(sprintf("%s noise %d sampler %d: log10 evidence %.2f", job$model, job$noise, job$sampler,
                  result$log10_evidence))
  result
}

grid <- rbind(expand.grid(noise = noise_seeds, sampler = 1L, model = "M3"),
              expand.grid(noise = 1L, sampler = sampler_seeds[-1], model = "M3"),
              expand.grid(noise = rivals, sampler = 1L, model = c("M2", "M1")),
              expand.grid(noise = 1L, sampler = sampler_seeds[-1], model = c("M2", "M1")))
jobs <- lapply(seq_len(nrow(grid)), function(i)
  list(model = as.character(grid$model[i]), noise = grid$noise[i], sampler = grid$sampler[i]))
fits <- parallel::mclapply(jobs, one_fit, keep = keep,
                           mc.cores = as.integer(option("workers", "1")), mc.preschedule = FALSE)
failed <- Filter(function(f) inherits(f, "try-error"), fits)
if (length(failed)) stop(length(failed), " fits failed: ", failed[[1]], call. = FALSE)

pick <- function(model, field = NULL, noise = noise_seeds, sampler = 1L) {
  own <- Filter(function(f) f$model == model && f$noise %in% noise && f$sampler %in% sampler, fits)
  own <- own[order(vapply(own, `[[`, 0, "noise"), vapply(own, `[[`, 0, "sampler"))]
  if (is.null(field)) own else vapply(own, function(f) as.numeric(f[[field]]), 0)
}
evidence <- sapply(c("M1", "M2", "M3"), pick, "log10_evidence", noise = rivals)
evidence <- matrix(evidence, ncol = 3, dimnames = list(NULL, c("M1", "M2", "M3")))
share <- function(model, holds) mean(vapply(pick(model), function(f) isTRUE(holds(f$index)), NA))
rank_of <- function(index, condition) index$rank[match(condition, index$boundary)]
inside <- vapply(pick("M3"), function(f) {
  p <- f$parameters
  true <- f$truth[p$name]
  p$lower95 <= true & true <= p$upper95
}, logical(6))
scatter <- function(model)
  stats::sd(pick(model, "log10_evidence", noise = 1L, sampler = sampler_seeds))
n <- length(noise_seeds)
rows <- list(
  list("share of seeds with log10 L in the order M1 < M2 < M3",
       mean(evidence[, 1] < evidence[, 2] & evidence[, 2] < evidence[, 3]), 1),
  list("least log10 B of M2 against M1", min(evidence[, 2] - evidence[, 1]), 2),
  list("least log10 B of M3 against M2", min(evidence[, 3] - evidence[, 2]), 2),
  list("M1: share of seeds with all conditions significant",
       share("M1", function(i) all(i$significant)), 1),
  list("M1: share of seeds with RHP and Te ranked highest",
       share("M1", function(i) all(rank_of(i, c("RHP", "Te")) <= 2)), 1),
  list("M2: share of seeds with Ws and Wd ranked highest",
       share("M2", function(i) all(rank_of(i, c("Ws", "Wd")) <= 2)), 1),
  list("M3: share of seeds with no condition significant",
       share("M3", function(i) !any(i$significant)), 1),
  list("M3: seeds with all six parameters inside their 95 % intervals", sum(colSums(inside) == 6),
       ceiling(0.9 * n)),
  list("M3: share of single parameters inside their 95 % intervals", mean(inside), 0.95))
scattered <- if (length(sampler_seeds) > 1) lapply(c("M1", "M2", "M3"), function(model) {
  list(paste0(model, ": standard deviation of log10 L over ", length(sampler_seeds),
              " sampler seeds"),
       scatter(model), 0.3)
})
as_row <- function(row, most = FALSE) {
  list(name = row[[1]], value = row[[2]], required = row[[3]],
       holds = if (most) row[[2]] < row[[3]] else row[[2]] >= row[[3]])
}
rows <- c(lapply(rows, as_row), lapply(scattered, as_row, most = TRUE))
write_rows(rows, out)
for (row in rows) cat(sprintf("%-75s %8.3f  required %5.2f  %s\n", row$name, row$value,
                              row$required, if (row$holds) "holds" else "FAILS"))
cat(sprintf("mean log10 L: M1 %.1f, M2 %.1f, M3 %.1f; fits with a trusted evidence: %d of %d\n",
            mean(evidence[, 1]), mean(evidence[, 2]), mean(evidence[, 3]),
            sum(vapply(fits, `[[`, NA, "trusted")), length(fits)))
