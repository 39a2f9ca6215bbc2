#' A first look at a simulator, before hundreds of runs
#'
#' Makes the few runs that show whether a study can go well: one at the medians of the priors, one
#' at a low and one at a high value of each parameter, and one that starts later. It works for every
#' simulator: [function_simulator()], [zone()], [program_simulator()].
#'
#' # What to look at
#'
#' * *A run*: how long it takes, and whether it has a number for every row. If it fails, nothing
#'   else is done, and the reason is shown.
#' * *Parameters*: how much the output changes (RMS over the rows used) if the parameter goes from
#'   its 10 % to its 90 % quantile while the others stay at their medians. A parameter that changes
#'   it by less than a twentieth of the noise does not act. Its placeholder stands in the wrong
#'   place, the program rounds it away, or it has no effect here.
#' * *The start*: a run that starts later in the record, so that it knows less of the past. It
#'   counts the rows until both runs agree within the noise. `warmup` of [measurements()] should be
#'   at least that long.
#' * *The study*: how long its runs would take one after the other.
#'
#' @param simulator A simulator.
#' @param measurements [measurements()].
#' @param runs Runs of a study. Two complete examples of the package took 191 and 195
#'   (`vignette("program", "amiss")`).
#' @param threads Number of threads, for a simulator that uses them.
#' @param quiet Show no progress.
#' @return An object of class `amiss_first_look`, a list:
#'   * `seconds`: of a run.
#'   * `rows`: number of rows.
#'   * `failed`: why the first run failed, or `NULL`.
#'   * `parameters`: a data frame of `name`, `label`, `low`, `high`, `change` in the target's unit,
#'     `over_noise` and `acts`.
#'   * `start`: `rows` until a later start is forgotten (`NA` if it is not), `hours`, `warmup` in
#'     hours, `settled`.
#'   * `runs_made`: the runs that this took.
#'   * `study_s`: seconds of the study.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4))
#' table$Ti <- 20 + 0.4 * table$Te + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1)
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), free("idle", uniform(0, 1)),
#'                              boundary = "Te")
#' try_run(linear, room)
#' @export
try_run <- function(simulator, measurements, runs = 200, threads = 1, quiet = FALSE) {
  check_arguments()
  check_simulator(simulator)
  check_object(measurements, "amiss_measurements", "measurements")
  check_input(checkmate::check_count(runs, positive = TRUE), "runs")
  check_threads(threads)
  hush(quiet)
  began <- c(runs_so_far(), found_so_far())
  parameters <- free_parameters(simulator)
  centre <- quantile_values(parameters, 0.5)
  first <- first_run(simulator, centre, measurements, threads)
  look <- list(name = simulator_name(simulator), unit = measurements$unit,
               noise_sd = measurements$noise_sd, seconds = first$seconds, found = first$found,
               rows = length(first$y), failed = first$failed)
  if (is.null(first$failed)) {
    look$parameters <- parameters_act(simulator, parameters, centre, measurements, threads)
    look$start <- start_forgotten(simulator, centre, measurements, threads)
    look$study_s <- runs * first$seconds
  }
  look$runs <- runs
  look$runs_found <- found_so_far() - began[2]
  look$runs_made <- runs_so_far() - began[1] - look$runs_found
  structure(look, class = "amiss_first_look")
}

simulator_name <- function(simulator) {
  name <- if (is.list(simulator)) simulator[["name"]]
  if (checkmate::test_string(name)) name else sub("^amiss_", "", class(simulator)[1])
}

quantile_values <- function(parameters, u) {
  matrix(vapply(parameters, function(parameter) prior_quantile(parameter$prior, u), 0), 1,
         dimnames = list(NULL, names(parameters)))
}

looked_uses <- c("calibrate", "validate")

# list(y, seconds, found, failed) at the medians.
first_run <- function(simulator, centre, measurements, threads) {
  said <- character()
  found <- found_so_far()
  began <- elapsed()
  run <- tryCatch(withCallingHandlers(
    simulate_measured(simulator, centre, measurements, looked_uses, threads),
    warning = function(w) {
      said <<- c(said, conditionMessage(w))
      invokeRestart("muffleWarning")
    }), error = function(e) {
      said <<- c(said, conditionMessage(e))
      NaN
    })
  seconds <- elapsed() - began
  found <- found_so_far() > found
  lost <- which(!is.finite(run))
  failed <- if (length(lost)) {
    c(cli::ansi_strip(said),
      if (!length(said)) paste("Its output is not finite in row", lost[1], "of", length(run)))
  }
  # A program's run is timed by itself, also if it was made before.
  if (last_seconds() > 0) seconds <- last_seconds()
  list(y = run[, 1, drop = TRUE], seconds = seconds, found = found, failed = failed)
}

# The output at two values of each parameter, the others at their medians.
parameters_act <- function(simulator, parameters, centre, measurements, threads) {
  low <- quantile_values(parameters, 0.1)[1, ]
  high <- quantile_values(parameters, 0.9)[1, ]
  values <- centre[rep(1, 2 * length(parameters)), , drop = FALSE]
  for (k in seq_along(parameters)) values[2 * k - 1:0, k] <- c(low[k], high[k])
  runs <- suppressWarnings(simulate_measured(simulator, values, measurements, looked_uses, threads))
  change <- vapply(seq_along(parameters), function(k) {
    sqrt(mean((runs[, 2 * k] - runs[, 2 * k - 1])^2))
  }, 0)
  over_noise <- change / measurements$noise_sd
  data.frame(name = names(parameters), label = distinct_labels(parameters),
             low = unname(low), high = unname(high), change = change, over_noise = over_noise,
             acts = ifelse(is.finite(change), over_noise >= rules$off_change, NA),
             row.names = NULL)
}

# How long a start is remembered: list(rows, hours, warmup, settled), by a run over the longest
# segment and one that starts after the first third of it.
start_forgotten <- function(simulator, centre, measurements, threads) {
  rows <- which(measurements$use %in% looked_uses & !is.na(measurements$y))
  pieces <- simulated_rows(measurements, rows)
  within <- pieces[[which.max(lengths(pieces))]]
  later <- within[-seq_len(length(within) %/% 3)]
  run <- function(rows) {
    counting_runs(1, function(part) {
      part(suppressWarnings(simulate_rows(simulator, centre, measurements$raw, rows, threads,
                                          rlang::caller_env())))[, 1]
    })
  }
  known <- utils::tail(run(within), length(later))
  apart <- abs(run(later) - known)
  if (anyNA(apart)) return(list(rows = NA, hours = NA, warmup = NA, settled = NA))
  last <- max(which(apart >= measurements$noise_sd), 0)
  settled <- last < length(later)
  warmup <- (match(TRUE, measurements$block[within] %in% rows) - 1) * measurements$raw$step_h
  hours <- last * measurements$raw$step_h
  list(rows = if (settled) last else NA, hours = if (settled) hours else NA, warmup = warmup,
       first = apart[1], settled = settled && hours <= warmup + 1e-9, watched = length(later))
}

#' @export
print.amiss_first_look <- function(x, ...) on_stdout(x, {
  cli::cli_text(
    "{.strong First look} at {.val {x$name}}: {x$runs_made} run{?s} made, {x$runs_found} found")
  if (is.null(x$failed)) {
    cli::cli_bullets(
      c("v" = "A run takes {short(x$seconds)} s and has a number in each of {x$rows} rows."))
    say_acting(x)
    say_start(x$start)
    cli::cli_bullets(c("*" = paste("A study of {x$runs} runs would take about",
                                   "{time_words(x$study_s)}, one after the other.")))
  } else {
    cli::cli_bullets(c("x" = "The first run failed."))
    say_bullets(one_line(x$failed), "x")
  }
})

say_acting <- function(x) {
  table <- x$parameters
  table$parameter <- labels_with_names(table$label, table$name)
  inert <- table$parameter[table$acts %in% FALSE]
  lost <- table$parameter[is.na(table$acts)]
  shown <- utils::head(
    table[order(-table$over_noise), c("parameter", "low", "high", "change", "over_noise")], 6)
  say_table(shown)
  if (length(inert))
    cli::cli_bullets(c("!" = paste("{.val {inert}} {?does/do} not act: the output stays within",
                                   "{rules$off_change} of the noise.")))
  if (length(lost)) cli::cli_bullets(c("x" = paste("The runs fail at low or high {.val {lost}}:",
                                                   "narrow {?its/their} prior{?s}.")))
}

say_start <- function(start) {
  if (is.na(start$settled)) return(cli::cli_bullets(c("x" = "A run that starts later fails.")))
  if (is.na(start$rows)) {
    told <- c("!" = paste("The start is not forgotten within {start$watched} rows: the simulator",
                          "remembers longer than the record, or its output depends on when it",
                          "starts."))
  } else {
    told <- paste("The start is forgotten after {start$rows} row{?s} ({short(start$hours)} h);",
                  "{short(start$warmup)} h are run before a value is compared")
    more <- if (!start$settled) ": give {.arg warmup} or {.arg lead_in} that length"
    told <- stats::setNames(paste0(told, more, "."), if (start$settled) "v" else "!")
  }
  cli::cli_bullets(told)
}
