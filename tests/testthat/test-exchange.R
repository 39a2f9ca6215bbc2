# Parameters that may exchange their values unnoticed.

exchanges_of <- function(simulator, m) {
  found <- amiss:::find_modes(searched_model(simulator, m), search_context())
  lapply(found$model$exchanges, function(pair) names(found$model$parameters)[pair])
}

one_order <- function() {
  stores_simulator(free("first", uniform(0.5, 5), "h"), free("second", uniform(5, 12), "h"))
}

test_that("stores in a row exchange their times, parameters that act differently do not", {
  m <- measured_run(stores_simulator(), c(first = 2, second = 8))
  expect_identical(exchanges_of(stores_simulator(), m), list(c("first", "second")))
  # Offset and gain have one unit here.
  line <- function_simulator(function(values, drivers) {
    values[["a"]] + values[["b"]] * drivers[, "Te"]
  }, free("a", uniform(0, 40)), free("b", uniform(0, 40)), boundary = "Te")
  expect_identical(exchanges_of(line, measured_run(line, c(a = 20, b = 0.5))), list())
  # Where the other's prior does not reach, nothing can be exchanged.
  expect_identical(exchanges_of(one_order(), m), list())
})

test_that("three stores stand in six orders", {
  orders <- amiss:::orders_by(list(c(1, 2), c(2, 3)), 4)
  expect_length(orders, 6)
  expect_setequal(vapply(orders, paste, "", collapse = ""),
                  c("1234", "2134", "1324", "2314", "3124", "3214"))
})

test_that("a posterior holds both orders of two stores, and the evidence is that of both", {
  skip_on_cran()  # second tier: tools/test --quick
  m <- measured_run(stores_simulator(), c(first = 2, second = 8))
  calibrated <- function(simulator) {
    calibrate_refined(simulate_design(simulator, m, 6, seed = 1), m, seed = 1)
  }
  both <- calibrated(stores_simulator())
  expect_true(both$trust$trusted)
  expect_identical(tidy(both)$term, rep(c("first", "second"), each = 2))
  # Some three hundred draws take an order each: they know the share to 0.03.
  expect_equal(sum(both$weights[both$values[, "first"] > 5]), 0.5, tolerance = 0.1)
  expect_match(amiss:::mode_words(both), "If first and second exchange", all = FALSE)
  # Under priors that hold one order alone, the evidence is that of this order, in a smaller volume.
  one <- calibrated(one_order())
  error <- sqrt(both$standard_error^2 + one$standard_error^2)
  expect_lt(abs(both$log_evidence - one$log_evidence - log(2 * 4.5 * 7 / 11.5^2)), 3 * error)
  # The simulator says the same of each draw as the emulator does of the order that it knows.
  runs <- amiss:::simulate_measured(stores_simulator(), both$values[1:20, ], m, "calibrate", 1)
  ends <- which(both$values[1:20, "first"] > 5)
  expect_gt(length(ends), 2)
  expect_lt(sqrt(mean((runs - rowMeans(runs))^2)), 0.1)
})

test_that("a store that a mechanism brings is found in either order", {
  skip_on_cran()  # second tier: tools/test --quick
  m <- measured_run(stores_simulator(), c(first = 2, second = 8))
  one <- function_simulator(function(values, drivers) {
    20 + 8 * routed(drivers[, "Te"], values[["first"]])
  }, free("first", uniform(0.5, 12), "h"), boundary = "Te")
  second <- mechanism("second store", boundary = "Te",
                      sentence = "Water passes through a second store.", edit = function(model) {
    with_parameters(model, free("second", uniform(0, 12), "h"),
                    f = function(values, drivers, base) {
      drivers[, "Te"] <- routed(drivers[, "Te"], values[["second"]])
      base(values, drivers)
    })
  })
  table <- linear_data()
  m <- linear_measurements(transform(table, Ti = m$raw$y), calibrate = table$hour <= 168,
                           validate = table$hour > 168)
  upgrade <- upgrade_model(one, m, catalogue(second), seed = 1, quiet = TRUE,
                           control = list(max_steps = 1, attribution = list(surrogates = 19)))
  expect_identical(upgrade$models[[2]]$mechanism, "second store")
  expect_true(upgrade$models[[2]]$fit$trust$trusted)
  expect_identical(tidy(upgrade)$term, rep(c("first", "second"), each = 2))
})

test_that("a mode without draws is weighed by its mass", {
  m <- measured_run(squared_simulator(), c(a = 0.6))
  context <- search_context()
  found <- amiss:::find_modes(searched_model(squared_simulator(), m), context)
  model <- amiss:::with_modes(found$model, found$modes[1], 1)
  model <- amiss:::verify_model(model, context)
  at <- found$modes[[1]]$at
  # The mirror image has the same mass, and a mode of half the width has half of it.
  other <- amiss:::with_runs(model, -model$runs$z[at, , drop = FALSE], context)
  share <- function(covariance) {
    amiss:::share_of_modes(other$model, list(model$fit), other$at, list(covariance))
  }
  covariance <- found$modes[[1]]$covariance
  # Of ten runs at draws the median density is known to half a nat.
  expect_lt(abs(log(share(covariance))), 0.7)
  expect_equal(share(covariance / 4), share(covariance) / 2, tolerance = 1e-6)
})

test_that("of an extension, images are searched in which one of its own parameters has moved", {
  m <- linear_measurements()
  z <- rbind(c(1, 2), c(1, 0.5), c(-0.3, 2 + 1e-9))
  model <- run_model(linear_simulator(), m, z)
  parameters <- names(model$parameters)
  searched <- integer()
  stand_in(with_exchanges = function(model, mode, context) c(model, list(images = 2:3)),
           given_slopes = function(...) matrix(0),
           begin_search = function(model, at, ...) list(model = model, at = at),
           run_search = function(search, context) {
             searched <<- c(searched, search$at)
             search
           }, has_arrived = function(search) TRUE)
  images_of <- function(...) {
    searched <<- integer()
    amiss:::from_images(list(model = model, modes = list(list(at = 1))), search_context(), ...)
    searched
  }
  expect_identical(images_of(), 2:3)
  expect_identical(images_of(parameters[2]), 2L)
  expect_identical(images_of(parameters[1]), 3L)
  expect_identical(images_of(character()), integer())
})
