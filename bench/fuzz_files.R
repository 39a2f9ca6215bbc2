#!/usr/bin/env Rscript
# Is every file read right, or refused?
# Usage: Rscript bench/fuzz_files.R --out FILE [--seconds 600] [--seed 1]
#                                   [--findings build/findings]
#
# Good files are changed at random, in their bytes and in their structure: tables of three kinds
# (commas; semicolons, decimal commas, a row of units and comments; tabs with local times), study
# files of three kinds (one record, several, a comparison) and the table that a program writes. Each
# is read as people's are: tables and study files by read_study(), which also checks the options,
# the program's table by simulate_runs(). It holds if each ends with a condition of the package
# (class `amiss_error`), or with a result in which every number stands in the file; within ten
# seconds, without a crash. FILE gets a row for each kind of file: cases, how many were read,
# refused and wrong, and the slowest: its seconds and number; a file that breaks this is kept in the
# folder of findings, with what happened. Reading goes on in a process of its own, which is watched:
# see fuzz_files/reader.R.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
seconds <- as.numeric(option("seconds", "600", smallest = "10"))
seed <- as.integer(option("seed", "1"))
out <- option("out", "fuzz_files.json")
findings <- option("findings", file.path("build", "findings"))
longest <- 10

dir.create(findings, recursive = TRUE, showWarnings = FALSE)
work <- tempfile("fuzz-")
dir.create(work)
script <- file.path(here, "fuzz_files", "reader.R")

start_reader <- function(first) {
  processx::process$new(file.path(R.home("bin"), "Rscript"), c(script, work, first),
                        stdout = file.path(work, "log"), stderr = "2>&1", cleanup_tree = TRUE)
}

# A line for each case: number, kind, outcome, seconds, what was said.
read_cases <- function() {
  path <- file.path(work, "cases.tsv")
  if (!file.exists(path)) return(NULL)
  lines <- strsplit(readLines(path, warn = FALSE), "\t", fixed = TRUE)
  lines <- lines[lengths(lines) == 5]
  do.call(rbind, lapply(lines, function(x) {
    data.frame(case = as.integer(x[1]), kind = x[2], outcome = x[3], seconds = as.numeric(x[4]),
               said = x[5])
  }))
}

# What is being read, list(case, kind), or nothing.
being_read <- function() {
  line <- tryCatch(readLines(file.path(work, "now"), warn = FALSE), warning = function(w) NULL)
  words <- unlist(strsplit(as.character(line), " "))
  if (length(words) == 2) list(case = as.integer(words[1]), kind = words[2])
}

keep_finding <- function(case, kind, what) {
  name <- sprintf("%s-%d", kind, case)
  file.copy(file.path(work, paste0("case.", kind)), file.path(findings, name), overwrite = TRUE)
  writeLines(what, file.path(findings, paste0(name, ".txt")))
  cat(name, what, "\n")
}

lost <- NULL
started <- proc.time()[["elapsed"]]
first <- 1000000L * seed
reader <- start_reader(first)
since <- list(case = -1L, at = started)
while (proc.time()[["elapsed"]] - started < seconds) {
  Sys.sleep(0.2)
  now <- being_read()
  elapsed <- proc.time()[["elapsed"]]
  if (!is.null(now) && now$case != since$case) since <- c(now, list(at = elapsed))
  hangs <- since$case >= 0 && elapsed - since$at > longest
  if (reader$is_alive() && !hangs) next
  if (is.null(now) || now$case < first)
    stop("the reader did not begin:\n", paste(readLines(file.path(work, "log")), "\n"))
  what <- if (hangs) "hangs" else "crashes"
  invisible(reader$kill_tree())
  keep_finding(now$case, now$kind, what)
  lost <- rbind(lost, data.frame(case = now$case, kind = now$kind, outcome = what,
                                 seconds = elapsed - since$at, said = what))
  first <- now$case + 1L
  reader <- start_reader(first)
  since <- list(case = -1L, at = elapsed)
}
invisible(reader$kill_tree())

cases <- rbind(read_cases(), lost)
invisible(file.copy(dir(work, "^found-", full.names = TRUE), findings, overwrite = TRUE))
rows <- do.call(rbind, lapply(split(cases, cases$kind), function(x) {
  data.frame(kind = x$kind[1], cases = nrow(x), read = sum(x$outcome == "read"),
             refused = sum(x$outcome == "refused"),
             wrong = sum(!x$outcome %in% c("read", "refused")), slowest_s = max(x$seconds),
             slowest_case = x$case[which.max(x$seconds)])
}))
print(rows, row.names = FALSE)
wrong <- cases[!cases$outcome %in% c("read", "refused"), ]
for (said in unique(wrong$said)) cat("WRONG", wrong$kind[wrong$said == said][1], said, "\n")
write_rows(rows, out)
