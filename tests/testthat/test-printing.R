# What people read of results: numbers with their intervals, labels, the same sentences everywhere.

test_that("an estimate and its interval have the decimals that show two digits of its width", {
  told <- amiss:::same_decimals(c(297.131, 21.595, 0.4, -0.001), c(297.094, 21.6, 0.1, -0.02),
                                c(297.168, 21.642, 30, 0.02))
  expect_identical(told$estimate, c("297.131", "21.595", "0", "-0.001"))
  expect_identical(told$lower, c("297.094", "21.600", "0", "-0.020"))
  expect_identical(told$upper, c("297.168", "21.642", "30", "0.020"))
  expect_identical(amiss:::with_limits(128.2, 127.98, 128.41, "+"), "+128.20 [+127.98, +128.41]")
  expect_identical(amiss:::with_limits(0.001, -2, 2, "+"), "0.0 [-2.0, +2.0]")
  expect_identical(amiss:::with_limits(1e9, 9e8, 1.2e9), "1.00e+09 [9.00e+08, 1.20e+09]")
  expect_identical(amiss:::with_limits(c(3, 0), c(3, 0), c(3, 0)), c("3.00 [3.00, 3.00]",
                                                                     "0 [0, 0]"))
  expect_identical(amiss:::same_decimals(NA, NA, NA)$estimate, NA)
})

warm <- function(least = 10) {
  function_simulator(function(values, drivers) {
    values[["offset"]] + values[["gain"]] * drivers[, "Te"]
  }, free("offset", uniform(least, 30), "degC", label = "base level"),
  free("gain", uniform(0, 1)), boundary = "Te")
}

warm_measurements <- function(...) {
  linear_measurements(linear_data(96), unit = "degC", ...,
                      boundary = list(Te = condition("outdoor air", "degC"),
                                      Gv = condition("sun", "W/m2")))
}

warm_fit <- made_once(function(least = 10) {
  m <- warm_measurements()
  calibrate(train_emulator(simulate_design(warm(least), m, 30, seed = 1), m), m, quick_ais,
            seed = 1)
})

test_that("print, summary and report say the same of the error, the edges and the modes", {
  fit <- warm_fit(20.5)
  upper <- seq_len(nrow(fit$values)) %% 2 == 0
  fit$values[, "gain"] <- fit$values[, "gain"] + 0.5 * upper
  said <- c(amiss:::error_sentence(fit), amiss:::edge_sentence(fit), amiss:::mode_words(fit))
  expect_match(said, "At the edge of what was thought possible: base level", all = FALSE)
  expect_match(said, "error is [0-9.]+ \u00b0C, [0-9.]+ times the stated noise", all = FALSE)
  expect_match(said, "gain has 2 modes", all = FALSE)
  report <- amiss:::calibration_words(fit, amiss:::as_only_model(fit))
  for (sentence in said) {
    expect_match(printed(fit), sentence, fixed = TRUE)
    expect_match(printed(summary(fit)), sentence, fixed = TRUE)
    expect_true(sentence %in% c(report$headline, report$remains), info = sentence)
  }
  plain <- plain_linear_fit()
  expect_null(amiss:::edge_sentence(plain))
  expect_no_match(printed(plain), "edge")
})

test_that("the table of a calibration has intervals of one number of decimals", {
  decimals <- function(lines) {
    row <- grep("base level", lines, value = TRUE)
    numbers <- regmatches(row, gregexpr("[0-9]+\\.[0-9]+", row))[[1]]
    nchar(sub(".*\\.", "", numbers))
  }
  fit <- warm_fit()
  expect_length(unique(decimals(capture.output(print(fit)))), 1)
  # The second is the standard error.
  expect_length(unique(decimals(capture.output(print(summary(fit))))[-2]), 1)
})

test_that("parameters stand under their labels, with names where code needs them", {
  m <- warm_measurements()
  fit <- warm_fit()
  runs <- simulate_design(warm(), m, 20, seed = 1)
  look <- try_run(warm(), m)
  for (x in list(fit, summary(fit), runs, look, sobol_indices(fit, seed = 1)))
    expect_match(printed(x), "base level (offset)", fixed = TRUE, info = class(x)[1])
  expect_identical(look$parameters$name, c("offset", "gain"))
  expect_match(printed(zone(volume = free("V", uniform(50, 90), "m3", label = "volume of air"))),
               "Free parameters: volume of air (V)", fixed = TRUE)
  expect_match(printed(fit), "\u00b0C", fixed = TRUE)
  expect_match(printed(fit$emulator), "beside a noise of 0.10 \u00b0C", fixed = TRUE)
})

test_that("findings name the label and the column of a condition", {
  data <- linear_data(96)
  data$Te[40] <- 700
  m <- linear_measurements(data, boundary = list(Te = condition("outdoor air", "degC"), "Gv"))
  expect_identical(m$findings$column, "Te")
  expect_match(printed(m), "outdoor air (Te) is 700 in", fixed = TRUE)
})

test_that("an attribution of several records has the labels of the conditions", {
  table <- data.frame(boundary = c("Gv", "Te"), log10_bf_dropped = c(3, 0), p_value = c(0.01, 1),
                      significant = c(TRUE, FALSE), group = NA_character_, records = c("one", ""))
  one <- structure(list(format_version = amiss:::format_version, table = table, groups = list(),
                        surrogates = 19L, control = list(), labels = c(Gv = "sun on the wall")),
                   class = "amiss_attribution")
  both <- structure(list(format_version = amiss:::format_version, records = list(one = one),
                         table = table, groups = list()),
                    class = "amiss_joint_attribution")
  expect_match(printed(both), "sun on the wall .*one: driven by sun on the wall")
})

test_that("a catalogue of a study has the labels, and says once what has two names", {
  folder <- withr::local_tempdir()
  boundary <- list(Te = list(label = "outdoor air"), Gv = list(label = "sun on the wall"))
  study <- read_study(write_study_file(folder, boundary = boundary), trust = TRUE)
  expect_match(printed(study$catalogue), "sun (sun on the wall): The sun", fixed = TRUE)
  expect_match(printed(study$catalogue[1]), "sun (sun on the wall)", fixed = TRUE)
  expect_identical(study$catalogue$sun$boundary, "Gv")
  alone <- catalogue(mechanism("sun", identity, "sun", "It shines."))
  expect_match(printed(alone), "sun: It shines", fixed = TRUE)
})

test_that("a heading without sentences is left out", {
  said <- function(told) paste(cli::cli_fmt(amiss:::say_inspections(told)), collapse = " ")
  expect_no_match(said(character()), "What to inspect next")
  expect_match(said(c(edge = "Look there.")), "What to inspect next.*Look there")
})

test_that("degrees are written as people write them", {
  expect_identical(amiss:::pretty_unit(c("degC", "deg", "W/m2", "degree")),
                   c("\u00b0C", "\u00b0", "W/m\u00b2", "degree"))
})
