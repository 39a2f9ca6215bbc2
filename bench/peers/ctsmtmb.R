#!/usr/bin/env Rscript
# The likelihood of the rival "kalman" (bench/rivals/kalman.R) beside that of package ctsmTMB, at
# the same values of the parameters of the same stochastic networks.
# Usage: Rscript bench/peers/ctsmtmb.R [--worlds 2,4,13] [--points 3] [--substeps 64,256]
#                                      [--seed 1] [--out FILE]
# tools/ does not install ctsmTMB, which needs newer packages than Debian 12 has: with R 4.2 ctsmTMB
# 1.1.1, RTMB 2.0 (compiled as C++17), TMB 1.9.25, Rcpp 1.1.2 and RcppEigen 0.3.4.0.2 of CRAN and
# Deriv 4.2.0 (sgsokol/Deriv, tag v4.2.0) work in a library of their own, which R_LIBS names.
#
# ctsmTMB knows observations at instants only, and begins at numbers. Here its model runs in a time
# of its own, stretched by inputs: `begin` (a constant drift takes each node from zero to where it
# starts, which leaves the covariance as it is), `run` (the network; `g` gathers the integral of the
# air's temperature) and `empty` (all stands still but the integral, which falls to 3e-12 of
# itself). So an observation at the end of an interval is its mean, as in kalman_deviance(). What
# differs then is ctsmTMB's solver of the moments' equations (rk4, `substeps` a row of the drivers),
# and falls with the fourth power of its step.

here <- dirname(dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1])))
source(file.path(here, "options.R"))
numbers <- function(text) as.numeric(strsplit(text, ",")[[1]])
seeds <- numbers(option("worlds", "2,4,13", smallest = "2"))
points <- as.integer(option("points", "3", smallest = "1"))
substeps <- numbers(option("substeps", "64,256", smallest = "16"))
seed <- as.integer(option("seed", "1"))
out <- option("out", "ctsmtmb.json")
suppressPackageStartupMessages({
  library(amiss)
  library(ctsmTMB)
})
scope <- worlds_scope(here)
for (part in c("choose", "kalman")) sys.source(file.path(here, "rivals", paste0(part, ".R")), scope)
little <- 0.013  # of a heater's range of capacities: nearly none

# Of a system with strings as its coefficients, the solution as strings; no pivots, which a
# conductance matrix does not need.
solve_strings <- function(a, b) {
  n <- length(b)
  minus <- function(x, y) if (y == "0") x else if (x == "0") paste0("(-", y, ")") else
    paste0("(", x, "-", y, ")")
  times <- function(x, y) if (x == "0" || y == "0") "0" else paste0("(", x, "*", y, ")")
  for (k in seq_len(n)) for (i in seq_len(n)[-seq_len(k)]) {
    if (a[i, k] == "0") next
    f <- paste0("(", a[i, k], "/", a[k, k], ")")
    for (j in k:n) a[i, j] <- if (j == k) "0" else minus(a[i, j], times(f, a[k, j]))
    b[i] <- minus(b[i], times(f, b[k]))
  }
  for (k in rev(seq_len(n))) {
    for (j in seq_len(n)[-seq_len(k)]) b[k] <- minus(b[k], times(a[k, j], b[j]))
    b[k] <- paste0("(", b[k], "/", a[k, k], ")")
  }
  b
}

# The network as equations of ctsmTMB, from its description (not from network_equations(), which is
# checked as well): x1 is the air, g the integral.
equations_of <- function(network) {
  nodes <- network$nodes
  n <- nrow(nodes)
  state <- function(node) if (node == "outside") "Te" else paste0("x", match(node, nodes$node))
  number <- function(name) if (name %in% names(network$fixed))
    sprintf("%.17g", network$fixed[[name]]) else name
  flows <- rep(list(character()), n)
  a <- matrix("0", n, n)
  outside <- rep("0", n)
  plus <- function(x, y) if (x == "0") y else paste0("(", x, "+", y, ")")
  for (l in seq_len(nrow(network$links))) {
    link <- network$links[l, ]
    g <- number(link$parameter)
    if (!link$conductance) g <- paste0("(1/", g, ")")
    ends <- c(link$from, link$to)
    for (k in 1:2) {
      i <- match(ends[k], nodes$node)
      j <- match(ends[3 - k], nodes$node)
      if (is.na(i)) next
      flows[[i]] <- c(flows[[i]], sprintf("%s*(%s-%s)", g, state(ends[3 - k]), state(ends[k])))
      a[i, i] <- plus(a[i, i], g)
      if (is.na(j)) outside[i] <- plus(outside[i], g)
      else a[i, j] <- if (a[i, j] == "0") paste0("(-", g, ")")
                      else paste0("(", a[i, j], "-", g, ")")
    }
  }
  for (k in seq_len(nrow(network$gains))) {
    gain <- network$gains[k, ]
    i <- match(gain$node, nodes$node)
    factor <- sprintf("%.17g*%s", gain$factor, gain$driver)
    if (!is.na(gain$parameter)) factor <- paste0(factor, "*", number(gain$parameter))
    flows[[i]] <- c(flows[[i]], factor)
  }
  held <- sprintf("%.17g", network$start[["held"]])
  b <- vapply(seq_len(n)[-1], function(i) {
    from_air <- if (a[i, 1] == "0") "0" else paste0("(-", a[i, 1], "*", held, ")")
    from_out <- if (outside[i] == "0") "0" else paste0("(", outside[i], "*remembered)")
    if (from_air == "0") from_out else if (from_out == "0") from_air else plus(from_air, from_out)
  }, "")
  start <- c(held, solve_strings(a[-1, -1, drop = FALSE], b))
  drift <- vapply(seq_len(n), function(i) {
    sprintf("run/(%.17g*%s)*(%s) + begin*(%s)", nodes$share[i], number(nodes$capacity[i]),
            paste(flows[[i]], collapse = " + "), start[i])
  }, "")
  scale <- c("air_noise", rep("wall_noise", n - 1))
  c(sprintf("dx%d ~ (%s)*dt + run*exp(%s)*dw%d", seq_len(n), drift, scale, seq_len(n)),
    sprintf("dg ~ (run*x1 - empty*30*g)*dt + 0*dw%d", n + 1))
}

make_model <- function(simulator, values, scales, count, step, lower = -Inf, upper = Inf) {
  model <- newModel()
  for (equation in equations_of(simulator$network)) model$addSystem(stats::as.formula(equation))
  model$addObs(stats::as.formula(sprintf("y ~ g/%.17g", step * count)))
  model$setVariance(y ~ exp(2 * sensor_noise))
  model$addInput(Te, Gv, P, run, begin, empty)
  all <- c(values, air_noise = scales[1], wall_noise = scales[2], sensor_noise = scales[3])
  lower <- rep_len(lower, length(all))
  upper <- rep_len(upper, length(all))
  given <- lapply(seq_along(all), function(k)
    c(initial = all[[k]], lower = lower[[k]], upper = upper[[k]]))
  do.call(model$setParameter, stats::setNames(given, names(all)))
  n <- nrow(simulator$network$nodes)
  model$setInitialState(list(x0 = numeric(n + 1), p0 = diag(c(rep(1e-4, n), 0))))
  model
}

# Rows for ctsmTMB: one to begin, then for each interval its rows of drivers and one that empties
# the integral. `y` stands where the interval ends.
stretched <- function(drivers, y, count, step, substeps) {
  one <- count + 1
  rows <- length(y) * one
  slot <- (seq_len(rows) - 1) %% one
  block <- (seq_len(rows) - 1) %/% one
  runs <- slot < count
  data <- data.frame(Te = 0, Gv = 0, P = 0, run = as.numeric(runs), begin = 0,
                     empty = as.numeric(!runs), y = NA_real_)[rep(1, rows), ]
  data$run <- as.numeric(runs)
  data$empty <- as.numeric(!runs)
  data[runs, scope$network_conditions] <- drivers[block[runs] * count + slot[runs] + 1, ]
  data$y[!runs] <- y[block[!runs] + 1]
  lasts <- c(1, ifelse(runs, step, 1))
  data <- rbind(transform(data[1, ], run = 0, begin = 1, y = NA), data)
  data <- rbind(data, data[nrow(data), ])
  data$y[nrow(data)] <- NA
  data$t <- c(0, cumsum(lasts))
  rownames(data) <- NULL
  list(data = data, timestep = c(1, ifelse(runs, step / substeps, 1 / 32)))
}

record_of <- function(world) {
  m <- world$measurements
  y <- replace(m$y, m$use != "calibrate", NA)
  y <- y[seq_len(max(which(!is.na(y))))]
  list(drivers = m$raw$drivers[, scope$network_conditions], y = y, count = m$per_step,
       step = world$base$step, sensor = log(m$noise_sd[1]))
}

own_log_likelihood <- function(simulator, values, record, scales,
                               deviance = scope$kalman_deviance) {
  plan <- scope$network_plan(simulator$network)
  -0.5 * deviance(scope$network_equations(plan, values), record$drivers, record$y, record$count,
                  record$step, scales)
}

# By ctsmTMB's filter in C++, from its innovations and their variances: the same numbers as its
# likelihood(), which needs a minute a model to be taped.
ctsm_log_likelihood <- function(model, record, substeps, values) {
  rows <- stretched(record$drivers, record$y, record$count, record$step, substeps)
  found <- model$filter(rows$data, pars = values, method = "ekf", ode.solver = "rk4",
                        ode.timestep = rows$timestep, silent = TRUE)
  seen <- !is.na(rows$data$y)
  e <- found$residuals$residuals[seen, "y"]
  s <- found$residuals$sd[seen, "y"]
  sum(stats::dnorm(e, 0, s, log = TRUE))
}

# The fastest rate of a network, an hour.
fastest <- function(simulator, values) {
  equations <- scope$network_equations(scope$network_plan(simulator$network), values)
  n <- length(equations$root)
  max(eigen(equations$root * equations$loss * rep(equations$root, each = n), TRUE)$values)
}

# Models of a world: its base, its base with what is hidden in it, and with a heater.
models_of <- function(world) {
  names <- c("base", unique(c(world$kinds, "heater state")))
  stats::setNames(lapply(names, function(name) if (name == "base") world$base else
    world$catalogue[[name]]$edit(world$base)), names)
}

# Where to compare: in the middle of the priors, and at places drawn, with scales of their own.
# The last place has what is added, a heater's capacity say, nearly gone: a fast node.
points_of <- function(simulator, record, points, seed, added) {
  parameters <- free_parameters(simulator)
  p <- length(parameters)
  set.seed(seed)
  lapply(seq_len(points + length(added)), function(k) {
    unit <- if (k == 1) rep(0.5, p) else stats::runif(p, 0.1, 0.9)
    if (k > points) unit <- replace(rep(0.5, p), match(added, names(parameters)), little)
    scales <- if (k == 1 || k > points) c(-3, -3, record$sensor) else
      c(stats::runif(2, -6, 0), record$sensor + stats::runif(1, -0.5, 0.5))
    list(values = amiss:::unit_to_values(t(unit), parameters)[1, ], scales = scales)
  })
}

one_point <- function(world, name, simulator, record, model, at, k) {
  values <- c(at$values, air_noise = at$scales[1], wall_noise = at$scales[2],
              sensor_noise = at$scales[3])
  own <- own_log_likelihood(simulator, at$values, record, at$scales)
  theirs <- vapply(substeps, function(j) ctsm_log_likelihood(model, record, j, values), 0)
  data.frame(world = world$seed, model = name, observations = sum(!is.na(record$y)), point = k,
             fastest = fastest(simulator, at$values) * record$step * record$count, own = own,
             ctsmTMB = theirs[length(theirs)], difference = own - theirs[length(theirs)])
}

rows <- do.call(rbind, lapply(seeds, function(of) {
  world <- scope$family_world("network", of)
  record <- record_of(world)
  # A gap, so that both have to go on without an observation.
  record$y[round(length(record$y) * c(0.6, 0.61, 0.8))] <- NA
  models <- models_of(world)
  do.call(rbind, lapply(names(models), function(name) {
    at <- points_of(models[[name]], record, points, seed + of,
                    if (name == "heater state") "C_heater")
    model <- make_model(models[[name]], at[[1]]$values, at[[1]]$scales, record$count, record$step)
    do.call(rbind, Map(one_point, list(world), name, list(models[[name]]), list(record),
                       list(model), at, seq_along(at)))
  }))
}))
rows$agrees <- abs(rows$difference) < 1e-3 + 1e-6 * abs(rows$own)
print(rows, digits = 9, row.names = FALSE)
write_rows(rows, out)
