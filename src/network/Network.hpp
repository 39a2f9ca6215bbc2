#pragma once

#include <vector>

#include "engine/linalg/Eigen.hpp"

namespace amiss::network {

/// Where a quantity stands: the state of a node, a driver, or neither (-1), which counts as 1.
struct Place {
  int node = -1;
  int driver = -1;
};

/// One summand of a balance: `sign x element x driver 'by' x quantity at 'of'` per hour. A link between two
/// nodes is four terms, two into each; a flow two; a gain one.
struct Term {
  int into = -1;  ///< node whose balance it enters; -1 in Network::output
  Place of;       ///< what is carried
  double sign = 1.0;
  int element = -1;  ///< number of the coefficient, -1 for one
  int by = -1;       ///< driver that multiplies it, -1 for none
};

/// Nodes with a capacity C that exchange what they hold, linear in their states x:
///
///   C_i dx_i/dt = sum of the terms into i,      y = sum of the terms of `output`.
///
/// Heat: x in K, C in kWh/K, elements in kW/K. Tanks and tracers: x a level or concentration, C an area or
/// a volume, elements flows or rates.
struct Network {
  int nodes = 0;
  int elements = 0;
  int drivers = 0;
  std::vector<Term> balance;
  std::vector<Term> output;

  /// Throws std::invalid_argument if a number leads nowhere or no output is given.
  void check() const;

  /// The node that is the output itself, or -1 if the output is a flow.
  int output_node() const;

  /// Drivers that multiply coefficients.
  std::vector<int> modulators() const;
};

/// Numbers of a network, or their change along one direction.
struct Coefficients {
  Eigen::VectorXd element;   ///< conductances, rates, factors
  Eigen::VectorXd capacity;  ///< of each node, > 0; infinite: the state is constant
  Eigen::VectorXd start;     ///< of each node; NaN: in steady state with the others
  Eigen::VectorXd before;    ///< drivers before the first row; NaN: the mean of the first rows
};

}  // namespace amiss::network
