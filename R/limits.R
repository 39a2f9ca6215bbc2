# Sizes that cannot finish are refused before work starts, with an estimate of what they would take.
# The estimates are rough ones, made to be rather low.

largest_gb <- 4
longest_h <- 24
largest_failed_share <- 0.2  # of the runs at posterior draws, or of the values of a likelihood
longest_path <- 4000  # bytes of the name of a folder

# `option`: what asks for so much.
check_size <- function(option, value, gb = 0, hours = 0, call = rlang::caller_env()) {
  if (gb <= largest_gb && hours <= longest_h || isTRUE(getOption("amiss.allow_large")))
    return(invisible(TRUE))
  needs <- c(if (gb > largest_gb) paste(signif(gb, 2), "GB of memory"),
             if (hours > longest_h) paste(signif(hours, 2), "hours of computing"))
  abort_input(c("{.arg {option}}{value_words(value)} would take about {needs}.",
                i = paste("Give less. If it is meant, allow it by",
                          "{.code options(amiss.allow_large = TRUE)}, or by {.code --large} on the",
                          "command line.")), call = call)
}

matrix_gb <- function(rows, columns, copies = 1) 8e-9 * rows * columns * copies

# Runs of the simulator at the rows of a record, and the series made of them.
check_run_number <- function(runs, rows, option = "runs", call = rlang::caller_env()) {
  check_size(option, runs, matrix_gb(rows, runs, copies = 4), call = call)
}

# An emulator of so many runs: the matrix that Gaussian processes invert.
check_training_size <- function(runs, option = "runs", value = runs, call = rlang::caller_env()) {
  check_size(option, value, matrix_gb(runs, runs), hours = runs^3 * 1e-9 / 3600, call = call)
}

# A grid of all ratios of all error times at each reach: the engine keeps about three matrices for
# each setting.
check_settings_size <- function(control, condition_columns, what, call = rlang::caller_env()) {
  settings <- length(control$reach) * length(control$error_ratios)^length(control$error_times)
  columns <- 2 + condition_columns * length(control$time_constants)
  option <- if (length(control$error_ratios) >= length(control$reach)) "error_ratios" else "reach"
  check_size(paste0(what, "$", option, " (", length(control[[option]]), " values)"),
             control[[option]], matrix_gb(columns, columns, copies = 3 * settings), call = call)
}

# Annealing visits at least ten temperatures; a likelihood takes at least 20 microseconds.
check_sampler_size <- function(ais, what, call = rlang::caller_env()) {
  counts <- c(pilot_chains = ais$pilot_chains,
              groups = ais$groups * if (ais$chains > 0) ais$chains else 32,
              importance_draws = ais$importance_draws)
  counts[1:2] <- 10 * counts[1:2] * max(ais$sweeps, 1)
  largest <- names(which.max(counts))
  check_size(paste0(what, "$", largest), ais[[largest]], hours = 2e-5 * sum(counts) / 3600,
             call = call)
}

# Substeps of all runs, components and cells of a zone; at most 40 cells a component are usual.
check_zone_size <- function(zone, runs, rows, step_s, control, call = rlang::caller_env()) {
  steps <- step_s / control$max_substep_s
  if (steps > 1e8) {
    abort_input(paste("{.arg step_s} = {step_s} has more than 1e8 steps of",
                      "{.arg control$max_substep_s} = {control$max_substep_s} s."), call = call)
  }
  components <- max(1, length(zone$components))
  hours <- 2e-7 * runs * rows * ceiling(steps) * components * (1 + control$cells / 3) / 3600
  largest <- which.max(c(steps, control$cells, runs))
  check_size(c("control$max_substep_s", "control$cells", "values (rows)")[largest],
             c(control$max_substep_s, control$cells, runs)[largest],
             matrix_gb(40 * control$cells, components), hours, call)
}

# Runs at the rows of the measurements, and an emulator of them; each round of refinement makes 1.3
# times as many.
check_runs_asked <- function(runs, measurements, call = rlang::caller_env()) {
  check_input(checkmate::check_count(runs, positive = TRUE), "runs", call = call)
  check_run_number(runs, length(measurements$raw$hours), call = call)
  check_training_size(runs, call = call)
}
