#!/usr/bin/env Rscript
# How often the discrepancy by itself, before any mechanism is tried, responds most to a condition
# of what is hidden; how often it responds to one if nothing is hidden, or something that no
# condition drives. Base models of worlds S, S+1, ... of each family are calibrated as the loop
# does it, and their discrepancy is attributed. Beside it the rule that asks a p-value of at most
# 0.05 of all evidence (with the same groups) and, for buildings, what others ask of the residuals:
# correlation, a random forest, lengthscales, and the paper's rule (hidden_effects/score.R).
# Usage: Rscript bench/attribution.R [--family F,F] [--worlds 100] [--seed 1] [--workers 2]
#                                    [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
families <- strsplit(option("family", "box,network,runoff"), ",", fixed = TRUE)[[1]]
worlds <- as.integer(option("worlds", "100", smallest = "1"))
first <- as.integer(option("seed", "1"))
workers <- as.integer(option("workers", "2"))
suppressPackageStartupMessages(library(amiss))
scope <- worlds_scope(here, c("worlds", "least_squares", "network", "runoff", "wrong", "families",
                              "score"))

one_world <- function(family, seed) {
  world <- scope$family_world(family, seed)
  scouts <- simulate_design(world$base, world$measurements,
                            2 * length(free_parameters(world$base)) + 2, seed = seed, quiet = TRUE)
  fit <- suppressWarnings(calibrate_refined(scouts, world$measurements, seed = seed, quiet = TRUE))
  table <- attribute_discrepancy(fit)$table
  first_of <- function(counts) if (any(counts)) table$boundary[counts][1] else NA
  tested <- table$log10_bf_dropped >= 0.5 & table$p_value <= 0.05
  at <- c(which(table$significant), 1)[1]
  row <- data.frame(family, seed, kind = world$kind, strength = world$strength,
                    true = paste(world$true_boundary, collapse = ","),
                    condition = first_of(table$significant), tested = first_of(tested),
                    log10_bf = table$log10_bf_dropped[at], p_value = table$p_value[at],
                    trusted = fit$trust$trusted, correlation = NA, forest = NA, lengthscales = NA,
                    paper = NA)
  if (scope$families[[family]]$rivals) {
    others <- scope$rival_conditions(fit, world)
    row$correlation <- others$correlation_condition
    row$forest <- c(others$forest_condition, NA)[1]
    row$lengthscales <- others$ard_condition
    row$paper <- scope$paper_condition(world, 120)
  }
  message(sprintf("%s %d, %s x%g (%s): %s, %.1f, p = %.2f", family, seed, row$kind, row$strength,
                  row$true, row$condition, row$log10_bf, row$p_value))
  row
}

tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, family = families,
                     stringsAsFactors = FALSE)
rows <- do.call(rbind, parallel::mclapply(
  seq_len(nrow(tasks)), function(i) one_world(tasks$family[i], tasks$seed[i]),
  mc.cores = workers, mc.preschedule = FALSE))
judged <- function(condition) {
  right <- mapply(`%in%`, condition, strsplit(rows$true, ",", fixed = TRUE))
  ifelse(is.na(condition), "none", ifelse(right, "right", "wrong"))
}
rows$hidden <- ifelse(rows$strength == 0, "nothing", ifelse(!nzchar(rows$true), "outside", ifelse(
  rows$strength >= 2, "strength of two and more", "weaker")))
rules <- c("condition", "tested", "correlation", "forest", "lengthscales", "paper")
table <- do.call(rbind, lapply(rules, function(rule) {
  said <- factor(judged(rows[[rule]]), c("right", "wrong", "none"))
  asked <- rule %in% rules[1:2] | vapply(rows$family, function(f) scope$families[[f]]$rivals, NA)
  counts <- stats::aggregate(stats::model.matrix(~ said - 1)[asked, ],
                             rows[asked, c("hidden", "family")], sum)
  cbind(rule = rule, stats::setNames(counts, c("hidden", "family", levels(said))))
}))
print(table, row.names = FALSE)
is_wrong <- judged(rows$condition) == "wrong"
print(rows[is_wrong, c("family", "seed", "kind", "strength", "true", "condition", "log10_bf",
                       "p_value")], row.names = FALSE)
write_rows(list(rows = rows, table = table), option("out", "attribution.json"))
