# The catalogue of all houses of the estate.
network_catalogue(source("estate_model.R")$value, envelope = "wall", outdoors = "Te", sun = "Gv",
                  heating = "P")
