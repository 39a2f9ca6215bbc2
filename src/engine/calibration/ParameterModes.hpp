#pragma once
#include "engine/calibration/Calibration.hpp"

namespace amiss {

struct ModeOptions {
  int starts = 256;         ///< draws from the prior
  int searches = 6;         ///< from the best of them, for each point of the history posterior
  int max_iterations = 30;  ///< of one search
  double inflation = 1.5;   ///< of the covariances
  double dof = 8.0;
};

/// Where the parameters lie, given the record, for a few points of the history posterior: modes of
///     log N(estimate; w'(z), C) + log N(x; 0, I),   C = S(z) + sigma^2 (R'R)^-1,  z = Phi(x),
/// by the Levenberg-Marquardt method, each with the Gauss-Newton covariance (W'C^-1 W + I)^-1, W = dw'/dx.
/// A Student-t mixture with one component for each distinct mode; weights half from the Laplace
/// approximation of its mass, half equal.
struct ParameterModes {
  StudentTMixture mixture;
  /// Least (estimate - w')'C^-1 (estimate - w') of the modes, for each point; not a number where no mode was
  /// found. Far above Q, the record contradicts the history posterior whatever the parameters: the joint
  /// posterior lies elsewhere.
  Eigen::VectorXd misfits;
  long evaluations;  ///< emulated points
};

ParameterModes parameter_modes(const CalibrationTarget& target, const std::vector<HistoryParameters>& points,
                               const ModeOptions& options, const Context& context, Stream& stream);

}  // namespace amiss
