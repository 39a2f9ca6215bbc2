# The routines compiled for AVX2 must be those that are called, and say what the others say.

evidence_with <- function(simd) {
  code <- '
    suppressPackageStartupMessages(library(amiss))
    data <- data.frame(hour = 1:80, Te = 5 + 3 * sin(1:80 / 4), Gv = cos(1:80 / 3)^2)
    data$Ti <- 20 + 0.4 * data$Te + 0.5 * data$Gv + 0.1 * sin(61 * (1:80)^2)
    house <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1)
    linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
                                 free("gain", uniform(0, 1)), boundary = "Te")
    runs <- simulate_design(linear, house, runs = 12, seed = 1)
    emulator <- train_emulator(runs, house)
    fit <- calibrate(emulator, house, seed = 1,
                     control = list(ais = list(pilot_chains = 48, groups = 4)))
    emulated <- stats::predict(emulator, cbind(gain = 0.37))$mean[40, 1]
    points <- list(setting = 5L, variance = 0.02, t = matrix(c(0, 0.3), 1))
    record <- amiss:::history_data(emulator, house, fit$rows, fit$control)
    likelihood <- amiss:::run_likelihood_(record, fit$priors, points,
                                          runs$outputs[, 3, drop = FALSE],
                                          list(seed = 1, threads = 1))
    middle <- vapply(zone_parameters(paper_box("M3")),
                     function(p) (p$prior$lower + p$prior$upper) / 2, 0)
    weather <- synthetic_weather(days = 2, step_h = 0.5, seed = 1)[c("Te", "Gv", "Ws", "Wd")]
    box <- simulate_zone(paper_box("M3"), t(middle), as.matrix(transform(weather, RHP = 50)),
                         step_s = 1800)
    numbers <- c(box[96, 1], emulated, likelihood, fit$log_evidence, fit$standard_error, coef(fit))
    cat(amiss:::instruction_set(), format(numbers, digits = 15))'
  out <- system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code)), stdout = TRUE,
                 env = c(paste0("AMISS_SIMD=", simd),
                         paste0("R_LIBS=", paste(.libPaths(), collapse = ":"))))
  parts <- strsplit(trimws(out[length(out)]), " +")[[1]]
  list(set = parts[1], values = as.numeric(parts[-1]))
}

test_that("both libraries agree, and the faster one is used where it can run", {
  baseline <- evidence_with("baseline")
  expect_equal(baseline$set, "baseline")
  expect_length(baseline$values, 6)
  installed <- list.files(system.file("libs", package = "amiss"), "amiss_avx2", recursive = TRUE)
  skip_if(!length(installed), "the package was compiled for one processor")
  skip_if(!amiss:::cpu_has_avx2_(), "this processor has no AVX2")
  avx2 <- evidence_with("")
  expect_equal(avx2$set, "AVX2")
  # Sums in another order: to rounding in the simulator and in the likelihood, to what ends a search
  # in the emulator.
  expect_equal(avx2$values[1], baseline$values[1], tolerance = 1e-10)
  expect_equal(avx2$values[2], baseline$values[2], tolerance = 1e-6)
  expect_equal(avx2$values[3], baseline$values[3], tolerance = 1e-9)
  # A chain that meets another number in the fifth digit may take another turn: the sampled evidence
  # agrees within four standard errors, the parameter to a small part of its posterior (0.01).
  expect_lt(abs(avx2$values[4] - baseline$values[4]),
            4 * sqrt(avx2$values[5]^2 + baseline$values[5]^2))
  expect_equal(avx2$values[6], baseline$values[6], tolerance = 1e-2)
})
