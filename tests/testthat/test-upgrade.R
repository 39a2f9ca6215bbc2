test_that("candidates that come near the best are calibrated in full, the others coarsely", {
  upgrade <- small_upgrade()
  table <- upgrade$candidates
  expect_equal(table$mechanism[!table$screened], "sun")
  expect_true(table$screened[table$mechanism == "drift"])
  expect_equal(upgrade$named_cause$mechanism, "sun")
})

test_that("contenders are those within the margin, and none where nothing comes near adoption", {
  fit <- function(log10_evidence, se = 0.05, lag = 0) {
    posterior <- list(annealed = c((log10_evidence - lag) * log(10), 0.1), second = c(log10_evidence * log(10), 0.1))
    structure(list(measurements = list(y = 1:3), rows = 1:3, log_evidence = log10_evidence * log(10), standard_error = se * log(10), posterior = posterior),
              class = "amiss_calibration")
  }
  control <- list(margin = 3, decisive = 2)
  reference <- fit(0, 0)
  expect_equal(amiss:::contenders(list(a = fit(10), b = fit(7.5), c = fit(6)), reference, control), c("a", "b"))
  expect_equal(amiss:::contenders(list(a = fit(10), b = fit(6, se = 0.5)), reference, control), c("a", "b"))  # its error reaches
  expect_equal(amiss:::contenders(list(a = fit(10), b = fit(6, lag = 2)), reference, control), c("a", "b"))  # its chains may have missed a mode
  expect_length(amiss:::contenders(list(a = fit(-2), b = fit(-5)), reference, control), 0)
  expect_equal(amiss:::contenders(list(a = fit(-0.5), b = fit(-5)), reference, control), "a")
})

test_that("screening can be left out, and bad settings are refused before anything runs", {
  upgrade <- small_upgrade()
  quick <- list(ais = list(pilot_chains = 24, groups = 4, chains = 8, importance_draws = 200))
  fits <- lapply(upgrade$models, `[[`, "fit")
  arguments <- list(fits[[1]]$emulator$simulator, upgrade$measurements, upgrade$catalogue, runs = 30, seed = 1, quiet = TRUE)
  full <- do.call(upgrade_model, c(arguments, list(control = list(
    max_steps = 1, screening = NULL, calibration = quick, attribution = list(surrogates = 19)))))
  expect_false(any(full$candidates$screened))
  expect_equal(full$named_cause$mechanism, "sun")
  both <- full$candidates$mechanism == "sun"
  own <- upgrade$candidates$mechanism == "sun"
  expect_equal(full$candidates$log10_bf[both], upgrade$candidates$log10_bf[own], tolerance = 1e-8)  # the same full calibration
  expect_error(do.call(upgrade_model, c(arguments, list(control = list(screening = list(chains = -1))))), "chains", class = "amiss_error_input")
  expect_error(do.call(upgrade_model, c(arguments, list(control = list(margin = -1)))), "margin", class = "amiss_error_input")
})
