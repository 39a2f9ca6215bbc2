# A batch job: the studies of both Twin Houses side by side, each in a session of its own, by the package future.
# Usage: Rscript batch.R OUT [--quick]
#   OUT: folder for the results: found.csv and, without --quick, OUT/N2 and OUT/O5 (report.html, figures, result.json)
#   --quick: a fast sampler, one check and one mechanism, to try the job; its numbers are worth nothing
library(amiss)

arguments <- commandArgs(trailingOnly = TRUE)
quick <- "--quick" %in% arguments
out <- setdiff(arguments, "--quick")
if (length(out) != 1) stop("usage: Rscript batch.R OUT [--quick]")

quickly <- function(study) {
  one <- do.call(catalogue, unname(study$catalogue[1]))
  upgrade_model(study$model, study$measurements, one, seed = 1, quiet = TRUE,
                control = list(max_steps = 1, rounds = 1, attribution = list(surrogates = 19),
                               calibration = list(ais = list(pilot_chains = 48, groups = 4))))
}

one_house <- function(house) {
  file <- system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss")
  upgrade <- if (quick) quickly(read_study(file)) else run_study(file, out = file.path(out, house), quiet = TRUE)
  data.frame(house = house, verdict = summary(upgrade)$tag, models = length(upgrade$models))
}

dir.create(out, showWarnings = FALSE, recursive = TRUE)
future::plan("multisession", workers = 2)
found <- future.apply::future_lapply(c("N2", "O5"), one_house, future.seed = TRUE, future.packages = "amiss")
found <- do.call(rbind, found)
write.csv(found, file.path(out, "found.csv"), row.names = FALSE)
print(found)
