# What could be wrong in the model of the Twin House living room; the same catalogue for both houses.

catalogue(
  mechanism("south solar aperture", boundary = "Gv_S",
            edit = function(model) {
              add_component(model, zone_window("south aperture", area = free("south_aperture", uniform(0.001, 6), "m2", "effective south aperture"),
                                               outside = "Te", u_value = 0, solar_factor = 1, sun = "Gv_S"))
            },
            sentence = "Sun enters through the south windows: their blinds are open, at least in part."),
  mechanism("wind-driven infiltration", boundary = c("Ws", "Wd", "Te"),
            edit = function(model) {
              leak <- free("leak_area", uniform(1e-5, 0.02), "m2", "leakage area of each facade")
              model <- add_component(model, zone_opening("south leak", area = leak, outside = "Te", height = 0.5, azimuth = 180,
                                                         wind_speed = "Ws", wind_direction = "Wd"))
              add_component(model, zone_opening("west leak", area = leak, outside = "Te", height = 2.0, azimuth = 270,
                                                wind_speed = "Ws", wind_direction = "Wd"))
            },
            sentence = "Wind drives outdoor air through leaks of the south and west facades."),
  mechanism("heater lag", boundary = "P_living",
            edit = function(model) change_component(model, "heater", capacity = free("heater_capacity", uniform(0, 4e4), "J/K", "heat capacity of the heater")),
            sentence = "The heater stores heat and gives it off with a delay."),
  mechanism("extra thermal mass", boundary = c("P_living", "Te"),
            edit = function(model) {
              add_component(model, zone_wall("furniture", area = free("furniture_area", uniform(0.1, 80), "m2", "surface of additional mass"),
                                             zone_layer(0.03, 0.15, 1.0e6)))
            },
            sentence = "The room holds mass, such as furniture, that the model leaves out."),
  mechanism("glazing U-value", boundary = "Te",
            edit = function(model) change_component(model, "south windows", u_value = free("u_south", uniform(0.3, 3), "W/m2K", "U-value of the south windows")),
            sentence = "The south windows lose heat at another rate than assumed."),
  mechanism("sky exchange", boundary = c("Lw_h", "Te"),
            edit = function(model) {
              emissivity <- free("sky_emissivity", uniform(0, 1), "", "emissivity of the facades towards the sky")
              model <- change_component(model, "south facade", sky = "Lw_h", outside_emissivity = emissivity)
              change_component(model, "west facade", sky = "Lw_h", outside_emissivity = emissivity)
            },
            sentence = "The facades radiate to a sky that is colder than the air."),
  mechanism("wind-dependent outside convection", boundary = c("Ws", "Wd"),
            edit = function(model) {
              share <- free("wind_film", uniform(0, 1), "", "share of wind-dependent convection")
              model <- change_component(model, "south facade", wind_film = share, wind_speed = "Ws", wind_direction = "Wd")
              change_component(model, "west facade", wind_film = share, wind_speed = "Ws", wind_direction = "Wd")
            },
            sentence = "Wind changes the heat transfer at the outside of the facades."),
  mechanism("neighbour coupling", boundary = "T_kitchen",
            edit = function(model) {
              add_component(model, zone_coupling("kitchen leak", conductance = free("kitchen_leak", uniform(0, 60), "W/K", "additional conductance to the kitchen"),
                                                 temperature = "T_kitchen"))
            },
            sentence = "More heat passes between the room and the kitchen than the model's partition lets through.")
)
