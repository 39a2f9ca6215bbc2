#!/usr/bin/env Rscript
# What the steps of a simulator do to names and intervals: a store of soil water that rain fills and
# that drains by a power of its level, in explicit steps of an hour down to a sixteenth of it; the
# truth takes sixty in an hour. Nothing is hidden, or rain that bypasses the store, or a gauge that
# catches too little.
# Usage: Rscript bench/steps.R [--worlds 60] [--seed 81001] [--workers N] [--out FILE]
#
# A row each: the steps, what they change at the true values over the noise, what was hidden and
# adopted, whether it is named, and whether it would be if the steps were no doubt (R/steps.R); and
# of the last model's parameters how many intervals hold the truth, of those that are told to move
# with finer steps and of the others.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
source(file.path(here, "intervals.R"))
seeds <- as.integer(option("seed", "81001")) +
  seq_len(as.integer(option("worlds", "60", smallest = "1"))) - 1L
workers <- option("workers")
common <- file.path(normalizePath(here), "sciences", "common.R")

one_world <- function(seed, common, smoke) {
  suppressPackageStartupMessages(library(amiss))
  source(common, local = TRUE)
  level <- function(values, rain, sun, step_h, parts) {
    water <- values[["start"]]
    out <- numeric(length(rain))
    for (i in seq_along(rain)) {
      for (j in seq_len(parts)) {
        change <- rain[i] - values[["k"]] * (water / 30)^values[["b"]] -
          values[["use"]] * sun[i] * water / 30
        water <- max(0, water + step_h / parts * change)
      }
      out[i] <- water
    }
    out
  }
  set.seed(seed)
  n <- 360
  rain <- numeric(n)
  for (start in sort(sample(n - 8, 20))) {
    wet <- start + 0:sample(1:6, 1)
    rain[wet] <- rain[wet] + stats::rgamma(length(wet), 0.8, 0.3)
  }
  sun <- pmax(0, sin(2 * pi * (seq_len(n) %% 24 - 6) / 24)) *
    pmin(1, pmax(0.1, 0.6 + stationary(n, 0.95, 0.3)))
  true <- c(k = stats::runif(1, 2, 8), b = stats::runif(1, 4, 8), use = stats::runif(1, 0.1, 0.5),
            start = 20)
  hidden <- sample(c("nothing", "nothing", "bypass", "undercatch"), 1)
  if (hidden == "bypass") true[["bypass"]] <- stats::runif(1, 0.15, 0.5)
  if (hidden == "undercatch") true[["catch"]] <- stats::runif(1, 1.1, 1.4)
  reaching <- switch(hidden, nothing = rain, bypass = rain - true[["bypass"]] * pmax(0, rain - 2),
                     undercatch = rain * true[["catch"]])
  noise <- stats::runif(1, 0.1, 0.3)
  parts <- sample(c(1, 2, 4, 8, 16), 1)
  clean <- level(true, reaching, sun, 1, 60)
  data <- data.frame(hour = seq_len(n), rain, sun, water = clean + noise_of(n, noise))
  record <- measurements(data, time = "hour", target = "water", boundary = ~ rain + sun,
                         noise_sd = noise, validate = data$hour > 240)
  base <- function_simulator(function(values, drivers, info) {
    level(values, drivers[, "rain"], drivers[, "sun"], info$step_h, parts)
  }, free("k", uniform(1, 12), "mm/h"), free("b", uniform(3, 10)),
     free("use", uniform(0, 1), "mm/h"), free("start", uniform(10, 30), "mm"),
     boundary = c("rain", "sun"), name = "soil water")
  with_rain <- function(name, sentence, parameter, reaching) {
    new_mechanism(name, "rain", sentence, parameter, function(values, drivers, info, base) {
      drivers[, "rain"] <- reaching(drivers[, "rain"], values[[parameter$name]])
      base(values, drivers, info)
    })
  }
  mechanisms <- catalogue(
    with_rain("bypass", "Strong rain bypasses the store.", free("bypass", uniform(0, 0.8)),
              function(rain, share) rain - share * pmax(0, rain - 2)),
    with_rain("undercatch", "The gauge catches too little, or too much.",
              free("catch", uniform(0.6, 1.6)), function(rain, factor) rain * factor),
    drifting_sensor(0.3, "mm/d"))
  off <- level(true, reaching, sun, 1, parts) - clean
  control <- if (smoke) list(max_steps = 1, rounds = 1, attribution = list(surrogates = 19),
                             calibration = list(ais = list(pilot_chains = 48, groups = 4)))
  upgrade <- upgrade_model(base, record, mechanisms, control = control, seed = seed, quiet = TRUE)
  adopted <- upgrade$models[-1]
  doubts <- lapply(adopted, `[[`, "doubts")
  verdicts <- vapply(adopted, `[[`, "", "verdict")
  otherwise <- lengths(lapply(doubts, function(d) d[!grepl("shorter steps", d)])) == 0 &
    verdicts != "stand-in"
  names <- vapply(adopted, `[[`, "", "mechanism")
  table <- tidy(upgrade)
  held <- holds(table, true[intersect(names(true), table$term)])
  moves <- amiss:::step_moves(upgrade$models[[length(upgrade$models)]])
  told <- names(held) %in% names(moves)[abs(moves) > 1]
  wrong <- names != hidden
  data.frame(seed, parts, off = sqrt(mean(off^2)) / noise, hidden, adopted = toString(names),
             verdicts = toString(verdicts), right = hidden %in% names,
             right_named = any(verdicts == "named" & !wrong),
             right_otherwise = any(otherwise & !wrong),
             wrong_named = any(verdicts == "named" & wrong),
             wrong_otherwise = any(otherwise & wrong), told = sum(told),
             told_held = sum(held & told), silent = sum(!told), silent_held = sum(held & !told))
}

if (!is.null(workers)) future::plan(future::multisession, workers = as.integer(workers))
rows <- do.call(rbind, future.apply::future_lapply(seeds, one_world, common, smoke,
                                                   future.seed = NULL, future.scheduling = Inf))
write_rows(rows, option("out", "steps.json"))
there <- rows[rows$hidden != "nothing", ]
cat(sprintf("named that is not there: %d of %d worlds, %d if steps were no doubt\n",
            sum(rows$wrong_named), nrow(rows), sum(rows$wrong_otherwise)),
    sprintf("hidden: %d, adopted %d, named %d, %d if steps were no doubt\n", nrow(there),
            sum(there$right), sum(there$right_named), sum(there$right_otherwise)),
    sprintf("95 %% intervals that hold the truth: %d of %d told to move, %d of %d others\n",
            sum(rows$told_held), sum(rows$told), sum(rows$silent_held), sum(rows$silent)), sep = "")
