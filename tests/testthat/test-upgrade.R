skip_on_cran()  # second tier: tools/test --quick
test_that("candidates that come near the best are calibrated in full, the others coarsely", {
  upgrade <- small_upgrade()
  table <- upgrade$candidates
  expect_equal(table$mechanism[!table$screened], "sun")
  expect_true(table$screened[table$mechanism == "drift"])
  expect_equal(upgrade$named_cause$mechanism, "sun")
})

test_that("a full calibration has an emulator of its own, of runs where the coarse posterior lies", {
  upgrade <- small_upgrade()
  emulator <- upgrade$models[[1]]$fit$emulator
  design <- simulate_design(emulator$simulator, upgrade$measurements, runs = 20, seed = 1)
  expect_identical(unname(emulator$over_priors$unit), unname(design$unit))
  # A third of the 30 runs, those of the coarse check, and those of the first 20 that lie there.
  expect_gte(nrow(emulator$unit), 10 + 10)
  expect_true(all(amiss:::in_region(emulator$processes$region, emulator$unit)))
  expect_true(all(apply(emulator$unit, 2, sd) < 0.5 * apply(design$unit, 2, sd)))
})

test_that("a coarse candidate is compared with the coarse calibration of the current model", {
  upgrade <- small_upgrade()
  base <- upgrade$models[[1]]$fit
  coarse <- amiss:::as_coarse(base)
  expect_identical(coarse$log_evidence, base$coarse$log_evidence)
  expect_false(coarse$log_evidence == base$log_evidence)
  table <- amiss:::trial_table(list(sun = upgrade$models[[2]]$fit, drift = upgrade$models[[2]]$fit),
                               base, from = "base", full = "sun")
  expect_equal(diff(table$log10_bf), (base$log_evidence - coarse$log_evidence) / log(10), tolerance = 1e-10)
})

test_that("a mechanism whose runs all failed takes no probability from the others", {
  models <- small_upgrade()$models
  seen <- data.frame(log10_bf = c(NA, -1), lower95 = c(NA, -2), upper95 = c(NA, 0), word = c(NA, "undecided"),
                     runs = 4, row.names = c("broken", "drift"))
  table <- amiss:::trial_table(list(sun = models[[2]]$fit), models[[1]]$fit, from = "base", full = "sun", seen)
  expect_equal(table$mechanism, c("sun", "broken", "drift"))
  odds <- 10^table$log10_bf[c(1, 3)]
  expect_equal(table$probability[c(1, 3)], odds / (1 + sum(odds)), tolerance = 1e-12)
  expect_equal(table$probability[2], 0)
})

test_that("the coarse calibration follows screening, whatever is asked of the full one", {
  upgrade <- small_upgrade()
  settings <- list(calibrate = calibrate, measurements = upgrade$measurements, runs = 30, seed = 1, threads = 1,
                   keep = function(name, value) value,
                   control = modifyList(amiss:::upgrade_control,
                                        list(calibration = list(ais = list(precision = 0.01, pilot_chains = 24)))))
  coarse <- amiss:::screen_model(upgrade$models[[1]]$fit$emulator$simulator, "base", settings)
  expect_equal(coarse$fit$control$ais$precision, amiss:::upgrade_control$screening$precision)
  expect_equal(ncol(coarse$ensemble$outputs), 20)
})

# Calibrations by hand that share a record: `coarse` is the evidence that screening found, `error` the simulation's.
fit_by_hand <- function(log10_evidence, se = 0.05, lag = 0, coarse = log10_evidence, error = 1) {
  posterior <- list(annealed = c((log10_evidence - lag) * log(10), 0.1), second = c(log10_evidence * log(10), 0.1))
  structure(list(measurements = list(y = 1:3), rows = 1:3, check = list(mean = 1:3 - error),
                 log_evidence = log10_evidence * log(10),
                 standard_error = se * log(10), posterior = posterior,
                 coarse = list(log_evidence = coarse * log(10), standard_error = 0)),
            class = c("amiss_calibration", "amiss_fit"))
}

test_that("contenders are those within the margin, and none where nothing comes near adoption", {
  control <- list(margin = 3, decisive = 2)
  fit <- fit_by_hand
  contenders <- function(fits, full = character(), reference = fit(0, 0)) {
    amiss:::contenders(fits, reference, full, control)
  }
  expect_equal(contenders(list(a = fit(10), b = fit(7.5), c = fit(6))), c("a", "b"))
  expect_equal(contenders(list(a = fit(10), b = fit(6, se = 0.5))), c("a", "b"))  # its error reaches
  expect_equal(contenders(list(a = fit(10), b = fit(6, lag = 2))), c("a", "b"))  # its chains may have missed a mode
  expect_length(contenders(list(a = fit(-2), b = fit(-5))), 0)
  expect_equal(contenders(list(a = fit(-0.5), b = fit(-5))), "a")
})

test_that("where the leader falls back in full, what now leads is calibrated in full as well", {
  control <- list(margin = 1, decisive = 2)
  fit <- fit_by_hand
  fits <- list(a = fit(10), b = fit(6), c = fit(2))
  expect_equal(amiss:::contenders(fits, fit(0, 0), character(), control), "a")
  fits$a <- fit(3)  # in full
  expect_equal(amiss:::contenders(fits, fit(0, 0), "a", control), "b")
  # Those in full stand beside the current model in full, the others beside its coarse calibration.
  expect_length(amiss:::contenders(fits, fit(-5, 0, coarse = 0), "a", control), 0)
  # A leader with which the simulation's own error rises stands in nobody's way.
  fits$a <- fit(10, error = 1.5)
  expect_equal(amiss:::contenders(fits, fit(0, 0), "a", control), "b")
  # The loop itself asks again until what leads is known in full. Here every full calibration falls back by 8 decades.
  base <- small_upgrade()$models[[1]]
  screen <- function(above) {
    own <- base$fit
    own$log_evidence <- amiss:::as_coarse(base$fit)$log_evidence + above * log(10)
    own$standard_error <- 0.1
    list(fit = own)
  }
  screens <- list(a = screen(30), b = screen(25), c = screen(2))
  made <- character()
  fall_back <- function(key, code) {
    made <<- c(made, key[[2]])
    own <- screens[[sub("base \\+ ", "", key[[2]])]]$fit
    own$log_evidence <- own$log_evidence - 8 * log(10)
    list(fit = own)
  }
  trials <- lapply(screens, function(screen) linear_simulator())
  tried <- amiss:::tried_in_full(base, trials, screens, list(control = amiss:::upgrade_control, keep = fall_back),
                                 say = function(...) NULL)
  expect_equal(made, c("base + a", "base + b"))
  expect_equal(tried$table$judged_by, c("calibration", "calibration", "screening"))
})

test_that("what is to be adopted is settled, and must lead after that too", {
  base <- small_upgrade()$models[[1]]
  above <- function(fit, decades, border) {
    fit$log_evidence <- amiss:::as_coarse(base$fit)$log_evidence + decades * log(10)
    fit$check$border <- border
    fit
  }
  decades <- list(full = c(a = 30, b = 28), settled = c(a = 27, b = 28))
  made <- character()
  keep <- function(key, code) {
    made <<- c(made, paste(key[[1]], key[[2]]))
    fit <- above(base$fit, decades[[key[[1]]]][[sub("base \\+ ", "", key[[2]])]], border = 0.03)
    if (key[[1]] == "full") list(fit = fit, made = list()) else fit
  }
  trials <- list(a = linear_simulator(), b = linear_simulator())
  screens <- lapply(decades$full, function(d) list(fit = above(base$fit, d, 0)))
  tried <- amiss:::tried_in_full(base, trials, screens, list(control = amiss:::upgrade_control, keep = keep),
                                 say = function(...) NULL)
  expect_equal(made, c("full base + a", "settled base + a", "full base + b", "settled base + b"))
  expect_equal(amiss:::best_trial(tried$table)$mechanism, "b")
  expect_equal(tried$fits$a$log_evidence, tried$fits$b$log_evidence - log(10))
})

test_that("where the present model's evidence is not known, runs of the simulator may decide", {
  row <- function(log10_bf = 10, lower95 = -290, trusted = TRUE, error_ratio = 0.1) {
    data.frame(log10_bf, lower95, trusted, error_ratio)
  }
  adopted <- function(best, passed = FALSE) {
    amiss:::may_be_adopted(best, list(check = list(passed = passed)), list(decisive = 2))
  }
  expect_true(adopted(row()))
  expect_false(adopted(row(), passed = TRUE))  # a known evidence decides by itself
  expect_true(adopted(row(lower95 = 9), passed = TRUE))
  expect_false(adopted(row(log10_bf = 1)))
  expect_false(adopted(row(trusted = FALSE)))
  expect_false(adopted(row(error_ratio = 0.8)))
  expect_false(adopted(row(error_ratio = NA)))
  expect_false(adopted(row()[0, ]))
})

test_that("the log says why a mechanism was adopted whose interval reaches below zero", {
  row <- function(lower95) data.frame(log10_bf = 3, lower95 = lower95, upper95 = 5, error_ratio = 0.5)
  expect_equal(amiss:::adoption_words(row(1)), "log10 Bayes factor 3.0")
  expect_match(amiss:::adoption_words(row(-1)), "3.0 [-1.0, 5.0] is too uncertain, but the error falls to 50 %",
               fixed = TRUE)
})

test_that("the evidence of a fit that runs confirmed needs a smaller margin, and nothing below it is refined", {
  control <- list(margin = 3, decisive = 2)
  confirmed <- function(passed, log10_evidence, ratio = 0.1) {
    fit <- fit_by_hand(log10_evidence, se = 0)
    fit$check[c("passed", "ratio")] <- list(passed, ratio)
    fit
  }
  contends <- function(fit) length(amiss:::contenders(list(a = fit), fit_by_hand(0, 0), character(), control)) == 1
  expect_true(contends(confirmed(FALSE, -0.5)))
  expect_false(contends(confirmed(TRUE, 0.5)))
  expect_true(contends(confirmed(TRUE, 1.5)))
  hopeless <- amiss:::hopeless(list(), fit_by_hand(0, 0), control)
  expect_true(hopeless(confirmed(TRUE, 0.5)))
  expect_false(hopeless(confirmed(FALSE, 0.5)))
  expect_true(hopeless(confirmed(FALSE, -1.5)))
  expect_false(hopeless(confirmed(FALSE, -1.5, ratio = 2)))  # such an emulator says nothing
})

test_that("the interval of a coarse candidate whose emulator is refuted holds the emulator's error", {
  sound <- amiss:::factor_of(fit_by_hand(1), fit_by_hand(0))
  row <- amiss:::as_far_as_emulated(sound, list(passed = FALSE, ratio = 0.5), rows = 3)
  expect_identical(amiss:::as_far_as_emulated(sound, list(passed = TRUE, ratio = 0.2), rows = 3), sound)
  expect_equal(row$upper95 - sound$upper95, (3 * 0.25 / 2 + 1.96 * sqrt(3) * 0.5) / log(10))
  expect_equal(sound$lower95 - row$lower95, 1.96 * sqrt(3) * 0.5 / log(10))
  expect_equal(row$log10_bf, sound$log10_bf)
})

test_that("screening can be left out, and bad settings are refused before anything runs", {
  upgrade <- small_upgrade()
  quick <- list(ais = list(pilot_chains = 24, groups = 4, chains = 8, importance_draws = 200))
  fits <- lapply(upgrade$models, `[[`, "fit")
  arguments <- list(fits[[1]]$emulator$simulator, upgrade$measurements, upgrade$catalogue, runs = 30, seed = 1,
                    quiet = TRUE)
  full <- do.call(upgrade_model, c(arguments, list(control = list(
    max_steps = 1, screening = NULL, calibration = quick, attribution = list(surrogates = 19)))))
  expect_false(any(full$candidates$screened))
  expect_equal(full$named_cause$mechanism, "sun")
  both <- full$candidates$mechanism == "sun"
  own <- upgrade$candidates$mechanism == "sun"
  expect_equal(full$candidates$log10_bf[both], upgrade$candidates$log10_bf[own],
               tolerance = 1e-8)  # the same full calibration
  expect_error(do.call(upgrade_model, c(arguments, list(control = list(screening = list(chains = -1))))), "chains",
               class = "amiss_error_input")
  expect_error(do.call(upgrade_model, c(arguments, list(control = list(margin = -1)))), "margin",
               class = "amiss_error_input")
  with_runs <- function(runs) do.call(upgrade_model, utils::modifyList(arguments, list(runs = runs)))
  expect_error(with_runs("many"), "runs", class = "amiss_error_input")
  expect_error(with_runs(6), "Of the 6 runs.*4", class = "amiss_error_input")
})

test_that("every model is checked by runs of its simulator, the adopted one judged", {
  upgrade <- small_upgrade()
  for (model in upgrade$models) {
    expect_true(model$fit$check$passed)
    expect_lte(model$fit$rounds, 2L)  # a smooth simulator needs few, if any
    expect_true(model$fit$trust$trusted)
  }
  expect_identical(upgrade$models[[2]]$verdict, "named")
  expect_identical(significant_conditions(upgrade$models[[1]]$attribution$table), "Gv")
})

test_that("coarse calibrations are corrected by a few runs", {
  upgrade <- small_upgrade()
  settings <- list(calibrate = calibrate, measurements = upgrade$measurements, runs = 30, seed = 1, threads = 1,
                   keep = function(name, value) value,
                   control = modifyList(amiss:::upgrade_control,
                                        list(calibration = list(ais = list(pilot_chains = 24,
                                                                           importance_draws = 200)))))
  own <- function(check) {
    settings$control$calibration$check <- check
    amiss:::screen_model(upgrade$models[[1]]$fit$emulator$simulator, "base", settings)$fit
  }
  expect_lte(own(NULL)$check$runs, 20)
  expect_identical(own(NULL)$rounds, 0L)
  expect_lte(own(8)$check$runs, 8)
  expect_null(own(0)$check)
})

test_that("models with a poor design are refined where the check fails, as often as the control allows", {
  m <- bent_measurements()
  loop <- function(rounds) {
    suppressWarnings(classes = "amiss_warning_runs", upgrade_model(
      bent_simulator(), m, catalogue(), runs = 6, seed = 1, quiet = TRUE,
      control = list(rounds = rounds, refine = 0, screening = NULL, calibration = quick_ais,
                     attribution = list(surrogates = 19))))
  }
  refined <- loop(2)
  expect_gte(refined$models[[1]]$fit$rounds, 1L)
  expect_true(refined$models[[1]]$fit$trust$trusted)
  rough <- loop(0)
  expect_false(rough$models[[1]]$fit$trust$trusted)
  expect_match(summary(rough)$tag, "not trusted|Unexplained")
  expect_error(loop(-1), "rounds", class = "amiss_error_input")
})

# Runs of the linear world, with sun and wind beside it, over all rows of a record in which both act.
given_upgrade <- function(catalogue, base = world$base, control = list()) {
  control <- utils::modifyList(list(calibration = quick_ais, attribution = list(surrogates = 19)), control)
  upgrade_model(base, world$m, catalogue, control = control, seed = 1, quiet = TRUE)
}

world <- local({
  data <- linear_data(120)
  data$Ws <- withr::with_seed(4, stats::rnorm(120))
  data$Ti <- data$Ti + 0.01 * data$Gv - 0.5 * data$Ws
  m <- linear_measurements(data, boundary = ~ Te + Gv + Ws, calibrate = data$hour <= 84, validate = data$hour > 84)
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
  upgrade <- given_upgrade(catalogue(of_runs("sun", with("sun"), "Gv"), of_runs("wind", with("wind"), "Ws")))
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
  expect_match(upgrade$stopped_because, "no runs that are left hold what has been adopted")
  file <- withr::local_tempfile(fileext = ".html")
  report(upgrade, file)
  expect_gt(file.size(file), 1000)
})

test_that("given runs that do not fit the loop are refused before anything is calibrated", {
  refused <- function(what, ...) expect_error(given_upgrade(...), what, class = "amiss_error_input")
  other <- linear_measurements(linear_data(60))
  elsewhere <- simulate_design(linear_simulator(), other, runs = 20, seed = 1)
  refused("knows its simulator", catalogue(), base = simulate_design(linear_simulator(), world$m, runs = 20, seed = 1))
  elsewhere["simulator"] <- list(NULL)
  refused("have 60 steps.*84", catalogue(of_runs("sun", elsewhere, "Gv")))
  expect_error(mechanism("sun", "runs", "Gv", "It acts."), "edit", class = "amiss_error_input")
  few <- of_runs("sun", world$made(c("offset", "gain", "sun"), rows = 1:84), "Gv")
  expect_error(amiss:::extend(world$base, few), "not known at the validation rows", class = "amiss_error_input")
})

test_that("given runs at the calibration rows alone are judged without held-out rows", {
  upgrade <- given_upgrade(catalogue(of_runs("sun", world$made(c("offset", "gain", "sun"), rows = 1:84), "Gv")),
                           base = world$made(c("offset", "gain"), rows = 1:84), control = list(max_steps = 1))
  expect_true(all(is.na(upgrade$models[[1]]$scores$validate)))
  expect_equal(upgrade$models[[2]]$mechanism, "sun")
  expect_true(is.na(upgrade$models[[2]]$held_out_gain$improves))
})

test_that("why the loop stops is told: nothing decisive, or evidence too uncertain; responses alone decide nothing", {
  table <- data.frame(mechanism = c("a", "b", "c"), log10_bf = c(1, 3, 9), lower95 = c(0.5, -1, 8),
                      upper95 = c(2, 7, 9), judged_by = c("screening", "calibration", "response"),
                      error_ratio = c(0.9, 0.5, NA))
  attribution <- list(table = data.frame(boundary = "Te", significant = FALSE, group = NA))
  best <- amiss:::best_trial(table)
  expect_equal(best$mechanism, "b")
  expect_match(amiss:::stop_reason(table, attribution, 2),
               "too uncertain \\(best: b.*3.0, interval from -1.0 to 7.0\\)")
  expect_match(amiss:::stop_reason(table, attribution, 4), "no mechanism is decisive \\(best: b.*; 4 or more")
  # With a rise of the simulation's own error no evidence is enough.
  table$error_ratio[2] <- 1.5
  expect_equal(amiss:::best_trial(table)$mechanism, "a")
  table$log10_bf[3] <- NA
  expect_match(amiss:::stop_reason(table, attribution, 2),
               "no mechanism lowers the error decisively \\(b has a log10 Bayes factor of 3.0, but raises it\\)")
  table$error_ratio[1] <- 2
  expect_equal(nrow(amiss:::best_trial(table)), 0)
})

test_that("runs that are too few to say how far the simulator can move are told", {
  table <- linear_data(60)
  m <- linear_measurements(table, calibrate = table$hour <= 42, validate = table$hour > 42)
  base <- function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
                             free("offset", uniform(10, 30)), free("gain", uniform(0, 1)), boundary = "Te")
  loop <- function(runs) {
    upgrade_model(base, m, catalogue(), runs = runs, seed = 1, quiet = TRUE,
                  control = list(calibration = quick_ais, attribution = list(surrogates = 19)))
  }
  expect_warning(loop(12), "8 runs fill the space of 2 parameters", class = "amiss_warning_runs")
  expect_no_warning(loop(15), class = "amiss_warning_runs")
})

test_that("a mechanism that cannot be made on top of what was adopted is left out, and told", {
  table <- linear_data(60)
  table$Ti <- table$Ti + 0.01 * table$Gv
  m <- linear_measurements(table, calibrate = table$hour <= 42, validate = table$hour > 42)
  base <- function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
                             free("offset", uniform(10, 30)), free("gain", uniform(0, 1)), boundary = "Te")
  sunny <- function(model) {
    with_parameters(model, free("s", uniform(0, 0.02)), boundary = "Gv",
                    f = function(values, drivers, base) base(values) + values[["s"]] * drivers[, "Gv"])
  }
  sun <- mechanism("sun", sunny, "Gv", "Sun enters.")
  again <- mechanism("sun again", function(model) {
    if ("s" %in% names(free_parameters(model))) stop("there is a sun")
    with_parameters(model, free("r", uniform(0, 1e-6)), boundary = "Gv",
                    f = function(values, drivers, base) base(values) + values[["r"]] * drivers[, "Gv"])
  }, "Gv", "A little sun enters.")
  expect_warning(upgrade <- upgrade_model(base, m, catalogue(sun, again), runs = 20, seed = 1, quiet = TRUE,
                                          control = list(calibration = quick_ais,
                                                         attribution = list(surrogates = 19))),
                 "\"sun again\" is left out", class = "amiss_warning_edit")
  expect_equal(upgrade$models[[2]]$mechanism, "sun")
  expect_match(upgrade$stopped_because, "can be applied on top")
  expect_setequal(upgrade$candidates$mechanism, c("sun", "sun again"))
})
