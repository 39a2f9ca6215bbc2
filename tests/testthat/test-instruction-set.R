# The routines compiled for AVX2 must be those that are called, and say what the others say.

evidence_with <- function(simd) {
  code <- '
    suppressPackageStartupMessages(library(amiss))
    data <- data.frame(hour = 1:80, Te = 5 + 3 * sin(1:80 / 4), Gv = cos(1:80 / 3)^2)
    data$Ti <- 20 + 0.4 * data$Te + 0.5 * data$Gv + 0.1 * sin(61 * (1:80)^2)
    house <- measurements(data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1)
    linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"], free("gain", uniform(0, 1)), boundary = "Te")
    runs <- simulate_design(linear, house, runs = 12, seed = 1)
    fit <- calibrate(train_emulator(runs, house), house, seed = 1, control = list(ais = list(pilot_chains = 48, groups = 4)))
    box <- simulate_zone(paper_box("M3"), t(vapply(zone_parameters(paper_box("M3")), function(p) (p$prior$lower + p$prior$upper) / 2, 0)),
                         as.matrix(synthetic_weather(days = 2, step_h = 0.5, seed = 1)[c("Te", "Gv", "Ws", "Wd")] |> transform(RHP = 50)), step_s = 1800)
    cat(amiss:::instruction_set(), format(c(fit$log_evidence, coef(fit), box[96, 1]), digits = 15))'
  out <- system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code)), stdout = TRUE,
                 env = c(paste0("AMISS_SIMD=", simd), paste0("R_LIBS=", paste(.libPaths(), collapse = ":"))))
  parts <- strsplit(trimws(out[length(out)]), " +")[[1]]
  list(set = parts[1], values = as.numeric(parts[-1]))
}

test_that("both libraries agree, and the faster one is used where it can run", {
  baseline <- evidence_with("baseline")
  expect_equal(baseline$set, "baseline")
  expect_length(baseline$values, 3)
  installed <- list.files(system.file("libs", package = "amiss"), "amiss_avx2", recursive = TRUE)
  skip_if(!length(installed), "the package was compiled for one processor")
  skip_if(!amiss:::cpu_has_avx2_(), "this processor has no AVX2")
  avx2 <- evidence_with("")
  expect_equal(avx2$set, "AVX2")
  # Sums in another order: to rounding in the simulator; through emulator and sampler far below their own error.
  expect_equal(avx2$values, baseline$values, tolerance = 1e-4)
  expect_equal(avx2$values[3], baseline$values[3], tolerance = 1e-10)
})
