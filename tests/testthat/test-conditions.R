# Objects that were read from a file of another version.

test_that("an object of another version is refused by its name, with both versions", {
  fit <- small_upgrade()$models[[1]]$fit
  expect_silent(amiss:::check_object(fit, "amiss_fit", "fit"))
  fit$format_version <- 1L
  for (use in list(attribute_discrepancy, discrepancy, predict,
                   function(fit) bayes_factor(fit, fit),
                   function(fit) report(fit, tempfile()))) {
    expect_error(use(fit), "another version.*1.*3", class = "amiss_error_input")
  }
  m <- small_upgrade()$measurements
  m$format_version <- "0.1"
  expect_error(simulate_design(fit$emulator$simulator, m, 20),
               "`measurements` was made by another version", class = "amiss_error_input")
  # Functions and what has no format are judged by their class alone.
  expect_error(amiss:::check_object(mean, "amiss_fit", "fit"),
               "must be a calibration made by calibrate\\(\\); got a function")
})
