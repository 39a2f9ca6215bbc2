# A thermal RC model in awk: time constant from a template, gain from an argument; it notes that it ran.
rc_lines <- c("BEGIN { FS = \",\"; print \"hours,Ti\" }",
              "NR > 1 { x = NR == 2 ? $3 : x + (1 - exp(-1 / {{ lag }})) * ($3 - x); print $2 \",\" 20 + gain * x }")

rc_log <- function() tempfile("log", fileext = ".txt")

rc_program <- function(cache = withr::local_tempdir(.local_envir = parent.frame()), lines = rc_lines, log = rc_log(),
                       ...) {
  lines <- c(lines, sprintf("END { print \"ran\" >> \"%s\" }", log))
  program_simulator(c("awk", "-v", "gain={{gain}}", "-v", "OFMT=%.15g", "-v", "CONVFMT=%.15g", "-f", "model.awk",
                      "drivers.csv"),
                    free("lag", uniform(2, 10), "h"), free("gain", uniform(0, 1)),
                    output = c(file = "stdout.txt", column = "Ti"), templates = list(model.awk = I(lines)),
                    boundary = "Te",
                    cache = cache, name = "rc", ...)
}

rc_function <- function() {
  function_simulator(function(values, drivers) 20 + values[["gain"]] * lagged(drivers[, "Te"], values[["lag"]]),
                     free("lag", uniform(2, 10), "h"), free("gain", uniform(0, 1)), boundary = "Te")
}

rc_values <- cbind(lag = c(3, 5, 8), gain = c(0.2, 0.5, 0.9))
rc_drivers <- cbind(Te = 10 + 5 * sin(1:48 / 4))

test_that("a program gives what the same function gives, and no run is made twice", {
  log <- rc_log()
  program <- rc_program(log = log)
  runs <- simulate_runs(program, rc_values, rc_drivers, 1)
  expect_equal(runs, simulate_runs(rc_function(), rc_values, rc_drivers, 1), tolerance = 1e-10)
  expect_identical(simulate_runs(program, rbind(rc_values, c(4, 0.1)), rc_drivers, 1)[, 1:3], runs)
  expect_length(readLines(log), 4)
  simulate_runs(program, rc_values, rc_drivers + 1, 1)
  expect_length(readLines(log), 7)
  expect_match(printed(program), "the program .*awk.* with 2 free parameters")
})

test_that("files of the working directory do not take the place of those that a run makes", {
  withr::local_dir(withr::local_tempdir())
  expected <- simulate_runs(rc_program(), rc_values, rc_drivers, 1)
  writeLines(c("time,hours,Te", "1,1,100"), "drivers.csv")
  writeLines("Ti", "stdout.txt")
  writeLines("BEGIN { exit 1 }", "model.awk")
  expect_identical(simulate_runs(rc_program(), rc_values, rc_drivers, 1), expected)
  named <- program_simulator(c("cat", "stdout.txt", "other.txt"), free("a", uniform(0, 1)),
                             output = c(file = "stdout.txt", column = "Ti"), templates = list(a.txt = I("{{a}}")))
  expect_identical(named$command, c("cat", "stdout.txt", "other.txt"))
})

test_that("runs in parallel are the same", {
  skip_on_cran()  # second tier: tools/test --quick
  skip_if_not_installed("future")
  serial <- simulate_runs(rc_program(), rc_values, rc_drivers, 1)
  withr::defer(future::plan(future::sequential))
  future::plan(future::multisession, workers = 2)
  expect_identical(simulate_runs(rc_program(), rc_values, rc_drivers, 1), serial)
})

test_that("failed runs are NaN, told with directory and stderr; the others are kept", {
  fails <- function(line, why, ...) {
    expect_warning(runs <- simulate_runs(rc_program(lines = c(rc_lines, line), ...), rc_values, rc_drivers, 1), why,
                   class = "amiss_warning_input")
    expect_true(all(is.nan(runs[, 2])))
    runs
  }
  only <- function(what) paste("NR == 5 && {{lag}} == 5 {", what, "}")
  runs <- fails(only("print \"no wall\" > \"/dev/stderr\"; exit 3"), "1 of 3.*Run 2.*exit status 3.*failed-.*no wall")
  expect_true(all(is.finite(runs[, -2])))
  expect_warning(simulate_runs(rc_program(lines = "BEGIN { } {{lag}} { }"), rc_values, rc_drivers, 1),
                 "3 of 3.*wrote nothing")
  missing <- rc_program()
  missing$command[1] <- "no-such-program"
  expect_error(simulate_runs(missing, rc_values, rc_drivers, 1), "no-such-program.*not there",
               class = "amiss_error_input")
  skip_on_cran()  # second tier: tools/test --quick
  fails(only("while (1) x = x"), "did not end within 0.5 s", time_limit = 0.5)
  fails(only("print \"1,nonsense\""), "line 6 .*\"nonsense\" in the column Ti")
  fails(only("print \"1,20\""), "49 rows, where 48")
  fails(only("getline; getline"), "46 rows, where 48")
})

test_that("a failed run is tried again, and a changed script runs anew", {
  tried <- tempfile()
  script <- withr::local_tempfile(fileext = ".sh")
  writeLines(c(sprintf("[ -e %s ] || { touch %s; exit 1; }", tried, tried), "echo Ti; echo 1; echo $1"), script)
  program <- program_simulator(c("sh", script, "{{a}}"), free("a", uniform(0, 2)), retries = 1,
                               cache = withr::local_tempdir(),
                               output = function(directory) as.numeric(
                                 readLines(file.path(directory, "stdout.txt"))[-1]))
  run <- function() simulate_runs(program, cbind(a = 1.5), matrix(0, 2, 0), 1)
  expect_equal(run(), cbind(c(1, 1.5)))
  writeLines("echo Ti; echo 7; echo $1", script)
  expect_equal(run(), cbind(c(7, 1.5)))
})

test_that("a placeholder and a parameter need each other", {
  expect_error(rc_program(lines = c(rc_lines, "# {{k}}")), "model.awk.*\"k\".*no parameter",
               class = "amiss_error_input")
  expect_error(rc_program(lines = "BEGIN {}"), "\"lag\" stands in no template", class = "amiss_error_input")
  expect_error(with_template(rc_program(), list(x.txt = I("a")), free("k", uniform(0, 1))), "\"k\" stands in no",
               class = "amiss_error_input")
  expect_error(with_template(rc_program(), list(x.txt = "nowhere")), "x.txt.*no file nowhere",
               class = "amiss_error_input")
})

test_that("a mechanism edits templates, and the extended program is calibrated", {
  skip_on_cran()  # second tier: tools/test --quick
  sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
    with_template(model,
                  list(model.awk = function(lines) sub("gain * x", "gain * x + {{sun}} * $4", lines, fixed = TRUE)),
                  free("sun", uniform(0, 0.02)), boundary = "Gv")
  })
  data <- small_record(120)
  data$Ti <- 20 + 0.4 * lagged(data$Te, 5) + 0.004 * data$Gv + withr::with_seed(2, stats::rnorm(120, 0, 0.05))
  m <- measurements(data, time = "time", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.05)
  extended <- amiss:::extend(rc_program(), sun)
  e <- simulate_design(extended, m, runs = 30, seed = 1)
  expect_equal(e$failed, 0)
  fit <- calibrate(train_emulator(e, m), m, c(quick_ais, check = 10), seed = 1)
  expect_equal(sum(fit$weights * fit$values[, "sun"]) / 0.004, 1, tolerance = 0.1)  # the prior's mean is 0.01
})

test_that("the program is told the time of the record", {
  m <- measurements(small_record(48), time = "time", target = "Ti", boundary = ~Te, noise_sd = 0.05)
  seen <- tempfile()
  program <- rc_program(lines = c(rc_lines, sprintf("NR == 2 { print $1 > \"%s\" }", seen)))
  simulate_design(program, m, runs = 6, seed = 1)
  expect_identical(readLines(seen), "2024-03-01T01:00:00Z")
})
