# Calibrations of one record by this package and by RobustCalibration: 384 hours of a room whose
# simulator knows outdoor temperature and sun, but not the wind that cools it. Run by
# bench/speed/peers.R: Rscript bench/peers/calibrations.R FILE

file <- commandArgs(TRUE)[1]
suppressPackageStartupMessages(library(amiss))

weather <- synthetic_weather(16, step_h = 1, seed = 1)
drivers <- as.matrix(weather[c("Te", "Gv", "Ws")])
room <- function(values, drivers) {
  stays <- exp(-1 / values[["hours"]])
  warmth <- drivers[, "Te"] + values[["gain"]] * drivers[, "Gv"]
  as.numeric(stats::filter((1 - stays) * warmth, stays, "recursive", init = warmth[1]))
}
simulator <- function_simulator(room, free("hours", uniform(4, 40), "h"),
                                free("gain", uniform(0, 0.05)), boundary = c("Te", "Gv"))
set.seed(1)
wind <- -0.1 * (drivers[, "Ws"] - mean(drivers[, "Ws"]))
weather$Ti <- room(c(hours = 12, gain = 0.02), drivers) + wind + stats::rnorm(nrow(weather), 0, 0.1)

# Smallest effective number among the columns of a chain: autocorrelations are summed in pairs up to
# the first that is not positive (Geyer 1992).
effective_draws <- function(chain) {
  min(apply(chain, 2, function(x) {
    rho <- stats::acf(x, lag.max = length(x) - 1, plot = FALSE)$acf
    even <- 2 * seq_len(length(rho) %/% 2)
    pairs <- rho[even - 1] + rho[even]
    length(x) / (2 * sum(pairs[cumprod(pairs > 0) == 1]) - 1)
  }))
}

# Its simulator takes conditions and parameters without names. Its default proposals, a twentieth of
# the parameters' ranges, are hardly ever accepted on this record: these are about as wide as the
# posterior.
robust_calibration <- function(discrepancy, iterations) {
  model <- function(x, theta) room(c(hours = 4 + 36 * theta[1], gain = 0.05 * theta[2]),
                                   `colnames<-`(x, colnames(drivers)))
  utils::capture.output(fit <- RobustCalibration::rcalibration(
    drivers, weather$Ti, p_theta = 2, math_model = model, theta_range = cbind(c(0, 0), 1),
    S = iterations, S_0 = iterations / 4, discrepancy_type = discrepancy,
    sd_proposal = c(0.005, 0.01, rep(0.25, 4))))
  fit@post_sample[, 1:2]
}

# The whole of ours: runs, emulator, calibration. Five of them, since one takes less than a second.
amiss_calibration <- function(calibration, seed) {
  m <- measurements(weather, "hour", "Ti", ~ Te + Gv + Ws, noise_sd = 0.1)
  calibration(train_emulator(simulate_design(simulator, m, 50, seed = seed), m), m, seed = seed)
}

cpu_seconds <- function(expression) sum(system.time(expression)[c("user.self", "sys.self")])
ours <- function(name, calibration) {
  seconds <- cpu_seconds(fits <- lapply(1:5, function(seed) amiss_calibration(calibration, seed)))
  data.frame(name = paste("amiss,", name), seconds = seconds,
             draws = sum(vapply(fits, function(fit) 1 / sum(fit$weights^2), 0)))
}
theirs <- function(discrepancy, iterations) {
  seconds <- cpu_seconds(chain <- robust_calibration(discrepancy, iterations))
  data.frame(name = paste("RobustCalibration,", discrepancy), seconds = seconds,
             draws = effective_draws(chain))
}
rows <- rbind(ours("calibrate()", calibrate), ours("calibrate_paper()", calibrate_paper),
              theirs("GaSP", 10000), theirs("S-GaSP", 3000))  # a minute each, about
saveRDS(rows, file)
