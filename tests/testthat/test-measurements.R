broken <- function(...) {
  data <- linear_data()
  edits <- list(...)
  for (name in names(edits)) data[[name]] <- edits[[name]](data[[name]])
  data
}
fails <- function(data, pattern, ...) {  # errors are matched on their own words, not on the call
  expect_error(linear_measurements(data, ...), pattern, class = "amiss_error_input")
}

test_that("bad tables are refused with what, where, the value and the mend", {
  data <- linear_data()
  fails(data[setdiff(names(data), "Gv")], "Gv.*not in the data")
  fails(broken(Te = function(v) replace(v, 17, NA)), "Te.*missing.*row 17")
  fails(broken(Te = function(v) replace(as.character(v), 5, "n/a")), "Te.*not numeric.*row 5.*n/a")
  fails(broken(hour = function(v) replace(v, 9, NA)), "missing.*row 9")
  fails(broken(hour = function(v) replace(v, 9, v[8])), "duplicated.*row 9")
  fails(broken(hour = function(v) replace(v, 9, 2)), "duplicated|goes back")
  fails(broken(hour = function(v) cumsum(rep(c(0.5, 1, 1.5), 80))), "unequal steps")
  fails(broken(hour = function(v) replace(format(as.POSIXct("2026-01-01", tz = "UTC") + 3600 * v,
                                                 "%Y-%m-%d %H:%M:%S"), 3, "noon")),
        "row 3 holds.*noon")
  fails(data, "noise_sd.*positive", noise_sd = -1)
  fails(data, "needed", noise_sd = NULL)
  fails(data, "whole multiple", average = 1.5)
  fails(data, "both calibrate", calibrate = data$hour < 100, validate = data$hour > 90)
  fails(data, "cannot be evaluated", calibrate = "phase == 1")
  fails(data, "picks no row", calibrate = data$hour < 0)
  fails(data, "rows are left", warmup = 230)
})

test_that("a constant boundary condition is left out with a warning", {
  data <- linear_data()
  data$Ws <- 3
  expect_warning(m <- linear_measurements(data, boundary = ~ Te + Ws), "Ws.*not vary",
                 class = "amiss_warning_input")
  expect_equal(m$conditions, "Te")
  expect_error(linear_measurements(data, boundary = ~Ws), "No boundary condition varies",
               class = "amiss_error_input") |> suppressWarnings()
})

test_that("a gap makes two segments, each with its own warm-up, and is told", {
  data <- linear_data()[-(100:130), ]
  expect_warning(m <- linear_measurements(data, warmup = 10), "1 gap within.*row 99",
                 class = "amiss_warning_input")
  expect_equal(unique(m$segment), c(1, 2))
  expect_equal(sum(m$use == "warmup"), 20)
  expect_equal(which(amiss:::segment_starts(m, amiss:::used_rows(m, "calibrate"))), c(1, 90))
  expect_message(linear_measurements(data, calibrate = data$hour < 115, validate = data$hour > 115),
                 "1 gap between", class = "amiss_message_gap")
})

test_that("averages are means of whole blocks with their standard errors", {
  data <- linear_data()
  m <- linear_measurements(data, average = 4, noise_sd = NULL)
  expect_equal(length(m$y), 60)
  expect_equal(m$y[7], mean(data$Ti[25:28]))
  expect_equal(m$boundary[7, 1], mean(data$Te[25:28]))
  expect_equal(m$standard_error[7], stats::sd(data$Ti[25:28]) / 2)
  expect_equal(m$noise_sd, sqrt(mean(m$standard_error^2)))
})

test_that("a missing target value is left out, not refused", {
  data <- linear_data()
  data$Ti[50] <- NA
  expect_equal(length(amiss:::used_rows(linear_measurements(data), "calibrate")), 239)
})

test_that("a condition that is on or off counts as 1 and 0, in a record and in what is predicted", {
  data <- linear_data()
  data$on <- sin(data$hour) > 0
  m <- linear_measurements(data, boundary = ~ Te + on)
  expect_identical(unname(m$raw$drivers[, "on"]), as.numeric(data$on))
  data$time <- data$hour
  new <- amiss:::new_record(m, data[1:24, ])
  expect_identical(unname(new$raw$drivers[, "on"]), as.numeric(data$on)[1:24])
  data$on[5] <- NA
  expect_error(linear_measurements(data, boundary = ~ Te + on), "on", class = "amiss_error_input")
})

test_that("circular conditions enter as sine and cosine of one condition", {
  data <- linear_data()
  data$Wd <- (seq_len(nrow(data)) * 37) %% 360
  m <- linear_measurements(data, boundary = ~ Te + circular(Wd))
  expect_equal(m$condition, c(1, 2, 2))
  expect_equal(m$boundary[, 2]^2 + m$boundary[, 3]^2, rep(1, 240))
})

test_that("directions are averaged as directions", {
  data <- linear_data()
  data$Wd <- rep(c(350, 10), 120)
  data$Wd[1:4] <- c(80, 100, 80, 100)
  m <- linear_measurements(data, boundary = ~ Te + circular(Wd), average = 2)
  expect_equal(m$boundary[10, 3], cos(10 * pi / 180))
  expect_equal(m$boundary[10, 2], 0, tolerance = 1e-12)
})

test_that("target, infinite values and odd expressions are refused by name", {
  data <- linear_data()
  fails(data, "Ti.*cannot be a boundary condition", boundary = ~ Te + Ti)
  fails(broken(Ti = function(v) replace(v, 12, Inf)), "infinite.*row 12")
  fails(broken(hour = function(v) replace(v, 240, Inf)), "infinite value in row 240")
  fails(data, "calibrate", calibrate = c("hour < 10", "hour > 100"))
})

test_that("an error names its function without printing the data", {
  data <- linear_data()
  error <- tryCatch(do.call(measurements, list(data[-1], "hour", "Ti", ~Te)), error = identity)
  expect_lt(max(nchar(rlang::cnd_message(error))), 500)
  expect_lt(length(deparse(conditionCall(error))), 3)
})

test_that("the bootstrapped noise is that of the closed form", {
  data <- linear_data()
  m <- linear_measurements(data, average = 6, noise_sd = bootstrap_noise(replicates = 4000))
  windows <- matrix(data$Ti, 6)
  exact <- apply(windows, 2, stats::sd) * sqrt(5 / 6) / sqrt(6)
  # A standard deviation from B draws has a relative error of about 1 / sqrt(2 B) = 0.011; the
  # largest of 40 is within 4.
  expect_lt(max(abs(m$noise$per_step / exact - 1)), 4 * 0.011)
  expect_equal(m$noise_sd, sqrt(mean(m$noise$per_step^2)))
  expect_equal(m$noise_sd, sqrt(mean(exact^2)), tolerance = 4 * 0.011 / sqrt(40))
  expect_match(printed(m), "bootstrap of readings.*6 an average.*4000 times")
  expect_identical(linear_measurements(data, average = 6, noise_sd = "bootstrap"),
                   linear_measurements(data, average = 6, noise_sd = bootstrap_noise()))
})

test_that(
  "a trend inside the windows is noise to the plain bootstrap, and not to the detrended one", {
  set.seed(8)
  data <- data.frame(hour = 1:1200, Te = sin(1:1200 / 9),
                     Ti = 20 + 0.3 * (1:1200) + stats::rnorm(1200, 0, 0.2), Gv = stats::runif(1200))
  noise <- function(...)
    linear_measurements(data, average = 6,
                        noise_sd = bootstrap_noise(replicates = 500, ...))$noise_sd
  # 200 windows: the variance of detrended windows has 800 degrees of freedom, a relative error of
  # 2.5 % of the sd.
  expect_equal(noise(detrend = TRUE), 0.2 / sqrt(6), tolerance = 0.08)
  expect_equal(noise(), sqrt((0.3^2 * (6^2 - 1) / 12 + 0.2^2 * 5 / 6) / 6), tolerance = 0.08)
})

test_that("a noise that cannot be bootstrapped is refused", {
  data <- linear_data()
  fails(data, "not averaged", noise_sd = "bootstrap")
  fails(data, "not averaged", noise_sd = "bootstrap", average = 1)
  fails(data, "an average is of 2 readings only", noise_sd = bootstrap_noise(detrend = TRUE),
        average = 2)
  fails(broken(Ti = function(v) rep(20, 240)), "do not scatter", noise_sd = "bootstrap",
        average = 6)
  fails(data, "neither a number nor.*guess", noise_sd = "guess", average = 6)
  expect_error(bootstrap_noise(replicates = 3), "too few", class = "amiss_error_input")
  expect_equal(linear_measurements(data)$noise$method, "given")
  expect_equal(linear_measurements(data, average = 6, noise_sd = NULL)$noise$method,
               "standard error")
  missing <- linear_measurements(broken(Ti = function(v) replace(v, 9, NA)), average = 6,
                                 noise_sd = "bootstrap")
  expect_equal(which(is.na(missing$noise$per_step)), 2)
})

test_that("a study may ask for the bootstrap", {
  path <- twinhouse_study("N2")
  study <- yaml::read_yaml(path)
  study$noise_sd <- "bootstrap"
  for (field in c("data", "model", "catalogue"))
    study[[field]] <- file.path(normalizePath(dirname(path)), study[[field]])
  file <- withr::local_tempfile(fileext = ".yml")
  yaml::write_yaml(study, file)
  m <- read_study(file, trust = TRUE)$measurements
  expect_equal(m$noise$method, "bootstrap of readings")
  expect_gt(m$noise_sd, 0)
})

test_that("rows without a measurement are told, and not counted as data", {
  table <- data.frame(hour = 1:100, Ti = 20 + sin(1:100), Te = cos(1:100))
  table$Ti[c(20:24, 90)] <- NaN
  m <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1,
                    warmup = 10, validate = table$hour > 80)
  told <- paste(capture.output(print(m)), collapse = " ")
  expect_match(told, "65 calibrate, 19 validate, 10 warm up")
  expect_match(told, "6 without a measurement, left out")
})

test_that("a formula names columns, and does not compute them", {
  data <- linear_data()
  expect_error(linear_measurements(data, boundary = ~ log(Te) + Gv),
               "`log\\(Te\\)` is computed from them", class = "amiss_error_input")
  expect_error(linear_measurements(data, boundary = ~ Te * Gv), "`Te:Gv` is computed",
               class = "amiss_error_input")
  names(data)[2] <- "Te (out)"
  expect_identical(linear_measurements(data, boundary = ~ `Te (out)` + Gv)$conditions,
                   c("Te (out)", "Gv"))
})

test_that("a warm-up of less than a step, or of the whole record, is told as such", {
  expect_warning(linear_measurements(warmup = 0.5), "`warmup` is 0.5 h, shorter than a step of 1 h",
                 class = "amiss_warning_input")
  expect_no_warning(expect_error(linear_measurements(warmup = 1000), "Only 0 rows .* warm-up",
                                 class = "amiss_error_input"))
})

test_that("people read the target's label, and tables keep its column", {
  m <- linear_measurements(label = "air of the room")
  expect_output(print(m), "target air of the room, noise")
  expect_match(levels(ggplot2::autoplot(m)$data$panel)[1], "air of the room")
  fit <- linear_fit(m)
  expect_output(print(discrepancy(fit)), "Discrepancy of air of the room")
  expect_true("Ti" %in% names(generics::augment(fit)))
  expect_match(response_mechanism("Gv", m)$sentence, "a response of air of the room to Gv")
  for (wrong in list("", 1, NA_character_, c("a", "b")))
    expect_error(linear_measurements(label = wrong), "label", class = "amiss_error_input")
  plain <- linear_measurements()
  expect_null(plain$label)
  expect_output(print(plain), "target Ti, noise")
})
