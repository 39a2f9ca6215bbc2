#pragma once

#include <vector>

#include "engine/linalg/Eigen.hpp"
#include "zone/Zone.hpp"

namespace amiss::zone {

/// Conduction through up to four walls, side by side in the lanes of a vector register, by finite volumes,
/// each wall condensed onto its inner surface. Lanes without a wall are zero throughout.
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
  static constexpr int kLanes = 4;
  using Lanes = Eigen::Array<double, kLanes, 1>;

  /// `interval` in s and `cells` (refinement) set the number of cells. At most kLanes walls.
  WallSolver(const std::vector<const Wall*>& walls, double interval, double cells);

  /// Conductances from the inner surfaces to the air and to the star node, W/K.
  const Lanes& to_air() const { return to_air_; }
  const Lanes& to_star() const { return to_star_; }

  /// Conductances of the outer films, W/K, changed by factorise().
  const Lanes& outside_conductance() const { return outside_conductance_; }

  /// Steady state of the wall in a lane between the air and the other side, both degC; uniform if adiabatic.
  void start_steady(int lane, double air, double outside);

  /// Factorises for the stage weight `weight` (s) and outer film conductances (W/K).
  void factorise(double weight, const Lanes& outside_conductance);

  /// dy0 / d(heat into the inner surface x weight), K/J.
  Lanes surface_response() const { return inverse_pivot_.col(0); }

  /// Eliminates from outside to inside with base `first ? state : second-stage base`; `inside` is the heat
  /// absorbed by the inner surfaces (W), `outside` that brought by the outer sides with the surface at 0 degC
  /// (W). Returns the temperatures of the inner surfaces with air and star at 0 degC.
  Lanes eliminate(bool first, const Lanes& inside, const Lanes& outside);

  /// Completes the stage, with `from_room = gc Ta + gr Ts` (W). Returns the outer surface temperatures, degC.
  Lanes substitute(const Lanes& from_room);

  /// Base of the second stage: `state + ratio (stage - state)`.
  void set_second_base(double ratio) { base_ = state_ + ratio * (stage_ - state_); }

  /// Takes the last stage as the new state.
  void accept() { state_ = stage_; }

  /// Heat stored relative to 0 degC, J.
  double stored() const { return (capacity_ * state_).sum(); }
  double stored_in(int lane) const { return (capacity_.row(lane) * state_.row(lane)).sum(); }

 private:
  using Nodes = Eigen::Array<double, kLanes, Eigen::Dynamic>;

  Lanes to_air_ = Lanes::Zero();
  Lanes to_star_ = Lanes::Zero();
  Lanes outside_conductance_ = Lanes::Zero();
  double weight_ = 0.0;
  Nodes cell_conductance_;  // W/K, from each node to the next; 0 beyond the last
  Nodes capacity_;          // J/K, of each node
  Nodes is_last_;           // 1 at the outer surface of each wall, else 0
  Nodes inverse_pivot_;
  Nodes multiplier_;  // of node j + 1 in the row of node j, and the reverse
  Nodes state_, stage_, base_, rhs_;
};

}  // namespace amiss::zone
