# The bits of 64-bit integers in doubles, as package bit64 keeps them.
integer64 <- function(x) {
  x <- as.vector(x)
  halves <- rbind(x %% 2^32, floor(x / 2^32))
  halves <- ifelse(halves >= 2^31, halves - 2^32, halves)
  # -2^31 are the bits of NA
  bits <- writeBin(suppressWarnings(as.integer(halves)), raw(), endian = "little")
  structure(readBin(bits, "double", length(x), endian = "little"), class = "integer64")
}
numbers <- c(0, 1, -1, 2^31 - 1, 2^31, -2^31, 2^32 + 5, 3e9, -3e9, 2^53, -2^53)

test_that("64-bit integers become numbers", {
  expect_identical(plain_numbers(integer64(numbers)), numbers)
  expect_identical(plain_numbers(integer64(c(1, -2^63))), c(1, NA))
  expect_identical(plain_numbers(structure(integer64(1:4), dim = c(2, 2))),
                   matrix(c(1, 2, 3, 4), 2))
  table <- data.frame(a = 1:2, b = 1:2)
  table$b <- integer64(c(3e9, 4e9))
  expect_identical(plain_numbers(table), data.frame(a = 1:2, b = c(3e9, 4e9)))
  skip_if_not_installed("bit64")
  expect_identical(plain_numbers(bit64::as.integer64(numbers)), numbers)
})

test_that("64-bit integers are read in a record, a design and runs", {
  data <- linear_data()
  data[c("hour", "Te", "Gv", "Ti")] <- lapply(data[c("hour", "Te", "Gv", "Ti")], round)
  long <- data
  long[] <- lapply(long, function(x) if (is.numeric(x)) integer64(x) else x)
  m <- linear_measurements(data)
  expect_identical(linear_measurements(long), m)
  rows <- length(amiss:::used_rows(m, "calibrate"))
  design <- data.frame(a = as.numeric(1:8), b = c(3, 1, 4, 1, 5, 9, 2, 6))
  runs <- outer(seq_len(rows), 1:8)
  made <- ensemble(design, runs, measurements = m)
  design$a <- integer64(1:8)
  expect_identical(ensemble(design, structure(integer64(runs), dim = dim(runs)), measurements = m),
                   made)
  simulator <- function_simulator(
    function(values, drivers) integer64(round(values[["g"]] * drivers[, "Te"])),
    free("g", uniform(1, 5)), boundary = "Te")
  expect_identical(simulate_runs(simulator, cbind(g = 2), cbind(Te = c(4, -6)), step_h = 1),
                   cbind(c(8, -12)))
})
