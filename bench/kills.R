#!/usr/bin/env Rscript
# Does a study that is killed go on to the same result, and leave nothing behind?
# Usage: Rscript bench/kills.R --out FILE [--kills 40] [--seed 1]
#
# A small study with `exec/amiss run`, once with an R function as its simulator and once with a
# program (awk). It runs alone first (without the work of a report and of figures). Then R is killed
# (SIGKILL) at random moments of its way, again and again; after each fifth kill the same command
# goes on to its end. It holds if after each kill what stands under the names of results is whole,
# if each end is the result of the study that was left alone (`result.json` but for its seconds),
# and if then no process of the study, no folder of a run and no file but the results is left. FILE
# gets a row for each simulator: kills, ends, and how many of each broke this.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
kills <- as.integer(option("kills", "40", smallest = "2"))
seed <- as.integer(option("seed", "1"))
out_file <- option("out", "kills.json")

# ---- the studies

write_record <- function(folder) {
  hour <- 1:120
  te <- 10 + 5 * sin(hour / 4) + sin(1.7 * hour)
  gv <- pmax(0, 300 * sin(hour / 4 - 1))
  record <- data.frame(hour, Te = round(te, 3), Gv = round(gv, 1))
  record$Ti <- round(20 + 0.4 * record$Te + 0.002 * record$Gv + 0.1 * sin(41 * hour^2), 4)
  utils::write.csv(record, file.path(folder, "data.csv"), row.names = FALSE)
}

models <- list(
  r_function = "function_simulator(function(values, drivers) {
                  Sys.sleep(0.005)
                  values[['offset']] + 0.4 * drivers[, 'Te']
                }, free('offset', uniform(10, 30), 'K'), boundary = 'Te')",
  program = "program_simulator(c('awk', '-F', ',', '-v', 'OFMT=%.12g', '-v', 'offset={{offset}}',
                                 'NR == 1 { for (i = 1; i <= NF; i++) {
                                              gsub(/\"/, \"\", $i); at[$i] = i }
                                            print \"Ti\" }
                                  NR > 1 { print offset + 0.4 * $at[\"Te\"] }', 'drivers.csv'),
                               free('offset', uniform(10, 30), 'K'), boundary = 'Te',
                               cache = 'runs', output = c(file = 'stdout.txt', column = 'Ti'))")

# The sun is added to the runs of either.
suns <- list(
  r_function = "with_parameters(model, free('sun', uniform(0, 0.01)), boundary = 'Gv',
                  f = function(values, drivers, base)
                    base(values) + values[['sun']] * drivers[, 'Gv'])",
  program = "program_simulator(c('awk', '-F', ',', '-v', 'OFMT=%.12g', '-v', 'offset={{offset}}',
                                 '-v', 'sun={{sun}}',
                                 'NR == 1 { for (i = 1; i <= NF; i++) {
                                              gsub(/\"/, \"\", $i); at[$i] = i }
                                            print \"Ti\" }
                                  NR > 1 { print offset + 0.4 * $at[\"Te\"] + sun * $at[\"Gv\"] }',
                                 'drivers.csv'),
                               free('offset', uniform(10, 30), 'K'), free('sun', uniform(0, 0.01)),
                               boundary = c('Te', 'Gv'), cache = 'runs',
                               output = c(file = 'stdout.txt', column = 'Ti'))")

write_study <- function(kind) {
  folder <- tempfile(paste0("kills-", kind, "-"))
  dir.create(folder)
  write_record(folder)
  writeLines(quick_parts, file.path(folder, "profile.R"))
  writeLines(models[[kind]], file.path(folder, "model.R"))
  writeLines(sprintf("catalogue(mechanism('sun', boundary = 'Gv', sentence = 'The sun shines in.',
                                          edit = function(model) %s))", suns[[kind]]),
             file.path(folder, "catalogue.R"))
  yaml::write_yaml(list(study = "killed", data = "data.csv", time = "hour", target = "Ti",
                        boundary = list("Te", "Gv"), noise_sd = 0.1, calibrate = "hour <= 90",
                        validate = "hour > 90", model = "model.R", catalogue = "catalogue.R",
                        runs = 20, seed = 4,
                        control = list(max_steps = 1, attribution = list(surrogates = 99))),
                   file.path(folder, "study.yml"))
  folder
}

# ---- runs of the command

command <- system.file("exec", "amiss", package = "amiss")

# Changes made to the package as it is loaded.
quick_parts <- c(
  "setHook(packageEvent('amiss', 'onLoad'), function(...) {",
  "  change <- function(name, value) utils::assignInNamespace(name, value, 'amiss')",
  paste("  change('report', function(x, file, ...)",
        "writeLines(c(rep('a line of the report', 1e5), '</html>'), file))"),
  "  change('save_figure', function(figure, path, ...) writeLines(rep('a figure', 1e4), path))",
  "})")

start <- function(folder, out) {
  processx::process$new(file.path(R.home("bin"), "Rscript"),
                        c(command, "run", file.path(folder, "study.yml"), "--out", out, "--trust",
                          "--quiet"),
                        wd = folder, stdout = file.path(folder, "log"), stderr = "2>&1",
                        env = c("current", R_LIBS = paste(.libPaths(), collapse = ":"),
                                R_PROFILE_USER = file.path(folder, "profile.R")))
}

# What a study found, without how long it took.
found <- function(out) {
  result <- jsonlite::read_json(file.path(out, "result.json"))
  result$wall_s <- NULL
  result
}

# Whether all that stands under the name of a result is whole.
is_whole <- function(out, reference) {
  there <- dir(out)
  tryCatch({
    json <- !"result.json" %in% there || identical(found(out), reference)
    rds <- !"result.rds" %in% there ||
      inherits(readRDS(file.path(out, "result.rds")), "amiss_upgrade")
    page <- !"report.html" %in% there ||
      any(grepl("</html>", readLines(file.path(out, "report.html"), warn = FALSE)))
    json && rds && page
  }, error = function(e) FALSE)
}

# Processes whose command or folder is of the study.
processes_of <- function(folder) {
  ids <- setdiff(grep("^[0-9]+$", dir("/proc"), value = TRUE), Sys.getpid())
  Filter(function(id) {
    words <- suppressWarnings(tryCatch(readBin(file.path("/proc", id, "cmdline"), "raw", 1e5),
                                       error = function(e) raw()))
    words <- rawToChar(replace(words, words == as.raw(0), charToRaw(" ")))
    place <- suppressWarnings(Sys.readlink(file.path("/proc", id, "cwd")))
    grepl(folder, words, fixed = TRUE) || isTRUE(startsWith(place, folder))
  }, ids)
}

# What is left but sources, kept runs and results.
left_behind <- function(folder, out) {
  results <- c("figures", "report.html", "result.json", "result.rds")
  c(setdiff(grep("^earlier-", dir(out, all.files = TRUE, no.. = TRUE), value = TRUE, invert = TRUE),
            results),
    grep("^[0-9a-f]{8}-[0-9a-f]{32}[.]rds$",
         dir(file.path(folder, "runs"), all.files = TRUE, no.. = TRUE), value = TRUE,
         invert = TRUE))
}

killed_study <- function(kind) {
  folder <- write_study(kind)
  on.exit(unlink(folder, recursive = TRUE))
  alone <- file.path(folder, "alone")
  seconds <- system.time(start(folder, alone)$wait())[["elapsed"]]
  if (!file.exists(file.path(alone, "result.json")))
    stop(paste(readLines(file.path(folder, "log")), collapse = "\n"))
  reference <- found(alone)
  cat(sprintf("%s: %.0f s when left alone; named %s\n", kind, seconds,
              reference$named_cause$mechanism %||% "nothing"))
  row <- list(simulator = kind, seconds_alone = seconds, kills = 0, in_vain = 0, not_whole = 0,
              ends = 0, other_result = 0, processes_left = 0, files_left = 0)
  try_out <- file.path(folder, "out")
  end <- function() {
    start(folder, try_out)$wait()
    row$ends <<- row$ends + 1
    ended <- if (file.exists(file.path(try_out, "result.json"))) found(try_out)
    same <- identical(ended, reference)
    if (!same) {
      cat("OTHER RESULT:", all.equal(reference, ended),
          utils::tail(readLines(file.path(folder, "log")), 5), sep = "\n")
    }
    left <- left_behind(folder, try_out)
    if (length(left)) cat("LEFT:", left, "\n")
    row$other_result <<- row$other_result + !same
    row$processes_left <<- row$processes_left + length(processes_of(folder))
    row$files_left <<- row$files_left + length(left)
    unlink(c(try_out, file.path(folder, "runs")), recursive = TRUE)
  }
  while (row$kills < kills) {
    run <- start(folder, try_out)
    run$wait(1000 * stats::runif(1, 0.1, 0.8) * seconds)
    if (run$is_alive()) row$kills <- row$kills + 1 else row$in_vain <- row$in_vain + 1
    run$signal(tools::SIGKILL)
    run$wait()
    row$not_whole <- row$not_whole + !is_whole(try_out, reference)
    if (row$kills %% 5 == 0 || row$kills >= kills) end()
  }
  as.data.frame(row)
}

`%||%` <- function(x, y) if (is.null(x)) y else x
set.seed(seed)
rows <- do.call(rbind, lapply(names(models), killed_study))
print(rows, row.names = FALSE)
write_rows(rows, out_file)
