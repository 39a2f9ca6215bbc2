# Parameters that may exchange their values unnoticed, as two stores in a row may. Searches and
# emulator look at one order of them, and draws are spread over all.

# The model with `exchanges`: pairs of parameters of one unit whose exchange changes none of the
# runs nearest to the record; and `images`, the runs at the mode with another pair exchanged. Only
# pairs that lie apart at the mode, as its search sees it, are looked at.
with_exchanges <- function(model, mode, context) {
  unit <- vapply(model$parameters, `[[`, "", "unit")
  pairs <- which(outer(unit, unit, "==") & upper.tri(diag(length(unit))), arr.ind = TRUE)
  model$exchanges <- Filter(function(pair) is_apart(model, mode, pair), asplit(unname(pairs), 1))
  model$images <- integer()
  model <- with_unnoticed(model, mode$at, context)
  images <- model$images
  nearest <- utils::head(order(squared_misfit(model)), rules$first_check)
  model <- with_unnoticed(model, setdiff(nearest, mode$at), context)
  model$images <- images
  model
}

# Where two parts of a model are alike, its other modes lie near to where they have exchanged a
# parameter. If the simulator gives its slopes, searches from there cost a few runs each:
# list(model, modes, agree) with what they find beside the only mode that is known. Of an extension
# only exchanges with a `new` parameter are searched: the others were with the model before.
from_images <- function(found, context, new = names(found$model$parameters)) {
  found$model <- with_exchanges(found$model, found$modes[[1]], context)
  moved <- abs(t(found$model$runs$z[found$model$images, , drop = FALSE]) -
                 found$model$runs$z[found$modes[[1]]$at, ])
  for (at in found$model$images[colSums(moved[new, , drop = FALSE]) > 1e-6]) {  # not by rounding
    slopes <- given_slopes(found$model, found$model$runs$z[at, ])
    if (is.null(slopes) || is_spent(context)) break
    search <- begin_search(found$model, at, slopes, 0, alone = TRUE)
    search$known <- found$modes
    search <- run_search(search, context)
    found$model <- search$model
    if (!has_arrived(search)) found$modes <- c(found$modes, list(search))
  }
  found
}

is_apart <- function(model, mode, pair) {
  z <- model$runs$z[mode$at, , drop = FALSE]
  apart <- (in_order(model, z, exchanged(seq_along(z), pair)) - z)[1, ]
  isTRUE(sum(apart * solve(conditioned(mode$covariance), apart)) > length(apart))
}

# Of the exchanges those that change none of some runs; the others' runs are `images`.
with_unnoticed <- function(model, runs, context) {
  z <- model$runs$z[runs, , drop = FALSE]
  images <- lapply(model$exchanges,
                   function(pair) in_order(model, z, exchanged(seq_len(ncol(z)), pair)))
  possible <- lapply(images, stats::complete.cases)
  of <- rep(seq_along(images), vapply(possible, sum, 0L))
  if (!length(of)) return(model)
  made <- with_runs(model, do.call(rbind, Map(function(image, fine) image[fine, , drop = FALSE],
                                              images, possible)), context)
  model <- made$model
  from <- unlist(lapply(possible, function(fine) runs[fine]))[seq_along(made$at)]
  outputs <- model$runs$outputs
  change <- over_noise(model, outputs[, made$at, drop = FALSE] - outputs[, from, drop = FALSE])
  is_same <- seq_along(of) %in% which(change < rules$off_change)
  model$exchanges <- model$exchanges[setdiff(seq_along(images), of[!is_same])]
  model$images <- made$at[!is_same[seq_along(made$at)]]
  model
}

exchanged <- function(order, pair) replace(order, pair, order[rev(pair)])

# All orders of the parameters that exchanges lead to, the first one as they are.
orders_by <- function(exchanges, p) {
  orders <- list(seq_len(p))
  repeat {
    more <- lapply(orders, function(order) lapply(exchanges, function(e) exchanged(order, e)))
    more <- unique(c(orders, unlist(more, recursive = FALSE)))
    if (length(more) == length(orders)) return(orders)
    orders <- more
  }
}

# Points (one a row) with the values of the parameters in another order; NA if a prior does not
# allow them.
in_order <- function(model, z, order) {
  values <- unit_to_values(to_unit(z, model$space), model$parameters)
  unit <- values_to_unit(values[, order, drop = FALSE], model$parameters)
  outside <- rowSums(unit <= 0 | unit >= 1) > 0
  image <- from_unit(unit, model$space)
  image[outside, ] <- NA
  image
}

# The mode of those that are known to which a search has come in another order of the parameters; or
# NULL.
known_image <- function(model, search, modes) {
  z <- model$runs$z[search$at, , drop = FALSE]
  for (order in orders_by(model$exchanges, ncol(z))[-1]) {
    image <- in_order(model, z, order)[1, ]
    for (mode in modes) {
      apart <- image - model$runs$z[mode$at, ]
      if (isTRUE(sum(apart * solve(conditioned(mode$covariance), apart)) < 2 * length(apart)))
        return(mode)
    }
  }
}

# Calibrations with draws (`unit`, of all parameters) in all orders, and with the evidence of all.
# Only `values` are in these orders: the emulator knows one, and predicts what all do.
over_orders <- function(model, fits, unit, seed) {
  if (!length(model$exchanges)) return(fits)
  orders <- orders_by(model$exchanges, ncol(unit))
  odds <- order_odds(model, unit, orders)
  total <- rowSums(odds)
  ends <- t(apply(odds / total, 1, cumsum))[, -length(orders), drop = FALSE]
  chosen <- 1 + rowSums(with_seed(seed, stats::runif(nrow(unit))) > ends)
  values <- unit_to_values(unit, model$parameters)
  for (k in seq_along(orders)) {
    values[chosen == k, ] <- values[chosen == k, orders[[k]], drop = FALSE]
  }
  weights <- fits[[1]]$weights * total
  gain <- log(sum(weights) / sum(fits[[1]]$weights))
  Map(function(fit, own) {
    fit$values[] <- values[, own]
    fit$weights <- fit$posterior$weights <- weights / sum(weights)
    fit$log_evidence <- fit$log_evidence + gain
    fit$interval <- fit$interval + gain
    fit$exchanges <- lapply(model$exchanges, function(pair) names(model$parameters)[pair])
    fit
  }, fits, model$own)
}

# What the priors say of each order against the first one, a column each. An order that the region
# holds has draws of its own.
order_odds <- function(model, unit, orders) {
  z <- from_unit(unit, model$space)
  log_prior <- function(unit) {
    values <- unit_to_values(unit, model$parameters)
    Reduce(`+`, lapply(seq_along(model$parameters),
                       function(j) log(prior_density(model$parameters[[j]]$prior, values[, j]))))
  }
  odds <- vapply(orders[-1], function(order) {
    image <- in_order(model, z, order)
    possible <- stats::complete.cases(image)
    image[!possible, ] <- 0
    image <- to_unit(image, model$space)
    counts <- possible & region_distance(model$region, image) > 1
    ifelse(counts, exp(log_prior(image) - log_prior(unit)), 0)
  }, numeric(nrow(z)))
  cbind(1, odds)
}
