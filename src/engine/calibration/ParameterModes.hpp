#pragma once
#include "engine/ais/StudentT.hpp"
#include "engine/calibration/CalibrationTarget.hpp"

namespace amiss {

struct ModeOptions {
  int starts = 192;         ///< points of the emulator's region
  int searches = 4;         ///< from the best of them, for each point of the history posterior
  int max_iterations = 30;  ///< of one search
  double inflation = 1.5;   ///< of the covariances
  double dof = 8.0;
};

/// Where the parameters lie, given the records, for a few points of the history posterior: modes of
///     log p(y | z, history) + log N(x; 0, I),  z = Phi(x),
/// by the Levenberg-Marquardt method, each with the Gauss-Newton covariance (W'A W + I)^-1, W = dw'/dx, A
/// what the records tell about the coefficients. A Student-t mixture with one component for each distinct
/// mode; weights half from the Laplace approximation of its mass, half equal. Where an emulator has a
/// region, a tenth of the mixture is spread over it.
struct ParameterModes {
  StudentTMixture mixture;
  Eigen::VectorXd best;  ///< the highest mode, P coordinates N(0, I)
  long evaluations;      ///< emulated points
};

/// @param points  each with one history for each record.
ParameterModes parameter_modes(const CalibrationTarget& target,
                               const std::vector<std::vector<HistoryParameters>>& points,
                               const ModeOptions& options, const Context& context, Stream& stream);

}  // namespace amiss
