# What is missing described by what it responds to, if the simulator cannot be changed: the output
# plus a gain times the condition behind a first-order low-pass. Linear in its gain and added to the
# output, it needs no run.

#' Responses: a description of what is missing
#'
#' Extends a model by the response to a boundary condition. Use it if the simulator cannot be
#' edited, because its runs are given ([ensemble()]) or its code is closed. The extended output is
#'
#' output + gain (x - reference), smoothed by a first-order low-pass with a time constant.
#'
#' Gain and time constant are calibrated with the model's own parameters. If runs are given, the
#' response is added to them as they are: each run gets values of the new parameters from a Latin
#' hypercube. If there is a simulator, the response is added after each run.
#'
#' # A description, no mechanism
#'
#' A response says what the target responds to, how strongly and how fast, but not why. It is never
#' named as a cause.
#'
#' A single store between the condition and the target has this shape. The condition fills the
#' store, which empties at a steady rate: heat in a mass, water in a soil, charge in a capacitor. If
#' the time constant is less than a step, the store acts at once, as a direct gain or loss does. It
#' does not bend, wear off or depend on anything else.
#'
#' # Priors
#'
#' The gain is uniform about zero. Its largest value is twice the standard deviation of the target
#' divided by that of the condition, in the rows that calibrate. Unsmoothed, such a response would
#' vary twice as much as the target itself.
#'
#' The time constant is log-uniform. It goes from a quarter of a step of the record, which is at
#' once, to a sixth of its calibration rows. The low-pass starts at the first value of each segment,
#' whose history it does not know: give a `warmup`.
#'
#' # Reference
#'
#' Nothing is added at the reference. It is zero if the condition is zero for a tenth of the time,
#' as sun, rain or a heater are. Otherwise it is the condition's mean over the rows that calibrate.
#'
#' @param boundary Name of the condition, a driver column of the `measurements`. One that
#'   [circular()] marks acts by its sine and its cosine, each with a gain.
#' @param measurements The [measurements()].
#' @param unit Unit of the condition, for people.
#' @param units Units of the conditions, if they are to be shown: `c(Gv = "W/m2")`.
#' @param gain,time_constant [Priors][prior] in place of those above; the time constant is in hours.
#' @param reference Value of the condition at which nothing is added; `NULL` as above.
#' @param name Short name.
#' @return `response_mechanism()`: a [mechanism()] that edits an [ensemble()] of given runs or any
#'   simulator. `responses()`: a [catalogue()] of one for each boundary condition that is analysed.
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' table$Ti <- 20 + 0.4 * table$Te + 0.005 * table$Gv + 0.1 * cos(1:96 * 1.7)
#' room <- measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                      unit = "K", validate = table$hour > 72)
#' sun <- response_mechanism("Gv", room, unit = "W/m2")
#' sun
#' gain <- seq(0.02, 0.98, 0.03)
#' given <- ensemble(cbind(gain), 20 + outer(table$Te, gain), list(free("gain", uniform(0, 1))),
#'                   measurements = room)
#' sun$edit(given)
#' responses(room, c(Te = "K", Gv = "W/m2"))
#' @export
response_mechanism <- function(boundary, measurements, unit = "", gain = NULL, time_constant = NULL,
                               reference = NULL, name = paste("response to", boundary)) {
  check_arguments()
  check_input(checkmate::check_string(boundary, min.chars = 1), "boundary")
  check_object(measurements, "amiss_measurements", "measurements")
  check_input(checkmate::check_string(unit), "unit")
  check_input(checkmate::check_class(gain, "amiss_prior", null.ok = TRUE), "gain")
  check_input(checkmate::check_class(time_constant, "amiss_prior", null.ok = TRUE), "time_constant")
  check_input(checkmate::check_number(reference, finite = TRUE, null.ok = TRUE), "reference")
  if (!is.null(time_constant) && time_constant$lower < 0) {
    abort_input(c(paste("The prior of {.arg time_constant} begins at {.val {time_constant$lower}},",
                        "below zero."), i = "Give one of positive hours."))
  }
  response <- new_response(boundary, measurements, unit, gain, time_constant, reference)
  entry <- mechanism(
    name, function(model) with_response(model, response, measurements), boundary,
    sprintf(paste("The model lacks a response of %s to %s: described here by a gain and a time",
                  "constant, and not explained."), target_label(measurements), boundary))
  entry$response <- response
  structure(entry, class = c("amiss_response_mechanism", class(entry)))
}

#' @rdname response_mechanism
#' @export
responses <- function(measurements, units = character()) {
  check_arguments()
  check_object(measurements, "amiss_measurements", "measurements")
  check_input(checkmate::check_character(units, any.missing = FALSE,
                                         names = if (length(units)) "unique"), "units")
  check_input(checkmate::check_subset(names(units), measurements$conditions), "units",
              "Name boundary conditions that are analysed.")
  units <- c(units,
             stats::setNames(rep("", length(measurements$conditions)), measurements$conditions))
  of <- function(name) response_mechanism(name, measurements, units[[name]])
  do.call(catalogue, lapply(measurements$conditions, of))
}

#' @export
print.amiss_response_mechanism <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong {x$name}}, driven by {.field {x$boundary}}, a description and no",
                      "mechanism: {x$sentence}"))
  for (parameter in x$response$parameters) cli::cli_bullets(c("*" = "{format(parameter)}"))
  cli::cli_bullets(c(">" = "next: a {.fun catalogue} of mechanisms"))
})

describes <- function(mechanism) inherits(mechanism, "amiss_response_mechanism")

# list(boundary, circular, reference, gains, time_constant, parameters): what the response is, and
# its parameters' names.
new_response <- function(boundary, measurements, unit, gain, time_constant, reference,
                         call = rlang::caller_env()) {
  m <- measurements
  require_columns(as.data.frame(m$raw$drivers), boundary, call)
  response <- list(boundary = boundary, circular = sum(m$conditions[m$condition] == boundary) == 2)
  rows <- m$raw$use == "calibrate" & !is.na(m$raw$y)
  x <- condition_columns(response, m$raw$drivers[rows, boundary])
  spread <- apply(x, 2, stats::sd)
  if (!all(is.finite(spread) & spread > 0)) {
    abort_input(c(paste("{.arg boundary} = {.val {boundary}} does not vary over the calibration",
                        "rows, or has missing values."), i = "Name a condition that varies."),
                call = call)
  }
  response$reference <- reference %||% apply(x, 2, resting_value)
  of <- if (response$circular) paste(c("sine", "cosine"), "of", boundary) else boundary
  per <- if (response$circular) "" else if (nzchar(unit)) unit else paste("unit of", boundary)
  response$gains <- gsub("[^A-Za-z0-9_.]", "_", paste0("gain_", of))
  response$time_constant <- paste0("time_constant_", boundary)
  response$per <- per
  # Uniform also because the output is then linear in the emulator's input, so that few runs show
  # it.
  largest <- 2 * stats::sd(m$raw$y[rows]) / spread
  gains <- lapply(seq_along(of), function(i) {
    free(response$gains[i], gain %||% uniform(-largest[i], largest[i]),
         paste0(m$unit, if (nzchar(per)) paste(" per", per)),
         paste("gain of the response to", of[i]))
  })
  slowest <- sum(m$use == "calibrate") * m$step_h / 6
  lag <- free(response$time_constant,
              time_constant %||% log_uniform(m$step_h / 4, max(slowest, 2 * m$step_h)), "h",
              paste("time constant of the response to", boundary))
  response$parameters <- named_parameters(c(gains, list(lag)))
  response
}

# Flat in the logarithm: a lognormal distribution so wide that its density falls by a thousandth
# over the range.
log_uniform <- function(lower, upper) {
  lognormal(log(lower * upper) / 2, 10 * log(upper / lower), lower, upper)
}

condition_columns <- function(response, x) {
  if (response$circular) cbind(sin(x * pi / 180), cos(x * pi / 180)) else matrix(x, ncol = 1)
}

resting_value <- function(x) if (stats::quantile(abs(x), 0.1) < 0.02 * max(abs(x))) 0 else mean(x)

# The response for each row of `values` (rows of x by runs), by the filters of the discrepancy's
# history.
response_runs <- function(response, x, hours, new_segment, values) {
  columns <- sweep(condition_columns(response, x), 2, response$reference)
  filtered <- filter_bank_(columns, values[, response$time_constant], hours, new_segment)
  scaled <- sweep(filtered, 2, as.numeric(values[, response$gains]), "*")
  runs <- nrow(values)
  Reduce(`+`, lapply(seq_along(response$gains) - 1,
                     function(i) scaled[, i * runs + seq_len(runs), drop = FALSE]))
}

with_response <- function(model, response, measurements) {
  twice <- intersect(names(free_parameters(model)), names(response$parameters))
  if (length(twice)) abort_input("The model has the parameter {.val {twice[1]}} already.")
  if (inherits(model, "amiss_ensemble")) return(responding_ensemble(model, response, measurements))
  attr(model, "responses") <- c(attr(model, "responses"), list(response))
  class(model) <- union("amiss_responding", class(model))
  model
}

# ---- given runs

# Each run with the response at values of its parameters that no other has: a run used twice would
# stand in for itself where the emulator is checked by runs left out.
responding_ensemble <- function(ensemble, response, measurements) {
  m <- measurements
  check_same_rows(ensemble$hours, m)
  runs <- nrow(ensemble$unit)
  # A seed that made no other design: of the same seed, new and old parameters would go together.
  seed <- strtoi(substr(content_hash(ensemble$unit), 1, 7), 16)
  unit <- with_seed(seed, lhs::randomLHS(runs, length(response$parameters)))
  values <- unit_to_values(unit, response$parameters)
  fine <- response_runs(response, m$raw$drivers[, response$boundary], m$raw$hours,
                        c(TRUE, diff(m$raw$segment) != 0), values)
  record <- averaged_runs(fine, m)
  held <- ensemble$held_out
  if (!is.null(held))
    held$outputs <- held$outputs + record[used_rows(m, "validate"), , drop = FALSE]
  new_ensemble(c(ensemble$parameters, response$parameters), cbind(ensemble$unit, unit),
               cbind(ensemble$values, values),
               ensemble$outputs + record[used_rows(m, "calibrate"), , drop = FALSE], NULL, NA,
               hours = ensemble$hours, held_out = held)
}

# ---- simulators

# Before the responses were added.
without_responses <- function(model) {
  attr(model, "responses") <- NULL
  class(model) <- setdiff(class(model), "amiss_responding")
  model
}

#' @export
free_parameters.amiss_responding <- function(simulator) {
  c(parameters_of(without_responses(simulator)),
    do.call(c, lapply(attr(simulator, "responses"), `[[`, "parameters")))
}

#' @export
driver_names.amiss_responding <- function(simulator) {
  union(named_drivers(without_responses(simulator)),
        vapply(attr(simulator, "responses"), `[[`, "", "boundary"))
}

#' @export
simulate_runs.amiss_responding <- function(simulator, values, drivers, step_h, hold = NULL,
                                           threads = 1L, ...) {
  base <- without_responses(simulator)
  runs <- simulate_runs(base, values[, names(parameters_of(base)), drop = FALSE],
                        drivers[, named_drivers(base), drop = FALSE], step_h, hold, threads, ...)
  rows <- seq_len(nrow(drivers))
  for (response in attr(simulator, "responses")) {
    runs <- runs + response_runs(response, drivers[, response$boundary], step_h * rows, rows == 1,
                                 values)
  }
  runs
}

#' @export
print.amiss_responding <- function(x, ...) on_stdout(x, {
  print(without_responses(x))
  of <- vapply(attr(x, "responses"), `[[`, "", "boundary")
  told <- paste("with {cli::qty(of)}the response{?s} to {.field {of}}, which describe{?s/} and",
                "do{?es/} not explain")
  cli::cli_bullets(c("*" = told))
})

# ---- in words

# What an adopted response says, with its numbers; NULL for mechanisms.
description_sentence <- function(entry, fit) {
  if (!describes(entry)) return(NULL)
  response <- entry$response
  m <- record_fits(fit)[[1]]$measurements
  rows <- parameter_rows(fit)
  number <- function(name) {
    row <- rows[rows$name == name, ]
    sprintf("%s (%s)", with_unit(short(row$median), row$unit),
            interval_words(row$lower95, row$upper95))
  }
  lag <- rows$median[rows$name == response$time_constant]
  shape <- if (lag < m$step_h) {
    sprintf(paste("That is less than a step: what %s does at once, as a direct gain or loss, has",
                  "this shape."), response$boundary)
  } else {
    sprintf(paste("A store that %s fills and that empties at a steady rate has this shape, such as",
                  "heat in a mass or water in a soil."), response$boundary)
  }
  gains <- paste(vapply(response$gains, number, ""), collapse = " and ")
  sprintf(paste("This describes and does not explain: %s responds to %s with a gain of %s,",
                "smoothed over a time constant of %s. %s"), target_label(m), response$boundary,
          gains, number(response$time_constant), shape)
}

description_inspection <- function(upgrade, model) {
  response <- upgrade$catalogue[[model$mechanism]]$response
  c(description = sprintf(paste("Look for what lets %s act on %s as the response does, and add it",
                                "as a mechanism: only that would explain it."),
                          response$boundary, target_label(upgrade$measurements)))
}
