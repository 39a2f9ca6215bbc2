#!/usr/bin/env Rscript
# How fast: Rscript bench/speed.R --out FILE [--only history,kernel,study]
# One core. Required times are for a core on which dgemm (n = 1000) runs at 60 GFLOP/s; that rate is measured in the same
# run and the times are scaled by it. The parts `history` and `kernel` build and run the micro-benchmarks of bench/micro
# (Google Benchmark, for this machine's processor, in build/native); `study` uses the installed package.
# FILE gets rows of name, value, unit, required, holds.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
root <- normalizePath(file.path(here, ".."))
out <- option("out", "speed.json")
parts <- strsplit(option("only", "history,kernel,study"), ",")[[1]]
unknown <- setdiff(parts, c("history", "kernel", "study"))
if (length(unknown)) stop("--only knows history, kernel, study; got ", paste(unknown, collapse = ", "), call. = FALSE)

build <- file.path(root, "build", "native")
run <- function(command, ...) {
  status <- system2(command, c(...), stdout = FALSE)
  if (status != 0) stop(paste(command, paste(c(...), collapse = " ")), " failed", call. = FALSE)
}
run("cmake", "-S", root, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DAMISS_NATIVE=ON")
run("cmake", "--build", build, "-j2", "--target", "micro_machine", "micro_history", "micro_kernel")

# One row for each benchmark: its name, real time in seconds, and its counters.
micro <- function(program, filter = ".") {
  file <- tempfile(fileext = ".json")
  run(file.path(build, program), paste0("--benchmark_filter='", filter, "'"), paste0("--benchmark_out=", file), "--benchmark_out_format=json")
  rows <- jsonlite::read_json(file)$benchmarks
  stats::setNames(lapply(rows, function(r) c(r, seconds = r$real_time / c(s = 1, ms = 1e3, us = 1e6, ns = 1e9)[[r$time_unit]])),
                  vapply(rows, function(r) sub("/iterations:1$", "", r$name), ""))
}

gflops <- micro("micro_machine", "1000")[[1]]$flops / 1e9
slower <- 60 / gflops  # this core's times over those of the one that the requirements are for
rows <- list()
measured <- function(name, value, unit, required = NA, above = FALSE) {
  holds <- if (is.na(required)) NA else if (above) value >= required else value <= required
  rows[[length(rows) + 1]] <<- data.frame(name = name, value = value, unit = unit, required = required, holds = holds)
  said <- if (is.na(holds)) "" else sprintf("  %s %-9.4g %s", if (above) "at least" else "at most ", required, if (holds) "holds" else "FAILS")
  cat(sprintf("%-64s %10.4g %-8s%s\n", name, value, unit, said))
}
scaled <- function(name, seconds, unit, required = NA) {
  measured(name, seconds / slower * c(s = 1, ms = 1e3, us = 1e6)[[unit]], unit, required)
}
measured("dgemm, n = 1000, Eigen", gflops, "GFLOP/s")

if ("history" %in% parts) {
  r <- micro("micro_history")
  likelihood <- vapply(c(384, 5760, 525600), function(n) r[[paste0("history/likelihood/", n)]]$seconds, 0)
  for (i in 1:3) scaled(sprintf("history likelihood with gradient, p = 49, N = %d", c(384L, 5760L, 525600L)[i]), likelihood[i], "us", 100)
  measured("greatest over least of these three", max(likelihood) / min(likelihood), "", 1.2)
  scaled("history set-up of one error setting, N = 525600", r[["history/setup/525600"]]$seconds, "s", 10)
}

if ("kernel" %in% parts) {
  r <- micro("micro_kernel")
  scaled("equation (6), dense value, N = 384", r[["kernel/dense/384"]]$seconds, "ms")
  measured("the same over one Cholesky factor (with kernel fill)", r[["kernel/dense/384"]]$seconds / r[["kernel/cholesky/384"]]$seconds, "")
  scaled("equation (6), value from a skeleton, N = 384", r[["kernel/skeleton/384"]]$seconds, "ms", 0.5)
  scaled("equation (6), value from a skeleton, N = 5760", r[["kernel/skeleton/5760"]]$seconds, "ms", 0.5)
  scaled("equation (6), value at low rank, N = 5760", r[["kernel/low_rank/5760"]]$seconds, "ms")
  required <- c("384/3" = 1, "5760/3" = 10, "5760/5" = 180, "8760/3" = 30, "11520/3" = 30)
  for (case in names(required)) {
    s <- r[[paste0("kernel/sampling/", case)]]
    told <- sprintf("posterior and evidence, N = %s, %s conditions act", sub("/.*", "", case), sub(".*/", "", case))
    scaled(told, s$seconds, "s", required[[case]])
    measured(paste0(told, ": standard error"), s$standard_error, "nat", 0.05)
    measured(paste0(told, ": effective draws"), s$effective_draws, "", 400, above = TRUE)
    measured(paste0(told, ": likelihood values"), s$values, "", 10000)
    measured(paste0(told, ": largest error of a certified draw"), s$largest_error, "nat", 0.05)
    measured(paste0(told, ": second estimate less the frozen run, over its error"), s$annealed_less / s$annealed_error, "", 3)
  }
}

if ("study" %in% parts) {
  suppressPackageStartupMessages(library(amiss))
  study <- read_study(system.file("studies", "paper_synthetic.yml", package = "amiss"))
  m <- study$measurements
  seconds <- system.time({
    emulator <- train_emulator(simulate_design(study$models[["M3"]], m, study$runs, seed = 1), m)
    paper <- calibrate_paper(emulator, m, seed = 1)
    fit <- calibrate(emulator, m, seed = 1)
    attribution <- attribute_discrepancy(fit, seed = 1)
  })[["elapsed"]]
  scaled("a paper-sized model: train, calibrate, both discrepancies, evidence", seconds, "s", 10)
  measured("its evidence: standard error", paper$standard_error / log(10), "decade", 0.1)
}
write_rows(do.call(rbind, rows), out)
