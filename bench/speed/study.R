# The whole, as a user would run it: a paper-sized model, the paper's six, the two houses.

study <- read_study(system.file("studies", "paper_synthetic.yml", package = "amiss"))
m <- study$measurements

# Train, calibrate, both discrepancies, evidence.
whole_model <- function(model, threads = 1) {
  emulator <- train_emulator(simulate_design(model, m, 150, seed = 1, threads = threads), m,
                             threads = threads)
  paper <- calibrate_paper(emulator, m, seed = 1, threads = threads)
  fit <- calibrate(emulator, m, seed = 1, threads = threads)
  attribute_discrepancy(fit, seed = 1, threads = threads)
  paper
}
elapsed <- function(expression) system.time(expression)[["elapsed"]]

scaled("a paper-sized model: train, calibrate, both discrepancies, evidence",
       elapsed(paper <- whole_model(paper_box("M3"))), "s", 10)
measured("its evidence: standard error", paper$standard_error / log(10), "decade", 0.1)
scaled("models M1 to M6, the same",
       elapsed(for (name in paste0("M", 1:6)) whole_model(paper_box(name))), "s", 60)
gains <- replicate(
  5, elapsed(whole_model(paper_box("M5"), 1)) / elapsed(whole_model(paper_box("M5"), 2)))
measured("two threads over one, a paper-sized model, median of five", stats::median(gains), "", 1.8,
         above = TRUE)
# What the machine has to give: the same work on one thread, done by two processes at once.
one <- replicate(5, elapsed(whole_model(paper_box("M5"))))
both <- replicate(5, elapsed(
  parallel::mclapply(1:2, function(i) whole_model(paper_box("M5"))$log_evidence, mc.cores = 2)))
measured("two processes at once over one, the same work each",
         2 * stats::median(one) / stats::median(both), "")

# The whole attribution of a house's base model: all conditions, the evidence without each,
# surrogates.
open_house <- read_study(system.file("studies", "twinhouse_O5.yml", package = "amiss"))
emulator <- train_emulator(simulate_design(open_house$model, open_house$measurements, 150, seed = 1,
                                           threads = 2),
                           open_house$measurements, threads = 2)
fit <- calibrate(emulator, open_house$measurements, seed = 1, threads = 2)
scaled("history attribution of O5", elapsed(attribute_discrepancy(fit, seed = 1)), "s", 2)

# Each house in a session of its own, with two threads: seconds, and the most memory the session
# held (MB).
house <- function(name) {
  code <- sprintf('suppressPackageStartupMessages(library(amiss))
    study <- read_study(system.file("studies", "twinhouse_%s.yml", package = "amiss"))
    seconds <- system.time(upgrade_model(study$model, study$measurements, study$catalogue,
                                         runs = study$runs, control = study$control,
                                         seed = study$seed, threads = 2, quiet = TRUE))[["elapsed"]]
    peak <- grep("VmHWM", readLines("/proc/self/status"), value = TRUE)
    cat(seconds, as.numeric(gsub("[^0-9]", "", peak)) / 1024)', name)
  out <- system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code)), stdout = TRUE)
  stats::setNames(as.numeric(strsplit(out[length(out)], " ")[[1]]), c("seconds", "peak"))
}
houses <- vapply(c(O5 = "O5", N2 = "N2"), house, c(seconds = 0, peak = 0))
for (name in colnames(houses))
  scaled(sprintf("house %s, eight mechanisms, two cores", name), houses["seconds", name], "s")
scaled("houses O5 and N2 together, two cores", sum(houses["seconds", ]), "s", 60)
measured("most memory held by either session", max(houses["peak", ]), "MB", 300)
