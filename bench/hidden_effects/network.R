# Grey-box thermal networks of a house: nodes with a heat capacity, resistances between them, and
# three boundary conditions: outdoor temperature Te (degC), sun Gv (W/m2) and heating P (kW).
# Capacities in kWh/K, resistances in K/kW, apertures in m2. Base models lack five things, which are
# the mechanisms; each of these adds its node, links or gains, and its parameters, to whatever
# network it is given.

network_conditions <- c("Te", "Gv", "P")

# About a decade: within a factor of root ten of the centre, either lognormal with nine tenths of
# its mass or more in there, or flat in the logarithm (a lognormal so wide that the truncation is
# all that is left of it).
decade <- function(name, centre, unit, label, flat) {
  sdlog <- if (flat) 10 else log(10) / 4
  amiss::free(name, amiss::lognormal(log(centre), sdlog, centre / sqrt(10), centre * sqrt(10)),
              unit, label)
}

# How much there is of a mechanism, from nothing on.
extent <- function(name, most, unit, label) amiss::free(name, amiss::uniform(0, most), unit, label)

add_parameter <- function(network, parameter) {
  network$parameters[[parameter$name]] <- parameter
  network
}

# A node of a capacity: that of a parameter, or a share of it.
add_node <- function(network, node, capacity, share = 1) {
  network$nodes <- rbind(network$nodes, data.frame(node = node, capacity = capacity, share = share))
  network
}

# A resistance between two nodes, or a node and the air outside; `conductance` if the parameter is
# its inverse.
add_link <- function(network, from, to, parameter, conductance = FALSE) {
  link <- data.frame(from = from, to = to, parameter = parameter, conductance = conductance)
  network$links <- rbind(network$links, link)
  network
}

# Heat that a driver gives to a node: times a number, and times a parameter if one is named.
add_gain <- function(network, node, driver, factor, parameter = NA_character_) {
  gain <- data.frame(node = node, driver = driver, factor = factor, parameter = parameter)
  network$gains <- rbind(network$gains, gain)
  network
}

# Base networks. The envelope is one node or a chain of them, a roof or a floor stands beside it;
# some of the heating may go to the inner surface of the wall; the sun may already reach the floor.
network_topologies <- c("one wall", "lined wall", "layered wall", "thick wall", "wall and roof",
                        "wall and floor", "sunny floor")

#' @param scale Size of the house: capacities and conductances grow with it.
#' @param radiant Share of the heating that reaches the inner surface of the wall.
base_network <- function(topology, scale = 1, flat = FALSE, radiant = 0) {
  network <- list(topology = topology, scale = scale, flat = flat, pieces = character(),
                  parameters = list(), fixed = c(R_ground = 12 / scale), start = c(held = 20))
  capacity <- function(network, name, centre, label) {
    add_parameter(network, decade(name, centre * scale, "kWh/K", label, flat))
  }
  resistance <- function(network, name, centre, label) {
    add_parameter(network, decade(name, centre / scale, "K/kW", label, flat))
  }
  network <- capacity(network, "C_air", 1, "capacity of the air and what follows it")
  network <- capacity(network, "C_wall", 4, "capacity of the wall")
  network <- add_node(network, "air", "C_air")
  layers <- switch(topology, "layered wall" = 2, "thick wall" = 3, 1)
  walls <- if (layers == 1) "wall" else paste0("wall", seq_len(layers))
  for (node in walls) network <- add_node(network, node, "C_wall", 1 / layers)
  network <- resistance(network, "R_inside", 1, "resistance between air and wall")
  inner <- walls[1]
  if (topology == "lined wall") {
    network <- capacity(network, "C_lining", 1, "capacity of the lining")
    network <- resistance(network, "R_lining", 0.8, "resistance between lining and wall")
    network <- add_node(network, "lining", "C_lining")
    network <- add_link(network, "air", "lining", "R_inside")
    network <- add_link(network, "lining", "wall", "R_lining")
    inner <- "lining"
  } else {
    network <- add_link(network, "air", inner, "R_inside")
  }
  if (layers > 1) {
    network <- resistance(network, "R_wall", 1.5, "resistance between layers of the wall")
    for (i in seq_len(layers - 1)) network <- add_link(network, walls[i], walls[i + 1], "R_wall")
  }
  network <- resistance(network, "R_outside", 4, "resistance between wall and outdoor air")
  network <- add_link(network, walls[layers], "outside", "R_outside")
  network$outermost <- walls[layers]
  if (topology == "wall and roof") {
    network <- capacity(network, "C_roof", 1, "capacity of the roof")
    network <- resistance(network, "R_roof_inside", 3, "resistance between air and roof")
    network <- resistance(network, "R_roof_outside", 6, "resistance between roof and outdoor air")
    network <- add_node(network, "roof", "C_roof")
    network <- add_link(network, "air", "roof", "R_roof_inside")
    network <- add_link(network, "roof", "outside", "R_roof_outside")
  }
  if (topology %in% c("wall and floor", "sunny floor")) {
    network <- capacity(network, "C_floor", 3, "capacity of the floor")
    network <- resistance(network, "R_floor", 1.5, "resistance between air and floor")
    network <- add_node(network, "floor", "C_floor")
    network <- add_link(network, "air", "floor", "R_floor")
    network <- add_link(network, "floor", "outside", "R_ground")
  }
  if (topology == "sunny floor") {
    network <- add_parameter(network, decade("A_floor", 2 * scale, "m2",
                                             "solar aperture towards the floor", flat))
    network <- add_gain(network, "floor", "Gv", 1e-3, "A_floor")
  }
  if (radiant > 0) network <- add_gain(network, inner, "P", radiant)
  add_gain(network, "air", "P", 1 - radiant)
}

# The air was held at a temperature before the record began; what outdoor temperature the rest
# remembers is not known.
with_past <- function(network, held, first_day) {
  network$start[["held"]] <- held
  prior <- amiss::normal(first_day, 1.5, first_day - 4.5, first_day + 4.5)
  add_parameter(network, amiss::free("remembered", prior, "degC",
                                     "outdoor temperature that the walls remember"))
}

# The mechanisms. The first parameter of each is its extent, zero where the mechanism is absent.
network_pieces <- list(
  "solar gain on the air" = function(network) {
    aperture <- extent("A_window", 12 * network$scale, "m2", "solar aperture towards the air")
    network <- add_parameter(network, aperture)
    add_gain(network, "air", "Gv", 1e-3, "A_window")
  },
  "heater state" = function(network) {
    capacity <- extent("C_heater", 3 * network$scale, "kWh/K", "capacity of the heater")
    resistance <- decade("R_heater", 0.6 / network$scale, "K/kW",
                         "resistance between heater and air", network$flat)
    network <- add_parameter(add_parameter(network, capacity), resistance)
    network <- add_link(add_node(network, "heater", "C_heater"), "heater", "air", "R_heater")
    network$gains$node[network$gains$driver == "P" & network$gains$node == "air"] <- "heater"
    network
  },
  "interior mass" = function(network) {
    capacity <- extent("C_mass", 8 * network$scale, "kWh/K", "capacity of the mass inside")
    resistance <- decade("R_mass", 0.8 / network$scale, "K/kW", "resistance between air and mass",
                         network$flat)
    network <- add_parameter(add_parameter(network, capacity), resistance)
    add_link(add_node(network, "mass", "C_mass"), "air", "mass", "R_mass")
  },
  "envelope leak" = function(network) {
    network <- add_parameter(network, extent("H_leak", 0.15 * network$scale, "kW/K",
                                             "direct loss to the outdoor air"))
    add_link(network, "air", "outside", "H_leak", conductance = TRUE)
  },
  "sun on the envelope" = function(network) {
    aperture <- extent("A_wall", 10 * network$scale, "m2",
                       "solar aperture towards the wall's outer layer")
    network <- add_parameter(network, aperture)
    add_gain(network, network$outermost, "Gv", 1e-3, "A_wall")
  })

network_boundary <- list("solar gain on the air" = "Gv", "heater state" = "P",
                         "interior mass" = c("P", "Te", "Gv"), "envelope leak" = "Te",
                         "sun on the envelope" = "Gv")

network_sentences <- c(
  "solar gain on the air" =
    "Sun enters through windows and warms the air, which the model leaves out.",
  "heater state" =
    "The heater stores heat and gives it off with a delay that the model leaves out.",
  "interior mass" =
    "The house holds mass, in exchange with the air alone, that the model leaves out.",
  "envelope leak" = "Heat passes from the air to outdoors directly, past the mass of the envelope.",
  "sun on the envelope" = "The sun warms the outside of the wall, which the model leaves out.")

# A network as numbers to be filled in: where the values of parameters go.
network_plan <- function(network) {
  nodes <- network$nodes$node
  place <- function(node) ifelse(node == "outside", 0L, match(node, nodes))
  links <- network$links
  gains <- network$gains
  list(n = length(nodes), capacity = network$nodes$capacity, share = network$nodes$share,
       from = place(links$from), to = place(links$to), resistance = links$parameter,
       conductance = links$conductance, gain_node = place(gains$node),
       gain_driver = match(gains$driver, network_conditions), gain_factor = gains$factor,
       gain_parameter = gains$parameter, fixed = network$fixed, start = network$start)
}

# C dx/dt = -loss x + gain u, with `root` of 1 / C, and where it begins: steady before the record,
# the air held, the rest between it and what it remembers of outdoors.
network_equations <- compiler::cmpfun(function(plan, values) {
  n <- plan$n
  values <- c(values, plan$fixed)
  root <- 1 / sqrt(pmax(unname(values[plan$capacity]) * plan$share, 1e-6))
  conductance <- unname(values[plan$resistance])
  conductance[!plan$conductance] <- 1 / conductance[!plan$conductance]
  loss <- matrix(0, n, n)
  gain <- matrix(0, n, 3)
  for (l in seq_along(conductance)) {
    i <- plan$from[l]
    j <- plan$to[l]
    loss[i, i] <- loss[i, i] + conductance[l]
    if (j == 0L) {
      gain[i, 1] <- gain[i, 1] + conductance[l]
    } else {
      loss[j, j] <- loss[j, j] + conductance[l]
      loss[i, j] <- loss[j, i] <- loss[i, j] - conductance[l]
    }
  }
  held <- plan$start[["held"]]
  outdoors <- values[["remembered"]]
  start <- c(held, solve(loss[-1, -1, drop = FALSE], gain[-1, 1] * outdoors - loss[-1, 1] * held))
  for (l in seq_along(plan$gain_node)) {
    parameter <- plan$gain_parameter[l]
    i <- plan$gain_node[l]
    j <- plan$gain_driver[l]
    gain[i, j] <- gain[i, j] +
      plan$gain_factor[l] * if (is.na(parameter)) 1 else values[[parameter]]
  }
  list(loss = loss, gain = gain, root = root, start = start)
})

# Temperature of the air, averaged over each step, driven by conditions that are constant over a
# step: exact, mode by mode. The truth is computed so, the models are the package's own networks.
network_output <- compiler::cmpfun(function(plan, values, drivers, step) {
  n <- plan$n
  equations <- network_equations(plan, values)
  root <- equations$root
  modes <- eigen(root * equations$loss * rep(root, each = n), symmetric = TRUE)
  rate <- pmax(modes$values, 1e-12)
  left <- modes$vectors * root
  forcing <- drivers %*% crossprod(equations$gain, left)
  initial <- as.numeric(crossprod(modes$vectors, equations$start / root))
  out <- numeric(nrow(drivers))
  for (k in seq_len(n)) {
    kept <- exp(-rate[k] * step)
    to <- (1 - kept) / rate[k]
    end <- stats::filter(to * forcing[, k], kept, "recursive", init = initial[k])
    begun <- c(initial[k], end[-length(end)])
    out <- out + left[1, k] * (begun * to / step + (1 - to / step) / rate[k] * forcing[, k])
  }
  out
})

# Temperature that a kilowatt of heating adds in the long run.
lift_per_kw <- function(network, values) {
  heated <- matrix(c(0, 0, 1), 2, 3, byrow = TRUE)
  rise <- function(drivers) network_output(network_plan(network), values, drivers, 1e6)[2]
  rise(heated) - rise(0 * heated)
}

#' The package's simulator of a network, which carries the description that it was built from.
#' @param step Length of a row of the drivers in hours.
network_simulator <- function(network, step, parameters = network$parameters) {
  field <- function(name, factor = 1) {
    if (name %in% names(parameters)) parameters[[name]] * factor else network$fixed[[name]] * factor
  }
  place <- function(node) if (node == "outside") "Te" else node
  nodes <- Map(function(node, capacity, share) {
    amiss::network_node(node, field(capacity, share),
                        start = if (node == "air") network$start[["held"]])
  }, network$nodes$node, network$nodes$capacity, network$nodes$share)
  links <- Map(function(from, to, parameter, conductance) {
    if (conductance) amiss::network_link(from, place(to), conductance = field(parameter))
    else amiss::network_link(from, place(to), resistance = field(parameter))
  }, network$links$from, network$links$to, network$links$parameter, network$links$conductance)
  gains <- Map(function(node, driver, factor, parameter) {
    amiss::network_gain(node, driver, if (is.na(parameter)) factor else field(parameter, factor))
  }, network$gains$node, network$gains$driver, network$gains$factor, network$gains$parameter)
  parts <- unname(c(nodes, links, gains))
  before <- list(Te = field("remembered"), P = 0)
  if ("Gv" %in% network$gains$driver) before$Gv <- 0
  built <- do.call(amiss::network, c(parts, list(output = "air", before = before, hold = FALSE,
                                                 name = network$topology)))
  built$network <- network
  built$step <- step
  built
}

# The model with one more piece; parameters that it has, whatever their priors have become, stay as
# they are.
network_with <- function(model, piece) {
  network <- network_pieces[[piece]](model$network)
  network$pieces <- c(network$pieces, piece)
  known <- amiss::free_parameters(model)
  own <- network$parameters[setdiff(names(network$parameters), names(known))]
  network_simulator(network, model$step, c(known, own))
}

network_catalogue <- function() {
  one <- function(piece) {
    amiss::mechanism(piece, boundary = network_boundary[[piece]],
                     edit = function(model) network_with(model, piece),
                     sentence = network_sentences[[piece]])
  }
  do.call(amiss::catalogue, lapply(names(network_pieces), one))
}

# Weather and heating, on a grid finer than the models' step; heating switches at the ends of their
# steps.
draw_network_weather <- function(days, step, fine) {
  climate <- climates[[sample.int(length(climates), 1)]]
  record <- list(days = days, step_h = step / fine, seed = sample.int(1e9, 1))
  weather <- do.call(amiss::synthetic_weather, c(record, climate))
  seed <- withr::with_preserve_seed(sample.int(1e9, 1))
  heating <- amiss::rolbs(round(24 * days / step), step, power = 1, seed = seed)
  cbind(Te = weather$Te, Gv = weather$Gv, P = rep(heating, each = fine))
}

draw_network_base <- function() {
  topology <- sample(network_topologies, 1)
  scale <- exp(stats::runif(1, log(0.5), log(2)))
  base_network(topology, scale, flat = stats::runif(1) < 0.5, radiant = sample(c(0, 0, 0.3), 1))
}

# Standard deviation of the mean of some values of noise in a row, for unit noise.
averaged_noise <- function(count, ar1)
  sqrt(mean(ar1^abs(outer(seq_len(count), seq_len(count), "-"))))

true_unit <- function(parameters) stats::runif(length(parameters), 0.15, 0.85)

#' As draw_world(): seed, and what may be fixed. `second_zone`: truth has one that the model lacks
#' (wrong.R).
draw_network_world <- function(seed, kind = NULL, strength = NULL, days = NULL,
                               second_zone = FALSE) {
  set.seed(seed, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
  effects <- names(network_pieces)
  drawn_kind <- sample(c("none", effects), 1, prob = c(1 / 8, rep(7 / 40, 5)))
  drawn_strength <- sample(c(0.5, 1, 2, 4, 8), 1)
  kind <- if (is.null(kind)) drawn_kind else kind
  strength <- if (kind == "none") 0 else if (is.null(strength)) drawn_strength else strength
  drawn_days <- sample(5:20, 1)
  days <- if (is.null(days)) drawn_days else days
  step <- sample(c(0.25, 0.5, 1), 1)
  noise <- exp(stats::runif(1, log(0.02), log(0.3)))
  ar1 <- sample(c(0, 0, 0.5, 0.8), 1)
  network <- draw_network_base()
  fine <- 5L
  weather <- draw_network_weather(days, step, fine)
  network <- with_past(network, stats::runif(1, 18, 23),
                       mean(weather[seq_len(24 * fine / step), "Te"]))
  base <- network_simulator(network, step)
  hours <- seq_len(round(24 * days / step)) * step
  warmup <- if (days < 10) 24 else 48
  calibrate <- hours <= warmup + 24 * ceiling(0.6 * (days - warmup / 24))
  rows <- which(calibrate & hours > warmup)
  heating <- weather[, "P"]
  limits <- c(0.02, 0.3)
  for (attempt in 1:20) {
    unit <- true_unit(amiss::free_parameters(base))
    values <- amiss:::unit_to_values(t(unit), amiss::free_parameters(base))[1, ]
    # A heater of the size of the house: on for good, it would lift it by 15 to 30 K.
    weather[, "P"] <- heating * stats::runif(1, 15, 30) / lift_per_kw(network, values)
    drivers <- block_means(weather, fine)
    run_truth <- function(simulator, v) {
      block_means(network_output(network_plan(simulator$network), v, weather, step / fine), fine)
    }
    real <- if (second_zone) with_second_zone(base) else list(simulator = base)
    real$values <- c(values, real$values)
    plain <- run_truth(real$simulator, real$values)
    adapted <- list(unit = unit)
    if (second_zone) {
      # An effect counts beside what the wrong base makes of the truth without one; what it cannot
      # is to show in the noise: a room that leaves the base nearly right is drawn again.
      adapted <- adapt_to(base, plain, drivers, rows, list(unit, rep(0.5, length(unit))))
      noise <- min(max(adapted$rms / sample(c(2, 4, 8), 1), limits[1]), limits[2])
      if (adapted$rms < 2 * limits[1] && attempt < 20) next
    }
    if (kind == "none") break
    true <- network_with(real$simulator, kind)
    known <- names(amiss::free_parameters(real$simulator))
    new <- amiss::free_parameters(true)[setdiff(names(amiss::free_parameters(true)), known)]
    other <- amiss:::unit_to_values(t(true_unit(new)), new)[1, ]
    at_size <- function(size) replace(other, 1, 0.95 * size * new[[1]]$prior$upper)
    effect_at <- function(size) run_truth(true, c(real$values, at_size(size))) - plain
    most <- most_left(effect_at, base, adapted$unit, drivers, rows)
    if (most >= strength * limits[1]) break
  }
  hidden <- list(noise = noise, achieved = 0, effect = 0)
  effect_values <- list()
  if (kind != "none") {
    hidden <- hide_effect(effect_at, base, adapted$unit, drivers, rows, strength, noise, limits,
                          most)
    effect_values[[kind]] <- c(at_size(hidden$size), size = hidden$size)
  }
  clean <- plain + hidden$effect
  data <- data.frame(hour = hours, drivers,
                     Ti = clean + draw_noise(length(clean), hidden$noise, ar1))
  average <- step * c(1, 2, 4)[findInterval(length(rows), c(0, 500, 1000))]
  noise_sd <- hidden$noise * averaged_noise(average / step, ar1)
  measured <- suppressMessages(
    amiss::measurements(data, time = "hour", target = "Ti", boundary = network_conditions,
                        noise_sd = noise_sd, average = if (average > step) average, warmup = warmup,
                        calibrate = calibrate, validate = !calibrate, name = kind, unit = "K"))
  list(seed = seed, family = "network", kind = kind, kinds = setdiff(kind, "none"),
       strength = strength, achieved = hidden$achieved, noise = hidden$noise, ar1 = ar1,
       days = days, values = values, effects = effect_values, clean = clean, data = data,
       measurements = measured, base = base, catalogue = network_catalogue(),
       true_boundary = as.character(unlist(network_boundary[setdiff(kind, "none")],
                                           use.names = FALSE)),
       misfit = if (second_zone) adapted$rms / hidden$noise)
}
