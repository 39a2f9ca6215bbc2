# What is measured responds linearly to Tn, of which the simulator knows nothing.
hidden <- withr::with_seed(6, as.numeric(stats::filter(rnorm(480), 0.9, "recursive")))
lacking <- made_once(function(reach = c(13, 300, Inf), ...) {
  data <- linear_data(480)
  data$Tn <- hidden
  data$Ti <- data$Ti + 0.3 * lagged(hidden, 3)
  m <- linear_measurements(data, boundary = c("Te", "Gv", "Tn"), calibrate = data$hour <= 320,
                           validate = data$hour > 320)
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 30, seed = 3), m)
  calibrate(emulator, m, c(quick_ais, list(reach = reach), ...), seed = 3)
})

scores <- function(p) amiss:::prediction_scores(p)$validate

test_that(
  "the discrepancy carried along lowers the error of held-out rows, and its band is honest", {
  for (reach in list(c(13, 300, Inf), Inf)) {
    fit <- lacking(reach)
    without <- scores(predict(fit))
    with <- scores(predict(fit, discrepancy = TRUE))
    # The response is 0.45 K, the noise 0.1 K: its RMS over 160 values has an error of 6 %.
    expect_gt(without[["rmse"]], 0.4)
    expect_lt(with[["rmse"]], 0.13)
    expect_lt(with[["crps"]], 0.4 * without[["crps"]])
    # 160 errors about 95 %: below 0.85 or all of them are far from it.
    expect_gt(with[["coverage95"]], 0.85)
    expect_lte(with[["coverage95"]], 1)
  }
})

test_that("the band with a discrepancy is not as wide as without", {
  fit <- lacking()
  width <- function(p) mean(p$upper95 - p$lower95)
  with <- width(predict(fit, use = "validate", discrepancy = TRUE))
  expect_lt(with, 0.5 * width(predict(fit, use = "validate")))
  expect_gt(with, 2 * 1.96 * 0.1 * 0.9)  # no less than the noise
})

test_that("only held-out measurements' conditions are used, not their values", {
  fit <- lacking()
  spoilt <- fit
  held <- spoilt$measurements$use == "validate"
  spoilt$measurements$y[held] <- 1e3
  expect_identical(predict(spoilt, use = "validate", discrepancy = TRUE)$mean,
                   predict(fit, use = "validate", discrepancy = TRUE)$mean)
})

test_that("how the simulator moves at other rows is told by the same runs", {
  fit <- lacking()
  moves <- unname(amiss:::simulator_moves(fit$emulator))
  expect_equal(amiss:::moves_at(fit, "calibrate", 1), moves, tolerance = 1e-10)
  both <- amiss:::moves_at(fit, c("calibrate", "validate"), 1)
  expect_equal(both[1:320, ], moves, tolerance = 1e-10)
  # The space of offset and gain: the vectors of all rows lie in it as well.
  expect_lt(max(abs(stats::lm.fit(cbind(1, linear_data(480)$Te), both)$residuals)),
            1e-8 * max(abs(both)))
})

test_that("so it is of an emulator of a region, whose mean is the simulator's tangent", {
  data <- linear_data(120)
  data$Ti <- bent_run(c(a = 0.6, b = 0.8), as.matrix(data[c("Te", "Gv")]))
  m <- linear_measurements(data, noise_sd = 0.05, calibrate = data$hour <= 80,
                           validate = data$hour > 80)
  runs <- simulate_design(bent_simulator(), m, runs = 8, seed = 1)
  fit <- calibrate_refined(runs, m, control = list(calibration = quick_ais), seed = 1, quiet = TRUE)
  moves <- fit$emulator$moves
  space <- amiss:::coordinates_of(fit$emulator$parameters)
  exact <- vapply(1:2, function(j) {
    run <- function(step) {
      unit <- amiss:::to_unit(rbind(replace(moves$z, j, moves$z[j] + step)), space)
      values <- amiss:::unit_to_values(unit, fit$emulator$parameters)
      amiss:::simulate_measured(bent_simulator(), values, m, "calibrate", 1)[, 1]
    }
    (run(1e-5) - run(-1e-5)) / 2e-5 * moves$unit[j]
  }, numeric(80))
  # The runs in the region correct the differences by which they were taken.
  expect_equal(moves$root, exact, tolerance = 1e-5)
  # Differences of 0.05 standard deviations on both sides are right to about its square.
  expect_equal(amiss:::moves_at(fit, "calibrate", 1), exact, tolerance = 2.5e-3)
  both <- amiss:::moves_at(fit, c("calibrate", "validate"), 1)
  expect_equal(both[1:80, ], exact, tolerance = 2.5e-3)
})

test_that("runs that fail at other rows are left out of its moves there", {
  fit <- lacking()
  fragile <- fit
  fragile$emulator$simulator <- function_simulator(function(values, drivers) {
    if (values[["gain"]] > 0.9 && nrow(drivers) > 320) stop("too hot")
    values[["offset"]] + values[["gain"]] * drivers[, "Te"]
  }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te")
  expect_no_warning(own <- amiss:::moves_at(fragile, "validate", 1))
  expect_equal(own, amiss:::moves_at(fit, "validate", 1), tolerance = 1e-8)
  never <- fit
  never$emulator$simulator <- function_simulator(function(values, drivers) NaN * drivers[, 1],
                                                 free("offset", uniform(10, 30), "K"),
                                                 free("gain", uniform(0, 1)), boundary = "Te")
  expect_error(amiss:::moves_at(never, "validate", 1), "failed at 30 of the ensemble's 30 runs",
               class = "amiss_error_numerical")
})

test_that("the discrepancy is the whole response that the model lacks", {
  truth <- 0.3 * lagged(hidden, 3)[1:320]
  fit <- lacking(Inf)
  own <- discrepancy(fit)$series
  # But for its level, which the simulator's offset takes. The filter bank's time constants are 2
  # and 4 h, that of the truth 3 h.
  expect_lt(sd(own$discrepancy - truth), 0.05 * sd(truth))
  expect_true(all(own$lower95 <= own$discrepancy & own$discrepancy <= own$upper95))
  for (reach in list(Inf, c(13, 300, Inf))) {
    own <- discrepancy(lacking(reach))$series
    # Where it keeps out of the parameters' way they take a part. Both together are what was made,
    # to a third of the noise.
    made <- 20 + 0.4 * linear_data(480)$Te[1:320] + truth
    expect_lt(sqrt(mean((own$simulated + own$discrepancy - made)^2)), 0.1 / 3)
    expect_equal(own$residual, own$observed - own$simulated)
  }
})

test_that("each condition's response is told, and their sum is the discrepancy", {
  for (reach in c(13, Inf)) {  # kept out of the parameters' way, and free
    own <- discrepancy(lacking(reach))
    expect_identical(colnames(own$responses), c("Te", "Gv", "Tn"))
    expect_equal(rowSums(own$responses), own$series$discrepancy, tolerance = 1e-8)
  }
  expect_gt(cor(own$responses[, "Tn"], lagged(hidden, 3)[1:320]), 0.99)
})

test_that("where nothing lacks, nothing is carried", {
  data <- linear_data()
  fit <- linear_fit(linear_measurements(data, calibrate = data$hour <= 160,
                                        validate = data$hour > 160))
  with <- predict(fit, use = "validate", discrepancy = TRUE)
  # A sixth of the noise of 0.1 K.
  expect_lt(max(abs(with$mean - predict(fit, use = "validate")$mean)), 0.1 / 6)
})

test_that("what cannot be carried is refused", {
  m <- linear_measurements(linear_data(60))
  emulator <- train_emulator(simulate_design(linear_simulator(), m, runs = 20, seed = 3), m)
  paper <- calibrate_paper(emulator, m,
                           list(ais = list(pilot_chains = 24, groups = 4, chains = 12)), seed = 1)
  expect_error(predict(paper, discrepancy = TRUE), "needs a fit of `calibrate\\(\\)`",
               class = "amiss_error_input")
  expect_s3_class(predict(paper, use = "calibrate"), "data.frame")
  expect_error(predict(lacking(), discrepancy = "yes"), "discrepancy", class = "amiss_error_input")
  expect_error(predict(plain_linear_fit(), use = "validate"), "no row", class = "amiss_error_input")
})

as_new <- function(data) data.frame(time = data$hour, data[setdiff(names(data), "hour")])

test_that("a data frame is predicted as the rows of the record are", {
  fit <- lacking()
  data <- linear_data(480)
  data$Tn <- hidden
  data$Ti <- fit$measurements$y
  for (discrepancy in c(FALSE, TRUE)) {
    own <- predict(fit, as_new(data), discrepancy = discrepancy)
    known <- predict(fit, discrepancy = discrepancy)
    expect_equal(own[names(own) != "use"], known[names(known) != "use"], tolerance = 1e-8)
  }
  expect_identical(predict(fit, fit$measurements, use = "validate"), predict(fit, use = "validate"))
  blind <- predict(fit, as_new(data[names(data) != "Ti"]))
  expect_true(all(is.na(blind$observed)) && all(is.na(blind$crps)))
  expect_identical(blind$mean, predict(fit, as_new(data))$mean)
})

test_that("averages and directions of a data frame are those of measurements()", {
  data <- linear_data(240)
  data$Wd <- (7 * data$hour) %% 360
  m <- linear_measurements(data, boundary = ~ Te + circular(Wd), average = 2)
  own <- amiss:::new_record(m, as_new(data))
  for (field in c("boundary", "condition", "conditions", "hours", "block", "segment")) {
    expect_identical(own[[field]], m[[field]], info = field)
  }
  expect_identical(own$observed, m$y)
  expect_error(amiss:::new_record(m, as_new(data[-5, ])), "without a gap",
               class = "amiss_error_input")
  expect_error(amiss:::new_record(m, as_new(data[names(data) != "Te"])), "Te",
               class = "amiss_error_input")
})

test_that("bands hold what they should, and the simulation's own is that of its runs", {
  fit <- lacking()
  inside <- function(p) mean(p$observed >= p[[5]] & p$observed <= p[[6]])
  # Of 160 held-out values: three standard errors of a share of a half.
  half <- predict(fit, use = "validate", discrepancy = TRUE, level = 0.5)
  expect_named(half[5:6], c("lower50", "upper50"))
  expect_lt(abs(inside(half) - 0.5), 0.12)
  own <- predict(fit, use = "validate", interval = "confidence", level = 0.8, draws = 60)
  draws <- fit$values[amiss:::even_draws(fit, 60), ]
  Te <- linear_data(480)$Te[321:480]
  runs <- vapply(1:60, function(i) draws[i, "offset"] + draws[i, "gain"] * Te, Te)
  expect_equal(own$lower80, apply(runs, 1, quantile, 0.1, names = FALSE), tolerance = 1e-10)
  expect_equal(own$upper80, apply(runs, 1, quantile, 0.9, names = FALSE), tolerance = 1e-10)
  expect_error(predict(fit, level = 95), "level", class = "amiss_error_input")
  expect_error(predict(fit, "validate"), "chosen by `use`", class = "amiss_error_input")
  expect_error(predict(fit, linear_measurements()), "boundary conditions",
               class = "amiss_error_input")
})

test_that("simulated records look like the record", {
  fit <- lacking()
  records <- simulate(fit, 100, seed = 4)
  y <- fit$measurements$y[fit$rows]
  expect_identical(dim(records), c(320L, 100L))
  expect_identical(simulate(fit, 100, seed = attr(records, "seed")), records)
  series <- discrepancy(fit)$series
  # Errors of 0.1 K over 100 records: 0.01 K at each row.
  expect_lt(sqrt(mean((rowMeans(records) - series$simulated - series$discrepancy)^2)), 0.02)
  # 320 errors: 4 % of their standard deviation; those of a record in 95 % of them, and five more.
  spread <- apply(records - rowMeans(records), 1, sd)
  expect_equal(mean(spread), sd(y - series$simulated - series$discrepancy), tolerance = 0.2)
})

test_that("simulated errors have their variance and memory, and forget it between segments", {
  kept <- c(0, 0.8, 0.8, 0, 0.5)
  x <- withr::with_seed(1, replicate(4000, amiss:::ornstein_uhlenbeck(kept)))
  expected <- diag(5)
  for (i in 1:5) for (j in seq_len(i - 1)) expected[i, j] <- expected[j, i] <- prod(kept[(j + 1):i])
  expect_lt(max(abs(cov(t(x)) - expected)), 5 * sqrt(2 / 4000))
  # A draw whose error has parts of 3 and 10 times the white variance.
  fit <- plain_linear_fit()
  ratios <- fit$control$error_ratios
  fit$posterior$setting[1] <- (match(3, ratios) - 1) + length(ratios) * (match(10, ratios) - 1)
  expect_identical(amiss:::error_ratios_of(fit, 1), matrix(c(3, 10), 1))
  errors <- withr::with_seed(2, amiss:::drawn_errors(fit, rep(1, 400)))
  expect_equal(mean(errors^2), 14 * fit$posterior$variance[1], tolerance = 0.05)
})

test_that("the discrepancy of a record of its own responds to its own conditions", {
  fit <- lacking(Inf)
  data <- linear_data(480)
  data$Tn <- hidden
  warmer <- transform(data, Tn = Tn + 1)
  gain <- predict(fit, as_new(warmer), discrepancy = TRUE)$mean -
    predict(fit, as_new(data), discrepancy = TRUE)$mean
  expect_equal(mean(gain), 0.3, tolerance = 0.15)  # what was made responds to Tn by 0.3
})

test_that("simulated errors are those of the draws whose discrepancy is known", {
  fit <- lacking()
  fit$posterior$variance[-(fit$kept + 1)] <- NA
  expect_false(anyNA(simulate(fit, 32, seed = 1)))
})

# A table for predict(), in which one column is changed.
new_table <- function(column, rows, value) {
  data <- linear_data()[1:96, ]
  new <- data.frame(time = data$hour, data[c("Te", "Gv", "Ti")])
  new[rows, column] <- value
  new
}

test_that("a table to predict is checked as the record was", {
  fit <- plain_linear_fit()
  expect_no_warning(predict(fit, new_table("Te", 1, 10)))
  for (code in c(-9999, -999, -99.9, 9999, 1e30, 32767)) for (column in c("Te", "Ti")) {
    expect_error(predict(fit, new_table(column, 20:23, code)),
                 "rows 20 to 23: a code for a missing value", class = "amiss_error_input")
  }
  expect_warning(predict(fit, new_table("Te", 40, 500)), "Te is 500 in row 40, far outside",
                 class = "amiss_warning_input")
  expect_warning(augment(fit, newdata = new_table("Gv", 30, 1e5)), "Gv is 1e\\+05",
                 class = "amiss_warning_input")
  expect_warning(predict(fit, new_table("Te", 30:70, 11.7)), "stuck", class = "amiss_warning_input")
})

test_that("codes and the range that the record declares hold in a table to predict", {
  fit <- plain_linear_fit()
  fit$measurements <- linear_measurements(missing = -9999, range = c(-Inf, 35))
  table <- predict(fit, new_table("Ti", 20:23, -9999))
  expect_true(all(is.na(table$observed[20:23])))
  expect_true(is.na(predict(fit, new_table("Ti", 30, 36))$observed[30]))
  expect_error(predict(fit, new_table("Te", 20:23, -9999)), "missing or infinite",
               class = "amiss_error_input")
  fit$measurements <- linear_measurements(missing = NA)
  expect_no_warning(table <- predict(fit, new_table("Te", 20:23, -9999)))
  expect_lt(table$mean[20], -1000)
})

# ---- forecasts

# A record whose model lacks the sun, with an autocorrelated error.
forecast_fit_of <- function(...) {
  data <- linear_data(300, seed = 21)
  data$Ti <- data$Ti + 0.004 * data$Gv + withr::with_seed(4, as.numeric(
    stats::arima.sim(list(ar = 0.9), 300, sd = 0.1)))
  linear_fit(linear_measurements(data, validate = data$hour > 220, ...))
}

test_that("forecasts are those of the joint normal distribution of all rows", {
  fit <- forecast_fit_of()
  draw <- amiss:::even_draws(fit, 1)
  chain <- amiss:::forecast_chain(fit, fit$measurements, c("calibrate", "validate"), draw, 1)
  known <- lapply(c(1, 5), function(k) amiss:::known_by(chain, k))
  left <- chain$y - chain$runs[, 1]
  found <- amiss:::forecast_draw(fit, draw, left, chain, known)
  error <- amiss:::draw_errors(fit, draw)
  calibrated <- seq_along(fit$rows)
  expect_identical(chain$hours[calibrated], fit$measurements$hours[fit$rows])
  limit <- if (is.finite(error$limit)) error$limit else 1e12
  e <- chain$moves[calibrated, , drop = FALSE]
  inner <- solve(crossprod(e) + diag(1e-9, ncol(e)))
  # The responses elsewhere keep out of the same combinations of the parameters.
  withheld <- inner %*% crossprod(e, chain$phi[calibrated, ] -
    solve(diag(nrow(e)) + (tcrossprod(e) / limit) %*% (tcrossprod(e) / limit),
          chain$phi[calibrated, ]))
  psi <- chain$phi - chain$moves %*% withheld
  apart <- abs(outer(chain$hours, chain$hours, "-"))
  covariance <- psi %*% (error$spread * t(psi)) + diag(error$white, length(left)) +
    Reduce(`+`, Map(function(v, t) v * exp(-apart / t), error$slow, fit$control$error_times))
  for (k in 1:2) for (i in c(2, 40, 221, 290)) {
    before <- seq_len(known[[k]][i])
    if (!length(before)) next
    gain <- solve(covariance[before, before], covariance[before, i])
    expect_equal(found$mean[i, k], sum(gain * left[before]), tolerance = 1e-6)
    expect_equal(found$sd[i, k]^2, covariance[i, i] - sum(gain * covariance[before, i]),
                 tolerance = 1e-6)
  }
})

test_that("one step ahead is known best, and any better than by the simulation alone", {
  fit <- forecast_fit_of()
  ahead <- predict(fit, use = "validate", horizon = c(24, 1, 4))
  expect_s3_class(ahead, "amiss_forecast")
  expect_identical(unique(ahead$horizon), c(1, 4, 24))
  scores <- summary(ahead)
  expect_identical(scores$rows, rep(80L, 3))
  expect_true(all(scores$crps[1] < scores$crps[-1]))
  simulated <- amiss:::prediction_scores(predict(fit, use = "validate"))$validate
  expect_lt(scores$rmse[1], 0.5 * simulated[["rmse"]])
  expect_lt(scores$rmse[3], simulated[["rmse"]])
  # 80 rows that agree with their neighbours hold as much as some 20: a share of 0.95 has a standard
  # error of 0.05.
  expect_true(all(abs(scores$coverage - 0.95) < 0.15))
  expect_identical(predict(fit, use = "validate", horizon = c(24, 1, 4)), ahead)
})

test_that("forecasts of a table know its rows before, if they were measured", {
  fit <- forecast_fit_of()
  later <- linear_data(60, seed = 22)
  names(later)[names(later) == "hour"] <- "time"
  later$time <- later$time + 1000
  later$Ti <- later$Ti + 0.004 * later$Gv + 2
  known <- predict(fit, later, horizon = 1)
  unknown <- predict(fit, transform(later, Ti = replace(Ti, 11:60, NA)), horizon = 1)
  expect_equal(known$mean[1:11], unknown$mean[1:11])
  expect_lt(abs(mean((known$observed - known$mean)[30:60])), 0.5)
  expect_gt(abs(mean(later$Ti[30:60] - unknown$mean[30:60])), 1)
  blind <- predict(fit, later[names(later) != "Ti"], horizon = 1)
  expect_equal(blind$mean[1], known$mean[1])
  expect_identical(nrow(summary(unknown)), 1L)
})

test_that("what a forecast cannot be is said", {
  fit <- plain_linear_fit()
  for (wrong in list(0, 1.5, "a", NA, numeric()))
    expect_error(predict(fit, horizon = wrong), "horizon", class = "amiss_error_input")
  expect_error(predict(fit, horizon = 1, discrepancy = TRUE), "takes the discrepancy along",
               class = "amiss_error_input")
  expect_error(predict(fit, horizon = 1, interval = "confidence"), "new measurements",
               class = "amiss_error_input")
})
