#!/usr/bin/env Rscript
# How fast a network is: one run of four nodes over 10,000 rows, with and without slopes, and with a
# link that wind multiplies; beside lsoda of deSolve, and beside the R function of the benchmark's
# networks (hidden_effects/network.R). Each is timed by the processor's time of this session,
# alternately, and the medians are told.
# Usage: Rscript bench/network.R [--rows 10000] [--repeats 5] [--seed 1] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
rows <- as.integer(option("rows", 10000, smallest = 300))
repeats <- as.integer(option("repeats", 5, smallest = 1))

scope <- worlds_scope(here, c("worlds", "least_squares", "network"))
set.seed(as.numeric(option("seed", 1)))
described <- scope$with_past(scope$base_network("thick wall"), 20, 5)
house <- scope$network_simulator(described, 1)
parameters <- free_parameters(house)
hour <- seq_len(rows)
drivers <- cbind(Te = 5 + 4 * sin(hour / 4), Gv = pmax(0, 400 * sin(hour / 4)),
                 P = ifelse(hour %% 8 < 3, 2, 0))
windy <- add_component(house,
                       network_link("air", "Te", conductance = 0.02, by = "wind", name = "leak"))
wind <- cbind(drivers, wind = 3 + 2 * cos(hour / 5))
draws <- function(n)
  amiss:::unit_to_values(matrix(stats::runif(n * length(parameters)), n), parameters)

# The same equations for a solver of differential equations, restarted at each row, where the
# drivers jump.
by_desolve <- function(values) {
  a <- 3 / values[["C_wall"]]
  g <- c(1 / values[["R_inside"]], rep(1 / values[["R_wall"]], 2), 1 / values[["R_outside"]])
  heat <- function(t, x, d) {
    flow <- g * (c(x[-1], d[["Te"]]) - x)
    list(c((flow[1] + d[["P"]]) / values[["C_air"]], a * (flow[2] - flow[1]),
           a * (flow[3] - flow[2]), a * (flow[4] - flow[3])))
  }
  x <- rep(20, 4)
  vapply(hour, function(k) {
    x <<- deSolve::lsoda(x, c(k - 1, k), heat, drivers[k, ])[2, -1]
    x[1]
  }, 0)
}

plan <- scope$network_plan(described)
cases <- list(
  run = function(n) simulate_runs(house, draws(n), drivers, 1),
  slopes = function(n) for (i in seq_len(n)) slopes(house, draws(1), drivers, 1),
  `run by wind` = function(n) simulate_runs(windy, draws(n), wind, 1),
  `slopes by wind` = function(n) for (i in seq_len(n)) slopes(windy, draws(1), wind, 1),
  `R function` = function(n)
    for (i in seq_len(n)) scope$network_output(plan, draws(1)[1, ], drivers, 1),
  deSolve = function(n) if (requireNamespace("deSolve", quietly = TRUE)) by_desolve(draws(1)[1, ]))
times <- c(run = 200, slopes = 20, `run by wind` = 20, `slopes by wind` = 5, `R function` = 20,
           deSolve = 1)

seconds <- function(name) sum(system.time(cases[[name]](times[[name]]))[1:2]) / times[[name]]
taken <- vapply(names(cases), function(name) stats::median(replicate(repeats, seconds(name))), 0)
if (!requireNamespace("deSolve", quietly = TRUE)) taken["deSolve"] <- NA
table <- data.frame(what = names(cases), rows = rows, ms = 1e3 * taken,
                    over_a_run = taken / taken[["run"]], row.names = NULL)
print(table, digits = 3)

# They are the same model: the means of rows by both, and the values at the ends of rows, from a
# uniform start.
at <- draws(1)
mean_off <- max(
  abs(simulate_runs(house, at, drivers, 1)[, 1] - scope$network_output(plan, at[1, ], drivers, 1)))
end_off <- NA
if (requireNamespace("deSolve", quietly = TRUE)) {
  same <- change_component(house, "network", output_at = "end")
  for (node in c("air", "wall1", "wall2", "wall3")) same <- change_component(same, node, start = 20)
  same <- change_component(same, "network", before = list())
  end_off <- max(abs(simulate_runs(same, at, drivers, 1)[, 1] - by_desolve(at[1, ])))
}
message(sprintf(
  "largest difference: %.1e K from the R function, %.1e K from lsoda (its tolerance is 1e-6)",
  mean_off, end_off))
if (!is.null(out <- option("out"))) write_rows(table, out)
