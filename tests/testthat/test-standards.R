# Standards for statistical software (inst/standards.md) that no other test shows.

test_that(paste("columns with a class of their own are numbers, others are refused if they are",
                "needed (G2.6, G2.11, G2.12)"), {
  table <- linear_data(60)
  plain <- linear_measurements(table)
  # As package units has them: a class that is no vector's, and an attribute.
  with_units <- table
  with_units$Te <- structure(table$Te, class = "units",
                             units = structure(list(numerator = "degC", denominator = ""),
                                               class = "symbolic_units"))
  expect_equal(linear_measurements(with_units)[c("y", "boundary", "hours")],
               plain[c("y", "boundary", "hours")])
  aside <- table
  aside$note <- as.list(seq_len(60))
  expect_equal(linear_measurements(aside)$boundary, plain$boundary)
  for (strange in list(as.list, factor, function(x) x + 0i)) {
    needed <- table
    needed$Te <- strange(table$Te)
    expect_error(linear_measurements(needed), "\"Te\" is not numeric", class = "amiss_error_input")
  }
})

test_that("a table of any class is the same record (G2.7, G2.10)", {
  table <- linear_data(60)
  plain <- linear_measurements(table)
  as_other <- c(tibble = "as_tibble", data.table = "as.data.table")
  for (package in names(as_other)) {
    if (!nzchar(system.file(package = package))) next
    other <- getExportedValue(package, as_other[[package]])(table)
    expect_equal(linear_measurements(other)[c("y", "boundary")], plain[c("y", "boundary")])
  }
})

test_that(paste("without information the posterior is the prior, with it the known posterior",
                "(BS7.0, BS7.1, BS7.2)"), {
  priors <- list(a = normal(3, 2), b = uniform(-1, 5))
  moments <- function(result) {
    mean <- colSums(result$weights * result$draws)
    rbind(mean = mean, sd = sqrt(colSums(result$weights * sweep(result$draws, 2, mean)^2)))
  }
  nothing <- ais(function(z) numeric(nrow(z)), priors, seed = 1)
  expect_equal(nothing$log_evidence, 0, tolerance = 0.01)
  # Within three standard errors of a mean of some 250 draws.
  expect_equal(moments(nothing), cbind(a = c(mean = 3, sd = 2), b = c(2, 6 / sqrt(12))),
               tolerance = 0.2)
  # Ten readings of mean 4 and unit variance: the conjugate posterior of `a`; `b` keeps its prior.
  y <- 4 + stats::qnorm(stats::ppoints(10))
  known <- ais(function(z) vapply(z[, "a"], function(a) sum(stats::dnorm(y, a, 1, log = TRUE)), 0),
               priors, seed = 1)
  precision <- 1 / 4 + 10
  expect_equal(moments(known),
               cbind(a = c(mean = (3 / 4 + sum(y)) / precision, sd = 1 / sqrt(precision)),
                     b = c(2, 6 / sqrt(12))), tolerance = 0.1)
})

test_that("neither trivial noise nor another seed changes what a calibration finds (G5.9)", {
  fit_of <- function(data, seed) {
    m <- linear_measurements(data)
    calibrate(train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = seed), m), m,
              quick_ais, seed = seed)
  }
  data <- linear_data(120)
  fit <- fit_of(data, 1)
  touched <- data
  touched$Ti <- touched$Ti * (1 + .Machine$double.eps * rep(c(-1, 1), 60))
  sd <- sqrt(diag(vcov(fit)))
  for (other in list(fit_of(touched, 1), fit_of(data, 2))) {
    # A median of some hundred draws has an error of 0.13 of the posterior's standard deviation:
    # three of a difference.
    expect_lt(max(abs(coef(other) - coef(fit)) / sd), 0.55)
    expect_lt(abs(other$log_evidence - fit$log_evidence),
              4 * sqrt(fit$standard_error^2 + other$standard_error^2) + 1e-6)
  }
})

test_that("fitted values and predictions are of the record's scale, whatever its origin (BS7.4)", {
  for (origin in c(0, 500)) {
    data <- linear_data(120)
    data$Ti <- data$Ti + origin
    model <- function_simulator(
      function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
      free("offset", uniform(origin + 10, origin + 30)), free("gain", uniform(0, 1)),
      boundary = "Te")
    m <- linear_measurements(data)
    fit <- calibrate(train_emulator(simulate_design(model, m, runs = 30, seed = 1), m), m,
                     quick_ais, seed = 1)
    expect_lt(sqrt(mean((fitted(fit) - data$Ti)^2)), 0.15)
    expect_lt(sqrt(mean((predict(fit)$mean - data$Ti)^2)), 0.15)
    expect_false(anyNA(fitted(fit)))
  }
})
