# The parts of a network, and the limits of each field.

network_number <- function(lower = 0, open = FALSE, infinite = FALSE, optional = FALSE) {
  list(kind = "number", lower = lower, open = open, upper = Inf, infinite = infinite,
       optional = optional)
}
network_place <- function(optional = FALSE) list(kind = "place", optional = optional)

network_fields <- list(
  node = list(capacity = network_number(infinite = TRUE),
              start = network_number(-Inf, optional = TRUE)),
  link = list(from = network_place(), to = network_place(),
              conductance = network_number(optional = TRUE),
              resistance = network_number(open = TRUE, optional = TRUE), by = network_place(TRUE)),
  flow = list(from = network_place(TRUE), to = network_place(TRUE), rate = network_number(),
              by = network_place(TRUE)),
  gain = list(to = network_place(), driver = network_place(TRUE), factor = network_number(-Inf),
              by = network_place(TRUE)))

#' Parts of a network
#'
#' Make the parts that a [network()] is composed of. Every number may be a [free()] parameter where
#' it stands.
#'
#' A *place* is the name of a node or, if no node has that name, of a driver column: a temperature
#' outside of the network. `by` names a driver column that multiplies the part: wind speed for a
#' leak that wind drives, the opening of a valve or a window. Within a row it is constant.
#'
#' @param name Name of the part. Links, flows and gains have one of their own: `"air-wall"`,
#'   `"soil-river"`, `"Gv to air"`.
#' @param capacity What the node holds for a unit of its state: heat capacity, volume, or 1 if the
#'   state is an amount. `Inf`: the state stays at its `start`, as that of the ground.
#' @param start State at the start; `NULL`: see [network()].
#' @param from,to Places. A link joins two, and its sign is that of the heat from the first to the
#'   second. A flow carries what `from` holds to `to`. With `to = NULL` it is lost; with `from =
#'   NULL` the flow brings a constant amount.
#' @param conductance,resistance One of the two: the heat that a difference of one unit drives, or
#'   its inverse.
#' @param rate Amount that is carried each hour for a unit of the state of `from`: a flow in m3/h
#'   for concentrations, 1/h for amounts.
#' @param driver A driver column; `NULL` for a gain that is constant.
#' @param factor Amount an hour that one unit of the driver brings: 1 for heating in kW, `1e-3`
#'   times an aperture for sun in W/m2.
#' @param by A driver column that multiplies the part, or `NULL`.
#' @return An object of class `amiss_network_part`.
#' @examples
#' network_node("air", capacity = free("C_air", uniform(0.1, 5), "kWh/K"))
#' network_link("air", "wall", resistance = free("R_inside", uniform(0.2, 5), "K/kW"))
#' network_link("air", "Te", conductance = free("leak", uniform(0, 0.02), "kW/K per m/s"),
#'              by = "wind")
#' network_flow("soil", "river", rate = free("k", uniform(0.001, 0.1), "1/h"))
#' network_gain("air", "Gv", factor = free("aperture", uniform(0, 8), "m2") * 1e-3)
#' @name network_parts
NULL

new_part <- function(type, name, fields, call = rlang::caller_env()) {
  check_input(checkmate::check_string(name, min.chars = 1), "name", call = call)
  check_part(structure(c(list(type = type, name = name), fields), class = "amiss_network_part"),
             call)
}

#' @rdname network_parts
#' @export
network_node <- function(name, capacity, start = NULL) {
  check_arguments()
  new_part("node", name, list(capacity = capacity, start = start))
}

#' @rdname network_parts
#' @export
network_link <- function(from, to, conductance = NULL, resistance = NULL, by = NULL,
                         name = paste0(from, "-", to)) {
  check_arguments()
  check_places(list(from = from, to = to))
  new_part("link", name,
           list(from = from, to = to, conductance = conductance, resistance = resistance, by = by))
}

#' @rdname network_parts
#' @export
network_flow <- function(from, to, rate, by = NULL,
                         name = paste0(from %||% "outside", "-", to %||% "outside")) {
  check_arguments()
  check_places(list(from = from, to = to), optional = c("from", "to"))
  new_part("flow", name, list(from = from, to = to, rate = rate, by = by))
}

#' @rdname network_parts
#' @export
network_gain <- function(to, driver, factor = 1, by = NULL,
                         name = paste(driver %||% "constant", "to", to)) {
  check_arguments()
  check_places(list(to = to, driver = driver), optional = "driver")
  new_part("gain", name, list(to = to, driver = driver, factor = factor, by = by))
}

# Before a name is made of them.
check_places <- function(places, optional = character(), call = rlang::caller_env()) {
  for (field in names(places)) {
    check_input(
      checkmate::check_string(places[[field]], min.chars = 1, null.ok = field %in% optional), field,
      "Give the name of a node or of a driver column.", call = call)
  }
}

check_part <- function(x, call) {
  where <- describe_part(x)
  rules <- network_fields[[x$type]]
  for (field in names(rules)) check_part_field(x[[field]], rules[[field]], where, field, call)
  if (x$type == "link" && is.null(x$conductance) == is.null(x$resistance)) {
    abort_input("{where}: give one of {.field conductance} and {.field resistance}.", call = call)
  }
  if (x$type %in% c("link", "flow") && identical(x$from, x$to)) {
    abort_input("{where} leads from {.val {x$from}} to itself.", call = call)
  }
  x
}

check_part_field <- function(value, rule, where, field, call) {
  if (is.null(value) && rule$optional) return(invisible())
  if (rule$kind == "place") {
    if (checkmate::test_string(value, min.chars = 1)) return(check_readable(value, field, call))
    abort_input(c(paste("{where}: {.field {field}} must be the name of a node or of a column; got",
                        "{seen(value)}."), i = if (rule$optional) "Use {.code NULL} for none."),
                call = call)
  }
  if (is_free(value)) return(check_prior_inside(value, rule, where, field, call))
  number <- isTRUE(plain_number(value, single = TRUE)) && checkmate::test_number(value)
  if (number && (is.finite(value) || rule$infinite && value == Inf) && inside_rule(value, rule))
    return(invisible())
  abort_input(paste("{where}: {.field {field}} must be one number {rule_words(rule)} or",
                    "{.fn free}; got {seen(value)}."), call = call)
}

inside_rule <- function(value, rule) if (rule$open) value > rule$lower else value >= rule$lower

rule_words <- function(rule) {
  if (is.infinite(rule$lower)) "of any sign" else if (rule$open) paste("above", rule$lower)
  else paste("of at least", rule$lower)
}

# A prior that reaches where the field cannot be.
check_prior_inside <- function(parameter, rule, where, field, call) {
  scaled <- inherits(parameter, "amiss_scaled_free")
  prior <- if (scaled) parameter$free$prior else parameter$prior
  least <- min(c(prior$lower, prior$upper) * if (scaled) parameter$factor else 1)
  if (least >= rule$lower) return(invisible())
  name <- if (scaled) parameter$free$name else parameter$name
  abort_input(c(paste("{where}: {.field {field}} must be {rule_words(rule)}, and the prior of",
                      "{.val {name}} reaches {least}."),
                i = "Cut it off there: {.code lower = {rule$lower}}."), call = call)
}

describe_part <- function(x) paste0(x$type, " '", x$name, "'")

#' @export
format.amiss_network_part <- function(x, ...) {
  of <- function(value) if (is_free(value)) format(value) else format(value, digits = 4)
  fields <- Filter(Negate(is.null), unclass(x)[names(network_fields[[x$type]])])
  places <- vapply(network_fields[[x$type]][names(fields)], function(rule) rule$kind == "place", NA)
  numbers <- fields[!places]
  told <- paste(names(numbers), vapply(numbers, of, ""), collapse = ", ")
  path <- switch(x$type, node = "", gain = paste0(", ", x$driver %||% "constant", " to ", x$to),
                 paste0(", ", x$from %||% "outside", " to ", x$to %||% "outside"))
  paste0(x$type, " ", x$name, path, ": ", told, if (!is.null(x$by)) paste(" by", x$by))
}

#' @export
print.amiss_network_part <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}
