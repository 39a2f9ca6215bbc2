# What every stage of the loop is given beside its data: seed, threads, options of the stages, the
# budget of runs, the store of finished work, and the way to say something. A point takes a run of
# each of `records`.

new_context <- function(seed, threads, control, keep = function(name, value) value,
                        say = function(...) NULL, budget = NULL, records = 1) {
  list(seed = seed, threads = threads, control = control, keep = keep, say = say,
       budget = budget %||% Inf, records = records, began = runs_so_far(),
       began_found = found_so_far())
}

runs_left <- function(context) context$budget - runs_spent(context)

runs_spent <- function(context) runs_so_far() - context$began

# Those of them that were not made: a program's cache had them.
runs_found <- function(context) found_so_far() - context$began_found

is_spent <- function(context) points_left(context) < 1

# Points at which the simulator may still be run.
points_left <- function(context) floor(max(0, runs_left(context)) / context$records)

# For a stage that leaves a part of the budget to those after it, but for the `points` that it
# cannot do without.
sparing <- function(context, share, points = 0)
  at_most(context, max(share * runs_left(context) / context$records, points))

at_most <- function(context, points) {
  context$budget <- min(context$budget, runs_spent(context) + points * context$records)
  context
}

# For a stage that leaves `points` to the next one.
leaving <- function(context, points) {
  context$budget <- context$budget - points * context$records
  context
}
