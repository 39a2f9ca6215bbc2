# What the record is made of: M6, with a small crack and outer layers that store less than M1 to M5 think possible.
list(simulator = paper_box("M6"),
     values = c(outer_k = 0.95, outer_c = 1900, insulation_k = 0.043, insulation_c = 150, heater_radiant = 0.70, crack_area = 300))
