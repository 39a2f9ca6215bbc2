# A house as a network of one or two heat capacities under wide uniform priors, as people without a
# building simulation begin: air, and the envelope if there are two. Corridor and outdoor air are
# its neighbours; sun, wind and the kitchen are not in it. Capacities in kWh/K, conductances in
# kW/K, areas in m2, powers in kW.

capacity <- function(name, least, most) amiss::free(name, amiss::uniform(least, most), "kWh/K")
conductance <- function(name, least, most) amiss::free(name, amiss::uniform(least, most), "kW/K")
area <- function(name, most) amiss::free(name, amiss::uniform(0, most), "m2")

envelope_parts <- function() {
  list(amiss::network_node("envelope", capacity("C_envelope", 0.2, 20),
                           start = amiss::free("T_envelope", amiss::uniform(10, 35), "degC")),
       amiss::network_link("air", "envelope", conductance = conductance("H_inside", 0.01, 2)),
       amiss::network_link("envelope", "Te", conductance = conductance("H_outside", 0.001, 0.2)))
}

crude_house <- function(states) {
  parts <- list(
    amiss::network_node("air", capacity("C_air", 0.05, 10),
                        start = amiss::free("T_start", amiss::uniform(20, 35), "degC")),
    amiss::network_link("air", "Te", conductance = conductance("H_air", 0, 0.2)),
    amiss::network_link("air", "corridor", conductance = conductance("H_corridor", 0, 0.5)),
    amiss::network_gain("air", "heating"))
  do.call(amiss::network,
          c(parts, if (states == 2) envelope_parts(), list(output = "air", output_at = "end")))
}

crude_catalogue <- function(states) {
  one <- function(name, boundary, sentence, ...) {
    parts <- list(...)
    amiss::mechanism(name, boundary = boundary, sentence = sentence,
                     edit = function(model) do.call(amiss::add_component, c(list(model), parts)))
  }
  later <- "The heater holds heat and gives it off later."
  lag <- amiss::mechanism("heater lag", boundary = "heating", sentence = later,
                          edit = function(model) {
    model <- amiss::add_component(
      model, amiss::network_node("heater", capacity("C_heater", 0.005, 1)),
      amiss::network_link("heater", "air", conductance("H_heater", 0.02, 2)))
    amiss::change_component(model, "heating to air", to = "heater")
  })
  envelope <- do.call(one, c(list("envelope", c("heating", "Te"), "The envelope holds heat."),
                             envelope_parts()))
  sun_outside <- one("sun on the envelope", "sun", "The sun heats the envelope.",
                     amiss::network_gain("envelope", "sun", area("A_envelope", 20)))
  amiss::catalogue(
    one("sun on the air", "sun", "The sun heats the room through the windows.",
        amiss::network_gain("air", "sun", area("A_air", 10))),
    lag,
    one("interior mass", c("heating", "Te"),
        "Something in the room takes heat up and gives it back.",
        amiss::network_node("mass", capacity("C_mass", 0.1, 10)),
        amiss::network_link("air", "mass", conductance = conductance("H_mass", 0.02, 2))),
    one("kitchen", "kitchen", "Heat passes the wall to the kitchen.",
        amiss::network_link("air", "kitchen", conductance = conductance("H_kitchen", 0, 0.2))),
    one("wind", c("wind", "Te"), "Wind drives outdoor air in.",
        amiss::network_link("air", "Te", by = "wind", name = "wind",
                            conductance = amiss::free("H_wind", amiss::uniform(0, 0.02),
                                                      "kW s/(K m)"))),
    if (states == 1) envelope else sun_outside)
}

crude_record <- function(house) {
  file <- system.file("extdata", paste0("twinhouse_exp1_", house, "_rolbs_freefloat_10min.csv.gz"),
                      package = "amiss")
  data <- utils::read.csv(file)
  data <- transform(data, heating = P_living / 1000, sun = Gv_S / 1000, corridor = Ti_corridor,
                    kitchen = T_kitchen, wind = Ws)
  amiss::measurements(data, time = "time_cet", target = "Ti",
                      boundary = ~ Te + sun + wind + heating + kitchen + corridor, noise_sd = 0.1,
                      average = 1, warmup = 1, calibrate = 'phase == "rolbs"',
                      validate = 'phase == "freefloat"')
}
