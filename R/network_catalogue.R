#' A catalogue of mechanisms for a network of a house
#'
#' @description Lists what may be missing in a grey-box model of a house:
#'
#'   * sun on the air,
#'   * sun on the envelope,
#'   * heater lag,
#'   * interior mass,
#'   * direct loss to outdoors,
#'   * wind-driven leakage,
#'   * an envelope that stores heat,
#'   * heat to a neighbour,
#'   * heat to the ground,
#'   * heating output.
#'
#' @details A mechanism is left out if its driver is `NULL`, or if the network has it already.
#'
#'   The priors have the size of the house that the model describes. Conductances and capacities go
#'   up to multiples of the house's own loss and capacity, both at the medians of its priors. If you
#'   know more, replace a mechanism by your own.
#'
#' @param network A [network()], temperatures in degC, heat in kW.
#' @param air Node of the room's air.
#' @param envelope Node of the outermost layer of the envelope, or `NULL` if the network has none.
#' @param outdoors,sun,heating,wind,neighbour Driver columns: outdoor temperature (degC), sun (W/m2,
#'   or `sun_factor` times kW/m2), heating (kW), wind speed (m/s), temperature next door (degC).
#'   `NULL` if there is none.
#' @param sun_factor Factor that turns the column of the sun into kW/m2.
#' @return A [catalogue()].
#' @examples
#' house <- network(
#'   network_node("air", capacity = free("C_air", uniform(0.2, 5), "kWh/K")),
#'   network_link("air", "Te", conductance = free("H", uniform(0.01, 0.3), "kW/K")),
#'   network_gain("air", "P"),
#'   output = "air")
#' network_catalogue(house, heating = "P", outdoors = "Te", sun = "Gv")
#' @export
network_catalogue <- function(network, air = network$output, envelope = NULL, outdoors = NULL,
                              sun = NULL, heating = NULL, wind = NULL, neighbour = NULL,
                              sun_factor = 1e-3) {
  check_arguments()
  check_object(network, "amiss_network", "network", "Make one with {.fn network}.")
  check_node(air, network, "air")
  if (!is.null(envelope)) check_node(envelope, network, "envelope")
  columns <- list(outdoors = outdoors, sun = sun, heating = heating, wind = wind,
                  neighbour = neighbour)
  for (role in names(columns)) {
    check_input(checkmate::check_string(columns[[role]], min.chars = 1, null.ok = TRUE), role)
  }
  check_input(checkmate::check_number(sun_factor, lower = 0, finite = TRUE), "sun_factor")
  house <- c(list(air = air, envelope = envelope, sun_factor = sun_factor,
                  parts = network$components), columns, house_size(network))
  found <- lapply(house_mechanisms, function(make) make(house))
  do.call(catalogue, unname(Filter(Negate(is.null), found)))
}

check_node <- function(name, network, what, call = rlang::caller_env()) {
  if (checkmate::test_choice(name, node_names(network))) return(invisible())
  abort_input(c("{.arg {what}} is {seen(name)}, and the network has no such node.",
                i = "Its nodes: {.val {node_names(network)}}."), call = call)
}

# Loss to the drivers (kW/K) and capacity (kWh/K) at the medians of the priors.
house_size <- function(network) {
  parameters <- free_parameters(network)
  medians <- vapply(parameters, function(parameter) prior_quantile(parameter$prior, 0.5), 0)
  numbers <- coefficient_values(coefficient_table(network), t(medians))[, 1]
  nodes <- node_names(network)
  exchanges <- Filter(function(part) part$type != "node", network$components)
  outward <- vapply(
    exchanges, function(part) part$type == "link" && !all(c(part$from, part$to) %in% nodes), NA)
  capacity <- numbers[length(exchanges) + seq_along(nodes)]
  list(loss = max(sum(numbers[seq_along(exchanges)][outward]), 1e-6),
       capacity = max(sum(capacity[is.finite(capacity)]), 1e-6))
}

# How much there is of a mechanism, from nothing on; about a decade around a centre.
from_nothing <- function(name, most, unit, label) free(name, uniform(0, most), unit, label)
about <- function(name, centre, unit, label) {
  free(name, lognormal(log(centre), log(10) / 2, centre / 30, centre * 30), unit, label)
}

house_mechanism <- function(name, boundary, sentence, ...) {
  parts <- list(...)
  mechanism(name, boundary = boundary, sentence = sentence,
            edit = function(model) do.call(add_component, c(list(model), parts)))
}

# Each from a description of the house; NULL where the house has no place for it. Sun that heats by
# 30 K at 0.5 kW/m2 comes through 60 m2 for each kW/K of loss.
house_mechanisms <- list(
  function(house) {
    if (is.null(house$sun) || has_gain(house, house$air, house$sun)) return(NULL)
    aperture <- from_nothing("A_air", 60 * house$loss, "m2", "solar aperture towards the air")
    house_mechanism("sun on the air", house$sun, "Sun enters through windows and warms the air.",
                    network_gain(house$air, house$sun, aperture * house$sun_factor))
  },
  function(house) {
    if (is.null(house$sun) || is.null(house$envelope) || has_gain(house, house$envelope, house$sun))
      return(NULL)
    aperture <- from_nothing("A_envelope", 60 * house$loss, "m2",
                             "solar aperture towards the envelope")
    house_mechanism("sun on the envelope", house$sun, "Sun warms the envelope.",
                    network_gain(house$envelope, house$sun, aperture * house$sun_factor))
  },
  function(house) heater_lag(house),
  function(house) {
    capacity <- from_nothing("C_mass", 3 * house$capacity, "kWh/K", "capacity of the mass inside")
    conductance <- about("H_mass", 5 * house$loss, "kW/K",
                         "conductance between the air and the mass inside")
    house_mechanism("interior mass", as.character(c(house$heating, house$sun, house$outdoors)),
                    "Something inside takes up heat and gives it back.",
                    network_node("mass", capacity),
                    network_link(house$air, "mass", conductance = conductance))
  },
  function(house) {
    if (is.null(house$outdoors) || has_link(house, house$air, house$outdoors)) return(NULL)
    conductance <- from_nothing("H_direct", 2 * house$loss, "kW/K",
                                "direct loss from the air to outdoors")
    house_mechanism(
      "direct loss to outdoors", house$outdoors,
      "Heat leaves the air without passing the mass of the envelope, by air leakage or windows.",
      network_link(house$air, house$outdoors, conductance = conductance, name = "direct loss"))
  },
  function(house) {
    if (is.null(house$wind) || is.null(house$outdoors)) return(NULL)
    conductance <- from_nothing("H_wind", house$loss / 2, "kW/K per m/s",
                                "air leakage for each m/s of wind")
    house_mechanism("wind-driven leakage", c(house$wind, house$outdoors),
                    "Wind drives outdoor air through leaks.",
                    network_link(house$air, house$outdoors, conductance = conductance,
                                 by = house$wind, name = "wind leakage"))
  },
  function(house) {
    if (is.null(house$outdoors)) return(NULL)
    capacity <- from_nothing("C_shell", 10 * house$capacity, "kWh/K",
                             "capacity of an envelope that stores heat")
    inside <- about("H_shell_inside", 5 * house$loss, "kW/K",
                    "conductance between the air and that envelope")
    outside <- about("H_shell_outside", house$loss, "kW/K",
                     "conductance between that envelope and outdoors")
    house_mechanism("envelope that stores heat", c(house$heating, house$outdoors),
                    "A part of the envelope stores heat between indoors and outdoors.",
                    network_node("shell", capacity),
                    network_link(house$air, "shell", conductance = inside),
                    network_link("shell", house$outdoors, conductance = outside))
  },
  function(house) {
    if (is.null(house$neighbour) || has_link(house, house$air, house$neighbour)) return(NULL)
    conductance <- from_nothing("H_neighbour", 2 * house$loss, "kW/K",
                                "conductance to the neighbour")
    house_mechanism("heat to a neighbour", house$neighbour, "Heat passes to or from a neighbour.",
                    network_link(house$air, house$neighbour, conductance = conductance,
                                 name = "neighbour"))
  },
  function(house) {
    conductance <- from_nothing("H_ground", house$loss, "kW/K", "conductance to the ground")
    ground <- free("T_ground", normal(12, 3, 2, 25), "degC", "temperature of the ground")
    house_mechanism("heat to the ground", character(),
                    "Heat passes to ground of a constant temperature.",
                    network_node("ground", Inf, start = ground),
                    network_link(house$air, "ground", conductance = conductance))
  },
  function(house) {
    gain <- heating_gain(house)
    if (is.null(gain) || is_free(gain$factor)) return(NULL)
    share <- free("heating_share", uniform(0.5, 1.5), "",
                  "heating that arrives, over that recorded")
    mechanism("heating output", boundary = house$heating,
              sentence = "Less or more heat arrives than is recorded as heating.",
              edit = function(model) change_component(model, gain$name,
                                                      factor = share * gain$factor))
  })

heater_lag <- function(house) {
  gain <- heating_gain(house)
  if (is.null(gain) || gain$to != house$air) return(NULL)
  capacity <- from_nothing("C_heater", house$capacity, "kWh/K", "capacity of the heater")
  conductance <- about("H_heater", 5 * house$loss, "kW/K", "conductance between heater and air")
  mechanism("heater lag", boundary = house$heating,
            sentence = "The heater stores heat and gives it off with a delay.",
            edit = function(model) {
    model <- add_component(model, network_node("heater", capacity),
                           network_link("heater", house$air, conductance = conductance))
    change_component(model, gain$name, to = "heater")
  })
}

heating_gain <- function(house) {
  if (is.null(house$heating)) return(NULL)
  gains <- Filter(function(part) part$type == "gain" && identical(part$driver, house$heating),
                  house$parts)
  if (length(gains) == 1) gains[[1]]
}

has_gain <- function(house, node, driver) {
  any(vapply(house$parts, function(part) {
    part$type == "gain" && part$to == node && identical(part$driver, driver)
  }, NA))
}

has_link <- function(house, a, b) {
  any(vapply(house$parts, function(part) {
    part$type == "link" && is.null(part$by) && setequal(c(part$from, part$to), c(a, b))
  }, NA))
}
