# What a mechanism explains by itself. The Bayes factor of a trial allows an unknown response to the conditions of its
# mechanism in both models, so that the true cause competes with a response that can imitate it. Without that response
# in either model,
#     Z1(-s) / Z0(-s) = (Z1 / Z0) (Z0 / Z0(-s)) / (Z1 / Z1(-s)),
# s the conditions of the mechanism: the factor, and what the present model loses without the response more than the
# extension does.

# log10 factors of trials, NA of those that are not trusted or whose mechanism has no condition.
explained_factors <- function(trials, present, catalogue, context) {
  conditions <- lapply(trials, function(trial) sort(catalogue[[trial$mechanism]]$boundary))
  explains <- vapply(seq_along(trials), function(k) is_explanation(trials[[k]], conditions[[k]]), NA)
  each <- unique(conditions[explains])
  before <- vapply(each, function(of) lost_without(present, of, context), 0)
  factors <- vapply(seq_along(trials), function(k) {
    if (!explains[k]) return(NA_real_)
    log10_factor(trials[[k]], present) + before[match(conditions[k], each)] -
      lost_without(trials[[k]], conditions[[k]], context)
  }, 0)
  stats::setNames(factors, names(trials))
}

is_explanation <- function(trial, conditions) {
  length(conditions) > 0 && !is.null(trial$fit) && isTRUE(trial$fit$trust$trusted)
}

# Decades of evidence that a model loses if its discrepancies do not respond to some conditions.
lost_without <- function(model, conditions, context) {
  fits <- record_fits(model$fit)
  ais <- fill_attribution_control(context$control$attribution, fits[[1]]$control$ais,
                                  length(fits[[1]]$measurements$conditions))$ais
  dropped <- lapply(unname(fits), function(fit) which(fit$measurements$conditions %in% conditions) - 1L)
  if (!any(lengths(dropped))) return(0)
  call_engine(drop_conditions_(engine_records(fits), engine_draws(fits), dropped, ais,
                               engine_context(context$seed, context$threads)))$lost / log(10)
}
