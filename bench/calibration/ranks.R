# Simulation-based calibration (Talts et al. 2018): the rank of the value that made the data among
# independent draws from the posterior is uniform, if sampler and model are right.

sbc_draws <- 19  # from each posterior: 20 equally probable ranks

# Rank of each true value among draws of equal weight, ties (a spike, a grid) broken at random,
# which keeps it uniform.
ranks <- function(truth, draws, weights) {
  picked <- sample(length(weights), sbc_draws, replace = TRUE, prob = weights)
  vapply(names(truth), function(name) {
    own <- draws[picked, name]
    sum(own < truth[[name]]) + sample(0:sum(own == truth[[name]]), 1)
  }, 0)
}

# Both tests of uniformity, chi-square (on the 20 ranks, or on pairs where records are few) and
# Kolmogorov-Smirnov, with Bonferroni's correction for two.
uniformity <- function(rank) {
  counts <- tabulate(rank + 1, sbc_draws + 1)
  if (length(rank) < 100) counts <- colSums(matrix(counts, 2))
  spread <- (rank + stats::runif(length(rank))) / (sbc_draws + 1)
  tests <- c(stats::chisq.test(counts)$p.value, stats::ks.test(spread, "punif")$p.value)
  min(1, 2 * min(tests))
}

sbc_one <- list(
  paper = function(world, control, seed) {
    control <- utils::modifyList(list(ais = sbc_ais), control)
    full <- amiss:::fill_paper_control(control, sbc_steps)
    drawn <- draw_paper(world, full, amiss:::fictitious_condition_(sbc_steps, full$fictitious_seed))
    fit <- amiss::calibrate_paper(world$emulator, observed(world$measurements, drawn$y), control,
                                  seed = seed)
    h <- fit$hyperparameters
    inside <- cbind(fit$posterior$unit, fit$lambda)
    colnames(inside) <- names(drawn$inside)
    outside <- cbind(h$alpha, h$t2, h$lambda)
    colnames(outside) <- names(drawn$outside)
    list(inside = ranks(drawn$inside, inside, fit$weights),
         outside = ranks(drawn$outside, outside, h$weights),
         trusted = c(inside = fit$posterior$trusted, outside = fit$outside$trusted))
  },
  # The record is the emulator's: the simulator is not asked.
  history = function(world, control, seed) {
    control <- utils::modifyList(list(ais = sbc_ais, check = 0), control)
    drawn <- draw_history(world,
                          amiss:::fill_calibration_control(control, world$measurements, sbc_steps))
    fit <- amiss::calibrate(world$emulator, observed(world$measurements, drawn$y), control,
                            seed = seed)
    part <- fit$posterior
    levels <- length(fit$control$error_ratios)
    places <- seq_along(fit$control$error_times)
    digits <- vapply(places, function(k) part$setting %/% levels^(k - 1) %% levels + 1,
                     part$variance)
    draws <- cbind(part$unit, part$variance, digits, part$setting %/% levels^length(places) + 1,
                   part$t)
    colnames(draws) <- names(drawn$joint)
    list(joint = ranks(drawn$joint, draws, part$weights), trusted = c(joint = part$trusted))
  })

# Ranks of `draws` repetitions; seeds are first + 1, 2, ...
sbc_run <- function(kind, world, draws, first, control = list(), workers = 1) {
  spread_work(first + seq_len(draws), function(seed) {
    set.seed(seed)
    sbc_one[[kind]](world, control, seed)
  }, workers)
}

# One result a seed, whatever the number of workers; the first error stops all.
spread_work <- function(seeds, work, workers) {
  results <- if (workers > 1) parallel::mclapply(seeds, work, mc.cores = workers)
             else lapply(seeds, work)
  failed <- Filter(function(r) inherits(r, "try-error"), results)
  if (length(failed)) stop(attr(failed[[1]], "condition"))
  results
}

sbc_rows <- function(case, results, part) {
  all <- do.call(rbind, lapply(results, `[[`, part))
  set.seed(1)  # of the random breaking of ties in the test
  data.frame(case = case, quantity = colnames(all), draws = nrow(all),
             p_value = apply(all, 2, uniformity), row.names = NULL)
}
