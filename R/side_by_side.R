# Work on several models side by side in the workers of package future, if there are any
# (future::plan()), else one after the other. No piece of it knows of another, so that results do
# not depend on the workers.

# `work(item, context)` of each item; `done(value)` is called for each when it is there. `used`:
# simulators and mechanisms of the user that the work runs.
side_by_side <- function(items, work, done, context, used) {
  from <- list(runs = runs_spent(context), found = runs_found(context))
  one <- function(item) {
    began <- list(runs = runs_so_far(), found = found_so_far())
    context$began <- began$runs - from$runs
    context$began_found <- began$found - from$found
    value <- work(item, context)
    list(value = value, runs = runs_so_far() - began$runs, found = found_so_far() - began$found)
  }
  needed <- needed_in_workers(used)
  if (length(items) < 2 || future::nbrOfWorkers() < 2 || needed$pointers) {
    return(lapply(items, function(item) {
      value <- one(item)$value
      done(value)
      value
    }))
  }
  lapply(in_workers(items, one, needed$globals), function(made) {
    count_runs(made$runs)
    count_found(made$found)
    done(made$value)
    made$value
  })
}

in_workers <- function(items, one, globals) {
  rlang::local_options(future.globals.maxSize = Inf)
  text <- paste("mechanisms side by side in", min(length(items), future::nbrOfWorkers()),
                "workers")
  counted(text, length(items), class = "amiss_item_done", {
    future.apply::future_lapply(items, function(item) {
      rlang::local_options(amiss.progress = "none")
      made <- one(item)
      piece_done(class = "amiss_item_done")
      made
    }, future.packages = setdiff(.packages(), "base"), future.seed = NULL,
    future.globals = globals, future.scheduling = Inf)
  })
}

# What user's code names in the global environment, by value, and whether something holds a pointer,
# which means nothing in another process.
needed_in_workers <- function(used) {
  seen <- new.env()
  plain(used, seen)
  names <- sub("^global ", "", grep("^global ", ls(seen), value = TRUE))
  list(globals = mget(names, globalenv()), pointers = isTRUE(seen[["pointer"]]))
}
