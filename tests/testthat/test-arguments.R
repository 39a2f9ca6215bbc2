# What a user is told who forgot quotes or an argument, or gave a value of another kind: in words,
# of the function that was called.

words_data <- linear_data(60)

# A call, and what its message must match.
worded <- list(
  list(quote(measurements(words_data, time = hour, "Ti", "Te")),
       "`time`: there is no object `hour`.*Did you mean the string \"hour\"?"),
  list(quote(measurements(words_data, "hour", target = Tj, "Te")), "`target`: .*\"Tj\""),
  list(quote(measurements(words_data, "hour", "Ti", boundary = Te)), "`boundary`: .*\"Te\""),
  list(quote(measurements(words_data, "hour", "Ti", "Te", calibrate = hour < 50)),
       "`calibrate`: there is no object `hour`.*the string \"hour < 50\""),
  list(quote(measurements(words_data, "hour", "Ti", "Te", unit = K)), "`unit`: .*\"K\""),
  list(quote(measurements(words_data, "hour", "Ti", "Te", noise_sd = twice(none))),
       "`noise_sd`: there is no object `none`"),
  list(quote(measurements(words_data, "hour", "Ti", "Te", noise_sd = broken_function())),
       "`noise_sd`: there is no object `not_there`, which `broken_function\\(\\)` needs"),
  list(quote(free(kx, uniform(0, 1))), "`name`: there is no object `kx`.*\"kx\""),
  list(quote(free("k", uniform(0, 1), W)), "`unit`: there is no object `W`"),
  list(quote(free(c, uniform(0, 1))), "`name` must be one string; got a function.*\"c\""),
  list(quote(condition("a", K)), "`unit`: there is no object `K`"),
  list(quote(mechanism(leak)), "`name`: there is no object `leak`"),
  list(quote(network_node(air)), "`name`: there is no object `air`"),
  list(quote(read_study(x.yml)), "`path`: there is no object `x.yml`"),
  list(quote(catalogue(leak)), "there is no object `leak`"),
  list(quote(zone_wall("wall", area = wide)), "`area`: there is no object `wide`"),
  list(quote(change_component(words_room, "heater", capacity = large)),
       "`capacity`: there is no object `large`"),
  list(quote(change_component(words_room, window)), "`name` must be one string; got a function"),
  list(quote(measurements(words_data, "hour", "Ti")), "`boundary` is missing"),
  list(quote(measurements()), "`data` is missing"),
  list(quote(free("k")), "`prior` is missing"),
  list(quote(normal(20)), "`sd` is missing"),
  list(quote(uniform(1)), "`upper` is missing"),
  list(quote(simulate_design(words_room)), "`measurements` is missing"),
  list(quote(calibrate_refined()), "`ensemble` is missing"),
  list(quote(attribute_discrepancy()), "`fit` is missing"),
  list(quote(discrepancy()), "`fit` is missing"),
  list(quote(function_simulator()), "`f` is missing"),
  list(quote(compare_models()), "`models` is missing"),
  list(quote(zone_window()), "`name` is missing"),
  list(quote(mechanism("leak", boundary = Ws)), "`edit` is missing"),
  list(quote(train_emulator(1)), "`noise_sd` is missing"),
  list(quote(run_study()), "`path` is missing"),
  list(quote(normal(20, -1)), "`sd` is -1; it must be above 0\\."),
  list(quote(normal("a", 1)), "`mean` must be one number; got the string \"a\""),
  list(quote(normal(NA, 1)), "`mean` must be one number; got NA"),
  list(quote(normal(1:2, 1)), "`mean` must be one number; got 2 numbers"),
  list(quote(normal(as.Date("2024-03-01"), 1)),
       "`mean` must be one number; got an object of .*Date"),
  list(quote(measurements(words_data, "hour", "Ti", "Te", warmup = -3)),
       "`warmup` is -3; it must be 0 or more\\."),
  list(quote(measurements(words_data[1:3, ], "hour", "Ti", "Te")),
       "`data` must have at least 10 rows; it has 3"),
  list(quote(free("k", 1)), "`prior` must be a prior made by uniform\\(\\).*; got the number 1"),
  list(quote(free("", uniform(0, 1))), "`name` must not be empty"),
  list(quote(condition("a", circular = "x")), "`circular` must be TRUE or FALSE; got the string"),
  list(quote(paper_box("M9")), "`model` must be \"M1\".* or \"M6\"; got the string \"M9\""),
  list(quote(mechanism("a", function() 1, "Te", "A.")), "`edit` must be a function of 1 argument"),
  list(quote(simulate_design(words_simulator, words_room)),
       "`measurements` must be .*; got a zone"),
  list(quote(read_study("none.yml")), "none.yml.*does not exist"),
  list(quote(attribute_discrepancy(1)), "`fit` must be a calibration made by.*; got the number 1"),
  list(quote(change_component(1, "a")), "`model` must be a zone made by.*; got the number 1"),
  list(quote(ais(identity, list(a = uniform(0, 1), 2))), "`priors`"),
  list(quote(compare_models(list(1), 1)), "`models` must have a name for each"))

test_that("errors are said in words, of the function that was called", {
  words_room <- zone(zone_heater("heater", "P"), volume = 40)
  words_simulator <- linear_simulator()
  twice <- function(x) 2 * x
  broken_function <- function() not_there
  for (row in worded) {
    shown <- deparse1(row[[1]])
    refused <- expect_error(eval(row[[1]]), class = "amiss_error_input", info = shown)
    message <- gsub("\\s+", " ", cli::ansi_strip(conditionMessage(refused)))
    expect_match(message, row[[2]], info = shown)
    expect_no_match(message, "eval\\(|checkmate|Element|inherit|2\\.2250|cannot be used")
    expect_identical(deparse1(conditionCall(refused)), paste0(row[[1]][[1]], "()"), info = shown)
  }
})

test_that("the call of a method's error is that of its generic", {
  fit <- small_upgrade()$models[[1]]$fit
  fit$format_version <- 1L
  for (use in c("tidy", "glance", "predict")) {
    refused <- expect_error(do.call(use, list(fit)), class = "amiss_error_input")
    expect_identical(deparse1(conditionCall(refused)), paste0(use, "()"))
  }
})

test_that("an object that is not there is said of every argument", {
  skip_on_cran()
  generics <- c("tidy", "glance", "augment", "autoplot", "predict", "simulate", "summary",
                "report_fragment", "simulate_runs", "slopes", "zone_resolve")
  calls <- valid_calls()
  wrong <- lapply(setdiff(names(calls), generics), function(f) {
    call <- unclass(calls[[f]])
    lapply(setdiff(intersect(names(call), names(formals(f))), ""), function(argument) {
      call[[argument]] <- quote(absent_object)
      told <- tryCatch(do.call(f, call), error = identity)
      fine <- inherits(told, "amiss_error_input") &&
        grepl(paste0("`", argument, "`: there is no object `absent_object`"),
              cli::ansi_strip(conditionMessage(told)), fixed = TRUE) &&
        identical(deparse1(conditionCall(told)), paste0(f, "()"))
      if (!fine) paste(f, argument, class(told)[1])
    })
  })
  expect_null(unlist(wrong))
})
