#pragma once

#include <vector>

#include "network/Propagator.hpp"

namespace amiss::network {

struct Options {
  double step_h = 1.0;  ///< length of a row, h, > 0
  bool linear = false;  ///< as Row::linear
  bool mean = true;     ///< as Row::mean
  double start_hours =
      24;  ///< of data, whose mean drivers are those before the start, >= 0: one row at least

  /// Throws std::invalid_argument.
  void check() const;
};

/// Output of a network over equal rows, and its slopes along directions.
struct Run {
  Eigen::VectorXd output;  ///< N
  Eigen::MatrixXd slopes;  ///< N x P
};

/// Runs a network over rows of drivers (N x m, finite). `hold`: values (N, or of size 0) at which the
/// output's node is prescribed over a row, NaN where it is free; nothing is held if the output is a flow.
///
/// Start: nodes with a start at it; the output's node, without one, at the first value that it is held at;
/// the others in steady state between them and the drivers before the start; if there is none, the output is
/// NaN.
///
/// Exact for drivers that are constant, or linear, over a row, at any step: see propagator(). If a driver
/// multiplies coefficients, its mean over the row does, and the matrices of all rows come from their
/// Chebyshev series in that driver, to 1e-12 of the largest; with two such drivers, from an exponential for
/// each row. Output that is not finite is returned as it is. Throws std::invalid_argument for a network,
/// options or sizes that do not fit.
Run simulate(const Network& network, const Coefficients& coefficients,
             const std::vector<Coefficients>& directions, const Eigen::Ref<const Eigen::MatrixXd>& drivers,
             const Eigen::Ref<const Eigen::VectorXd>& hold, const Options& options);

}  // namespace amiss::network
