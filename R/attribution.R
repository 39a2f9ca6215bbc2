attribution_control <- list(surrogates = 99, smallest_shift = 0.05, level = 0.05,
                            least_log10_bf = 0.5, decisive = 2,
                            ais = list(pilot_chains = 128, groups = 4, max_groups = 16,
                                       max_sweeps = 12, precision = 0.3, importance_draws = 500))

#' Which boundary conditions drive the discrepancy
#'
#' @description
#' Gives three numbers for each boundary condition:
#'
#' * the evidence that the model loses if its discrepancy may not respond to the condition,
#' * the condition's share of the misfit, and
#' * a p-value from surrogates.
#'
#' # P-values
#'
#' A surrogate shifts all conditions in time together. This keeps their autocorrelation and their
#' correlation with one another. The p-values of all conditions together come from the step-down
#' method of Westfall and Young (1993). Their smallest p-value does not grow with the number of
#' conditions.
#'
#' A shifted record stands for another record of the same weather. The conditions are therefore
#' taken as stationary over the record, in mean, variance and autocorrelation. No shift resembles a
#' condition that only rises or falls; nothing checks that.
#'
#' # Limits
#'
#' *Products.* Responses are linear in each condition's history. An effect that is a product of two
#' conditions shows only as far as one of them indicates it. A mechanism that holds a product is
#' judged by its own runs ([upgrade_model()]). It can be found even if no condition is significant.
#'
#' *Something else with the same rhythm.* If the evidence is decisive but the p-value is high, a
#' record shifted in time would do nearly as well. In a few days of weather that is so for all that
#' repeats daily. The error then responds to the condition or to something else with its rhythm.
#'
#' *A condition is not yet a cause.* A fault that changes how much a system loses or stores changes
#' its response to everything. The error may then respond to what moves the output most (in a heated
#' room the heating), not to the condition that the mechanism is named after. Conditions say where
#' to look; trials of mechanisms say what it is.
#'
#' # Groups
#'
#' Conditions with the same information hide one another: each can be dropped without harm, but not
#' both. Among conditions that can be dropped alone, a set is sought that cannot be dropped together
#' and cannot be made smaller. A group is tested like a condition. Its members are named
#' together, because this record cannot separate their effects. If there are several records, a
#' group of one record is dropped from all, because another record may separate its members.
#'
#' # Shares
#'
#' A set of conditions takes away a part of the misfit: its sum of squares, weighed by the
#' covariance of error and simulator. The share of a condition is its Shapley value. That is what it
#' adds to the conditions before it, averaged over all orders of the conditions and over the
#' posterior.
#'
#' Shares are therefore not negative. They add up to what all conditions explain together, even if
#' conditions are correlated. Two conditions with the same information share evenly. If more than 10
#' conditions act, 400 random orders stand for all.
#'
#' @param fit A calibration ([calibrate()], [calibrate_refined()]), or that of several records
#'   ([calibrate_jointly()]).
#' @param control List of options, with their defaults:
#'   * `surrogates`: number of surrogates (99; 39 if no condition earns enough evidence to matter).
#'   * `smallest_shift`: shortest shift as a share of the record (0.05).
#'   * `level`: largest p-value that is significant (0.05).
#'   * `least_log10_bf`: evidence that a condition must earn besides its p-value (0.5).
#'   * `decisive`: evidence that is significant whatever the p-value (2).
#'   * `ais`: options of [ais()].
#' @param seed Seed of the random numbers. It is that of the calibration if none is given, so that
#'   two calls say the same. `NULL` draws one.
#' @inheritParams calibrate
#' @return An object of class `amiss_attribution` with
#'
#'   * `table`: one row for each condition, ranked (see below).
#'   * `groups`: a list with one element for each group: `conditions`, `log10_bf_dropped`,
#'     `p_value`, `significant` and `correlation`, the largest between two members.
#'
#'   The columns of `table` are
#'
#'   * `boundary`: the condition.
#'   * `log10_bf_dropped`, `standard_error`: the evidence lost without the condition, with its
#'     error.
#'   * `share`: its share of the misfit.
#'   * `p_value`, `p_value_single`: the p-value among all conditions, and by itself.
#'   * `significant`: a loss of at least `decisive`, or one of at least `least_log10_bf` with a
#'     p-value of at most `level`. A member of a group has the value of the group.
#'   * `trusted`: whether the sampler is trusted.
#'   * `group`: the group, that is, conditions whose effects this record cannot separate (`NA` for
#'     none).
#'
#'   For several records: an object of class `amiss_joint_attribution` with `records`, one such
#'   object each, and `table` and `groups` of all together.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      validate = table$hour > 72)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' runs <- simulate_design(linear, room, runs = 20, seed = 1)
#' quick <- list(ais = list(pilot_chains = 48, groups = 4))  # a coarse sampler, for speed
#' fit <- calibrate(train_emulator(runs, room), room, quick, seed = 1)
#' attribute_discrepancy(fit, list(surrogates = 19), seed = 1)
#' @export
attribute_discrepancy <- function(fit, control = NULL, seed = fit$seed, threads = 1) {
  check_arguments()
  UseMethod("attribute_discrepancy")
}

#' @export
attribute_discrepancy.default <- function(fit, control = NULL, seed = fit$seed, threads = 1) {
  check_object(fit, c("amiss_calibration", "amiss_joint"), "fit")
}

#' @export
attribute_discrepancy.amiss_calibration <- function(fit, control = NULL, seed = fit$seed,
                                                    threads = 1) {
  check_object(fit, "amiss_calibration", "fit")
  check_not_part(fit)
  attribute_record(list(fit), 1, control, pick_seed(seed), check_threads(threads))
}

# Of records that were calibrated together, the discrepancy of one.
attribute_record <- function(fits, which, control, seed, threads) {
  fit <- fits[[which]]
  control <- fill_attribution_control(control, fit$control$ais, length(fit$measurements$conditions))
  records <- engine_records(fits)
  draws <- engine_draws(fits)
  conditions <- fit$measurements$conditions
  alone <- seq_along(conditions)
  asked <- utils::modifyList(control, list(least = control$least_log10_bf * log(10),
                                           decisive = control$decisive * log(10)))
  result <- staged("attributing the discrepancy", call_engine(
    attribute_(records, which, draws, asked, engine_context(seed, threads))))
  log10_bf <- result$sets$lost / log(10)
  significant <- result$significant
  table <- data.frame(boundary = conditions, log10_bf_dropped = log10_bf[alone],
                      standard_error = result$sets$standard_error[alone] / log(10),
                      share = colMeans(result$shares), p_value = result$adjusted[alone],
                      p_value_single = result$p_value[alone],
                      significant = significant[alone], trusted = result$sets$trusted[alone],
                      group = NA_character_)
  groups <- lapply(setdiff(seq_along(log10_bf), alone), function(k) {
    members <- result$sets$conditions[[k]] + 1L
    list(conditions = conditions[members], log10_bf_dropped = log10_bf[k],
         p_value = result$adjusted[k], significant = significant[k],
         correlation = largest_correlation(fit, members))
  })
  table <- with_groups(table, groups)
  table <- table[order(-table$log10_bf_dropped, -table$share), ]
  rownames(table) <- NULL
  structure(list(format_version = format_version, table = table, groups = groups,
                 lost = by_condition_set(log10_bf,
                                         lapply(result$sets$conditions,
                                                function(at) conditions[at + 1L])),
                 surrogates = nrow(result$null_statistics),
                 statistic = result$statistic, null_statistics = result$null_statistics,
                 p_value_own = stats::setNames(result$adjusted[alone], conditions),
                 control = control, labels = fit$measurements$labels, seed = seed),
            class = "amiss_attribution")
}

# Evidence lost, by the sets of conditions without which it is.
by_condition_set <- function(lost, sets) stats::setNames(lost, vapply(sets, condition_set, ""))

# In an order that does not depend on the locale, which workers need not share.
condition_set <- function(conditions) toString(sort(conditions, method = "radix"))

# As AttributionOptions::significant() of the engine.
is_significant <- function(log10_bf, p_value, control) {
  log10_bf >= control$decisive || log10_bf >= control$least_log10_bf && p_value <= control$level
}

# Each member of a group is reported with the numbers of the group.
with_groups <- function(table, groups) {
  for (group in groups) {
    members <- table$boundary %in% group$conditions
    table$group[members] <- listed(group$conditions, "or")
    table$significant[members] <- group$significant
    table$log10_bf_dropped[members] <- pmax(table$log10_bf_dropped[members], group$log10_bf_dropped)
    table$p_value[members] <- group$p_value
  }
  table
}

# A posterior of calibrate_sets() as the engine takes it.
engine_draws <- function(fits) {
  list(posterior = fits[[1]]$posterior, kept = fits[[1]]$kept,
       records = lapply(unname(fits), function(fit) {
         c(fit$posterior[c("setting", "variance", "t")], list(tangent = fit$tangent))
       }))
}

# The largest correlation between columns of two different conditions of a group, over the
# calibration rows.
largest_correlation <- function(fit, members) {
  m <- fit$measurements
  columns <- which(m$condition %in% members)
  r <- abs(stats::cor(m$boundary[fit$rows, columns, drop = FALSE]))
  max(r[outer(m$condition[columns], m$condition[columns], "!=")])
}

# The sampler of the calibration, `ais`, with what the attribution's options change.
fill_attribution_control <- function(control, ais, conditions, what = "control",
                                     call = rlang::caller_env()) {
  control <- merge_control(attribution_control, control, what, call = call)
  named <- function(option) paste0(what, "$", option)
  check_input(checkmate::check_count(control$surrogates, positive = TRUE), named("surrogates"),
              call = call)
  # A surrogate takes a millisecond at least.
  check_size(named("surrogates"), control$surrogates, matrix_gb(control$surrogates, conditions),
             hours = 1e-3 * control$surrogates / 3600, call = call)
  check_input(checkmate::check_number(control$smallest_shift, lower = 0, upper = 0.49),
              named("smallest_shift"), call = call)
  check_input(checkmate::check_number(control$level, lower = 0, upper = 1), named("level"),
              call = call)
  check_input(checkmate::check_number(control$least_log10_bf, finite = TRUE),
              named("least_log10_bf"), call = call)
  check_input(checkmate::check_number(control$decisive, lower = control$least_log10_bf,
                                      finite = TRUE),
              named("decisive"), "It must not be less than {.code least_log10_bf}.", call = call)
  ais <- merge_control(ais, control$ais, named("ais"), names(ais_defaults_()), call)
  control$ais <- fill_ais_control(ais, named("ais"), call)
  control
}

# What is reported as significant: conditions, and each group of conditions that cannot be
# distinguished as one. The paper's table has no groups.
significant_conditions <- function(table) {
  group <- table$group %||% rep(NA, length(table$boundary))
  told <- ifelse(is.na(group), table$boundary, group)
  unique(told[table$significant])
}

#' @export
print.amiss_attribution <- function(x, ...) on_stdout(x, {
  x <- told_attribution(x)
  cli::cli_text("{.strong Attribution} of the discrepancy ({x$surrogates} surrogates)")
  say_table(x$table[c("boundary", "log10_bf_dropped", "share", "p_value", "significant")])
  named <- significant_conditions(x$table)
  cli::cli_bullets(c("*" = if (length(named)) "driven by {.field {named}}"
                           else "no boundary condition is significant",
                     stats::setNames(as_said(group_words(x)), rep("!", length(group_words(x)))),
                     ">" = "next: {.fun upgrade_model} with a {.fun catalogue}"))
})

# Which conditions cannot be distinguished, by what rule, and what would distinguish them. The
# largest correlation between two of them is often far below 1, and not the reason.
group_words <- function(attribution) {
  vapply(Filter(function(g) g$significant, attribution$groups), function(g) {
    two <- length(g$conditions) == 2
    sprintf(paste("In this record %s cannot be distinguished (the discrepancy can do without %s,",
                  "but not without %s): measure while %s differ"), listed(g$conditions),
            if (two) "either one" else "some of them", if (two) "both" else "all of them",
            if (two) "the two" else "they")
  }, "")
}

# Whether a correlation is why conditions cannot be distinguished: a short record may not tell weak
# responses apart either.
go_together <- function(group) group$correlation >= rules$confounded

#' @export
tidy.amiss_attribution <- function(x, ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  x$table
}

#' @export
condition_table.amiss_calibration <- function(fit, settings) {
  attribute_discrepancy(fit, settings$control$attribution, seed = settings$seed,
                        threads = settings$threads)$table
}
