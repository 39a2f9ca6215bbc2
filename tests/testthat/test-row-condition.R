condition_data <- data.frame(hour = 1:6, phase = rep(c("a", "b"), 3), y = c(-1, 2, NA, 4, 5, 6))

rows <- function(text) row_condition(text, condition_data, "calibrate")

refuse <- function(text, part)
  expect_error(rows(text), part, fixed = TRUE, class = "amiss_error_input")

test_that("a condition says of each row whether it holds", {
  data <- condition_data
  expect_equal(rows("hour <= 3 & phase == 'a'"), c(TRUE, FALSE, TRUE, FALSE, FALSE, FALSE))
  expect_equal(rows("!(hour %in% c(1, 6)) | phase %in% c('a', \"c\")"),
               c(TRUE, TRUE, TRUE, TRUE, TRUE, FALSE))
  expect_equal(rows("-hour + 2 * y / 2 - 1 != -3"), with(data, -hour + 2 * y / 2 - 1 != -3))
  expect_equal(rows("y > -1"), data$y > -1)
})

test_that("R code in a condition is refused and not run", {
  touched <- withr::local_tempfile()
  refuse(sprintf("{system('touch %s'); hour <= 3}", touched), "system(")
  refuse(sprintf("hour <= file.create('%s')", touched), "file.create(")
  refuse(sprintf("hour %%in%% c(1, file.create('%s'))", touched), "file.create(")
  refuse("(function() hour > 1)()", "function()")
  expect_false(file.exists(touched))
})

test_that("R code in a study's condition is not run", {
  folder <- withr::local_tempdir()
  touched <- file.path(folder, "x")
  study <- write_study_file(folder,
                            calibrate = sprintf("{file.create('%s'); hour <= 180}", touched))
  expect_error(read_study(study, trust = TRUE), "not allowed", class = "amiss_error_input")
  expect_false(file.exists(touched))
})

test_that("a condition is refused for any part that is none", {
  for (part in c("hour$x", "hour[1]", "base::exp(hour)", "hour <- 3", "hour && y", "~hour",
                 "c(1, 2)", "if (hour) y", "TRUE", "`!`(hour, y)", "`<`(e1 = hour, 3)")) {
    refuse(part, part)
  }
})

test_that("a condition that cannot be understood is refused, and why", {
  refuse("hours < 3", "`hours` is not a column")
  refuse("hour %in% hour", "is not c()")
  refuse("hour < ", "cannot be read")
  refuse("hour < 3; y", "not one condition")
  refuse("phase + 1 > 2", "non-numeric")
  refuse(strrep("-", 3000), "longer than 2000")
  refuse("hour", "TRUE or FALSE")
})
