# The living room of the Twin Houses, one model for both houses (N2 and O5). It believes the south blinds closed:
# no sun passes the south windows. Numbers are those of the experiment's documentation; what it leaves open is free.

plaster <- zone_layer(0.010, 0.8, 1.2e6)
brick <- function(thickness) zone_layer(thickness, 0.22, 0.8e6)
old_plaster <- zone_layer(0.030, 1.0, 1.5e6)
insulation <- function(thickness) zone_layer(thickness, free("k_insulation", uniform(0.025, 0.050), "W/mK", "facade insulation"), 4e4)

zone(
  volume = 86.4, air_capacity_factor = 1.2,
  initial_wall_offset = free("initial_wall_offset", normal(0, 1, -3, 3), "K", "walls before the record, against the air"),

  zone_wall("south facade", area = 7.5, plaster, brick(0.30), old_plaster, insulation(0.12), plaster,
            outside = "Te", sun = "Gv_S", absorptance = 0.23, azimuth = 180,
            inside_convection = free("inside_convection", uniform(1.5, 6), "W/m2K", "inside convection")),
  zone_wall("west facade", area = 12.2, plaster, brick(0.30), old_plaster, insulation(0.08), plaster,
            outside = "Te", sun = "Gv_W", absorptance = 0.23, azimuth = 270,
            inside_convection = free("inside_convection", uniform(1.5, 6), "W/m2K", "inside convection")),
  zone_wall("ceiling", area = 33.6, zone_layer(0.10, free("k_ceiling", uniform(0.025, 0.060), "W/mK", "ceiling insulation"), 4e4),
            zone_layer(0.22, 2.0, 2.4e6), zone_layer(0.04, 0.04, 4e4), zone_layer(0.04, 1.4, 2.0e6), outside = "T_attic_w", outside_film = 6,
            inside_convection = free("inside_convection", uniform(1.5, 6), "W/m2K", "inside convection")),
  zone_wall("floor", area = 33.6, zone_layer(0.065, 1.4, 2.0e6), zone_layer(0.033, 0.023, 4e4), zone_layer(0.030, 0.025, 4e4),
            zone_layer(0.029, 0.06, 5e5), zone_layer(0.22, 2.1, 2.4e6), outside = "T_cellar", outside_film = 6,
            inside_convection = free("inside_convection", uniform(1.5, 6), "W/m2K", "inside convection")),
  zone_wall("partition to kitchen", area = 16, plaster, zone_layer(0.115, 0.35, free("c_partition", uniform(0.5e6, 2e6), "J/m3K", "heat capacity of partitions")),
            plaster, outside = "T_kitchen", outside_film = 8,
            inside_convection = free("inside_convection", uniform(1.5, 6), "W/m2K", "inside convection")),
  zone_wall("partition to corridor", area = 14, plaster, zone_layer(0.115, 0.35, free("c_partition", uniform(0.5e6, 2e6), "J/m3K", "heat capacity of partitions")),
            plaster, outside = "Ti_corridor", outside_film = 8,
            inside_convection = free("inside_convection", uniform(1.5, 6), "W/m2K", "inside convection")),

  zone_window("south windows", area = 8.0, outside = "Te", u_value = 1.1),
  zone_window("west window", area = 2.14, outside = "Te", u_value = 1.1, sun = "Gv_W",
              solar_factor = free("g_west", uniform(0, 0.6), "", "solar factor of the west window")),

  zone_coupling("door to corridor", conductance = free("door", uniform(0, 300), "W/K", "air exchange through the door"), temperature = "Ti_corridor"),
  zone_infiltration("infiltration", ach = free("ach", uniform(0, 0.4), "1/h", "infiltration"), outside = "Te"),
  zone_supply("ventilation", flow = "vent_supply_m3h", temperature = "vent_supply_T"),
  zone_heater("heater", power = "P_living", radiant_fraction = free("radiant_fraction", uniform(0.1, 0.5), "", "radiant share of the heater"))
)
