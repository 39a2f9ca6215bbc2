# The model of every house of the estate: air and walls, heated, and nothing of the sun.
network(
  network_node("air", free("C_air", uniform(0.2, 3), "kWh/K", "capacity of the air")),
  network_node("wall", free("C_wall", uniform(2, 15), "kWh/K", "capacity of the walls")),
  network_link("air", "wall", resistance = free("R_inside", uniform(0.2, 3), "K/kW",
                                                "resistance between air and walls")),
  network_link("wall", "Te", resistance = free("R_outside", uniform(2, 15), "K/kW",
                                               "resistance of the envelope")),
  network_gain("air", "P"),
  output = "air")
