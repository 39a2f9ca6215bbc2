# Runs tests/testthat on the installed package; fails when a test fails. Writes the count to FILE
# and, where the files do not run side by side (TESTTHAT_PARALLEL=FALSE), to FILE.csv the seconds
# that each test took, the slowest first.
# Usage: Rscript tools/run-testthat.R FILE
file <- commandArgs(trailingOnly = TRUE)[1]
results <- as.data.frame(testthat::test_dir("tests/testthat", package = "amiss",
                                            load_package = "installed", reporter = "summary",
                                            stop_on_failure = FALSE))
if (nrow(results) == 0) stop("no R test was run")
if (identical(toupper(Sys.getenv("TESTTHAT_PARALLEL")), "FALSE")) {
  times <- results[order(-results$real), c("real", "user", "file", "test")]
  utils::write.csv(times, paste0(file, ".csv"), row.names = FALSE)
}
broken <- sum(results$failed > 0 | results$error)
if (broken) stop(broken, " of ", nrow(results), " R tests failed", call. = FALSE)
writeLines(sprintf("%d R tests (%d expectations, %d skipped)", nrow(results), sum(results$nb),
                   sum(results$skipped)), file)
