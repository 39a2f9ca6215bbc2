#pragma once

namespace amiss::zone {

/// How open the ground around a facade is: selects a column of the table of wind pressure coefficients.
enum class Exposure { exposed, semi_exposed, sheltered };

/// Angle (0 to 180 degrees) between the direction the wind comes from and the outward normal of a facade,
/// both in degrees from north, clockwise.
double incidence_angle(double wind_direction, double azimuth);

/// Wind pressure coefficient Cp of a facade with 1:1 walls at `angle` (degrees, see incidence_angle).
///
/// Tabulated every 22.5 degrees (ESP-r's pressure coefficient sets; Liddament 1986). Between the nodes a
/// cubic Hermite with harmonic-mean slopes (Fritsch and Carlson 1980): once differentiable, no value outside
/// those of the two nodes, and even about 0 and 180 degrees, so smooth around the whole circle;
/// NaN for an angle that is NaN.
double pressure_coefficient(Exposure exposure, double angle);

/// Air speed V (m/s) along a vertical facade for the film coefficient 2.8 + 3 V, from the wind speed (m/s)
/// and the incidence angle (degrees): windward max(0.25, sin angle) Ws, leeward 0.25 sin(angle) Ws. The jump
/// between the two at 90 degrees is spread smoothly over 80 to 100 degrees.
double facade_wind(double wind_speed, double angle);

}  // namespace amiss::zone
