# Runs of a zone.

zone_control <- list(max_substep_s = 300, cells = 1, spinup = 0L, initial_hours = 24)

#' Simulate a zone
#'
#' @param zone A [zone()].
#' @param values Matrix of M runs x P parameters with column names; every free parameter needs a
#'   column. `NULL` for a zone without free parameters: one run.
#' @param drivers Numeric matrix with column names, one row per interval: means over the interval. A
#'   warning names what seems to be no measurement: codes for a missing value, values far outside
#'   all others, stuck readings, counters.
#' @param step_s Length of an interval, s.
#' @param hold Air temperature (degC) to be prescribed in each interval, `NA` in intervals in which
#'   it is free; `NULL` for none. Holding the first intervals at the measurement lets the walls
#'   forget their unknown past.
#' @param threads Number of threads; the result does not depend on it.
#' @param control List of options, with their defaults. Calibrations take the defaults; a
#'   [function_simulator()] may call `simulate_zone()` with others.
#'   * `max_substep_s`: longest step in s (300).
#'   * `cells`: refinement of the walls (1).
#'   * `spinup`: times that the leading held rows are repeated first (0).
#'   * `initial_hours`: hours of data that give the walls their first outside temperature (24).
#' @param flux Name of a wall whose heat flux is wanted instead of the air temperature.
#' @return Matrix of mean air temperatures, degC, or of mean heat fluxes at the inner surface of the
#'   wall, W/m2, positive into the room. It has one row per interval and one column per run; a run
#'   that fails is `NaN`.
#' @examples
#' weather <- synthetic_weather(1, seed = 1)
#' weather$RHP <- rolbs(nrow(weather), power = 100, seed = 1)
#' values <- cbind(outer_k = 1.05, outer_c = 3361, insulation_k = c(0.040, 0.048),
#'                 insulation_c = 179, heater_radiant = 0.79)
#' air <- simulate_zone(paper_box("M2"), values, as.matrix(weather[-1]), step_s = 900)
#' dim(air)
#' @export
simulate_zone <- function(zone, values = NULL, drivers, step_s, hold = NULL, threads = 1L,
                          control = list(), flux = NULL) {
  check_arguments()
  runs <- zone_runs(zone, values, drivers, step_s, hold, threads, control, flux)
  read <- intersect(colnames(drivers), zone_boundary(zone))
  warn_findings(table_findings(lapply(stats::setNames(nm = read), function(name) drivers[, name])),
                "drivers")
  runs
}

# The same of drivers that a record has checked.
zone_runs <- function(zone, values, drivers, step_s, hold, threads, control = list(), flux = NULL,
                      call = rlang::caller_env()) {
  parameters <- names(zone_parameters(zone))
  if (is.null(values)) values <- matrix(0, 1, 0)
  check_input(checkmate::check_matrix(values, mode = "numeric", any.missing = FALSE, min.rows = 1),
              "values", call = call)
  check_values(colnames(values), parameters, call)
  check_named_columns(values, "values", parameters, call)
  check_drivers(zone, drivers, call)
  check_input(checkmate::check_number(step_s, lower = 1e-3, finite = TRUE), "step_s", call = call)
  threads <- check_threads(threads, call)
  if (is.null(hold)) hold <- numeric()
  check_input(checkmate::check_numeric(hold), "hold", call = call)
  if (!length(hold) %in% c(0, nrow(drivers)) || any(is.infinite(hold))) {
    abort_input(c(paste("{.arg hold} must have one finite number or NA per row of the drivers; got",
                        "{length(hold)} values."), i = "The drivers have {nrow(drivers)} rows."),
                call = call)
  }
  control <- check_zone_control(control, call)
  if (!is.null(flux)) control$flux_wall <- wall_number(zone, flux, "flux", call)
  check_zone_size(zone, nrow(values), nrow(drivers), step_s, control, call)
  # Every field is a multiple of one parameter and may lie in an interval: what holds for the
  # extremes holds between them.
  fields <- free_fields(unclass(zone))
  extremes <- vapply(parameters, function(p) range(values[, p]), numeric(2))
  for (i in seq_len(if (nrow(values) > 1) 2 else 1)) resolve_zone(zone, fields, extremes[i, ], call)
  storage.mode(drivers) <- "double"
  call_engine(zone_simulate_(index_zone(unclass(zone), colnames(drivers)),
                             lapply(fields, `[[`, "path"), field_values(fields, values),
                             drivers, step_s, as.numeric(hold), control,
                             engine_context(0, threads)), call)
}

check_drivers <- function(zone, drivers, call) {
  check_input(checkmate::check_matrix(drivers, mode = "numeric", min.rows = 1,
                                      col.names = "unique"), "drivers", call = call)
  needed <- zone_boundary(zone)
  absent <- setdiff(needed, colnames(drivers))
  if (length(absent) > 0) {
    abort_input(c("The zone needs columns that {.arg drivers} does not have: {.val {absent}}.",
                  i = "Columns given: {.val {colnames(drivers)}}."), call = call)
  }
  gaps <- needed[!apply(is.finite(drivers[, needed, drop = FALSE]), 2, all)]
  if (length(gaps) > 0) {
    abort_input(c("{.arg drivers} has missing or infinite values in {.val {gaps}}.",
                  i = "The simulator needs every driver in every interval: fill the gaps first."),
                call = call)
  }
}

# Number of a wall in the engine, from 0.
wall_number <- function(zone, name, what, call = rlang::caller_env()) {
  walls <- Filter(function(x) x$type == "wall", unclass(zone)$components)
  names <- vapply(walls, `[[`, "", "name")
  check_input(checkmate::check_string(name), what, "Give the name of one wall of the zone.",
              call = call)
  if (!name %in% names) {
    abort_input(c("{.arg {what}} is {.val {name}}, and the zone has no wall of that name.",
                  i = "Its walls: {.val {names}}."), call = call)
  }
  match(name, names) - 1L
}

check_zone_control <- function(control, call) {
  control <- merge_control(zone_control, control, call = call)
  for (option in c("max_substep_s", "cells", "initial_hours")) {
    check_input(checkmate::check_number(control[[option]], lower = 1e-3, upper = 1e9),
                paste0("control$", option), call = call)
  }
  check_input(checkmate::check_count(control$spinup), "control$spinup", call = call)
  control
}

# The engine's form: names of columns become 0-based indices, -1 for none.
index_zone <- function(zone, columns) {
  zone$components <- lapply(zone$components, function(x) {
    for (field in column_fields(x)) {
      x[[field]] <- if (is.null(x[[field]])) -1L else match(x[[field]], columns) - 1L
    }
    if (!is.null(x$azimuth) && !is_free(x$azimuth)) x$azimuth <- as.numeric(x$azimuth)
    x
  })
  zone
}

#' @export
free_parameters.amiss_zone <- function(simulator) zone_parameters(simulator)

#' @export
driver_names.amiss_zone <- function(simulator) zone_boundary(simulator)

#' @export
simulate_runs.amiss_zone <- function(simulator, values, drivers, step_h, hold = NULL,
                                     threads = 1L, ...) {
  check_run_dots(...)
  zone_runs(simulator, values, drivers, step_s = 3600 * step_h, hold = hold, threads = threads)
}

#' Heat flux into a wall of a zone
#'
#' Makes a simulator of what a heat flux sensor on the inner surface of a wall measures. Use it with
#' the zone itself, the simulator of the air temperature, as a second record in
#' [calibrate_jointly()].
#'
#' @param zone A [zone()].
#' @param wall Name of the wall.
#' @param air Column of the measured air temperature, degC. In rows that warm up the air is held at
#'   it, as the zone itself is held at its target there.
#' @return An object of class `amiss_zone_flux`: a simulator of the mean heat flux at the inner
#'   surface, W/m2, positive into the room.
#' @section Errors: `amiss_error_input` if the zone does not have this wall.
#' @examples
#' brick <- zone_layer(0.2, free("k", uniform(0.1, 0.3), "W/mK"), 8e5)
#' room <- zone(zone_wall("facade", area = 12, brick, outside = "Te"), volume = 40)
#' zone_flux(room, "facade", air = "Ti")
#' @export
zone_flux <- function(zone, wall, air) {
  check_arguments()
  check_object(zone, "amiss_zone", "zone")
  wall_number(zone, wall, "wall")
  check_input(checkmate::check_string(air, min.chars = 1), "air", "Give the name of one column.")
  structure(list(name = paste("heat flux,", wall), zone = zone, wall = wall, air = air),
            class = "amiss_zone_flux")
}

#' @export
print.amiss_zone_flux <- function(x, ...) on_stdout(x, {
  cli::cli_text(
    "{.strong Heat flux} into the room at the inner surface of {.val {x$wall}} of a zone")
  cli::cli_bullets(c(">" = "next: {.fun simulate_jointly}"))
})

#' @export
free_parameters.amiss_zone_flux <- function(simulator) zone_parameters(simulator$zone)

#' @export
driver_names.amiss_zone_flux <- function(simulator)
  union(zone_boundary(simulator$zone), simulator$air)

#' @export
simulate_runs.amiss_zone_flux <- function(simulator, values, drivers, step_h, hold = NULL,
                                          threads = 1L, ...) {
  check_run_dots(...)
  air <- if (!is.null(hold)) ifelse(is.na(hold), NA, drivers[, simulator$air])
  zone_runs(simulator$zone, values, drivers, step_s = 3600 * step_h, hold = air, threads = threads,
                flux = simulator$wall)
}
