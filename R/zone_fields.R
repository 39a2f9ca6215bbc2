# What the components of a zone are made of, and the limits of each field: checks, the engine's form
# and the help page follow this table.

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
  wall = c(list(area = positive(), layers = list(kind = "layers"), outside = optional_column(),
                outside_film = positive(), sun = optional_column(), absorptance = between(0, 1),
                sky = optional_column(), sky_view = between(0, 1)),
           wind_fields,
           list(azimuth = between(missing = TRUE), wind_film = between(0, 1),
                inside_convection = positive(),
                inside_emissivity = between(0, 1), outside_emissivity = between(0, 1))),
  window = list(area = positive(), outside = needed_column(), u_value = between(0),
                solar_factor = between(0, 1), sun = optional_column(), to_air = between(0, 1)),
  opening = c(list(area = between(0)), opening_fields),
  crack = c(list(width = between(0), length = between(0)), opening_fields),
  infiltration = list(ach = between(0), outside = needed_column()),
  heater = list(power = needed_column(),
                radiant_fraction = between(0, 1), capacity = between(0), conductance = positive()),
  supply = list(flow = needed_column(), temperature = needed_column(), scale = between(0)),
  coupling = list(conductance = between(0), temperature = needed_column()),
  gain = list(power = needed_column(), scale = between(), radiant_fraction = between(0, 1)),
  zone = list(volume = positive(), air_capacity_factor = between(1), initial_air = between(),
              initial_wall_offset = between()))

# The table in words, for the help page.
zone_limits <- function() {
  in_words <- function(rule)
    switch(rule$kind,
           number = paste0(
             if (is.infinite(rule$lower)) "any number"
             else paste0("number ",
                         if (rule$open) "above "
                         else if (is.finite(rule$upper)) "from "
                         else "of at least ",
                         rule$lower, if (is.finite(rule$upper)) paste(" to", rule$upper)),
             if (isTRUE(rule$missing)) " or `NA`"),
           column = if (rule$optional) "column or `NULL`" else "column",
           choice = paste0('`"', rule$choices, '"`', collapse = ", "),
           layers = "layers")
  rows <- vapply(names(zone_fields), function(type) {
    words <- vapply(zone_fields[[type]], in_words, "")
    fields <- vapply(unique(words), function(word) {
      paste0(paste0("`", names(words)[words == word], "`", collapse = ", "), ": ", word)
    }, "")
    paste0("* *", type, "*: ", paste(fields, collapse = "; "), ".")
  }, "")
  paste(rows, collapse = "\n")
}

is_free <- function(x) inherits(x, c("amiss_free", "amiss_scaled_free"))

check_field <- function(value, rule, where, field, call) {
  if (is.character(value)) check_readable(value, field, call)
  switch(rule$kind,
         number = check_number_field(value, rule, where, field, call),
         column = if (!(rule$optional && is.null(value)) &&
                      !checkmate::test_string(value, min.chars = 1)) {
                    abort_input(c(paste("{where}: {.field {field}} must be the name of a column of",
                                        "the data; got {seen(value)}."),
                                  i = if (rule$optional) "Use {.code NULL} for none."), call = call)
                  },
         choice = if (!checkmate::test_choice(value, rule$choices)) {
                    abort_input(paste("{where}: {.field {field}} must be one of",
                                      "{.val {rule$choices}}; got {seen(value)}."), call = call)
                  },
         layers = check_layers(value, where, call))
}

check_number_field <- function(value, rule, where, field, call) {
  if (is_free(value) || isTRUE(rule$missing) && checkmate::test_scalar_na(value))
    return(invisible())
  inside <- checkmate::test_number(value, finite = TRUE) && isTRUE(plain_number(value, TRUE)) &&
    value <= rule$upper && (if (rule$open) value > rule$lower else value >= rule$lower)
  if (inside) return(invisible())
  limits <- paste0(if (rule$open) "(" else "[", rule$lower, ", ", rule$upper, "]")
  abort_input(paste("{where}: {.field {field}} must be one number in {limits} or {.fn free}; got",
                    "{seen(value)}."), call = call)
}

check_layers <- function(layers, where, call) {
  ok <- is.list(layers) && length(layers) > 0 && all(vapply(layers, inherits, NA, "amiss_layer"))
  if (!ok) {
    abort_input(
      c("{where}: the layers must be one or more {.fn zone_layer}, from inside to outside.",
        i = "Name every argument of {.fn zone_wall} but the name, the area and the layers."),
      call = call)
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
  if (!x$type %in% setdiff(names(zone_fields), c("layer", "zone"))) {
    abort_input("Component {.val {x$name}} is of the unknown type {.val {x$type}}.", call = call)
  }
  check_fields(x, zone_fields[[x$type]], describe_component(x), call)
  if (!is.null(x$wind_speed) && is.null(x$wind_direction) &&
      !checkmate::test_scalar_na(x$azimuth)) {
    abort_input("{describe_component(x)}: {.field wind_speed} needs {.field wind_direction} too.",
                call = call)
  }
  if (x$type == "wall" && (is_free(x$wind_film) || x$wind_film > 0) && is.null(x$wind_speed)) {
    abort_input("{describe_component(x)}: {.field wind_film} needs {.field wind_speed}.",
                call = call)
  }
  x
}

describe_component <- function(x) paste0(x$type, " '", x$name, "'")

column_fields <- function(x) {
  rules <- zone_fields[[x$type]]
  names(rules)[vapply(rules, function(rule) rule$kind == "column", NA)]
}

check_zone <- function(zone, name = "zone", call = rlang::caller_env()) {
  present(zone, call, name, argument_code(name, call))
  if (was_checked(zone, "zone")) return(invisible(TRUE))
  check_object(zone, "amiss_zone", name, "Make one with {.fn zone}.", call = call)
  check_fields(zone, zone_fields$zone, "zone", call)
  for (one in zone$components) check_component(one, call)
  note_checked(zone, "zone")
}
