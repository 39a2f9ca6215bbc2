# What the instruction sets bring: the package as R CMD INSTALL builds it, without and with its AVX2
# library, and compiled for this processor (as tools/ does). Then what a BLAS for the matrix
# products brings (AMISS_BLAS=1): R's own and OpenBLAS (bench/peers/install.R), each beside Eigen's
# products in a session that has the same BLAS for R's.

installed <- function(variant) {
  run("bash", "-c", shQuote(sprintf("source %s && install_package %s",
                                    shQuote(file.path(root, "tools", "lib.sh")), variant)))
  file.path(root, "build", variant, "library")
}
whole <- 'suppressPackageStartupMessages(library(amiss))
  study <- read_study(system.file("studies", "paper_synthetic.yml", package = "amiss"))
  cat(system.time({
    runs <- simulate_design(study$models[["M3"]], study$measurements, 300, seed = 1)
    emulator <- train_emulator(runs, study$measurements)
    fit <- calibrate(emulator, study$measurements, seed = 1)
  })[["elapsed"]])'
seconds <- function(library, simd = "", preload = "") {
  libraries <- paste(c(library, .libPaths()), collapse = ":")
  env <- c("OPENBLAS_NUM_THREADS=1", "OMP_NUM_THREADS=1",
           paste0(c("R_LIBS=", "AMISS_SIMD=", "LD_PRELOAD="), shQuote(c(libraries, simd, preload))))
  one <- function(i)
    as.numeric(system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(whole)), stdout = TRUE,
                       env = env))
  stats::median(vapply(1:3, one, 0))
}
portable <- installed("portable")
baseline <- seconds(portable, "baseline")
scaled("simulate 300 runs, train, calibrate: any x86-64 processor", baseline, "s")
measured("AVX2 chosen at load: times as fast", baseline / seconds(portable), "")
native <- seconds(.libPaths()[1])
measured("compiled for this processor: times as fast", baseline / native, "")

source(file.path(root, "bench", "peers", "install.R"), local = TRUE)
blas <- installed("blas")
own <- basename(extSoftVersion()[["BLAS"]])
measured(sprintf("products by R's own BLAS (%s) instead of Eigen: times as fast", own),
         native / seconds(blas), "")
open_blas <- peer_blas(root)
if (nzchar(open_blas)) {
  measured("products by OpenBLAS instead of Eigen: times as fast",
           seconds(.libPaths()[1], preload = open_blas) / seconds(blas, preload = open_blas), "")
}
