# A Twin House as a thermal network that the circuit simulator ngspice solves (Debian: apt-get install ngspice). The
# network believes that no sun enters; in house O5 the blinds were open.
# Usage: Rscript twinhouse.R
library(amiss)

folder <- system.file("examples", "ngspice", package = "amiss")
minutes <- read.csv(system.file("extdata", "twinhouse_exp1_O5_rolbs_freefloat_10min.csv.gz", package = "amiss"))
ends <- seq(6, nrow(minutes), 6)
record <- data.frame(minutes[ends, c("time_cet", "phase")],
                     rowsum(minutes[-(1:2)], rep(ends, each = 6)) / 6)  # means of hours
room <- measurements(record, time = "time_cet", target = "Ti", unit = "K", warmup = 24,
                     noise_sd = 0.3,  # of the sensor, and of what two capacities leave out
                     boundary = ~ Te + Gv_S + Ws + P_living, name = "House O5",
                     calibrate = record$phase == "rolbs", validate = record$phase == "freefloat")

network <- program_simulator(
  c("sh", "run.sh"),
  free("c_air", uniform(2e5, 2e6), "J/K", "capacity of the air and what follows it"),
  free("c_mass", uniform(5e6, 5e7), "J/K", "capacity of walls, floor and ceiling"),
  free("h_mass", uniform(50, 600), "W/K", "between both"),
  free("h_out", uniform(5, 40), "W/K", "windows, leaks and facade"),
  free("h_door", uniform(0, 200), "W/K", "door to the corridor"),
  free("h_rooms", uniform(1, 40), "W/K", "partition to the kitchen, ceiling and floor, each"),
  templates = c(room.cir = file.path(folder, "room.cir"), run.sh = file.path(folder, "run.sh")),
  output = function(directory) utils::read.table(file.path(directory, "out.txt"))[-1, 2],
  boundary = c("Te", "Ti_corridor", "T_kitchen", "T_attic_w", "T_cellar", "vent_supply_m3h", "vent_supply_T",
               "P_living"),
  cache = file.path(tempdir(), "ngspice"), name = "room by ngspice")

# Each mechanism is the circuit with other lines.
more <- function(...) list(room.cir = function(lines) append(lines, c(...), which(lines == ".control") - 1))
ideas <- catalogue(
  mechanism("south sun", boundary = "Gv_S", sentence = "Sun enters through the south windows.", edit = function(model) {
    with_template(model, more("Bsouth 0 air I={{south}}*v(Gv_S)"),
                  free("south", uniform(0, 6), "m2", "effective south aperture"), boundary = "Gv_S")
  }),
  mechanism("wind", boundary = c("Ws", "Te"), sentence = "Wind drives outdoor air in.", edit = function(model) {
    with_template(model, more("Bwind air 0 I={{wind}}*v(Ws)*(v(air)-v(Te))"),
                  free("wind", uniform(0, 10), "W/K per m/s", "exchange by wind"), boundary = "Ws")
  }))

# ---- Few checks, and a fast sampler.
quick <- list(max_steps = 1, rounds = 3, attribution = list(surrogates = 19),
              calibration = list(ais = list(pilot_chains = 48, groups = 4)))
upgrade <- upgrade_model(network, room, ideas, control = quick, seed = 1, quiet = TRUE)
print(upgrade)
estimates <- tidy(upgrade)
print(estimates[estimates$term %in% c("south", "wind"), ])
