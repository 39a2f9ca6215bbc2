#!/usr/bin/env Rscript
# The houses of bench/estate: Rscript bench/cluster/estate.R --write DIR --houses N --seed S writes
# the study of each house, of one design and with its own walls, weather and heating, and what it
# hides into DIR/truth.csv. --score DIR compares the survey in DIR/survey with that.
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "..", "options.R"))
suppressPackageStartupMessages(library(amiss))

# What a house may hide, and how often: parts with which its truth is made.
hidden <- list(
  nothing = list(share = 0.3),
  "sun on the air" = list(share = 0.25, part = function(house) {
    add_component(house, network_gain("air", "Gv", stats::runif(1, 1, 4) * 1e-3))
  }),
  "heater lag" = list(share = 0.2, part = function(house) {
    house <- add_component(house, network_node("heater", stats::runif(1, 0.5, 1.5)),
                           network_link("heater", "air", resistance = stats::runif(1, 0.5, 1.5)))
    change_component(house, "P to air", to = "heater")
  }),
  "direct loss to outdoors" = list(share = 0.25, part = function(house) {
    add_component(house, network_link("air", "Te", conductance = stats::runif(1, 0.03, 0.1)))
  }))

# Truth on a grid four times as fine; the sensor reads averages of an hour with noise of 0.1 K.
write_house <- function(folder, number, seed) {
  set.seed(seed + number)
  hours <- 24 * 14
  fine <- 4
  what <- sample(names(hidden), 1, prob = vapply(hidden, `[[`, 0, "share"))
  weather <- synthetic_weather(14, step_h = 1 / fine, seed = sample.int(1e6, 1))
  heating <- rolbs(hours, 1, power = stats::runif(1, 2, 4), seed = sample.int(1e6, 1))
  drivers <- cbind(Te = weather$Te, Gv = weather$Gv, P = rep(heating, each = fine))
  house <- source(file.path(here, "estate_model.R"))$value
  if (what != "nothing") house <- hidden[[what]]$part(house)
  values <- c(C_air = stats::runif(1, 0.6, 1.5), C_wall = stats::runif(1, 4, 10),
              R_inside = stats::runif(1, 0.5, 1.2), R_outside = stats::runif(1, 4, 8))
  run <- simulate_runs(house, t(values), drivers, step_h = 1 / fine)[, 1]
  hourly <- function(x) colMeans(matrix(x, fine))
  table <- data.frame(hour = seq_len(hours), Te = hourly(drivers[, "Te"]),
                      Gv = hourly(drivers[, "Gv"]), P = heating,
                      Ti = hourly(run) + stats::rnorm(hours, 0, 0.1))
  name <- sprintf("house_%02d", number)
  dir.create(file.path(folder, "studies", name), recursive = TRUE, showWarnings = FALSE)
  utils::write.csv(signif(table, 6), file.path(folder, "studies", name, "record.csv"),
                   row.names = FALSE)
  writeLines(c(paste("study:", name), "data: record.csv", "time: hour", "target: Ti", "unit: K",
               "boundary: [Te, Gv, P]", "noise_sd: 0.1", "warmup_h: 24",
               "calibrate: hour <= 240", "validate: hour > 240", paste("seed:", number),
               "model: ../../estate_model.R", "catalogue: ../../estate_catalogue.R"),
             file.path(folder, "studies", name, "study.yml"))
  data.frame(study = name, hidden = what)
}

write_estate <- function(folder) {
  houses <- as.integer(option("houses", "64"))
  seed <- as.integer(option("seed", "1"))
  dir.create(folder, recursive = TRUE, showWarnings = FALSE)
  file.copy(file.path(here, c("estate_model.R", "estate_catalogue.R")), folder)
  truth <- do.call(rbind, lapply(seq_len(houses), function(k) write_house(folder, k, seed)))
  utils::write.csv(truth, file.path(folder, "truth.csv"), row.names = FALSE)
}

score_estate <- function(folder) {
  truth <- utils::read.csv(file.path(folder, "truth.csv"))
  studies <- utils::read.csv(file.path(folder, "survey", "studies.csv"),
                             colClasses = c(named = "character", likely = "character",
                                            stand_in = "character"))
  all <- merge(truth, studies, by = "study", all.x = TRUE)
  found <- all[!is.na(all$verdict) & all$verdict != "no result", ]
  each <- function(text) strsplit(text, "; ", fixed = TRUE)
  is_in <- function(hidden, texts) mapply(`%in%`, hidden, each(texts))
  others <- function(texts) lengths(mapply(setdiff, each(texts), found$hidden, SIMPLIFY = FALSE))
  adopted <- paste(found$named, found$likely, found$stand_in, sep = "; ")
  adopted <- gsub("(^(; )+|(; )+$)", "", gsub("(; )+", "; ", adopted))
  something <- found$hidden != "nothing"
  result <- list(
    houses = nrow(all), without_result = nrow(all) - nrow(found), hide_something = sum(something),
    right_adopted = sum(is_in(found$hidden, adopted)[something]),
    right_named = sum(is_in(found$hidden, found$named)[something]),
    wrong_adopted = sum(others(adopted) > 0), wrong_named = sum(others(found$named) > 0),
    nothing_hidden = sum(!something), nothing_adopted = sum(adopted[!something] == ""),
    runs_median = stats::median(found$runs), seconds_median = stats::median(found$seconds))
  print(table(hidden = found$hidden, adopted = adopted))
  utils::str(result, give.head = FALSE)
  write_rows(result, option("out"))
}

if ("--write" %in% arguments) write_estate(option("write")) else score_estate(option("score"))
