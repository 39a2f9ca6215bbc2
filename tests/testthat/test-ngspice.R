# A real program with a measured record: a thermal network in ngspice, driven by what was measured
# in house O5.
skip_on_cran()
skip_if(Sys.which("ngspice") == "", "ngspice is not installed")

folder <- system.file("examples", "ngspice", package = "amiss")

test_that("the network that ngspice solves is the one that is meant", {
  # One capacity beside a conductance of 1 / 2000 K/W, with time constant C / h = 2 h, in steps of
  # 10 minutes.
  circuit <- c("* test", ".include drivers.inc", "Cair air 0 {{c}}", "Gout air Te air Te 100",
               ".ic v(air)={Te_first+10}", ".control", "run", "linearize v(air)",
               "wrdata out.txt v(air)", "quit", ".endc", ".end")
  network <- program_simulator(
    c("sh", "run.sh"), free("c", uniform(1e5, 1e6)), boundary = "Te",
    templates = list(room.cir = I(circuit), run.sh = file.path(folder, "run.sh")),
    output = function(directory) utils::read.table(file.path(directory, "out.txt"))[-1, 2],
    cache = withr::local_tempdir())
  runs <- simulate_runs(network, cbind(c = 7.2e5), cbind(Te = rep(0:1, c(12, 24))), step_h = 1 / 6)
  hours <- 1:36 / 6
  expected <- ifelse(hours <= 2, 10 * exp(-hours / 2),
                     1 - (1 - 10 * exp(-1)) * exp(-(hours - 2) / 2))
  expect_lt(max(abs(runs - expected)), 0.05)  # a jump of 1 K within a step of 10 minutes is 0.08 K
})

test_that("the sun of house O5 is found in a network that knows of none, and the gain measured", {
  skip_if_not(identical(Sys.getenv("AMISS_EXTENDED_TESTS"), "true"),
              "the long forms (AMISS_EXTENDED_TESTS)")
  if (.Platform$OS.type == "unix") {
    future::plan("multicore", workers = 2)
    withr::defer(future::plan("sequential"))
  }
  example <- new.env()
  utils::capture.output(suppressMessages(source(file.path(folder, "twinhouse.R"), local = example)))
  upgrade <- example$upgrade
  expect_equal(upgrade$models[[2]]$mechanism, "south sun")
  expect_gt(upgrade$candidates$log10_bf[upgrade$candidates$mechanism == "south sun"], 4)
  expect_lt(upgrade$gain$rmse_validation[2], 0.6 * upgrade$gain$rmse_validation[1])
})
