test_that("mechanisms and catalogues are checked", {
  expect_error(catalogue("sun"), "must be a mechanism", class = "amiss_error_input")
  m <- mechanism("a", function(model) model, "Te", "A.")
  expect_error(catalogue(m, m), "twice", class = "amiss_error_input")
  expect_error(mechanism("a", 3, "Te", "A."), "edit", class = "amiss_error_input")
  broken <- mechanism("b", function(model) stop("no such wall"), "Te", "B.")
  expect_error(amiss:::extend(linear_simulator(), broken), "cannot be applied.*no such wall",
               class = "amiss_error_input")
  other <- mechanism("c", function(model) 3, "Te", "C.")
  expect_error(amiss:::extend(linear_simulator(), other), "not a simulator",
               class = "amiss_error_input")
})

test_that("every mechanism of the shipped catalogues applies to its model", {
  study <- read_study(twinhouse_study("O5"))
  expect_gte(length(study$catalogue), 8)
  for (entry in study$catalogue) {
    extended <- amiss:::extend(study$model, entry)
    expect_gt(length(free_parameters(extended)), length(free_parameters(study$model)))
    expect_true(all(driver_names(extended) %in% colnames(study$measurements$raw$drivers)))
  }
  expect_no_warning(amiss:::warn_absent_drivers(study$catalogue, study$measurements))
  for (entry in box_catalogue()) {
    expect_gt(length(free_parameters(amiss:::extend(paper_box("M2"), entry))),
              length(free_parameters(paper_box("M2"))))
  }
})

test_that("braces in another's message are left as they are", {
  broken <- mechanism("b", function(model) stop("no {way} }"), "Te", "B.")
  expect_error(amiss:::extend(linear_simulator(), broken), "no {way} }", fixed = TRUE,
               class = "amiss_error_input")
})

test_that("an edit that loses what was adopted before is refused", {
  gain <- free("gain", uniform(0, 1))
  sun <- free("sun", uniform(0, 1))
  model <- function(...)
    function_simulator(function(values, drivers) 20 + 0 * drivers[, "Te"], ..., boundary = "Te")
  anew <- mechanism("leak", function(m) model(gain, free("leak", uniform(0, 1))), "Te", "It leaks.")
  expect_error(amiss:::extend(model(gain, sun), anew, adopted = "sun"),
               "\"leak\" drops the parameter \"sun\".*adopted before",
               class = "amiss_error_input")
  # What belongs to the base model may be replaced.
  expect_s3_class(amiss:::extend(model(gain, sun), anew), "amiss_function_simulator")
  expect_s3_class(amiss:::extend(model(gain, sun), anew, adopted = "gain"),
                  "amiss_function_simulator")
})

test_that("a loop whose second mechanism loses the first one stops with a reason", {
  data <- linear_data(120)
  data$Ti <- data$Ti + 0.01 * data$Gv
  m <- linear_measurements(data)
  offset <- free("offset", uniform(10, 30))
  make <- function(name, column, scale) {
    run <- function(values, drivers) {
      values[["offset"]] + 0.4 * drivers[, "Te"] + scale * values[[name]] * drivers[, column]
    }
    mechanism(name, boundary = column, sentence = "It acts.", edit = function(model) {
      function_simulator(run, offset, free(name, uniform(0, 1)), boundary = c("Te", column))
    })
  }
  base <- function_simulator(function(values, drivers) values[["offset"]] + 0.4 * drivers[, "Te"],
                             offset, boundary = "Te")
  expect_error(
    upgrade_model(base, m, catalogue(make("sun", "Gv", 0.02), make("wall", "Te", 0.1)), runs = 20,
                  seed = 1, quiet = TRUE,
                  control = list(calibration = quick_ais, attribution = list(surrogates = 19))),
    "\"wall\" could not be tried|drops the parameter", class = "amiss_error_input")
})

test_that("two mechanisms of a function, adopted one after the other, are both kept", {
  data <- linear_data(120)
  data$Ws <- withr::with_seed(4, stats::rnorm(120))
  data$Ti <- data$Ti + 0.01 * data$Gv - 0.5 * data$Ws
  m <- linear_measurements(data, boundary = ~ Te + Gv + Ws)
  added <- function(name, column, prior) {
    mechanism(name, boundary = column, sentence = "It acts.", edit = function(model) {
      with_parameters(model, free(name, prior), boundary = column,
                      f = function(values, drivers, base)
                        base(values) + values[[name]] * drivers[, column])
    })
  }
  upgrade <- upgrade_model(
    linear_simulator(), m,
    catalogue(added("wind", "Ws", normal(0, 1)), added("sun", "Gv", uniform(0, 0.02))), runs = 30,
    seed = 1, quiet = TRUE,
    control = list(calibration = quick_ais, attribution = list(surrogates = 19)))
  expect_setequal(vapply(upgrade$models[-1], `[[`, "", "mechanism"), c("sun", "wind"))
  last <- upgrade$models[[3]]$fit
  expect_setequal(names(last$emulator$parameters), c("offset", "gain", "sun", "wind"))
  expect_equal(coef(last)[c("gain", "sun", "wind")], c(gain = 0.4, sun = 0.01, wind = -0.5),
               tolerance = 0.1)
  expect_lt(upgrade$models[[3]]$scores$calibrate[["rmse"]], 0.12)  # the noise is 0.1
  # If the first were not named, neither would be the second.
  doubted <- upgrade
  doubted$models[[2]]$fit$trust$trusted <- FALSE
  doubted <- rejudged(doubted)$models
  expect_identical(doubted[[2]]$verdict, "likely")
  expect_true("stands_on" %in% names(doubted[[3]]$doubts))
  # Had the second no evidence alone and been correlated with the first, it would be likely at most.
  expect_identical(upgrade$models[[3]]$verdict, "named")
  second <- upgrade$models[[3]]$mechanism
  upgrade$candidates$log10_bf[upgrade$candidates$from == "base" &
                              upgrade$candidates$mechanism == second] <- -1
  expect_identical(rejudged(upgrade)$models[[3]]$verdict, "named")
  at <- match(c("sun", "wind"), names(last$emulator$parameters))
  upgrade$models[[3]]$fit$posterior$unit[, at[1]] <- last$posterior$unit[, at[2]]
  expect_match(rejudged(upgrade)$models[[3]]$doubts, "evidence only together with")
  expect_identical(rejudged(upgrade)$models[[3]]$verdict, "likely")
})

test_that("a driver that is not among the conditions is told", {
  m <- linear_measurements(boundary = ~Te)
  make <- function(name, boundary) mechanism(name, function(model) model, boundary, "It acts.")
  expect_warning(amiss:::warn_absent_drivers(catalogue(make("sun", c("Te", "Gv"))), m),
                 "\"sun\" is driven by \"Gv\", which is not among",
                 class = "amiss_warning_input")
  expect_warning(amiss:::warn_absent_drivers(catalogue(make("both", c("Wd", "Gv"))), m),
                 "\"Wd\" and \"Gv\", which are not among",
                 class = "amiss_warning_input")
  expect_no_warning(
    amiss:::warn_absent_drivers(catalogue(make("film", "Te"), make("drift", character())), m))
  # As the loop begins; what follows is stopped by an edit.
  stopped <- mechanism("sun", function(model) stop("far enough"), "Gv", "Sun.")
  expect_warning(expect_error(upgrade_model(linear_simulator(), m, catalogue(stopped), runs = 20,
                                            seed = 1, quiet = TRUE,
                                            control = list(calibration = quick_ais,
                                                           attribution = list(surrogates = 19))),
                              "far enough"),
                 "driven by", class = "amiss_warning_input")
})

test_that("a part of a catalogue is a catalogue", {
  entries <- box_catalogue()
  some <- entries[names(entries)[2:3]]
  expect_s3_class(some, "amiss_catalogue")
  expect_named(some, names(entries)[2:3])
  expect_s3_class(entries[-1], "amiss_catalogue")
  expect_error(entries["nothing"], "no mechanism \"nothing\" in the catalogue.*Its mechanisms: ",
               class = "amiss_error_input")
})

test_that("held-out data are judged at the step that adopted a mechanism", {
  data <- linear_data(240)
  # The sun has an effect in calibration, the wind in both, and held out the wind hides what the sun
  # brings.
  held <- data$hour > 180
  data$Ws <- data$Gv / 100 * ifelse(held, 1, 0) + withr::with_seed(4, stats::rnorm(240, 0, 0.1))
  data$Ti <- data$Ti + 0.01 * data$Gv - 1.6 * data$Ws
  m <- linear_measurements(data, boundary = ~ Te + Gv + Ws, validate = held)
  added <- function(name, column, prior) {
    mechanism(name, boundary = column, sentence = "It acts.", edit = function(model) {
      with_parameters(model, free(name, prior), boundary = column,
                      f = function(values, drivers, base)
                        base(values) + values[[name]] * drivers[, column])
    })
  }
  both <- catalogue(added("wind", "Ws", uniform(-3, 0)), added("sun", "Gv", uniform(0, 0.02)))
  upgrade <- upgrade_model(linear_simulator(), m, both, seed = 1, quiet = TRUE,
                           control = list(calibration = quick_ais,
                                          attribution = list(surrogates = 19)))
  expect_identical(vapply(upgrade$models[-1], `[[`, "", "mechanism"), c("sun", "wind"))
  first <- upgrade$models[[2]]
  expect_false(first$held_out_gain$improves)
  expect_identical(first$verdict, "stand-in")
  expect_true(upgrade$models[[3]]$held_out_gain$improves)
  expect_match(summary(upgrade)$mechanisms[[1]]$brought, "on held-out data it rises .* no gain")
})

test_that("a list is no catalogue, and how it becomes one is told", {
  expect_error(catalogue(list()), "do.call\\(catalogue, list\\)", class = "amiss_error_input")
  expect_error(upgrade_model(linear_simulator(), linear_measurements(), list()),
               "Make it with `catalogue\\(\\)`", class = "amiss_error_input")
})
