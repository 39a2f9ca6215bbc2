# A mechanism is an edit of a model that is composed of parts.

#' Edit a zone or a network
#'
#' A physical mechanism is an edit: a component more, one less, or other fields in one that is
#' there.
#'
#' @param model A [zone()] or a [network()].
#' @param ... `add_component()`: components to add; `change_component()`: fields to replace, by
#'   name, the layers of a wall as `layers = list(zone_layer(...), ...)`.
#' @param name Name of a component. `"zone"` for the zone's own fields (`volume`,
#'   `air_capacity_factor`, `initial_air`, `initial_wall_offset`), `"network"` for those of a
#'   network (`output`, `before`, ...).
#' @return The edited model; of `component()`, the component.
#' @examples
#' room <- zone(zone_heater("heater", power = "P"), zone_coupling("door", 10, "T_hall"),
#'              volume = 40)
#' room <- add_component(room, zone_infiltration("leaks", ach = 0.2, outside = "Te"))
#' room <- change_component(room, "heater", capacity = 8000)
#' room <- change_component(room, "zone", air_capacity_factor = 4)
#' room <- drop_component(room, "door")
#' component(room, "heater")
#'
#' # The heating reaches the air by way of a heater that stores heat.
#' house <- network(network_node("air", 1), network_link("air", "Te", 0.2),
#'                  network_gain("air", "P"), output = "air")
#' house <- add_component(house, network_node("heater", free("C_heater", uniform(0, 1), "kWh/K")),
#'                        network_link("heater", "air", conductance = 0.5))
#' change_component(house, "P to air", to = "heater")
#' @name zone_edits
NULL

#' @rdname zone_edits
#' @export
component <- function(model, name) {
  check_arguments()
  UseMethod("component")
}

#' @rdname zone_edits
#' @export
add_component <- function(model, ...) {
  check_arguments()
  check_input(checkmate::check_list(list(...), min.len = 1), "...", "Give a component to add.")
  UseMethod("add_component")
}

#' @rdname zone_edits
#' @export
drop_component <- function(model, name) {
  check_arguments()
  UseMethod("drop_component")
}

#' @rdname zone_edits
#' @export
change_component <- function(model, name, ...) {
  check_arguments()
  UseMethod("change_component")
}

#' @export
component.default <- function(model, name) check_composed(model)

#' @export
add_component.default <- function(model, ...) check_composed(model)

#' @export
drop_component.default <- function(model, name) check_composed(model)

#' @export
change_component.default <- function(model, name, ...) check_composed(model)

check_composed <- function(model, call = rlang::caller_env()) {
  check_object(model, c("amiss_zone", "amiss_network"), "model",
               "Make one with {.fn zone} or {.fn network}.", call)
}

#' @export
component.amiss_zone <- function(model, name) {
  check_composed(model)
  find_component(model, name, rlang::current_env())
}

find_component <- function(zone, name, call) {
  known <- names(zone$components)
  check_input(checkmate::check_string(name), "name", call = call)
  if (!checkmate::test_choice(name, known)) {
    abort_input(c("The zone has no component {.arg name} = {seen(name)}.",
                  i = "Known components: {.val {known}}."), call = call)
  }
  zone$components[[name]]
}

#' @export
add_component.amiss_zone <- function(model, ...) {
  check_composed(model)
  model$components <- new_zone(c(unname(model$components), list(...)),
                               unclass(model)[names(zone_fields$zone)])$components
  model
}

#' @export
drop_component.amiss_zone <- function(model, name) {
  check_composed(model)
  find_component(model, name, rlang::current_env())
  model$components[[name]] <- NULL
  model
}

#' @export
change_component.amiss_zone <- function(model, name, ...) {
  check_composed(model)
  call <- rlang::current_env()
  changes <- list(...)
  if (identical(name, "zone")) {
    check_field_names(changes, names(zone_fields$zone), "zone", call)
    return(check_fields(replace_fields(model, changes), zone_fields$zone, "zone", call))
  }
  old <- find_component(model, name, call)
  check_field_names(changes, names(zone_fields[[old$type]]), describe_component(old), call)
  model$components[[name]] <- check_component(replace_fields(old, changes), call)
  model
}

check_field_names <- function(changes, known, where, call) {
  unknown <- setdiff(rlang::names2(changes), known)
  if (length(unknown) > 0) {
    abort_input(c("{where} has no field {.val {unknown}}.", i = "Known fields: {.val {known}}."),
                call = call)
  }
}

# Unlike modifyList(): a NULL is kept as the field's value, and a list replaces instead of being
# merged.
replace_fields <- function(x, changes) {
  for (field in names(changes)) x[field] <- changes[field]
  x
}
