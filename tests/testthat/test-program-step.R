# Programs one after the other.
skip_on_os("windows")

# A simulator of these steps, whose model writes hours and 20 + gain * Te below a line of comment.
chain <- function(..., output = program_output("stdout.txt", "Ti"),
                  cache = withr::local_tempdir(.local_envir = parent.frame()),
                  templates = list(model.awk = I(chain_rule)), more = list()) {
  do.call(program_simulator,
          c(list(list(...), free("gain", uniform(0, 2)), output = output, templates = templates,
                 boundary = "Te", cache = cache, name = "chain"), more))
}

chain_rule <- c("BEGIN { FS = \",\"; print \"# by awk\"; print \"hours Ti\" }",
                "NR > 1 { print $2, 20 + {{gain}} * $3 }")
simulate_step <- function(...) program_step("awk", "-f", "model.awk", "drivers.csv", ...)
te <- cbind(Te = c(4, 6, 5))

# What a chain's failed run says.
told_by <- function(simulator) {
  said <- NULL
  withCallingHandlers(simulate_runs(simulator, cbind(gain = 1), te, 1), warning = function(w) {
    said <<- gsub("\\s+", " ", cli::ansi_strip(conditionMessage(w)))
    invokeRestart("muffleWarning")
  })
  said
}

test_that("steps run one after the other in one folder, each with its input and its output", {
  program <- chain(
    simulate_step(stdout = "all.txt", makes = "all.txt"),
    program_step("sh", "-c",
                 "read f; awk -v f=$f '/^#/ { next } { print $2 == \"Ti\" ? $2 : f * $2 }' all.txt",
                 input = I("{{2 * gain:%.3f}}")))
  expect_equal(simulate_runs(program, cbind(gain = c(0.5, 1)), te, 1),
               cbind(20 + 0.5 * te[, 1], 2 * (20 + te[, 1])), ignore_attr = TRUE)
  expect_match(printed(program), "awk.*sh.*driven by Te.*s a run; 2 finished runs")
})

test_that("the input of a step is text, a file with placeholders, or a file of the run", {
  script <- withr::local_tempfile(lines = c("Ti", "{{gain}}", "7"))
  for (input in list(I(c("Ti", "{{gain}}", "7")), script)) {
    program <- chain(program_step("cat", input = input), templates = list())
    expect_equal(simulate_runs(program, cbind(gain = 0.5), te[1:2, , drop = FALSE], 1)[, 1],
                 c(0.5, 7))
  }
  program <- chain(simulate_step(stdout = "all.txt"), program_step("cat", input = "all.txt"))
  expect_equal(simulate_runs(program, cbind(gain = 1), te, 1)[, 1], 20 + te[, 1])
  expect_error(chain(program_step("cat", input = "nowhere.txt")), "nowhere.txt.*neither",
               class = "amiss_error_input")
})

test_that("the step that fails is named, with the end of what it and the one before wrote", {
  quiet <- program_step("sh", "-c", "echo no weather in climate.db; echo beware >&2")
  extract <- program_step("awk", "{ print }", "raw.csv")
  said <- told_by(chain(quiet, extract))
  expect_match(said, "step 2 of 2 \\(awk\\): it ended with exit status 2")
  expect_match(said, "End of standard error of step 2 \\(awk\\): .*raw.csv")
  expect_match(said, "End of standard output of step 1 \\(sh\\): no weather in climate.db")
  expect_match(said, "End of standard error of step 1 \\(sh\\): beware")
})

test_that("a program that exits with 0 fails by what it says, does not say or does not make", {
  say <- function(...)
    chain(program_step("sh", "-c", "echo no weather; echo log > l.txt", ...), simulate_step())
  expect_match(told_by(say(fails_if = "no [a-z]+er")),
               "step 1 of 2 \\(sh\\): its standard output says \"no weather\"")
  expect_match(told_by(say(fails_if = "^log$", log = "l.txt")), "its l.txt says \"log\"")
  expect_match(told_by(say(needs = "finished", log = "l.txt")),
               "End of l.txt of step 1 \\(sh\\): log")
  expect_match(told_by(say(needs = "finished")),
               "standard output and standard error.* does not say \"finished\"")
  expect_match(told_by(say(makes = c("l.txt", "house.res"))),
               "exit status 0 and wrote nothing into house.res")
  expect_match(told_by(chain(program_step("sh", "-c", "echo bad; exit 3", fails_if = "bad"))),
               "exit status 3; its standard output says \"bad\"")
  expect_null(told_by(say(needs = c("weather", "(?i)NO W"), fails_if = "error", makes = "l.txt")))
})

test_that("exit statuses, time limits and folders are those of a step", {
  expect_null(told_by(chain(program_step("sh", "-c", "exit 3", status = c(0, 3)), simulate_step())))
  expect_null(told_by(chain(program_step("sh", "-c", "exit 9", status = NULL), simulate_step())))
  expect_match(told_by(chain(program_step("sleep", "60", time_limit = 0.2), simulate_step())),
               "step 1 of 2 \\(sleep\\): it did not end within 0.2 s")
  inside <- chain(program_step("awk", "-f", "../model.awk", "../drivers.csv", folder = "cfg"))
  expect_equal(simulate_runs(inside, cbind(gain = 1), te, 1)[, 1], 20 + te[, 1])
})

test_that("a step that is checked in another way is another run", {
  log <- tempfile()
  note <- function(...)
    chain(program_step("sh", "-c", paste("echo ran >>", log), ...), simulate_step(), cache = cache)
  cache <- withr::local_tempdir()
  simulate_runs(note(), cbind(gain = 1), te, 1)
  simulate_runs(note(), cbind(gain = 1), te, 1)
  expect_length(readLines(log), 1)
  simulate_runs(note(time_limit = 100), cbind(gain = 1), te, 1)
  expect_length(readLines(log), 1)
  simulate_runs(note(fails_if = "bad"), cbind(gain = 1), te, 1)
  expect_length(readLines(log), 2)
})

test_that("what a person would type is shown", {
  step <- program_step("bps", "-file", "my house.cfg", "{{k}}", needs = "done")
  expect_identical(step_words_of(step), "bps -file 'my house.cfg' {{k}}")
  expect_match(printed(step), "bps -file 'my house.cfg' \\{\\{k\\}\\}.*must say done")
})

test_that("an unknown argument or pattern is refused", {
  expect_error(program_step("a", fail_if = "x"), "no argument `fail_if`",
               class = "amiss_error_input")
  expect_error(program_step("a", needs = "("), "no regular expression", class = "amiss_error_input")
  expect_error(program_step("a", 1), class = "amiss_error_input")
  expect_error(program_step("a", makes = "/tmp/x"), "run's directory", class = "amiss_error_input")
  expect_error(chain(program_step("cat"), 3), "Number 2 of `command`", class = "amiss_error_input")
  expect_error(chain(), class = "amiss_error_input")
  expect_error(simulate_runs(chain(program_step("no-such-program"), simulate_step()),
                             cbind(gain = 1), te, 1),
               "no-such-program.*not there", class = "amiss_error_input")
})

test_that("directories of good runs are kept, up to a number, and listed", {
  program <- chain(simulate_step(), more = list(keep = 2))
  simulate_runs(program, cbind(gain = c(0.1, 0.2, 0.3)), te, 1)
  folders <- dir(program$cache, "^kept-", full.names = TRUE)
  expect_length(folders, 2)
  expect_setequal(dir(folders[1]), c("drivers.csv", "model.awk", "stdout.txt", "stderr.txt"))
  expect_match(printed(program), "folder of a run: .*kept-")
  expect_lte(length(utils::capture.output(print(program))), 15)
  all <- chain(simulate_step(), more = list(keep = TRUE))
  simulate_runs(all, cbind(gain = c(0.1, 0.2, 0.3)), te, 1)
  expect_length(dir(all$cache, "^kept-"), 3)
})

test_that("runs that the cache has count like others, and are told apart", {
  hours <- 1:60
  record <- data.frame(hour = ifelse(hours > 30, hours + 5, hours), Te = 10 + 5 * sin(hours / 4))
  record$Ti <- 20 + 0.4 * record$Te + 0.1 * cos(hours * 1.7)
  m <- suppressWarnings(measurements(record, time = "hour", target = "Ti", boundary = ~Te,
                                     noise_sd = 0.1))
  expect_length(unique(m$segment), 2)
  program <- chain(simulate_step())
  spent <- function(gain, m) {
    before <- c(runs_so_far(), found_so_far())
    simulate_measured(program, cbind(gain = gain), m, "calibrate", 1)
    c(runs_so_far(), found_so_far()) - before
  }
  expect_equal(spent(c(0.1, 0.2), m), c(2, 0))
  expect_equal(spent(c(0.1, 0.2, 0.3), m), c(3, 2))
  unlink(dir(program$cache, "[.]rds$", full.names = TRUE)[1])  # one segment of one run
  expect_equal(spent(c(0.1, 0.2, 0.3), m), c(3, 2))
  context <- new_context(1, 1, list(), budget = 5)
  simulate_measured(program, cbind(gain = c(0.1, 0.2)), m, "calibrate", 1)
  expect_equal(c(runs_left(context), runs_found(context)), c(3, 2))
})
