# What the instruction sets bring: the package as R CMD INSTALL builds it, without and with its AVX2 library, and compiled
# for this processor (as tools/ does). The former is built into build/portable if it is not there. Then what a BLAS for the
# matrix products brings (AMISS_BLAS=1, built into build/blas likewise): R's own and OpenBLAS (bench/peers/install.R), each
# beside Eigen's products in a session that has the same BLAS for R's.

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
seconds <- function(library, simd = "", preload = "") {
  libraries <- paste(c(library, .libPaths()), collapse = ":")
  env <- c("OPENBLAS_NUM_THREADS=1", "OMP_NUM_THREADS=1", paste0(c("R_LIBS=", "AMISS_SIMD=", "LD_PRELOAD="), shQuote(c(libraries, simd, preload))))
  one <- function(i) as.numeric(system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(whole)), stdout = TRUE, env = env))
  stats::median(vapply(1:3, one, 0))
}
baseline <- seconds(portable, "baseline")
scaled("simulate 300 runs, train, calibrate: any x86-64 processor", baseline, "s")
measured("AVX2 chosen at load: times as fast", baseline / seconds(portable), "")
native <- seconds(.libPaths()[1])
measured("compiled for this processor: times as fast", baseline / native, "")

source(file.path(root, "bench", "peers", "install.R"), local = TRUE)
blas <- file.path(root, "build", "blas")
if (!dir.exists(file.path(blas, "library", "amiss"))) {
  copy <- file.path(blas, "package")  # so that the clone stays clean
  for (folder in c(copy, file.path(blas, "library"))) dir.create(folder, showWarnings = FALSE, recursive = TRUE)
  file.copy(file.path(root, c("DESCRIPTION", "NAMESPACE", "R", "src", "inst")), copy, recursive = TRUE)
  makevars <- Sys.getenv("R_MAKEVARS_USER", file.path(root, "tools", "Makevars"))
  log <- file.path(blas, "install.log")
  status <- system2(file.path(R.home("bin"), "R"), c("CMD", "INSTALL", "--no-multiarch", shQuote(c(paste0("--library=", blas, "/library"), copy))),
                    stdout = log, stderr = log, env = c("AMISS_BLAS=1", "AMISS_NATIVE=1", "MAKEFLAGS=-j2", paste0("R_MAKEVARS_USER=", shQuote(makevars))))
  if (status != 0) stop("the package could not be installed with AMISS_BLAS=1: see ", log, call. = FALSE)
}
own <- basename(extSoftVersion()[["BLAS"]])
measured(sprintf("products by R's own BLAS (%s) instead of Eigen: times as fast", own), native / seconds(file.path(blas, "library")), "")
open_blas <- peer_blas(root)
if (nzchar(open_blas)) {
  measured("products by OpenBLAS instead of Eigen: times as fast",
           seconds(.libPaths()[1], preload = open_blas) / seconds(file.path(blas, "library"), preload = open_blas), "")
}
