# What trials are worth, by models made by hand.

skip_on_cran()  # second tier: tools/test --quick

# `error`: the simulation's, and that of its only run; `level`: what its runs have shown.
model_by_hand <- function(log10_evidence, se = 0.05, level = "verified", passed = TRUE,
                          effective = 1, ratio = 0.1, error = 0.95, name = "a") {
  check <- list(mean = 1:3 - error, passed = passed, effective = effective, ratio = ratio)
  fit <- structure(list(measurements = list(y = 1:3), rows = 1:3, check = check,
                        log_evidence = log10_evidence * log(10), standard_error = se * log(10),
                        posterior = list(annealed = c(log10_evidence * log(10), se * log(10)),
                                         second = c(log10_evidence * log(10), se * log(10)))),
                   class = c("amiss_calibration", "amiss_fit"))
  list(name = paste("base +", name), mechanism = name, fit = fit, level = level, target = 1:3,
       noise = rep(1, 3), runs = list(outputs = cbind(1:3 - error)))
}

tried_by_hand <- function(log10_evidence, ...) model_by_hand(log10_evidence, level = "tried", ...)

test_that("a trial's evidence may be off by what its runs leave open, a verified one's is not", {
  present <- model_by_hand(0, se = 0, error = 1)
  bound <- function(model, leader = present)
    amiss:::log10_factor(model, present) + amiss:::doubt_of(model, present, leader)
  expect_equal(bound(model_by_hand(3, se = 0.1)), 3 + 3 * 0.1)
  expect_equal(bound(tried_by_hand(3, se = 0)), 3 + rules$trial_margin)
  expect_equal(bound(tried_by_hand(3, se = 0.2, effective = 0.5)), 3 + 3 * 0.2 + rules$trial_margin)
  refuted <- tried_by_hand(3, se = 0, passed = FALSE, ratio = 2)
  expect_equal(bound(refuted), 3 + rules$trial_doubt * 3)
  # A run has half the error: what refutes the emulator cannot rule that out.
  promising <- tried_by_hand(-40, se = 0, passed = FALSE, ratio = 2, error = 0.5)
  expect_equal(bound(promising), Inf)
  # Nor can a check that has passed, but leaves its evidence open.
  expect_equal(bound(tried_by_hand(-40, se = 3, effective = 0.3, error = 0.5)), Inf)
  expect_lt(bound(tried_by_hand(-40, se = 1, effective = 0.3, error = 0.5)), 0)
  # A leader that is as near to the record can.
  expect_lt(bound(promising, leader = model_by_hand(8, error = 0.5)), -20)
  unchecked <- tried_by_hand(3, se = 0)
  unchecked$fit$check <- NULL
  expect_equal(bound(unchecked), 3 + rules$trial_doubt * 2)
})

test_that("of trials that can still win the nearest, then that of highest evidence is verified", {
  present <- model_by_hand(0, se = 0, error = 1)
  context <- amiss:::new_context(1, 1, list(decisive = 2))
  following <- function(...) {
    trials <- list(...)
    names(trials) <- vapply(trials, `[[`, "", "mechanism")
    amiss:::next_to_verify(trials, present, context)
  }
  expect_equal(following(tried_by_hand(5, name = "a"), tried_by_hand(6, name = "b")), "b")
  near <- tried_by_hand(5, name = "a", error = 0.9)
  expect_equal(following(near, tried_by_hand(6, name = "b")), "a")
  expect_equal(following(tried_by_hand(5, name = "a", error = 0.995),
                         tried_by_hand(6, name = "b")), "b")
  # One that is in doubt may still lead.
  doubtful <- tried_by_hand(5, name = "a", passed = FALSE)
  expect_equal(following(doubtful, tried_by_hand(6, name = "b")), "b")
  expect_equal(following(doubtful, model_by_hand(6, name = "b")), "a")
  expect_null(following(doubtful, model_by_hand(7.5, name = "b")))
  # None of these is decisive.
  expect_null(following(tried_by_hand(1, name = "a"), tried_by_hand(-4, name = "b")))
  expect_equal(following(tried_by_hand(1.6, name = "a")), "a")
  expect_null(following(tried_by_hand(5, name = "a"), model_by_hand(8, name = "b")))
  expect_equal(following(tried_by_hand(7.6, name = "a"), model_by_hand(8, name = "b")), "a")
  # Mechanisms rank by what they explain with no unknown response at all.
  ranked <- function(model, taken, taken_of_all) c(model, list(taken = taken,
                                                               taken_of_all = taken_of_all))
  mass <- ranked(model_by_hand(0, name = "mass"), 8, 8)
  expect_equal(following(ranked(tried_by_hand(1, name = "leak"), 3, 9), mass), "leak")
  expect_null(following(ranked(tried_by_hand(1, name = "leak"), 3, 5), mass))
  # One that is not decisive by itself is not adopted, wherever it ranks.
  expect_null(following(ranked(tried_by_hand(-1, name = "leak"), 1, 9), mass))
  # A leader with which the simulation's own error rises stands in nobody's way.
  raising <- model_by_hand(8, name = "b", error = 1.5)
  expect_equal(following(tried_by_hand(5, name = "a"), raising), "a")
  expect_null(following(list(mechanism = "a", level = "silent"),
                        list(mechanism = "b", level = "failed")))
})

test_that("what a mechanism must reach is what another surely has that may be adopted", {
  present <- model_by_hand(0, se = 0, error = 1)
  context <- amiss:::new_context(1, 1, list(decisive = 2))
  bar <- function(model, trusted = TRUE) {
    model$fit$trust <- list(trusted = trusted)
    amiss:::bar_of(list(model), present, context)$standing
  }
  expect_equal(bar(model_by_hand(5, se = 0)), 5)
  expect_equal(bar(tried_by_hand(5, se = 0)), 5 - rules$trial_margin)
  expect_equal(bar(model_by_hand(5, se = 0), trusted = FALSE), -Inf)
  expect_equal(bar(model_by_hand(1, se = 0)), -Inf)  # not decisive
  expect_equal(bar(model_by_hand(5, se = 0, error = 1.5)), -Inf)  # the error rises
})

test_that("a trial that its runs refute goes on if it is nearer to the record than the leader", {
  present <- model_by_hand(0, se = 0, error = 1)
  context <- amiss:::new_context(1, 1, list(decisive = 2))
  leader <- tried_by_hand(9, se = 0, error = 0.4)
  leader$fit$trust <- list(trusted = TRUE)
  could_win <- function(error, trials) {
    refuted <- tried_by_hand(-40, se = 0, passed = FALSE, error = error)
    amiss:::could_win(refuted, present, amiss:::bar_of(trials, present, context))
  }
  expect_true(could_win(0.6, list()))
  expect_false(could_win(0.6, list(leader)))
  expect_true(could_win(0.3, list(leader)))
})

test_that("a trial goes on while its runs leave open whether it can win", {
  present <- model_by_hand(0, se = 0, error = 1)
  clear <- function(..., bar = 2) {
    reach <- list(factor = bar, standing = -Inf, leader = present)
    amiss:::is_clear(tried_by_hand(...), present, reach)
  }
  expect_true(clear(3))
  expect_false(clear(2.2, effective = 0.5))
  expect_true(clear(3, effective = 0.5))
  expect_true(clear(-5, effective = 0.5))
  expect_true(clear(9, effective = 0.5))
  expect_false(clear(8.2, effective = 0.5, bar = 8))
})

test_that("the odds are of what was computed; what was not has no part in them", {
  present <- model_by_hand(0, se = 0, error = 1)
  present$fit$emulator <- list(parameters = list())
  present$fit$values <- matrix(0, 1, 0)
  trials <- list(a = model_by_hand(1), b = tried_by_hand(-1, name = "b"))
  by_hand <- function(fit, parent) {
    log10_bf <- fit$log_evidence / log(10)
    data.frame(log10_bf, lower95 = log10_bf - 0.1, upper95 = log10_bf + 0.1, word = "undecided")
  }
  stand_in(added_parameters = function(...) data.frame(name = character()), bayes_factor = by_hand)
  for (name in c("a", "b")) {
    trials[[name]]$fit$posterior <- list(trusted = TRUE)
    trials[[name]]$fit$trust <- list(trusted = TRUE)
  }
  trials$quiet <- list(mechanism = "quiet", level = "silent")
  table <- amiss:::trial_table(trials, present, c("a", "b", "quiet", "left"), 2)
  expect_equal(table$mechanism, c("a", "b", "quiet", "left"))
  expect_equal(table$judged_by, c("runs", "trial", "silent", "none"))
  odds <- c(10, 0.1)
  expect_equal(table$probability, c(odds / (1 + sum(odds)), 0, 0))
  # The interval of a trial allows for what its runs may have missed.
  expect_equal(table$upper95 - table$lower95, c(0.2, 0.2 + 2 * rules$trial_margin, NA, NA))
})

# A mechanism as trial_table() has it.
row_by_hand <- function(log10_bf = 3, lower95 = log10_bf - 0.2, judged_by = "runs",
                        error_ratio = 0.5, beside_unknown = -1, standing = log10_bf, name = "a") {
  data.frame(mechanism = name, log10_bf, lower95, judged_by, error_ratio, beside_unknown, standing)
}

test_that("what is adopted was verified, lowers the error, and leads by a decisive evidence", {
  adopted <- function(...)
    amiss:::may_be_adopted(amiss:::best_trial(row_by_hand(...), 2), 2)
  expect_true(adopted())
  expect_false(adopted(judged_by = "trial"))
  expect_false(adopted(log10_bf = 1.9))
  expect_false(adopted(lower95 = -0.1))
  expect_false(adopted(error_ratio = 1))
  expect_true(adopted(error_ratio = 0.98))
  expect_false(adopted(beside_unknown = -4))
  expect_false(adopted(log10_bf = NA))
  both <- rbind(row_by_hand(5, error_ratio = 1.5), row_by_hand(3))
  expect_equal(amiss:::best_trial(both, 2)$log10_bf, 3)
})

test_that(paste("of decisive mechanisms that is adopted which explains most with no unknown",
                "response at all"), {
  best <- function(...) amiss:::best_trial(rbind(...), 2)$mechanism
  # A mass has all conditions to itself, a leak one.
  mass <- row_by_hand(47.7, standing = 48.3, name = "mass")
  expect_equal(best(mass, row_by_hand(23.8, standing = 55.1, name = "leak")), "leak")
  # One that is not decisive by itself is not adopted.
  expect_equal(best(mass, row_by_hand(1.9, standing = 55.1, name = "leak")), "mass")
  expect_equal(best(mass, row_by_hand(5, lower95 = -0.1, standing = 55.1, name = "leak")), "mass")
})

test_that("the best mechanism has its own odds, the others those of their standing against it", {
  table <- rbind(row_by_hand(3, standing = 10, name = "best"),
                 row_by_hand(5, standing = 9, error_ratio = 1.2, name = "raises the error"),
                 row_by_hand(NA, judged_by = "none", name = "left out"))
  odds <- c(1000, 100, 0)
  expect_equal(amiss:::probability_of(table, 2), odds / (1 + sum(odds)))
  # If none may be adopted, each has its own.
  table$error_ratio <- 1.2
  odds <- c(1000, 1e5, 0)
  expect_equal(amiss:::probability_of(table, 2), odds / (1 + sum(odds)))
})

test_that("a winner is the cause if it leaves little of the error beyond the noise", {
  # Twelve rows of noise 1 and two parameters: an RMS of e counts as e sqrt(12 / 10).
  model <- function(rms, level = "verified") {
    list(level = level, target = rep(0, 12), noise = rep(1, 12), parameters = 1:2,
         least = list(at = 1), runs = list(outputs = matrix(rms * rep(c(-1, 1), 6))))
  }
  large <- rules$large_remainder / sqrt(12 / 10)
  expect_true(amiss:::leaves_much(model(1.01 * large)))
  expect_false(amiss:::leaves_much(model(0.99 * large)))
  expect_false(amiss:::leaves_much(model(9, level = "given")))
  cause <- function(before, after) amiss:::takes_error(model(after), model(before))
  expect_true(cause(8, 1))
  expect_true(cause(8, 2))  # leaves 4.8 - 1 of 76.8 - 1
  expect_false(cause(8, 3))  # 10.8 - 1
})

test_that("the first look is at the ends of what is new and between", {
  space <- amiss:::coordinates_of(list(free("a", uniform(0, 1)), free("b", normal(0, 1))))
  one <- amiss:::first_values(space[1, ])
  expect_equal(unname(one[, 1]), c(-1, 1, 0) * sqrt(3))
  two <- amiss:::first_values(space)
  expect_equal(dim(two), c(5, 2))
  expect_equal(two[1:2, ], rbind(-c(sqrt(3), 4), c(sqrt(3), 4)), ignore_attr = TRUE)
  expect_identical(two, amiss:::first_values(space))
  expect_equal(dim(amiss:::first_values(space[0, ])), c(1, 0))
})
