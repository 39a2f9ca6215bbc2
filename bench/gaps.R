#!/usr/bin/env Rscript
# What gaps in the record cost: the Twin House study O5 as it was measured, with a fifth of its
# hours without a measurement, drawn at random, and with a day in the middle of its calibration
# without one. The cause must be the same, and every parameter of the extended model lie in the 95 %
# interval that the whole record gives.
# Usage: Rscript bench/gaps.R [--threads 2] [--seed 1] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
`%or%` <- function(x, y) if (is.null(x)) y else x
seed <- as.numeric(option("seed", 1))
threads <- as.integer(option("threads", 2))
folder <- system.file("studies", package = "amiss")
study <- read_study(file.path(folder, "twinhouse_O5.yml"))
fields <- yaml::read_yaml(file.path(folder, "twinhouse_O5.yml"))
data <- utils::read.csv(file.path(folder, fields$data), stringsAsFactors = FALSE)
hour <- (seq_len(nrow(data)) - 1) %/% 6  # of six steps of ten minutes

# The study's measurements without those of the hours `lost`.
measured <- function(lost) {
  data[[fields$target]][hour %in% lost] <- NA
  measurements(data, time = fields$time, target = fields$target,
               boundary = as.character(unlist(fields$boundary)), noise_sd = fields$noise_sd,
               average = fields$average_h, calibrate = data$phase == "rolbs",
               validate = data$phase == "freefloat", warmup = fields$warmup_h, name = fields$study,
               unit = fields$unit)
}

calibrating <- unique(hour[data$phase == "rolbs"])
set.seed(seed)
middle <- stats::median(calibrating)
records <- list(whole = integer(),
                `a fifth at random` = sample(calibrating, length(calibrating) %/% 5),
                `a day in one block` = round(middle) + 0:23)
quick <- if (smoke) list(calibration = list(ais = list(pilot_chains = 48, groups = 4)),
                         attribution = list(surrogates = 19))
catalogue <- if (smoke) study$catalogue["south solar aperture"] else study$catalogue
class(catalogue) <- class(study$catalogue)

upgrades <- lapply(records, function(lost) {
  suppressMessages(upgrade_model(study$model, measured(lost), catalogue, runs = study$runs,
                                 control = c(list(max_steps = 1), quick), seed = seed,
                                 threads = threads,
                                 quiet = TRUE))
})
whole <- confint(upgrades$whole)
rows <- Map(function(name, upgrade) {
  both <- intersect(rownames(whole), names(coef(upgrade)))
  held <- coef(upgrade)[both] >= whole[both, 1] & coef(upgrade)[both] <= whole[both, 2]
  data.frame(record = name, rows = nobs(upgrade),
             cause = upgrade$named_cause$mechanism %or% NA_character_,
             verdict = upgrade$models[[length(upgrade$models)]]$verdict %or% NA_character_,
             log10_bf = upgrade$named_cause$log10_bf %or% NA_real_, parameters = length(both),
             within = sum(held), outside = paste(both[!held], collapse = ", "),
             rmse_validation = upgrade$gain$rmse_validation[2])
}, names(upgrades), upgrades)
table <- do.call(rbind, unname(rows))
print(table, digits = 3)
write_rows(table, option("out", "gaps.json"))
