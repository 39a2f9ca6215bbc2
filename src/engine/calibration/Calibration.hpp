#pragma once
#include <vector>

#include "engine/ais/Target.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss {

/// What the measurement says about the coefficients of the basis under one error of the history posterior:
///     estimate ~ N(w(z), covariance).
struct CoefficientData {
  Eigen::VectorXd estimate;    ///< Q
  Eigen::MatrixXd covariance;  ///< Q x Q: sigma^2 (R'R)^-1
  double log_jacobian = 0.0;   ///< -log |R|, which makes this a density of y
};

/// Calibration posterior (equation 5) of the parameters in the unit cube. The error enters as equally probable draws
/// from what the part of y outside the simulation space says about it, so that the normalising constant is the
/// density of the inside part given the outside part, and both together are the evidence of the model:
///     likelihood(z) = mean_j N(estimate_j; w'(z), S(z) + covariance_j) / |R_j|,
/// w' and S the emulator's mean and variance.
class CalibrationTarget : public Target {
 public:
  CalibrationTarget(const Emulator& emulator, std::vector<CoefficientData> data);

  Eigen::Index dimension() const override { return emulator_.n_inputs(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;

  /// Log densities under each error draw (errors x n), of which the likelihood is the mean.
  Eigen::MatrixXd log_densities(const Eigen::MatrixXd& x) const;
  /// u = Phi(x), n x P.
  static Eigen::MatrixXd unit(const Eigen::MatrixXd& x);

 private:
  const Emulator& emulator_;
  std::vector<CoefficientData> data_;
};

}  // namespace amiss
