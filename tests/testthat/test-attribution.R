# A record that responds to `driver`, among fifteen conditions of which all but Te and Gv are named
# X.
fifteen <- function(strength) withr::with_seed(4, {
  data <- linear_data()
  hour <- data$hour
  for (k in 1:13) {
    walk <- as.numeric(stats::filter(rnorm(240), 0.9, "recursive"))
    data[[sprintf("X%02d", k)]] <- walk + sin(2 * pi * hour / (20 + k))
  }
  data$Ti <- data$Ti + strength * lagged(data$X05, 4)
  linear_measurements(data, boundary = setdiff(names(data), c("hour", "Ti")))
})

# A record that responds to Tn, and Tc, which is correlated with it.
twins <- function(r, strength) withr::with_seed(6, {
  data <- linear_data()
  walk <- function() as.numeric(stats::filter(rnorm(240), 0.9, "recursive"))
  data$Tn <- walk()
  other <- stats::lm.fit(cbind(1, data$Tn), walk())$residuals
  data$Tc <- r * data$Tn + sqrt(1 - r^2) * sd(data$Tn) / sd(other) * other
  data$Ti <- data$Ti + strength * lagged(data$Tn, 3)
  linear_measurements(data, boundary = c("Te", "Gv", "Tn", "Tc"))
})

test_that("a planted effect is found in the right condition, and none where there is none", {
  data <- linear_data()
  lagged <- as.numeric(stats::filter(data$Gv / 300, 0.8, "recursive")) * 0.2
  data$Ti <- data$Ti + lagged
  found <- attribute_discrepancy(linear_fit(linear_measurements(data)), list(surrogates = 99),
                                 seed = 1)
  expect_equal(found$table$boundary[1], "Gv")
  expect_true(found$table$significant[1])
  expect_gt(found$table$log10_bf_dropped[1], 2)
  expect_true(all(is.na(found$table$group)))
  none <- attribute_discrepancy(plain_linear_fit(), list(surrogates = 99), seed = 1)
  expect_false(any(none$table$significant))
  expect_length(none$groups, 0)
  expect_match(printed(none), "no boundary condition is significant")
})

test_that("one true condition among fifteen is found, and it alone", {
  found <- attribute_discrepancy(linear_fit(fifteen(0.1)), list(surrogates = 39), seed = 1)
  # The step-down method's least p-value does not grow with the number of conditions: Holm's would
  # be 15 / 40.
  expect_identical(significant_conditions(found$table), "X05")
  expect_equal(found$table$p_value[1], 1 / 40)
  expect_setequal(found$table$boundary, fifteen(0.1)$conditions)
})

test_that("among fifteen conditions none is significant if nothing is hidden", {
  none <- attribute_discrepancy(linear_fit(fifteen(0)), list(surrogates = 99), seed = 1)
  expect_length(significant_conditions(none$table), 0)
})

test_that("a copy of the true driver does not hide it: both are named as one", {
  for (seed in 1:2) {
    found <- attribute_discrepancy(linear_fit(twins(1, 0.05), seed = seed), list(surrogates = 99),
                                   seed = 1)
    expect_identical(significant_conditions(found$table), "Tn or Tc")
  }
  expect_length(found$groups, 1)
  group <- found$groups[[1]]
  expect_identical(group$conditions, c("Tn", "Tc"))
  expect_gt(group$log10_bf_dropped, 5)
  expect_equal(group$correlation, 1)
  members <- found$table$boundary %in% c("Tn", "Tc")
  expect_identical(found$table$group, ifelse(members, "Tn or Tc", NA))
  expect_identical(found$table$significant, members)
  expect_equal(found$table$log10_bf_dropped[members], rep(group$log10_bf_dropped, 2))
  expect_match(printed(found), "driven by Tn or Tc")
  expect_match(printed(found),
               paste("In this record Tn and Tc cannot be distinguished .the discrepancy can do",
                     "without either one, but not without both.: measure while the two differ"))
})

test_that("nearly a copy is named with the driver, and what differs enough is distinguished", {
  near <- attribute_discrepancy(linear_fit(twins(0.999, 0.1)), list(surrogates = 99), seed = 1)
  expect_identical(significant_conditions(near$table), "Tn or Tc")
  expect_match(amiss:::group_words(near), "Tn and Tc cannot be distinguished")
  # At 0.95 the record may distinguish them; if so, the true one is named. "Nothing" is wrong in
  # either case.
  for (strength in c(0.02, 0.1)) {
    apart <- attribute_discrepancy(linear_fit(twins(0.95, strength)), list(surrogates = 99),
                                   seed = 1)
    expect_true(significant_conditions(apart$table) %in% c("Tn", "Tn or Tc"))
  }
  expect_length(amiss:::group_words(apart), sum(!is.na(apart$table$group)) / 2)
})

test_that("shares are plain shares of the variance where conditions do not overlap, and add up", {
  data <- linear_data()
  data$Ti <- data$Ti + 0.004 * data$Gv
  fit <- linear_fit(linear_measurements(data))
  table <- attribute_discrepancy(fit, list(surrogates = 19), seed = 1)$table
  # The simulator's own directions are nearly free beside a noise of 0.1: all but the noise, over
  # what is measured outside them.
  outside <- function(v) stats::lm.fit(fit$emulator$basis$vectors, v)$residuals
  noise <- data$Ti - 20 - 0.4 * data$Te - 0.004 * data$Gv
  explained <- 1 - sum(outside(noise)^2) / sum(outside(data$Ti)^2)
  expect_equal(sum(table$share), explained, tolerance = 0.05)
  expect_gt(table$share[table$boundary == "Gv"], 0.95 * sum(table$share))
  expect_true(all(table$share >= 0))
})

test_that("decisive evidence counts whatever the p-value, weak evidence with a low one", {
  found <- attribute_discrepancy(plain_linear_fit(), list(surrogates = 19, decisive = -10,
                                                         least_log10_bf = -10))$table
  expect_true(all(found$significant))
  expect_gt(max(found$p_value), 0.05)
  expect_error(attribute_discrepancy(plain_linear_fit(), list(decisive = 0.4)),
               "decisive.*0\\.4.*0\\.5", class = "amiss_error_input")
  counts <- function(evidence, p)
    amiss:::is_significant(evidence, p, amiss:::attribution_control)
  expect_true(counts(2, 1))
  expect_true(counts(0.5, 0.05))
  expect_false(counts(1.9, 0.06))
  expect_false(counts(0.4, 0.01))
})

test_that("two threads give the bits of one", {
  fit <- plain_linear_fit()
  expect_identical(attribute_discrepancy(fit, list(surrogates = 19), seed = 1, threads = 2)$table,
                   attribute_discrepancy(fit, list(surrogates = 19), seed = 1, threads = 1)$table)
})

test_that("one boundary condition is enough", {
  fit <- linear_fit(linear_measurements(boundary = ~Te))
  expect_equal(attribute_discrepancy(fit, list(surrogates = 19), seed = 1)$table$boundary, "Te")
  expect_error(attribute_discrepancy(fit, list(level = 5)), "level", class = "amiss_error_input")
})

test_that("evidence lost is the posterior over the prior odds of a condition that does not act", {
  data <- linear_data()
  # too weak to be certain: a part of the draws leaves it out
  data$Ti <- data$Ti + 0.00031 * data$Gv
  fit <- linear_fit(linear_measurements(data))
  table <- attribute_discrepancy(fit, list(surrogates = 19), seed = 1)$table
  off <- colSums(fit$weights * (fit$posterior$t == 0))
  expect_true(all(off > 0.02 & off < 0.99))
  expect_equal(table$log10_bf_dropped[match(c("Te", "Gv"), table$boundary)],
               log10(1 - 0.2) - log10(off), tolerance = 1e-8)
  # Sampled again without the condition: the same within four standard errors of both.
  again <- attribute_discrepancy(fit, list(surrogates = 19,
                                           ais = list(precision = 0.01, max_groups = 4)),
                                 seed = 1)$table
  again <- again[match(table$boundary, again$boundary), ]
  expect_true(all(again$log10_bf_dropped != table$log10_bf_dropped))
  error <- sqrt(again$standard_error^2 + table$standard_error^2)
  expect_true(all(abs(again$log10_bf_dropped - table$log10_bf_dropped) < 4 * error))
  expect_gt(diff(range(table$log10_bf_dropped)), 0.1)  # the two conditions do differ
})

test_that("without a seed an attribution takes that of the calibration, and says the same again", {
  fit <- plain_linear_fit()
  few <- list(surrogates = 9)
  found <- attribute_discrepancy(fit, few)
  expect_identical(found, attribute_discrepancy(fit, few))
  expect_identical(found, attribute_discrepancy(fit, few, seed = fit$seed))
  expect_false(attribute_discrepancy(fit, few, seed = NULL)$seed == fit$seed)
})
