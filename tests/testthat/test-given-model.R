# The loop on runs that were made elsewhere: nothing is run.
skip_on_cran()  # second tier: tools/test --quick

# Runs of the linear world, with sun and wind beside it, over all rows of a record in which both
# act.
given_upgrade <- function(catalogue, base = world$base, control = list()) {
  control <- utils::modifyList(list(calibration = quick_ais, attribution = list(surrogates = 19)),
                               control)
  upgrade_model(base, world$m, catalogue, control = control, seed = 1, quiet = TRUE)
}

world <- local({
  data <- linear_data(120)
  data$Ws <- withr::with_seed(4, stats::rnorm(120))
  data$Ti <- data$Ti + 0.01 * data$Gv - 0.5 * data$Ws
  m <- linear_measurements(data, boundary = ~ Te + Gv + Ws, calibrate = data$hour <= 84,
                           validate = data$hour > 84)
  free_of <- list(offset = free("offset", uniform(10, 30)), gain = free("gain", uniform(0, 1)),
                  sun = free("sun", uniform(0, 0.02)), wind = free("wind", uniform(-1, 1)))
  made <- function(names, rows = 1:120) {
    unit <- withr::with_seed(length(names), lhs::randomLHS(40, length(names)))
    values <- amiss:::unit_to_values(unit, free_of[names])
    series <- cbind(offset = 1, gain = data$Te, sun = data$Gv, wind = data$Ws)
    ensemble(values, tcrossprod(series[rows, names], values), free_of[names], measurements = m)
  }
  list(m = m, made = made, base = made(c("offset", "gain")))
})

of_runs <- function(name, edit, boundary) mechanism(name, edit, boundary, "It acts.")

test_that("mechanisms may be other sets of given runs", {
  # A function of what there is gives runs with what was adopted.
  with <- function(name) function(present) world$made(c(names(free_parameters(present)), name))
  upgrade <- given_upgrade(catalogue(of_runs("sun", with("sun"), "Gv"),
                                     of_runs("wind", with("wind"), "Ws")))
  expect_setequal(vapply(upgrade$models[-1], `[[`, "", "mechanism"), c("sun", "wind"))
  expect_setequal(names(coef(upgrade$models[[3]]$fit)), c("offset", "gain", "sun", "wind"))
  first <- upgrade$candidates[upgrade$candidates$from == "base", ]
  expect_gt(min(first$log10_bf), 2)
  for (model in upgrade$models) {
    expect_match(model$fit$check$verdict, "left-out runs")
    expect_true(model$fit$check$passed)
    expect_equal(sum(model$prediction$use == "validate"), 36)
    expect_true(all(is.finite(unlist(model$scores))))
  }
  rmse <- vapply(upgrade$models, function(m) m$scores$validate[["rmse"]], 0)
  expect_true(all(diff(rmse) < 0))
  expect_true(all(vapply(upgrade$models[-1], function(m) m$held_out_gain$improves, NA)))
  expect_type(summary(upgrade)$headline, "character")
})

test_that("given runs without what was adopted are no longer tried", {
  sun <- world$made(c("offset", "gain", "sun"))
  wind <- world$made(c("offset", "gain", "wind"))
  upgrade <- given_upgrade(catalogue(of_runs("sun", sun, "Gv"), of_runs("wind", wind, "Ws")))
  expect_length(upgrade$models, 2)
  expect_equal(nrow(upgrade$candidates), 2)
  expect_match(upgrade$stopped_because,
               "no mechanism that is left can be applied on top of what was adopted")
  file <- withr::local_tempfile(fileext = ".html")
  report(upgrade, file)
  expect_gt(file.size(file), 1000)
})

test_that("given runs that do not fit the loop are refused before anything is calibrated", {
  refused <- function(what, ...) expect_error(given_upgrade(...), what, class = "amiss_error_input")
  other <- linear_measurements(linear_data(60))
  elsewhere <- simulate_design(linear_simulator(), other, runs = 20, seed = 1)
  refused("knows its simulator", catalogue(),
          base = simulate_design(linear_simulator(), world$m, runs = 20, seed = 1))
  elsewhere["simulator"] <- list(NULL)
  refused("have 60 steps.*84", catalogue(of_runs("sun", elsewhere, "Gv")))
  expect_error(mechanism("sun", "runs", "Gv", "It acts."), "edit", class = "amiss_error_input")
  few <- of_runs("sun", world$made(c("offset", "gain", "sun"), rows = 1:84), "Gv")
  expect_error(amiss:::extend(world$base, few), "not known at the validation rows",
               class = "amiss_error_input")
})

test_that("given runs at the calibration rows alone are judged without held-out rows", {
  upgrade <- given_upgrade(
    catalogue(of_runs("sun", world$made(c("offset", "gain", "sun"), rows = 1:84), "Gv")),
    base = world$made(c("offset", "gain"), rows = 1:84), control = list(max_steps = 1))
  expect_true(all(is.na(upgrade$models[[1]]$scores$validate)))
  expect_equal(upgrade$models[[2]]$mechanism, "sun")
  expect_true(is.na(upgrade$models[[2]]$held_out_gain$improves))
})

test_that("a mechanism that cannot be made on top of what was adopted is left out, and told", {
  table <- linear_data(60)
  table$Ti <- table$Ti + 0.01 * table$Gv
  m <- linear_measurements(table, calibrate = table$hour <= 42, validate = table$hour > 42)
  base <- function_simulator(
    function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
    free("offset", uniform(10, 30)), free("gain", uniform(0, 1)), boundary = "Te")
  sunny <- function(model) {
    with_parameters(model, free("s", uniform(0, 0.02)), boundary = "Gv",
                    f = function(values, drivers, base)
                      base(values) + values[["s"]] * drivers[, "Gv"])
  }
  sun <- mechanism("sun", sunny, "Gv", "Sun enters.")
  again <- mechanism("sun again", function(model) {
    if ("s" %in% names(free_parameters(model))) stop("there is a sun")
    with_parameters(model, free("r", uniform(0, 1e-6)), boundary = "Gv",
                    f = function(values, drivers, base)
                      base(values) + values[["r"]] * drivers[, "Gv"])
  }, "Gv", "A little sun enters.")
  expect_warning(upgrade <- upgrade_model(base, m, catalogue(sun, again), seed = 1, quiet = TRUE,
                                          control = list(calibration = quick_ais,
                                                         attribution = list(surrogates = 19))),
                 "\"sun again\" is left out", class = "amiss_warning_edit")
  expect_equal(upgrade$models[[2]]$mechanism, "sun")
  expect_match(upgrade$stopped_because, "can be applied on top")
  expect_setequal(upgrade$candidates$mechanism, c("sun", "sun again"))
})
