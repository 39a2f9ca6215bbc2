#' Describe a building zone
#'
#' A zone is one well-mixed volume of air and a list of components that exchange heat with it. Any number may be
#' a [free()] parameter, or a free parameter times a number (`free("area", uniform(700, 1300), "mm2") * 1e-6`).
#' Every driver (weather, power, neighbour) is named by its column in the data; `NULL` means there is none.
#'
#' @param name Name of the component, unique in its zone.
#' @param thickness Thickness of a layer, m.
#' @param conductivity Thermal conductivity, W/mK.
#' @param capacity `zone_layer()`: volumetric heat capacity, J/m3K. `zone_heater()`: heat capacity, J/K; 0 for no lag.
#' @param area Area, m2 (of an opening: the orifice).
#' @param ... `zone_wall()`: layers from inside to outside. `zone()`: components.
#' @param outside Column of the temperature on the other side, degC. `NULL` makes a wall adiabatic: internal mass.
#' @param outside_film Film coefficient of the outer surface, convection and radiation, W/m2K.
#' @param inside_convection Convective coefficient of the inner surface, W/m2K.
#' @param inside_emissivity,outside_emissivity Long-wave emissivity of the two surfaces.
#' @param sun Column of the solar irradiance on the outer surface or window, W/m2. A window without is shaded.
#' @param absorptance Solar absorptance of the outer surface.
#' @param sky Column of the down-welling long-wave irradiance on the horizontal, W/m2.
#' @param sky_view View factor from the outer surface to the sky: 0.5 for a facade, 1 for a flat roof.
#' @param wind_speed,wind_direction Columns of wind speed (m/s) and the direction it comes from (degrees from
#'   north, clockwise).
#' @param azimuth Direction of the outward normal, degrees from north, clockwise. `NA`: a horizontal wall.
#' @param wind_film Share (0 to 1) of the wind-dependent film `4.5 + 2.8 + 3 V` in the outer film coefficient.
#' @param u_value Thermal transmittance, W/m2K.
#' @param solar_factor Solar gain per irradiance and area.
#' @param to_air Share of the solar gain that goes straight to the air; the rest goes to the inner surfaces.
#' @param width,length Width and length of a crack, m.
#' @param height Height above the zone's datum, m.
#' @param exposure How open the ground is: `"exposed"`, `"semi-exposed"` or `"sheltered"`.
#' @param shelter Reduction of the wind speed at the opening.
#' @param ach Air changes per hour.
#' @param power Column of the power, W.
#' @param radiant_fraction Share of the power that goes to the inner surfaces by area x emissivity.
#' @param conductance `zone_heater()`: emission, W/K, so that the lag is `capacity / conductance` seconds.
#'   `zone_coupling()`: to the known temperature, W/K.
#' @param flow Column of the supplied air, m3/h.
#' @param temperature Column of the supply's or neighbour's temperature, degC.
#' @param scale Factor on the flow of a supply or the power of a gain.
#' @param volume Volume of air, m3.
#' @param air_capacity_factor Heat capacity of air and furnishings over that of the air, at least 1.
#' @param initial_air Air temperature at the start when no row is held, degC.
#' @param initial_wall_offset The walls start in a steady state as if the air had been warmer by this, K. What they were
#'   before the record is unknown: a heavy building remembers it for days, so that it may be a [free()] parameter.
#' @return `zone()`: an object of class `amiss_zone`; the others: a component (`amiss_component`) or `amiss_layer`.
#' @details One opening alone exchanges nothing: use two at different heights or facades.
#' @source Wind pressure coefficients: Liddament (1986), Air infiltration calculation techniques, Air Infiltration and
#'   Ventilation Centre, as in ESP-r; between its nodes interpolated as by Fritsch and Carlson (1980), Monotone
#'   piecewise cubic interpolation, SIAM Journal on Numerical Analysis 17, 238-246.
#' @examples
#' zone(
#'   zone_wall("facade", area = 12, zone_layer(0.02, 0.8, 1.4e6),
#'             zone_layer(0.2, free("k", uniform(0.1, 0.3), "W/mK"), 8e5), outside = "Te", sun = "Gv"),
#'   zone_window("window", area = 2, outside = "Te", sun = "Gv"),
#'   zone_heater("heater", power = "P"),
#'   volume = 40)
#' @name zone_components
NULL

# ---- fields: what a component is made of, and the limits of each ----

positive <- function() list(kind = "number", lower = 0, open = TRUE, upper = Inf)
between <- function(lower = -Inf, upper = Inf, missing = FALSE) {
  list(kind = "number", lower = lower, open = FALSE, upper = upper, missing = missing)
}
needed_column <- function() list(kind = "column", optional = FALSE)
optional_column <- function() list(kind = "column", optional = TRUE)
choice <- function(...) list(kind = "choice", choices = c(...))

wind_fields <- list(wind_speed = optional_column(), wind_direction = optional_column())

opening_fields <- c(
  list(outside = needed_column(), height = between(), azimuth = between()), wind_fields,
  list(exposure = choice("exposed", "semi-exposed", "sheltered"), shelter = between(0)))

zone_fields <- list(
  layer = list(thickness = positive(), conductivity = positive(), capacity = between(0)),
  wall = c(
    list(area = positive(), layers = list(kind = "layers"), outside = optional_column(), outside_film = positive(),
         sun = optional_column(), absorptance = between(0, 1), sky = optional_column(), sky_view = between(0, 1)),
    wind_fields,
    list(azimuth = between(missing = TRUE), wind_film = between(0, 1), inside_convection = positive(),
         inside_emissivity = between(0, 1), outside_emissivity = between(0, 1))),
  window = list(area = positive(), outside = needed_column(), u_value = between(0), solar_factor = between(0, 1),
                sun = optional_column(), to_air = between(0, 1)),
  opening = c(list(area = between(0)), opening_fields),
  crack = c(list(width = between(0), length = between(0)), opening_fields),
  infiltration = list(ach = between(0), outside = needed_column()),
  heater = list(power = needed_column(), radiant_fraction = between(0, 1), capacity = between(0),
                conductance = positive()),
  supply = list(flow = needed_column(), temperature = needed_column(), scale = between(0)),
  coupling = list(conductance = between(0), temperature = needed_column()),
  gain = list(power = needed_column(), scale = between(), radiant_fraction = between(0, 1)),
  zone = list(volume = positive(), air_capacity_factor = between(1), initial_air = between(),
              initial_wall_offset = between()))

is_free <- function(x) inherits(x, c("amiss_free", "amiss_scaled_free"))

check_field <- function(value, rule, where, field, call) {
  switch(rule$kind,
    number = check_number_field(value, rule, where, field, call),
    column = if (!(rule$optional && is.null(value)) && !checkmate::test_string(value, min.chars = 1)) {
      abort_input(c("{where}: {.field {field}} must be the name of a column of the data; got {seen(value)}.",
                    i = if (rule$optional) "Use {.code NULL} for none."), call = call)
    },
    choice = if (!checkmate::test_choice(value, rule$choices)) {
      abort_input("{where}: {.field {field}} must be one of {.val {rule$choices}}; got {seen(value)}.", call = call)
    },
    layers = check_layers(value, where, call))
}

check_number_field <- function(value, rule, where, field, call) {
  if (is_free(value) || isTRUE(rule$missing) && checkmate::test_scalar_na(value)) return(invisible())
  inside <- checkmate::test_number(value, finite = TRUE) && isTRUE(plain_number(value)) && value <= rule$upper &&
    (if (rule$open) value > rule$lower else value >= rule$lower)
  if (inside) return(invisible())
  limits <- paste0(if (rule$open) "(" else "[", rule$lower, ", ", rule$upper, "]")
  abort_input("{where}: {.field {field}} must be one number in {limits} or {.fn free}; got {seen(value)}.",
              call = call)
}

check_layers <- function(layers, where, call) {
  ok <- is.list(layers) && length(layers) > 0 && all(vapply(layers, inherits, NA, "amiss_layer"))
  if (!ok) {
    abort_input(c("{where}: the layers must be one or more {.fn layer}, from inside to outside.",
                  i = "Name every argument of {.fn wall} but the name, the area and the layers."), call = call)
  }
  for (i in seq_along(layers)) {
    check_fields(layers[[i]], zone_fields$layer, paste(where, "layer", i), call)
  }
}

check_fields <- function(x, rules, where, call) {
  for (field in names(rules)) check_field(x[[field]], rules[[field]], where, field, call)
  invisible(x)
}

check_component <- function(x, call) {
  check_fields(x, zone_fields[[x$type]], describe_component(x), call)
  if (!is.null(x$wind_speed) && is.null(x$wind_direction) && !checkmate::test_scalar_na(x$azimuth)) {
    abort_input("{describe_component(x)}: {.field wind_speed} needs {.field wind_direction} too.", call = call)
  }
  if (x$type == "wall" && (is_free(x$wind_film) || x$wind_film > 0) && is.null(x$wind_speed)) {
    abort_input("{describe_component(x)}: {.field wind_film} needs {.field wind_speed}.", call = call)
  }
  x
}

describe_component <- function(x) paste0(x$type, " '", x$name, "'")

new_component <- function(type, name, fields, call = rlang::caller_env()) {
  check_input(checkmate::check_string(name, min.chars = 1), "name", call = call)
  if (name == "zone") abort_input("A component cannot be named {.val zone}: that is the zone itself.", call = call)
  check_component(structure(c(list(type = type, name = name), fields), class = "amiss_component"), call)
}

# ---- components ----

#' @rdname zone_components
#' @export
zone_layer <- function(thickness, conductivity, capacity) {
  x <- structure(list(thickness = thickness, conductivity = conductivity, capacity = capacity), class = "amiss_layer")
  check_fields(x, zone_fields$layer, "layer", rlang::current_env())
}

#' @rdname zone_components
#' @export
zone_wall <- function(name, area, ..., outside = NULL, outside_film = 25, sun = NULL, absorptance = 0.5, sky = NULL,
                 sky_view = 0.5, wind_speed = NULL, wind_direction = NULL, azimuth = 0, wind_film = 0,
                 inside_convection = 3, inside_emissivity = 0.9, outside_emissivity = 0.9) {
  new_component("wall", name, list(
    area = area, layers = list(...), outside = outside, outside_film = outside_film, sun = sun,
    absorptance = absorptance, sky = sky, sky_view = sky_view, wind_speed = wind_speed,
    wind_direction = wind_direction, azimuth = azimuth, wind_film = wind_film,
    inside_convection = inside_convection, inside_emissivity = inside_emissivity,
    outside_emissivity = outside_emissivity))
}

#' @rdname zone_components
#' @export
zone_window <- function(name, area, outside, u_value = 1.1, solar_factor = 0.5, sun = NULL, to_air = 0.1) {
  new_component("window", name, list(area = area, outside = outside, u_value = u_value, solar_factor = solar_factor,
                                     sun = sun, to_air = to_air))
}

#' @rdname zone_components
#' @export
zone_opening <- function(name, area, outside, height = 0, azimuth = 0, wind_speed = NULL, wind_direction = NULL,
                    exposure = "semi-exposed", shelter = 1) {
  new_component("opening", name, list(
    area = area, outside = outside, height = height, azimuth = azimuth, wind_speed = wind_speed,
    wind_direction = wind_direction, exposure = exposure, shelter = shelter))
}

#' @rdname zone_components
#' @export
zone_crack <- function(name, width, length, outside, height = 0, azimuth = 0, wind_speed = NULL, wind_direction = NULL,
                  exposure = "semi-exposed", shelter = 1) {
  new_component("crack", name, list(
    width = width, length = length, outside = outside, height = height, azimuth = azimuth, wind_speed = wind_speed,
    wind_direction = wind_direction, exposure = exposure, shelter = shelter))
}

#' @rdname zone_components
#' @export
zone_infiltration <- function(name, ach, outside) new_component("infiltration", name,
                                                                list(ach = ach, outside = outside))

#' @rdname zone_components
#' @export
zone_heater <- function(name, power, radiant_fraction = 0.3, capacity = 0, conductance = 10) {
  new_component("heater", name, list(power = power, radiant_fraction = radiant_fraction, capacity = capacity,
                                     conductance = conductance))
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
  new_component("gain", name, list(power = power, scale = scale, radiant_fraction = radiant_fraction))
}

#' @rdname zone_components
#' @export
zone <- function(..., volume, air_capacity_factor = 1, initial_air = 20, initial_wall_offset = 0) {
  new_zone(list(...), list(volume = volume, air_capacity_factor = air_capacity_factor, initial_air = initial_air,
                           initial_wall_offset = initial_wall_offset))
}

new_zone <- function(components, extra, call = rlang::caller_env()) {
  if (!all(vapply(components, inherits, NA, "amiss_component"))) {
    abort_input(c("A zone is composed of components.", i = "Give for example {.fn wall}, {.fn window}, {.fn heater}."),
                call = call)
  }
  names(components) <- vapply(components, `[[`, "", "name")
  twice <- unique(names(components)[duplicated(names(components))])
  if (length(twice) > 0) {
    abort_input(c("Every component needs a name of its own; used more than once: {.val {twice}}."), call = call)
  }
  x <- c(list(components = components), extra)
  check_fields(x, zone_fields$zone, "zone", call)
  structure(x, class = "amiss_zone")
}

# ---- edits: a mechanism is an edit of a zone ----

#' Edit a zone
#'
#' A physical mechanism is an edit: a component more, one less, or other fields in one that is there.
#'
#' @param zone A [zone()].
#' @param component A component to add.
#' @param name Name of a component, or `"zone"` for the zone's own fields (`volume`, `air_capacity_factor`,
#'   `initial_air`, `initial_wall_offset`).
#' @param ... Fields to replace, by name; the layers of a wall as `layers = list(zone_layer(...), ...)`.
#' @return The edited zone; of `component()`, the component.
#' @examples
#' room <- zone(zone_heater("heater", power = "P"), zone_coupling("door", 10, "T_hall"), volume = 40)
#' room <- add_component(room, zone_infiltration("leaks", ach = 0.2, outside = "Te"))
#' room <- change_component(room, "heater", capacity = 8000)
#' room <- change_component(room, "zone", air_capacity_factor = 4)
#' room <- drop_component(room, "door")
#' component(room, "heater")
#' @name zone_edits
NULL

check_zone <- function(zone, name = "zone", call = rlang::caller_env()) {
  check_object(zone, "amiss_zone", name, "Make one with {.fn zone}.", call = call)
}

#' @rdname zone_edits
#' @export
component <- function(zone, name) {
  check_zone(zone)
  find_component(zone, name, rlang::current_env())
}

find_component <- function(zone, name, call) {
  known <- names(zone$components)
  if (!checkmate::test_choice(name, known)) {
    abort_input(c("The zone has no component {.arg name} = {seen(name)}.", i = "Known components: {.val {known}}."),
                call = call)
  }
  zone$components[[name]]
}

#' @rdname zone_edits
#' @export
add_component <- function(zone, component) {
  check_zone(zone)
  zone$components <- new_zone(c(unname(zone$components), list(component)),
                              unclass(zone)[names(zone_fields$zone)])$components
  zone
}

#' @rdname zone_edits
#' @export
drop_component <- function(zone, name) {
  check_zone(zone)
  find_component(zone, name, rlang::current_env())
  zone$components[[name]] <- NULL
  zone
}

#' @rdname zone_edits
#' @export
change_component <- function(zone, name, ...) {
  check_zone(zone)
  call <- rlang::current_env()
  changes <- list(...)
  if (identical(name, "zone")) {
    check_field_names(changes, names(zone_fields$zone), "zone", call)
    return(check_fields(replace_fields(zone, changes), zone_fields$zone, "zone", call))
  }
  old <- find_component(zone, name, call)
  check_field_names(changes, names(zone_fields[[old$type]]), describe_component(old), call)
  zone$components[[name]] <- check_component(replace_fields(old, changes), call)
  zone
}

check_field_names <- function(changes, known, where, call) {
  unknown <- setdiff(rlang::names2(changes), known)
  if (length(unknown) > 0) {
    abort_input(c("{where} has no field {.val {unknown}}.", i = "Known fields: {.val {known}}."), call = call)
  }
}

# Unlike modifyList(): a NULL is kept as the field's value, and a list replaces instead of being merged.
replace_fields <- function(x, changes) {
  for (field in names(changes)) x[field] <- changes[field]
  x
}

# ---- free parameters ----

#' @export
Ops.amiss_free <- function(e1, e2) scale_free(.Generic, e1, e2)

#' @export
Ops.amiss_scaled_free <- function(e1, e2) scale_free(.Generic, e1, e2)

scale_free <- function(operator, e1, e2) {
  left <- is_free(e1)
  parameter <- if (left) e1 else e2
  number <- if (left) e2 else e1
  allowed <- operator == "*" || operator == "/" && left
  if (!allowed || !checkmate::test_number(number, finite = TRUE) || number == 0) {
    abort_input(c("A free parameter can only be multiplied or divided by a number that is not zero.",
                  i = "It serves to change units: {.code free(\"crack\", uniform(700, 1300), \"mm2\") * 1e-6}."))
  }
  factor <- if (operator == "*") number else 1 / number
  if (inherits(parameter, "amiss_scaled_free")) {
    parameter$factor <- parameter$factor * factor
    return(parameter)
  }
  structure(list(free = parameter, factor = factor), class = "amiss_scaled_free")
}

#' @export
format.amiss_scaled_free <- function(x, ...) paste(format(x$free), "*", format(x$factor))

#' @export
print.amiss_scaled_free <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}

# Where the free parameters stand in a nested description, in order: each with its path, and the factor that scales it.
free_fields <- function(x, path = integer()) {
  if (is_free(x)) {
    scaled <- inherits(x, "amiss_scaled_free")
    return(list(list(path = path, free = if (scaled) x$free else x, factor = if (scaled) x$factor else 1)))
  }
  if (!is.list(x)) return(list())
  do.call(c, lapply(seq_along(x), function(i) free_fields(x[[i]], c(path, i))))
}

# Values of the fields at each row of parameter values: runs x fields.
field_values <- function(fields, values) {
  columns <- lapply(fields, function(field) field$factor * values[, field$free$name])
  matrix(as.numeric(unlist(columns)), nrow(values), length(fields))
}

fill_free <- function(x, fields, values) {
  for (field in fields) x[[field$path]] <- field$factor * values[[field$free$name]]
  x
}

#' What a zone needs
#'
#' @param zone A [zone()].
#' @param values Named numeric vector: a value for every free parameter.
#' @return `zone_parameters()`: a named list of the free parameters, each once. `zone_boundary()`: the names of the
#'   columns of data that the zone uses. `zone_resolve()`: the zone with numbers in place of free parameters.
#' @examples
#' box <- paper_box("M2")
#' names(zone_parameters(box))
#' zone_boundary(box)
#' zone_resolve(box, c(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 179,
#'                     heater_radiant = 0.79))
#' @export
zone_parameters <- function(zone) {
  check_zone(zone)
  call <- rlang::current_env()
  found <- list()
  for (field in free_fields(unclass(zone))) {
    x <- field$free
    known <- found[[x$name]]
    if (!is.null(known) && !identical(known$prior, x$prior)) {
      abort_input(c("The free parameter {.val {x$name}} stands with two different priors:",
                    "*" = "{format(known$prior)}", "*" = "{format(x$prior)}",
                    i = "Use one prior, or two names."), call = call)
    }
    if (is.null(known)) found[[x$name]] <- x
  }
  found
}

#' @rdname zone_parameters
#' @export
zone_boundary <- function(zone) {
  check_zone(zone)
  columns <- lapply(unname(zone$components), function(x) unlist(x[column_fields(x)], use.names = FALSE))
  unique(as.character(unlist(columns)))
}

column_fields <- function(x) {
  rules <- zone_fields[[x$type]]
  names(rules)[vapply(rules, function(rule) rule$kind == "column", NA)]
}

#' @rdname zone_parameters
#' @export
zone_resolve <- function(zone, values = numeric()) {
  parameters <- names(zone_parameters(zone))
  check_input(checkmate::check_numeric(values, any.missing = FALSE, finite = TRUE), "values")
  check_values(names(values), parameters, rlang::current_env())
  resolve_zone(zone, free_fields(unclass(zone)), values, rlang::current_env())
}

check_values <- function(given, parameters, call) {
  absent <- setdiff(parameters, given)
  if (length(absent) > 0) {
    abort_input(c("{.arg values} has no value for {.val {absent}}.",
                  i = "The zone's free parameters: {.val {parameters}}."), call = call)
  }
}

# `fields`: the free ones; components without any were checked when they were made.
resolve_zone <- function(zone, fields, values, call) {
  resolved <- fill_free(zone, fields, values)
  at <- match("components", names(zone))
  paths <- Filter(function(path) path[1] == at, lapply(fields, `[[`, "path"))
  for (i in unique(vapply(paths, `[[`, 0L, 2L))) check_component(resolved$components[[i]], call)
  check_fields(resolved, zone_fields$zone, "zone", call)
}

# ---- simulation ----

zone_control <- list(max_substep_s = 300, cells = 1, spinup = 0L, initial_hours = 24)

#' Simulate a zone
#'
#' @param zone A [zone()].
#' @param values Matrix of M runs x P parameters with column names; every free parameter needs a column. `NULL` for a
#'   zone without free parameters: one run.
#' @param drivers Numeric matrix with column names, one row per interval: means over the interval.
#' @param step_s Length of an interval, s.
#' @param hold Air temperature (degC) to be prescribed in each interval, `NA` where it is free; `NULL` for none.
#'   Holding the first intervals at the measurement lets the walls forget their unknown past.
#' @param threads Number of threads; the result does not depend on it.
#' @param control List of `max_substep_s` (s), `cells` (refinement of the walls), `spinup` (times that the leading
#'   held rows are repeated first), `initial_hours` (of data that give the walls their first outside temperature).
#' @return Matrix of mean air temperatures, degC: one row per interval, one column per run; `NaN` in a run that fails.
#' @examples
#' weather <- synthetic_weather(1, seed = 1)
#' weather$RHP <- rolbs(nrow(weather), power = 100, seed = 1)
#' values <- cbind(outer_k = 1.05, outer_c = 3361, insulation_k = c(0.040, 0.048), insulation_c = 179,
#'                 heater_radiant = 0.79)
#' air <- simulate_zone(paper_box("M2"), values, as.matrix(weather[-1]), step_s = 900)
#' dim(air)
#' @export
simulate_zone <- function(zone, values = NULL, drivers, step_s, hold = NULL, threads = 1L, control = list()) {
  call <- rlang::current_env()
  parameters <- names(zone_parameters(zone))
  if (is.null(values)) values <- matrix(0, 1, 0)
  check_input(checkmate::check_matrix(values, mode = "numeric", any.missing = FALSE, min.rows = 1), "values")
  check_values(colnames(values), parameters, call)
  check_named_columns(values, "values", parameters, call)
  check_drivers(zone, drivers, call)
  check_input(checkmate::check_number(step_s, lower = 1e-3, finite = TRUE), "step_s")
  threads <- check_threads(threads)
  if (is.null(hold)) hold <- numeric()
  check_input(checkmate::check_numeric(hold), "hold")
  if (!length(hold) %in% c(0, nrow(drivers)) || any(is.infinite(hold))) {
    abort_input(c("{.arg hold} must have one finite number or NA per row of the drivers; got {length(hold)} values.",
                  i = "The drivers have {nrow(drivers)} rows."))
  }
  control <- check_zone_control(control, call)
  check_zone_size(zone, nrow(values), nrow(drivers), step_s, control, call)
  # Every field is a multiple of one parameter and may lie in an interval: what holds for the extremes holds between
  # them.
  fields <- free_fields(unclass(zone))
  extremes <- vapply(parameters, function(p) range(values[, p]), numeric(2))
  for (i in seq_len(if (nrow(values) > 1) 2 else 1)) resolve_zone(zone, fields, extremes[i, ], call)
  storage.mode(drivers) <- "double"
  call_engine(zone_simulate_(index_zone(unclass(zone), colnames(drivers)), lapply(fields, `[[`, "path"),
                             field_values(fields, values),
                             drivers, step_s, as.numeric(hold), control, engine_context(0, threads)), call)
}

check_drivers <- function(zone, drivers, call) {
  verdict <- checkmate::check_matrix(drivers, mode = "numeric", min.rows = 1, col.names = "unique")
  check_input(verdict, "drivers", call = call)
  needed <- zone_boundary(zone)
  absent <- setdiff(needed, colnames(drivers))
  if (length(absent) > 0) {
    abort_input(c("The zone needs columns that {.arg drivers} does not have: {.val {absent}}.",
                  i = "Columns given: {.val {colnames(drivers)}}."), call = call)
  }
  gaps <- needed[!apply(is.finite(drivers[, needed, drop = FALSE]), 2, all)]
  if (length(gaps) > 0) {
    abort_input(c("{.arg drivers} has missing or infinite values in {.val {gaps}}.",
                  i = "The simulator needs every driver in every interval: fill the gaps first."), call = call)
  }
}

check_zone_control <- function(control, call) {
  control <- merge_control(zone_control, control, call = call)
  for (option in c("max_substep_s", "cells", "initial_hours")) {
    check_input(checkmate::check_number(control[[option]], lower = 1e-3, upper = 1e9), paste0("control$", option),
                call = call)
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

# ---- printing ----

#' @export
format.amiss_component <- function(x, ...) {
  fields <- x[setdiff(names(zone_fields[[x$type]]), "layers")]
  free_ones <- fields[vapply(fields, is_free, NA)]
  columns <- unlist(x[column_fields(x)])
  paste0(x$type, " ", x$name,
         if (!is.null(x$layers)) paste0(", ", length(x$layers), if (length(x$layers) == 1) " layer" else " layers"),
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
  if (length(x$components) > length(shown)) cat("  ... and", length(x$components) - length(shown), "more\n")
  parameters <- names(zone_parameters(x))
  cat("Free parameters: ", if (length(parameters) > 0) paste(parameters, collapse = ", ") else "none", "\n", sep = "")
  cat("Needs columns: ", paste(zone_boundary(x), collapse = ", "), "\n", sep = "")
  invisible(x)
}

#' @export
free_parameters.amiss_zone <- function(simulator) zone_parameters(simulator)

#' @export
driver_names.amiss_zone <- function(simulator) zone_boundary(simulator)

#' @export
simulate_runs.amiss_zone <- function(simulator, values, drivers, step_h, hold = NULL, threads = 1L, ...) {
  check_run_dots(...)
  simulate_zone(simulator, values, drivers, step_s = 3600 * step_h, hold = hold, threads = threads)
}
