#include "engine/calibration/CalibrationTarget.hpp"

#include <limits>
#include <stdexcept>
#include <utility>

#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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

}  // namespace amiss
