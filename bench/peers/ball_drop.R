#!/usr/bin/env Rscript
# Against a peer: the ball-drop example of SEPIA (bench/peers/ball_drop/README.md). Rscript
# bench/peers/ball_drop.R --out FILE
#
# Times t(h) of falling balls; the simulator has drag linear in the speed, h'' = g - (C / R) h', the
# balls that were timed had quadratic drag. The model is SEPIA's (Higdon et al. 2008) with its
# default priors, y(R_i) = K w(R_i, C) + D v(R_i) + e, v_j ~ GP(0, rho^(4 d^2) / lambda_v), e ~ N(0,
# 1 / lambda_o), D normal kernels 1.5 m wide at the heights of the runs. Emulator and sampler are
# this package's: train_emulator() over (R, C) on the published design, ais() over C, rho, lambda_v
# and lambda_o. Differences of method: SEPIA samples the emulator's hyper-parameters, here they
# stand at their mode; the noise of the timed balls was drawn anew each time that SEPIA's notebook
# ran. calibrate() would answer another question: it looks for discrepancy outside the simulation
# space only, where SEPIA's may imitate the parameter, and its record has at least 20 steps.

published <- c(mean = 0.1204, sd = 0.0075)  # SEPIA's example, posterior of C

ball_drop <- function(folder, seed = 1) {
  design <- as.matrix(utils::read.csv(file.path(folder, "design.csv")))
  field <- utils::read.csv(file.path(folder, "field.csv"))
  heights <- seq(1.5, 24, 1.5)
  runs <- apply(design, 1,
                function(point)
                  vapply(heights, fall_time, 0, radius = point[["R"]], drag = point[["C"]]))
  range_of <- function(name) amiss::uniform(min(design[, name]), max(design[, name]))
  parameters <- list(amiss::free("R", range_of("R"), "m"), amiss::free("C", range_of("C")))
  emulator <- amiss::train_emulator(amiss::ensemble(design, runs, parameters), noise_sd = 0.01)
  priors <- list(C = range_of("C"), rho = amiss::beta_prior(1, 0.1), v = amiss::uniform(0, 1),
                 o = amiss::uniform(0, 1))
  posterior <- amiss::ais(higdon_likelihood(emulator, field, heights,
                                            stats::sd(runs - rowMeans(runs))),
                          priors, seed = seed)
  mean <- sum(posterior$weights * posterior$draws[, "C"])
  list(posterior = posterior, mean = mean,
       sd = sqrt(sum(posterior$weights * (posterior$draws[, "C"] - mean)^2)))
}

# Linear drag: h(t) = g t / b - g (1 - exp(-b t)) / b^2, b = C / R.
fall_time <- function(height, radius, drag, g = 9.8) {
  b <- drag / radius
  stats::uniroot(function(t) g * t / b + g * expm1(-b * t) / b^2 - height, c(1e-3, 50),
                 tol = 1e-12)$root
}

# The precisions come as u in (0, 1) of their priors, Gamma(1, 0.001) in units of the runs'
# variance.
higdon_likelihood <- function(emulator, field, heights, scale) {
  timed <- unique(field$height)
  radii <- unique(field$R)
  at_timed <- apply(emulator$basis$vectors, 2,
                    function(column) stats::approx(heights, column, timed)$y)
  kernels <- outer(timed, heights, function(a, b) stats::dnorm(a, b, 1.5))
  discrepancy <- tcrossprod(kernels) / max(tcrossprod(kernels))
  limits <- emulator$parameters$R$prior
  distance2 <- outer(radii, radii, "-")^2 / (limits$upper - limits$lower)^2
  to_unit <- function(name, values) amiss:::prior_cdf(emulator$parameters[[name]]$prior, values)
  log_density <- function(mean, variance, rho, precision) {
    covariance <- kronecker(rho^(4 * distance2), discrepancy) / precision[1] +
      diag(1 / precision[2], nrow(field))
    for (k in seq_along(radii)) {
      own <- field$R == radii[k]
      covariance[own, own] <- covariance[own, own] + at_timed %*% (variance[k, ] * t(at_timed))
    }
    root <- tryCatch(chol(covariance), error = function(e) NULL)
    if (is.null(root)) return(-Inf)  # precisions so far apart that rounding would decide
    residual <- field$time - as.vector(tcrossprod(at_timed, mean))
    -sum(log(diag(root))) - 0.5 * sum(backsolve(root, residual, transpose = TRUE)^2)
  }
  function(z) {
    points <- expand.grid(R = to_unit("R", radii), C = to_unit("C", z[, "C"]))
    w <- amiss:::emulated_coefficients(emulator, as.matrix(points))
    precision <- matrix(stats::qexp(z[, c("v", "o")], 0.001) / scale^2, ncol = 2)
    vapply(seq_len(nrow(z)), function(i) {
      own <- length(radii) * (i - 1) + seq_along(radii)
      log_density(w$mean[own, , drop = FALSE], w$variance[own, , drop = FALSE], z[i, "rho"],
                  precision[i, ])
    }, 0)
  }
}

if (sys.nframe() == 0) {
  arguments <- commandArgs(trailingOnly = TRUE)
  at <- match("--out", arguments)
  out <- if (is.na(at)) "ball_drop.json" else arguments[at + 1]
  here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
  own <- ball_drop(file.path(here, "ball_drop"))
  row <- list(case = "ball drop", peer = "SEPIA", mean = own$mean, sd = own$sd,
              peer_mean = published[["mean"]], peer_sd = published[["sd"]],
              difference_in_sd = (own$mean - published[["mean"]]) / published[["sd"]],
              trusted = own$posterior$trusted)
  jsonlite::write_json(row, out, auto_unbox = TRUE, digits = 6, pretty = TRUE)
  cat(sprintf("C = %.4f, sd %.4f; SEPIA %.4f, sd %.4f: %.2f standard deviations apart; %s\n",
              own$mean, own$sd, published[["mean"]], published[["sd"]], row$difference_in_sd,
              own$posterior$verdict))
}
