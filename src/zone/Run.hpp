#pragma once

#include <string>
#include <vector>

#include "engine/linalg/Eigen.hpp"

namespace amiss::zone {

/// Where the heat of a run went, J. `sum(through) + hold = stored_air + stored_walls + stored_heaters` up to
/// rounding, because every term is integrated with the quadrature of the time stepping itself.
struct EnergyBalance {
  std::vector<std::string> component;  ///< names: walls, then windows, openings, ... in the order of Zone
  std::vector<double> through;         ///< heat that came into the zone by each of them
  double hold = 0.0;                   ///< heat that holding the air at prescribed temperatures took
  double stored_air = 0.0;             ///< change of the heat stored in the air and furnishings
  double stored_walls = 0.0;           ///< ... in the walls
  double stored_heaters = 0.0;         ///< ... in heaters with a lag
};

/// Result of simulate().
struct Run {
  bool ok = true;       ///< false if a temperature was not finite; `air` and `flux` are then NaN throughout
  Eigen::VectorXd air;  ///< mean air temperature of every interval, degC
  /// Mean heat flux at the inner surface of Options::flux_wall in every interval, W/m2, positive into the
  /// room: what the wall gives to air and surfaces less the radiation that it absorbs there. Of size 0 if
  /// there is no such wall.
  Eigen::VectorXd flux;
  EnergyBalance balance;  ///< of the whole run, without the spin-up
};

}  // namespace amiss::zone
