# The figure of parameters whose posterior has several modes.

# Draws of `a` about -1 (a quarter of the posterior) and 1, of `b` about 0.
two_modes <- function(modes = NULL) {
  withr::with_seed(1, {
    a <- c(rnorm(100, -1, 0.1), rnorm(300, 1, 0.1))
    b <- rnorm(400)
  })
  fit <- list(values = cbind(a, b), weights = rep(1 / 400, 400), modes = modes,
              parameters = list(a = free("a", uniform(-2, 2), "m", "first"),
                                b = free("b", uniform(-9, 9))))
  structure(fit, class = c("amiss_calibration", "amiss_fit"))
}

searched <- list(agree = TRUE, searches = 3, lost = 0, heights = c(-10, -11.1, -10.01),
                 points = cbind(a = c(1, -1, 1.001), b = 0))

test_that("modes, their shares and where searches ended are drawn", {
  figure <- amiss:::figure_modes(two_modes(searched))
  expect_identical(figure$labels$title,
                   "The posterior of first has 2 modes, with shares of 25 % and 75 %")
  # The area under each curve is the share of its mode.
  area <- vapply(split(figure$data, figure$data$mode),
                 function(curve) sum(curve$y) * diff(curve$x[1:2]), 0)
  expect_equal(unname(area), c(0.25, 0.75), tolerance = 0.01)
  ends <- amiss:::search_ends(two_modes(searched), "a", figure$data$x)
  expect_identical(ends$label, c("highest", "1.1 lower"))
  expect_equal(ends$x, c(1, -1))
  expect_error(ggplot2::ggplot_build(figure), NA)
})

test_that("without searches, or with those of an older object, the modes are drawn alone", {
  for (modes in list(NULL, list(agree = TRUE, searches = 2, ends = 1:2, lost = 0))) {
    figure <- amiss:::figure_modes(two_modes(modes))
    expect_no_match(figure$labels$subtitle, "Triangles")
    expect_error(ggplot2::ggplot_build(figure), NA)
  }
})

test_that("one mode is told in the title, with the searches that ended there", {
  told <- function(...) amiss:::one_mode_title(list(lost = 0, ...))
  expect_identical(told(agree = TRUE, searches = 2), "One mode: 2 searches ended there")
  expect_identical(told(agree = TRUE, searches = 3), "One mode: 2 of 3 searches ended there")
  expect_match(told(agree = FALSE, searches = 3), "no two of 3 searches")
  expect_match(told(agree = FALSE, searches = 1), "only one search")
  expect_match(amiss:::one_mode_title(list(agree = TRUE, searches = 2, lost = 1)), "1 more")
  expect_match(amiss:::one_mode_title(NULL), "^One mode")
})

test_that("searches are remembered with their height and place", {
  m <- measured_run(squared_simulator(), c(a = 0.6))
  found <- amiss:::find_modes(searched_model(squared_simulator(), m), search_context())
  told <- amiss:::told_modes(found)
  expect_length(told$heights, told$searches)
  expect_equal(abs(told$points[, "a"]), rep(0.6, told$searches), tolerance = 0.01)
  expect_false(is.unsorted(-told$heights))
})
