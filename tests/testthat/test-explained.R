# What a mechanism explains by itself: its Bayes factor with no unknown response to its conditions in either model.

test_that("it is the factor, and what the present model loses without the response more than the extension", {
  upgrade <- small_upgrade()
  expect_gt(length(upgrade$models), 1)
  row <- upgrade$candidates[upgrade$candidates$from == "base" & upgrade$candidates$mechanism == "sun", ]
  lost <- function(model) {
    table <- model$attribution$table
    table$log10_bf_dropped[table$boundary == "Gv"]
  }
  by_attribution <- row$log10_bf + lost(upgrade$models[[1]]) - lost(upgrade$models[[2]])
  # The attribution samples the same evidences with other random numbers: a tenth of a decade each.
  expect_equal(row$explained, by_attribution, tolerance = 0.4 / abs(by_attribution))
  # The sun is the cause: an unknown response to it competes, and takes most of the factor.
  expect_gt(row$explained, row$log10_bf)
})

test_that("it is not known of a mechanism without conditions, or whose numbers are not trusted", {
  upgrade <- small_upgrade()
  trial <- function(trusted) list(mechanism = "sun", fit = list(trust = list(trusted = trusted)))
  expect_false(amiss:::is_explanation(trial(TRUE), character()))
  expect_false(amiss:::is_explanation(trial(FALSE), "Gv"))
  expect_false(amiss:::is_explanation(list(mechanism = "sun"), "Gv"))
  none <- amiss:::explained_factors(list(sun = trial(FALSE)), NULL, upgrade$catalogue, NULL)
  expect_identical(none, c(sun = NA_real_))
  expect_length(amiss:::explained_factors(list(), NULL, upgrade$catalogue, NULL), 0)
})
