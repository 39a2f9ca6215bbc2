#' A catalogue of mechanisms for the test box
#'
#' @description
#' Lists what may be missing in a model like [paper_box()]`("M2")`:
#'
#' * wind-driven infiltration,
#' * window transmission,
#' * heater lag,
#' * missing thermal mass,
#' * glazing U-value,
#' * sky exchange,
#' * wind-dependent outside convection,
#' * neighbour coupling.
#'
#' @details
#' The model must have the components of [paper_box()]: walls `front`, `back`, `left`, `right` and
#' `roof`, a window `window` and a heater `heater`.
#'
#' The driver columns are `Te`, `Gv`, `Ws`, `Wd`, `RHP`, `Lw` (long-wave radiation of the sky, W/m2)
#' and `Tn` (temperature of a neighbour, degC). A mechanism is left out if its column is not among
#' `columns`.
#'
#' @param columns Names of the driver columns that the measurements have.
#' @param azimuth Direction that the front faces, degrees from north, clockwise.
#' @return A [catalogue()].
#' @examples
#' box_catalogue(c("Te", "Gv", "Ws", "Wd", "RHP"))
#' @export
box_catalogue <- function(columns = c("Te", "Gv", "Ws", "Wd", "RHP", "Lw", "Tn"), azimuth = 180) {
  check_arguments()
  check_input(checkmate::check_character(columns, any.missing = FALSE), "columns")
  check_input(checkmate::check_number(azimuth, finite = TRUE), "azimuth")
  outer <- c("front", "back", "left", "right", "roof")
  facing <- c(front = azimuth, back = azimuth + 180, left = azimuth + 90, right = azimuth - 90,
              roof = NA)
  change_all <- function(model, ...)
    Reduce(function(m, name) change_component(m, name, ...), outer, model)
  all <- list(
    mechanism("wind-driven infiltration", boundary = c("Ws", "Wd", "Te"),
              edit = function(model) {
                leak <- free("leak_area", uniform(1, 2000), "mm2", "area of each leak") * 1e-6
                model <- add_component(
                  model, zone_opening("leak_low", leak, outside = "Te", height = 0.2,
                                      azimuth = azimuth, wind_speed = "Ws", wind_direction = "Wd"))
                add_component(model, zone_opening("leak_high", leak, outside = "Te", height = 0.8,
                                                  azimuth = azimuth + 180, wind_speed = "Ws",
                                                  wind_direction = "Wd"))
              },
              sentence = paste("Wind and buoyancy drive outdoor air through leaks that the model",
                               "does not have.")),
    mechanism("window transmission", boundary = "Gv",
              edit = function(model) change_component(model, "window", solar_factor = free(
                "transmission", uniform(0.1, 0.9), "", "solar factor of the window")),
              sentence = "The window passes another share of the sun than assumed."),
    mechanism("heater lag", boundary = "RHP",
              edit = function(model) change_component(model, "heater", capacity = free(
                "heater_capacity", uniform(0, 4e4), "J/K", "heat capacity of the heater")),
              sentence = paste("The heater stores heat and gives it off with a delay that the",
                               "model leaves out.")),
    mechanism("missing thermal mass", boundary = c("RHP", "Te"),
              edit = function(model) add_component(
                model, zone_wall("mass", area = free("mass_area", uniform(0.01, 3), "m2",
                                                     "surface of additional mass"),
                                 zone_layer(0.02, 0.5, 2e6))),
              sentence = "The box holds mass that the model leaves out."),
    mechanism("glazing U-value", boundary = "Te",
              edit = function(model) change_component(
                model, "window",
                u_value = free("u_window", uniform(0.3, 6), "W/m2K", "U-value of the window")),
              sentence = "The window loses heat at another rate than assumed."),
    mechanism("sky exchange", boundary = c("Lw", "Te"),
              edit = function(model) change_all(model, sky = "Lw", outside_emissivity = free(
                "sky_emissivity", uniform(0, 1), "", "emissivity towards the sky")),
              sentence = paste("The outer surfaces radiate to a sky that is colder than the air,",
                               "which the model leaves out.")),
    mechanism("wind-dependent outside convection", boundary = c("Ws", "Wd"),
              edit = function(model) {
                share <- free("wind_film", uniform(0, 1), "", "share of wind-dependent convection")
                Reduce(function(m, name) change_component(
                  m, name, wind_film = share, wind_speed = "Ws", wind_direction = "Wd",
                  azimuth = unname(facing[name])), outer, model)
              },
              sentence = paste("Wind changes the heat transfer at the outer surfaces, which the",
                               "model takes as constant.")),
    mechanism(
      "neighbour coupling", boundary = "Tn",
      edit = function(model) add_component(model, zone_coupling("neighbour", free(
        "neighbour", uniform(0, 3), "W/K", "conductance to the neighbour"), temperature = "Tn")),
      sentence = "Heat is exchanged with a neighbour that the model does not know."))
  do.call(catalogue, Filter(function(m) all(m$boundary %in% columns), all))
}
