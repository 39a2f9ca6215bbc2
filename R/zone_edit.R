# A mechanism is an edit of a zone.

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

#' @rdname zone_edits
#' @export
component <- function(zone, name) {
  check_present(zone, name)
  check_zone(zone)
  find_component(zone, name, rlang::current_env())
}

find_component <- function(zone, name, call) {
  known <- names(zone$components)
  if (is.character(name)) check_readable(name, "name", call)
  if (!checkmate::test_choice(name, known)) {
    abort_input(c("The zone has no component {.arg name} = {seen(name)}.", i = "Known components: {.val {known}}."),
                call = call)
  }
  zone$components[[name]]
}

#' @rdname zone_edits
#' @export
add_component <- function(zone, component) {
  check_present(zone, component)
  check_zone(zone)
  zone$components <- new_zone(c(unname(zone$components), list(component)),
                              unclass(zone)[names(zone_fields$zone)])$components
  zone
}

#' @rdname zone_edits
#' @export
drop_component <- function(zone, name) {
  check_present(zone, name)
  check_zone(zone)
  find_component(zone, name, rlang::current_env())
  zone$components[[name]] <- NULL
  zone
}

#' @rdname zone_edits
#' @export
change_component <- function(zone, name, ...) {
  check_present(zone, name)
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
