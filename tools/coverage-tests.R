# The tests that tools/coverage.R counts lines by, in its own process.
testthat::test_dir("tests/testthat", package = "amiss", load_package = "none", reporter = "silent",
                   stop_on_failure = FALSE)
