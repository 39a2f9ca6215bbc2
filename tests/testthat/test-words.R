test_that("units have their powers, and other digits stay", {
  expect_equal(amiss:::pretty_unit(c("W/m2K", "Km2/W", "m3/s", "m/s2", "kWh/m3", "m0.5", "m2.5",
                                     "CO2", "K", "")),
               c("W/m\u00b2K", "Km\u00b2/W", "m\u00b3/s", "m/s\u00b2", "kWh/m\u00b3", "m0.5",
                 "m2.5", "CO2", "K", ""))
  expect_equal(amiss:::with_unit(c("1", "2"), "m2"), c("1 m\u00b2", "2 m\u00b2"))
  expect_equal(amiss:::with_unit(c("1", "2"), ""), c("1", "2"))
  expect_equal(amiss:::with_unit(c("1", "2"), c("", "K")), c("1", "2 K"))
  expect_equal(amiss:::change_words(1, 2, ""), "rises from 1.0 to 2.0")
})

test_that("a name has the article of its sound", {
  expect_identical(amiss:::with_article(c("window", "Opening", "uniform share", "unknown leak",
                                          "one-way flow", "hour")),
                   c("a window", "an Opening", "a uniform share", "an unknown leak",
                     "a one-way flow", "an hour"))
})

test_that("sentences begin with a capital, names of code stay", {
  expect_identical(amiss:::capital(c("heater lag fits", "x2 moves", "Te", "a", "k_out moves")),
                   c("Heater lag fits", "x2 moves", "Te", "a", "k_out moves"))
})

test_that("the ends of an interval are distinguished", {
  expect_equal(amiss:::interval_words(c(0.351, 1), c(0.353, 2)), c("0.351 to 0.353", "1.0 to 2.0"))
  expect_equal(amiss:::interval_words(3, 3), "3.0 to 3.0")
  expect_equal(amiss:::interval_words(1, 2, between = " and "), "1.0 and 2.0")
})

test_that("what rounds to zero has no sign, and a clock no sixtieth minute", {
  expect_equal(amiss:::signed(c(-0.01, 0.04, -0.06, 12.3)), c("0.0", "0.0", "-0.1", "+12"))
  expect_equal(amiss:::clock_words(c(0, 7.5, 10.9999, 23.25)),
               c("00:00", "07:30", "11:00", "23:15"))
})

test_that("odds up to a million are told in figures", {
  expect_equal(amiss:::power_of_ten(c(1, 4.6, 5.9, 6.2)), c("10", "40,000", "790,000", "10^6"))
})

test_that("a gain within its standard error is no clear one", {
  said <- function(mean, error) amiss:::gain_words(list(mean = mean, standard_error = error))
  expect_identical(said(0.5, 1), "no clear gain")
  expect_identical(said(3, 1), "a gain of 3.0 standard errors")
  expect_identical(said(0.5, 0), "a gain")
})
