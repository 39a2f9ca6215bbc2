# Physical values: calibrated ones, and what the simulator lacks counted too.

# Of what lacks the second of two correlated drivers, the calibrated gain of the first makes up for
# a part.
lacking <- function() {
  set.seed(5)
  n <- 240
  table <- data.frame(hour = seq_len(n), Te = 8 + 6 * sin(2 * pi * (1:n - 9) / 24) + walk(n, 0.95),
                      sun = pmax(0, 200 * sin(2 * pi * (1:n - 7) / 24) + 20 * walk(n, 0.8)))
  table$Ti <- 20 + 0.4 * table$Te + 0.004 * table$sun + stats::rnorm(n, sd = 0.1)
  m <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + sun, noise_sd = 0.1)
  model <- function_simulator(function(values, drivers) {
    values[["level"]] + values[["gain"]] * drivers[, "Te"]
  }, free("level", uniform(0, 40)), free("gain", uniform(-2, 3)), boundary = "Te")
  list(m = m, model = model, table = table)
}

walk <- function(n, memory)
  as.numeric(stats::filter(stats::rnorm(n, sd = sqrt(1 - memory^2)), memory, "recursive"))

# A model of one error of 3 h, so that a setting is a ratio.
calibrated <- function(world) {
  runs <- simulate_design(world$model, world$m, runs = 20, seed = 1)
  calibrate_refined(runs, world$m, control = list(calibration = list(error_times = 3)), seed = 1)
}

# Under the whole response the parameters of a line with flat priors have a closed posterior, given
# error and discrepancy: y ~ N(E x, sigma^2 C + Phi T Phi').
closed <- function(fit, design) {
  data <- amiss:::history_data(fit$emulator, fit$measurements, fit$rows, fit$control)
  phi <- sweep(sweep(data$responses, 2, fit$centre), 2, fit$scale, "/")
  apart <- abs(outer(data$time, data$time, "-"))
  each <- lapply(fit$kept + 1L, function(k) {
    ratio <- fit$priors$ratios[fit$posterior$setting[k] %% length(fit$priors$ratios) + 1]
    error <- fit$posterior$variance[k] * (diag(nrow(apart)) + ratio * exp(-apart / 3))
    t <- fit$posterior$t[k, data$condition + 1] / sum(data$condition == 0)
    precise <- solve(error + phi %*% (t * t(phi)), cbind(design, data$y))
    spread <- solve(crossprod(design, precise[, 1:2]))
    list(mean = (spread %*% crossprod(design, precise[, 3]))[, 1], sd = sqrt(diag(spread)))
  })
  mean <- vapply(each, `[[`, numeric(2), "mean")
  sd <- vapply(each, `[[`, numeric(2), "sd")
  share <- function(x, j) mean(stats::pnorm(x, mean[j, ], sd[j, ]))
  quantile <- function(p, j)
    stats::uniroot(function(x) share(x, j) - p, range(mean[j, ] + 9 * sd[j, ],
                                                      mean[j, ] - 9 * sd[j, ]), tol = 1e-9)$root
  list(sd = sqrt(apply(mean, 1, stats::var) + rowMeans(sd^2)),
       ends = t(vapply(1:2, function(j) c(quantile(0.025, j), quantile(0.975, j)), c(0, 0))))
}

test_that("physical values have the posterior under the whole response, if priors are flat", {
  world <- lacking()
  fit <- calibrated(world)
  expect_true(fit$trust$trusted)
  of_all <- closed(fit, cbind(1, world$table$Te))
  found <- tidy(fit)
  # The same 32 draws of error and discrepancy. Each has a draw of the parameters here, their whole
  # distribution there: the mean differs by up to 3 / sqrt(32) of the standard deviation, and that
  # by 3 / sqrt(62) of itself. The interval holds the calibrated one too.
  expected <- cbind(pmin(of_all$ends[, 1], found$conf.low), pmax(of_all$ends[, 2], found$conf.high))
  off <- (3 / sqrt(32) + 1.96 * 3 / sqrt(62)) * of_all$sd
  expect_true(all(abs(found$physical.low - expected[, 1]) < off))
  expect_true(all(abs(found$physical.high - expected[, 2]) < off))
  # The calibrated gain makes up for the sun, the physical one does not.
  gain <- found[found$term == "gain", ]
  expect_gt(gain$conf.low, 0.4)
  expect_lt(gain$physical.low, 0.4)
})

test_that("nothing is added if nothing is missing, or if no slopes are known", {
  world <- lacking()
  world$table$Ti <- world$table$Ti - 0.004 * world$table$sun
  world$m <- measurements(world$table, time = "hour", target = "Ti", boundary = ~ Te + sun,
                          noise_sd = 0.1)
  found <- tidy(calibrated(world))
  width <- found$conf.high - found$conf.low
  expect_true(all(found$physical.high - found$physical.low < 1.5 * width))
  runs <- simulate_design(world$model, world$m, runs = 20, seed = 1)
  staged <- calibrate(train_emulator(runs, world$m), world$m,
                      list(ais = list(pilot_chains = 48, groups = 4)), seed = 1)
  expect_true(all(is.na(tidy(staged)$physical.low)))
})
