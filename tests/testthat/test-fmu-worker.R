# FMUs that crash, hang and fail take no run with them, and leave no process.
skip_without_fmus()
skip_on_os("windows")

faulty <- function(file, ...) house_fmu(file, free("fault", uniform(0, 10)), ...)

with_fault <- function(fault)
  cbind(R_out = seq(0.008, 0.012, length.out = length(fault)), fault = fault)

# The warnings of a call. It stands by itself: expect_match() evaluates its argument twice.
told_of <- function(code) {
  told <- NULL
  withCallingHandlers(code, warning = function(w) {
    told <<- c(told, gsub("\\s+", " ", conditionMessage(w)))
    invokeRestart("muffleWarning")
  })
  told
}

worker_of <- function(simulator) amiss:::fmu_workers[[amiss:::fmu_worker_key(simulator)]]

test_that("each way to fail is told, and the session and the next runs go on", {
  skip_on_cran()  # second tier: tools/test --quick
  file <- house_file()
  house <- faulty(file, time_limit = 5)
  why <- c("signal 6", "did not end within 1 s", "exit status 3", "signal 11",
           "not finite in row 1", "discarded the step at 0", "fatal error for the step")
  for (fault in seq_along(why)) {
    quick <- if (fault == 2) faulty(file, time_limit = 1) else house
    told <- told_of(runs <- simulate_runs(quick, with_fault(fault), house_drivers(3), 1))
    expect_match(told, paste0("1 of 1 run of \"house\" failed.*", why[fault]))
    expect_true(all(is.nan(runs)))
  }
  expect_true(all(is.finite(simulate_runs(house, with_fault(0), house_drivers(3), 1))))
  asks <- faulty(house_file(3))
  told <- told_of(simulate_runs(asks, with_fault(6), house_drivers(3), 1))
  expect_match(told, "asked to end the simulation")
})

test_that("a process that does not start says how it ended", {
  once <- faulty(house_file())
  amiss:::stop_fmu_worker(once)
  stand_in(fmu_start_limit = 0)
  told <- told_of(simulate_runs(once, with_fault(0), house_drivers(3), 1))
  expect_match(told, "could not be started: it did not answer within 0 s")
  # Nor one whose package cannot be loaded.
  stand_in(fmu_start_limit = 60, start_process = function(command, args, ...)
    processx::process$new(command, c("--vanilla", "-e", "stop('no package')"), ...))
  told <- told_of(simulate_runs(once, with_fault(0), house_drivers(3), 1))
  expect_match(told, "could not be started: its process ended with exit status 1. .*no package")
})

test_that("no run is lost that succeeds, and those that fail cost no process that need not end", {
  house <- faulty(house_file(), time_limit = 1)
  fault <- rep(0, 30)
  fault[c(4, 17)] <- 1
  fault[9] <- 2
  fault[c(12, 22)] <- 5
  told <- told_of(runs <- simulate_runs(house, with_fault(fault), house_drivers(12), 1))
  expect_match(told, "5 of 30 runs")
  expect_identical(which(is.nan(runs[1, ])), which(fault != 0))
  good <- house_fmu(house$file)
  expect_identical(runs[, fault == 0],
                   simulate_runs(good, with_fault(fault)[fault == 0, "R_out", drop = FALSE],
                                 house_drivers(12), 1))
  # The last process lives since run 18; those without a number did not end it.
  expect_identical(worker_of(house)$runs, 13 + sum(fault == 0))
  # A worker of a test before may be about to end.
  known <- function() {
    alive <- Filter(function(one) one$process$is_alive(), as.list(amiss:::fmu_workers))
    vapply(alive, function(one) one$process$get_pid(), 0L)
  }
  wait_until(function() setequal(fmu_processes(), known()))
  expect_setequal(fmu_processes(), known())
})

test_that("a failed run is tried again in a new process, and a finished one is kept", {
  house <- faulty(house_file(), cache = withr::local_tempdir(), retries = 1)
  told <- told_of(simulate_runs(house, with_fault(c(1, 0)), house_drivers(3), 1))
  expect_match(told, "1 of 2 runs")
  expect_identical(worker_of(house)$runs, 1)
  runs <- simulate_runs(house, with_fault(c(1, 0))[2, , drop = FALSE], house_drivers(3), 1)
  expect_identical(worker_of(house)$runs, 1)
  expect_true(all(is.finite(runs)))
  simulate_runs(house, with_fault(c(1, 0))[2, , drop = FALSE], house_drivers(3) + 1, 1)
  expect_identical(worker_of(house)$runs, 2)
})

test_that("an FMU that is not to be instantiated twice has a process for each run", {
  once <- function(lines)
    sub("<CoSimulation", "<CoSimulation canBeInstantiatedOnlyOncePerProcess=\"true\"", lines)
  house <- house_fmu(house_file(2, once))
  expect_true(
    all(is.finite(simulate_runs(house, cbind(R_out = c(0.01, 0.011)), house_drivers(3), 1))))
  expect_null(worker_of(house))
})

test_that("an FMU whose resource is missing says so", {
  for (version in 2:3) {
    house <- house_fmu(house_file(version, resources = list()))
    told <- told_of(simulate_runs(house, cbind(R_out = 0.01), house_drivers(3), 1))
    expect_match(told, "could not be instantiated.*Its last words: no start in")
  }
})

test_that("an FMU that fills the disk is stopped", {
  house <- faulty(house_file(), size_limit = 1, time_limit = 20)
  told <- told_of(simulate_runs(house, with_fault(8), house_drivers(3), 1))
  expect_match(told, "wrote more than 1 MB")
})

test_that("what an FMU prints does not disturb the answer, and is part of the warning", {
  house <- faulty(house_file())
  expect_true(all(is.finite(simulate_runs(house, with_fault(9), house_drivers(3), 1))))
  told <- told_of(simulate_runs(house, with_fault(9.5), house_drivers(3), 1))
  expect_match(told, "exit status 3.*answered 1")
})

# A session whose FMU does not return, when it is there: it has written a file by then.
hanging_session <- function(file, frame = parent.frame()) {
  folder <- withr::local_tempdir(.local_envir = frame)
  code <- sprintf("library(amiss)
    house <- fmu_simulator('%s', free('fault', uniform(0, 10)), output = 'T_air', time_limit = 500)
    simulate_runs(house, cbind(fault = 8), matrix(0, 3, 0), 1)", file)
  session <- processx::process$new(
    file.path(R.home("bin"), "Rscript"), c("-e", code), stdout = "|", stderr = "2>&1",
    env = c("current", R_LIBS = paste(.libPaths(), collapse = ":"), TMPDIR = folder))
  withr::defer(session$kill_tree(), envir = frame)
  wait_until(function() length(dir(folder, "^filled[.]txt$", recursive = TRUE)) > 0)
  session
}

test_that("a session that is killed, interrupted or ended leaves no process", {
  skip_on_cran()  # second tier: tools/test --quick
  file <- house_file()
  for (signal in c(tools::SIGKILL, tools::SIGINT, tools::SIGTERM)) {
    session <- hanging_session(file)
    pid <- session$get_pid()
    expect_length(fmu_processes(pid), 1)
    session$signal(signal)
    wait_until(function() !length(fmu_processes(pid)))
    expect_length(fmu_processes(pid), 0)
  }
})
