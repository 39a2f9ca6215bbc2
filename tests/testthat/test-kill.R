# A study that is killed leaves nothing half-written under the names of its results, and goes on to
# the same ones.
skip_on_cran()  # second tier: tools/test --quick
skip_on_os("windows")

kill_study <- function(folder) {
  data <- linear_data()
  data$Ti <- data$Ti + 0.002 * data$Gv
  utils::write.csv(data, file.path(folder, "data.csv"), row.names = FALSE)
  # Slow enough that there is something to kill.
  writeLines("function_simulator(function(values, drivers) {
                Sys.sleep(0.01)
                values[['offset']] + 0.4 * drivers[, 'Te']
              }, free('offset', uniform(10, 30), 'K'), boundary = 'Te', name = 'linear')",
             file.path(folder, "model.R"))
  writeLines("catalogue(mechanism('sun', boundary = 'Gv', sentence = 'The sun shines in.',
                edit = function(model)
                  with_parameters(model, free('sun', uniform(0, 0.01)), boundary = 'Gv',
                    f = function(values, drivers, base)
                      base(values) + values[['sun']] * drivers[, 'Gv'])))",
             file.path(folder, "catalogue.R"))
  path <- file.path(folder, "study.yml")
  yaml::write_yaml(list(study = "killed", data = "data.csv", time = "hour", target = "Ti",
                        boundary = list("Te", "Gv"), noise_sd = 0.1, calibrate = "hour <= 180",
                        validate = "hour > 180", model = "model.R", catalogue = "catalogue.R",
                        runs = 60, seed = 4,
                        control = list(max_steps = 1, attribution = list(surrogates = 199))),
                   path)
  path
}

# Changes made to the package in another session: a report and figures that take no time, and more.
quick_parts <- list(
  report =
    "function(x, file, ...) writeLines(c(rep('a line of the report', 1e5), '</html>'), file)",
  save_figure = "function(figure, path, ...) writeLines(rep('a figure', 1e4), path)")

# Killed when the first of its results is in place, or the first of earlier ones moved aside.
killed_moving <- list(move_files = "function(names, from, to, ...) {
  file.rename(file.path(from, names[1]), file.path(to, names[1]))
  tools::pskill(Sys.getpid(), tools::SIGKILL)
  Sys.sleep(60)
}")

r_process <- function(folder, arguments, parts = quick_parts) {
  profile <- tempfile("profile-", folder)
  changes <- sprintf("utils::assignInNamespace('%s', %s, 'amiss')", names(parts), parts)
  writeLines(c("setHook(packageEvent('amiss', 'onLoad'), function(...) {", changes, "})"), profile)
  processx::process$new(
    file.path(R.home("bin"), "Rscript"), arguments, stdout = "|", stderr = "2>&1",
    env = c("current", R_LIBS = paste(.libPaths(), collapse = ":"), R_PROFILE_USER = profile))
}

run_command_on <- function(study, out, parts = quick_parts) {
  r_process(dirname(study), c(system.file("exec", "amiss", package = "amiss"), "run", study,
                              "--out", out, "--trust", "--quiet"), parts)
}

# What a run found, without how long it took.
found <- function(out) {
  result <- jsonlite::read_json(file.path(out, "result.json"))
  result$wall_s <- NULL
  result
}

result_names <- c("figures", "report.html", "result.json", "result.rds")

# Whatever stands under the name of a result is whole.
expect_whole <- function(out, reference) {
  there <- intersect(dir(out), result_names)
  if ("result.json" %in% there) expect_identical(found(out), reference)
  if ("result.rds" %in% there)
    expect_s3_class(readRDS(file.path(out, "result.rds")), "amiss_upgrade")
  if ("report.html" %in% there)
    expect_match(readLines(file.path(out, "report.html")), "</html>", all = FALSE)
  if ("figures" %in% there)
    expect_true(all(file.size(dir(file.path(out, "figures"), full.names = TRUE)) > 0))
}

test_that("a study killed at any moment goes on to the result of one that was left alone", {
  folder <- withr::local_tempdir()
  study <- kill_study(folder)
  alone <- file.path(folder, "alone")
  seconds <- system.time(run_command_on(study, alone)$wait())[["elapsed"]]
  reference <- found(alone)
  out <- file.path(folder, "killed")
  signals <- c(tools::SIGKILL, tools::SIGTERM, tools::SIGINT, tools::SIGKILL)
  moments <- withr::with_seed(1, stats::runif(length(signals), 0.2, 0.9)) * seconds
  for (k in seq_along(signals)) {
    run <- run_command_on(study, out)
    run$wait(1000 * moments[k])
    run$signal(signals[k])
    run$wait(10000)
    expect_false(run$is_alive())
    expect_whole(out, reference)
  }
  run_command_on(study, out, c(quick_parts, killed_moving))$wait()
  expect_true(length(intersect(dir(out), result_names)) %in% 1:3)
  expect_whole(out, reference)
  last <- run_command_on(study, out)
  last$wait()
  expect_identical(last$get_exit_status(), 0L)
  expect_identical(found(out), reference)
  expect_setequal(grep("^earlier-", dir(out, all.files = TRUE, no.. = TRUE), value = TRUE,
                       invert = TRUE), result_names)
})

# Runs the study again and again until it is not interrupted, and looks each time whether the
# session is as before. An interrupt that comes late, between two runs, waits for the next.
interrupted_session <- "
  out <- commandArgs(TRUE)[2]
  state <- function() list(getwd(), options('warn', 'digits', 'OutDec', 'amiss.allow_large'),
                           RNGkind(), sink.number(), sink.number('message'),
                           grDevices::dev.list(), nrow(showConnections()), search())
  invisible(loadNamespace('amiss'))
  tryCatch(suspendInterrupts(repeat {
    before <- state()
    cat('begins\\n')
    ended <- tryCatch({
      allowInterrupts(amiss::run_study(commandArgs(TRUE)[1], out, quiet = TRUE, trust = TRUE))
      'whole'
    }, interrupt = function(e) 'interrupted')
    changed <- which(!mapply(identical, state(), before))
    left <- dir(out, '^[.]amiss|^amiss-new', all.files = TRUE)
    cat(ended, length(changed), length(left), '\\n')
    if (ended == 'whole') break
  }), interrupt = function(e) NULL)"

test_that("a session in which a study was interrupted is as it was, and can go on", {
  folder <- withr::local_tempdir()
  study <- kill_study(folder)
  out <- file.path(folder, "out")
  script <- file.path(folder, "session.R")
  writeLines(interrupted_session, script)
  session <- r_process(folder, c(script, study, out))
  moments <- withr::with_seed(2, stats::runif(3, 0.2, 4))
  said <- character()
  next_line <- function() {
    while (!length(line <- session$read_output_lines(1)) && session$is_incomplete_output())
      session$poll_io(1000)
    said <<- c(said, line)
    line
  }
  while (length(line <- next_line())) {
    if (line != "begins" || !length(moments)) next
    # A study that has ended before the moment is not interrupted: the session itself would be.
    still_runs <- session$poll_io(round(1000 * moments[1]))[["output"]] == "timeout"
    moments <- moments[-1]
    if (still_runs) session$interrupt()
  }
  told <- said[!said %in% c("begins", "")]
  expect_identical(unique(told), c("interrupted 0 0 ", "whole 0 0 "))
  expect_identical(session$get_exit_status(), 0L)
  expect_setequal(dir(out), result_names)
})
