#' A simulator composed of nodes, links, flows and gains
#'
#' Nodes hold something and exchange it in proportion to their states: heat between the resistances
#' and capacities of a grey-box model, water between the stores of a catchment, a tracer between
#' tanks. The network is linear, so each run is exact at any length of a row, and it knows its own
#' slopes: a search for the best parameters needs no runs for differences. Parameters stand in
#' the place of numbers ([free()]).
#'
#' The state `x` of each node follows `capacity dx/dt = sum of links + flows + gains`. A link brings
#' `conductance * (x_other - x)`, a flow takes `rate * x_from` from one node to another, a gain
#' brings `factor * driver`.
#'
#' | field | state | capacity | link | flow | gain |
#' |---|---|---|---|---|---|
#' | heat | temperature, degC | kWh/K | kW/K | air that moves, kW/K | kW |
#' | stores of water | amount, mm | 1 | | 1/h | rain, mm/h |
#' | tracers | concentration, g/m3 | volume, m3 | exchange, m3/h | m3/h | g/h |
#'
#' Any consistent units do; time is in hours.
#'
#' @section Start: A node with a `start` starts there. The output's node, without one, starts where
#'   the measurements stand while the model warms up. All others start in steady state between these
#'   and the drivers before the start: `before`, or the mean of the first `start_hours`.
#' @section Drivers between rows: A row of the drivers is the mean of its interval, and constant
#'   within it. With `interpolation = "linear"` it is the value at the end of its row, and drivers
#'   run in a line between rows. A driver that multiplies a part (`by`) is constant within a row in
#'   either case. A node cannot be faster than 1e-5 of a row: a smaller capacity, or none, acts like
#'   that.
#' @param ... [Parts][network_parts].
#' @param output Name of the node whose state is the output, or of the link, flow or gain whose
#'   amount an hour it is.
#' @param before Named list of drivers before the start: numbers or [free()] parameters.
#' @param hold Whether the output's node is held at the measurements while the model warms up.
#' @param interpolation `"constant"` or `"linear"`.
#' @param output_at `"mean"` of a row, or the value at its `"end"`.
#' @param start_hours Hours of data whose mean drivers are those before the start.
#' @param name A name for people.
#' @return An object of class `amiss_network`: a simulator.
#' @section Errors: `amiss_error_input` if parts, output or drivers do not fit together.
#' @source Van Loan (1978), Computing integrals involving the matrix exponential, IEEE Transactions
#'   on Automatic Control 23, 395-404. Madsen and Holst (1995), Estimation of continuous-time models
#'   for the heat dynamics of a building, Energy and Buildings 22, 67-79.
#' @seealso [network_catalogue()] for mechanisms of a house, [add_component()] for edits.
#' @examples
#' house <- network(
#'   network_node("air", capacity = free("C_air", uniform(0.2, 5), "kWh/K")),
#'   network_node("wall", capacity = free("C_wall", uniform(1, 20), "kWh/K")),
#'   network_link("air", "wall", resistance = free("R_inside", uniform(0.5, 5), "K/kW")),
#'   network_link("wall", "Te", resistance = free("R_outside", uniform(2, 20), "K/kW")),
#'   network_gain("air", "P"),
#'   output = "air")
#' house
#' drivers <- cbind(Te = c(5, 6, 7), P = c(2, 2, 0))
#' values <- cbind(C_air = 1, C_wall = 6, R_inside = 1, R_outside = 5)
#' simulate_runs(house, values, drivers, step_h = 1)
#' slopes(house, values, drivers, step_h = 1)
#'
#' # Two stores of a catchment; the river is what leaves the second one.
#' catchment <- network(
#'   network_node("soil", capacity = 1, start = 20),
#'   network_node("ground", capacity = 1),
#'   network_gain("soil", "rain"),
#'   network_flow("soil", "ground", rate = free("percolation", uniform(0.001, 0.1), "1/h")),
#'   network_flow("ground", NULL, rate = free("k", uniform(0.001, 0.05), "1/h"), name = "river"),
#'   output = "river")
#' simulate_runs(catchment, cbind(percolation = 0.02, k = 0.01), cbind(rain = c(0, 3, 1)),
#'               step_h = 1)
#' @export
network <- function(..., output, before = list(), hold = TRUE, interpolation = "constant",
                    output_at = "mean", start_hours = 24, name = "network") {
  check_arguments()
  check_input(checkmate::check_string(output, min.chars = 1), "output")
  check_input(checkmate::check_flag(hold), "hold")
  check_input(checkmate::check_choice(interpolation, c("constant", "linear")), "interpolation")
  check_input(checkmate::check_choice(output_at, c("mean", "end")), "output_at")
  check_input(checkmate::check_number(start_hours, lower = 0, finite = TRUE), "start_hours")
  check_input(checkmate::check_string(name), "name")
  if (is.numeric(before)) before <- as.list(before)
  check_input(checkmate::check_list(before, names = if (length(before)) "unique"), "before",
              "Give a named list: driver = number or {.fun free}.")
  new_network(
    list(format_version = format_version, name = name, components = named_parts(list(...)),
         output = output, before = before, hold = hold, interpolation = interpolation,
         output_at = output_at, start_hours = start_hours))
}

named_parts <- function(parts, call = rlang::caller_env()) {
  other <- Filter(function(x) !inherits(x, "amiss_network_part"), parts)
  if (length(other)) {
    abort_input(c("A network is composed of its parts; got {seen(other[[1]])}.",
                  i = paste("Give for example {.fn network_node}, {.fn network_link},",
                            "{.fn network_gain}.")), call = call)
  }
  for (one in parts) check_whole(one, "...", call = call)
  names(parts) <- vapply(parts, `[[`, "", "name")
  twice <- names(parts)[duplicated(names(parts))]
  if (length(twice)) {
    abort_input(c(paste("Every part needs a name of its own; used more than once:",
                        "{.val {unique(twice)}}."), i = "Give {.arg name}."), call = call)
  }
  parts
}

# Checks that parts, output and drivers fit together, and makes the object.
new_network <- function(x, call = rlang::caller_env()) {
  x <- structure(x, class = "amiss_network")
  nodes <- node_names(x)
  if (!length(nodes)) abort_input("A network needs at least one {.fn network_node}.", call = call)
  if (!x$output %in% names(x$components)) {
    abort_input(c("{.arg output} is {.val {x$output}}, and the network has no such part.",
                  i = "Its parts: {.val {names(x$components)}}."), call = call)
  }
  for (part in x$components) check_part_places(part, nodes, call)
  unknown <- setdiff(names(x$before), driver_names(x))
  if (length(unknown)) {
    abort_input(c("{.arg before} names {.val {unknown[1]}}, which drives nothing in the network.",
                  i = "Its drivers: {.val {driver_names(x)}}."), call = call)
  }
  rule <- network_number(-Inf)
  for (driver in names(x$before)) check_part_field(x$before[[driver]], rule, "before", driver, call)
  collect_parameters(network_fields_free(x), call)
  x
}

check_part_places <- function(part, nodes, call) {
  if (part$type == "node") return(invisible())
  ends <- switch(part$type, gain = part$to, c(part$from, part$to))
  if (!any(ends %in% nodes)) {
    abort_input(c(paste("{describe_part(part)} stands at {.val {ends}}, and the network has no",
                        "such node."), i = "Its nodes: {.val {nodes}}."), call = call)
  }
  columns <- c(part$by, if (part$type == "gain") part$driver)
  if (any(columns %in% nodes)) {
    abort_input(c(paste("{describe_part(part)} needs a driver column, and",
                        "{.val {intersect(columns, nodes)}} is a node."),
                  i = "What passes between nodes is a {.fn network_link} or a {.fn network_flow}."),
                call = call)
  }
}

node_names <- function(network) {
  names(Filter(function(part) part$type == "node", network$components))
}

#' @export
print.amiss_network <- function(x, ...) on_stdout(x, {
  types <- vapply(x$components, `[[`, "", "type")
  count <- function(type) paste0(sum(types == type), " ", type, if (sum(types == type) != 1) "s")
  cli::cli_text(paste("{.strong Network} {.val {x$name}}: {vapply(unique(types), count, '')};",
                      "output {.field {x$output}}"))
  shown <- utils::head(x$components, 10)
  say_bullets(vapply(shown, format, ""))
  if (length(x$components) > length(shown))
    say_bullets(paste(length(x$components) - length(shown), "more parts"))
  cli::cli_bullets(c("*" = "drivers: {.field {driver_names(x)}}",
                     ">" = "next: {.fun upgrade_model}, or {.fun add_component} for a mechanism"))
})

#' @export
free_parameters.amiss_network <- function(simulator)
  collect_parameters(network_fields_free(simulator))

network_fields_free <- function(network) free_fields(unclass(network)[c("components", "before")])

#' @export
driver_names.amiss_network <- function(simulator) {
  places <- lapply(simulator$components, function(part) {
    switch(part$type, node = NULL, gain = c(part$driver, part$by), c(part$from, part$to, part$by))
  })
  setdiff(as.character(unlist(places)), node_names(simulator))
}
