# What a mechanism explains by itself: its Bayes factor with no unknown response to its conditions
# in either model.

test_that(paste("it is the factor, and what the present model loses without the response more than",
                "the extension"), {
  upgrade <- small_upgrade()
  expect_gt(length(upgrade$models), 1)
  row <-
    upgrade$candidates[upgrade$candidates$from == "base" & upgrade$candidates$mechanism == "sun", ]
  lost <- function(model) {
    table <- model$attribution$table
    table$log10_bf_dropped[table$boundary == "Gv"]
  }
  by_attribution <- row$beside_unknown + lost(upgrade$models[[1]]) - lost(upgrade$models[[2]])
  # The attribution samples the same evidences with other random numbers: a tenth of a decade each.
  expect_equal(row$log10_bf, by_attribution, tolerance = 0.4 / abs(by_attribution))
  # The sun is the cause: an unknown response to it competes, and takes most of the factor.
  expect_gt(row$log10_bf, row$beside_unknown)
})

test_that("a mechanism without conditions takes nothing away", {
  present <- list(conditions = list(sun = character()), catalogued = character(), lost = list())
  trial <- amiss:::with_taken(list(mechanism = "sun"), present, NULL)
  expect_identical(trial[c("taken", "taken_of_all")], list(taken = 0, taken_of_all = 0))
})

test_that("what numbers that are not trusted take away is not told", {
  present <- small_upgrade()$models[[1]]
  trial <- c(small_upgrade()$models[[2]], list(level = "verified", taken = 5))
  row <- amiss:::trial_row(trial, present)
  expect_equal(row$log10_bf, row$beside_unknown + 5)
  trial$fit$trust$trusted <- FALSE
  row <- amiss:::trial_row(trial, present)
  expect_equal(row$log10_bf, row$beside_unknown)
})
