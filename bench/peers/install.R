# Packages of others for the comparisons, under build/peers: only what is missing there is fetched.

# A library with these packages from CRAN; those that could not be installed are named.
peer_library <- function(root, packages) {
  library <- file.path(root, "build", "peers", "library")
  dir.create(library, showWarnings = FALSE, recursive = TRUE)
  absent <- function() setdiff(packages, rownames(utils::installed.packages(library)))
  if (length(absent())) try(utils::install.packages(absent(), library, Ncpus = 2, quiet = TRUE))
  if (length(absent())) cat("could not be installed:", paste(absent(), collapse = ", "), "\n")
  library
}

# What R uses by default may be the reference BLAS, with which no one who cares for speed would run
# the peers. OpenBLAS as Debian has it (one thread), unpacked, not installed; "" elsewhere, and the
# peers get R's own.
peer_blas <- function(root) {
  folder <- file.path(root, "build", "peers", "openblas")
  found <- function()
    Sys.glob(file.path(folder, "usr", "lib", "*", "openblas-serial", "libopenblas.so.0"))
  if (!length(found()) && nzchar(Sys.which("apt-get"))) {
    dir.create(folder, showWarnings = FALSE, recursive = TRUE)
    fetch <- paste("(cd", shQuote(folder),
                   "&& apt-get download libopenblas0-serial && dpkg -x *.deb .)")
    system(fetch, ignore.stdout = TRUE, ignore.stderr = TRUE)
  }
  c(found(), "")[1]
}

# Runs an R script of this folder with those packages and that BLAS, on one thread, and reads what
# it writes to the file that it is given.
run_with_peers <- function(root, script, packages) {
  library <- peer_library(root, packages)
  file <- tempfile(fileext = ".rds")
  paths <- paste(c(library, .libPaths()), collapse = .Platform$path.sep)
  env <- c("OPENBLAS_NUM_THREADS=1", "OMP_NUM_THREADS=1",
           paste0(c("R_LIBS=", "LD_PRELOAD="), shQuote(c(paths, peer_blas(root)))))
  status <- system2(file.path(R.home("bin"), "Rscript"),
                    shQuote(c(file.path(root, "bench", "peers", script), file)), env = env)
  if (status != 0) stop(script, " failed", call. = FALSE)
  readRDS(file)
}
