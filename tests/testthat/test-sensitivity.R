# Ishigami's function, and its indices in closed form (Ishigami and Homma 1990).
ishigami_ensemble <- function(runs) {
  design <- withr::with_seed(1, lhs::randomLHS(200, 3) * 2 * pi - pi)[seq_len(runs), ]
  colnames(design) <- c("x1", "x2", "x3")
  value <- sin(design[, 1]) + 7 * sin(design[, 2])^2 + 0.1 * design[, 3]^4 * sin(design[, 1])
  free_ones <- lapply(colnames(design), function(name) free(name, uniform(-pi, pi)))
  ensemble(design, outer(1 + 0.3 * sin(1:6), value), free_ones)
}

ishigami_indices <- function() {
  alone <- c((1 + 0.1 * pi^4 / 5)^2 / 2, 7^2 / 8, 0)
  both <- 0.01 * pi^8 * (1 / 18 - 1 / 50)
  list(first = alone / (sum(alone) + both),
       total = (alone + both * c(1, 0, 1)) / (sum(alone) + both))
}

test_that("indices of Ishigami's function are those of the closed form, within their errors", {
  truth <- unlist(ishigami_indices(), use.names = FALSE)
  emulators <- lapply(c(60, 200),
                      function(runs) train_emulator(ishigami_ensemble(runs), noise_sd = 0.01))
  indices <- list(sobol_indices(emulators[[1]], points = 128, replicates = 8, seed = 2),
                  sobol_indices(emulators[[2]], seed = 2))
  rows <- lapply(indices, generics::tidy)
  expect_lt(max(abs(rows[[2]]$estimate - truth)), 0.03)  # three of its standard errors, 0.01
  for (table in rows) expect_lt(max(abs(table$estimate - truth) / table$std.error), 3.5)
  # Few runs: it is the emulator that is uncertain, and it says so.
  expect_gt(max(indices[[1]]$table$first_emulator), 5 * max(indices[[1]]$table$first_sampling))
  expect_gt(indices[[1]]$unexplained, 0.1)
  expect_lt(indices[[2]]$unexplained, 0.01)
})

test_that("indices of a series weigh its steps by their variances", {
  m <- linear_measurements(linear_data(48))
  fit_of <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 1), m)
  indices <- sobol_indices(fit_of, by_time = TRUE, seed = 1)
  gain <- linear_data(48)$Te^2  # variances over the priors, times 12
  offset <- 20^2
  truth <- c(48 * offset, sum(gain)) / (48 * offset + sum(gain))
  expect_lt(max(abs(indices$table$first - truth)), 0.015)  # the standard error is 0.004
  expect_equal(indices$table$total, indices$table$first, tolerance = 1e-3)
  expect_lt(max(indices$table$first_emulator), 1e-3)
  step <- indices$by_time[indices$by_time$parameter == "gain", ]
  expect_equal(step$time, 1:48)
  expect_equal(step$total, gain / (offset + gain), tolerance = 0.06)
  expect_null(sobol_indices(fit_of, points = 32, replicates = 4, seed = 1)$by_time)
})

test_that("functions drawn go through the runs and vary elsewhere as the emulator says", {
  emulator <- train_emulator(ishigami_ensemble(40), noise_sd = 0.01)
  inputs <- emulator$processes$inputs
  unit <- rbind(c(0.1, 0.2, 0.3), c(0.9, 0.5, 0.1), c(0.5, 0.5, 0.5), c(0.3, 0.8, 0.6))
  drawn <- with_seed(1, replicate(200, drawn_function(emulator)(rbind(inputs, unit))[, 1]))
  expect_equal(rowMeans(drawn[1:40, ]), emulator$processes$coefficients[, 1], tolerance = 0.01)
  known <- emulated_coefficients(emulator, unit)
  # 200 draws know a standard deviation to 5 %, 256 features a covariance to 6 %.
  expect_equal(apply(drawn[41:44, ], 1, sd) / sqrt(known$variance[, 1]), rep(1, 4), tolerance = 0.2)
  expect_lt(max(abs(rowMeans(drawn[41:44, ]) - known$mean[, 1]) / sqrt(known$variance[, 1])), 0.4)
})

test_that(paste("a fit and a refined emulator have the indices over the priors, and R's generator",
                "stays as it was"), {
  m <- linear_measurements(linear_data(48))
  made <- simulate_design(linear_simulator(), m, runs = 30, seed = 1)
  emulator <- train_emulator(made, m)
  fit <- calibrate(emulator, m, c(quick_ais, check = 0, exact = 0), seed = 1)
  refined <- train_emulator(refine_ensemble(made, fit, runs = 20), m)
  expect_false(is.null(refined$processes$region))
  small <- function(x) sobol_indices(x, points = 64, replicates = 4, seed = 3)$table
  set.seed(1)
  before <- .Random.seed
  expect_identical(small(fit), small(emulator))
  expect_identical(small(refined), small(emulator))
  expect_identical(.Random.seed, before)
})

test_that("indices are printed, tidied and drawn", {
  indices <- sobol_indices(train_emulator(ishigami_ensemble(80), noise_sd = 0.01), 64, 4, seed = 1)
  expect_match(printed(indices),
               "Sobol indices of 3 parameters.*x2.*x1.*x3.*first orders add up.*unexplained")
  table <- generics::tidy(indices)
  expect_equal(table$order, rep(c("first", "total"), each = 3))
  expect_true(all(table$conf.low <= table$conf.high & table$conf.low >= 0 & table$conf.high <= 1))
  expect_identical(as.data.frame(indices), indices$table)
  figure <- ggplot2::autoplot(indices)
  expect_match(figure$labels$title,
               "^x2 moves the simulation most: [0-9]+ % of its variance by itself, [0-9]+ % with")
  expect_s3_class(ggplot2::ggplot_build(figure), "ggplot_built")
})

test_that("what has no indices is refused", {
  emulator <- train_emulator(ishigami_ensemble(40), noise_sd = 0.01)
  expect_error(sobol_indices(ishigami_ensemble(40)), "train_emulator", class = "amiss_error_input")
  expect_error(sobol_indices(emulator, points = 10), "too few", class = "amiss_error_input")
  expect_error(sobol_indices(emulator, replicates = 2), "too few", class = "amiss_error_input")
  expect_error(generics::tidy(sobol_indices(emulator, 32, 4), what = 1),
               class = "rlib_error_dots_nonempty")
})
