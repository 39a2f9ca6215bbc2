# What every stage of the loop is given beside its data: seed, threads, options of the stages, the
# budget of runs, the store of finished work, and the way to say something.

new_context <- function(seed, threads, control, keep = function(name, value) value,
                        say = function(...) NULL, budget = NULL) {
  list(seed = seed, threads = threads, control = control, keep = keep, say = say,
       budget = budget %||% Inf, began = runs_so_far(), began_found = found_so_far())
}

runs_left <- function(context) context$budget - runs_spent(context)

runs_spent <- function(context) runs_so_far() - context$began

# Runs that were asked for and not made: a program's cache had them.
runs_found <- function(context) found_so_far() - context$began_found

is_spent <- function(context) runs_left(context) < 1
