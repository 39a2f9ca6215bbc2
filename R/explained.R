# What a mechanism explains by itself. If both models may respond to the conditions of the mechanism
# in an unknown way, the true cause competes with a response that can imitate it. With that response
# in neither model, the Bayes factor is Z1(-s) / Z0(-s) = (Z1 / Z0) (Z0 / Z0(-s)) / (Z1 / Z1(-s)), s
# the conditions of the mechanism: the factor Z1 / Z0 with the response in both, and what the
# mechanism takes away of the evidence for that response. It decides; the factor with the response
# in both must not speak against it.

# Mechanisms are compared with one another with no unknown response to any condition of the
# catalogue in any model. What each takes away of its own conditions grows with their number, and is
# no measure of which is better.

# A trial with both, in decades: what it takes away of its own conditions (`taken`) and of all of
# the catalogue (`taken_of_all`).
with_taken <- function(trial, present, context) {
  own <- present$conditions[[trial$mechanism]]
  trial$taken <- taken_away(trial, present, own, context)
  trial$taken_of_all <-
    if (setequal(own, present$catalogued)) trial$taken
    else taken_away(trial, present, present$catalogued, context)
  trial
}

# By how much more the present model needs the response to some conditions than the extension does.
taken_away <- function(trial, present, conditions, context) {
  if (!length(conditions)) return(0)
  present$lost[[condition_set(conditions)]] - lost_without(trial, conditions, context)
}

# The present model with the conditions of the mechanisms that are left, each and together, and what
# it loses without a response to them. `known`: losses by set that were computed before.
with_losses <- function(model, catalogue, known, context) {
  model$conditions <- lapply(catalogue, function(mechanism) sort(mechanism$boundary))
  model$catalogued <- sort(unique(unlist(model$conditions, use.names = FALSE)))
  sets <- unique(Filter(length, c(unname(model$conditions), list(model$catalogued))))
  model$lost <- by_condition_set(lapply(sets, function(conditions) {
    set <- condition_set(conditions)
    if (set %in% names(known)) known[[set]] else lost_without(model, conditions, context)
  }), sets)
  model
}

# Decades of evidence that a model loses if its discrepancies do not respond to some conditions.
lost_without <- function(model, conditions, context) {
  fits <- record_fits(model$fit)
  ais <- fill_attribution_control(context$control$attribution, fits[[1]]$control$ais,
                                  length(fits[[1]]$measurements$conditions))$ais
  dropped <- lapply(unname(fits),
                    function(fit) which(fit$measurements$conditions %in% conditions) - 1L)
  if (!any(lengths(dropped))) return(0)
  call_engine(drop_conditions_(engine_records(fits), engine_draws(fits), dropped, ais,
                               engine_context(context$seed, context$threads)))$lost / log(10)
}

# ---- what each mechanism leaves of the responses

# Decades of evidence that the error responds to boundary conditions: of the present model ("no
# change") to each, by its attribution; of each trial whose numbers are trusted to those that drive
# its mechanism, together.
response_table <- function(trials, present, attribution) {
  before <- attribution$table[c("boundary", "log10_bf_dropped")]
  trusted <- Filter(function(trial) isTRUE(trial$fit$trust$trusted), trials)
  rows <- lapply(trusted, function(trial) {
    conditions <- present$conditions[[trial$mechanism]]
    if (!length(conditions)) return(NULL)
    lost <- present$lost[[condition_set(conditions)]]
    data.frame(mechanism = trial$mechanism, condition = conditions, before = lost,
               left = lost - trial$taken)
  })
  unchanged <- data.frame(mechanism = "no change", condition = before$boundary,
                          before = before$log10_bf_dropped, left = before$log10_bf_dropped)
  table <- cbind(from = present$name, do.call(rbind, c(list(unchanged), unname(rows))))
  rownames(table) <- NULL
  table
}
