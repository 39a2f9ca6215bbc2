# A thermal RC model in awk: time constant from a template, gain from an argument; it notes that it
# ran.
rc_lines <- c(
  "BEGIN { FS = \",\"; print \"hours,Ti\" }",
  paste("NR > 1 { x = NR == 2 ? $3 : x + (1 - exp(-1 / {{ lag }})) * ($3 - x);",
        "print $2 \",\" 20 + gain * x }"))

rc_log <- function() tempfile("log", fileext = ".txt")

rc_program <- function(cache = withr::local_tempdir(.local_envir = parent.frame()),
                       lines = rc_lines, log = rc_log(), ...) {
  lines <- c(lines, sprintf("END { print \"ran\" >> \"%s\" }", log))
  program_simulator(c("awk", "-v", "gain={{gain}}", "-v", "OFMT=%.15g", "-v", "CONVFMT=%.15g", "-f",
                      "model.awk", "drivers.csv"),
                    free("lag", uniform(2, 10), "h"), free("gain", uniform(0, 1)),
                    output = c(file = "stdout.txt", column = "Ti"),
                    templates = list(model.awk = I(lines)), boundary = "Te", cache = cache,
                    name = "rc", ...)
}

rc_function <- function() {
  function_simulator(
    function(values, drivers) 20 + values[["gain"]] * lagged(drivers[, "Te"], values[["lag"]]),
    free("lag", uniform(2, 10), "h"), free("gain", uniform(0, 1)), boundary = "Te")
}

rc_values <- cbind(lag = c(3, 5, 8), gain = c(0.2, 0.5, 0.9))
rc_drivers <- cbind(Te = 10 + 5 * sin(1:48 / 4))

test_that("a command may have no arguments", {
  made <- program_simulator("cat", free("a", uniform(0, 1)),
                            output = c(file = "stdout.txt", column = "a"),
                            templates = list("in.txt" = I("{{a}}")))
  expect_identical(made$command, "cat")
})

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
                             output = c(file = "stdout.txt", column = "Ti"),
                             templates = list(a.txt = I("{{a}}")))
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
    expect_warning(runs <- simulate_runs(rc_program(lines = c(rc_lines, line), ...), rc_values,
                                         rc_drivers, 1),
                   why, class = "amiss_warning_input")
    expect_true(all(is.nan(runs[, 2])))
    runs
  }
  only <- function(what) paste("NR == 5 && {{lag}} == 5 {", what, "}")
  runs <- fails(only("print \"no wall\" > \"/dev/stderr\"; exit 3"),
                "1 of 3.*Run 2.*exit status 3.*failed-.*no wall")
  expect_true(all(is.finite(runs[, -2])))
  expect_warning(simulate_runs(rc_program(lines = "BEGIN { } {{lag}} { }"), rc_values, rc_drivers,
                               1), "3 of 3.*wrote nothing")
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
  writeLines(c(sprintf("[ -e %s ] || { touch %s; exit 1; }", tried, tried),
               "echo Ti; echo 1; echo $1"), script)
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
  expect_error(rc_program(lines = "BEGIN {}"), "\"lag\" stands in no template",
               class = "amiss_error_input")
  expect_error(with_template(rc_program(), list(x.txt = I("a")), free("k", uniform(0, 1))),
               "\"k\" stands in no", class = "amiss_error_input")
  expect_error(with_template(rc_program(), list(x.txt = "nowhere")), "x.txt.*no file nowhere",
               class = "amiss_error_input")
})

test_that("a mechanism edits templates, and the extended program is calibrated", {
  skip_on_cran()  # second tier: tools/test --quick
  sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters.", edit = function(model) {
    with_template(model,
                  list(model.awk = function(lines) sub("gain * x", "gain * x + {{sun}} * $4", lines,
                                                       fixed = TRUE)),
                  free("sun", uniform(0, 0.02)), boundary = "Gv")
  })
  data <- small_record(120)
  data$Ti <- 20 + 0.4 * lagged(data$Te, 5) + 0.004 * data$Gv +
    withr::with_seed(2, stats::rnorm(120, 0, 0.05))
  m <- measurements(data, time = "time", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.05)
  extended <- amiss:::extend(rc_program(), sun)
  e <- simulate_design(extended, m, runs = 30, seed = 1)
  expect_equal(e$failed, 0)
  fit <- calibrate(train_emulator(e, m), m, c(quick_ais, check = 10), seed = 1)
  # the prior's mean is 0.01
  expect_equal(sum(fit$weights * fit$values[, "sun"]) / 0.004, 1, tolerance = 0.1)
})

test_that("the program is told the time of the record", {
  m <- measurements(small_record(48), time = "time", target = "Ti", boundary = ~Te, noise_sd = 0.05)
  seen <- tempfile()
  program <- rc_program(lines = c(rc_lines, sprintf("NR == 2 { print $1 > \"%s\" }", seen)))
  simulate_design(program, m, runs = 6, seed = 1)
  expect_identical(readLines(seen), "2024-03-01T01:00:00Z")
})

# Runs a shell script of the lines given as a program, three rows long: its output, or what is told
# of its failure.
shell_run <- function(..., cache = withr::local_tempdir(.local_envir = parent.frame()), rows = 3,
                      output = c(file = "stdout.txt", column = "Ti"), time_limit = 200) {
  skip_on_os("windows")
  program <- program_simulator(c("sh", "script.sh"), free("a", uniform(0, 2)), output = output,
                               cache = cache, templates = list(script.sh = I(c(..., "# {{a}}"))),
                               time_limit = time_limit, size_limit = 10)
  told <- NULL
  runs <- withCallingHandlers(simulate_runs(program, cbind(a = 1), matrix(0, rows, 0), 1),
                              warning = function(w) {
    told <<- gsub("\\s+", " ", conditionMessage(w))
    invokeRestart("muffleWarning")
  })
  if (is.null(told)) runs[, 1] else told
}

seconds <- function(code) system.time(code)[["elapsed"]]

good <- "printf 'Ti\\n1\\n2\\n3\\n'"

alive <- function(command)
  length(suppressWarnings(system2("pgrep", c("-f", shQuote(command)), stdout = TRUE))) > 0

test_that("a run ends with its program, and what that left in the background is stopped", {
  took <- seconds(expect_equal(shell_run("sleep 301 &", "(setsid sleep 302 &)", good), 1:3))
  expect_lt(took, 200)  # a tenth of a second on an idle machine; what is left behind takes 300
  for (wait in 1:50) if (alive("^sleep 30[12]$")) Sys.sleep(0.1)  # killed is not gone yet
  expect_false(alive("^sleep 30[12]$"))
})

test_that("what is starting at the moment when its program ends is stopped too", {
  skip_on_os("windows")
  # One look misses some of a hundred programs that replace themselves five times.
  script <- withr::local_tempfile(lines = "test $1 -gt 0 && exec sh $0 $(($1 - 1)); exec sleep 305")
  left <- paste("setsid sh", script, "5 &")
  kept <- lapply(1:100, function(run) {  # one that R has forgotten stops its tree itself
    process <- amiss:::start_process("sh", c("-c", left), cleanup_tree = TRUE)
    process$wait()
    amiss:::stop_tree(process)
    process
  })
  Sys.sleep(1)  # killed is not gone yet
  expect_false(alive("^sleep 305$"))
  expect_length(kept, 100)
})

test_that("processes that start from one seed at one second are not stopped together", {
  skip_on_os("windows")
  withr::local_seed(1)
  before <- .Random.seed
  start <- function() amiss:::with_seed(1, amiss:::start_process("sleep", "304"))
  Sys.sleep(1 - as.numeric(Sys.time()) %% 1)  # a second begins
  both <- list(start(), start())
  withr::defer(for (process in both) process$kill())
  both[[1]]$kill_tree()
  both[[1]]$wait(5000)
  expect_identical(vapply(both, function(process) process$is_alive(), NA), c(FALSE, TRUE))
  expect_identical(.Random.seed, before)
})

test_that("a program that writes without end is stopped, and little of it is kept", {
  cache <- withr::local_tempdir()
  expect_match(shell_run("yes", cache = cache), "wrote more than 10 MB")
  expect_match(shell_run("yes a > other.txt", cache = cache), "wrote more than 10 MB")
  files <- dir(cache, recursive = TRUE, full.names = TRUE)
  expect_lt(max(file.size(files)), 1.1e6)
  expect_match(shell_run("echo Ti; head -c 5000000 /dev/zero | tr '\\0' 1"),
               "5 MB, more than the 1 MB for 3 rows")
  expect_match(shell_run("echo Ti; head -c 1200000 /dev/zero | tr '\\0' 1"),
               "line 2 of stdout.txt is longer than 1 MB")
})

test_that("the time limit covers reading, and what has no end is not read", {
  forever <- function(directory) repeat NULL
  expect_match(shell_run(good, output = forever, time_limit = 1), "could not be read in time")
  reads <- function(directory) as.numeric(readLines(file.path(directory, "o.csv")))
  for (made in c("mkfifo o.csv", "ln -s /dev/zero o.csv", "ln -s /dev/stdin a; ln -s a o.csv")) {
    expect_match(shell_run(made, output = c(file = "o.csv", column = "Ti")),
                 "no regular file|wrote nothing")
    expect_match(shell_run(made, output = reads), "cannot open")
  }
})

test_that("a killed session stops its program, and the next call removes its folder", {
  skip_on_os("windows")
  cache <- withr::local_tempdir()
  code <- sprintf(
    "program <- amiss::program_simulator(c('sh', '-c', 'sleep 303; sleep {{a}}'), amiss::free('a',
    amiss::uniform(0, 1)), output = c(file = 'stdout.txt', column = 'a'), cache = '%s')
    amiss::simulate_runs(program, cbind(a = 1), matrix(0, 3, 0), 1)", cache)
  killed <- processx::process$new(file.path(R.home("bin"), "Rscript"), c("-e", code),
                                  env = c("current", R_LIBS = paste(.libPaths(), collapse = ":")))
  wait_until(function() alive("^sleep 303$"))
  expect_true(alive("^sleep 303$"))
  killed$signal(tools::SIGKILL)
  wait_until(function() !alive("^sleep 303$"))
  expect_false(alive("^sleep 303$"))
  expect_length(dir(cache, "^running-"), 2)
  expect_equal(shell_run(good, cache = cache), 1:3)
  expect_length(dir(cache, "^running-"), 0)
})

test_that("what is kept of runs is checked, and made again where it is bad", {
  log <- rc_log()
  program <- rc_program(log = log)
  runs <- simulate_runs(program, rc_values, rc_drivers, 1)
  files <- dir(program$cache, "[.]rds$", full.names = TRUE)
  key <- function(file) sub("[.]rds$", "", basename(file))
  whole <- readBin(files[1], "raw", 1e5)
  spoil <- list(
    cut = function(file) writeBin(whole[1:60], file), empty = function(file) file.create(file),
    plain = function(file) saveRDS(1:48 / 2, file),
    longer = function(file) store_value(1:49 / 2, file, key(file)),
    missing = function(file) store_value(c(NaN, 2:48), file, key(file)),
    text = function(file) store_value(letters, file, key(file)),
    another = function(file) file.copy(files[2], file, overwrite = TRUE))
  for (how in names(spoil)) {
    spoil[[how]](files[1])
    expect_message(again <- simulate_runs(program, rc_values, rc_drivers, 1), "done again",
                   class = "amiss_message_kept")
    expect_identical(again, runs, info = how)
  }
  expect_length(readLines(log), 3 + length(spoil))
  expect_no_message(simulate_runs(program, rc_values, rc_drivers, 1))
})

test_that(
  "a run that cannot be kept, or whose files cannot be written, is told and stops nothing", {
  stand_in(store_value = function(...) FALSE)
  expect_message(runs <- simulate_runs(rc_program(), rc_values, rc_drivers, 1), "could not be kept")
  expect_true(all(is.finite(runs)))
  stand_in(write_inputs = function(...) stop("its file a could not be written: is the disk full?"))
  expect_warning(runs <- simulate_runs(rc_program(), rc_values, rc_drivers, 1),
                 "3 of 3 .*is the disk full", class = "amiss_warning_input")
  expect_true(all(is.nan(runs)))
})

test_that("templates stay in the run's directory, each with a file of its own", {
  with <- function(...)
    program_simulator(c("cat", "{{a}}"), free("a", uniform(0, 1)), templates = list(...),
                      output = c(file = "o.csv", column = "b"), cache = tempfile())
  text <- I("x")
  bad <- c("../../x.txt", "..", ".", "a/", "/tmp/x", "a/../../b", "a//b", "./a", "~/x", "C:/x",
           "..\\x", "a\nb", "", "drivers.csv", "stdout.txt", "stderr.txt/x", strrep("a", 300))
  for (name in bad) {
    expect_error(do.call(with, stats::setNames(list(text), name)), class = "amiss_error_input",
                 info = name)
  }
  expect_error(with(a = text, "a/b" = text), "\"a\"|'a'", class = "amiss_error_input")
  expect_named(with("a/b.txt" = text, "a/c d.txt" = text, .x = text, "..y" = text)$templates)
  output <- function(file)
    program_simulator(c("cat", "{{a}}"), free("a", uniform(0, 1)), cache = tempfile(),
                      output = c(file = file, column = "b"))
  expect_error(output("../o.csv"), "run's directory", class = "amiss_error_input")
  expect_error(with_template(with(a = text), list("../b" = text)), "run's directory",
               class = "amiss_error_input")
})

test_that(
  "a file without a placeholder is copied byte for byte, and text of any encoding is filled in", {
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  at <- function(name) file.path(folder, name)
  writeBin(as.raw(c(0:255, 13, 10, 0, 13)), at("binary"))
  writeBin(charToRaw("a\r\nb\rc, no end"), at("text"))
  writeBin(c(charToRaw("T in "), as.raw(0xb0), charToRaw("C = {{a}}\n")), at("latin1"))
  program <- program_simulator(c("sh", "-c", "exit 1"), free("a", uniform(0, 1)),
                               cache = at("cache"), output = c(file = "o.csv", column = "b"),
                               templates = list(binary = at("binary"), "in/text" = at("text"),
                                                latin1 = at("latin1")))
  expect_warning(simulate_runs(program, cbind(a = 0.5), matrix(0, 3, 0), 1), "exit status 1")
  copied <- function(name)
    file_bytes(file.path(dir(at("cache"), "^failed", full.names = TRUE), name))
  expect_identical(copied("binary"), file_bytes(at("binary")))
  expect_identical(copied("in/text"), file_bytes(at("text")))
  expect_identical(copied("latin1"), c(charToRaw("T in "), as.raw(0xb0), charToRaw("C = 0.5\n")))
  expect_error(with_template(program, list(binary = identity)), "binary",
               class = "amiss_error_input")
  edited <- with_template(program, list("in/text" = function(lines) c(lines, "d")))
  expect_identical(edited$templates[["in/text"]], c("a", "b", "c, no end", "d"))
})

test_that("the columns of the drivers are distinguished whatever their names", {
  bytes <- csv_bytes(data.frame(time = 1, "a,\"b" = 0.5, check.names = FALSE))
  expect_identical(rawToChar(bytes), "time,\"a,\"\"b\"\n1,0.5\n")
  expect_named(utils::read.csv(text = rawToChar(bytes), check.names = FALSE), c("time", "a,\"b"))
})

# What is read of a CSV with these lines, or why it is not.
read_csv_lines <- function(..., column = "Ti", rows = 3) {
  folder <- withr::local_tempdir()
  writeLines(c(...), file.path(folder, "o.csv"), useBytes = TRUE)
  tryCatch(read_output(c(file = "o.csv", column = column), folder, rows), error = conditionMessage)
}

test_that("numbers of a program's output are read right", {
  expect_identical(read_csv_lines("h,Ti", "1,20", "2,20.5", "3,-1e3"), c(20, 20.5, -1000))
  expect_identical(read_csv_lines("Ti", "1.5D-03", "1.5d3", "-.25Q+2"), c(1.5e-3, 1500, -25))
  expect_identical(read_csv_lines("Ti", "1.5-103", "0.1+100", "+7."), c(1.5e-103, 1e99, 7))
  expect_identical(read_csv_lines("\"h\",\"T, in\"", "1, 2", "", "2,\"3\"", column = "T, in"),
                   c(2, 3))
  expect_identical(read_csv_lines("\ufeffTi,x,", "1,a,", "2,\"b,c\","), c(1, 2))
  expect_identical(read_csv_lines("T \xb0C,Ti\r", "1,2\r"), 2)
  expect_identical(read_csv_lines("Ti", "nan", "-Infinity", "1"), c(NaN, NaN, 1))
})

test_that("what is no number is refused with its line, the value and what to write", {
  expect_match(read_csv_lines("Ti", "1,5", "2,5"),
               "line 2 .*2 field.*1 name.*\"1,5\".*a point before decimals")
  expect_match(read_csv_lines("h,Ti", "1,1,5"), "line 2 .*3 field.*2 name.*\"1,1,5\"")
  expect_match(read_csv_lines("h,Ti", "1,2", "", "3"), "line 4 .*1 field.*one field for each name")
  expect_match(read_csv_lines("h,Ti", "1,\"1,5\""),
               "line 2 .*\"1,5\" in the column Ti.*a point before decimals")
  expect_match(read_csv_lines("h;Ti", "1;20"), "no column Ti.*commas between columns")
  expect_match(read_csv_lines("h,Ti", "1,2", "2,*****"), "line 3 .*\"\\*+\".*widen the format")
  expect_match(read_csv_lines("h,Ti", "h,degC", "1,2"), "line 2 .*\"degC\".*no units below")
  expect_match(read_csv_lines("h,Ti", "1,2", "2,"), "line 3 .*\"\".*a number in every row")
  expect_match(read_csv_lines("Ti,Ti", "1,2"), "several columns Ti")
  expect_match(read_csv_lines("h,Ti", "1,2", "2,\"3"), "line 3 .*a quote that does not end")
  for (word in c("0x1F", "1 2", "TRUE", "1.2.3", "1e", "--1", "1_000", "12:30"))
    expect_match(read_csv_lines("Ti", "1", word), "line 3 .*no number; write numbers only",
                 info = word)
  folder <- withr::local_tempdir()
  writeBin(as.raw(c(84, 105, 10, 49, 0, 10)), file.path(folder, "o.csv"))
  expect_error(read_output(c(file = "o.csv", column = "Ti"), folder, 1), "no text: line 2")
})
