#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "zone/Simulation.hpp"

/// Zones and drivers for the tests of the simulator.
namespace amiss::zone::test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double pi = 3.14159265358979323846;
inline const VectorXd no_hold;

enum : Column { outdoor, power, sun, speed, direction, sky, flow, supply_air, n_columns };

inline MatrixXd constant_drivers(Eigen::Index rows, double outside, double watts) {
  MatrixXd drivers = MatrixXd::Zero(rows, n_columns);
  drivers.col(outdoor).setConstant(outside);
  drivers.col(power).setConstant(watts);
  return drivers;
}

inline Wall plain_wall() {
  Wall wall;
  wall.area = 10.0;
  wall.layers = {{0.012, 0.25, 1e6}, {0.08, 0.04, 4e4}, {0.12, 0.8, 1.6e6}};
  wall.inside_emissivity = 0.0;
  wall.outside = outdoor;
  return wall;
}

inline Heater convector() {
  Heater heater;
  heater.power = power;
  heater.radiant_fraction = 0.0;
  return heater;
}

inline double wall_u(const Wall& wall) {
  double resistance = 1.0 / wall.inside_convection + 1.0 / wall.outside_film;
  for (const Layer& layer : wall.layers) resistance += layer.thickness / layer.conductivity;
  return 1.0 / resistance;
}

inline Zone heated_zone() {
  Zone zone;
  zone.volume = 30.0;
  zone.walls = {plain_wall()};
  zone.heaters = {convector()};
  return zone;
}

/// Weather and loads that vary in every column.
inline MatrixXd lively_drivers(Eigen::Index rows) {
  MatrixXd drivers(rows, n_columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double t = 2.0 * pi * static_cast<double>(i) / 96.0;
    drivers(i, outdoor) = 8.0 + 6.0 * std::sin(t);
    drivers(i, power) = (i / 7) % 2 == 0 ? 800.0 : 0.0;
    drivers(i, sun) = std::max(0.0, 500.0 * std::sin(t));
    drivers(i, speed) = 3.0 + 2.0 * std::sin(3.1 * t);
    drivers(i, direction) = std::fmod(40.0 * static_cast<double>(i), 360.0);
    drivers(i, sky) = 280.0 + 20.0 * std::cos(t);
    drivers(i, flow) = 60.0 + 20.0 * std::cos(2.0 * t);
    drivers(i, supply_air) = 17.0;
  }
  return drivers;
}

inline Zone everything() {
  Zone zone = heated_zone();
  zone.air_capacity_factor = 4.0;
  Wall facade = plain_wall();
  facade.name = "facade";
  facade.inside_emissivity = 0.9;
  facade.sun = sun;
  facade.sky = sky;
  facade.wind_speed = speed;
  facade.wind_direction = direction;
  facade.wind_film = 0.7;
  Wall mass = plain_wall();
  mass.name = "mass";
  mass.inside_emissivity = 0.6;
  mass.outside = no_column;
  zone.walls = {facade, mass};
  zone.windows = {{"window", 2.0, 1.2, outdoor, 0.5, sun, 0.1}};
  Opening low;
  low.outside = outdoor;
  low.wind_speed = speed;
  low.wind_direction = direction;
  low.area = 0.01;
  Opening high = low;
  high.height = 2.0;
  high.azimuth = 180.0;
  high.kind = OpeningKind::crack;
  zone.openings = {low, high};
  zone.infiltrations = {{"infiltration", 0.1, outdoor}};
  zone.heaters[0] = {"heater", power, 0.4, 8000.0, 10.0};
  zone.supplies = {{"supply", flow, supply_air, 0.9}};
  zone.couplings = {{"door", 15.0, supply_air}};
  zone.gains = {{"people", power, 0.1, 0.5}};
  return zone;
}

}  // namespace amiss::zone::test
