# Worlds whose base model is wrong in structure besides: whatever its parameters, something is left.
# In half of them an effect of the catalogue is hidden as well.
# - "one layer for three": the box of worlds.R, whose walls have three layers, fitted with walls of
#   one (paper_box("M1")).
# - "one zone for two": a network of network.R with a room behind a door that the model does not
#   have and nobody measures.

# A second room: its air, its wall, the door, and part of the heating. Its numbers belong to the
# truth alone.
with_second_zone <- function(base) {
  network <- base$network
  scale <- network$scale
  values <-
    exp(stats::runif(4, log(0.5), log(2))) * c(1, 4, 1, 4) * c(scale, scale, 1 / scale, 1 / scale)
  names(values) <- c("C_room", "C_room_wall", "R_room_inside", "R_room_outside")
  values[["H_door"]] <- scale * exp(stats::runif(1, log(0.05), log(0.5)))
  share <- stats::runif(1, 0, 0.5)
  network <- add_node(add_node(network, "room", "C_room"), "room_wall", "C_room_wall")
  network <- add_link(network, "room", "room_wall", "R_room_inside")
  network <- add_link(network, "room_wall", "outside", "R_room_outside")
  network <- add_link(network, "air", "room", "H_door", conductance = TRUE)
  network <- add_gain(network, "room", "P", share)
  network$fixed <- c(network$fixed, values)
  list(simulator = network_simulator(network, base$step), values = values)
}

wrong_structures <- c("one layer for three", "one zone for two")

#' As draw_world(): seed, and what may be fixed; `structure` is one of the two above.
draw_wrong_world <- function(seed, kind = NULL, strength = NULL, days = NULL, structure = NULL) {
  set.seed(seed, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
  drawn_structure <- sample(wrong_structures, 1)
  structure <- if (is.null(structure)) drawn_structure else structure
  effects <- if (structure == wrong_structures[1]) catalogue_kinds else names(network_pieces)
  drawn_kind <- if (stats::runif(1) < 0.5) "none" else sample(effects, 1)
  kind <- if (is.null(kind)) drawn_kind else kind
  own <- sample.int(1e9, 1)  # not the worlds that the other families have from this seed
  world <- if (structure == wrong_structures[1]) {
    one_layer_for_three(draw_world(own, kind, strength, days))
  } else {
    draw_network_world(own, kind, strength, days, second_zone = TRUE)
  }
  world$seed <- seed
  world$family <- "wrong"
  world$structure <- structure
  world
}

# Its misfit, as that of the other: RMS of what its parameters leave of the truth without an effect,
# over the noise.
one_layer_for_three <- function(world) {
  offset <- amiss::free("initial_wall_offset", amiss::normal(0, 1, -3, 3), "K")
  world$base <- amiss::change_component(amiss::paper_box("M1"), "zone",
                                        initial_wall_offset = offset)
  m <- world$measurements
  m$raw$y <- simulate_truth(amiss::paper_box("M2"), world$values, world$data)
  whole <- !is.na(m$block)
  m$y <- as.numeric(rowsum(m$raw$y[whole], m$block[whole])) / m$per_step
  world$misfit <- best_on_record(world$base, m, world$seed, starts = 1)$rms / world$noise
  world
}
