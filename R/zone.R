#' Describe a building zone
#'
#' A zone is one well-mixed volume of air and a list of components that exchange heat with it. Any
#' number may be a [free()] parameter, or a free parameter times a number (`free("area",
#' uniform(700, 1300), "mm2") * 1e-6`). Every driver (weather, power, neighbour) is named by its
#' column in the data; `NULL` means there is none.
#'
#' @param name Name of the component, unique in its zone.
#' @param thickness Thickness of a layer, m.
#' @param conductivity Thermal conductivity, W/mK.
#' @param capacity `zone_layer()`: volumetric heat capacity, J/m3K. `zone_heater()`: heat capacity,
#'   J/K; 0 for no lag.
#' @param area Area, m2 (of an opening: the orifice).
#' @param ... `zone_wall()`: layers from inside to outside. `zone()`: components.
#' @param outside Column of the temperature on the other side, degC. `NULL` makes a wall adiabatic:
#'   internal mass.
#' @param outside_film Film coefficient of the outer surface, convection and radiation, W/m2K.
#' @param inside_convection Convective coefficient of the inner surface, W/m2K.
#' @param inside_emissivity,outside_emissivity Long-wave emissivity of the two surfaces.
#' @param sun Column of the solar irradiance on the outer surface or window, W/m2. A window without
#'   is shaded.
#' @param absorptance Solar absorptance of the outer surface.
#' @param sky Column of the down-welling long-wave irradiance on the horizontal, W/m2.
#' @param sky_view View factor from the outer surface to the sky: 0.5 for a facade, 1 for a flat
#'   roof.
#' @param wind_speed,wind_direction Columns of wind speed (m/s) and the direction it comes from
#'   (degrees from north, clockwise).
#' @param azimuth Direction of the outward normal, degrees from north, clockwise. `NA`: a horizontal
#'   wall.
#' @param wind_film Share (0 to 1) of the wind-dependent film `4.5 + 2.8 + 3 V` in the outer film
#'   coefficient.
#' @param u_value Thermal transmittance, W/m2K.
#' @param solar_factor Solar gain per irradiance and area.
#' @param to_air Share of the solar gain that goes straight to the air; the rest goes to the inner
#'   surfaces.
#' @param width,length Width and length of a crack, m.
#' @param height Height above the zone's datum, m.
#' @param exposure How open the ground is: `"exposed"`, `"semi-exposed"` or `"sheltered"`.
#' @param shelter Factor on the wind speed at the opening: 1 for the column as it is, 0 for no wind.
#' @param ach Air changes per hour.
#' @param power Column of the power, W.
#' @param radiant_fraction Share of the power that goes to the inner surfaces by area x emissivity.
#' @param conductance `zone_heater()`: emission, W/K, so that the lag is `capacity / conductance`
#'   seconds. `zone_coupling()`: to the known temperature, W/K.
#' @param flow Column of the supplied air, m3/h.
#' @param temperature Column of the supply's or neighbour's temperature, degC.
#' @param scale Factor on the flow of a supply or the power of a gain.
#' @param volume Volume of air, m3.
#' @param air_capacity_factor Heat capacity of air and furnishings over that of the air, at least 1.
#' @param initial_air Air temperature at the start when no row is held, degC.
#' @param initial_wall_offset The walls start in a steady state as if the air had been warmer by
#'   this, K. What they were before the record is unknown: a heavy building remembers it for days,
#'   so that it may be a [free()] parameter.
#' @return `zone()`: an object of class `amiss_zone`; the others: a component (`amiss_component`) or
#'   `amiss_layer`.
#' @details One opening alone exchanges nothing: use two at different heights or facades.
#'
#' *Walls.* The inner surface exchanges heat with the air by `inside_convection` and with the other
#' surfaces by `4 sigma (293.15 K)^3 inside_emissivity` (5.1 W/m2K at 0.9). The outer surface gains,
#' in W/m2, `film (Te - T) + absorptance sun - outside_emissivity sky_view (sigma Te^4 - sky)`. In
#' the last term Te is in kelvin. Here
#' `film = (1 - wind_film) outside_film + wind_film (7.3 + 3 V)`. `V` is the wind along the facade
#' (for a horizontal wall the wind speed). Without `outside`, `sun` and `sky` count for nothing;
#' without `sky`, `outside_emissivity` does; with `wind_film = 0`, wind and azimuth do.
#'
#' *Windows* lose `u_value area (Ta - Te)` from the air, and gain `solar_factor area sun`, of which
#' the share `1 - to_air` goes to the walls.
#'
#' *Openings.* Mass flow of an orifice is `0.65 area sqrt(2 rho |dp|)`, so that `area` is geometric;
#' of a crack `rho k |dp|^x` with `x = 0.5 + 0.5 exp(-500 width)` and `k = 0.0097 length 0.0092^x`:
#' a crack is absent at `length = 0`, not at `width = 0`. dp is wind pressure and buoyancy over
#' `height`. A negative `flow` of a supply counts as 0.
#' @section Limits of the fields:
#' `r zone_limits()`
#' @source Wind pressure coefficients: Liddament (1986), Air infiltration calculation techniques,
#'   Air Infiltration and Ventilation Centre, as in ESP-r; between its nodes interpolated as by
#'   Fritsch and Carlson (1980), Monotone piecewise cubic interpolation, SIAM Journal on Numerical
#'   Analysis 17, 238-246.
#' @examples
#' zone(
#'   zone_wall("facade", area = 12, zone_layer(0.02, 0.8, 1.4e6),
#'             zone_layer(0.2, free("k", uniform(0.1, 0.3), "W/mK"), 8e5),
#'             outside = "Te", sun = "Gv"),
#'   zone_window("window", area = 2, outside = "Te", sun = "Gv"),
#'   zone_heater("heater", power = "P"),
#'   volume = 40)
#' @name zone_components
NULL

new_component <- function(type, name, fields, call = rlang::caller_env()) {
  check_arguments(call)
  check_input(checkmate::check_string(name, min.chars = 1), "name", call = call)
  if (name == "zone")
    abort_input("A component cannot be named {.val zone}: that is the zone itself.", call = call)
  check_component(structure(c(list(type = type, name = name), fields), class = "amiss_component"),
                  call)
}

#' @rdname zone_components
#' @export
zone_layer <- function(thickness, conductivity, capacity) {
  check_arguments()
  x <- structure(list(thickness = thickness, conductivity = conductivity, capacity = capacity),
                 class = "amiss_layer")
  check_fields(x, zone_fields$layer, "layer", rlang::current_env())
}

#' @rdname zone_components
#' @export
zone_wall <- function(name, area, ..., outside = NULL, outside_film = 25, sun = NULL,
                      absorptance = 0.5, sky = NULL, sky_view = 0.5, wind_speed = NULL,
                      wind_direction = NULL, azimuth = 0, wind_film = 0, inside_convection = 3,
                      inside_emissivity = 0.9, outside_emissivity = 0.9) {
  new_component("wall", name, list(
    area = area, layers = list(...), outside = outside, outside_film = outside_film, sun = sun,
    absorptance = absorptance, sky = sky, sky_view = sky_view, wind_speed = wind_speed,
    wind_direction = wind_direction, azimuth = azimuth, wind_film = wind_film,
    inside_convection = inside_convection, inside_emissivity = inside_emissivity,
    outside_emissivity = outside_emissivity))
}

#' @rdname zone_components
#' @export
zone_window <- function(name, area, outside, u_value = 1.1, solar_factor = 0.5, sun = NULL,
                        to_air = 0.1) {
  new_component("window", name, list(area = area, outside = outside, u_value = u_value,
                                     solar_factor = solar_factor, sun = sun, to_air = to_air))
}

#' @rdname zone_components
#' @export
zone_opening <- function(name, area, outside, height = 0, azimuth = 0, wind_speed = NULL,
                         wind_direction = NULL, exposure = "semi-exposed", shelter = 1) {
  new_component("opening", name, list(
    area = area, outside = outside, height = height, azimuth = azimuth, wind_speed = wind_speed,
    wind_direction = wind_direction, exposure = exposure, shelter = shelter))
}

#' @rdname zone_components
#' @export
zone_crack <- function(name, width, length, outside, height = 0, azimuth = 0, wind_speed = NULL,
                       wind_direction = NULL, exposure = "semi-exposed", shelter = 1) {
  new_component("crack", name, list(
    width = width, length = length, outside = outside, height = height, azimuth = azimuth,
    wind_speed = wind_speed, wind_direction = wind_direction, exposure = exposure,
    shelter = shelter))
}

#' @rdname zone_components
#' @export
zone_infiltration <- function(name, ach, outside) new_component("infiltration", name,
                                                                list(ach = ach, outside = outside))

#' @rdname zone_components
#' @export
zone_heater <- function(name, power, radiant_fraction = 0.3, capacity = 0, conductance = 10) {
  new_component("heater", name, list(power = power, radiant_fraction = radiant_fraction,
                                     capacity = capacity, conductance = conductance))
}

#' @rdname zone_components
#' @export
zone_supply <- function(name, flow, temperature, scale = 1) {
  new_component("supply", name, list(flow = flow, temperature = temperature, scale = scale))
}

#' @rdname zone_components
#' @export
zone_coupling <- function(name, conductance, temperature) {
  new_component("coupling", name, list(conductance = conductance, temperature = temperature))
}

#' @rdname zone_components
#' @export
zone_gain <- function(name, power, scale = 1, radiant_fraction = 0.5) {
  new_component("gain", name,
                list(power = power, scale = scale, radiant_fraction = radiant_fraction))
}

#' @rdname zone_components
#' @export
zone <- function(..., volume, air_capacity_factor = 1, initial_air = 20, initial_wall_offset = 0) {
  new_zone(list(...), list(volume = volume, air_capacity_factor = air_capacity_factor,
                           initial_air = initial_air, initial_wall_offset = initial_wall_offset))
}

new_zone <- function(components, extra, call = rlang::caller_env()) {
  check_arguments(call)
  if (!all(vapply(components, inherits, NA, "amiss_component"))) {
    abort_input(c("A zone is composed of components.",
                  i = "Give for example {.fn zone_wall}, {.fn zone_window}, {.fn zone_heater}."),
                call = call)
  }
  for (one in components) check_whole(one, "...", call = call)
  names(components) <- vapply(components, `[[`, "", "name")
  twice <- unique(names(components)[duplicated(names(components))])
  if (length(twice) > 0) {
    abort_input(c("Every component needs a name of its own; used more than once: {.val {twice}}."),
                call = call)
  }
  x <- c(list(components = components), extra)
  check_fields(x, zone_fields$zone, "zone", call)
  structure(x, class = "amiss_zone")
}

#' @export
format.amiss_component <- function(x, ...) {
  fields <- x[setdiff(names(zone_fields[[x$type]]), "layers")]
  free_ones <- fields[vapply(fields, is_free, NA)]
  columns <- unlist(x[column_fields(x)])
  paste0(x$type, " ", x$name,
         if (!is.null(x$layers))
           paste0(", ", length(x$layers), if (length(x$layers) == 1) " layer" else " layers"),
         if (length(columns) > 0) paste0(" <- ", paste(unique(columns), collapse = ", ")),
         if (length(free_ones) > 0) paste0("; free: ", paste(names(free_ones), collapse = ", ")))
}

#' @export
print.amiss_component <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}

#' @export
print.amiss_zone <- function(x, ...) {
  number <- function(value) if (is_free(value)) "free" else format(value, digits = 3)
  cat("Zone of ", number(x$volume), " m3, ", length(x$components), " components\n", sep = "")
  shown <- utils::head(x$components, 10)
  for (one in shown) cat("  ", format(one), "\n", sep = "")
  if (length(x$components) > length(shown))
    cat("  ... and", length(x$components) - length(shown), "more\n")
  parameters <- parameter_titles(zone_parameters(x))
  cat("Free parameters: ",
      if (length(parameters) > 0) paste(parameters, collapse = ", ") else "none", "\n", sep = "")
  cat("Needs columns: ", paste(zone_boundary(x), collapse = ", "), "\n", sep = "")
  invisible(x)
}
