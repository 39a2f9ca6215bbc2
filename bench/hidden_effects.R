#!/usr/bin/env Rscript
# Hidden-effect benchmark.
# Usage: Rscript bench/hidden_effects.R [--family F,F] --worlds N --seed S --out FILE [--workers N]
#                                       [--rivals no]
#
# Worlds S, S+1, ... of each family named are drawn, scored and written as JSON: a row a world, with
# its family, and for each family rates, means and what the attribution by itself said of each
# mechanism. Figures lie beside it: FILE-detection.png for all, FILE-confusion-FAMILY.png for each.
# Families (hidden_effects/families.R): box, the test box with eight mechanisms and effects outside
# the catalogue, which is the default; network, grey-box networks of a house; runoff, a catchment
# with thresholds; wrong, base models that are wrong in structure besides. Each finished world is
# kept in FILE.worlds/, so that a stopped run goes on where it was; worlds that failed are tried
# again. Work goes through the user's future plan if --workers is not given. Rivals take two thirds
# of the time; the random forest is asked where the package ranger is installed.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
asked <- strsplit(option("family", "box"), ",", fixed = TRUE)[[1]]
worlds <- as.integer(option("worlds", "24", smallest = "1"))
first <- as.integer(option("seed", "1"))
out <- option("out", "hidden_effects.json")
workers <- option("workers")
rivals <- option("rivals", "yes") != "no"
suppressPackageStartupMessages(library(amiss))

parts <- c("worlds", "least_squares", "network", "runoff", "wrong", "families", "score", "figures")
parts <- file.path(normalizePath(here), "hidden_effects", paste0(parts, ".R"))
scope <- new.env(parent = globalenv())
for (part in parts) sys.source(part, scope)
unknown <- setdiff(asked, names(scope$families))
if (length(unknown))
  stop("--family ", unknown[1], " is not one of ", toString(names(scope$families)), call. = FALSE)

keep <- paste0(out, ".worlds")
dir.create(keep, showWarnings = FALSE, recursive = TRUE)
keep <- normalizePath(keep)
tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, family = unique(asked),
                     stringsAsFactors = FALSE)
tasks$file <- file.path(keep, sprintf("%s-%09d.rds", tasks$family, tasks$seed))
finished <- function(file) file.exists(file) && is.null(readRDS(file)$error)
one_world <- function(seed, family, file, parts, rivals, total) {
  suppressPackageStartupMessages(library(amiss))
  scope <- new.env(parent = globalenv())
  for (part in parts) sys.source(part, scope)
  row <- tryCatch(
    scope$score_world(scope$family_world(family, seed),
                      rivals = rivals && scope$families[[family]]$rivals),
    error = function(e) list(seed = seed, family = family, error = conditionMessage(e)))
  part <- tempfile("part-", dirname(file))
  saveRDS(row, part)
  file.rename(part, file)
  said <- row$error
  if (is.null(said))
    said <- sprintf("%s x%g: %s %s", row$kind, row$strength, row$verdict, row$mechanism)
  message(sprintf("%d of %d, %s world %d, %s", length(list.files(dirname(file), "rds$")), total,
                  family, seed, said))
}

if (!is.null(workers)) future::plan(future::multisession, workers = as.integer(workers))
missing <- tasks[!vapply(tasks$file, finished, NA), ]
if (rivals && !requireNamespace("ranger", quietly = TRUE)) {
  message("ranger is not installed: no random forest among the rivals ",
          "(tools/install-dependencies --bench installs it)")
}
invisible(future.apply::future_mapply(one_world, missing$seed, missing$family, missing$file,
                                      MoreArgs = list(parts = parts, rivals = rivals,
                                                      total = nrow(tasks)),
                                      future.seed = NULL, future.scheduling = Inf))
rows <- lapply(tasks$file, readRDS)
failed <- Filter(function(r) !is.null(r$error), rows)
scored <- Filter(function(r) is.null(r$error), rows)
rates <- scope$by_family(scored, scope$score_rates)
attributed <- scope$by_family(scored, scope$attributed_kinds)
as_arrays <- function(row) {  # also where there is one value, or none
  arrays <- c("true_boundary", "true_mechanism", "adopted", "verdicts", "rmse")
  for (name in intersect(names(row), arrays)) row[[name]] <- as.list(row[[name]])
  row
}
write_rows(list(worlds = lapply(rows, as_arrays), failed = length(failed), rates = rates,
                means = scope$by_family(scored, scope$score_means), attributed = attributed), out)
if (length(scored)) scope$write_figures(scored, out)
for (family in names(rates)) {
  cat(family, "\n", sep = "")
  for (name in names(rates[[family]])) {
    r <- rates[[family]][[name]]
    shares <- 100 * c(r$rate, r$lower95, r$upper95)
    if (r$n > 0) cat(sprintf("  %-28s %5.1f %% of %d [%.0f, %.0f]\n", name, shares[1], r$n,
                             shares[2], shares[3]))
  }
  if (length(attributed[[family]])) print(attributed[[family]], row.names = FALSE)
}
if (length(failed)) cat(length(failed), "worlds failed:", failed[[1]]$error, "\n")
