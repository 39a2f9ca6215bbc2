#pragma once

namespace amiss::zone {

/// How a run is computed.
struct Options {
  double max_substep_s = 300.0;  ///< an interval is divided equally into steps no longer than this, s, > 0
  double cells = 1.0;            ///< refinement of the walls: 2 doubles the number of cells; > 0
  int spinup = 0;                ///< times that the leading held rows are run before the start, >= 0
  double initial_hours = 24.0;   ///< the walls start from the mean driver of this time, h, > 0
  int flux_wall = -1;            ///< number of the wall whose inner heat flux is kept; -1: none

  /// Throws std::invalid_argument naming the field, the value and the rule.
  void check() const;
};

}  // namespace amiss::zone
