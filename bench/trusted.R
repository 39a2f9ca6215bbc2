#!/usr/bin/env Rscript
# How often "trusted" is false: posteriors whose evidence is known, drawn at random, sampled by
# ais() once each. A row for each: kind, dimension, exact log evidence, estimate, standard error,
# whether it is trusted, and the share of the first of two modes. The last lines count what is
# trusted, and what is trusted and wrong by more than three standard errors or half a decade, of
# each kind and in all.
# Usage: Rscript bench/trusted.R [--posteriors 500] [--seed 1] [--workers 1] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
posteriors <- as.integer(option("posteriors", "500", smallest = "6"))
first <- as.integer(option("seed", "1"))
workers <- as.integer(option("workers", "1"))

half_width <- 10  # priors are uniform between -10 and 10

# Log density of N(centre, (by'by)^-1) at the rows of x.
normal_log_density <- function(x, centre, by) {
  log_root <- as.numeric(determinant(by)$modulus)
  log_root - 0.5 * ncol(x) * log(2 * pi) - 0.5 * colSums((by %*% (t(x) - centre))^2)
}

random_rotation <- function(d) qr.Q(qr(matrix(stats::rnorm(d * d), d)))

# Each: list(f, mass), the log-likelihood of rows and the log of its integral over the cube. What a
# normal density has outside is below 1e-9 of it, but for `truncated`.
kinds <- list(
  modes = function(d) {  # of unequal width and mass
    share <- sample(c(0.5, 0.8, 0.95), 1)
    sd <- 10^stats::runif(1, -1.5, -0.3)
    sd <- c(sd, sd / sample(c(1, 2, 5, 10), 1))
    centre <- stats::runif(d, -6, 6)
    f <- function(x) {
      one <- log(share) + normal_log_density(x, centre, diag(d) / sd[1])
      other <- log(1 - share) + normal_log_density(x, -centre, diag(d) / sd[2])
      pmax(one, other) + log1p(exp(-abs(one - other)))
    }
    list(f = f, mass = 0, share = share, is_first = function(x) (x %*% centre)[, 1] > 0)
  },
  narrow = function(d) {
    by <- random_rotation(d) / 10^stats::runif(1, -4, -1)
    centre <- stats::runif(d, -8, 8)
    list(f = function(x) normal_log_density(x, centre, by), mass = 0)
  },
  ridge = function(d) {
    by <- diag(c(1, 10^stats::runif(d - 1, 2, 4))) %*% random_rotation(d)
    centre <- stats::runif(d, -3, 3)
    list(f = function(x) normal_log_density(x, centre, by), mass = 0)
  },
  curved = function(d) {  # a ridge bent into a parabola; the map has the determinant 1
    bend <- stats::runif(1, 0.1, 1)
    sd <- 10^stats::runif(1, -2, -0.5)
    f <- function(x) {
      x[, 2] <- x[, 2] - bend * (x[, 1]^2 - 1)
      normal_log_density(x, rep(0, d), diag(c(1, rep(1 / sd, d - 1))))
    }
    list(f = f, mass = 0)
  },
  truncated = function(d) {  # with its centre outside in some coordinates
    sd <- 10^stats::runif(d, -2, 1)
    centre <- stats::runif(d, -8, 8)
    beyond <- sample(d, sample(d, 1))
    centre[beyond] <-
      sign(centre[beyond]) * (half_width + sd[beyond] * stats::runif(length(beyond), 0, 5))
    # From whichever end loses no digits.
    inside <- stats::pnorm(-half_width, -abs(centre), sd, lower.tail = FALSE, log.p = TRUE)
    outside <- stats::pnorm(half_width, -abs(centre), sd, lower.tail = FALSE, log.p = TRUE)
    list(f = function(x) normal_log_density(x, centre, diag(1 / sd, d)),
         mass = sum(inside + log1p(-exp(outside - inside))))
  },
  constant = function(d) {
    value <- stats::runif(1, -1000, 1000)
    rounding <- sample(c(0, 1e-13), 1)
    list(f = function(x) value * (1 + rounding * sin(1e5 * x[, 1])),
         mass = value + d * log(2 * half_width))
  })

one_posterior <- function(k) {
  set.seed(k)
  kind <- names(kinds)[(k - first) %% length(kinds) + 1]
  d <- sample(c(2:6, 8, 12, 20), 1)
  case <- kinds[[kind]](d)
  priors <- stats::setNames(rep(list(uniform(-half_width, half_width)), d), paste0("x", seq_len(d)))
  exact <- case$mass - d * log(2 * half_width)
  result <- suppressWarnings(ais(function(x) case$f(unname(x)), priors, seed = k))
  off <- result$log_evidence - exact
  found <- if (is.null(case$is_first)) NA
           else sum(result$weights[case$is_first(unname(result$draws))])
  data.frame(seed = k, kind, d, exact, off, standard_error = result$standard_error,
             estimator = result$estimator, trusted = result$trusted, share = case$share %||% NA,
             found, wrong = abs(off) > max(3 * result$standard_error, 1e-6) && abs(off) > 0.02 ||
                            abs(off) > 0.5 * log(10), evaluations = result$evaluations)
}

`%||%` <- function(x, otherwise) if (is.null(x)) otherwise else x

table <- do.call(rbind, parallel::mclapply(first + seq_len(posteriors) - 1L, one_posterior,
                                           mc.cores = workers))
count <- function(rows) {
  data.frame(posteriors = nrow(rows), trusted = sum(rows$trusted),
             false = sum(rows$trusted & rows$wrong), wrong = sum(rows$wrong))
}
each <- lapply(split(table, table$kind), count)
print(cbind(kind = c(names(each), "all"), do.call(rbind, c(unname(each), list(count(table))))),
      row.names = FALSE)
write_rows(table, option("out", "trusted.json"))
