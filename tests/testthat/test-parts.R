# What acts in one part of a record alone.
quiet_error <- function(n = 400) withr::with_seed(2, stats::rnorm(n, 0, 0.1))

test_that("the moment at which changes of the error grow or shrink is found, and no other", {
  found <- function(r, hours = seq_along(r)) amiss:::changed_size(r, hours, 1)
  r <- quiet_error()
  expect_null(found(r))
  late <- replace(r, 301:400, 5 * r[301:400])
  began <- found(late)
  expect_lt(abs(began$row - 301), 5)
  # Changes of white noise have the standard deviation sqrt(2) 0.1, and five times that.
  expect_equal(began$before, 0.141, tolerance = 0.15)
  expect_equal(began$after, 0.707, tolerance = 0.15)
  ended <- found(rev(late))
  expect_lt(abs(ended$row - 101), 5)
  expect_gt(ended$before, ended$after)
  # An effect of each day, a drift and a jump between two segments are no such thing.
  expect_null(found(r + 2 * sin(2 * pi * seq_along(r) / 24) + seq_along(r) / 40))
  day <- seq_along(r) %% 24 %in% 8:16
  expect_null(found(replace(r, day, 5 * r[day])))
  expect_null(found(r + 50 * (seq_along(r) > 200), c(1:200, 301:500)))
  # Neither are a few readings at an end, one that is far off, nor a record without change.
  expect_null(found(replace(r, 390:400, 8 * r[390:400])))
  expect_null(found(replace(r, 30, 3)))
  expect_null(found(replace(r, 200, 60)))
  expect_null(found(numeric(400)))
  expect_null(found(rep(NA_real_, 400)))
  expect_null(found(r[1:2]))
  # Nor is white noise, of a short record either: none of 200.
  noise <- function(seed, n) withr::with_seed(seed, stats::rnorm(n))
  alarms <- vapply(1:200, function(seed) !is.null(found(noise(seed, 30 + seed))), NA)
  expect_equal(sum(alarms), 0)
  # A part may begin after a gap, or after nothing was left.
  gap <- c(1:300, 1301:1400)
  expect_identical(gap[found(late, gap)$row] > 1300, TRUE)
  expect_lt(abs(found(c(numeric(200), r[1:200]))$row - 201), 3)
})

test_that("people are asked what began or ended then, in their own time and unit", {
  upgrade <- small_upgrade()
  said <- function(times) {
    p <- upgrade$models[[2]]$prediction
    late <- seq_len(nrow(p)) > 0.6 * nrow(p)
    upgrade$models[[2]]$prediction$observed <-
      p$observed + times * late * withr::with_seed(3, stats::rnorm(nrow(p), 0, 0.1))
    unname(upgrade_inspections(upgrade)["parts"])
  }
  expect_true(is.na(said(0)))
  expect_match(said(8), "^Ask what began at 2024-03-0[0-9 :]*: from one reading to the next the ")
  expect_match(said(8), "changes by 0\\.[0-9]+ K before, and by 1\\.[0-9]* K after\\. What acts in")
  table <- upgrade$models[[2]]$attribution$table
  upgrade$models[[2]]$attribution$table$significant <- table$boundary == "Te"
  expect_match(said(8), "after\\. It may be Te, to which the error responds")
})
