# Twin House O5 by given runs alone: the sun's way into the room is missing, and the simulator cannot be changed.
# Usage: Rscript given_runs.R [FOLDER for the report]
library(amiss)

record <- read.csv(system.file("extdata", "twinhouse_exp1_O5_rolbs_freefloat_10min.csv.gz", package = "amiss"))
room <- measurements(record, time = "time_cet", target = "Ti", unit = "K", noise_sd = 0.1, average = 1, warmup = 24,
                     boundary = ~ Te + Gv_S + Gv_W + Lw_h + Ws + circular(Wd) + P_living + T_kitchen,
                     calibrate = record$phase == "rolbs", validate = record$phase == "freefloat", name = "House O5")

# ---- Elsewhere: 150 runs of a room that no sun reaches, neither through its windows nor on its walls.
shaded <- source(system.file("studies", "twinhouse_model.R", package = "amiss"), chdir = TRUE)$value
shaded <- change_component(shaded, "west window", sun = NULL, solar_factor = 0)
shaded <- change_component(shaded, "south facade", sun = NULL)
shaded <- change_component(shaded, "west facade", sun = NULL)
design <- simulate_design(shaded, room, runs = 150, seed = 1)$values
runs <- lapply(c("rolbs", "freefloat"), function(phase) {
  rows <- record$phase == phase
  held <- ifelse(seq_len(sum(rows)) <= 24 * 6, record$Ti[rows], NA)  # the first day follows the measurement
  simulate_runs(shaded, design, as.matrix(record[rows, driver_names(shaded)]), step_h = 1 / 6, hold = held)
})

# ---- Here: only the design, the runs and the measurements are known.
given <- ensemble(design, do.call(rbind, runs), unname(free_parameters(shaded)), measurements = room)
upgrade <- upgrade_model(given, room, responses(room, c(Gv_S = "W/m2", Gv_W = "W/m2")), seed = 1)
print(upgrade)
print(summary(upgrade))
folder <- commandArgs(trailingOnly = TRUE)
if (length(folder)) report(upgrade, file.path(folder[1], "given_runs.html"))
