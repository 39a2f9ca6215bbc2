#pragma once

#include <vector>

#include "engine/linalg/Eigen.hpp"
#include "zone/Zone.hpp"

namespace amiss::zone {

/// Conduction through one wall by finite volumes, condensed onto its inner surface.
///
/// Nodes stand at the cell boundaries, node 0 on the inner surface, the last on the outer one; each holds
/// half of the heat capacity of the cells beside it, so surfaces and interfaces of layers are nodes and the
/// steady state is exact. The number of cells of a layer depends on its thickness and the interval only, not
/// on conductivity and capacity, so that the result is a smooth function of the two, as an emulator needs.
///
/// One implicit stage solves `(C + w K) y = C base + w q` (w = stage weight in s, K includes the surface
/// films). The tridiagonal matrix is eliminated from outside to inside, which leaves the inner surface as `y0
/// = free_surface + w surface_response (gc Ta + gr Ts)`: all that the air (Ta) and star (Ts) nodes need to
/// know.
class WallSolver {
 public:
  /// `interval` in s and `cells` (refinement) set the number of cells.
  WallSolver(const Wall& wall, double interval, double cells);

  /// Conductances from the inner surface to the air and to the star node, W/K.
  double to_air() const { return to_air_; }
  double to_star() const { return to_star_; }

  /// Conductance of the outer film, W/K, changed by set_outside().
  double outside_conductance() const { return outside_conductance_; }

  /// Steady state between the air and the other side, both degC; uniform if adiabatic.
  void start_steady(double air, double outside);

  /// Factorises for the stage weight `weight` (s) and outer film conductance (W/K).
  void factorise(double weight, double outside_conductance);

  /// dy0 / d(heat into the inner surface x weight), K/J.
  double surface_response() const { return inverse_pivot_[0]; }

  /// Eliminates from outside to inside with base `first ? state : second-stage base`; `inside` is the heat
  /// absorbed by the inner surface (W), `outside` that brought by the outer side with the surface at 0 degC
  /// (W). Returns the temperature of the inner surface with air and star at 0 degC.
  double eliminate(bool first, double inside, double outside);

  /// Completes the stage, with `from_room = gc Ta + gr Ts` (W). Returns the outer surface temperature, degC.
  double substitute(double from_room);

  /// Base of the second stage: `state + ratio (stage - state)`.
  void set_second_base(double ratio) { base_ = state_ + ratio * (stage_ - state_); }

  /// Takes the last stage as the new state.
  void accept() { state_ = stage_; }

  /// Heat stored relative to 0 degC, J.
  double stored() const { return (capacity_ * state_).sum(); }

 private:
  void add_layer(const Layer& layer, double area, double interval, double cells);

  double to_air_ = 0.0;
  double to_star_ = 0.0;
  double outside_conductance_ = 0.0;
  double weight_ = 0.0;
  std::vector<double> cell_capacity_;     // J/K, of each cell
  std::vector<double> cell_conductance_;  // W/K, across each cell
  Eigen::ArrayXd capacity_;               // J/K, of each node
  Eigen::ArrayXd inverse_pivot_;
  Eigen::ArrayXd multiplier_;  // of node j + 1 in the row of node j, and the reverse
  Eigen::ArrayXd state_, stage_, base_, rhs_;
};

}  // namespace amiss::zone
