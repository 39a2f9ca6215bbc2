#' The test box of the method's paper, as its models M1 to M6
#'
#' Makes a model of the paper's test box: a cube of 0.96 m inside with walls of 12 cm all round. It
#' has a window of 0.60 x 0.60 m in the front and a heater. The box stands free, so that outside air
#' is all around it.
#'
#' # Models
#'
#' * M1 has walls of one layer; the others have walls of 3 + 6 + 3 cm.
#' * M3, M5 and M6 leak through two equal openings, low in the front and high in the back. Wind and
#'   buoyancy drive the exchange.
#' * M4 is M2 with a free transmission of the window.
#' * M5 is M3 with other limits of its cracks.
#' * M6 is M5 with a wider prior of the outer layers' capacity.
#'
#' The driver columns are `Te` (degC), `Gv` (W/m2, front), `Ws` (m/s), `Wd` (degrees) and `RHP`
#' (heater power, W). Only the models that leak need `Ws` and `Wd`.
#'
#' The paper gives no value of film coefficients, solar absorptance and the window's thermal
#' transmittance (1.5 W/m2K). Those here are this package's. Together they give the measured heat
#' loss coefficient of about 4 W/K.
#'
#' @param model `"M1"` to `"M6"`.
#' @param azimuth Direction that the front faces, degrees from north, clockwise.
#' @return A [zone()] with the free parameters and uniform priors of the paper.
#' @source Monari (2022), An approach for identifying sources of inadequacy and upgrades in models
#'   with high-dimensional outputs and boundary conditions.
#' @examples
#' paper_box("M3")
#' @export
paper_box <- function(model = "M3", azimuth = 180) {
  check_arguments()
  check_input(checkmate::check_choice(model, paste0("M", 1:6)), "model")
  check_input(checkmate::check_number(azimuth, finite = TRUE), "azimuth")
  inside <- 0.96
  window_area <- 0.60^2
  layers <- box_layers(model)
  side <- function(name, area = inside^2, sun = NULL) {
    do.call(zone_wall, c(list(name, area), layers, list(outside = "Te", sun = sun)))
  }
  transmission <- if (model == "M4") free("window_transmission", uniform(0.5, 0.72)) else 0.61
  box <- zone(
    side("front", inside^2 - window_area, sun = "Gv"),
    side("back"), side("left"), side("right"), side("roof"), side("floor"),
    zone_window("window", window_area, outside = "Te", u_value = 1.5, sun = "Gv",
                solar_factor = transmission * (0.52^2 / window_area)),
    zone_heater("heater", power = "RHP",
                radiant_fraction = free("heater_radiant", uniform(0.53, 0.98))), volume = inside^3)
  area <- box_crack_area(model)
  if (is.null(area)) return(box)
  leak <- function(name, height, azimuth) {
    zone_opening(name, area * 1e-6, outside = "Te", height = height, azimuth = azimuth,
                 wind_speed = "Ws", wind_direction = "Wd")
  }
  box <- add_component(box, leak("crack_low", 0.2, azimuth))
  add_component(box, leak("crack_high", 0.8, azimuth + 180))
}

box_layers <- function(model) {
  if (model == "M1") {
    return(list(zone_layer(0.12, free("wall_k", uniform(0.07, 0.13), "W/mK"),
                           free("wall_c", uniform(1680, 3120), "kJ/m3K") * 1e3)))
  }
  outer_c <- if (model == "M6") uniform(1440, 3360) else uniform(2240, 4160)
  outer <- zone_layer(0.03, free("outer_k", uniform(0.7, 1.3), "W/mK"),
                      free("outer_c", outer_c, "kJ/m3K") * 1e3)
  insulation <- zone_layer(0.06, free("insulation_k", uniform(0.035, 0.065), "W/mK"),
                           free("insulation_c", uniform(112, 208), "kJ/m3K") * 1e3)
  list(outer, insulation, outer)
}

box_crack_area <- function(model) {
  switch(model,
    M3 = free("crack_area", uniform(700, 1300), "mm2"),
    M5 = , M6 = free("crack_area", uniform(10, 610), "mm2"))
}
