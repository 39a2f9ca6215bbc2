# FMUs that others made: the Reference FMUs of the Modelica Association
# (github.com/modelica/Reference-FMUs), in the folder AMISS_REFERENCE_FMUS as a release has them:
# 2.0/Dahlquist.fmu, 3.0/Dahlquist.fmu and so on.
skip_on_cran()  # second tier: tools/test --quick
skip_if_not_installed("xml2")
reference_fmus <- Sys.getenv("AMISS_REFERENCE_FMUS")
skip_if_not(dir.exists(reference_fmus), "AMISS_REFERENCE_FMUS: a folder of Reference FMUs")

reference <- function(version, name) file.path(reference_fmus, version, paste0(name, ".fmu"))

ends <- function(simulator, values, drivers, step_s) {
  simulator$averaged <- FALSE
  simulate_runs(simulator, values, drivers, step_s / 3600)[, 1]
}

test_that(paste("Dahlquist and Van der Pol give their steps of forward Euler, a tenth and a",
                "hundredth of a second long"), {
  for (version in c("2.0", "3.0")) {
    dahlquist <- fmu_simulator(reference(version, "Dahlquist"), free("k", uniform(0.1, 2)),
                               output = "x")
    expect_equal(ends(dahlquist, cbind(k = 0.5), matrix(0, 10, 0), 1), 0.95^(10 * 1:10),
                 tolerance = 1e-12)
    pol <- fmu_simulator(reference(version, "VanDerPol"), free("mu", uniform(0.1, 3)),
                         output = "x0")
    x <- c(2, 0)
    expected <- vapply(1:20, function(row) {
      for (step in 1:100) x <<- x + 0.01 * c(x[2], (1 - x[1]^2) * x[2] - x[1])
      x[1]
    }, 0)
    expect_equal(ends(pol, cbind(mu = 1), matrix(0, 20, 0), 1), expected, tolerance = 1e-12)
  }
})

test_that("Feedthrough gives what it is given, of each type", {
  for (version in c("2.0", "3.0")) {
    for (type in c("Float64_continuous", "Float64_discrete", "Int32", "Boolean", "Enumeration")) {
      through <- fmu_simulator(
        reference(version, "Feedthrough"), free("Float64_fixed_parameter", uniform(0, 1)),
        output = paste0(type, "_output"), inputs = c(a = paste0(type, "_input")))
      given <- if (type %in% c("Boolean", "Enumeration")) c(1, 1, 0) else c(2, -5, 7)
      given <- if (type == "Enumeration") given + 1 else given
      expect_identical(ends(through, cbind(Float64_fixed_parameter = 0.5), cbind(a = given), 1),
                       given)
    }
  }
})

test_that("the ball bounces", {
  for (version in c("2.0", "3.0")) {
    ball <- fmu_simulator(reference(version, "BouncingBall"), free("e", uniform(0.5, 0.99)),
                          output = "h")
    height <- ends(ball, cbind(e = 0.7), matrix(0, 10, 0), 0.1)
    # before the first bounce, by steps of 10 ms
    expect_equal(height[4], 1 - 9.81 / 2 * 0.4^2, tolerance = 0.02)
    expect_gt(height[8], height[5])                                  # after it
  }
})
