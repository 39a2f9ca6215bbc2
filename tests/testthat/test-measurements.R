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
  fails(broken(hour = function(v) replace(v, 9, v[9] + 0.3)), "unequal steps")
  fails(broken(hour = function(v) replace(format(as.POSIXct("2026-01-01", tz = "UTC") + 3600 * v, "%Y-%m-%d %H:%M:%S"), 3, "noon")), "row 3 holds.*noon")
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
  expect_warning(m <- linear_measurements(data, boundary = ~ Te + Ws), "Ws.*not vary", class = "amiss_warning_input")
  expect_equal(m$conditions, "Te")
  expect_error(linear_measurements(data, boundary = ~Ws), "No boundary condition varies", class = "amiss_error_input") |> suppressWarnings()
})

test_that("a gap makes two segments, each with its own warm-up, and is told", {
  data <- linear_data()[-(100:130), ]
  expect_warning(m <- linear_measurements(data, warmup = 10), "1 gap within.*row 99", class = "amiss_warning_input")
  expect_equal(unique(m$segment), c(1, 2))
  expect_equal(sum(m$use == "warmup"), 20)
  expect_equal(which(amiss:::segment_starts(m, amiss:::used_rows(m, "calibrate"))), c(1, 90))
  expect_message(linear_measurements(data, calibrate = data$hour < 115, validate = data$hour > 115), "1 gap between",
                 class = "amiss_message_gap")
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

test_that("text times know midnight and offsets, and refuse rubbish", {
  read <- function(text) amiss:::read_time(text, "t") * 3600
  start <- as.numeric(as.POSIXct("2024-03-01", tz = "UTC"))
  expect_equal(read(c("2024-03-01", "2024-03-01 01:00:00")), start + c(0, 3600))
  expect_equal(read(c("2024-03-01T01:00+0100", "2024-03-01T02:00:00+01:00", "2024-03-01T02:30Z")), start + c(0, 3600, 9000))
  expect_error(read(c("2024-03-01 01:00:00", "2024-03-01 02:00:00 foo")), "row 2.*foo", class = "amiss_error_input")
})

test_that("an error names its function without printing the data", {
  data <- linear_data()
  error <- tryCatch(do.call(measurements, list(data[-1], "hour", "Ti", ~Te)), error = identity)
  expect_lt(max(nchar(rlang::cnd_message(error))), 500)
  expect_lt(length(deparse(conditionCall(error))), 3)
})
