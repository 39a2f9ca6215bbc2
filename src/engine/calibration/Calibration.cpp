#include "engine/calibration/Calibration.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

CalibrationTarget::CalibrationTarget(const Emulator& emulator, std::vector<CoefficientData> data)
    : emulator_(emulator), data_(std::move(data)) {
  if (data_.empty()) throw std::invalid_argument("calibration: no error draws");
}

MatrixXd CalibrationTarget::unit(const MatrixXd& x) { return x.transpose().unaryExpr(&normal_cdf); }

MatrixXd CalibrationTarget::log_densities(const MatrixXd& x) const {
  constexpr double kLogTwoPi = 1.83787706640934548356;
  MatrixXd mean, variance;
  emulator_.predict(unit(x), mean, variance);
  MatrixXd values(static_cast<Index>(data_.size()), x.cols());
  const Index q = mean.cols();
  MatrixXd covariance(q, q);
  for (Index i = 0; i < x.cols(); ++i) {
    for (std::size_t j = 0; j < data_.size(); ++j) {
      covariance = data_[j].covariance;
      covariance.diagonal() += variance.row(i).transpose();
      // The coefficients differ by orders of magnitude: factorise the correlation.
      const VectorXd scale = covariance.diagonal().cwiseSqrt();
      covariance.array() /= (scale * scale.transpose()).array();
      const Eigen::LLT<MatrixXd> factor(covariance);
      const VectorXd z = factor.matrixL().solve(
          (data_[j].estimate - mean.row(i).transpose()).cwiseQuotient(scale));
      const double log_det = 2.0 * (factor.matrixLLT().diagonal().array().log().sum() + scale.array().log().sum());
      values(static_cast<Index>(j), i) =
          factor.info() == Eigen::Success
              ? data_[j].log_jacobian - 0.5 * (static_cast<double>(q) * kLogTwoPi + log_det + z.squaredNorm())
              : -std::numeric_limits<double>::infinity();
    }
  }
  return values;
}

VectorXd CalibrationTarget::log_likelihood(const MatrixXd& x) const {
  const MatrixXd parts = log_densities(x);
  VectorXd values(x.cols());
  for (Index i = 0; i < x.cols(); ++i) values[i] = log_mean_exp(parts.col(i));
  return values;
}

}  // namespace amiss
