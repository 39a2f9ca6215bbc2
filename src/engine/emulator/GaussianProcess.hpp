#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Gamma(shape, rate) prior of the noise precision lambda_q; shape = 0 leaves lambda_q out (no such noise).
struct GammaPrior {
  double shape = 0.0;
  double rate = 0.0;
};

struct EmulatorOptions {
  int starts = 3;             ///< starting points screened; the search runs from the best of them
  int searches = 1;           ///< how many of them are searched
  int max_evaluations = 120;  ///< per search

  void check() const;
};

/// Hyper-parameters of equation (2) on the scales on which they are searched:
///     cov(w_i, w_j) = amplitude prod_p beta_p^(4 (u_ip - u_jp)^2) + delta_ij (nugget + 1 / lambda),
/// amplitude = (1 - s2) / s2, nugget = (1 - eta2) / eta2. With s2 and eta2 uniform on (0, 1), log amplitude =
/// -logit(s2) and log nugget = -logit(eta2).
struct GaussianProcessParameters {
  double log_amplitude = 0.0;
  double log_nugget = -10.0;
  double log_lambda = 0.0;
  Eigen::VectorXd logit_beta;  ///< P

  Eigen::VectorXd pack() const;
  static GaussianProcessParameters unpack(const Eigen::VectorXd& x);
};

/// Gaussian-process emulator of one coefficient over the unit cube, of values centred and scaled to unit
/// variance.
class GaussianProcess {
 public:
  /// @param inputs M x P in the unit cube. @param values M, standardised.
  GaussianProcess(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values,
                  const GaussianProcessParameters& parameters);

  /// Mode of the joint density (3) of values and hyper-parameters, by gradient search.
  static GaussianProcess fit(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values,
                             const GammaPrior& prior, const EmulatorOptions& options);

  /// Logarithm of the joint density (3), up to a constant, and its gradient in pack()'s coordinates.
  static double log_density(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values,
                            const GammaPrior& prior, const Eigen::VectorXd& packed,
                            Eigen::Ref<Eigen::VectorXd> gradient);

  /// Mean and variance of the smooth part at points (n x P).
  void predict(const Eigen::MatrixXd& points, Eigen::Ref<Eigen::VectorXd> mean,
               Eigen::Ref<Eigen::VectorXd> variance) const;

  /// Leave-one-out prediction of each value, closed form (Rasmussen and Williams 2006, equation 5.12).
  void leave_one_out(Eigen::VectorXd& mean, Eigen::VectorXd& variance) const;

  const GaussianProcessParameters& parameters() const { return parameters_; }
  double log_joint = 0.0;  ///< value of (3) at the mode, if fitted
  int evaluations = 0;     ///< of (3), while fitting

 private:
  Eigen::MatrixXd scaled_inputs_;  // M x P: input p times sqrt(-4 log beta_p)
  Eigen::VectorXd values_;
  GaussianProcessParameters parameters_;
  Eigen::MatrixXd inverse_;       // of the covariance
  Eigen::MatrixXd root_inverse_;  // inverse of its Cholesky factor
  Eigen::VectorXd weights_;       // inverse times values
};

}  // namespace amiss
