# What the instruction sets bring: the package as R CMD INSTALL builds it, without and with its AVX2 library, and compiled
# for this processor (as tools/ does). The former is built into build/portable if it is not there.

portable <- file.path(root, "build", "portable", "library")
if (!dir.exists(file.path(portable, "amiss"))) {
  run("bash", "-c", shQuote(sprintf("source %s && install_package portable", shQuote(file.path(root, "tools", "lib.sh")))))
}
whole <- 'suppressPackageStartupMessages(library(amiss))
  study <- read_study(system.file("studies", "paper_synthetic.yml", package = "amiss"))
  cat(system.time({
    emulator <- train_emulator(simulate_design(study$models[["M3"]], study$measurements, 300, seed = 1), study$measurements)
    fit <- calibrate(emulator, study$measurements, seed = 1)
  })[["elapsed"]])'
seconds <- function(library, simd = "") {
  libraries <- paste(c(library, .libPaths()), collapse = ":")
  one <- function(i) as.numeric(system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(whole)), stdout = TRUE, env = c(paste0("R_LIBS=", libraries), paste0("AMISS_SIMD=", simd))))
  stats::median(vapply(1:3, one, 0))
}
baseline <- seconds(portable, "baseline")
scaled("simulate 300 runs, train, calibrate: any x86-64 processor", baseline, "s")
measured("AVX2 chosen at load: times as fast", baseline / seconds(portable), "")
measured("compiled for this processor: times as fast", baseline / seconds(.libPaths()[1]), "")
