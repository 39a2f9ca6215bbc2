#pragma once

namespace amiss::zone {

/// Specific heat capacity of air, J/(kg K).
constexpr double air_heat = 1006.0;
/// Stefan-Boltzmann constant, W/(m2 K4).
constexpr double stefan_boltzmann = 5.670374419e-8;
/// 0 degC in K.
constexpr double zero_celsius = 273.15;
/// Acceleration of gravity, m/s2.
constexpr double gravity = 9.81;

/// Density of air (kg/m3) at `temperature` (degC) and normal pressure: the ideal gas fixed at 1.1881 at 20
/// degC.
inline double air_density(double temperature) { return 1.1881 * 293.15 / (zero_celsius + temperature); }

}  // namespace amiss::zone
