#!/usr/bin/env Rscript
# How often intervals of emulators hold what they have not seen.
# Usage: Rscript bench/emulator_coverage.R --out FILE [--designs 10] [--seed 9001]
#
# Known functions on random Latin hypercubes of M runs, without and with noise of 5 % of their
# standard deviation; 1000 held-out points each. "before" are the same emulators widened to the
# leave-one-out errors of hyper-parameters that have seen the run left out. FILE gets a row for each
# function and M: shares held by the intervals of 90 and 95 %, mean squared standardised error, mean
# interval score of 95 % (Gneiting and Raftery 2007, in standard deviations of the function), RMSE,
# standard deviation of the mean of `hold95`, seconds to train.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
out <- option("out", "emulator_coverage.json")
designs <- as.integer(option("designs", "10", smallest = "1"))
first <- as.integer(option("seed", "9001"))

between <- function(u, lower, upper)
  as.data.frame(sweep(sweep(u, 2, upper - lower, "*"), 2, lower, "+"))
named <- function(u, names, lower, upper) stats::setNames(between(u, lower, upper), names)

functions <- list(
  borehole = list(inputs = 8, f = function(u) {
    v <- named(u, c("rw", "r", "Tu", "Hu", "Tl", "Hl", "L", "Kw"),
               c(0.05, 100, 63070, 990, 63.1, 700, 1120, 9855),
               c(0.15, 50000, 115600, 1110, 116, 820, 1680, 12045))
    with(v, 2 * pi * Tu * (Hu - Hl) /
            (log(r / rw) * (1 + 2 * L * Tu / (log(r / rw) * rw^2 * Kw) + Tu / Tl)))
  }),
  friedman = list(inputs = 8, f = function(u)
    10 * sin(pi * u[, 1] * u[, 2]) + 20 * (u[, 3] - 0.5)^2 + 10 * u[, 4] + 5 * u[, 5]),
  otl = list(inputs = 6, f = function(u) {
    v <- named(u, c("b1", "b2", "f", "c1", "c2", "beta"), c(50, 25, 0.5, 1.2, 0.25, 50),
               c(150, 70, 3, 2.5, 1.2, 300))
    with(v, {
      gain <- beta * (c2 + 9)
      ((12 * b2 / (b1 + b2) + 0.74) * gain + 11.35 * f + 0.74 * f * gain / c1) / (gain + f)
    })
  }),
  wing = list(inputs = 10, f = function(u) {
    v <- named(u, c("S", "Wf", "A", "L", "q", "l", "tc", "Nz", "Wd", "Wp"),
               c(150, 220, 6, -10, 16, 0.5, 0.08, 2.5, 1700, 0.025),
               c(200, 300, 10, 10, 45, 1, 0.18, 6, 2500, 0.08))
    with(v, {
      cosine <- cos(L * pi / 180)
      0.036 * S^0.758 * Wf^0.0035 * (A / cosine^2)^0.6 * q^0.006 * l^0.04 *
        (100 * tc / cosine)^-0.3 * (Nz * Wd)^0.49 + S * Wp
    })
  }),
  piston = list(inputs = 7, f = function(u) {
    v <- named(u, c("M", "S", "V0", "k", "P0", "Ta", "T0"),
               c(30, 0.005, 0.002, 1000, 90000, 290, 340),
               c(60, 0.02, 0.01, 5000, 110000, 296, 360))
    with(v, {
      A <- P0 * S + 19.62 * M - k * V0 / S
      V <- S / (2 * k) * (sqrt(A^2 + 4 * k * P0 * V0 / T0 * Ta) - A)
      2 * pi * sqrt(M / (k + S^2 * P0 * V0 / T0 * Ta / V^2))
    })
  }),
  smooth3 = list(inputs = 3,
                 f = function(u)
                   4 * u[, 1] * exp(-0.2 - u[, 2]) + sin(3 * u[, 2] + u[, 3]) + 0.3 * u[, 3]^2),
  kink = list(inputs = 4,
              f = function(u)
                pmax(0, u[, 1] - 0.4) * (1 + u[, 2]) + 0.5 * abs(u[, 3] - 0.5) + 0.3 * u[, 4]),
  step = list(inputs = 3, f = function(u) (u[, 1] + 0.5 * u[, 2] > 0.7) + sin(3 * u[, 3])))

latin_hypercube <- function(n, p)
  vapply(seq_len(p), function(i) (sample(n) - stats::runif(n)) / n, numeric(n))

scores <- function(error, sd) {
  half <- stats::qnorm(0.975) * sd
  c(hold90 = mean(abs(error) < stats::qnorm(0.95) * sd), hold95 = mean(abs(error) < half),
    square = mean((error / sd)^2),
    score = mean(2 * half + 40 * pmax(0, abs(error) - half)))
}

# train_emulator() is for series: this is what it does for each of their coefficients.
one_design <- function(case, runs, noise, seed) {
  set.seed(seed)
  x <- latin_hypercube(runs, case$inputs)
  at <- matrix(stats::runif(1000 * case$inputs), 1000)
  truth <- case$f(at)
  unit <- stats::sd(truth)
  y <- case$f(x) / unit + noise * stats::rnorm(runs)
  truth <- truth / unit + noise * stats::rnorm(1000)
  centre <- mean(y)
  spread <- stats::sd(y)
  values <- matrix((y - centre) / spread)
  basis <- list(vectors = matrix(1, 3, 1), coefficients = values, singular_values = 1,
                discarded_ss = 0)
  seconds <- system.time(gcFirst = FALSE, {
    e <- amiss:::train_emulator_(amiss:::to_normal(x), NULL, basis, NULL,
                                 amiss:::emulator_control, list(seed = 1, threads = 1))
  })[["elapsed"]]
  p <- amiss:::predict_emulator_(c(e, list(region = NULL)), stats::qnorm(at))
  error <- truth - centre - spread * p$mean[, 1]
  # At the mode: variances without what they were widened by, leave-one-out errors from the
  # covariance.
  mode <- e$hyperparameters[1, ] + log(e$widened) * c(-1, -1, 1, rep(0, case$inputs))
  theta <- 4 * log1p(exp(-mode[-(1:3)]))
  kernel <- exp(mode[1]) * exp(-as.matrix(stats::dist(x %*% diag(sqrt(theta), case$inputs)))^2)
  diag(kernel) <- exp(mode[1]) * (1 + 1e-10) + exp(mode[2]) + exp(-mode[3])
  inverse <- chol2inv(chol(kernel))
  at_mode <- max(1, mean((inverse %*% values)^2 / diag(inverse)))
  after <- scores(error, spread * sqrt(p$variance[, 1]))
  before <- scores(error, spread * sqrt(p$variance[, 1] * at_mode / e$widened))
  c(stats::setNames(before, paste0(names(before), "_before")), after, rmse = sqrt(mean(error^2)),
    seconds = seconds, factor_before = at_mode, factor = e$widened)
}

cases <- rbind(expand.grid(name = c("borehole", "friedman", "otl", "wing", "piston"),
                           runs = c(100, 200, 500), noise = 0, stringsAsFactors = FALSE),
               expand.grid(name = c("smooth3", "kink", "step"), runs = c(40, 200), noise = 0,
                           stringsAsFactors = FALSE),
               expand.grid(name = c("borehole", "friedman", "otl", "wing", "piston"), runs = 200,
                           noise = 0.05, stringsAsFactors = FALSE),
               expand.grid(name = c("smooth3", "kink", "step"), runs = 40, noise = 0.05,
                           stringsAsFactors = FALSE))
if (smoke) cases <- cases[cases$runs == 40, ]
cat(sprintf("%-22s %5s %19s %19s %15s %19s %8s\n", "function", "M", "90 % hold", "95 % hold",
            "square", "interval score", "RMSE"))
rows <- Map(function(name, runs, noise) {
  all <- vapply(first + seq_len(designs) - 1L,
                function(seed) one_design(functions[[name]], runs, noise, seed), numeric(12))
  m <- as.list(rowMeans(all))
  error <- stats::sd(all["hold95", ]) / sqrt(designs)
  label <- if (noise > 0) sprintf("%s, noise %g", name, noise) else name
  cat(sprintf(
    "%-22s %5d     %.3f -> %.3f     %.3f -> %.3f   %.2f -> %.2f     %7.5f -> %7.5f %8.5f\n",
    label, as.integer(runs), m$hold90_before, m$hold90, m$hold95_before, m$hold95,
    m$square_before, m$square, m$score_before, m$score, m$rmse))
  data.frame(name = name, runs = runs, noise = noise, designs = designs, m, hold95_error = error)
}, cases$name, cases$runs, cases$noise)
write_rows(do.call(rbind, rows), out)
