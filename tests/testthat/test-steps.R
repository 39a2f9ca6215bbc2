# A store that rain fills and that drains by a power of its level, in explicit steps of its own: the
# coarser they are, the later it drains.
store_hours <- 160
store_rain <- local({
  set.seed(3)
  rain <- numeric(store_hours)
  for (start in seq(8, store_hours - 10, by = 14))
    rain[start + 0:sample(1:4, 1)] <- stats::rexp(1, 0.25)
  rain
})

store_level <- function(values, rain, step_h, parts) {
  level <- 20
  out <- numeric(length(rain))
  for (i in seq_along(rain)) {
    for (j in seq_len(parts))
      level <- max(0, level + step_h / parts * (rain[i] - values[["k"]] * (level / 30)^6))
    out[i] <- level
  }
  out
}

store <- function(parts, output = function(values, drivers, info) {
  store_level(values, drivers[, "rain"], info$step_h, parts)
}) function_simulator(output, free("k", uniform(1, 9)), boundary = "rain", name = "store")

store_truth <- c(k = 4, bypass = 0.3)
store_record <- function(bypass = 0) {
  rain <- store_rain - bypass * pmax(0, store_rain - 2)
  set.seed(4)
  data <- data.frame(hour = seq_len(store_hours), rain = store_rain,
                     level = store_level(store_truth, rain, 1, 100) +
                             stats::rnorm(store_hours, sd = 0.05))
  measurements(data, time = "hour", target = "level", boundary = ~ rain, noise_sd = 0.05,
               validate = data$hour > 120)
}

store_fit <- function(simulator, m = store_record()) {
  calibrate(train_emulator(simulate_design(simulator, m, runs = 30, seed = 1), m), m,
            c(quick_ais, check = 0), seed = 1)
}

effect_of <- function(simulator, ...) amiss:::step_effect(store_fit(simulator, ...), threads = 1)

test_that(paste("what shorter steps change is what an own run with them changes, but for what the",
                "parameters take up"), {
  fit <- store_fit(store(2))
  k <- amiss:::unit_to_values(stats::pnorm(t(amiss:::posterior_centre(fit))),
                              fit$emulator$parameters)
  own <- function(parts, k) store_level(k, store_rain, 1, parts)[1:120]
  change <- own(8, k[1, ]) - own(2, k[1, ])
  slope <- (own(2, k[1, ] + 0.05) - own(2, k[1, ] - 0.05)) / 0.1
  left <- stats::lm.fit(cbind(slope), change)
  effect <- amiss:::step_effect(fit, threads = 1)
  # The slopes are the emulator's, and the prior holds a little.
  expect_equal(effect$error, sqrt(mean(left$residuals^2)), tolerance = 0.02)
  sd <- sqrt(sum(fit$weights * (fit$values[, "k"] - sum(fit$weights * fit$values[, "k"]))^2))
  expect_equal(effect$moved[["k"]], left$coefficients[["slope"]] / sd, tolerance = 0.1)
  expect_gt(effect$error / 0.05, 1)
  # Ten times as fine, a tenth is left of a scheme of first order.
  expect_lt(effect_of(store(20))$error, 0.2 * effect$error)
})

test_that("a parameter of which the record says nothing takes up nothing", {
  simulator <- with_parameters(store(2), free("idle", uniform(0, 1)))
  effect <- effect_of(simulator)
  expect_equal(effect$error, effect_of(store(2))$error, tolerance = 0.05)
  expect_lt(abs(effect$moved[["idle"]]), 0.5)  # the emulator's slope is not quite zero
})

test_that("a value for each row may be the mean of the row or that at its end", {
  mean_of_row <- function(values, drivers, info) {
    parts <- 40
    fine <- store_level(values, rep(drivers[, "rain"], each = parts), info$step_h / parts, 1)
    colMeans(matrix(fine, parts))
  }
  fit <- store_fit(store(40, mean_of_row))
  k <- amiss:::unit_to_values(stats::pnorm(t(amiss:::posterior_centre(fit))),
                              fit$emulator$parameters)
  changes <- amiss:::simulate_in_steps(store(40, mean_of_row), k, store_record(), 4, character(),
                                       threads = 1) -
    simulate_runs(store(40, mean_of_row), k, cbind(rain = store_rain[1:120]), 1)[, 1]
  at_end <- sqrt(mean(changes[, 2]^2))
  expect_gt(at_end, 0.05)
  expect_lt(amiss:::step_effect(fit, threads = 1)$error, 0.1 * at_end)
})

test_that("what is an amount of a row is shared among shorter ones", {
  amounts <- store(4, function(values, drivers, info) {
    store_level(values, drivers[, "rain"] / info$step_h, info$step_h, 4)
  })
  expect_equal(effect_of(amounts), effect_of(store(4)))
  # With each driver taken wrongly the output changes by as much as it counts.
  counts <- c(a = 5, b = 0.1, c = 1, d = 2)
  off_by <- function(right) function(amounts) {
    wrong <- union(setdiff(amounts, right), setdiff(right, amounts))
    0.01 + abs(sum(c(1, 1, -1, 1)[match(wrong, names(counts))] * counts[wrong]))
  }
  for (right in list(c("a", "c"), "d", character(), names(counts)))
    expect_setequal(amiss:::likely_amounts(names(counts), off_by(right)), right)
})

test_that("steps that no runs are left to shorten are open, and a doubt", {
  of_none <- amiss:::step_effect(store_fit(store(2)), threads = 1, left = function() 2)
  expect_true(amiss:::is_open_effect(of_none))
  # No more than the drivers' amounts could be looked for.
  expect_null(amiss:::likely_amounts(c("rain", "sun"), function(amounts) 1, left = function() 3))
  expect_match(amiss:::doubts$steps_open$says(list(model = list(steps = list(a = of_none)))),
               "left no runs")
  expect_null(amiss:::doubts$steps_open$says(list(model = list(steps = list(NULL)))))
})

test_that("nothing is said of steps that are not those of the rows, or that cannot be known", {
  by_row <- store(1, function(values, drivers) store_level(values, drivers[, "rain"], 1, 2))
  expect_null(effect_of(by_row))
  unheeded <- store(1,
                    function(values, drivers, info)
                      store_level(values, drivers[, "rain"], 1 + 0 * info$step_h, 2))
  expect_null(effect_of(unheeded))
  fails <- store(1, function(values, drivers, info) {
    if (info$step_h < 1) stop("no such step")
    store_level(values, drivers[, "rain"], info$step_h, 2)
  })
  expect_no_warning(effect <- effect_of(fails))
  expect_null(effect)
  # One that does not look at how many rows it is given.
  deaf <- function(values, drivers, info) store_level(values, store_rain[1:120], info$step_h, 2)
  expect_null(effect_of(store(1, deaf)))
  # runs that are given
  expect_null(amiss:::step_effect(list(emulator = list(simulator = NULL)), threads = 1))
})

test_that("a function follows the rows if it, or one that it calls, reads the length of a step", {
  level <- function(values, drivers, info) store_level(values, drivers[, "rain"], info$step_h, 2)
  indirect <- function(values, drivers, info) level(values, drivers, info)
  circular <- function(values, drivers, info)
    if (FALSE) circular(values, drivers, info) else numeric(nrow(drivers))
  expect_true(amiss:::follows_step(store(2)))
  expect_true(amiss:::follows_step(store(1, indirect)))
  expect_false(amiss:::follows_step(store(1, circular)))
  expect_false(amiss:::follows_step(paper_box("M1")))
  # What is stacked on it does not count.
  drift <- function(values, drivers, info, base)
    base(values) + values[["drift"]] * info$step_h * seq_len(nrow(drivers))
  expect_false(amiss:::follows_step(with_parameters(linear_simulator(),
                                                    free("drift", uniform(0, 1)), f = drift)))
})

bypass <- mechanism("bypass", boundary = "rain", sentence = "Strong rain bypasses the store.",
                    edit = function(model) {
  with_parameters(model, free("bypass", uniform(0, 1)), f = function(values, drivers, base) {
    drivers[, "rain"] <- drivers[, "rain"] - values[["bypass"]] * pmax(0, drivers[, "rain"] - 2)
    base(values, drivers)
  })
})

store_upgrade <- function(parts, hidden) {
  upgrade_model(store(parts), store_record(hidden), catalogue(bypass), runs = 30, seed = 1,
                quiet = TRUE,
                control = list(calibration = quick_ais, attribution = list(surrogates = 19)))
}

test_that("a mechanism that mends the simulator's own steps is not named", {
  # In one step an hour the level errs by 12 times the noise, and a bypass mends most of that.
  upgrade <- store_upgrade(1, 0)
  model <- upgrade$models[[2]]
  expect_identical(model$mechanism, "bypass")
  expect_identical(model$verdict, "likely")
  expect_match(model$doubts, "shorter steps of the simulator change .* of the noise where it mends",
               all = FALSE)
  told <- summary(upgrade)
  expect_match(told$inspect, "finer steps before you believe in bypass", all = FALSE)
  expect_match(told$inspect, "With steps a quarter as long the simulator's output changes by",
               all = FALSE)
  expect_equal(amiss:::result_list(upgrade)$models[[1]]$step_error,
               upgrade$models[[1]]$steps[[1]]$error)
  # So is one that finer steps would take back: its distance from no effect is what makes its
  # evidence.
  doubt <- function(moved, log10_bf) {
    parent <- upgrade$models[[1]]
    parent$steps[[1]]$error <- 0
    model$steps[[1]]$moved[["bypass"]] <- moved
    amiss:::step_doubt(parent, model, "bypass", log10_bf, upgrade$measurements)
  }
  expect_match(doubt(-2, 4),
               "move its values by 2.0 standard deviations, where 4.3 make its evidence")
  expect_null(doubt(-1.4, 4))
  expect_null(doubt(-2, 10))
  expect_null(amiss:::step_doubt(upgrade$models[[1]][c("fit", "scores")], model[c("fit", "scores")],
                                 "bypass", 4, upgrade$measurements))  # steps are not known
})

test_that(paste("one that is there is named by a simulator whose steps are fine, and none by it",
                "where none is hidden"), {
  upgrade <- store_upgrade(100, 0.3)
  expect_identical(upgrade$models[[2]]$verdict, "named")
  expect_false(any(grepl("steps", c(upgrade$models[[2]]$doubts, summary(upgrade)$inspect))))
  expect_length(store_upgrade(100, 0)$models, 1)
})

test_that("parameters that finer steps would move are told", {
  upgrade <- store_upgrade(100, 0.3)
  upgrade$models[[2]]$steps[[1]]$moved[["bypass"]] <- -1.4
  told <- summary(upgrade)
  expect_match(
    told$remains,
    "With finer steps of the simulator bypass moves by more than .*: this value is biased",
    all = FALSE)
  expect_match(told$inspect, "check that on site. Finer steps would move these values.",
               all = FALSE)
  upgrade$models[[2]]$steps[[1]]$moved[] <- 1.4
  expect_match(summary(upgrade)$remains, "k and bypass move by .*: these values are biased",
               all = FALSE)
})
