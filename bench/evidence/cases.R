# Posteriors whose evidence is known: each a list of name, d, priors, log-likelihood of the rows of
# a matrix, the exact log evidence (closed form or quadrature) and the bias allowed over the
# repeats, in nats.

# y = A x + error, x ~ N(0, I).
linear_gaussian <- function(d, sd = 0.3) {
  set.seed(50 + d)
  a <- matrix(stats::rnorm((d + 4) * d), d + 4)
  y <- as.numeric(a %*% stats::rnorm(d) + sd * stats::rnorm(d + 4))
  root <- chol(tcrossprod(a) + sd^2 * diag(d + 4))
  list(name = "linear-Gaussian", d = d, required = 0.1,
       priors = named(rep(list(amiss::normal(0, 1)), d)),
       f = function(x) colSums(stats::dnorm(y, a %*% t(x), sd, log = TRUE)),
       exact = -sum(log(diag(root))) - 0.5 * sum(backsolve(root, y, transpose = TRUE)^2) -
               0.5 * (d + 4) * log(2 * pi))
}

# Two shells of radius 2 and width 0.1 about +-3.5 on the first axis (Feroz, Hobson and Bridges
# 2009). What of a shell overlaps the other, or lies outside the cube, is below 1e-20 of it: the
# exact value is a radial integral.
shells <- function(d) {
  shell <- function(x, centre)
    stats::dnorm(sqrt((x[, 1] - centre)^2 + rowSums(x[, -1, drop = FALSE]^2)), 2, 0.1, log = TRUE)
  log_sphere <- log(2) + d / 2 * log(pi) - lgamma(d / 2)  # area of the unit sphere
  radial <- stats::integrate(function(r) (r / 2)^(d - 1) * stats::dnorm(r, 2, 0.1), 1, 3,
                             rel.tol = 1e-10)$value
  list(name = "Gaussian shells", d = d, required = if (d == 20) 0.2 else 0.1,
       priors = named(rep(list(amiss::uniform(-6, 6)), d)),
       f = function(x) {
         one <- shell(x, -3.5)
         other <- shell(x, 3.5)
         pmax(one, other) + log1p(exp(-abs(one - other)))
       }, exact = log(2) + log_sphere + (d - 1) * log(2) + log(radial) - d * log(12))
}

# (2 + cos(x1 / 2) cos(x2 / 2))^5: periodic and smooth, so that the rectangle rule is exact to
# rounding.
egg_box <- function() {
  f <- function(x1, x2) (2 + cos(x1 / 2) * cos(x2 / 2))^5
  at <- (seq_len(2000) - 0.5) / 2000 * 10 * pi
  values <- outer(at, at, f)
  list(name = "egg box", d = 2, required = 0.1,
       priors = named(rep(list(amiss::uniform(0, 10 * pi)), 2)), f = function(x) f(x[, 1], x[, 2]),
       exact = max(values) + log(mean(exp(values - max(values)))))
}

# A Gaussian process of unit variance, noise 0.1, and one unknown: the length scale, log-normal.
gaussian_process <- function() {
  set.seed(7)
  at <- seq(0, 1, length.out = 25)
  squares <- as.matrix(stats::dist(at))^2
  covariance <- function(l) exp(-0.5 * squares / l^2) + 0.01 * diag(25)
  y <- as.numeric(crossprod(chol(covariance(0.25)), stats::rnorm(25)))
  f <- function(l) {
    root <- chol(covariance(l))
    -sum(log(diag(root))) - 0.5 * sum(backsolve(root, y, transpose = TRUE)^2) - 12.5 * log(2 * pi)
  }
  each <- function(l) vapply(l, f, 0)
  top <- stats::optimize(f, c(0.02, 2), maximum = TRUE)$objective
  # Over the logarithm of the length scale, seven standard deviations of the prior either way.
  integral <- stats::integrate(function(z) exp(each(exp(z)) - top) * stats::dnorm(z, -1, 1), -8, 6,
                               rel.tol = 1e-8)
  list(name = "Gaussian process", d = 1, required = 0.05,
       priors = list(l = amiss::lognormal(-1, 1)), f = function(x) each(x[, 1]),
       exact = top + log(integral$value))
}

named <- function(priors) stats::setNames(priors, paste0("x", seq_along(priors)))

evidence_cases <- function() {
  c(lapply(c(3, 10, 20), linear_gaussian), lapply(c(2, 5, 10, 20), shells),
    list(egg_box(), gaussian_process()))
}

# One run: error of the log evidence, whether the stated interval holds the exact value, and the
# verdict.
evidence_run <- function(case, seed) {
  result <- amiss::ais(case$f, case$priors, seed = seed)
  data.frame(case = case$name, d = case$d, seed = seed, log_evidence = result$log_evidence,
             standard_error = result$standard_error,
             estimator = result$estimator, inside = result$interval[1] <= case$exact &&
               case$exact <= result$interval[2],
             trusted = result$trusted, evaluations = result$evaluations)
}

# One row of the table from the runs of one case. The mean of n runs is itself uncertain by sd /
# sqrt(n).
evidence_row <- function(case, runs) {
  bias <- mean(runs$log_evidence) - case$exact
  list(case = case$name, d = case$d, exact = case$exact, mean = mean(runs$log_evidence),
       bias = bias, sd = stats::sd(runs$log_evidence), coverage = mean(runs$inside),
       required = case$required, holds = abs(bias) < case$required, repeats = nrow(runs),
       trusted = mean(runs$trusted), evaluations = mean(runs$evaluations))
}

coverage_row <- function(runs) {
  coverage <- mean(runs$inside)
  list(case = "95 % interval, all cases", d = NA, exact = 0.95, mean = coverage,
       bias = coverage - 0.95, sd = sqrt(coverage * (1 - coverage) / nrow(runs)),
       coverage = coverage, required = "0.90-0.98", holds = coverage >= 0.90 && coverage <= 0.98,
       repeats = nrow(runs))
}
