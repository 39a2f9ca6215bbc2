# Runs tests/testthat on the installed package; fails when a test fails. Writes the count to the file given.
arguments <- commandArgs(trailingOnly = TRUE)
results <- testthat::test_dir("tests/testthat", package = "amiss", load_package = "installed",
                              reporter = "summary", stop_on_failure = TRUE)
results <- as.data.frame(results)
if (nrow(results) == 0) stop("no R test was run")
writeLines(sprintf("%d R tests (%d expectations, %d skipped)", nrow(results), sum(results$nb), sum(results$skipped)),
           arguments[1])
