# A stochastic grey-box model of a network (network.R), and likelihood ratio tests between models:
#   dx = (A x + B u) dt + S dw,  y = mean of x_1 over an interval + noise,
# with S diagonal: one scale for the air, one for all other nodes. The state is augmented with the
# integral of x_1, which begins at zero in each interval, so that means are known exactly. Two
# parameters of S and the noise are estimated beside those of the network, by maximum likelihood.

# exp([F, G; 0, 0]) and the covariance that noise adds over one step (Van Loan, 1978). His block
# also holds exp(-F), which overflows if a node is much faster than the step. So both are computed
# for a step no longer than the fastest time constant, and doubled up to the step asked for.
exact_step <- function(drift, input, diffusion, step) {
  n <- nrow(drift)
  m <- ncol(input)
  doublings <- max(0, ceiling(log2(step * max(abs(drift)))))
  short <- step / 2^doublings
  moved <- as.matrix(Matrix::expm(short * rbind(cbind(drift, input), matrix(0, m, n + m))))
  block <- rbind(cbind(-drift, diffusion), cbind(matrix(0, n, n), t(drift)))
  loan <- as.matrix(Matrix::expm(short * block))
  to <- t(loan[n + seq_len(n), n + seq_len(n)])
  noise <- to %*% loan[seq_len(n), n + seq_len(n)]
  input <- moved[seq_len(n), n + seq_len(m)]
  for (k in seq_len(doublings)) {
    noise <- noise + to %*% noise %*% t(to)
    input <- input + to %*% input
    to <- to %*% to
  }
  list(to = to, input = input, noise = (noise + t(noise)) / 2)
}

#' @param equations Of a network: network_equations().
#' @param drivers Conditions, a row a step.
#' @param y Means over `count` steps; `NA` where nothing was measured or is not to be used.
#' @param scales Log of the two scales of the noise of the state (K per root of an hour), and of the
#'   noise of the sensor (K).
#' @return -2 log likelihood.
kalman_deviance <- compiler::cmpfun(function(equations, drivers, y, count, step, scales) {
  n <- length(equations$start)
  drift <- rbind(cbind(-equations$root^2 * equations$loss, 0), c(1, numeric(n)))
  input <- rbind(equations$root^2 * equations$gain, 0)
  diffusion <- diag(c(exp(2 * scales[1]), rep(exp(2 * scales[2]), n - 1), 0), n + 1)
  one <- exact_step(drift, input, diffusion, step)
  all <- exact_step(drift, input, diffusion, step * count)
  # What the conditions of an interval add to the state at its end.
  forced <- matrix(0, length(y), n + 1)
  power <- diag(n + 1)
  for (k in rev(seq_len(count))) {
    rows <- seq(k, by = count, length.out = length(y))
    forced <- forced + drivers[rows, , drop = FALSE] %*% t(power %*% one$input)
    power <- power %*% one$to
  }
  to <- all$to[, seq_len(n)]
  sensor <- exp(2 * scales[3])
  span <- step * count
  x <- equations$start
  covariance <- diag(1e-4, n)
  own <- seq_len(n)
  deviance <- 0
  steady <- FALSE
  for (t in seq_along(y)) {
    z <- to %*% x + forced[t, ]
    if (!steady || is.na(y[t])) {
      whole <- to %*% covariance %*% t(to) + all$noise
      spread <- whole[n + 1, n + 1] / span^2 + sensor
      gain <- whole[own, n + 1] / (span * spread)
    }
    if (is.na(y[t])) {
      x <- z[own]
      covariance <- whole[own, own]
      steady <- FALSE
      next
    }
    innovation <- y[t] - z[n + 1] / span
    deviance <- deviance + innovation^2 / spread + log(2 * pi * spread)
    x <- z[own] + gain * innovation
    if (!steady) {
      before <- covariance
      covariance <- whole[own, own] - spread * tcrossprod(gain)
      steady <- max(abs(covariance - before)) < 1e-12 * max(abs(covariance))
    }
  }
  deviance
})

fit_kalman <- function(simulator, from, m, seed) {
  parameters <- amiss::free_parameters(simulator)
  p <- length(parameters)
  plan <- network_plan(simulator$network)
  drivers <- m$raw$drivers[, network_conditions]
  count <- m$per_step
  y <- replace(m$y, m$use != "calibrate", NA)
  last <- max(which(!is.na(y)))
  y <- y[seq_len(last)]
  runs <- 0
  deviance_at <- function(place) {
    runs <<- runs + 1
    values <- amiss:::unit_to_values(t(place[seq_len(p)]), parameters)[1, ]
    value <- tryCatch(
      kalman_deviance(network_equations(plan, values), drivers, y, count, simulator$step,
                      place[p + 1:3]),
      error = function(e) NaN)
    if (is.finite(value)) value else 1e10
  }
  sensor <- log(m$noise_sd[1])
  scales <- if (is.null(from)) list(c(-3, -3, sensor), c(-1, -5, sensor)) else list(from$scales)
  places <- starts_from(parameters, from, seed)[if (is.null(from)) 1:2 else 1]
  starts <- Map(c, places, scales)
  lower <- c(rep(1e-4, p), -12, -12, sensor - 3)
  upper <- c(rep(1 - 1e-4, p), 3, 3, sensor + 2)
  search <- function(start) {
    stats::nlminb(start, deviance_at, lower = lower, upper = upper,
                  control = list(iter.max = 60, eval.max = 90, rel.tol = 1e-8))
  }
  found <- lapply(starts, search)
  best <- found[[which.min(vapply(found, `[[`, 0, "objective"))]]
  unit <- stats::setNames(best$par[seq_len(p)], names(parameters))
  list(unit = unit, scales = best$par[p + 1:3],
       values = amiss:::unit_to_values(t(unname(unit)), parameters)[1, ],
       deviance = best$objective, size = p, runs = runs)
}

# The mechanism with the highest likelihood, if the test at 5 % rejects the model without it.
likelihood_ratio <- function(fits, present) {
  gain <- present$deviance - vapply(fits, `[[`, 0, "deviance")
  best <- which.max(gain)
  more <- fits[[best]]$size - present$size
  if (stats::pchisq(gain[best], more, lower.tail = FALSE) < 0.05) best
}
