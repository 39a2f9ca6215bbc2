# A paper-sized model, as a user would run it.

suppressPackageStartupMessages(library(amiss))
study <- read_study(system.file("studies", "paper_synthetic.yml", package = "amiss"))
m <- study$measurements
seconds <- system.time({
  emulator <- train_emulator(simulate_design(study$models[["M3"]], m, study$runs, seed = 1), m)
  paper <- calibrate_paper(emulator, m, seed = 1)
  fit <- calibrate(emulator, m, seed = 1)
  attribution <- attribute_discrepancy(fit, seed = 1)
})[["elapsed"]]
scaled("a paper-sized model: train, calibrate, both discrepancies, evidence", seconds, "s", 10)
measured("its evidence: standard error", paper$standard_error / log(10), "decade", 0.1)
