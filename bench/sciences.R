#!/usr/bin/env Rscript
# The loop on records of other sciences (bench/sciences): a tank with a leak and a little rain, a
# battery cell with two causes, a greenhouse and a photovoltaic module whose causes the catalogues
# do not hold, a town where nothing is missing, a river under wind, glucose with two causes, a
# reactor that fouls, a drug that tissue takes up. What is named, what was hidden, and how many of
# the true values lie in their 95 % intervals (physical ones, and those of calibrated values).
# Usage: Rscript bench/sciences.R
#          [--records reservoir,cell,greenhouse,town,river,glucose,reactor,module,drug]
#          [--seed 1] [--runs 120] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
source(file.path(here, "intervals.R"))
suppressPackageStartupMessages(library(amiss))
known <- c("reservoir", "cell", "greenhouse", "town", "river", "glucose", "reactor", "module",
           "drug")
for (part in c("common", known)) source(file.path(here, "sciences", paste0(part, ".R")))
chosen <- strsplit(option("records", paste(known, collapse = ","), "town"), ",")[[1]]
if (!all(chosen %in% known))
  stop("--records: choose from ", paste(known, collapse = ", "), call. = FALSE)
seed <- as.numeric(option("seed", 1))
runs <- as.integer(option("runs", 120, 40))
quick <- if (smoke) list(max_steps = 1,
                         calibration = list(ais = list(pilot_chains = 48, groups = 4)),
                         attribution = list(surrogates = 19))

score_record <- function(name) {
  record <- get(paste0("draw_", name))(seed)
  started <- proc.time()[["elapsed"]]
  upgrade <- upgrade_model(record$base, record$measurements, record$catalogue, control = quick,
                           seed = seed, quiet = TRUE)
  listed <- function(x) if (length(x)) paste(x, collapse = ", ") else "nothing"
  adopted <- upgrade$models[-1]
  estimates <- tidy(upgrade)
  true <- record$true[intersect(names(record$true), estimates$term)]
  answers <- upgrade$models[[1]]$attribution$table
  data.frame(
    record = name, hidden = listed(record$hidden),
    adopted = listed(vapply(adopted, function(m) sprintf("%s (%s)", m$mechanism, m$verdict), "")),
    answers_to = listed(answers$boundary[answers$significant][1][any(answers$significant)]),
    verdict = summary(upgrade)$verdict, log10_bf = upgrade$gain$log10_bf, parameters = length(true),
    covered = sum(holds(estimates, true, "physical")),
    calibrated_covered = sum(holds(estimates, true)),
    rmse_before = upgrade$gain$rmse_validation[1], rmse_after = upgrade$gain$rmse_validation[2],
    noise = record$measurements$noise_sd, runs = upgrade$runs_total,
    seconds = proc.time()[["elapsed"]] - started)
}
rows <- do.call(rbind, lapply(chosen, score_record))
print(rows, digits = 3)
write_rows(rows, option("out", "sciences.json"))
