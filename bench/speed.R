#!/usr/bin/env Rscript
# How fast.
# Usage: Rscript bench/speed.R --out FILE
#                              [--only history,kernel,ais,emulator,study,peers,growth,instructions]
#
# One core, unless a row says otherwise. Required times are for a core on which dgemm (n = 1000)
# runs at 60 GFLOP/s; that rate is measured in the same run and the times are scaled by it. The
# parts are the files of bench/speed; those that time single functions build and run the
# micro-benchmarks of bench/micro (Google Benchmark, for this machine's processor, in build/native),
# the others use the installed package. FILE gets rows of name, value, unit, required, holds; parts
# that draw figures put them beside it.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
root <- normalizePath(file.path(here, ".."))
out <- option("out", "speed.json")
known <- c("history", "kernel", "ais", "emulator", "study", "peers", "growth", "instructions")
parts <- strsplit(option("only", paste(known, collapse = ","), smallest = "history"), ",")[[1]]
unknown <- setdiff(parts, known)
if (length(unknown))
  stop("--only knows ", paste(known, collapse = ", "), "; got ", paste(unknown, collapse = ", "),
       call. = FALSE)
suppressPackageStartupMessages(library(amiss))

build <- file.path(root, "build", "native")
run <- function(command, ...) {
  status <- system2(command, c(...), stdout = FALSE)
  if (status != 0) stop(paste(command, paste(c(...), collapse = " ")), " failed", call. = FALSE)
}
run("cmake", "-S", root, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DAMISS_NATIVE=ON")
run("cmake", "--build", build, "-j2", "--target", "micro_machine", "micro_history", "micro_kernel",
    "micro_emulator")

# One row for each benchmark: its name, real time in seconds, and its counters.
micro <- function(program, filter = ".") {
  file <- tempfile(fileext = ".json")
  run(file.path(build, program), paste0("--benchmark_filter='", filter, "'"),
      paste0("--benchmark_out=", file), "--benchmark_out_format=json")
  rows <- jsonlite::read_json(file)$benchmarks
  stats::setNames(lapply(rows,
                         function(r) c(r, seconds = r$real_time / c(s = 1, ms = 1e3, us = 1e6,
                                                                    ns = 1e9)[[r$time_unit]])),
                  vapply(rows, function(r) sub("/iterations:[0-9]+$", "", r$name), ""))
}

gflops <- micro("micro_machine", "1000")[[1]]$flops / 1e9
slower <- 60 / gflops  # this core's times over those of the one that the requirements are for
rows <- list()
measured <- function(name, value, unit, required = NA, above = FALSE) {
  holds <- if (is.na(required)) NA else if (above) value >= required else value <= required
  rows[[length(rows) + 1]] <<- data.frame(name = name, value = value, unit = unit,
                                          required = required, holds = holds)
  said <- if (is.na(holds)) ""
          else sprintf("  %s %-9.4g %s", if (above) "at least" else "at most ", required,
                       if (holds) "holds" else "FAILS")
  cat(sprintf("%-64s %10.4g %-8s%s\n", name, value, unit, said))
}
scaled <- function(name, seconds, unit, required = NA) {
  measured(name, seconds / slower * c(s = 1, ms = 1e3, us = 1e6)[[unit]], unit, required)
}
measured("dgemm, n = 1000, Eigen", gflops, "GFLOP/s")

for (part in parts) {
  cat("\n", part, "\n", sep = "")
  sys.source(file.path(here, "speed", paste0(part, ".R")), new.env(parent = globalenv()))
  write_rows(do.call(rbind, rows), out)
}
