# Which of the sentences of "What to inspect next" come first, and how many people read at once.
# Each sentence has an id, its name; the id gives its place.

inspections_first <- 3L

# The ids by what their sentences would settle, those of one group in their order.
inspection_ranks <- function() {
  list(verdict = c("emulator", "sampler", "numbers", "record",
                   setdiff(names(fault_words), "constant"), "held_out", "step"),
       cause = c("separate", "rival", "site", "drift", "parts", "stand_in", "description",
                 "nearest", "undecided", "group", "answer", "answers", "noise", "pattern",
                 "driver", "constant"),
       parameters = c("tied", "edge", "loose"),
       rest = c("steps", "spikes", "small_noise", "cause", "nothing"))
}

# The sentences by rank; an id without a place is last.
ranked <- function(told) {
  place <- match(names(told), unlist(inspection_ranks()), nomatch = .Machine$integer.max)
  told <- told[order(place)]
  stats::setNames(capital(told), names(told))
}

first_inspections <- function(told) utils::head(told, inspections_first)

further_inspections <- function(told) utils::tail(told, -inspections_first)

# The last part of a printed summary: the first sentences, how many more there are, where to go on.
say_inspections <- function(told) {
  if (length(told)) cli::cli_text("{.strong What to inspect next}:")
  say_bullets(first_inspections(told))
  more <- length(further_inspections(told))
  cli::cli_bullets(c(
    ">" = if (more) "{more} more to inspect: {.code $inspect} of this summary, or {.fun report}",
    ">" = "next: {.fun report}"))
}
