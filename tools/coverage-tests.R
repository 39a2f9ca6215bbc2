# The tests that tools/coverage.R counts lines by, in its own process: the first tier, and of the
# second the files on figures, reports and folders of results, whose lines the first tier leaves out
# because they are long to draw and render. Says what each file took, so that it can be seen where
# the time goes; stops when a test fails.
counted_tests <- function(filter, tier) {
  withr::local_envvar(NOT_CRAN = if (tier == "second") "true" else "false")
  files <- testthat::find_test_scripts("tests/testthat", filter = filter, full.names = FALSE)
  for (file in sub("^test-(.*)[.][rR]$", "\\1", files)) {
    seconds <- system.time(
      results <- as.data.frame(testthat::test_dir("tests/testthat", filter = paste0("^", file, "$"),
                                                  package = "amiss", load_package = "none",
                                                  reporter = "silent",
                                                  stop_on_failure = FALSE)))[["elapsed"]]
    if (nrow(results))
      message(sprintf("%-18s %3d tests of the %s tier %5.0f s", file, nrow(results), tier, seconds))
    broken <- results$test[results$failed > 0 | results$error]
    if (length(broken)) stop("failed: ", paste(broken, collapse = "; "), call. = FALSE)
  }
}

counted_tests(NULL, "first")
counted_tests("^(plot|report|results-folder)$", "second")
