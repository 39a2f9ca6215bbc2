# What the synthetic record is made of: the paper's M3 at its initial values.
list(simulator = paper_box("M3"),
     values = c(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 179, heater_radiant = 0.79, crack_area = 790))
