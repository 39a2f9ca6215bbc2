test_that("the emulator reproduces a linear simulator and knows its own error", {
  m <- linear_measurements()
  runs <- simulate_design(linear_simulator(), m, runs = 40, seed = 3)
  emulator <- train_emulator(runs, m)
  expect_gt(emulator$diagnostics$series_r2, 0.9999)
  point <- cbind(offset = 17, gain = 0.3)
  expect_equal(predict(emulator, point)$mean[, 1], 17 + 0.3 * m$raw$drivers[, "Te"],
               tolerance = 1e-3)
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
  expect_warning(train_emulator(ensemble(design, noise), 0.01, list(max_vectors = 3)),
                 "unexplained", class = "amiss_warning_result")
  expect_warning(calibrate_refined(ensemble(design, noise), m,
                                   control = c(list(emulator = list(max_vectors = 3)),
                                               list(calibration = quick_ais)), seed = 1),
                 "control\\$emulator\\$max_vectors", class = "amiss_warning_basis")
  emulator <- suppressWarnings(train_emulator(ensemble(design, noise), 0.01, list(max_vectors = 3)))
  expect_false(emulator$trust$trusted)
  expect_match(emulator$trust$verdict, "basis of 3 vectors leaves 0.9.*more than the noise of 0.01")
  expect_match(printed(emulator), "basis of 3 vectors leaves")
  expect_error(train_emulator(ensemble(design, noise), 0.01, list(vectors = 3)),
               "unknown option.*vectors", class = "amiss_error_input")
  same <- matrix(sin(1:240), 240, 30)
  expect_error(train_emulator(ensemble(design, same), 0.01),
               "All 30 runs are the same.*offset.*gain", class = "amiss_error_input")
})

test_that("the emulator refuses points it knows nothing of", {
  m <- linear_measurements()
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  expect_error(predict(emulator, cbind(offset = 500, gain = 1)), "outside its prior",
               class = "amiss_error_input")
  expect_error(predict(emulator, cbind(offset = NA, gain = 1)), "newdata",
               class = "amiss_error_input")
  expect_error(predict(emulator, "a"), "newdata", class = "amiss_error_input")
})

box_runs <- function(model, seed = 1, unit = NULL) {
  data <- synthetic_weather(4, seed = seed)
  data$RHP <- rolbs(nrow(data), power = 100, seed = seed)
  data$Ti <- 20
  m <- measurements(data, time = "hour", target = "Ti",
                    boundary = ~ Te + Gv + Ws + circular(Wd) + RHP, noise_sd = 0.1, warmup = 24)
  box <- paper_box(model)
  parameters <- free_parameters(box)
  if (is.null(unit)) return(simulate_design(box, m, runs = 10 * length(parameters), seed = seed))
  values <- amiss:::unit_to_values(unit, parameters)
  ensemble(values, amiss:::simulate_measured(box, values, m, "calibrate", 1), parameters)
}

# The Borehole function (Morris, Mitchell and Ylvisaker 1993), its length as time goes on.
borehole_runs <- function(runs = 70) {
  ranges <- list(rw = c(0.05, 0.15), r = c(100, 50000), Tu = c(63070, 115600), Hu = c(990, 1110),
                 Tl = c(63.1, 116), Hl = c(700, 820), Kw = c(9855, 12045))
  parameters <- lapply(names(ranges), function(n) free(n, uniform(ranges[[n]][1], ranges[[n]][2])))
  names(parameters) <- names(ranges)
  design <- amiss:::unit_to_values(amiss:::with_seed(5, lhs::randomLHS(runs, 7)), parameters)
  length <- seq(1120, 1680, length.out = 60)
  outputs <- apply(design, 1, function(v) {
    ratio <- log(v[["r"]] / v[["rw"]])
    2 * pi * v[["Tu"]] * (v[["Hu"]] - v[["Hl"]]) /
      (ratio *
       (1 + 2 * length * v[["Tu"]] / (ratio * v[["rw"]]^2 * v[["Kw"]]) + v[["Tu"]] / v[["Tl"]]))
  })
  ensemble(design, outputs, parameters)
}

test_that("95 % intervals of runs left out hold 95 % of them, coefficients and series", {
  skip_on_cran()  # second tier: tools/test --quick
  study <- suppressWarnings(read_study(twinhouse_study("O5")))
  runs <- c(lapply(paste0("M", 1:6), box_runs),
            list(borehole_runs(),
                 simulate_design(study$model, study$measurements, runs = 150, seed = 1)))
  noise <- c(rep(0.1, 6), 1, 0.1)
  diagnostics <- Map(function(r, n) train_emulator(r, n)$diagnostics, runs, noise)
  size <- vapply(seq_along(runs),
                 function(i) ncol(runs[[i]]$outputs) * nrow(diagnostics[[i]]$coefficients), 0)
  # Over 3000 coefficients left out: the standard deviation of a binomial share of 0.95 is 0.004, so
  # that 0.93 to 0.97 is five of them either way. The series of a run are its few coefficients and
  # what the basis leaves out: about as many independent errors.
  expect_gt(sum(size), 3000)
  coefficients <- sum(size * vapply(diagnostics, `[[`, 0, "coverage95")) / sum(size)
  series <- sum(size * vapply(diagnostics, `[[`, 0, "series_coverage95")) / sum(size)
  expect_gt(coefficients, 0.93)
  expect_lt(coefficients, 0.97)
  expect_gt(series, 0.93)
  expect_lt(series, 0.97)
  # A selection that is caught where the nugget has no slope is over-confident: its intervals held
  # 0.78 here, which asks for a factor of (1.96 / 1.23)^2 = 2.5.
  expect_lt(
    max(train_emulator(runs[[7]], 1, list(selection = "forward"))$diagnostics$coefficients$widened),
    1.6)
})

test_that("a prediction's sd is that of a run: emulator, nugget and what the basis leaves out", {
  runs <- box_runs("M4")
  emulator <- train_emulator(runs, 0.1)
  fresh <- box_runs("M4", unit = withr::with_seed(7, matrix(runif(200 * 6), 200)))
  predicted <- predict(emulator, fresh$values)
  # 200 runs of 7 to 8 independent errors each: 0.6 % of binomial error about 95 %. The factors by
  # which variances are widened come from 60 errors left out each: 18 % of a variance, 2 % of
  # coverage. Without the discarded part it would be 45 %.
  coverage <- mean(abs(predicted$mean - fresh$outputs) < stats::qnorm(0.975) * predicted$sd)
  expect_gt(coverage, 0.92)
  expect_lt(coverage, 0.99)
  m <- ncol(runs$outputs)
  raised <- m / (m - ncol(emulator$basis$vectors) + 1)
  expect_equal(sqrt(mean(emulator$basis$discarded_sd^2)), raised * emulator$basis$discarded_rms,
               tolerance = 1e-8)
})

test_that("forward selection finds the parameters that act, with one thread and with two", {
  set.seed(2)
  design <- matrix(runif(60 * 6), 60, dimnames = list(NULL, letters[1:6]))
  t <- seq_len(50) / 10
  outputs <- apply(
    design, 1, function(v) 20 + 3 * v[["b"]] * exp(-t * (0.3 + v[["e"]])) + sin(4 * v[["e"]] + t))
  runs <- ensemble(design, outputs)
  forward <- train_emulator(runs, 0.1, list(selection = "forward"))
  first <- forward$selection[forward$selection$step <= 2, ]
  expect_true(all(first$parameter[first$vector == 1] %in% c("b", "e")))
  expect_true(all(forward$selection$parameter[forward$selection$step == 1] %in% c("b", "e")))
  beta <- tidy(forward)
  expect_lt(max(beta$beta[beta$vector == 1 & beta$parameter == "e"]),
            min(beta$beta[beta$vector == 1 & beta$parameter %in% c("a", "c", "d", "f")]))
  expect_setequal(beta$step[beta$vector == 1 & !is.na(beta$step)],
                  forward$selection$step[forward$selection$vector == 1])
  expect_identical(train_emulator(runs, 0.1, list(selection = "forward"), threads = 2), forward)
  ard <- train_emulator(runs, 0.1)
  expect_equal(nrow(ard$selection), 0)
  # Both find nearly all of it; neither may be much worse.
  expect_gt(min(ard$diagnostics$series_r2, forward$diagnostics$series_r2), 0.999)
  expect_lt(forward$diagnostics$series_rmse, 1.5 * ard$diagnostics$series_rmse)
  expect_match(printed(forward), "own beta by forward selection.*vector 1: [be]")
})

test_that("priors of the hyper-parameters can be changed, within reason", {
  runs <- simulate_design(linear_simulator(), linear_measurements(), runs = 30, seed = 3)
  train <- function(...) train_emulator(runs, 0.1, list(...))
  default <- train()
  expect_identical(train(s2 = c(1, 1), lambda = c(2, NA))$processes, default$processes)
  # A firm prior draws beta to its mode, 0.5.
  expect_equal(tidy(train(beta = c(1e5, 1e5)))$beta, rep(0.5, 4), tolerance = 1e-2)
  firm <- train(lambda = c(1e6, 1))$processes$hyperparameters[, 3]
  expect_true(all(firm != default$processes$hyperparameters[, 3]))
  expect_error(train(beta = c(1, 0.5)), "control\\$beta.*no greatest value",
               class = "amiss_error_input")
  expect_error(train(eta2 = 1), "control\\$eta2", class = "amiss_error_input")
  expect_error(train(lambda = c(0, 1)), "shape.*positive.*0", class = "amiss_error_input")
  expect_error(train(selection = "backward"), "control\\$selection.*backward",
               class = "amiss_error_input")
  expect_error(train(selection = "forward", significance = 2), "significance",
               class = "amiss_error_input")
})

test_that("the bits do not depend on where R keeps the runs", {
  m <- linear_measurements()
  runs <- simulate_design(linear_simulator(), m, runs = 30, seed = 1)
  control <- c(amiss:::emulator_control, noise_sd = 0.1)
  first <- amiss:::make_basis_(runs$outputs, control)
  kept <- list()
  for (i in 1:24) {  # copies land at other addresses, some aligned in another way
    kept[[i]] <- list(numeric(i), runs$outputs + 0)
    expect_identical(amiss:::make_basis_(kept[[i]][[2]], control), first)
  }
  zone <- paper_box("M2")
  data <- synthetic_weather(2, seed = 1)
  data$RHP <- 50
  values <- t(vapply(zone_parameters(zone), function(p) 0.5 * (p$prior$lower + p$prior$upper), 0))
  drivers <- as.matrix(data[setdiff(names(data), "hour")])
  air <- simulate_zone(zone, values, drivers, step_s = 900)
  for (i in 1:24) {
    kept[[i]] <- list(numeric(i), drivers + 0)
    expect_identical(simulate_zone(zone, values, kept[[i]][[2]], step_s = 900), air)
  }
})
