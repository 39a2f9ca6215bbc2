#!/usr/bin/env Rscript
# Crude base models of the two Twin Houses (crude/house.R): what is adopted and said, and how near
# the simulation at its best is to the record. The truth: in O5 the sun is missing, in N2 a second
# state and the kitchen. A row for each house and number of states, and one for each mechanism of
# the first step.
# Usage: Rscript bench/crude.R [--houses O5,N2] [--states 1,2] [--seed 1] [--threads 2] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
source(file.path(here, "crude", "house.R"))
suppressPackageStartupMessages(library(amiss))
houses <- strsplit(option("houses", "O5,N2", "N2"), ",", fixed = TRUE)[[1]]
states <- as.integer(strsplit(option("states", "1,2", "1"), ",", fixed = TRUE)[[1]])
quick <- if (smoke) list(max_steps = 1, runs_total = 100, attribution = list(surrogates = 19))

one_house <- function(house, states) {
  record <- suppressMessages(crude_record(house))
  upgrade <- suppressWarnings(upgrade_model(crude_house(states), record, crude_catalogue(states),
                                            control = quick, seed = as.numeric(option("seed", 1)),
                                            threads = as.integer(option("threads", 2)),
                                            quiet = TRUE))
  models <- upgrade$models
  rmse <- function(model) {
    paste(signif(c(model$scores$calibrate[["rmse"]], model$scores$validate[["rmse"]]), 2),
          collapse = "/")
  }
  message(house, ", ", states, " states, ", upgrade$runs_total, " runs: ", rmse(models[[1]]),
          paste0(vapply(models[-1],
                        function(m) sprintf(" -> %s (%s) %s", m$mechanism, m$verdict, rmse(m)), ""),
                 collapse = ""))
  first <- upgrade$candidates[upgrade$candidates$from == models[[1]]$name, ]
  print(first[order(-first$log10_bf),
              c("mechanism", "log10_bf", "beside_unknown", "error_ratio", "trusted", "runs")],
        digits = 3, row.names = FALSE)
  adopted <- vapply(models[-1], `[[`, "", "mechanism")
  data.frame(house, states, runs_total = upgrade$runs_total, adopted = toString(adopted),
             verdicts = toString(vapply(models[-1], `[[`, "", "verdict")),
             before = rmse(models[[1]]), after = rmse(models[[length(models)]]),
             trusted = models[[length(models)]]$fit$trust$trusted)
}

cases <- expand.grid(states = states, house = houses, stringsAsFactors = FALSE)
table <- do.call(rbind, unname(Map(one_house, cases$house, cases$states)))
print(table)
write_rows(table, option("out", "crude.json"))
