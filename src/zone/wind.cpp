#include "zone/wind.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace amiss::zone {
namespace {

constexpr int last_node = 8;
constexpr double node_width = 22.5;
constexpr double degree = 3.14159265358979323846 / 180.0;

using Table = std::array<double, last_node + 1>;
constexpr std::array<Table, 3> tables = {{
    {0.70, 0.525, 0.35, -0.075, -0.50, -0.45, -0.40, -0.30, -0.20},
    {0.40, 0.25, 0.10, -0.10, -0.30, -0.325, -0.35, -0.275, -0.20},
    {0.20, 0.125, 0.05, -0.10, -0.25, -0.275, -0.30, -0.275, -0.25},
}};

/// Slope per node width at a node: harmonic mean of the neighbouring differences, zero at an extremum
/// and, by symmetry, at both ends.
double node_slope(const Table& table, int node) {
  if (node == 0 || node == last_node) return 0.0;
  const double before = table[node] - table[node - 1];
  const double after = table[node + 1] - table[node];
  return before * after > 0.0 ? 2.0 * before * after / (before + after) : 0.0;
}

}  // namespace

double incidence_angle(double wind_direction, double azimuth) {
  return std::abs(std::remainder(wind_direction - azimuth, 360.0));
}

double pressure_coefficient(Exposure exposure, double angle) {
  if (std::isnan(angle)) return angle;  // it belongs to no node
  const Table& table = tables[static_cast<std::size_t>(exposure)];
  const double position = std::clamp(angle / node_width, 0.0, static_cast<double>(last_node));
  const int node = std::min(static_cast<int>(position), last_node - 1);
  const double u = position - node;
  const double v = 1.0 - u;
  return (1.0 + 2.0 * u) * v * v * table[node] + u * v * v * node_slope(table, node) +
         u * u * (3.0 - 2.0 * u) * table[node + 1] - u * u * v * node_slope(table, node + 1);
}

double facade_wind(double wind_speed, double angle) {
  const double along = std::sin(angle * degree);
  const double turned = std::clamp((angle - 80.0) / 20.0, 0.0, 1.0);
  const double lee = turned * turned * (3.0 - 2.0 * turned);
  return wind_speed * ((1.0 - lee) * std::max(0.25, along) + lee * 0.25 * along);
}

}  // namespace amiss::zone
