#' Heat loss coefficient of a zone
#'
#' Gives the heat per kelvin that it takes, in the steady state, to hold the zone's air warmer than
#' its surroundings. It counts conduction through walls and windows, and air exchange. It comes from
#' the simulator itself, so all that the zone is composed of counts. Sun and gains are off, and the
#' sky is as warm as the air outside.
#'
#' @param simulator A [zone()].
#' @param values Matrix of parameter values, one row a point, named columns; or one named vector.
#' @param drivers Named vector of the driver columns that are neither temperatures nor sun, sky or
#'   power, like wind speed and direction. What is not named is 0.
#' @param outside,inside Temperatures, degC. Only buoyancy and the density of air depend on them.
#' @return Heat loss coefficients, W/K, one for each point.
#' @examples
#' box <- paper_box("M2")
#' values <- c(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 179,
#'             heater_radiant = 0.79)
#' heat_loss_coefficient(box, values)
#' @export
heat_loss_coefficient <- function(simulator, values, drivers = numeric(), outside = 10,
                                  inside = 30) {
  check_arguments()
  check_zone(simulator, "simulator")
  if (is.numeric(values) && is.null(dim(values))) values <- t(values)
  values <- as_number_matrix(values)
  check_input(checkmate::check_matrix(values, "numeric", any.missing = FALSE, min.rows = 1),
              "values")
  check_all_finite(values, "values")
  check_values(colnames(values), names(zone_parameters(simulator)), rlang::current_env())
  check_input(checkmate::check_numeric(drivers, finite = TRUE, any.missing = FALSE,
                                       names = if (length(drivers)) "unique"), "drivers")
  check_input(checkmate::check_number(outside, finite = TRUE), "outside")
  check_input(checkmate::check_number(inside, lower = outside + 0.1, finite = TRUE), "inside",
              "It must be warmer than {.arg outside}.")
  row <- t(steady_drivers(simulator, drivers, outside))
  vapply(seq_len(nrow(values)),
         function(i) steady_loss(zone_resolve(simulator, values[i, ]), row, inside) /
                       (inside - outside), 0)
}

# One interval of a day, its driver repeated long enough for the walls to be in balance with a held
# air.
steady_loss <- function(zone, row, inside) {
  day <- 86400
  control <- utils::modifyList(zone_control, list(max_substep_s = 7200, spinup = 60L))
  run <- zone_balance_(index_zone(zone, colnames(row)), row, day, inside, control)
  run$hold / day
}

# What each column is by the field that names it.
steady_drivers <- function(zone, drivers, outside) {
  known <- c(outside = outside, temperature = outside, sun = 0, power = 0,
             sky = 5.670374e-8 * (273.15 + outside)^4)
  roles <- unlist(lapply(unname(zone$components), function(x) unlist(x[column_fields(x)])))
  row <- stats::setNames(known[names(roles)], roles)
  given <- is.na(row) & roles %in% names(drivers)
  row[given] <- drivers[roles[given]]
  row[is.na(row)] <- 0
  row[!duplicated(names(row))]
}
