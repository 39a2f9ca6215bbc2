#!/usr/bin/env Rscript
# How much does it matter to the paper's evidence that one noise precision is drawn Q + 1 times?
# Usage: Rscript bench/one_noise.R [--out FILE] [--records 8]
#
# Records with one noise throughout; the log evidence with a precision for each basis vector and one
# for the discrepancy (as in the paper), with one for all basis vectors (shared_lambda), and with
# one for all, by ais() on the joint posterior written down with dense matrices. The table stands in
# the vignette "What the engine computes".

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
for (part in c("world", "prior_predictive", "bridge"))
  sys.source(file.path(here, "calibration", paste0(part, ".R")), globalenv())
the_world <- sbc_world()

one_noise <- function(seed, confidence, noise, world = the_world) {
  m <- world$measurements
  k <- world$emulator$basis$vectors
  control <- list(alpha = c(1, 1), confidence = confidence, ais = sbc_ais)
  full <- amiss:::fill_paper_control(control, sbc_steps)
  set.seed(seed)
  priors <- list(noise_sd = m$noise_sd, noise_shape = sbc_steps * confidence)
  lambda <- if (is.null(noise)) draw_precision(1, priors) else 1 / noise^2
  x <- cbind(m$boundary, amiss:::fictitious_condition_(sbc_steps, full$fictitious_seed))
  w <- coefficients_at(world$emulator, stats::runif(2))
  s <- length(m$conditions) + 1
  zeta <- kernel_covariance(x, c(m$condition, s), stats::runif(s), stats::runif(1))
  outside <- stats::lm.fit(k, as.numeric(stats::rnorm(sbc_steps) %*%
                                         chol(zeta + diag(1 / lambda, sbc_steps))))$residuals
  y <- as.numeric(
    k %*% stats::rnorm(ncol(k), w$mean, sqrt(w$variance + 1 / (lambda * colSums(k^2))))) + outside

  complement <- qr.Q(qr(k), complete = TRUE)[, -seq_len(ncol(k))]
  data <- list(world = world, y = y, priors = priors, h = complement, v = crossprod(complement, y),
               x = x)
  # Coordinates: 2 parameters, alpha, t2, lambda*. Both parts hold the prior of theirs, which ais()
  # knows already.
  joint <- function(u) {
    x <- stats::qnorm(u)
    vapply(seq_len(nrow(x)), function(i) {
      parts <- list(inside = x[i, c(1, 2, rep(ncol(x), ncol(k)))], outside = x[i, -(1:2)])
      known <- sum(stats::dnorm(unlist(parts), log = TRUE))
      tryCatch(log_posterior_inside(parts$inside, data) +
               log_posterior_outside(parts$outside, data) - known, error = function(e) -Inf)
    }, 0)
  }
  coordinates <- stats::setNames(rep(list(uniform(0, 1)), s + 4), paste0("u", seq_len(s + 4)))
  record <- observed(m, y)
  c(separate = calibrate_paper(world$emulator, record, control, seed = seed)$log_evidence,
    shared = calibrate_paper(world$emulator, record, c(control, shared_lambda = TRUE),
                             seed = seed)$log_evidence,
    one = ais(joint, coordinates, sbc_ais, seed = seed)$log_evidence)
}

cases <- list(list(name = "hardly believed (c = 2/N)", confidence = 2 / sbc_steps, noise = NULL),
              list(name = "firmly believed (c = 1)", confidence = 1, noise = NULL),
              list(name = "hardly believed, three times as large", confidence = 2 / sbc_steps,
                   noise = 0.9))
rows <- do.call(rbind, lapply(cases, function(case) {
  values <- t(vapply(seq_len(as.integer(option("records", "8", smallest = "1"))), one_noise,
                     numeric(3), case$confidence, case$noise))
  difference <- values[, 1:2] - values[, 3]
  data.frame(noise = case$name, log_evidence = colnames(difference), mean = colMeans(difference),
             lowest = apply(difference, 2, min),
             highest = apply(difference, 2, max), records = nrow(values), row.names = NULL)
}))
print(rows, digits = 2)
write_rows(rows, option("out", "one_noise.json"))
