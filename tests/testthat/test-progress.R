# Lines of progress, each plain and without its mark.
said <- function(code) {
  lines <- character()
  withCallingHandlers(code, message = function(m) {
    lines <<- c(lines, sub("^[^[:alpha:]] |^i ", "", trimws(cli::ansi_strip(conditionMessage(m)))))
    invokeRestart("muffleMessage")
  })
  lines
}

loudly <- function(interval = 0, frame = parent.frame()) {
  withr::local_options(amiss.progress = "lines", amiss.progress_interval = interval,
                       .local_envir = frame)
}

broken_record <- function() {
  suppressMessages(suppressWarnings(linear_measurements(linear_data(80)[-(41:50), ])))
}

test_that("tests, documents and quiet calls show nothing, logs lines and terminals a bar", {
  expect_equal(progress_way(), "none")
  withr::local_envvar(TESTTHAT = "")
  withr::with_options(list(cli.dynamic = FALSE), expect_equal(progress_way(), "lines"))
  withr::with_options(list(cli.dynamic = TRUE), {
    expect_equal(progress_way(), "bar")
    withr::with_options(list(knitr.in.progress = TRUE), expect_equal(progress_way(), "none"))
    withr::with_options(list(amiss.progress = "lines"), expect_equal(progress_way(), "lines"))
    withr::with_options(list(amiss.progress = "loud"), {
      expect_error(progress_way(), "amiss.progress.*\"loud\"", class = "amiss_error_input")
    })
    f <- function(quiet) {
      hush(quiet)
      progress_way()
    }
    expect_equal(f(TRUE), "none")
    expect_equal(f(FALSE), "bar")
    expect_equal(progress_way(), "bar")
  })
})

test_that("runs are counted over all segments, with the time left", {
  loudly()
  lines <- said(simulate_design(linear_simulator(), broken_record(), runs = 10, seed = 1))
  expect_match(lines, "^runs of the simulator \\(2 segments\\), [0-9]+ of 20, about [0-9]+ s left$")
  expect_match(lines[1], ", 1 of 20,")
  # A simulator that does not count its runs is followed by segments.
  registerS3method("free_parameters", "silent",
                   function(simulator) free_parameters(linear_simulator()),
                   envir = asNamespace("amiss"))
  registerS3method("driver_names", "silent", function(simulator) "Te", envir = asNamespace("amiss"))
  registerS3method("simulate_runs", "silent", envir = asNamespace("amiss"),
                   function(simulator, values, drivers, ...)
                     tcrossprod(drivers[, "Te"], values[, "gain"]))
  silent <- structure(list(), class = "silent")
  lines <- said(simulate_design(silent, broken_record(), runs = 10, seed = 1))
  expect_match(lines, "(10|20) of 20")
})

test_that("lines are seldom, and none of quick work", {
  loudly(interval = 30)
  m <- linear_measurements(linear_data(60))
  expect_length(said(simulate_design(linear_simulator(), m, runs = 30, seed = 1)), 0)
  told$at <- elapsed() - 31
  expect_equal(said(tell_seldom("later")), "later")
  expect_length(said(tell_seldom("at once")), 0)
  # A fifth of the time that the work has taken lies between two lines.
  told$at <- elapsed() - 60
  expect_length(said(tell_seldom("slow", began = elapsed() - 400)), 0)
  told$at <- elapsed() - 81
  expect_equal(said(tell_seldom("slow", began = elapsed() - 400)), "slow")
})

test_that("runs in parallel are counted as they end", {
  skip_if_not_installed("future")
  skip_if(!nzchar(Sys.which("awk")))
  withr::defer(future::plan(future::sequential))
  program <- function() {
    program_simulator(c("awk", "NR > 1 { if (NR == 2) print \"Ti\"; print {{gain}} * $3 }", "FS=,",
                        "drivers.csv"),
                      free("gain", uniform(0, 1)), output = c(file = "stdout.txt", column = "Ti"),
                      boundary = "Te", cache = withr::local_tempdir(.local_envir = parent.frame(2)))
  }
  # as skip_on_cran(): sessions are long to start
  second_tier <- identical(Sys.getenv("NOT_CRAN"), "true")
  for (plan in c("sequential", if (.Platform$OS.type == "unix") "multicore",
                 if (second_tier) "multisession")) {
    if (plan == "sequential") future::plan(plan) else future::plan(plan, workers = 2)
    seen <- 0
    simulate <- function() {
      simulate_runs(program(), cbind(gain = c(0.1, 0.2, 0.3, 0.4)), cbind(Te = c(1, 5, 2)),
                    step_h = 1)
    }
    runs <- withCallingHandlers(simulate(), amiss_piece_done = function(piece) seen <<- seen + 1)
    expect_equal(runs[2, ], 5 * c(0.1, 0.2, 0.3, 0.4))
    expect_equal(seen, 4)
  }
})

test_that("a terminal has a bar as long as the work lasts", {
  withr::local_options(amiss.progress = "bar", cli.dynamic = TRUE)
  m <- linear_measurements(linear_data(60))
  bars <- NULL
  model <- function_simulator(function(values, drivers) {
    bars <<- c(bars, cli::cli_progress_num())
    values[["gain"]] * drivers[, "Te"]
  }, free("gain", uniform(0, 1)), boundary = "Te")
  lines <- said(staged("study one", simulate_design(model, m, runs = 12, seed = 1)))
  expect_match(lines, "study one", all = FALSE)
  expect_equal(bars, rep(2, 12))  # the stage's and that of the runs
  expect_equal(cli::cli_progress_num(), 0)
  expect_null(getOption("amiss.stages"))
})

test_that("the loop says where it is, and is silent if asked", {
  m <- measurements(small_record(120), time = "time", target = "Ti", boundary = ~ Te + Gv,
                    noise_sd = 0.05)
  base <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
                             free("gain", uniform(0, 2)), boundary = "Te")
  sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
    with_parameters(model, free("sun", uniform(0, 0.02)), boundary = "Gv",
                    f = function(values, drivers, base)
                      base(values) + values[["sun"]] * drivers[, "Gv"])
  })
  coarse <- list(pilot_chains = 24, groups = 2, max_groups = 2, importance_draws = 0)
  control <- list(max_steps = 1, rounds = 1, calibration = list(ais = coarse),
                  attribution = list(surrogates = 19, ais = coarse))
  run <- function(quiet) {
    upgrade_model(base, m, catalogue(sun), control = control, seed = 1, quiet = quiet)
  }
  loudly()
  lines <- said(run(FALSE))
  for (part in c("^Calibrating the base model", "^base: training the emulator of [0-9]+ runs",
                 "^base: sampling the posterior", "^base: attributing the discrepancy",
                 "^step 1: mechanism 1 of 1 \\(sun\\): runs of the simulator, 1 of [0-9]+",
                 "^step 1: mechanism 1 of 1 \\(sun\\): training the emulator of [0-9]+ runs",
                 "^ *sun: log10 Bayes factor [-+]?[0-9.]+$", "^Stopped: ")) {
    expect_match(lines, part, all = FALSE)
  }
  expect_silent(run(TRUE))
})

test_that("turns of a loop tell the time left once it can be known", {
  turn <- turns("model", 3)
  expect_equal(turn("a"), "model 1 of 3 (a)")
  expect_match(turn("b"), "^model 2 of 3 \\(b\\), about [0-9]+ s left$")
  began <- elapsed() - 600
  expect_equal(time_left(began, 0, 3), "")
  expect_match(time_left(began, 1, 3), "about 20 min left")
  expect_match(time_left(began - 36000, 1, 2), "about 10 h left")
  expect_match(time_left(began + 540, 4, 5), "about (15|16) s left")
})

test_that("an interrupt leaves the session as it was and keeps what is finished", {
  loudly(interval = 30)
  folder <- withr::local_tempdir()
  m <- linear_measurements(linear_data(60))
  stop_at <- 15
  calls <- 0
  model <- function_simulator(function(values, drivers) {
    calls <<- calls + 1
    if (calls == stop_at) rlang::interrupt()
    values[["gain"]] * drivers[, "Te"]
  }, free("gain", uniform(0, 1)), boundary = "Te")
  keep <- checkpoint_keeper(folder, list(1))
  work <- function() {
    lapply(1:2, function(i) staged("part", keep(i, simulate_design(model, m, runs = 10, seed = i))))
  }
  set.seed(1)
  before <- .Random.seed
  expect_equal(tryCatch(work(), interrupt = function(e) "interrupted"), "interrupted")
  expect_null(getOption("amiss.stages"))
  expect_identical(.Random.seed, before)
  expect_length(dir(folder), 1)
  stop_at <- Inf
  calls <- 0
  expect_length(suppressMessages(work()), 2)
  expect_equal(calls, 10)
})

test_that("a response of the error is told of only where one is significant", {
  model <- small_upgrade()$models[[1]]
  said <- function(model) {
    say <- function(text, .envir = parent.frame()) cli::format_inline(text, .envir = .envir)
    amiss:::report_model(model, amiss:::new_context(1, 1, list(), say = say))
  }
  expect_match(said(model), "discrepancy responds most to .?Gv")
  model$attribution$table$significant <- FALSE
  expect_match(said(model), "discrepancy shows no response to a boundary condition")
})
