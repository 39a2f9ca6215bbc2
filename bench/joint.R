#!/usr/bin/env Rscript
# Records calibrated together, on the Twin Houses: (a) temperature and heat flux into the west wall
# of N2, and (b) the temperatures of N2 and O5 at once with shared walls, O5's model with the sun
# through its open blinds and a door, an infiltration and a start of its own. For each: how much
# narrower the parameters get, the evidence of sharing them (a decision of its own: that of all
# records together against the product of those of each), and which conditions drive the
# discrepancies.
# Usage: Rscript bench/joint.R [--threads 2] [--seed 1] [--runs 150] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
seed <- as.numeric(option("seed", 1))
threads <- as.integer(option("threads", 2))
runs <- as.integer(option("runs", 150, 40))
folder <- system.file("studies", package = "amiss")
quick <- list(ais = list(pilot_chains = 48, groups = 4), exact = 40)
control <- list(calibration = if (smoke) quick)
asked <- if (smoke) list(surrogates = 19)

house <- function(name) read_study(file.path(folder, paste0("twinhouse_", name, ".yml")))
# A second series of a study's record, with noise of its own.
beside <- function(name, target, unit, noise_sd) {
  fields <- yaml::read_yaml(file.path(folder, paste0("twinhouse_", name, ".yml")))
  data <- utils::read.csv(file.path(folder, fields$data), stringsAsFactors = FALSE)
  measurements(data, time = fields$time, target = target,
               boundary = unlist(Map(function(column, field) {
                 if (isTRUE(field$circular)) sprintf("circular(%s)", column) else column
               }, names(fields$boundary), fields$boundary), use.names = FALSE),
               noise_sd = noise_sd,
               average = fields$average_h, calibrate = data$phase == "rolbs",
               validate = data$phase == "freefloat", warmup = fields$warmup_h, unit = unit,
               name = paste(name, target))
}
n2 <- house("N2")
o5 <- house("O5")
sun <- o5$catalogue[["south solar aperture"]]

# The houses have the same walls; what people, doors and the summer before them did to each is its
# own.
of_o5 <- rename_parameters(sun$edit(o5$model), door = "door O5", ach = "ach O5",
                           initial_wall_offset = "initial_wall_offset O5")

cases <- list(
  `temperature and heat flux` = list(
    simulators = list(Ti = n2$model, flux = zone_flux(n2$model, "west facade", air = "Ti")),
    measurements = list(Ti = n2$measurements, flux = beside("N2", "hf_wall_west_in", "W/m2", 0.3))),
  `two houses` = list(
    simulators = list(N2 = n2$model, O5 = of_o5),
    measurements = list(N2 = n2$measurements, O5 = o5$measurements)))

studied <- lapply(cases, function(case) {
  ensembles <- simulate_jointly(case$simulators, case$measurements, runs, seed, threads)
  alone <- Map(function(ensemble, m) {
    calibrate_refined(ensemble, m, control = control, seed = seed, threads = threads, quiet = TRUE)
  }, ensembles, case$measurements)
  joint <- calibrate_jointly(ensembles, case$measurements, control = control, seed = seed,
                             threads = threads, quiet = TRUE)
  list(alone = alone, joint = joint,
       attribution = attribute_discrepancy(joint, asked, seed = seed, threads = threads))
})

rows <- do.call(rbind, unname(Map(function(name, s) {
  together <- confint(s$joint)
  do.call(rbind, unname(Map(function(record, fit) {
    own <- confint(fit)
    both <- together[rownames(own), , drop = FALSE]
    data.frame(case = name, record = record, parameter = rownames(own), alone_lower = own[, 1],
               alone_upper = own[, 2], joint_lower = both[, 1], joint_upper = both[, 2],
               width = (both[, 2] - both[, 1]) / (own[, 2] - own[, 1]), row.names = NULL)
  }, names(s$alone), s$alone)))
}, names(studied), studied)))
evidence <- do.call(rbind, unname(Map(function(name, s) {
  each <- sum(vapply(s$alone, `[[`, 0, "log_evidence"))
  predicted <- suppressWarnings(predict(s$joint, use = "validate"))
  rmse <- vapply(predicted, function(p) sqrt(mean((p$observed - p$mean)^2, na.rm = TRUE)), 0)
  data.frame(case = name, log10_shared = (s$joint$log_evidence - each) / log(10),
             trusted = s$joint$trust$trusted, runs = s$joint$runs_made + runs * length(s$alone),
             rmse_held_out = paste(names(rmse), signif(rmse, 3), collapse = ", "))
}, names(studied), studied)))
print(rows, digits = 3)
print(evidence, digits = 3)
for (s in studied) print(s$attribution)
write_rows(list(parameters = rows, evidence = evidence,
                attribution = lapply(studied, function(s) s$attribution$table)),
           option("out", "joint.json"))
