# What mechanisms could explain, seen by a few runs before any is calibrated.

settings <- function(...) {
  utils::modifyList(list(seed = 1, threads = 1, keep = function(name, value) value, spent = function() FALSE,
                         control = amiss:::upgrade_control), list(...))
}

base_fit <- function() small_upgrade()$models[[1]]$fit

extensions <- function(...) lapply(catalogue(...), amiss:::extend, simulator = base_fit()$emulator$simulator)

adding <- function(name, f, ..., boundary = "Te") {
  mechanism(name, boundary = boundary, sentence = "It acts.", edit = function(model) {
    with_parameters(model, ..., boundary = boundary,
                    f = function(values, drivers, base) base(values) + f(values, drivers))
  })
}

test_that("responses tell the mechanism that acts from those that do not, and one that fails from all", {
  acts <- adding("sun", function(values, drivers) values[["s"]] * lagged(drivers[, "Gv"], 3),
                 free("s", uniform(0, 0.02)), boundary = "Gv")
  idle <- adding("drift", function(values, drivers) values[["d"]] * seq_len(nrow(drivers)) / 100,
                 free("d", uniform(-1, 1)))
  none <- adding("nothing", function(values, drivers) 0 * values[["n"]], free("n", uniform(0, 1)))
  fails <- adding("fails", function(values, drivers) NaN * values[["n"]], free("n", uniform(0, 1)))
  expect_warning(own <- amiss:::response_factors(base_fit(), extensions(acts, idle, none, fails), threads = 1),
                 "\"nothing\" changes nothing", class = "amiss_warning_input")
  expect_gt(own["sun", "log10_bf"], 5)
  expect_lt(own["drift", "upper95"], 1)
  # The same record and the same model: what is left is the sampler's error.
  expect_lt(abs(own["nothing", "log10_bf"]), 1e-6)
  expect_true(is.na(own["fails", "log10_bf"]))
  expect_equal(own$runs, c(4, 4, 4, 4))
})

test_that("responses lie near the full Bayes factor, and not above twice of it", {
  upgrade <- small_upgrade()
  seen <- amiss:::response_factors(base_fit(), extensions(upgrade$catalogue$sun), threads = 1)
  full <- upgrade$candidates$log10_bf[upgrade$candidates$mechanism == "sun"]
  expect_gt(seen$log10_bf, 0.4 * full)
  expect_lt(seen$log10_bf, 1.5 * full)
})

test_that("the runs that show responses spread a mechanism's parameters and keep the model's", {
  trial <- extensions(adding("two", function(values, drivers) 0, free("a", uniform(0, 1)),
                             free("b", uniform(5, 6))))[[1]]
  centre <- cbind(offset = 15, gain = 3)  # beyond its prior, 0 to 2
  values <- amiss:::response_design(trial, centre)
  expect_equal(nrow(values), 6)
  expect_equal(unique(values[, "offset"]), 15)
  expect_equal(unique(values[, "gain"]), 2)
  strata <- (1:6 - 0.5) / 6
  expect_equal(sort(values[, "a"]), strata)
  expect_equal(sort(values[, "b"]), 5 + strata)
  expect_false(isTRUE(all.equal(values[, "a"] + 5, values[, "b"])))
  # A mechanism without a parameter has one response.
  expect_equal(nrow(amiss:::response_design(base_fit()$emulator$simulator, centre)), 1)
})

tried <- function(..., spent = function() FALSE) {
  upgrade <- small_upgrade()
  own <- settings(calibrate = calibrate, measurements = upgrade$measurements, runs = 30, spent = spent)
  own$control$calibration <- quick_ais
  amiss:::try_mechanisms(upgrade$models[[1]], catalogue(...), own, say = function(...) NULL)
}

drift <- adding("drift", function(values, drivers) values[["d"]] * seq_len(nrow(drivers)) / 100,
                free("d", uniform(-1, 1)))
sun <- adding("sun", function(values, drivers) values[["s"]] * lagged(drivers[, "Gv"], 3), free("s", uniform(0, 0.02)),
              boundary = "Gv")

test_that("mechanisms are tried in the order of their responses, all of them", {
  table <- tried(drift, sun)$table
  expect_equal(table$mechanism, c("sun", "drift"))
  expect_equal(table$judged_by, c("calibration", "screening"))
  expect_equal(tried(drift)$table$judged_by, "screening")
})

test_that("what a budget leaves no runs for is judged by its responses alone, and the table says so", {
  table <- tried(drift, sun, spent = function() TRUE)$table
  expect_equal(table$mechanism, c("sun", "drift"))
  expect_equal(table$judged_by, c("calibration", "response"))
  expect_false(table$trusted[2])
  expect_lt(table$upper95[2], 2)
  expect_equal(nrow(table$parameters[[2]]), 0)
  expect_equal(names(table$parameters[[1]]), names(table$parameters[[2]]))
})

# Every run leaves a byte in `file`.
counted_loop <- function(file, folder = NULL, ...) {
  table <- linear_data(60)
  table$Ti <- table$Ti + 0.01 * table$Gv
  m <- linear_measurements(table, boundary = ~ Te + Gv, calibrate = table$hour <= 42, validate = table$hour > 42)
  base <- function_simulator(function(values, drivers) {
    cat(".", file = file, append = TRUE)
    values[["offset"]] + values[["gain"]] * drivers[, "Te"]
  }, free("offset", uniform(10, 30)), free("gain", uniform(0, 1)), boundary = "Te")
  sun <- adding("sun", function(values, drivers) values[["s"]] * drivers[, "Gv"], free("s", uniform(0, 0.02)),
                boundary = "Gv")
  upgrade_model(base, m, catalogue(sun), runs = 20, seed = 1, quiet = TRUE,
                control = list(max_steps = 1, calibration = quick_ais, attribution = list(surrogates = 19), ...),
                checkpoint = folder)
}

test_that("an upgrade says how many runs it took, those of finished work that was kept too", {
  file <- withr::local_tempfile()
  folder <- withr::local_tempdir()
  first <- counted_loop(file, folder)
  expect_gt(first$runs_total, 20 + 4 + 20)
  # The simulator is called once more where it is checked.
  expect_lte(abs(file.size(file) - first$runs_total), 2)
  unlink(file)
  again <- counted_loop(file, folder)
  expect_lte(sum(file.size(file), na.rm = TRUE), 2)
  expect_equal(again$runs_total, first$runs_total)
  expect_equal(amiss:::result_list(again)$runs_total, first$runs_total)
})

test_that("a spent budget ends the loop and is told", {
  file <- withr::local_tempfile()
  spent <- counted_loop(file, runs_total = 10)
  expect_match(spent$stopped_because, "budget of 10 runs")
  expect_length(spent$models, 1)
  expect_null(spent$candidates)
  expect_error(counted_loop(file, runs_total = 0), "runs_total", class = "amiss_error_input")
})
