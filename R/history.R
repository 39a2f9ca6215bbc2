# The discrepancy as a response to the history of the boundary conditions, as the engine takes it.

# Filter responses over the whole averaged record, so that each calibration row knows its history.
filter_responses <- function(measurements, time_constants) {
  all <- seq_along(measurements$y)
  filter_bank_(measurements$boundary, time_constants, measurements$hours,
               segment_starts(measurements, all))
}

# What the engine needs of a record, whatever the simulator.
record_history <- function(measurements, rows, control) {
  responses <- filter_responses(measurements, control$time_constants)
  list(y = measurements$y[rows], responses = responses[rows, , drop = FALSE],
       condition = rep(measurements$condition - 1L, each = length(control$time_constants)),
       time = measurements$hours[rows], new_segment = segment_starts(measurements, rows))
}

history_data <- function(emulator, measurements, rows, control) {
  c(record_history(measurements, rows, control),
    list(basis = emulator$basis$vectors, moves = simulator_moves(emulator)))
}

history_priors <- function(measurements, control, n, discarded_variance) {
  list(noise_sd = measurements$noise_sd, noise_shape = n * control$confidence,
       discarded_variance = discarded_variance, inclusion = control$inclusion,
       amplitude = control$amplitude, correlation_times = control$error_times,
       ratios = control$error_ratios, reach = control$reach)
}
