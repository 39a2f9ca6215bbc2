#include "engine/calibration/PaperCalibration.hpp"

#include <cmath>
#include <stdexcept>

#include "engine/linalg/constants.hpp"
#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kOrthogonal = 1e-6;  // largest cosine between two columns

}  // namespace

PaperCalibration::PaperCalibration(const VectorXd& y, const MatrixXd& basis) {
  if (basis.rows() != y.size() || basis.cols() == 0)
    throw std::invalid_argument("calibration: lengths differ");
  norms_ = basis.colwise().squaredNorm().transpose();
  if (!(norms_.minCoeff() > 0)) throw std::invalid_argument("calibration: a column of the basis is zero");
  const VectorXd scale = norms_.cwiseSqrt();
  MatrixXd cosine = (basis.transpose() * basis).array() / (scale * scale.transpose()).array();
  cosine.diagonal().setZero();
  if (!(cosine.cwiseAbs().maxCoeff() < kOrthogonal))
    throw std::invalid_argument("calibration: the columns of the basis are not orthogonal");
  estimate_ = (basis.transpose() * y).cwiseQuotient(norms_);
}

double PaperCalibration::log_density(const VectorXd& mean, const VectorXd& variance,
                                     const VectorXd& lambda) const {
  double value = log_jacobian();
  for (Index q = 0; q < size(); ++q) {
    const double total = variance[q] + 1.0 / (lambda[lambda.size() == 1 ? 0 : q] * norms_[q]);
    const double difference = estimate_[q] - mean[q];
    value -= 0.5 * (kLogTwoPi + std::log(total) + difference * difference / total);
  }
  return value;
}

PaperCalibrationTarget::PaperCalibrationTarget(const PaperCalibration& data, const Emulator& emulator,
                                               const NoisePrior& noise, bool shared_lambda)
    : data_(data), emulator_(emulator), noise_(noise), shared_lambda_(shared_lambda) {
  noise_.check();
  if (emulator.n_outputs() != data.size())
    throw std::invalid_argument("calibration: the emulator's coefficients do not match the basis");
}

MatrixXd PaperCalibrationTarget::unit(const MatrixXd& x) const {
  return x.topRows(emulator_.n_inputs()).transpose().unaryExpr(&normal_cdf);
}

MatrixXd PaperCalibrationTarget::lambda(const MatrixXd& x) const {
  return x.bottomRows(precisions()).transpose().unaryExpr([this](double v) { return noise_.precision(v); });
}

VectorXd PaperCalibrationTarget::log_likelihood(const MatrixXd& x) const {
  MatrixXd mean, variance;
  emulator_.predict_at(x.topRows(emulator_.n_inputs()), mean, variance);
  const MatrixXd precision = lambda(x);
  VectorXd values(x.cols());
  for (Index i = 0; i < x.cols(); ++i) {
    values[i] =
        data_.log_density(mean.row(i).transpose(), variance.row(i).transpose(), precision.row(i).transpose());
  }
  return values;
}

}  // namespace amiss
