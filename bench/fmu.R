#!/usr/bin/env Rscript
# What an FMU costs, and what one that fails takes with it: the house of inst/examples/fmu by FMI
# 2.0 and 3.0 beside the same house as an R function, for three hours, a week and a year; and 200
# runs of which some crash and some hang. A run that succeeds must not be lost, and no process be
# left.
# Usage: Rscript bench/fmu.R [--runs 200] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
sources <- system.file("examples", "fmu", package = "amiss")
source(file.path(sources, "build.R"))
runs <- as.integer(option("runs", if (smoke) 10 else 200))

files <- lapply(
  2:3, function(version) build_house(tempfile(fileext = ".fmu"), version, sources = sources))
fmu <- function(file, ...) {
  fmu_simulator(file, free("R_out", uniform(0.005, 0.02)), ..., output = "T_air",
                inputs = c("Te", "P"), time_limit = 2)
}

# The same system in R, by the matrix exponential of an hour.
in_r <- function(values, drivers) {
  a <- rbind(c(-350, 200, 100) / 2e6, c(200, -200 - 1 / values[["R_out"]], 0) / 3e7,
             c(100, 0, -100) / 1e5)
  by <- eigen(a)
  step <- by$vectors %*% diag(exp(3600 * by$values)) %*% solve(by$vectors)
  input <- rbind(c(50, 0) / 2e6, c(1 / values[["R_out"]], 0) / 3e7, c(0, 1) / 1e5)
  rest <- -solve(a, input %*% t(drivers))
  state <- rep(20, 3)
  air <- numeric(nrow(drivers))
  for (row in seq_len(nrow(drivers))) {
    last <- state
    state <- rest[, row] + step %*% (state - rest[, row])
    air[row] <- (last[1] + state[1]) / 2
  }
  air
}
simulators <- list(`R function` = function_simulator(in_r, free("R_out", uniform(0.005, 0.02)),
                                                     boundary = c("Te", "P")),
                   `FMI 2.0` = fmu(files[[1]]), `FMI 3.0` = fmu(files[[2]]))

drivers <- function(rows)
  cbind(Te = 5 + 6 * sin(seq_len(rows) / 4), P = ifelse(seq_len(rows) %% 24 < 8, 2000, 0))
values <- cbind(R_out = seq(0.006, 0.018, length.out = runs))
speed <- do.call(rbind, lapply(if (smoke) 24 else c(3, 168, 8760), function(rows) {
  some <- values[seq_len(if (rows > 1000) min(20, runs) else runs), , drop = FALSE]
  outputs <- list()
  of_each <- lapply(names(simulators), function(name) {
    # starts the process
    simulate_runs(simulators[[name]], some[1, , drop = FALSE], drivers(rows), 1)
    took <-
      system.time(out <- simulate_runs(simulators[[name]], some, drivers(rows), 1))[["elapsed"]]
    outputs[[name]] <<- out
    data.frame(what = name, rows = rows, runs = nrow(some), runs_per_s = nrow(some) / took,
               off = max(abs(out - outputs[[1]])))
  })
  do.call(rbind, of_each)
}))
print(speed, digits = 3)

faulty <- fmu(files[[1]], free("fault", uniform(0, 10)))
fault <- rep(0, runs)
# it ends in four ways
fault[seq(5, runs, by = 10)] <- rep_len(c(1, 4, 3, 7), length(seq(5, runs, by = 10)))
fault[seq(8, runs, by = 40)] <- 2                                                      # it hangs
took <- system.time(
  out <- suppressWarnings(simulate_runs(faulty, cbind(values, fault = fault), drivers(24), 1)))
good <- simulate_runs(simulators[["FMI 2.0"]], values, drivers(24), 1)
pids <- vapply(as.list(amiss:::fmu_workers), function(one) one$process$get_pid(), 0L)
for (worker in as.list(amiss:::fmu_workers)) amiss:::end_worker(worker)
left <- suppressWarnings(system2("pgrep",
                                 c("-f", shQuote(sprintf("serve_fmu[(]%d[)]", Sys.getpid()))),
                                 stdout = TRUE))
crash <- data.frame(runs = runs, ended = sum(fault %in% c(1, 3, 4, 7)), hung = sum(fault == 2),
                    succeeded = sum(fault == 0), lost = sum(is.nan(out[1, fault == 0])),
                    differ = sum(out[, fault == 0] != good[, fault == 0]), processes = length(pids),
                    left = length(left), seconds = took[["elapsed"]])
print(crash, digits = 3)
write_rows(list(speed = speed, crash = crash), option("out", "fmu.json"))
