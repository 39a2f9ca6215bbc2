# Emulators of the borehole function, ours and those of other packages, each as its users would fit
# it. Run by bench/speed/emulator.R: Rscript bench/peers/borehole.R FILE

file <- commandArgs(TRUE)[1]
suppressPackageStartupMessages(library(amiss))

borehole <- function(unit) {
  lower <- c(0.05, 100, 63070, 990, 63.1, 700, 1120, 9855)
  upper <- c(0.15, 50000, 115600, 1110, 116, 820, 1680, 12045)
  v <- sweep(sweep(unit, 2, upper - lower, "*"), 2, lower, "+")
  colnames(v) <- c("rw", "r", "Tu", "Hu", "Tl", "Hl", "L", "Kw")
  with(as.data.frame(v), 2 * pi * Tu * (Hu - Hl) /
                         (log(r / rw) * (1 + 2 * L * Tu / (log(r / rw) * rw^2 * Kw) + Tu / Tl)))
}
hypercube <- function(n) vapply(1:8, function(i) (sample(n) - stats::runif(n)) / n, numeric(n))

interval <- function(mean, sd, df = Inf) {
  half <- stats::qt(0.975, df) * sd
  list(mean = mean, lower = mean - half, upper = mean + half)
}

# Each fits and returns its predictions of runs: mean and 95 % limits, with the nugget where it
# estimates one. train_emulator() is for series: ours is what it does for each of their
# coefficients.
amiss_fit <- function(x, y) {
  basis <- list(vectors = matrix(1, 3, 1), coefficients = matrix((y - mean(y)) / stats::sd(y)),
                singular_values = 1, discarded_ss = 0)
  e <- amiss:::train_emulator_(amiss:::to_normal(x), NULL, basis, NULL,
                               amiss:::emulator_control, list(seed = 1, threads = 1))
  function(at) {
    p <- amiss:::predict_emulator_(c(e, list(region = NULL)), stats::qnorm(at))
    interval(mean(y) + stats::sd(y) * p$mean[, 1], stats::sd(y) * sqrt(p$variance[, 1]))
  }
}

libkriging <- function(...) function(x, y) {
  fit <- rlibkriging::Kriging(y, x, ...)
  function(at) with(stats::predict(fit, at), interval(as.numeric(mean), as.numeric(stdev)))
}

robustgasp <- function(...) function(x, y) {
  fit <- RobustGaSP::rgasp(x, y, ...)
  function(at)
    with(RobustGaSP::predict(fit, at), list(mean = mean, lower = lower95, upper = upper95))
}

dicekriging <- function(...) function(x, y) {
  colnames(x) <- paste0("x", 1:8)
  fit <- DiceKriging::km(design = x, response = y, covtype = "gauss", control = list(trace = FALSE),
                         ...)
  function(at) {
    p <- DiceKriging::predict(fit, `colnames<-`(at, colnames(x)), type = "UK", light.return = TRUE)
    list(mean = p$mean, lower = p$lower95, upper = p$upper95)
  }
}

hetgp <- function(x, y) {
  fit <- hetGP::mleHomGP(x, y)
  function(at) with(stats::predict(fit, at), interval(mean, sqrt(sd2 + nugs)))
}

# Nearly no nugget, and longer ranges than its defaults allow: with them, or with an estimated
# nugget, its errors are several times as large or its variances NaN.
lagp <- function(x, y) {
  gp <- laGP::newGPsep(x, y, d = laGP::darg(NULL, x)$start, g = 1e-6, dK = TRUE)
  laGP::mleGPsep(gp, "d", tmin = sqrt(.Machine$double.eps), tmax = 100)
  function(at) with(laGP::predGPsep(gp, at, lite = TRUE), interval(mean, sqrt(s2), df))
}

emulators <- list(
  "amiss" = amiss_fit,
  "rlibkriging, gauss" = libkriging("gauss"),
  "rlibkriging, matern" = libkriging("matern5_2"),
  "rlibkriging, gauss + nugget" = libkriging("gauss", noise = "nugget"),
  "hetGP" = hetgp,
  "laGP" = lagp,
  "DiceKriging, gauss" = dicekriging(),
  "DiceKriging, gauss + nugget" = dicekriging(nugget.estim = TRUE),
  "RobustGaSP, matern" = robustgasp(),
  "RobustGaSP, gauss + nugget" = robustgasp(kernel_type = "pow_exp", alpha = rep(2, 8),
                                            nugget.est = TRUE))

fitted_once <- function(name, runs, seed) {
  set.seed(seed)
  x <- hypercube(runs)
  y <- borehole(x)
  at <- matrix(stats::runif(8000), 1000)
  truth <- borehole(at)
  fit <- NULL
  seconds <- numeric()
  while (length(seconds) < 5 && sum(seconds) < 0.5) {  # short fits again and again
    utils::capture.output(used <- system.time(fit <- emulators[[name]](x, y), gcFirst = TRUE))
    seconds <- c(seconds, sum(used[c("user.self", "sys.self")]))
  }
  p <- fit(at)
  data.frame(emulator = name, runs = runs, seed = seed, seconds = stats::median(seconds),
             error = sqrt(mean((p$mean - truth)^2)) / stats::sd(truth),
             coverage = mean(p$lower <= truth & truth <= p$upper))
}

# Small designs differ much in how well their intervals hold: more of them.
cases <- rbind(
  expand.grid(seed = 1:10, runs = 200, name = names(emulators), stringsAsFactors = FALSE),
  expand.grid(seed = 1:3, runs = 500, name = names(emulators), stringsAsFactors = FALSE))
rows <- Map(function(name, runs, seed) {
  tryCatch(fitted_once(name, runs, seed), error = function(e) {
    cat(name, ", M = ", runs, ", seed ", seed, ": ", conditionMessage(e), "\n", sep = "")
    data.frame(emulator = name, runs = runs, seed = seed, seconds = NA, error = NA, coverage = NA)
  })
}, cases$name, cases$runs, cases$seed)
saveRDS(do.call(rbind, rows), file)
