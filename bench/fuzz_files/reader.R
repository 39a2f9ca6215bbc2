# Reads changed files until it is ended: Rscript reader.R FOLDER FIRST. Each case has the number of
# its seed. The folder gets the file that is being read (case.KIND), its number and kind (now), and
# a line for each that was (cases.tsv).
suppressPackageStartupMessages(library(amiss))
words <- commandArgs(TRUE)
work <- words[1]
case <- as.integer(words[2])
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "changes.R"))

# ---- good files

hour <- 1:60
record <- data.frame(hour, Te = round(10 + 5 * sin(hour / 4) + sin(hour), 3),
                     Gv = round(pmax(0, 300 * sin(hour / 4)), 1))
record$Ti <- round(20 + 0.4 * record$Te + 0.1 * sin(7 * hour), 3)
comma <- function(x) gsub(".", ",", format(x, trim = TRUE), fixed = TRUE)
stamps <- format(as.POSIXct("2024-03-30", tz = "UTC") + 3600 * hour, "%d.%m.%Y %H:%M")
tables <- list(
  paste(c("hour,Te,Gv,Ti", do.call(paste, c(record, sep = ","))), collapse = "\n"),
  paste(c("# logger 7", "hour;Te;Gv;Ti", "h;degC;W/m2;degC",
          do.call(paste, c(lapply(record, comma), sep = ";"))), collapse = "\r\n"),
  paste(c("hour\tTe\tGv\tTi", paste(stamps, record$Te, record$Gv, record$Ti, sep = "\t")),
        collapse = "\n"))
writeLines(tables[[1]], file.path(work, "data.csv"))
writeLines('function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
                               free("gain", uniform(0, 1)), boundary = "Te")',
           file.path(work, "model.R"))
writeLines(
  'list(a = function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
                                        free("gain", uniform(0, 1)), boundary = "Te"))',
  file.path(work, "models.R"))
writeLines('catalogue(mechanism("sun", identity, "Gv", "The sun."))',
           file.path(work, "catalogue.R"))
head <- "study: linear\ndata: data.csv\ntime: hour\ntarget: Ti\nboundary: [Te, Gv]\nnoise_sd: 0.1\n"
loop <- "model: model.R\ncatalogue: catalogue.R\nruns: 20\nseed: 7\n"
studies <- list(
  paste0(
    head, loop,
    "calibrate: hour <= 45\nvalidate: hour > 45 & Te < 30\nwarmup_h: 2\nmissing: [-9999, 85]\n",
    "control:\n  max_steps: 1\n  calibration: {ais: {groups: 4}, error_ratios: [0, 1e0]}\n"),
  paste0(head, loop,
         "records:\n  east: {target: Ti}\n  west:\n    noise_sd: 0.2\n    range: [-.inf, 40]\n"),
  paste0(head, "models: models.R\nmethod: history\nruns: 20\ntitle: 'A \"quoted\" title'\n"))
outputs <- paste(c("hour,Ti", paste(hour, record$Ti, sep = ",")), collapse = "\n")

# ---- numbers that a file can hold, by every mark of decimals and thousands

numbers_in <- function(path) {
  bytes <- readBin(path, "raw", file.size(path))
  if (length(bytes) > 1 && bytes[1] %in% as.raw(c(0xfe, 0xff)) &&
      bytes[2] %in% as.raw(c(0xfe, 0xff))) {
    bytes <- bytes[bytes != as.raw(0)]
  }
  text <- iconv(rawToChar(bytes[bytes != as.raw(0)]), "latin1", "UTF-8")
  fields <- unlist(strsplit(c(text, gsub("\"", "", text, fixed = TRUE)), "[\t\r\n;|\"]+"))
  words <- trimws(unique(c(fields, unlist(strsplit(fields, ",", fixed = TRUE)),
                           unlist(strsplit(fields, "[ ,]+")))))
  plain <- gsub("[ '\u00a0]", "", words)
  plain <- sub("([0-9.,])([+-][0-9]{3})$", "\\1e\\2", chartr("dD", "ee", plain))
  forms <- c(words, plain, gsub(",", "", plain),
             sub(",", ".", gsub(".", "", plain, fixed = TRUE), fixed = TRUE),
             sub(",", ".", plain, fixed = TRUE))
  unique(stats::na.omit(suppressWarnings(as.numeric(forms))))
}

check_numbers <- function(values, path) {
  known <- c(numbers_in(path), 0, 1)  # what is on or off, too
  strange <- setdiff(values[!is.na(values)], known)
  near <- vapply(strange, function(v) any(abs(v - known) <= 1e-12 * abs(v)), NA)
  if (any(!near)) stop("the file does not hold ", strange[!near][1])
}

# ---- reading

read_table <- function(path) {
  yaml <- file.path(work, "of-table.yml")
  writeLines(c(paste0("data: ", basename(path)), sub("data: data.csv\n", "", paste0(head, loop))),
             yaml)
  study <- read_study(yaml, trust = TRUE)
  raw <- study$measurements$raw
  check_numbers(raw$y, path)
  check_numbers(raw$drivers[!is.na(raw$y), c("Te", "Gv")], path)  # rows that were lost are bridged
}

read_yaml <- function(path) {
  study <- read_study(path, trust = TRUE)
  amiss:::check_study_control(study)
  stopifnot(is.character(study$study), is.list(study$measurements))
}

read_output <- function(path) {
  program <- program_simulator(c("awk", "-v", "gain={{gain}}", "{ print }", path),
                               free("gain", uniform(0, 1)),
                               output = c(file = "stdout.txt", column = "Ti"), time_limit = 5,
                               version = case, cache = file.path(work, "cache"))
  runs <- simulate_runs(program, cbind(gain = 0.5), cbind(Te = record$Te), step_h = 1)
  unlink(file.path(work, "cache"), recursive = TRUE)
  if (!all(is.finite(runs))) rlang::abort("a run that failed", class = "amiss_error")
  check_numbers(runs, path)
}

read_of <- list(csv = read_table, yml = read_yaml, out = read_output)
good <- list(csv = tables, yml = studies, out = list(outputs))

# list(outcome, said)
outcome <- function(read, path) {
  tryCatch({
    suppressWarnings(suppressMessages(read(path)))
    list("read", "")
  }, amiss_error = function(e) list("refused", ""),
     error = function(e)
       list("wrong", paste(class(e)[1], conditionMessage(e), deparse1(conditionCall(e)))))
}

cases <- file(file.path(work, "cases.tsv"), "a")
repeat {
  set.seed(case)
  kind <- sample(names(good), 1, prob = c(4, 4, 1))
  path <- file.path(work, paste0("case.", kind))
  writeBin(changed_bytes(charToRaw(sample(good[[kind]], 1)[[1]]), lapply(unlist(good), charToRaw)),
           path)
  writeLines(paste(case, kind), file.path(work, "now"))
  seconds <- system.time(came <- outcome(read_of[[kind]], path))[["elapsed"]]
  if (came[[1]] == "wrong") {
    file.copy(path, file.path(work, sprintf("found-%s-%d", kind, case)))
    writeLines(came[[2]], file.path(work, sprintf("found-%s-%d.txt", kind, case)))
  }
  said <- if (nzchar(came[[2]])) gsub("[[:space:]]+", " ", substr(came[[2]], 1, 300)) else "-"
  cat(case, kind, came[[1]], format(seconds), said, sep = "\t", file = cases)
  cat("\n", file = cases)
  flush(cases)
  case <- case + 1L
}
