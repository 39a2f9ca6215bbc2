#include "engine/calibration/CalibrationTarget.hpp"

#include <limits>
#include <stdexcept>
#include <utility>

#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// The record as the parameters see it, error and discrepancy known; the emulator's variance is the typical
// one.
class AlongParameters : public Conditional {
 public:
  AlongParameters(const Emulator& emulator, CoefficientLikelihood likelihood)
      : emulator_(emulator), likelihood_(std::move(likelihood)) {}

  VectorXd gradient(const VectorXd& x) const override {
    MatrixXd slopes;
    VectorXd by_mean;
    likelihood_.log_density(emulator_.mean_at(x, slopes), by_mean);
    return slopes.transpose() * by_mean;
  }

 private:
  const Emulator& emulator_;
  CoefficientLikelihood likelihood_;
};

}  // namespace

CalibrationTarget::CalibrationTarget(const HistoryModel& model, std::vector<int> active,
                                     const Emulator& emulator)
    : history_(model, std::move(active)), emulator_(emulator) {
  if (emulator.n_outputs() != model.data().basis.cols())
    throw std::invalid_argument("calibration: the emulator's coefficients do not match the basis");
}

MatrixXd CalibrationTarget::unit(const MatrixXd& x) const {
  return x.bottomRows(emulator_.n_inputs()).transpose().unaryExpr(&normal_cdf);
}

VectorXd CalibrationTarget::log_likelihood(const MatrixXd& x) const {
  const MatrixXd parameters = x.bottomRows(emulator_.n_inputs());
  MatrixXd mean, variance;
  emulator_.predict_at(parameters, mean, variance);
  VectorXd values(x.cols());
  for (Index i = 0; i < x.cols(); ++i) {
    values[i] =
        emulator_.region().contains(parameters.col(i))
            ? model().log_likelihood(history(x.col(i)), mean.row(i).transpose(), variance.row(i).transpose())
            : -std::numeric_limits<double>::infinity();
  }
  return values;
}

std::unique_ptr<Conditional> CalibrationTarget::along_last_part(const VectorXd& x) const {
  return std::make_unique<AlongParameters>(
      emulator_, model().given(history(x)).blurred(emulator_.typical_variance().transpose()));
}

}  // namespace amiss
