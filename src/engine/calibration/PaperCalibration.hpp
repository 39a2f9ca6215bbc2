#pragma once
#include "engine/ais/Target.hpp"
#include "engine/discrepancy/KernelModel.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss {

/// What equation (5) asks of the data: the measurement's coefficients on the basis.
///
/// With y = K w + H v + e, e ~ N(0, I / lambda*), and orthogonal columns k_q, the coefficient
///     w*_q = (k_q'k_q)^-1 k_q'y = w_q + (k_q'k_q)^-1 k_q'e
/// carries noise of variance (k_q'k_q)^-2 k_q'k_q / lambda* = 1 / (lambda* k_q'k_q). So
///     w*_q ~ N(w'_q(z), s2_q(z) + 1 / (lambda*_q k_q'k_q)),  lambda*_q ~ Gamma(a*, b*),
/// with the emulator's mean w'_q and variance s2_q; lambda*_q is the precision of the noise in the series,
/// the same quantity and the same prior as in (6). Written for the coefficient's own precision mu_q =
/// lambda*_q k_q'k_q the prior is mu_q ~ Gamma(a*, b* / k_q'k_q) and the variance 1 / mu_q: the paper's
/// scaling. Either form, but not both at once: dividing by k_q'k_q twice would make the result depend on the
/// unit of K.
///
/// The map y -> (w*, v), y = K w* + H v, has |dy| = |K'K|^(1/2) |dw*| |dv|, so that
///     p(y) = |K'K|^(-1/2) p(w*) p(v).
/// The factor belongs to the value here: the product of the normalising constants of (5) and (6) is a density
/// of y, whatever the basis. It is exact for a model in which the noise is drawn Q + 1 times (once for each
/// coefficient, once for v), as the paper has it; CalibrationTarget draws it once.
class PaperCalibration {
 public:
  /// @throws std::invalid_argument if lengths differ, or the columns of the basis are not orthogonal.
  PaperCalibration(const Eigen::VectorXd& y, const Eigen::MatrixXd& basis);

  /// Log density of the inside part of y for coefficients of the emulator's mean and variance (Q each) and
  /// noise precisions lambda (Q, or one for all).
  double log_density(const Eigen::VectorXd& mean, const Eigen::VectorXd& variance,
                     const Eigen::VectorXd& lambda) const;

  Eigen::Index size() const { return estimate_.size(); }                     ///< Q
  const Eigen::VectorXd& estimate() const { return estimate_; }              ///< w*
  const Eigen::VectorXd& norms() const { return norms_; }                    ///< k_q'k_q
  double log_jacobian() const { return -0.5 * norms_.array().log().sum(); }  ///< -1/2 log|K'K|

 private:
  Eigen::VectorXd estimate_, norms_;
};

/// Posterior (5). Coordinates: one for each parameter, u = Phi(x); then lambda*_1 ... lambda*_Q, or one
/// lambda* shared by all coefficients.
class PaperCalibrationTarget : public Target {
 public:
  PaperCalibrationTarget(const PaperCalibration& data, const Emulator& emulator, const NoisePrior& noise,
                         bool shared_lambda);

  Eigen::Index dimension() const override { return emulator_.n_inputs() + precisions(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;

  Eigen::Index precisions() const { return shared_lambda_ ? 1 : data_.size(); }
  Eigen::MatrixXd unit(const Eigen::MatrixXd& x) const;    ///< parameters in the unit cube, n x P
  Eigen::MatrixXd lambda(const Eigen::MatrixXd& x) const;  ///< precisions, n x (Q or 1)

 private:
  const PaperCalibration& data_;
  const Emulator& emulator_;
  NoisePrior noise_;
  bool shared_lambda_;
};

}  // namespace amiss
