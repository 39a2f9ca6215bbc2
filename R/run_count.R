# The account of runs.

# Runs of simulators that were asked for in this session, by which a study says what it costs, and
# those of them that a program's cache had. A study that is continued asks for the same runs.
ledger <- new.env(parent = emptyenv())
ledger$runs <- 0
ledger$found <- 0
ledger$seconds <- 0

runs_so_far <- function() ledger$runs

count_runs <- function(runs) ledger$runs <- ledger$runs + runs

found_so_far <- function() ledger$found

count_found <- function(runs) ledger$found <- ledger$found + runs

# A method of simulate_runs() that keeps runs notes of each whether it was found, and the seconds
# that it took when it was made.
note_found <- function(found, seconds) {
  ledger$last <- found
  ledger$seconds <- ledger$seconds + sum(seconds)
}

# Seconds of the runs that were counted last, when they were made; 0 for simulators that keep none.
last_seconds <- function() ledger$seconds

# Evaluates the code that makes `runs` runs, and counts them and those of which no part had to be
# made. `part()` is to be called for each part.
counting_runs <- function(runs, code) {
  all_found <- rep(TRUE, runs)
  ledger$seconds <- 0
  count_runs(runs)
  part <- function(made) {
    ledger$last <- NULL
    force(made)
    all_found <<- all_found & if (length(ledger$last) == runs) ledger$last else FALSE
    made
  }
  result <- code(part)
  count_found(sum(all_found))
  result
}
