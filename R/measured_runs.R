# Runs of a simulator over a measured record.

# Runs over the segments that hold rows of the wanted uses, averaged like the measurements: one row
# for each used row.
simulate_measured <- function(simulator, values, measurements, uses, threads,
                              call = rlang::caller_env()) {
  check_driver_columns(simulator, measurements, call)
  rows <- which(measurements$use %in% uses & !is.na(measurements$y))
  pieces <- simulated_rows(measurements, rows)
  over <- if (length(pieces) > 1) paste0(" (", length(pieces), " segments)")
  out <- counting_runs(nrow(values), function(part) {
    out <- matrix(NaN, length(measurements$y), nrow(values))
    counted(paste0("runs of the simulator", over), length(pieces) * nrow(values),
            for (i in seq_along(pieces)) {
              within <- pieces[[i]]
              fine <- part(simulate_rows(simulator, values, measurements$raw, within,
                                         threads, call))
              averaged <- block_means(fine, measurements$block[within], measurements$per_step)
              out[as.integer(rownames(averaged)), ] <- averaged
              piece_done(i * nrow(values))
            })
    out
  })
  out[rows, , drop = FALSE]
}

# The rows of the raw record, segment by segment, that a simulator runs over to give these rows of
# the averaged one.
simulated_rows <- function(measurements, rows) {
  wanted <- which(measurements$block %in% rows)
  lapply(unique(measurements$segment[rows]), function(segment) {
    within <- which(measurements$raw$segment == segment)
    within[within <= max(intersect(within, wanted))]  # what comes later changes nothing
  })
}

check_driver_columns <- function(simulator, measurements, call, mechanism = NULL) {
  present <- colnames(measurements$raw$drivers)
  absent <- setdiff(named_drivers(simulator), present)
  if (!length(absent)) return(invisible())
  abort_input(c(paste("The simulator", if (!is.null(mechanism)) "with mechanism {.val {mechanism}}",
                      "needs {cli::qty(absent)}column{?s} {.val {absent}}, which the measurements",
                      "do not have."), i = "Columns there: {.val {present}}."),
              call = call)
}

# Runs over rows of the raw record, all of one segment.
simulate_rows <- function(simulator, values, raw, rows, threads, call) {
  needed <- named_drivers(simulator)
  for (column in needed) {
    bad <- rows[!is.finite(raw$drivers[rows, column])]
    if (length(bad)) {
      abort_input(c(paste("Driver {.val {column}} has {length(bad)} missing value{?s}; the first",
                          "is in row {bad[1]} ({format(raw$time[bad[1]])})."),
                    i = paste("A simulator needs every value of what drives it: fill the gap, or",
                              "remove these rows as a whole.")), call = call)
    }
  }
  given <- segment_drivers(simulator, raw, rows, needed)
  runs <- simulate_runs(simulator, values, given$drivers, raw$step_h, given$hold, threads,
                        time = given$time, segment = raw$segment[rows[1]])
  if (given$lead) runs[-seq_len(given$lead), , drop = FALSE] else runs
}

# Rows of the raw record averaged like the measurements; the names of the rows are those of the
# blocks.
block_means <- function(fine, block, per_step) {
  whole <- !is.na(block)
  rowsum(fine[whole, , drop = FALSE], block[whole], reorder = TRUE) / per_step
}
