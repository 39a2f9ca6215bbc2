# Calibrations of one record by other packages and by ours (bench/peers/calibrations.R): effective
# draws per CPU second of one core, over the whole of each call. SEPIA is in no package registry
# (its method: bench/peers/ball_drop.R).

source(file.path(root, "bench", "peers", "install.R"), local = TRUE)
calibrations <- run_with_peers(root, "calibrations.R", "RobustCalibration")
rate <- calibrations$draws / calibrations$seconds
peer <- !startsWith(calibrations$name, "amiss")
name <- paste0("effective draws per second, ", calibrations$name)
for (i in which(peer)) measured(name[i], rate[i], "1/s")
measured("effective draws per second, SEPIA: could not be installed", NA_real_, "1/s")
for (i in which(!peer)) measured(name[i], rate[i], "1/s", max(rate[peer]), above = TRUE)
