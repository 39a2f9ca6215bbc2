#pragma once

#include <string>
#include <vector>

#include "engine/linalg/Eigen.hpp"
#include "zone/Airflow.hpp"
#include "zone/Options.hpp"
#include "zone/Run.hpp"
#include "zone/WallSolver.hpp"
#include "zone/Zone.hpp"

namespace amiss::zone {

/// Simulates a zone over equal intervals.
///
/// @param drivers  N x S, one row per interval, means over the interval, held constant within it.
/// @param step_s   length of an interval, s, > 0.
/// @param hold     N air temperatures (degC), or of size 0. Where it is a number the air is prescribed to it
/// over
///                 that interval; where it is NaN the air is free. Holding the first rows lets the walls
///                 forget their unknown past.
/// @return         mean air temperature of every interval, the flux that was asked for, and the energy
/// balance.
///
/// Start: air at the first number of `hold`, else at `zone.initial_air`; walls in steady state between that,
/// plus `zone.initial_wall_offset`,
/// and the mean of the driver on their other side over `options.initial_hours`; heaters emit their first
/// power. Time: equal sub-steps by the two-stage, second-order, L-stable and stiffly accurate SDIRK method
/// (gamma = 1 - 1/sqrt 2; Alexander 1977, SIAM J. Numer. Anal. 14); air flows are frozen over a sub-step.
/// Air and star nodes are found from 2 x 2 equations in each stage, the walls being condensed onto their
/// surfaces. Throws std::invalid_argument for a zone, options or data that fail their checks.
Run simulate(const Zone& zone, const Eigen::Ref<const Eigen::MatrixXd>& drivers, double step_s,
             const Eigen::Ref<const Eigen::VectorXd>& hold, const Options& options);

/// One run of simulate(): allocates when made, not while running.
class Simulation {
 public:
  Simulation(const Zone& zone, const Eigen::Ref<const Eigen::MatrixXd>& drivers, double step_s,
             const Eigen::Ref<const Eigen::VectorXd>& hold, const Options& options);
  Run run();

 private:
  /// Heat that one component brings: `conductance (temperature - Ta) + to_air` to the air, the rest to
  /// surfaces, W.
  struct Exchange {
    std::string name;
    double conductance = 0.0;
    double temperature = 0.0;
    double to_air = 0.0;
    double by_emissivity = 0.0;  // to the surfaces by area x emissivity
    double by_area = 0.0;        // to the surfaces by area
    double kept = 0.0;           // into the component's own storage
    double energy = 0.0;         // J, since the balance was begun
  };

  /// Number of the first exchange of each kind; the others follow it in the order of the zone's.
  struct FirstExchanges {
    std::size_t window = 0, opening = 0, infiltration = 0, heater = 0, supply = 0, coupling = 0, gain = 0;
  };

  using Lanes = WallSolver::Lanes;

  /// Walls that are solved side by side, with their shares of radiant heat, what their outer sides bring with
  /// the surface at 0 degC (W), and the heat that came through the outer sides (J).
  struct WallGroup {
    std::vector<const Wall*> walls;
    WallSolver solver;
    Lanes emissivity_share = Lanes::Zero();
    Lanes area_share = Lanes::Zero();
    Lanes outside_heat = Lanes::Zero();
    Lanes energy = Lanes::Zero();
  };

  struct HeaterState {
    const Heater* heater;
    double lag = 0.0;      // s
    double emitted = 0.0;  // W, at the present time
  };

  /// Sums over walls that couple the air and star nodes; K/W and W/K.
  struct RoomMatrix {
    double air = 0.0, star = 0.0;                           // sum gc, sum gr
    double air_air = 0.0, air_star = 0.0, star_star = 0.0;  // w sum gc gc s, ... with s the surface response
  };

  /// Totals of the exchanges over a sub-step.
  struct Load {
    double conductance = 0.0, to_air = 0.0, by_emissivity = 0.0, by_area = 0.0;
  };

  /// Air temperature of a stage, and the heat from the walls to the air (W).
  struct Stage {
    double air;
    double from_walls;
  };

  double driver(Column column) const { return drivers_(row_, column); }
  bool held() const { return hold_.size() > 0 && hold_[row_] == hold_[row_]; }

  void add_walls(const Options& options);
  void add_exchanges();
  void add_heaters();
  void start(const Options& options);
  void spin_up(int times);
  void begin_balance();
  EnergyBalance balance() const;
  double stored_walls() const;
  double lost_inwards(int wall) const;
  double stored_heaters() const;

  double advance_interval();
  void hold_air();
  void set_walls();
  double outside_heat(const Wall& wall, double conductance) const;
  double film(const Wall& wall) const;
  void set_exchanges();
  void set_flows();
  void set_heaters();
  void sum_load();
  void update_room_matrix();
  double advance_substep();
  Stage solve_stage(bool first, double base_air, double quadrature_weight);
  void book(double mean_air);

  const Zone& zone_;
  const Eigen::Ref<const Eigen::MatrixXd> drivers_;
  const Eigen::Ref<const Eigen::VectorXd> hold_;
  Eigen::Index row_ = 0;
  int n_substeps_;
  double substep_;                // s
  double stage_weight_;           // gamma x substep, s
  double air_capacity_;           // J/K
  double air_ = 0.0;              // degC, at the present time
  std::vector<WallGroup> walls_;  // in the order of the zone's
  std::vector<Exchange> exchanges_;
  FirstExchanges first_;
  std::vector<HeaterState> heaters_;
  Airflow airflow_;
  int flux_wall_;
  RoomMatrix room_;
  Load load_;
  bool surfaces_emit_ = false;
  double hold_energy_ = 0.0;  // J, since the balance was begun
  double begun_air_ = 0.0, begun_walls_ = 0.0, begun_heaters_ = 0.0;
};

}  // namespace amiss::zone
