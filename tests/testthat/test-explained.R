# What a mechanism explains by itself: its Bayes factor with no unknown response to its conditions
# in either model.

test_that(paste("it is the factor, and what the present model loses without the response more than",
                "the extension"), {
  upgrade <- small_upgrade()
  expect_gt(length(upgrade$models), 1)
  row <-
    upgrade$candidates[upgrade$candidates$from == "base" & upgrade$candidates$mechanism == "sun", ]
  lost <- function(model) {
    finer <- list(surrogates = 19, ais = list(pilot_chains = 128, groups = 8, max_groups = 16))
    table <- attribute_discrepancy(model$fit, finer, seed = 2)$table
    table$log10_bf_dropped[table$boundary == "Gv"]
  }
  by_attribution <- row$beside_unknown + lost(upgrade$models[[1]]) - lost(upgrade$models[[2]])
  # The attribution samples the same evidences with other random numbers: a tenth of a decade each.
  expect_equal(row$log10_bf, by_attribution, tolerance = 0.4 / abs(by_attribution))
  # The sun is the cause: an unknown response to it competes, and takes most of the factor.
  expect_gt(row$log10_bf, row$beside_unknown)
})

test_that("what the attribution knows of the present model is not sampled again", {
  asked <- NULL
  stand_in(lost_without = function(model, conditions, context) {
    asked <<- c(asked, list(conditions))
    -1
  })
  upgrade <- small_upgrade()
  attribution <- upgrade$models[[1]]$attribution
  catalogue <- c(upgrade$catalogue["sun"], list(both = list(boundary = c("Te", "Gv"))))
  model <- amiss:::with_losses(list(), catalogue, attribution$lost, NULL)
  table <- attribution$table
  expect_equal(model$lost[["Gv"]], table$log10_bf_dropped[table$boundary == "Gv"])
  expect_equal(asked, list(c("Gv", "Te")))
  expect_equal(model$lost[["Gv, Te"]], -1)
  # In an order that workers in another locale share.
  expect_identical(amiss:::condition_set(c("gain", "Te")), "Te, gain")
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
  # That searches do not agree says nothing of the evidence of the mode that was found.
  lost <- trial
  lost$fit$trust$trusted <- FALSE
  expect_equal(amiss:::trial_row(lost, present)$log10_bf, row$log10_bf)
  trial$fit$check$passed <- FALSE
  row <- amiss:::trial_row(trial, present)
  expect_equal(row$log10_bf, row$beside_unknown)
})

test_that("what each mechanism leaves is of its own conditions, and before it of each by itself", {
  attribution <- list(table = data.frame(boundary = c("Gv", "Te"), log10_bf_dropped = c(6, 1)))
  present <- list(name = "base", conditions = list(sun = "Gv", mass = c("Gv", "Te"), drift = NULL),
                  lost = list(Gv = 5.9, "Gv, Te" = 8))
  trial <- function(mechanism, taken, trusted = TRUE)
    list(mechanism = mechanism, taken = taken, fit = list(trust = list(trusted = trusted)))
  trials <- list(trial("sun", 5.5), trial("mass", 2), trial("drift", 0),
                 trial("mass", 1, trusted = FALSE), list(mechanism = "silent"))
  table <- amiss:::response_table(trials, present, attribution)
  expect_equal(table$mechanism, c("no change", "no change", "sun", "mass", "mass"))
  expect_equal(table$condition, c("Gv", "Te", "Gv", "Gv", "Te"))
  expect_equal(table$before, c(6, 1, 5.9, 8, 8))
  expect_equal(table$left, c(6, 1, 0.4, 6, 6))
  expect_true(all(table$from == "base"))
})

test_that("a loop keeps them for each step, and the figure says how much the cause explains", {
  upgrade <- small_upgrade()
  sun <- upgrade$responses[upgrade$responses$mechanism == "sun", ]
  row <- upgrade$candidates[upgrade$candidates$mechanism == "sun", ]
  expect_equal(sun$before - sun$left, (row$log10_bf - row$beside_unknown)[1])
  expect_match(ggplot2::autoplot(upgrade, "explained")$labels$title,
               "With sun, the evidence for a response to Gv falls")
})
