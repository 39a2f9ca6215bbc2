# Runs of a network, and their slopes.

#' @export
simulate_runs.amiss_network <- function(simulator, values, drivers, step_h, hold = NULL,
                                        threads = 1L, ...) {
  check_run_dots(...)
  call <- rlang::current_env()
  check_run_number(nrow(values), nrow(drivers))
  run <- network_request(simulator, drivers, step_h, hold, call)
  numbers <- coefficient_values(coefficient_table(simulator), values)
  call_engine(network_simulate_(run$network, numbers, run$drivers, run$hold, run$options,
                                engine_context(0, threads)), call)
}

#' @export
slopes.amiss_network <- function(simulator, values, drivers, step_h, hold = NULL, ...) {
  call <- rlang::current_env()
  parameters <- names(parameters_of(simulator))
  check_named_columns(values, "values", parameters)
  check_named_columns(drivers, "drivers", named_drivers(simulator))
  run <- network_request(simulator, drivers, step_h, hold, call)
  table <- coefficient_table(simulator)
  at <- values[1, , drop = FALSE]
  out <- call_engine(network_slopes_(run$network, coefficient_values(table, at)[, 1],
                                     coefficient_slopes(table, at, parameters), run$drivers,
                                     run$hold, run$options), call)
  colnames(out) <- parameters
  out
}

# What the engine is given beside numbers.
network_request <- function(network, drivers, step_h, hold, call) {
  check_network_joined(network, hold, call)
  needed <- named_drivers(network)
  drivers <- drivers[, needed, drop = FALSE]
  storage.mode(drivers) <- "double"
  gaps <- needed[!apply(is.finite(drivers), 2, all)]
  if (length(gaps)) {
    abort_input(c("{.arg drivers} has missing or infinite values in {.val {gaps}}.",
                  i = "The simulator needs every driver in every row: fill the gaps first."),
                call = call)
  }
  list(network = engine_network(network, needed), drivers = drivers,
       hold = if (network$hold) as.numeric(hold) else numeric(),
       options = list(step_h = step_h, linear = network$interpolation == "linear",
                      mean = network$output_at == "mean", start_hours = network$start_hours))
}

# A node that nothing joins to a driver or to a known state has no steady state to start from.
check_network_joined <- function(network, hold, call) {
  parts <- network$components
  nodes <- Filter(function(part) part$type == "node", parts)
  known <- vapply(nodes, function(node) !is.null(node$start) || identical(node$capacity, Inf), NA)
  held <- network$hold && any(is.finite(hold))
  loose <- setdiff(names(nodes), c(names(nodes)[known], if (held) network$output))
  joins <- Filter(function(part) part$type == "link" || part$type == "flow", parts)
  repeat {
    joined <- loose[vapply(loose, function(node) any(vapply(joins, leaves, NA, node, loose)), NA)]
    if (!length(joined)) break
    loose <- setdiff(loose, joined)
  }
  if (!length(loose)) return(invisible())
  abort_input(
    c("Node {.val {loose[1]}} has no steady state to start from: nothing leads out of it.",
      i = paste("Give its {.field start}, or a {.fn network_link} or {.fn network_flow} that leads",
                "elsewhere.")), call = call)
}

# Whether a part takes something from a node to where it is not kept among those that are loose.
leaves <- function(part, node, loose) {
  if (part$type == "flow") return(identical(part$from, node) && !isTRUE(part$to %in% loose))
  ends <- c(part$from, part$to)
  node %in% ends && !setdiff(ends, node) %in% loose
}

# Numbers from 0 in place of names, as the engine has them.
engine_network <- function(network, drivers) {
  nodes <- node_names(network)
  exchanges <- Filter(function(part) part$type != "node", network$components)
  elements <- stats::setNames(seq_along(exchanges) - 1, names(exchanges))
  place <- function(name) {
    c(node = match(name %||% NA, nodes, 0) - 1, driver = match(name %||% NA, drivers, 0) - 1)
  }
  term <- function(into, of, sign, part) {
    by <- if (is.null(part$by)) -1 else match(part$by, drivers) - 1
    c(place(into)[["node"]], place(of), sign, elements[[part$name]], by)
  }
  balance <- do.call(
    rbind, c(list(matrix(0, 0, 6)), lapply(exchanges, function(part) part_terms(part, term))))
  list(nodes = length(nodes), elements = length(exchanges), drivers = length(drivers),
       balance = balance[balance[, 1] >= 0, , drop = FALSE],
       output = if (network$output %in% nodes) rbind(c(-1, place(network$output), 1, -1, -1))
                else output_terms(exchanges[[network$output]], term))
}

# What a part brings to the balances at both its ends; the engine drops those that are no nodes.
part_terms <- function(part, term) {
  switch(part$type,
    link = rbind(term(part$to, part$from, 1, part), term(part$to, part$to, -1, part),
                 term(part$from, part$to, 1, part), term(part$from, part$from, -1, part)),
    flow = rbind(term(part$to, part$from, 1, part), term(part$from, part$from, -1, part)),
    gain = term(part$to, part$driver, 1, part))
}

# The amount an hour that passes a part.
output_terms <- function(part, term) {
  switch(part$type,
    link = rbind(term(NULL, part$from, 1, part), term(NULL, part$to, -1, part)),
    flow = rbind(term(NULL, part$from, 1, part)),
    gain = rbind(term(NULL, part$driver, 1, part)))
}

# All coefficients in the engine's order: elements, capacities, starts, drivers before the start.
# Each is a number, or a factor times a parameter, or the inverse of that.
coefficient_table <- function(network) {
  parts <- network$components
  nodes <- Filter(function(part) part$type == "node", parts)
  element <- function(part) switch(part$type, link = part$conductance %||% part$resistance,
                                   flow = part$rate, gain = part$factor)
  exchanges <- Filter(function(part) part$type != "node", parts)
  fields <- c(lapply(exchanges, element), lapply(nodes, `[[`, "capacity"),
              lapply(nodes, function(node) node$start %||% NaN),
              lapply(named_drivers(network), function(driver) network$before[[driver]] %||% NaN))
  inverse <- c(vapply(exchanges, function(part) !is.null(part$resistance), NA),
               logical(2 * length(nodes) + length(named_drivers(network))))
  scaled <- vapply(fields, inherits, NA, "amiss_scaled_free")
  free <- vapply(fields, is_free, NA)
  data.frame(value = vapply(seq_along(fields),
                            function(i) if (free[i]) NA_real_ else as.numeric(fields[[i]]), 0),
             parameter = vapply(seq_along(fields), function(i) {
               if (scaled[i]) fields[[i]]$free$name
               else if (free[i]) fields[[i]]$name
               else NA_character_
             }, ""),
             factor = vapply(seq_along(fields),
                             function(i) if (scaled[i]) fields[[i]]$factor else 1, 0),
             inverse = unname(inverse))
}

# Coefficients x runs.
coefficient_values <- function(table, values) {
  out <- matrix(table$value, nrow(table), nrow(values))
  free <- which(!is.na(table$parameter))
  if (length(free)) {
    out[free, ] <- table$factor[free] * t(values[, table$parameter[free], drop = FALSE])
  }
  out[table$inverse, ] <- 1 / out[table$inverse, ]
  out
}

# Coefficients x parameters: what each changes by for a unit of each parameter.
coefficient_slopes <- function(table, at, parameters) {
  out <- matrix(0, nrow(table), length(parameters))
  free <- which(!is.na(table$parameter))
  slope <- table$factor[free]
  inverse <- table$inverse[free]
  slope[inverse] <- -slope[inverse] / (slope * at[1, table$parameter[free]])[inverse]^2
  out[cbind(free, match(table$parameter[free], parameters))] <- slope
  out
}
