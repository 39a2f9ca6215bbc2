test_that("the emulator reproduces a linear simulator and knows its own error", {
  m <- linear_measurements()
  runs <- simulate_design(linear_simulator(), m, runs = 40, seed = 3)
  emulator <- train_emulator(runs, m)
  expect_gt(emulator$diagnostics$series_r2, 0.9999)
  point <- cbind(offset = 17, gain = 0.3)
  expect_equal(predict(emulator, point)$mean[, 1], 17 + 0.3 * m$raw$drivers[, "Te"], tolerance = 1e-3)
})

test_that("a stored emulator is the same emulator", {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  file <- withr::local_tempfile()
  saveRDS(emulator, file)
  point <- cbind(offset = 17, gain = 0.3)
  expect_identical(predict(readRDS(file), point), predict(emulator, point))
})

test_that("a basis that explains too little is said to", {
  m <- linear_measurements()
  set.seed(1)
  design <- cbind(offset = runif(30, 10, 30), gain = runif(30))
  noise <- matrix(rnorm(240 * 30), 240)
  expect_warning(train_emulator(ensemble(design, noise), 0.01, list(max_vectors = 3)), "unexplained", class = "amiss_warning_result")
  expect_error(train_emulator(ensemble(design, noise), 0.01, list(vectors = 3)), "unknown option.*vectors", class = "amiss_error_input")
  expect_error(train_emulator(ensemble(design, matrix(1, 240, 30)), 0.01), "do not vary", class = "amiss_error_input")
})

test_that("the emulator refuses points it knows nothing of", {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  expect_error(predict(emulator, cbind(offset = 500, gain = 1)), "outside its prior", class = "amiss_error_input")
  expect_error(predict(emulator, cbind(offset = NA, gain = 1)), "newdata", class = "amiss_error_input")
  expect_error(predict(emulator, "a"), "newdata", class = "amiss_error_input")
})
