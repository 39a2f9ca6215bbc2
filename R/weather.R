#' Synthetic weather and heating sequences
#'
#' @description
#' `synthetic_weather()` makes weather with the features that matter to a building:
#'
#' * the sun's path with passing clouds,
#' * outdoor temperature that follows sun and slow changes of the air mass,
#' * gusty wind with a preferred direction,
#' * the sky's long-wave radiation.
#'
#' The default is like the coast of Almeria (Spain) in spring. `rolbs()` makes a randomly ordered
#' logarithmic binary sequence of heating, uncorrelated with the weather.
#'
#' @param days Length in days.
#' @param step_h Step in hours.
#' @param day_of_year First day, 1 to 365.
#' @param latitude Latitude, degrees.
#' @param temperature,daily_range Mean outdoor temperature (degC) and mean range over a clear day
#'   (K).
#' @param cloudiness Mean share of the sky that is covered, 0 to 1.
#' @param wind Mean wind speed, m/s.
#' @param wind_direction Preferred direction the wind comes from, degrees from north, clockwise.
#' @param azimuth Direction of the vertical surface whose sun `Gv` is, degrees from north,
#'   clockwise.
#' @param seed Seed; if `NULL`, R's generator gives one.
#' @return `synthetic_weather()`: a data frame, one row a step (means over the step that ends at
#'   `hour`), with
#'   * `hour`.
#'   * `Te`: outdoor temperature, degC.
#'   * `Gh`, `Gv`: sun on a horizontal and on the vertical surface, W/m2.
#'   * `Ws`, `Wd`: wind speed, m/s, and direction, degrees from north, clockwise.
#'   * `Lw`: long-wave radiation of the sky, W/m2.
#'
#'   `rolbs()`: a vector of heating powers.
#' @source Declination by Cooper (1969), The absorption of radiation in solar stills, Solar Energy
#'   12, 333-346; the clear sky's beam by Meinel and Meinel (1976), Applied solar energy,
#'   Addison-Wesley.
#' @examples
#' weather <- synthetic_weather(4, seed = 1)
#' weather$RHP <- rolbs(nrow(weather), step_h = 0.25, power = 100, seed = 1)
#' @export
synthetic_weather <- function(days, step_h = 0.25, day_of_year = 100, latitude = 36.8,
                              temperature = 17, daily_range = 9, cloudiness = 0.3, wind = 3.5,
                              wind_direction = 240, azimuth = 180, seed = NULL) {
  check_arguments()
  check_input(checkmate::check_number(days, lower = 1, finite = TRUE), "days")
  check_input(checkmate::check_number(step_h, lower = 1 / 60, upper = 6), "step_h")
  check_size("days", days, matrix_gb(24 * days / step_h, 30))
  check_input(checkmate::check_number(day_of_year, lower = 0, upper = 366), "day_of_year")
  check_input(checkmate::check_number(latitude, lower = -90, upper = 90), "latitude",
              "It is in degrees, north of the equator.")
  check_input(checkmate::check_number(temperature, lower = -90, upper = 60), "temperature",
              "It is in degrees Celsius.")
  check_input(checkmate::check_number(daily_range, lower = 0, upper = 60), "daily_range")
  check_input(checkmate::check_number(wind_direction, lower = -360, upper = 360), "wind_direction",
              "It is in degrees.")
  check_input(checkmate::check_number(azimuth, lower = -360, upper = 360), "azimuth",
              "It is in degrees.")
  check_input(checkmate::check_number(cloudiness, lower = 0, upper = 1), "cloudiness")
  check_input(checkmate::check_number(wind, lower = 0, upper = 200), "wind")
  with_seed(pick_seed(seed), {
    n <- round(24 * days / step_h)
    hour <- seq_len(n) * step_h
    middle <- hour - step_h / 2
    sun <- sun_position(day_of_year + middle / 24, latitude)
    cover <- stats::pnorm(stats::qnorm(min(max(cloudiness, 0.02), 0.98)) * sqrt(1.5) +
                          red_noise(n, 6, step_h) + 0.7 * red_noise(n, 0.5, step_h))
    # Clear sky: beam by air mass (Meinel), a diffuse part that clouds enlarge; the ground reflects
    # a fifth.
    air_mass <- 1 / pmax(sin(sun$elevation), 0.05)
    beam <- ifelse(sun$elevation > 0, 1353 * 0.7^(air_mass^0.678), 0) * (1 - cover)^1.2
    up <- pmax(sin(sun$elevation), 0)
    diffuse <- up * (90 + 160 * cover * (1 - 0.5 * cover))
    horizontal <- beam * up + diffuse
    facing <- pmax(cos(sun$elevation) * cos(sun$azimuth - azimuth * pi / 180), 0)
    vertical <- beam * facing + 0.5 * diffuse + 0.1 * horizontal
    clear <- 1 -
      stats::filter(c(rep(cover[1], round(24 / step_h)), cover),
                    rep(step_h / 24, round(24 / step_h)), sides = 1)
    clear <- as.numeric(utils::tail(clear, n))
    outdoor <- temperature +
      daily_range / 2 * (0.4 + 0.8 * clear) * cos(2 * pi * (middle - 15) / 24) +
      2 * red_noise(n, 48, step_h) + 0.35 * red_noise(n, 1.5, step_h)
    breeze <- 1 + 0.35 * cos(2 * pi * (middle - 16) / 24)
    speed <- wind * breeze * exp(
      0.45 * red_noise(n, 8, step_h) + 0.25 * red_noise(n, 0.5, step_h) - 0.13)
    direction <- (wind_direction + 35 * sin(2 * pi * (middle - 10) / 24) +
                  45 * red_noise(n, 10, step_h) + 15 * red_noise(n, 0.5, step_h)) %% 360
    emissivity <- 0.78 * (1 - cover) + 0.96 * cover
    data.frame(hour = hour, Te = outdoor, Gh = horizontal, Gv = vertical, Ws = speed,
               Wd = direction, Lw = emissivity * 5.670374e-8 * (273.15 + outdoor)^4)
  })
}

# Elevation and azimuth (radians; azimuth from north, clockwise) at solar time, day counted with its
# fraction.
sun_position <- function(day, latitude) {
  declination <- 23.45 * pi / 180 * sin(2 * pi * (284 + day) / 365)
  angle <- 2 * pi * (day %% 1 - 0.5)
  phi <- latitude * pi / 180
  elevation <- asin(sin(phi) * sin(declination) + cos(phi) * cos(declination) * cos(angle))
  azimuth <- pi + atan2(sin(angle), cos(angle) * sin(phi) - tan(declination) * cos(phi))
  list(elevation = elevation, azimuth = azimuth)
}

# Stationary Gaussian noise of unit variance with an exponential autocorrelation.
red_noise <- function(n, time_h, step_h) {
  a <- exp(-step_h / time_h)
  as.numeric(stats::filter(c(stats::rnorm(1), sqrt(1 - a^2) * stats::rnorm(n - 1)), a,
                           method = "recursive"))
}

#' @rdname synthetic_weather
#' @param n Number of steps.
#' @param power Power while the heater is on, W.
#' @param lengths Lengths of the on and off periods, hours.
#' @export
rolbs <- function(n, step_h = 0.25, power = 100, lengths = c(1, 2, 4, 8, 16), seed = NULL) {
  check_arguments()
  check_input(checkmate::check_count(n, positive = TRUE), "n")
  check_size("n", n, matrix_gb(n, 4))
  check_input(checkmate::check_number(step_h, lower = 1e-6, finite = TRUE), "step_h")
  check_input(checkmate::check_number(power, finite = TRUE), "power")
  check_input(checkmate::check_numeric(lengths, lower = step_h, upper = 1e6 * step_h, min.len = 1,
                                       any.missing = FALSE),
              "lengths",
              "They are hours, at least one step and at most a million.")
  with_seed(pick_seed(seed), {
    on <- logical(0)
    while (length(on) < n) {
      off_steps <- round(sample_of(lengths) / step_h)
      on_steps <- round(sample_of(lengths) / step_h)
      on <- c(on, unlist(Map(function(a, b) rep(c(FALSE, TRUE), c(a, b)), off_steps, on_steps)))
    }
    power * on[seq_len(n)]
  })
}

sample_of <- function(x) x[sample.int(length(x))]
