# One world scored: what the loop says, and what it should have said.

fit_seed <- function(world) world$seed + 77L  # never the world's own

score_world <- function(world, control = list(max_steps = 2,
                                              calibration = list(ais = list(precision = 0.3))),
                        runs = NULL, rivals = TRUE, least_squares = TRUE) {
  started <- proc.time()[["elapsed"]]
  upgrade <- amiss::upgrade_model(world$base, world$measurements, world$catalogue, runs = runs,
                                  control = control, seed = fit_seed(world), threads = 1,
                                  quiet = TRUE)
  wall <- proc.time()[["elapsed"]] - started
  adopted <- unlist(adopted_mechanisms(upgrade))
  attributed <- attributed_condition(upgrade)
  verdict <- amiss:::diagnosis_verdict(upgrade)
  rmse <- vapply(upgrade$models, function(m) m$scores$calibrate[["rmse"]], 0)
  best <- if (least_squares) best_rmse(world) else NA
  row <- list(
    seed = world$seed, family = world$family, structure = c(world$structure, NA)[1],
    misfit = c(world$misfit, NA)[1], hidden = length(world$kinds) > 0, kind = world$kind,
    strength = world$strength, achieved = world$achieved, noise = world$noise, ar1 = world$ar1,
    days = world$days, true_boundary = world$true_boundary,
    true_mechanism = intersect(world$kinds, names(world$catalogue)),
    condition = told_condition(upgrade, attributed), attributed_condition = attributed,
    mechanism = if (length(adopted)) adopted[1] else NA, adopted = as.character(adopted),
    verdicts = rep(mechanism_verdicts(upgrade, verdict$verdict),
                   lengths(adopted_mechanisms(upgrade))), check_passed = check_passed(upgrade),
    verdict = verdict$verdict, unexplained = verdict$verdict == "unexplained",
    headline = verdict$headline,
    log10_bf = max(upgrade$candidates$log10_bf[upgrade$candidates$from == upgrade$models[[1]]$name],
                   na.rm = TRUE),
    gain_share = gain_share(world, upgrade), covered = parameter_covered(world, upgrade, "conf"),
    physical_covered = parameter_covered(world, upgrade, "physical"),
    rmse = rmse, held_out = upgrade$gain$rmse_validation[2],
    noise_sd = mean(world$measurements$noise_sd), best_rmse = best,
    rmse_ratio = rmse[length(rmse)] / best,
    over_least = if (least_squares) over_least_squares(world, upgrade) else c(NA, NA),
    doubts = rep(lapply(upgrade$models[-1], function(m) names(m$doubts)),
                 lengths(adopted_mechanisms(upgrade))),
    candidates = first_trials(upgrade), wall_s = wall, runs_total = upgrade$runs_total)
  if (rivals) row <- c(row, rival_conditions(upgrade$models[[1]]$fit, world),
                       list(paper_condition = paper_condition(world, 120)))
  row
}

# The mechanisms of each model, both of a pair.
adopted_mechanisms <- function(upgrade) {
  lapply(upgrade$models[-1], function(m) {
    of <- upgrade$catalogue[[m$mechanism]]$of
    if (is.null(of)) m$mechanism else of
  })
}

# What is said of each mechanism that was adopted, in turn; of all of them together where the
# package does not say it of each.
mechanism_verdicts <- function(upgrade, overall) {
  vapply(upgrade$models[-1], function(m) {
    own <- m[["verdict"]]
    if (is.list(own)) own <- own[["verdict"]]
    if (is.null(own)) overall else as.character(own)[1]
  }, "")
}

# Did runs of the simulator at draws of the last model's posterior confirm its emulator? NA where
# nobody asked.
check_passed <- function(upgrade) {
  passed <- upgrade$models[[length(upgrade$models)]]$fit[["check"]][["passed"]]
  if (is.null(passed)) NA else passed
}

# The RMSE in calibration that least squares reaches with what is really there; NA where no model of
# the catalogue is it, or where the effort is not worth it (the box). The search starts from the
# truth as well.
best_rmse <- function(world) {
  if (!world$family %in% c("network", "runoff")) return(NA)
  true <- Reduce(function(model, k) world$catalogue[[k]]$edit(model), world$kinds, world$base)
  values <- c(world$values,
              unlist(lapply(unname(world$effects), function(e) e[names(e) != "size"])))
  parameters <- amiss::free_parameters(true)
  unit <- vapply(names(parameters),
                 function(n) amiss:::prior_cdf(parameters[[n]]$prior, values[[n]]), 0)
  best_on_record(true, world$measurements, fit_seed(world), starts = 3,
                 known = list(unname(unit)))$rms
}

# The error of the last model's simulation at its best, calibrated and held out, over that of least
# squares on the same simulator by itself.
over_least_squares <- function(world, upgrade) {
  model <- upgrade$models[[length(upgrade$models)]]
  adopted <- unlist(adopted_mechanisms(upgrade))
  simulator <- Reduce(function(simulator, name) world$catalogue[[name]]$edit(simulator), adopted,
                      world$base)
  m <- world$measurements
  found <- best_on_record(simulator, m, fit_seed(world), starts = 2)
  values <- amiss:::unit_to_values(t(found$unit), amiss::free_parameters(simulator))
  rms <- function(use) {
    y <- m$y[m$use == use & !is.na(m$y)]
    sqrt(mean((amiss:::simulate_measured(simulator, values, m, use, 1L) - y)^2))
  }
  c(model$scores$calibrate[["rmse"]] / rms("calibrate"),
    model$scores$validate[["rmse"]] / rms("validate"))
}

# What was found of each mechanism on the base model.
first_trials <- function(upgrade) {
  table <- upgrade$candidates[upgrade$candidates$from == upgrade$models[[1]]$name, ]
  table[c("mechanism", "log10_bf", "beside_unknown", "error_ratio", "trusted", "judged_by", "runs")]
}

attributed_condition <- function(upgrade) {
  table <- upgrade$models[[1]]$attribution$table
  if (any(table$significant)) table$boundary[table$significant][1] else NA
}

# What the tool tells: the condition of the cause it names or, where it names none, the one that the
# discrepancy responds to.
told_condition <- function(upgrade, attributed) {
  of_cause <- upgrade$named_cause$boundary
  if (is.null(of_cause) || attributed %in% of_cause) attributed else of_cause[1]
}

# The paper's rule: basis of 99 % of the variance, conditions as they are at the moment, one
# fictitious variable. Every k-th row of the record is kept, at most 150 of them, as its cost grows
# with their cube.
paper_condition <- function(world, runs, most = 150) {
  m <- world$measurements
  rows <- which(m$use == "calibrate")
  m$use[rows[seq_along(rows) %% ceiling(length(rows) / most) != 0]] <- "unused"
  ensemble <- amiss::simulate_design(world$base, m, runs, seed = fit_seed(world))
  emulator <- suppressWarnings(amiss::train_emulator(ensemble, m, list(noise_fraction = 1e6)))
  coarse <- list(pilot_chains = 96, groups = 4, max_groups = 4, precision = 1,
                 importance_draws = 500, max_sweeps = 10)
  index <- amiss::calibrate_paper(emulator, m, list(ais = coarse), seed = fit_seed(world))$index
  if (any(index$significant)) index$boundary[index$significant][1] else NA
}

# Held-out error that the loop removes, as a share of what knowing the truth would remove.
gain_share <- function(world, upgrade) {
  if (!length(world$kinds)) return(NA)
  m <- world$measurements
  rows <- which(m$use == "validate")
  averaged <- rowsum(world$clean, m$block) / m$per_step
  truth <- sqrt(mean((m$y[rows] - averaged[rows])^2))
  rmse <- upgrade$gain$rmse_validation
  if (rmse[1] <= 1.02 * truth) return(NA)
  (rmse[1] - rmse[2]) / (rmse[1] - truth)
}

# By the interval of the calibrated value ("conf"), or of the physical one.
parameter_covered <- function(world, upgrade, which) {
  first <- if (length(upgrade$models) > 1) upgrade$models[[2]]$mechanism
  if (is.null(first) || !first %in% world$kinds) return(NA)
  last <- amiss::tidy(upgrade$models[[length(upgrade$models)]]$fit)
  true <- world$effects[[first]]
  own <- last[last$term == names(true)[1], ]
  ends <- own[paste0(which, c(".low", ".high"))]
  any(ends[[1]] <= true[[1]] & true[[1]] <= ends[[2]])  # a row for each mode
}

# What is done today: the residuals of the calibrated base model held against each condition. The
# lengthscales are fitted to every k-th row, at most 400 of them.
rival_conditions <- function(fit, world, most = 400) {
  m <- fit$measurements
  x <- m$boundary[fit$rows, , drop = FALSE]
  names_of <- m$conditions[m$condition]
  r <- residuals(fit)
  strongest <- function(score) unname(names_of[which.max(score)])
  unit <- apply(x, 2, function(v) (v - min(v)) / diff(range(v)))
  thin <- seq(1, length(r), by = ceiling(length(r) / most))
  ard <- amiss:::train_emulator_(
    amiss:::to_normal(unit[thin, , drop = FALSE]), NULL,
    list(vectors = matrix(1, 3, 1), coefficients = matrix(r[thin]), singular_values = 1,
         discarded_ss = 0),
    NULL,
    utils::modifyList(amiss:::emulator_control,
                      list(starts = 2, searches = 1, max_evaluations = 40)),
    list(seed = 1, threads = 1))
  forest <- if (requireNamespace("ranger", quietly = TRUE)) {
    strongest(ranger::ranger(x = as.data.frame(unname(x)), y = r, importance = "permutation",
                             num.trees = 300, seed = 1, num.threads = 1)$variable.importance)
  }  # not asked where the package is not there
  list(correlation_condition = strongest(abs(stats::cor(x, r))), forest_condition = forest,
       ard_condition = strongest(-ard$hyperparameters[1, -(1:3)]))
}

# TRUE, FALSE or, where a rule was not asked, NA; a rule that was asked and names nothing is not
# right.
named_right <- function(row) !is.na(row$mechanism) && row$mechanism %in% row$true_mechanism
condition_right <- function(row, what = "condition") {
  if (is.null(row[[what]])) NA else !is.na(row[[what]]) && row[[what]] %in% row$true_boundary
}
named_mechanisms <- function(row) row$adopted[row$verdicts == "named"]

rate <- function(flags) {
  flags <- flags[!is.na(flags)]
  if (!length(flags)) return(list(rate = NA, n = 0, lower95 = NA, upper95 = NA))
  interval <- stats::binom.test(sum(flags), length(flags))$conf.int
  list(rate = mean(flags), n = length(flags), lower95 = interval[1], upper95 = interval[2])
}

# Worlds whose effect is about twice the noise and more, and a mechanism of the catalogue.
strong_effects <- function(rows)
  Filter(function(r) length(r$true_mechanism) > 0 && r$achieved >= 1.95, rows)

# Rates of the worlds of one family; by_family() has those of each.
score_rates <- function(rows) {
  pick <- function(f) Filter(f, rows)
  # NA where it was not scored
  flags <- function(rows, f) vapply(rows, function(r) c(as.logical(f(r)), NA)[1], NA)
  strong <- strong_effects(rows)
  one <- pick(function(r) length(r$true_mechanism) > 0 && abs(r$achieved - 1) <= 0.2)
  none <- pick(function(r) r$kind == "none")
  outside <- pick(function(r) r$hidden && !length(r$true_mechanism))
  both <- pick(function(r) r$kind == "two effects" && r$achieved >= 1.95)
  # Where the base is wrong in structure, effects can be smaller than what its structure leaves,
  # whatever the noise is.
  above <- Filter(function(r) isTRUE(r$achieved >= r$misfit), strong)
  weak <- pick(function(r) length(r$true_mechanism) > 0 && r$achieved < 0.8)
  rivals <- c("condition", "attributed_condition", "paper_condition", "correlation_condition",
              "forest_condition", "ard_condition")
  right <- lapply(stats::setNames(rivals, paste0("right_", rivals)),
                  function(rule) rate(flags(strong, function(r) condition_right(r, rule))))
  within_a_tenth <- function(k) function(r) unlist(r$over_least)[k] <= 1.1
  c(list(right_mechanism = rate(flags(strong, named_right))), right,
    list(
      named = rate(flags(strong, function(r) any(named_mechanisms(r) %in% r$true_mechanism))),
      least_squares_calibration = rate(flags(rows, within_a_tenth(1))),
      least_squares_held_out = rate(flags(rows, within_a_tenth(2))),
      many_runs = rate(flags(rows, function(r) r$runs_total > 800)),
      detection_at_1 = rate(flags(one, named_right)),
      detection_below_1 = rate(flags(weak, named_right)),
      parameter_covered = rate(flags(strong, function(r) r$covered)),
      physical_covered = rate(flags(strong, function(r) r$physical_covered)),
      false_condition = rate(flags(none, function(r) !is.na(r$condition))),
      false_mechanism = rate(flags(none, function(r) !is.na(r$mechanism))),
      false_paper_condition = rate(flags(none, function(r) !is.na(r$paper_condition))),
      false_named = rate(flags(rows, function(r) any(!named_mechanisms(r) %in% r$true_mechanism))),
      hidden_among_adopted = rate(flags(strong, function(r) all(r$true_mechanism %in% r$adopted))),
      hidden_above_misfit_among_adopted = rate(
        flags(above, function(r) all(r$true_mechanism %in% r$adopted))),
      rmse_ratio_ok = rate(flags(pick(function(r) r$hidden && named_right(r)),
                                 function(r) r$rmse_ratio <= 1.2)),
      check_failed = rate(flags(rows, function(r) !r$check_passed)),
      named_unchecked = rate(flags(pick(function(r) isFALSE(r$check_passed)),
                                   function(r) length(named_mechanisms(r)) > 0)),
      outside_blamed = rate(flags(outside, function(r) r$verdict == "named")),
      outside_unexplained = rate(flags(Filter(function(r) r$achieved >= 1.95, outside),
                                       function(r) r$unexplained)),
      both_found = rate(flags(both, function(r) all(r$true_mechanism %in% r$adopted)))))
}

by_family <- function(rows, of) {
  family <- vapply(rows, `[[`, "", "family")
  lapply(stats::setNames(nm = unique(family)), function(f) of(rows[family == f]))
}

# Means, with their standard errors: held-out error removed, as a share of what knowing the truth
# would remove, and time.
score_means <- function(rows) {
  strong <- strong_effects(rows)
  of <- function(rows, field) {
    v <- vapply(rows, function(r) as.numeric(r[[field]]), 0)
    v <- v[is.finite(v)]
    list(mean = mean(v), standard_error = stats::sd(v) / sqrt(length(v)), median = stats::median(v),
         largest = if (length(v)) max(v) else NA, n = length(v))
  }
  list(gain_share = of(strong, "gain_share"), rmse_ratio = of(strong, "rmse_ratio"),
       runs_total = of(rows, "runs_total"), wall_s = of(rows, "wall_s"))
}

# What the attribution by itself said in the worlds of each mechanism: how often a right condition,
# a wrong one, none.
attributed_kinds <- function(rows) {
  strong <- strong_effects(rows)
  kinds <- vapply(strong, `[[`, "", "kind")
  do.call(rbind, lapply(unique(kinds), function(kind) {
    own <- strong[kinds == kind]
    none <- sum(vapply(own, function(r) is.na(r$attributed_condition), NA))
    right <- sum(vapply(own, condition_right, NA, "attributed_condition"))
    data.frame(kind = kind, right = right, wrong = length(own) - right - none, none = none)
  }))
}
