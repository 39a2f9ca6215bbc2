#!/usr/bin/env Rscript
# The loop over two houses at once: N2 and O5 share the parameters of their walls; a door, an
# infiltration and a start are each one's own. Of the catalogue, the sun through open blinds is
# tried in O5 alone and in both, glazing and heater lag in both.
# Usage: Rscript bench/joint_upgrade.R [--threads 1] [--seed 1] [--runs 150] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
seed <- as.numeric(option("seed", 1))
threads <- as.integer(option("threads", 1))
runs <- as.integer(option("runs", 150, 60))
control <- list(max_steps = 2)
if (smoke) {
  control <- list(max_steps = 1, rounds = 1,
                  calibration = list(ais = list(pilot_chains = 48, groups = 4)),
                  attribution = list(surrogates = 19))
}

house <- function(name)
  read_study(system.file("studies", paste0("twinhouse_", name, ".yml"), package = "amiss"))
houses <- list(N2 = house("N2"), O5 = house("O5"))
models <- lapply(houses, `[[`, "model")
models$O5 <- rename_parameters(models$O5, door = "door O5", ach = "ach O5",
                               initial_wall_offset = "initial_wall_offset O5")
acting_in <- function(name, records) {
  entry <- houses$O5$catalogue[[name]]
  mechanism(paste(name, "of", paste(records, collapse = " and ")), boundary = entry$boundary,
            sentence = entry$sentence,
            edit = function(model, record) if (record %in% records) entry$edit(model) else model)
}
both <- names(houses)
tried <- if (smoke) catalogue(acting_in("south solar aperture", "O5")) else {
  catalogue(acting_in("south solar aperture", "O5"), acting_in("south solar aperture", both),
            acting_in("glazing U-value", both), acting_in("heater lag", both))
}

began <- proc.time()[["elapsed"]]
upgrade <- suppressWarnings(upgrade_model(models, lapply(houses, `[[`, "measurements"), tried,
                                          runs = runs, control = control, seed = seed,
                                          threads = threads, quiet = TRUE))
rows <- do.call(rbind, lapply(upgrade$models, function(model) {
  entry <- upgrade$candidates[upgrade$candidates$from == c(model$parent, "")[1] &
                                upgrade$candidates$mechanism == c(model$mechanism, "")[1], ]
  do.call(rbind, lapply(names(model$records), function(name) {
    scores <- model$records[[name]]$scores
    data.frame(model = model$name, record = name, log10_bf = c(entry$log10_bf, NA)[1],
               verdict = c(model$verdict, NA)[1], doubts = paste(model$doubts, collapse = "; "),
               rmse_calibration = scores$calibrate[["rmse"]],
               rmse_validation = scores$validate[["rmse"]])
  }))
}))
rows$runs_total <- upgrade$runs_total
rows$wall_s <- proc.time()[["elapsed"]] - began
print(rows, digits = 3)
write_rows(rows, option("out", "joint_upgrade.json"))
