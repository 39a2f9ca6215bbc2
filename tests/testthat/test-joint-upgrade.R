# The loop over several records.

skip_on_cran()  # second tier: tools/test --quick

quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)),
              attribution = list(surrogates = 59))

two_rooms <- function(sun = c(a = 0, b = 0), seed = 1) {
  hour <- 1:240
  table <- data.frame(hour = hour, Te = 10 + 5 * sin(2 * pi * hour / 24) + cos(hour / 31))
  withr::with_seed(seed, {
    # days that are alike are no surrogates of one another
    clouds <- rep(stats::runif(10, 0.1, 1), each = 24)
    table$Gv <- clouds * pmax(0, 300 * sin(2 * pi * (hour - 7) / 24))
    table$a <- 20 + 0.4 * table$Te + sun[["a"]] * table$Gv + stats::rnorm(240, 0, 0.1)
    table$b <- 18 + 0.4 * table$Te + sun[["b"]] * table$Gv + stats::rnorm(240, 0, 0.2)
  })
  room <- function(target, noise_sd) {
    measurements(table, time = "hour", target = target, boundary = ~ Te + Gv, noise_sd = noise_sd,
                 unit = "K", validate = table$hour > 168, name = paste("room", target))
  }
  list(a = room("a", 0.1), b = room("b", 0.2))
}

# Rooms that share what the weather does to them.
room <- function(base) {
  function_simulator(function(values, drivers) values[[base]] + values[["gain"]] * drivers[, "Te"],
                     free("gain", uniform(0, 1)), free(base, uniform(15, 25), "K"), boundary = "Te")
}
rooms <- list(a = room("base a"), b = room("base b"))

shining <- function(model, gain = "sun") {
  with_parameters(model, free(gain, uniform(0, 0.05), "K m2/W"), boundary = "Gv",
                  f = function(values, drivers, base) {
    base(values) + values[[gain]] * drivers[, "Gv"]
  })
}
sun <- mechanism("sun", function(model) shining(model), "Gv", "Sun enters both rooms.")
sun_in_a <- mechanism("sun in a",
                      function(model, record) if (record == "a") shining(model, "sun a") else model,
                      "Gv", "Sun enters room a.")
drift <- mechanism("drift", function(model) {
  with_parameters(model, free("drift", uniform(-1, 1), "K"), f = function(values, drivers, base) {
    base(values) + values[["drift"]] * seq_len(nrow(drivers)) / 240
  })
}, "Te", "The rooms warm up.")

looped <- function(measured, ..., simulators = rooms, runs = 24, control = list()) {
  upgrade_model(simulators, measured, catalogue(...), runs = runs,
                control = utils::modifyList(quick, control), seed = 1, quiet = TRUE)
}

cache <- new.env()
both_sunny <- function() {
  if (is.null(cache$upgrade)) cache$upgrade <- looped(two_rooms(c(a = 0.01, b = 0.01)), sun, drift)
  cache$upgrade
}

test_that("what both records lack is named, with one parameter for both", {
  upgrade <- both_sunny()
  expect_identical(upgrade$named_cause$mechanism, "sun")
  model <- upgrade$models[[2]]
  expect_identical(model$verdict, "named")
  expect_true(model$held_out_gain$improves)
  interval <- confint(upgrade)["sun", ]
  expect_true(interval[1] < 0.01 && interval[2] > 0.01)
  expect_named(coef(upgrade), c("gain", "base a", "sun", "base b"))
  expect_s3_class(model$fit, "amiss_joint")
  expect_equal(upgrade$candidates$beside_unknown[1],
               bayes_factor(model$fit, upgrade$models[[1]]$fit)$log10_bf)
  expect_identical(upgrade$candidates$judged_by, c("runs", "trial", "trial"))
  expect_gt(upgrade$runs_total, 0)
})

test_that("scores are of each record in its unit, and of all in units of the noise", {
  model <- both_sunny()$models[[1]]
  expect_named(model$records, c("a", "b"))
  of <- function(use, score) vapply(model$records, function(r) r$scores[[use]][[score]], 0)
  noise <- c(a = 0.1, b = 0.2)
  for (use in c("calibrate", "validate")) {
    expect_equal(model$scores[[use]][["rmse"]], sqrt(mean((of(use, "rmse") / noise)^2)))
    expect_equal(model$scores[[use]][["crps"]], mean(of(use, "crps") / noise))
  }
  gain <- both_sunny()$models[[2]]$held_out_gain
  each <- lapply(both_sunny()$models[[2]]$records, `[[`, "held_out_gain")
  expect_equal(gain$mean, mean(c(each$a$mean, each$b$mean) / noise^2))
})

test_that("what is hidden in one record is found there, by the mechanism that acts there", {
  measured <- two_rooms(c(a = 0.01, b = 0))
  upgrade <- looped(measured, sun, sun_in_a)
  expect_identical(upgrade$named_cause$mechanism, "sun in a")
  first <- upgrade$candidates[upgrade$candidates$from == "base", ]
  expect_gt(first$log10_bf[first$mechanism == "sun in a"],
            first$log10_bf[first$mechanism == "sun"] + 2)
  last <- upgrade$models[[length(upgrade$models)]]
  expect_named(last$fit$records$a$emulator$parameters, c("gain", "base a", "sun a"))
  expect_named(last$fit$records$b$emulator$parameters, c("gain", "base b"))
  expect_identical(upgrade$models[[1]]$attribution$table$records[1], "a")
  # Of a mechanism that acts on both the other record knows better: it is not named.
  alone <- looped(measured, sun)
  expect_false("named" %in% unlist(lapply(alone$models, `[[`, "verdict")))
})

test_that("a list of one record gives the bits of the record alone", {
  of_one <- function(x) list(a = x$a)
  measured <- two_rooms(c(a = 0.01, b = 0))
  listed <- looped(of_one(measured), sun, drift, simulators = of_one(rooms))
  alone <- looped(measured$a, sun, drift, simulators = rooms$a)
  expect_s3_class(listed$models[[1]]$fit, "amiss_calibration")
  expect_identical(listed$candidates, alone$candidates)
  expect_identical(listed$models[[2]]$fit$values, alone$models[[2]]$fit$values)
  expect_identical(listed[c("gain", "named_cause", "stopped_because")],
                   alone[c("gain", "named_cause", "stopped_because")])
})

test_that("an edit of two arguments gets the record's name, also of a single record", {
  seen <- character()
  telling <- mechanism("sun", function(model, record) {
    seen <<- c(seen, record)
    shining(model)
  }, "Gv", "Sun enters.")
  measured <- two_rooms()
  state <- function(simulators, record) {
    list(present = list(simulators = simulators, parameters = list()), base = character(),
         started = list(record = record))
  }
  extended <- amiss:::extended_simulators(telling, state(rooms, names(rooms)))
  amiss:::extended_simulators(telling, state(list(rooms$a), "room a"))
  expect_identical(seen, c("a", "b", "room a"))
  expect_named(amiss:::free_parameters(extended$b), c("gain", "base b", "sun"))
  expect_error(mechanism("sun", function(model, record, more) model, "Gv", "Sun enters."), "edit",
               class = "amiss_error_input")
})

test_that(
  "an edit gets the simulator with its own names, and its parameters go by the others again", {
  apart <- rename_parameters(room("base a"), gain = "gain of c")
  extended <- amiss:::extend(apart, sun)
  expect_named(amiss:::free_parameters(extended), c("gain of c", "base a", "sun"))
  drivers <- cbind(Te = 1:3, Gv = c(0, 100, 0))
  values <- cbind(`gain of c` = 0.5, `base a` = 20, sun = 0.01)
  expect_equal(simulate_runs(extended, values, drivers, 1)[, 1], 20 + 0.5 * 1:3 + c(0, 1, 0))
  twice <- mechanism("twice", function(model) shining(model, "gain of c"), "Gv", "It acts.")
  expect_error(amiss:::extend(apart, twice), "two parameters", class = "amiss_error_input")
  # One that goes by another name may be replaced.
  anew <- mechanism("anew", function(model) room("base"), "Te", "It acts.")
  expect_named(amiss:::free_parameters(amiss:::extend(apart, anew)), c("gain of c", "base"))
})

test_that("what an upgrade is asked is answered for several records", {
  upgrade <- both_sunny()
  expect_lte(length(utils::capture.output(print(upgrade))), 15)
  expect_output(print(upgrade), "named: sun")
  told <- summary(upgrade)
  expect_identical(told$verdict, "named")
  expect_match(told$gain[1], "times the noise")
  expect_match(told$of_records, "^[ab]: .* K", all = TRUE)
  expect_identical(unique(told$records$record), c("a", "b"))
  expect_output(print(told), "Cause named")
  expect_identical(nrow(glance(upgrade)), 1L)
  expect_identical(tidy(upgrade)$term, names(coef(upgrade)))
  expect_identical(nobs(upgrade), 336L)
  for (by_record in list(residuals(upgrade), fitted(upgrade), augment(upgrade),
                         predict(upgrade, use = "validate"), simulate(upgrade, seed = 1)))
    expect_named(by_record, c("a", "b"))
  expect_identical(colnames(as.matrix(upgrade, draws = 8)), names(coef(upgrade)))
  expect_error(logLik(upgrade), class = "amiss_error_input")
  expect_output(print(upgrade$measurements), "2 records")
  left <- base_only(upgrade)
  expect_match(summary(left)$headline, "Gv")
  expect_match(summary(left)$remains, "in a: around", all = FALSE)
  expect_output(print(left), "0 mechanisms")
})

test_that("figures are of all records where they can be, and of each one", {
  upgrade <- both_sunny()
  named <- amiss:::figures_of(upgrade)
  expect_true(all(c("candidates", "fit of a", "fit of b") %in% named))
  for (which in named) expect_s3_class(ggplot2::autoplot(upgrade, which), "ggplot")
  expect_equal(ggplot2::autoplot(upgrade)$data, ggplot2::autoplot(upgrade, "fit of a")$data)
  expect_error(ggplot2::autoplot(upgrade, "fit of c"), "fit of a", class = "amiss_error_input")
})

test_that("a loop over records goes on from what was kept", {
  folder <- withr::local_tempdir()
  again <- function() {
    upgrade_model(rooms, two_rooms(c(a = 0.01, b = 0.01)), catalogue(sun), runs = 24,
                  control = quick, seed = 1, quiet = TRUE, checkpoint = folder)
  }
  first <- again()
  files <- dir(folder)
  second <- again()
  expect_identical(second$candidates, first$candidates)
  expect_identical(second$runs_total, first$runs_total)
  expect_identical(dir(folder), files)
})

test_that("what does not fit together is refused before anything runs", {
  measured <- two_rooms()
  refused <- function(what, simulators = rooms, of = measured, ...) {
    expect_error(looped(of, ..., simulators = simulators), what, class = "amiss_error_input")
  }
  refused("under the same name", of = stats::setNames(measured, c("a", "c")))
  refused("under the same name", of = measured["a"])
  refused("named lists of both", of = measured$a)
  refused("named lists of both", simulators = rooms$a)
  refused("named list", simulators = unname(rooms))
  refused("no simulator", simulators = list(a = rooms$a, b = 1))
  refused("made by measurements", of = list(a = measured$a, b = 1))
  other <- function_simulator(function(values, drivers) values[["gain"]] * drivers[, "Te"],
                              free("gain", uniform(0, 2)), boundary = "Te")
  refused("different priors", simulators = list(a = rooms$a, b = other))
  given <- simulate_design(rooms$a, measured$a, runs = 10, seed = 1)
  given["simulator"] <- list(NULL)
  refused("simulators of all records", simulators = list(a = given, b = rooms$b))
  refused("one set of runs", simulators = rooms, of = measured,
          mechanism("runs", given, "Gv", "It acts."))
  refused("runs", runs = 0)
})

test_that("given runs of several records are looped over too", {
  measured <- two_rooms(c(a = 0.01, b = 0.01))
  made <- function(record, sun = NULL) {
    m <- measured[[record]]
    priors <- c(list(free("gain", uniform(0, 1)), free(paste("base", record), uniform(15, 25))),
                sun)
    unit <- withr::with_seed(length(priors), lhs::randomLHS(40, length(priors)))
    values <- amiss:::unit_to_values(unit, amiss:::named_parameters(priors))
    series <- cbind(m$raw$drivers[, "Te"], 1, m$raw$drivers[, "Gv"])[, seq_along(priors)]
    ensemble(values, tcrossprod(series, values), priors, measurements = m)
  }
  given <- list(a = made("a"), b = made("b"))
  with_sun <- mechanism("sun",
                        function(model, record) made(record, list(free("sun", uniform(0, 0.05)))),
                        "Gv", "Sun enters.")
  upgrade <- looped(measured, with_sun, simulators = given)
  expect_identical(upgrade$models[[2]]$mechanism, "sun")
  expect_identical(upgrade$runs_total, 0)
})

# ---- a study file

write_rooms_study <- function(folder, records = NULL, drop = character(), ...) {
  measured <- two_rooms(c(a = 0.01, b = 0.01))
  for (name in names(measured)) {
    raw <- measured[[name]]$raw
    utils::write.csv(data.frame(hour = raw$hours, raw$drivers[, c("Te", "Gv")], warmth = raw$y),
                     file.path(folder, paste0(name, ".csv")), row.names = FALSE)
  }
  writeLines('room <- function(base) {
    function_simulator(
      function(values, drivers) values[[base]] + values[["gain"]] * drivers[, "Te"],
      free("gain", uniform(0, 1)), free(base, uniform(15, 25), "K"), boundary = "Te")
  }
  list(a = room("base a"), b = room("base b"))', file.path(folder, "models.R"))
  writeLines('function(measurements) function_simulator(
    function(values, drivers) values[["own"]] + values[["gain"]] * drivers[, "Te"],
    free("gain", uniform(0, 1)), free("own", uniform(15, 25)), boundary = "Te",
    name = measurements$name)',
             file.path(folder, "own.R"))
  writeLines('catalogue(mechanism("sun", function(model, record) {
    with_parameters(model, free("sun", uniform(0, 0.05), "K m2/W"), boundary = "Gv",
                    f = function(values, drivers, base)
                      base(values) + values[["sun"]] * drivers[, "Gv"])
  }, "Gv", "Sun enters both rooms."))', file.path(folder, "catalogue.R"))
  fields <- list(study = "two rooms", time = "hour", target = "warmth", boundary = list("Te", "Gv"),
                 unit = "K", calibrate = "hour <= 168", validate = "hour > 168", model = "models.R",
                 catalogue = "catalogue.R", runs = 24, seed = 1,
                 control = c(quick, list(max_steps = 1)),
                 records = records %||% list(a = list(data = "a.csv", noise_sd = 0.1),
                                             b = list(data = "b.csv", noise_sd = 0.2)), ...)
  path <- file.path(folder, "study.yml")
  yaml::write_yaml(fields[setdiff(names(fields), drop)], path)
  path
}

test_that("a study of several records is read: fields outside are those of all", {
  folder <- withr::local_tempdir()
  study <- read_study(write_rooms_study(folder), trust = TRUE)
  expect_identical(vapply(study$measurements, `[[`, 0, "noise_sd"), c(a = 0.1, b = 0.2))
  expect_identical(vapply(study$measurements, `[[`, "", "name"), c(a = "a", b = "b"))
  expect_identical(vapply(study$measurements, `[[`, "", "unit"), c(a = "K", b = "K"))
  expect_named(study$model$b$parameters, c("gain", "base b"))
  own <- list(a = list(data = "a.csv", noise_sd = 0.1),
              b = list(data = "b.csv", model = "own.R", noise_sd = 0.2))
  study <- read_study(write_rooms_study(folder, own), trust = TRUE)
  expect_named(study$model$b$parameters, c("gain", "own"))
  expect_identical(study$model$b$name, "b")
  expect_error(read_study(write_rooms_study(folder, own)), class = "amiss_error_trust")
})

test_that("records of a study that say too little or too much are refused", {
  folder <- withr::local_tempdir()
  refused <- function(what, ...) {
    expect_error(read_study(write_rooms_study(folder, ...), trust = TRUE), what,
                 class = "amiss_error_input")
  }
  refused("record \"b\", lacks field data", list(a = list(data = "a.csv"), b = list(noise_sd = 1)))
  refused("record.*\"b\".*unknown field seed",
          list(a = list(data = "a.csv"), b = list(data = "b.csv", seed = 2)))
  refused("no mapping", list("a.csv", "b.csv"))
  refused("no mapping", list(a = "a.csv"))
  refused("no simulator of the record.*c", list(a = list(data = "a.csv", noise_sd = 1),
                                               c = list(data = "b.csv", noise_sd = 1)))
  refused("record \"b\" cannot be read.*noise_sd", list(a = list(data = "a.csv", noise_sd = 1),
                                                       b = list(data = "b.csv")))
  refused("go through the loop only", models = "models.R", drop = c("model", "catalogue"))
  refused("does not exist", list(a = list(data = "a.csv"), b = list(data = "lost.csv")))
  refused("lacks field target", drop = "target")
})

test_that("a study of several records runs to its report, whose figures are of each record", {
  skip_if_not(rmarkdown::pandoc_available("2.0"), "pandoc")
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  result <- run_study(write_rooms_study(folder), out = out, quiet = TRUE, trust = TRUE)
  expect_identical(result$named_cause$mechanism, "sun")
  expect_setequal(list.files(out), c("report.html", "figures", "result.rds", "result.json"))
  expect_true(
    all(c("gain.png", "fit_of_a.png", "fit_of_b.png") %in% list.files(file.path(out, "figures"))))
  model <- jsonlite::read_json(file.path(out, "result.json"))$models[[2]]
  expect_identical(vapply(model$records, `[[`, "", "name"), c("a", "b"))
  own <- result$models[[2]]$records$b
  expect_equal(model$records[[2]]$rmse_calibration, own$scores$calibrate[["rmse"]])
  expect_equal(model$records[[2]]$held_out_gain, own$held_out_gain[c("mean", "standard_error")])
  expect_equal(model$rmse_calibration, result$models[[2]]$scores$calibrate[["rmse"]])
  page <- paste(readLines(file.path(out, "report.html"), encoding = "UTF-8"), collapse = "\n")
  for (told in c("fit of a: ", "fit of b: ", "discrepancy of b: ", "times the noise",
                 "Sun enters both rooms")) {
    expect_on_page(page, told)
  }
})
