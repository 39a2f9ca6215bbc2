#pragma once

#include <vector>

#include "engine/linalg/Eigen.hpp"
#include "zone/Zone.hpp"

namespace amiss::zone {

/// Air exchange through the openings of a zone.
///
/// Pressure difference across opening i at height z (Pa, positive inwards), p the zone's pressure at the
/// datum:
///     dp = Cp(angle) rho_out (r Ws)^2 / 2 - rho_out g z - (p - rho_in g z)
/// Mass flow (kg/s, rho of the upstream side):
///     orifice  0.65 A sqrt(2 rho |dp|) sign(dp)
///     crack    rho k |dp|^x sign(dp), x = 0.5 + 0.5 exp(-500 width), k = 0.0097 length 0.0092^x
/// with |dp|^x sign(dp) written as `dp (dp^2 + delta^2)^((x-1)/2)`, delta = 1e-3 Pa, which is smooth and
/// strictly increasing. The zone's pressure is the root of the sum of all flows: bracketed, found by
/// safeguarded Newton. Source: ESP-r's flow components (Hensen 1991; Clarke 2001, Energy Simulation in
/// Building Design).
class Airflow {
 public:
  explicit Airflow(const std::vector<Opening>& openings);

  std::size_t size() const { return openings_.size(); }

  /// Takes wind and outside temperature from one row of the drivers.
  void set_weather(const Eigen::Ref<const Eigen::MatrixXd>& drivers, Eigen::Index row);

  /// Finds the zone's pressure and the flows for an air temperature (degC).
  void solve(double air);

  /// Mass flow of opening i, kg/s, positive inwards.
  double flow(std::size_t i) const { return openings_[i].flow; }
  /// Temperature outside of opening i, degC.
  double outside(std::size_t i) const { return openings_[i].temperature; }

 private:
  struct State {
    const Opening* opening;
    double coefficient;  // of density^density_power |dp|^exponent
    double exponent;
    double density_power;
    double temperature = 0.0;
    double density = 0.0;  // outside, kg/m3
    double wind_pressure = 0.0;
    double drive = 0.0;  // dp at zero zone pressure, Pa
    double flow = 0.0;
  };

  struct Balance {
    double net;         // sum of the flows, kg/s
    double throughput;  // sum of their sizes
    double slope;       // d net / d pressure, < 0
  };

  Balance flows_at(double pressure, double density_inside);

  std::vector<State> openings_;
  double pressure_ = 0.0;
};

}  // namespace amiss::zone
