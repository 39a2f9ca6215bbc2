# A house as a network of one or two heat capacities under wide uniform priors, as people without a building simulation
# begin: air, and the envelope if there are two. Corridor and outdoor air are its neighbours; sun, wind and the kitchen
# are not in it. Capacities in kWh/K, conductances in kW/K, areas in m2, powers in kW.

house_drivers <- c("Te", "heating", "sun", "corridor", "kitchen", "wind")

# Nodes with a capacity among the parameters, exact for drivers held over a step. A symmetric matrix, as each link
# gives to one node what it takes from the other, so that its modes are real.
house_temperature <- function(values, drivers, step_h) {
  of <- function(name) if (name %in% names(values)) values[[name]] else 0
  capacity <- c(air = of("C_air"), envelope = of("C_envelope"), heater = of("C_heater"), mass = of("C_mass"))
  capacity <- capacity[capacity > 0]
  nodes <- names(capacity)
  warm <- nodes[match(c("heater", "air"), nodes, nomatch = 0)][1]
  between <- list(c("air", "envelope", "H_inside"), c("air", "heater", "H_heater"), c("air", "mass", "H_mass"))
  outside <- list(c("air", "Te", "H_air"), c("air", "corridor", "H_corridor"), c("air", "kitchen", "H_kitchen"),
                  c("envelope", "Te", "H_outside"))
  gains <- list(c("air", "sun", "A_air"), c("envelope", "sun", "A_envelope"), c("air", "chill", "H_wind"))
  exchange <- matrix(0, length(nodes), length(nodes), dimnames = list(nodes, nodes))
  inflow <- matrix(0, length(nodes), length(house_drivers), dimnames = list(nodes, c(house_drivers[1:5], "chill")))
  for (link in between) if (link[2] %in% nodes) {
    at <- link[1:2]
    exchange[at, at] <- exchange[at, at] + of(link[3]) * rbind(c(-1, 1), c(1, -1))
  }
  for (link in outside) if (link[1] %in% nodes) {
    exchange[link[1], link[1]] <- exchange[link[1], link[1]] - of(link[3])
    inflow[link[1], link[2]] <- inflow[link[1], link[2]] + of(link[3])
  }
  for (gain in gains) if (gain[1] %in% nodes) inflow[gain[1], gain[2]] <- of(gain[3])
  inflow[warm, "heating"] <- 1
  root <- sqrt(capacity)
  modes <- eigen(exchange / outer(root, root), symmetric = TRUE)
  # Wind takes heat with the temperature difference to a room of 24 degC.
  forces <- cbind(drivers[, house_drivers[1:5]], chill = drivers[, "wind"] * (drivers[, "Te"] - 24))
  forcing <- forces %*% t(crossprod(modes$vectors, inflow / root))
  start <- values[["T_start"]] - ifelse(nodes == "envelope", of("start_colder"), 0)
  state <- crossprod(modes$vectors, root * start)
  air <- match("air", nodes)
  parts <- vapply(seq_along(nodes), function(k) {
    kept <- exp(modes$values[k] * step_h)
    gained <- if (abs(modes$values[k]) < 1e-10) step_h else (kept - 1) / modes$values[k]
    modes$vectors[air, k] / root[air] *
      as.numeric(stats::filter(gained * forcing[, k], kept, "recursive", init = state[k]))
  }, numeric(nrow(drivers)))
  rowSums(parts)
}

house_simulator <- function(parameters) {
  run <- function(values, drivers, info) house_temperature(values, drivers, info$step_h)
  do.call(amiss::function_simulator, c(list(run), unname(parameters), list(boundary = house_drivers)))
}

capacity <- function(name, least, most) amiss::free(name, amiss::uniform(least, most), "kWh/K")
conductance <- function(name, least, most) amiss::free(name, amiss::uniform(least, most), "kW/K")
area <- function(name, most) amiss::free(name, amiss::uniform(0, most), "m2")

envelope_parameters <- function() {
  list(capacity("C_envelope", 0.2, 20), conductance("H_inside", 0.01, 2), conductance("H_outside", 0.001, 0.2),
       amiss::free("start_colder", amiss::uniform(-5, 10), "K"))
}

crude_house <- function(states) {
  house_simulator(c(list(capacity("C_air", 0.05, 10), conductance("H_air", 0, 0.2), conductance("H_corridor", 0, 0.5),
                         amiss::free("T_start", amiss::uniform(20, 35), "degC")),
                    if (states == 2) envelope_parameters()))
}

crude_catalogue <- function(states) {
  one <- function(name, boundary, sentence, parameters) {
    amiss::mechanism(name, boundary = boundary, sentence = sentence, edit = function(model) {
      house_simulator(c(amiss::free_parameters(model), parameters))
    })
  }
  amiss::catalogue(
    one("sun on the air", "sun", "The sun heats the room through the windows.", list(area("A_air", 10))),
    one("heater lag", "heating", "The heater holds heat and gives it off later.",
        list(capacity("C_heater", 0.005, 1), conductance("H_heater", 0.02, 2))),
    one("interior mass", c("heating", "Te"), "Something in the room takes heat up and gives it back.",
        list(capacity("C_mass", 0.1, 10), conductance("H_mass", 0.02, 2))),
    one("kitchen", "kitchen", "Heat passes the wall to the kitchen.", list(conductance("H_kitchen", 0, 0.2))),
    one("wind", c("wind", "Te"), "Wind drives outdoor air in.",
        list(amiss::free("H_wind", amiss::uniform(0, 0.02), "kW s/(K m)"))),
    if (states == 1) one("envelope", c("heating", "Te"), "The envelope holds heat.", envelope_parameters())
    else one("sun on the envelope", "sun", "The sun heats the envelope.", list(area("A_envelope", 20))))
}

crude_record <- function(house) {
  file <- system.file("extdata", paste0("twinhouse_exp1_", house, "_rolbs_freefloat_10min.csv"), package = "amiss")
  data <- utils::read.csv(file)
  data <- transform(data, heating = P_living / 1000, sun = Gv_S / 1000, corridor = Ti_corridor, kitchen = T_kitchen,
                    wind = Ws)
  amiss::measurements(data, time = "time_cet", target = "Ti",
                      boundary = ~ Te + sun + wind + heating + kitchen + corridor, noise_sd = 0.1,
                      average = 1, warmup = 1, calibrate = 'phase == "rolbs"', validate = 'phase == "freefloat"')
}
