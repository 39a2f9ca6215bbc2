# Several records calibrated together.

quick <- list(calibration = list(ais = list(pilot_chains = 64, groups = 4)))

two_table <- function(sun = 0, seed = 1) {
  hour <- 1:240
  table <- data.frame(hour = hour, Te = 10 + 5 * sin(2 * pi * hour / 24) + cos(hour / 31))
  withr::with_seed(seed, {
    # days that are alike are no surrogates of one another
    clouds <- rep(stats::runif(10, 0.1, 1), each = 24)
    table$Gv <- clouds * pmax(0, 300 * sin(2 * pi * (hour - 7) / 24))
    table$Ti <- 20 + 0.4 * table$Te + sun * table$Gv + stats::rnorm(240, 0, 0.1)
    table$flux <- 3 - 2 * table$Te + 0.1 * stats::rnorm(240, 0, 5)
  })
  table
}

record_of <- function(table, target, noise_sd) {
  measurements(table, time = "hour", target = target, boundary = ~ Te + Gv, noise_sd = noise_sd,
               validate = table$hour > 168)
}

wall <- function_simulator(function(values, drivers) {
  cbind(Ti = values[["base"]] + values[["gain"]] * drivers[, "Te"],
        flux = 3 - 5 * values[["gain"]] * drivers[, "Te"])
}, free("gain", uniform(0, 1)), free("base", uniform(15, 25)), boundary = "Te")

# Of the flux alone: it knows no base.
flux_only <- function_simulator(
  function(values, drivers) 3 - 5 * values[["gain"]] * drivers[, "Te"], free("gain", uniform(0, 1)),
  boundary = "Te")

joint_fit <- function(sun = 0, simulators = outputs_of(wall, c("Ti", "flux"))) {
  table <- two_table(sun)
  both <- list(Ti = record_of(table, "Ti", 0.1), flux = record_of(table, "flux", 0.5))
  calibrate_jointly(simulate_jointly(simulators, both, 25, seed = 1), both, control = quick,
                    seed = 1)
}

test_that("the joint posterior is that of linear regression on both records", {
  fit <- joint_fit(simulators = list(Ti = outputs_of(wall, "Ti")$Ti, flux = flux_only))
  expect_true(fit$trust$trusted)
  expect_named(fit$parameters, c("gain", "base"))
  # Least squares with weights: both records at their noise, no discrepancy.
  used <- two_table()[1:168, ]
  x <- rbind(cbind(1, used$Te) / 0.1, cbind(0, -5 * used$Te) / 0.5)
  y <- c(used$Ti / 0.1, (used$flux - 3) / 0.5)
  ols <- stats::lm.fit(x, y)
  sd <- sqrt(diag(solve(crossprod(x))))
  # Discrepancy and autocorrelated error, were there any, leave the parameters wider than least
  # squares alone.
  expect_lt(abs(coef(fit)[["gain"]] - ols$coefficients[2]), 2 * sd[2])
  expect_lt(abs(coef(fit)[["base"]] - ols$coefficients[1]), 2 * sd[1])
  ratio <- sqrt(diag(vcov(fit)))[c("base", "gain")] / sd
  expect_true(all(ratio > 0.8 & ratio < 2.5))
})

test_that("a record that knows a parameter better tells the other", {
  fit <- joint_fit()
  table <- two_table()
  m <- record_of(table, "Ti", 0.1)
  alone <- calibrate_refined(simulate_design(outputs_of(wall, "Ti")$Ti, m, 25, seed = 1), m,
                             control = quick, seed = 1)
  expect_lt(vcov(fit)["gain", "gain"], vcov(alone)["gain", "gain"])
  # Without the joint one's evidence: a part has none, and says so.
  expect_true(is.na(fit$records$Ti$log_evidence))
  expect_error(bayes_factor(fit$records$Ti, alone), "calibrated together",
               class = "amiss_error_input")
  expect_error(attribute_discrepancy(fit$records$Ti), "calibrated together",
               class = "amiss_error_input")
})

test_that("a model that lacks an effect in one record loses against one that has it", {
  sunny <- with_parameters(wall, free("sun", uniform(0, 0.02)), boundary = "Gv",
                           f = function(values, drivers, base) {
    run <- base(values)
    run[, "Ti"] <- run[, "Ti"] + values[["sun"]] * drivers[, "Gv"]
    run
  })
  without <- joint_fit(0.01)
  with <- joint_fit(0.01, outputs_of(sunny, c("Ti", "flux")))
  expect_gt(bayes_factor(with, without)$lower95, 2)
  interval <- confint(with)["sun", ]
  expect_true(interval[1] < 0.01 && interval[2] > 0.01)
  attribution <- attribute_discrepancy(without, list(surrogates = 59), seed = 1)
  expect_named(attribution$records, c("Ti", "flux"))
  expect_identical(attribution$table$boundary[1], "Gv")
  expect_true(attribution$table$significant[1])
  expect_identical(attribution$table$records[1], "Ti")
  expect_identical(attribution$records$flux$table$significant, c(FALSE, FALSE))
  expect_output(print(attribution), "Ti: driven by")
  expect_identical(nrow(tidy(attribution)), 4L)
})

test_that("conditions that no record tells apart are named together", {
  table <- two_table(0.01)
  table$copy <- table$Gv + withr::with_seed(3, stats::rnorm(240, 0, 0.5))
  copied <- function(target, noise_sd) {
    measurements(table, time = "hour", target = target, boundary = ~ Te + Gv + copy,
                 noise_sd = noise_sd, validate = table$hour > 168)
  }
  both <- list(Ti = copied("Ti", 0.1), flux = copied("flux", 0.5))
  runs <- simulate_jointly(outputs_of(wall, c("Ti", "flux")), both, 25, seed = 1)
  # Draws in which neither acts are few: a coarser sampler may have none of them.
  finer <- list(calibration = list(ais = list(pilot_chains = 128, groups = 8)))
  together <- attribute_discrepancy(calibrate_jointly(runs, both, control = finer, seed = 1),
                                    list(surrogates = 59), seed = 1)
  expect_length(together$groups, 1)
  expect_setequal(together$groups[[1]]$conditions, c("Gv", "copy"))
  expect_gt(together$groups[[1]]$log10_bf_dropped, 5)
  members <- together$table[together$table$boundary %in% c("Gv", "copy"), ]
  expect_true(all(members$significant))
  expect_equal(unique(members$group), "Gv or copy")
  expect_output(print(together), "cannot be distinguished")
  expect_setequal(amiss:::significant_conditions(together$table), "Gv or copy")
})

test_that("what concerns one record works on its part", {
  fit <- joint_fit()
  expect_output(print(fit), "Joint calibration")
  expect_lte(length(utils::capture.output(print(fit))), 15)
  expect_output(print(fit$records$Ti), "calibrated together")
  expect_identical(nrow(tidy(fit)), 2L)
  expect_equal(dim(as.data.frame(fit, draws = 10)), c(10L, 2L))
  predicted <- predict(fit, use = "validate")
  expect_named(predicted, c("Ti", "flux"))
  held <- predicted$flux
  expect_gt(mean(held$observed > held$lower95 & held$observed < held$upper95), 0.85)
  expect_s3_class(discrepancy(fit$records$flux), "amiss_discrepancy")
})

test_that("a search runs no record again for a parameter that it does not have", {
  calls <- c(Ti = 0, flux = 0)
  counted <- function(name, simulator) {
    f <- simulator$f
    simulator$f <- function(values, drivers, info) {
      calls[[name]] <<- calls[[name]] + 1
      amiss:::call_run_function(f, values, drivers, info = info)
    }
    simulator
  }
  table <- two_table()
  both <- list(Ti = record_of(table, "Ti", 0.1), flux = record_of(table, "flux", 0.5))
  room <- function_simulator(function(values, drivers) {
    values[["base"]] + values[["offset"]] + values[["gain"]] * drivers[, "Te"]
  }, free("gain", uniform(0, 1)), free("base", uniform(15, 25)), free("offset", uniform(-1, 1)),
     boundary = "Te")
  simulators <- list(Ti = counted("Ti", room), flux = counted("flux", flux_only))
  records <- lapply(both, amiss:::loop_record, quick_ais)
  context <- amiss:::new_context(1, 1, list())
  found <- amiss:::find_modes(amiss:::new_model(simulators, records), context)
  expect_equal(amiss:::runs_spent(context), sum(calls))
  # One run is made twice, to see whether it repeats.
  expect_equal(calls[["Ti"]], ncol(found$model$runs$outputs) + 1)
  # Differences along base and offset are one run to the flux, which knows neither.
  before <- calls
  sloped <- amiss:::difference_slopes(found$model, found$modes[[1]]$at, context)
  expect_equal(calls - before, c(Ti = 3, flux = 2))
  expect_true(all(sloped$slopes[sloped$model$rows[[2]], c(2, 3)] == 0))
  z <- found$model$runs$z[found$modes[[1]]$at, , drop = FALSE]
  estimate <- amiss:::unit_to_values(amiss:::to_unit(z, found$model$space), found$model$parameters)
  # Base and offset are one to the record; what their priors say of them leaves the sum where it is.
  expect_equal(c(estimate[1, "gain"], sum(estimate[1, c("base", "offset")])), c(gain = 0.4, 20),
               tolerance = 0.01, ignore_attr = TRUE)
})

test_that("runs that were made elsewhere are calibrated together as they are", {
  table <- two_table()
  both <- list(Ti = record_of(table, "Ti", 0.1), flux = record_of(table, "flux", 0.5))
  design <- withr::with_seed(
    4, matrix(stats::runif(50), 25, 2) %*% diag(c(1, 10)) + rep(c(0, 15), each = 25))
  colnames(design) <- c("gain", "base")
  te <- table$Te[1:168]
  runs <- list(Ti = apply(design, 1, function(v) v[["base"]] + v[["gain"]] * te),
               flux = apply(design, 1, function(v) 3 - 5 * v[["gain"]] * te))
  priors <- list(free("gain", uniform(0, 1)), free("base", uniform(15, 25)))
  given <- lapply(runs, function(outputs) ensemble(design, outputs, priors))
  fit <- calibrate_jointly(given, both, control = quick, seed = 1)
  expect_identical(fit$runs_made, 0)
  expect_lt(max(abs(coef(fit) - coef(joint_fit())) / sqrt(diag(vcov(fit)))), 1)
})

test_that("a run is made once for all outputs", {
  calls <- 0
  counted <- function_simulator(function(values, drivers) {
    calls <<- calls + 1
    cbind(a = values[["x"]] * drivers[, "Te"], b = drivers[, "Te"])
  }, free("x", uniform(0, 1)), boundary = "Te")
  two <- outputs_of(counted, c("a", "b"))
  drivers <- cbind(Te = 1:5)
  values <- cbind(x = c(0.2, 0.4))
  expect_equal(simulate_runs(two$a, values, drivers, 1), outer(1:5, c(0.2, 0.4)))
  expect_equal(simulate_runs(two$b, values, drivers, 1), matrix(1:5, 5, 2))
  expect_identical(calls, 2)
  simulate_runs(two$b, values, drivers + 1, 1)
  expect_identical(calls, 4)
  lacking <- outputs_of(counted, "c")$c
  expect_warning(simulate_runs(lacking, values, drivers, 1), "columns a, b, not c",
                 class = "amiss_warning_input")
})

test_that("parameters under another name are not shared", {
  apart <- rename_parameters(flux_only, gain = "gain of the flux")
  expect_named(amiss:::free_parameters(apart), "gain of the flux")
  expect_identical(amiss:::free_parameters(apart)[[1]]$label, "gain of the flux")
  labelled <- function_simulator(function(values, drivers) values[["g"]] * drivers[, "Te"],
                                 free("g", uniform(0, 1), label = "gain"), boundary = "Te")
  expect_identical(amiss:::free_parameters(rename_parameters(labelled, g = "h"))$h$label, "gain")
  drivers <- cbind(Te = 1:4)
  expect_equal(simulate_runs(apart, cbind(`gain of the flux` = 0.3), drivers, 1),
               simulate_runs(flux_only, cbind(gain = 0.3), drivers, 1))
  fit <- joint_fit(simulators = list(Ti = outputs_of(wall, "Ti")$Ti, flux = apart))
  expect_named(coef(fit), c("gain", "base", "gain of the flux"))
  # Nothing is shared: the evidence is the product of those of each.
  alone <- Map(function(simulator, m) {
    calibrate_refined(simulate_design(simulator, m, 25, seed = 1), m, control = quick, seed = 1)
  }, list(outputs_of(wall, "Ti")$Ti, flux_only), lapply(fit$records, `[[`, "measurements"))
  each <- vapply(alone, `[[`, 0, "log_evidence")
  error <- sqrt(fit$standard_error^2 + sum(vapply(alone, `[[`, 0, "standard_error")^2))
  expect_lt(abs(fit$log_evidence - sum(each)), 4 * error)
  expect_error(rename_parameters(flux_only, nothing = "x"), "no parameter",
               class = "amiss_error_input")
  expect_error(rename_parameters(wall, gain = "base"), "two parameters",
               class = "amiss_error_input")
  expect_output(print(apart), "other names")
})

test_that("what does not fit together is refused", {
  table <- two_table()
  both <- list(Ti = record_of(table, "Ti", 0.1), flux = record_of(table, "flux", 0.5))
  expect_error(simulate_jointly(list(Ti = flux_only), both, 25), class = "amiss_error_input")
  expect_error(simulate_jointly(list(a = flux_only, b = flux_only), both, 25),
               "under the same name", class = "amiss_error_input")
  other <- function_simulator(function(values, drivers) values[["gain"]] * drivers[, "Te"],
                              free("gain", uniform(0, 2)), boundary = "Te")
  expect_error(simulate_jointly(list(Ti = other, flux = flux_only), both, 25), "different priors",
               class = "amiss_error_input")
  expect_error(outputs_of(1, "a"), class = "amiss_error_input")
  expect_error(attribute_discrepancy(1), class = "amiss_error_input")
})

test_that("the flux at a wall is what its balance says", {
  room <- zone(zone_wall("facade", area = 12, zone_layer(0.2, 0.3, 8e5), outside = "Te"),
               volume = 40)
  drivers <- cbind(Te = rep(5, 24 * 40))
  # Air held at 20 degC until nothing changes: 1 / (1/3 + 1/25 + 0.2/0.3) W/m2K, no other surface to
  # radiate to.
  flux <- simulate_zone(room, NULL, drivers, 3600, hold = rep(20, nrow(drivers)), flux = "facade")
  expect_equal(flux[nrow(flux)], -15 / (1 / 3 + 1 / 25 + 0.2 / 0.3), tolerance = 1e-6)
  expect_error(simulate_zone(room, NULL, drivers, 3600, flux = "roof"), "no wall of that name",
               class = "amiss_error_input")
  expect_error(zone_flux(room, "roof", "Ti"), "no wall of that name", class = "amiss_error_input")
  sensor <- zone_flux(room, "facade", "Ti")
  measured <- cbind(drivers, Ti = 20)
  # In rows that warm up it is the air that is held, not the flux measured there.
  expect_equal(simulate_runs(sensor, matrix(0, 1, 0), measured, 1, hold = rep(-7, nrow(drivers))),
               flux)
})
