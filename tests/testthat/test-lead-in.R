# Drivers ahead of the first measured value of a segment.
skip_on_os("windows")

# A program that echoes what it is given, and notes each run's rows.
echo <- function(..., frame = parent.frame()) {
  program_simulator(
    c("sh", "-c",
      "cp drivers.csv $0; awk -F, 'NR == 1 { print \"Ti\" } NR > 1 { print {{a}} * $3 }' $0",
      seen_drivers),
    free("a", uniform(0, 2)), boundary = "Te", output = c(file = "stdout.txt", column = "Ti"),
    cache = withr::local_tempdir(.local_envir = frame), ...)
}

seen_drivers <- tempfile("seen")
withr::defer(unlink(seen_drivers), teardown_env())

# Two segments of two days by hours, ten hours apart, Te the hour of the record.
led_record <- function(lost = 0) {
  hour <- c(1:48, 59:106)
  data <- data.frame(hour = hour, Te = hour,
                     Ti = ifelse(seq_along(hour) <= lost, NA, hour + 0.1 * cos(1.7 * hour)))
  suppressMessages(suppressWarnings(measurements(data, time = "hour", target = "Ti", boundary = ~Te,
                                                 noise_sd = 0.1)))
}

# What the program was given for its last segment, and the runs.
given <- function(m, ...) {
  y <- simulate_measured(echo(...), cbind(a = 1), m, "calibrate", 1)
  list(y = y[, 1], drivers = utils::read.csv(seen_drivers))
}

test_that("the record's own rows come ahead of a segment, and the first day where it has none", {
  m <- led_record()
  rlang::reset_message_verbosity("amiss lead 2 59 20 10")
  expect_message(out <- given(m, lead_in = 20),
                 "no drivers for 10 of the 20 h ahead of its segment 2 \\(59\\).*repeated",
                 class = "amiss_message_lead")
  # Hours 39 to 48 are there; 49 to 58 are those of a day later.
  expect_equal(out$drivers$Te, c(39:48, 73:82, 59:106))
  expect_equal(out$drivers$time, 39:106)
  expect_equal(out$y, c(1:48, 59:106))  # the lead-in is left out
})

test_that("the first day alone, or the record alone, is taken if that is asked for", {
  m <- led_record()
  out <- suppressMessages(given(m, lead_in = 30, before = "first_day"))
  expect_equal(out$drivers$Te, c(77:82, 59:82, 59:106))
  out <- given(m, lead_in = 20, before = "record_only")
  expect_equal(out$drivers$Te, 59:106)  # the gap cuts it off
  expect_equal(out$y, c(1:48, 59:106))
  expect_error(echo(lead_in = 1, before = "nothing"), "before", class = "amiss_error_input")
  expect_error(echo(lead_in = -1), "lead_in", class = "amiss_error_input")
})

test_that("rows without a target ahead of the record count as its lead-in", {
  m <- led_record(lost = 24)
  program <- echo(lead_in = 24)
  raw <- m$raw
  first <- which(raw$segment == 1)
  expect_identical(segment_drivers(program, raw, first, "Te")$lead, 0)
  expect_identical(suppressMessages(segment_drivers(echo(lead_in = 30), raw, first, "Te"))$lead, 6)
  expect_identical(segment_drivers(rename_parameters(program, a = "b"), raw, first, "Te")$lead, 0)
  expect_identical(segment_drivers(linear_simulator(), raw, first, "Te")$lead, 0)
})

test_that(
  "a message says once that the first day is repeated, and the times are those of the record", {
  data <- small_record(48)
  m <- measurements(data, time = "time", target = "Ti", boundary = ~Te, noise_sd = 0.05)
  out <- suppressMessages(given(m, lead_in = 6))
  expect_no_message(given(m, lead_in = 6))
  expect_identical(out$drivers$time[1], "2024-02-29T19:00:00Z")
  expect_equal(out$drivers$Te, c(data$Te[19:24], data$Te), tolerance = 1e-10)
})
