#!/usr/bin/env Rscript
# From where must the simulator be searched so that the best mode of the posterior is found?
# Usage: Rscript bench/starts.R [--family network,runoff,wrong] [--worlds N] [--seed S] [--out FILE]
#
# Of each world the base model, that with the hidden mechanism and one other mechanism drawn at random: searches
# (R/mode_search.R) from the places from which the package starts over the priors (starts_over_priors()) and, for
# comparison, from four draws of the prior; `shipped` are the former, one after the other, as search_modes() does it,
# which gives up what leads nowhere new. A set of starts misses if the best mode it leads to lies more than 5 nats
# below the best that any found. Seeds are not those of bench/hidden_effects.R.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
scope <- new.env(parent = globalenv())
for (part in c("worlds", "least_squares", "network", "runoff", "wrong", "families"))
  sys.source(file.path(here, "hidden_effects", paste0(part, ".R")), scope)
families <- strsplit(option("family", "network,runoff,wrong", smallest = "runoff"), ",", fixed = TRUE)[[1]]
worlds <- as.integer(option("worlds", "20", smallest = "1"))
first <- as.integer(option("seed", "60001"))

# One row for each start: the value that its search ends at, NA where it failed, and its runs.
searches <- function(model, name, world, present = NULL) {
  seed <- world$seed + 77L
  ensemble <- simulate_design(model, world$measurements, 80, seed = seed)
  emulator <- train_emulator(ensemble, world$measurements)
  set <- amiss:::calibration_setting(emulator, world$measurements, list(), seed)
  starts <- amiss:::starts_over_priors(list(ensemble), list(set), present)
  names(starts) <- c(if (!is.null(present)) "present", "nearest", "apart", "middle")
  set.seed(world$seed)
  drawn <- replicate(4, stats::rnorm(length(ensemble$parameters)), simplify = FALSE)
  starts <- c(starts, stats::setNames(drawn, paste0("drawn", 1:4)))
  records <- amiss:::searched_records(list(set), 1)
  modes <- lapply(starts, function(start) {
    tryCatch(amiss:::search_mode(records, start), amiss_error_numerical = function(e) NULL)
  })
  modes <- Filter(Negate(is.null), modes)
  shipped <- amiss:::search_modes(list(set), starts[!grepl("drawn", names(starts))], 1)
  compared <- amiss:::with_common_values(c(unname(modes), shipped$modes), records)
  value <- vapply(compared, `[[`, 0, "value")
  best <- compared[[which.max(value)]]$centre
  value <- value - max(value)
  own <- seq_along(modes)
  table <- data.frame(family = world$family, seed = world$seed, model = name, extension = !is.null(present),
                      coarse = amiss:::too_coarse(emulator, world$measurements), start = c(names(modes), "shipped"),
                      value = c(value[own], max(-Inf, value[-own])),
                      runs = c(vapply(modes, `[[`, 0, "runs"), shipped$runs))
  list(table = table, best = stats::setNames(best, names(ensemble$parameters)))
}

world_rows <- function(family, seed) {
  world <- scope$family_world(family, seed)
  base <- searches(world$base, "base", world)
  others <- setdiff(names(world$catalogue), world$kinds)
  set.seed(seed)
  tried <- c(intersect(world$kinds, names(world$catalogue)), sample(others, 1))
  extended <- lapply(tried, function(name) {
    searches(world$catalogue[[name]]$edit(world$base), name, world, base$best)$table
  })
  message(family, " ", seed)
  do.call(rbind, c(list(base$table), extended))
}

tasks <- expand.grid(seed = first + seq_len(worlds) - 1L, family = families, stringsAsFactors = FALSE)
rows <- do.call(rbind, Map(world_rows, tasks$family, tasks$seed))
rows <- rows[rows$coarse, ]  # elsewhere the package does not search over the priors
sets <- list(c("middle", "nearest"), c("middle", "nearest", "apart"), c("middle", "nearest", "present"),
             c("middle", "nearest", "apart", "present"), "shipped")
for (extension in c(FALSE, TRUE)) {
  cat(if (extension) "extensions" else "base models", "\n")
  models <- split(rows[rows$extension == extension, ], ~ family + seed + model, drop = TRUE)
  for (set in sets) {
    if (!extension && "present" %in% set || !length(models)) next
    values <- vapply(models, function(m) max(-Inf, m$value[m$start %in% set], na.rm = TRUE), 0)
    runs <- mean(vapply(models, function(m) sum(m$runs[m$start %in% set], na.rm = TRUE), 0))
    cat(sprintf("  %-34s %2d of %d miss, at worst by %.0f nats; %.0f runs\n", paste(set, collapse = ", "),
                sum(values < -5), length(values), -min(values), runs))
  }
}
write_rows(rows, option("out", "starts.json"))
