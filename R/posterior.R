# Weighted draws of the parameters: their quantiles, equal ones from them, and their tables.

# Posterior draws of the parameters in the unit cube.
posterior_unit <- function(fit) fit$posterior$unit

# n draws, each with equal weight, from weighted ones; deterministic.
systematic_draws <- function(weights, n) {
  findInterval((seq_len(n) - 0.5) / n, cumsum(weights / sum(weights)), left.open = TRUE) + 1L
}

# In the order of the first parameter, so that they cover the posterior evenly.
even_draws <- function(fit, n) {
  order <- order(fit$values[, 1])
  order[systematic_draws(fit$weights[order], n)]
}

weighted_quantile <- function(x, w, probs) {
  if (length(x) == 1) return(rep(x, length(probs)))
  order <- order(x)
  cumulative <- cumsum(w[order]) / sum(w)
  stats::approx(cumulative, x[order], probs, rule = 2, ties = "ordered")$y
}

# Those that the draws are of: of one record, or of several together.
drawn_parameters <- function(fit) fit$parameters %||% fit$emulator$parameters

parameter_table <- function(fit) {
  parameters <- drawn_parameters(fit)
  rows <- lapply(names(parameters), function(n) {
    q <- weighted_quantile(fit$values[, n], fit$weights, c(0.5, 0.025, 0.975))
    data.frame(name = n, unit = parameters[[n]]$unit, median = q[1], lower95 = q[2], upper95 = q[3])
  })
  do.call(rbind, rows)
}

#' The posterior of the parameters
#'
#' Medians, intervals and covariance from the weighted draws of a calibration. For an upgrade they
#' are those of its last model.
#'
#' @param object,x A calibration ([calibrate()], [calibrate_paper()]) or an upgrade
#'   ([upgrade_model()]).
#' @param parm Names or numbers of parameters; all by default.
#' @param level,conf.level Probability that the intervals hold; their ends cut off equal tails.
#' @param what Which table of an upgrade: `"parameters"`, or the mechanisms tried, `"candidates"`.
#' @param ... Not used: an argument that is not known is an error.
#' @return
#'   * `coef()`: the posterior medians.
#'   * `confint()`: a matrix of the ends of credible intervals.
#'   * `vcov()`: the covariance of the posterior.
#'   * `tidy()`: a data frame with one row for each parameter or, if its posterior has several
#'     modes, for each mode.
#'
#'   The columns of `tidy()` name the parameter (`term`, `label`, `unit`) and give its median
#'   (`estimate`) and standard deviation (`std.error`). Two intervals follow, `conf.low` to
#'   `conf.high` and `physical.low` to `physical.high`. `modes` is the number of modes of this
#'   parameter, and `share` the part of the posterior that the row holds. `coef()`, `confint()` and
#'   `vcov()` describe all modes together.
#'
#'   `conf.low` and `conf.high` are of the calibrated value, by which the simulation is nearest to
#'   the record. What the simulator lacks may act as a parameter does, and the calibrated value then
#'   makes up for it. `physical.low` and `physical.high` count this too: between them lies the value
#'   of the quantity itself (Brynjarsdottir and O'Hagan 2014). They are `NA` after [calibrate()] and
#'   [calibrate_paper()], which know no slopes of the simulator. Each mode has its own.
#'
#'   `tidy(upgrade, "candidates")` has one row for each mechanism tried. Its columns are those of
#'   `candidates` ([upgrade_model()], *Candidates*) without the estimates, with `conf.low` and
#'   `conf.high` for the 95 % interval of `log10_bf`. `conf.level` does not change them.
#' @source Brynjarsdottir and O'Hagan (2014), Learning about physical parameters: the importance of
#'   model discrepancy, Inverse Problems 30, 114007.
#' @seealso [as_draws][as.data.frame.amiss_fit] for the draws themselves.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4))
#' table$Ti <- 20 + 0.4 * table$Te + 0.1 * cos(1:96 * 1.7)
#' m <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1)
#' model <- function_simulator(function(values, drivers) {
#'   values[["offset"]] + values[["gain"]] * drivers[, "Te"]
#' }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te")
#' fit <- calibrate(train_emulator(simulate_design(model, m, runs = 30, seed = 1), m), m,
#'                  control = list(ais = list(pilot_chains = 48, groups = 4)), seed = 1)
#' confint(fit, "gain", level = 0.9)
#' tidy(fit)
#' @name posterior
NULL

#' @rdname posterior
#' @export
coef.amiss_fit <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  table <- parameter_table(object)
  stats::setNames(table$median, table$name)
}

#' @rdname posterior
#' @export
confint.amiss_fit <- function(object, parm = NULL, level = 0.95, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  check_level(level, "level")
  names <- picked_parameters(object, parm)
  tails <- c((1 - level) / 2, (1 + level) / 2)
  ends <- vapply(names, function(n) weighted_quantile(object$values[, n], object$weights, tails),
                 c(0, 0))
  matrix(ends, ncol = 2, byrow = TRUE,
         dimnames = list(names, paste(format(100 * tails, trim = TRUE, digits = 3), "%")))
}

check_level <- function(level, name, call = rlang::caller_env()) {
  check_input(checkmate::check_number(level, lower = 1e-6, upper = 1 - 1e-6), name,
              "It is a probability.", call = call)
}

picked_parameters <- function(fit, parm, call = rlang::caller_env()) {
  names <- colnames(fit$values)
  if (is.null(parm)) return(names)
  known <- if (is.numeric(parm)) seq_along(names) else names
  if (!is.atomic(parm) || !length(parm) || !all(parm %in% known)) {
    unknown <- if (is.atomic(parm)) as.character(setdiff(parm, known)) else class(parm)
    abort_input(c("{.arg parm} names what is no parameter of this model: {.val {unknown}}.",
                  i = "Its parameters: {.val {names}}."), call = call)
  }
  if (is.numeric(parm)) names[parm] else parm
}

#' @rdname posterior
#' @export
vcov.amiss_fit <- function(object, ...) {
  check_whole(object, "object")
  rlang::check_dots_empty()
  stats::cov.wt(object$values, object$weights / sum(object$weights), method = "ML")$cov
}

#' Posterior draws as other packages take them
#'
#' Gives the draws of a calibration as one chain of equal weights, as `posterior` and `bayesplot`
#' take them. The draws of a calibration carry importance weights. Here they are resampled to equal
#' weights by a systematic rule.
#'
#' A draw of more weight than one of `draws` is repeated. Its repeats stand next to each other, as
#' in a Markov chain that does not move; apart from that the order is random. The effective
#' number of draws that `posterior` states (`ess_bulk`, `ess_tail`) therefore counts repeats only
#' once: it is about the effective number of the weighted draws, however large `draws` is, and not
#' above the number of distinct draws by more than the error of its estimate.
#'
#' Do not judge the sampler by these draws: `trust` of the fit says whether it can be trusted. R-hat
#' compares two halves of one chain and says nothing about it.
#'
#' @param x A calibration ([calibrate()], [calibrate_paper()]) or an upgrade ([upgrade_model()]),
#'   whose last model is taken.
#' @param draws Number of draws; by default as many as the fit has.
#' @param row.names,optional As [as.data.frame()] has them; `optional` is not used.
#' @param ... Not used: an argument that is not known is an error.
#' @return A data frame or matrix with one row for each draw and one column for each parameter.
#'   `as_draws()`, `as_draws_df()` and `as_draws_matrix()` of `posterior` give the class of that
#'   name.
#' @examplesIf requireNamespace("posterior", quietly = TRUE)
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4))
#' table$Ti <- 20 + 0.4 * table$Te + 0.1 * cos(1:96 * 1.7)
#' m <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1)
#' model <- function_simulator(function(values, drivers) {
#'   values[["offset"]] + values[["gain"]] * drivers[, "Te"]
#' }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te")
#' fit <- calibrate(train_emulator(simulate_design(model, m, runs = 30, seed = 1), m), m,
#'                  control = list(ais = list(pilot_chains = 48, groups = 4)), seed = 1)
#' posterior::summarise_draws(posterior::as_draws_df(fit), "mean", "sd")
#' @export
as.data.frame.amiss_fit <- function(x, row.names = NULL, optional = FALSE,
                                    draws = nrow(x$values), ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  as.data.frame(equal_draws(x, draws), row.names = row.names)
}

#' @rdname as.data.frame.amiss_fit
#' @export
as.matrix.amiss_fit <- function(x, draws = nrow(x$values), ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  equal_draws(x, draws)
}

#' @rdname as.data.frame.amiss_fit
#' @exportS3Method posterior::as_draws_matrix
as_draws_matrix.amiss_fit <- function(x, draws = nrow(x$values), ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  posterior::as_draws_matrix(equal_draws(x, draws))
}

#' @rdname as.data.frame.amiss_fit
#' @exportS3Method posterior::as_draws_df
as_draws_df.amiss_fit <- function(x, draws = nrow(x$values), ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  posterior::as_draws_df(posterior::as_draws_matrix(equal_draws(x, draws)))
}

#' @rdname as.data.frame.amiss_fit
#' @exportS3Method posterior::as_draws
as_draws.amiss_fit <- as_draws_df.amiss_fit

# Repeats of a draw stand together, so that the autocorrelation of the rows says how few they are.
# All else is in random order: halves of a chain in the order of a parameter would disagree.
equal_draws <- function(fit, n, call = rlang::caller_env()) {
  check_input(checkmate::check_count(n, positive = TRUE), "draws", call = call)
  check_run_number(n, ncol(fit$values), "draws", call)
  drawn <- even_draws(fit, n)
  place <- with_seed(fit$seed, sample.int(nrow(fit$values)))
  fit$values[drawn[order(place[drawn])], , drop = FALSE]
}

parameter_labels <- function(fit, names) {
  rows <- parameter_rows(fit)
  rows$label[match(names, rows$name)]
}

# Parameters of a calibration with their priors; `at_edge` as edge_of_prior() has it.
parameter_rows <- function(fit) {
  table <- parameter_table(fit)
  declared <- drawn_parameters(fit)[table$name]
  side <- function(u, fallback) vapply(declared, function(p) {
    limit <- prior_quantile(p$prior, u)
    if (is.finite(limit)) limit else prior_quantile(p$prior, fallback)
  }, 0)
  cbind(table, label = distinct_labels(declared), prior_lower = side(0, 0.001),
        prior_upper = side(1, 0.999), at_edge = unname(edge_of_prior(fit)[table$name]))
}

# TRUE for each parameter whose 95 % interval ends at an end of its prior, nearer than a twentieth
# of its own width, with its median in the outer tenth (in probability) at that end. A narrow
# interval in a wide prior is not at the edge, however near to the end it lies in probability.
edge_of_prior <- function(fit) {
  unit <- posterior_unit(fit)
  stats::setNames(vapply(seq_len(ncol(unit)), function(p) {
    q <- weighted_quantile(unit[, p], fit$weights, c(0.025, 0.5, 0.975))
    near <- rules$edge_interval * (q[3] - q[1])
    outer <- rules$edge_median
    (q[3] > 1 - near && q[2] > 1 - outer) || (q[1] < near && q[2] < outer)
  }, NA), colnames(fit$values))
}

posterior_centre <- function(fit) colSums(fit$weights * to_normal(posterior_unit(fit)))

# The first parameters of a fit, how many there are besides, and what makes their values doubtful.
say_parameters <- function(fit, most) {
  rows <- mode_rows(fit)
  parameters <- drawn_parameters(fit)[rows$name]
  table <- data.frame(
    parameter = labels_with_names(rows$label, rows$name),
    unit = pretty_unit(vapply(parameters, `[[`, "", "unit")),
    stats::setNames(same_decimals(rows$median, rows$lower, rows$upper),
                    c("median", "lower95", "upper95")), row.names = NULL)
  if (any(rows$modes > 1)) table$share <- share_words(rows)
  say_first(table, most)
  say_bullets(c(mode_words(fit), failing_sentence(fit), edge_sentence(fit)), "!")
}

# Of parameters with several modes.
share_words <- function(rows) ifelse(rows$modes > 1, percent(rows$share), "")

# The first parameters of a table, without a column of units if there is none.
say_first <- function(table, most) {
  if (!any(nzchar(table$unit))) table$unit <- NULL
  place <- match(table$parameter, unique(table$parameter))
  say_table(table[place <= most, ])
  more <- max(place) - most
  if (more > 0) cli::cli_text("{more} more parameter{?s}: see {.fun tidy}")
}

# How much of the posterior the simulator's failures cut off; NULL if that is hardly anything.
failing_sentence <- function(fit) {
  share <- fit$failing %||% 0
  if (share > rules$failing_told)
    sprintf("The posterior ends where the simulator fails: that cuts off %s of it.", percent(share))
}

# The parameters at the edge of their priors, and what to do about them; NULL if there is none.
edge_sentence <- function(fit) {
  rows <- parameter_rows(fit)
  edge <- rows$label[rows$at_edge]
  if (length(edge)) {
    sprintf("At the edge of what was thought possible: %s. %s for something else.", listed(edge),
            if (length(edge) == 1) "Widen this range, or suspect that the parameter makes up"
            else "Widen these ranges, or suspect that these parameters make up")
  }
}

no_edge <- "No parameter is at the edge of its range."

# Modes of a parameter: parts of its draws that a gap keeps apart, list(median, sd, lower, upper,
# from, to, share) each, with the draws at either end. A gap counts if it is a quarter of the 95 %
# interval or more and holds hardly any of the posterior, with a twentieth of it on either side. A
# density with one peak has no such gap: it falls from there on, so that three times as much lies
# beyond at most, and what is outside the interval.
parameter_modes <- function(fit, name, level = 0.95) {
  lapply(draws_of_modes(fit, name), function(own) {
    q <- weighted_quantile(own$x, own$w, c(0.5, 0.5 - level / 2, 0.5 + level / 2))
    list(median = q[1], sd = weighted_sd(own$x, own$w), lower = q[2], upper = q[3],
         from = own$x[1], to = own$x[length(own$x)], share = sum(own$w))
  })
}

weighted_sd <- function(x, w) sqrt(stats::weighted.mean((x - stats::weighted.mean(x, w))^2, w))

# The draws of each mode in their order, list(x, w) each; the weights of all sum to one.
draws_of_modes <- function(fit, name) {
  x <- fit$values[, name]
  keep <- fit$weights > 0
  order <- order(x[keep])
  x <- x[keep][order]
  w <- fit$weights[keep][order] / sum(fit$weights[keep])
  part <- findInterval(seq_along(x), gaps_between_modes(x, w) + 1)
  lapply(unname(split(seq_along(x), part)), function(own) list(x = x[own], w = w[own]))
}

# The last of rising draws x before each gap. Gaps that overlap are one, and end at their widest
# part without a draw.
gaps_between_modes <- function(x, w) {
  below <- cumsum(w)
  end <- pmin(findInterval(below + rules$mode_gap_share, below) + 1, length(x))
  part <- max(rules$mode_part, rules$mode_part_draws * sum(w^2))
  is_gap <- x[end] - x > rules$mode_gap * diff(weighted_quantile(x, w, c(0.025, 0.975))) &
    below > part & below[end] - w[end] < 1 - part
  begin <- which(is_gap)
  apart <- begin[-1] >= cummax(end[begin])[-length(begin)]
  vapply(unname(split(begin, cumsum(c(TRUE, apart))[seq_along(begin)])), function(own) {
    within <- seq(own[1], max(end[own]))
    within[which.max(diff(x[within]))]
  }, 1L)
}

# A row for each mode of each parameter.
mode_rows <- function(fit, level = 0.95) {
  label <- distinct_labels(drawn_parameters(fit))
  do.call(rbind, lapply(names(label), function(name) {
    modes <- do.call(rbind.data.frame, parameter_modes(fit, name, level))
    data.frame(name, label = label[[name]], modes, modes = nrow(modes))
  }))
}

# A sentence for each parameter of several modes, and one for those that may exchange their values.
mode_words <- function(fit) {
  label <- distinct_labels(drawn_parameters(fit))
  several <- lapply(names(label), function(name) {
    modes <- parameter_modes(fit, name)
    if (length(modes) < 2) return(NULL)
    ends <- vapply(modes, function(mode) {
      sprintf("%s (%s)", interval_words(mode$lower, mode$upper, 3), percent(mode$share))
    }, "")
    sprintf("The posterior of %s has %d modes: %s.", label[[name]], length(modes), listed(ends))
  })
  several <- unlist(several)
  exchanges <- lapply(fit$exchanges, function(pair) {
    sprintf("If %s exchange their values, nothing changes: no record tells which is which.",
            listed(label[pair]))
  })
  c(several, unlist(exchanges))
}

posterior_correlation <- function(fit) stats::cov.wt(fit$values, fit$weights, cor = TRUE)$cor

# Share of the prior's 95 % interval that the posterior's takes.
narrowing <- function(fit) {
  rows <- parameter_rows(fit)
  width <- vapply(drawn_parameters(fit)[rows$name],
                  function(p) diff(prior_quantile(p$prior, c(0.025, 0.975))), 0)
  stats::setNames((rows$upper95 - rows$lower95) / width, rows$label)
}
