# The race of the trials of a step: those in front are verified, until the leader is exact and
# nobody can reach it. If none takes the error away, all are searched again.

# The next trial to verify, or NULL: of those that may be adopted and may lead the one that is
# nearest to the record, so that what the others must reach is known early; of equally near ones the
# one that ranks highest.
next_to_verify <- function(trials, present, context) {
  adoptable <- Filter(Negate(function(model) cannot_be_adopted(model, present)), trials)
  open <- Filter(function(model) model$level == "tried", adoptable)
  if (!length(open)) return(NULL)
  leader <- leader_of(Filter(is_verified, adoptable), present, context$control$decisive)
  bar <- list(factor = context$control$decisive, leader = leader %||% present,
              standing = if (is.null(leader)) -Inf else standing_of(leader, present))
  open <- Filter(function(model) could_win(model, present, bar), open)
  if (!length(open)) return(NULL)
  error <- vapply(open, least_error, 0)
  nearest <- open[rules$fallen_error * error <= min(error)]
  nearest[[which.max(vapply(nearest, standing_of, 0, present))]]$mechanism
}

# Of models with a decisive factor the one that ranks highest, or NULL.
leader_of <- function(models, present, decisive) {
  models <- Filter(function(model) log10_factor(model, present) >= decisive, models)
  if (length(models)) models[[which.max(vapply(models, standing_of, 0, present))]]
}

# If a step ends without a cause of the error, though much of it is left: trials searched again, the
# one nearest to the record first, until one of them is its cause.
second_look <- function(present, trials, context) {
  for (name in nearest_first(trials)) {
    if (is_spent(context)) break
    bar <- bar_of(trials, present, context)
    before <- trials[[name]]
    trials[[name]] <- staged(paste(name, "again"), widened_trial(before, present, bar, context))
    if (trials[[name]]$mode == before$mode) next
    report_trial(trials[[name]], present, context)
    trials <- race(present, trials, context)
    if (has_cause(trials, present, context)) return(trials)
  }
  race(present, trials, context)
}

nearest_first <- function(trials) {
  searched <- Filter(function(trial) trial$level %in% c("tried", "verified"), trials)
  names(searched)[order(vapply(searched, least_error, 0))]
}

# Whether a trial may be adopted that takes the error away.
has_cause <- function(trials, present, context) {
  best <- to_adopt(trials, present, context)
  !is.null(best) && takes_error(trials[[best$mechanism]], present)
}

# Whether a model leaves little of the error, or of what was beyond the noise.
takes_error <- function(model, present) {
  !leaves_much(model) ||
    left_over_noise(model)^2 - 1 < rules$cause_leaves * (left_over_noise(present)^2 - 1)
}

# Whether what the simulation leaves at its best is large beside the noise; fitted parameters are no
# agreement. Of given runs there are no others to look at.
leaves_much <- function(model) {
  model$level != "given" && left_over_noise(model) > rules$large_remainder
}

left_over_noise <- function(model) {
  n <- length(model$target)
  left <- over_noise(model, model$runs$outputs[, model$least$at] - model$target)
  left * sqrt(n / max(1, n - length(model$parameters)))
}

# What is to be adopted, searched again; if that changes which it is, the next one too.
confirm_best <- function(trials, present, context) {
  repeat {
    best <- to_adopt(trials, present, context)
    if (is.null(best)) return(trials)
    trial <- trials[[best$mechanism]]
    if (!is.null(trial$modes) || trial$level == "given") return(trials)
    trials[[best$mechanism]] <- staged(paste("searching", best$mechanism, "again"),
                                       searched_again(trial, present, context))
    trials <- race(present, trials, context)
  }
}

# All trials on the present model, those in front verified.
race <- function(present, trials, context) {
  repeat {
    name <- next_to_verify(trials, present, context)
    if (is.null(name) || is_spent(context)) break
    bar <- bar_of(trials[names(trials) != name], present, context)
    trials[[name]] <- staged(paste("verifying", name),
                             settled_trial(trials[[name]], present, bar, context))
    report_trial(trials[[name]], present, context)
  }
  trials
}

report_trial <- function(trial, present, context) {
  what <- switch(trial$level, silent = "changes nothing", failed = "could not be computed",
                 untried = "could not be tried: its runs failed", missed = "the budget ended",
                 unchecked = "its runs failed where its posterior lies",
                 paste0(if (is_emulated(trial))
                          paste("log10 Bayes factor", signed(log10_factor(trial, present)))
                        else "its numbers are too rough yet",
                        if (trial$level == "verified") ", verified by runs"))
  context$say("  {trial$mechanism}: {what}")
  if (trial$level == "silent") warn_no_response(trial$mechanism)
  if (trial$level == "untried") {
    said <- failure_words(trial, 1)
    warn_result(c(paste("Mechanism {.val {trial$mechanism}} could not be tried: every run of its",
                        "first look failed."), x = if (length(said)) "{said}",
                  i = "Run its simulator at a point of its priors, and see what it returns."),
                class = "amiss_warning_trial")
  }
  if (trial$level == "failed") {
    warn_result(c("Mechanism {.val {trial$mechanism}} could not be tried.", x = "{trial$reason}"),
                class = "amiss_warning_trial")
  }
}

warn_no_response <- function(mechanism) {
  warn_input(c(
    paste("Mechanism {.val {mechanism}} changes nothing: every run with it is that of the model",
          "without it."),
    i = paste("Does this record hold what it acts on, and does the simulator use its parameters?",
              "See {.code vignette(\"mechanisms\")}, Inside a simulator.")))
}
