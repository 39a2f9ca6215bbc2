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

// The record as the parameters see it, error and discrepancy known.
class AlongParameters : public Conditional {
 public:
  // Of each chain, what the record says about the coefficients.
  AlongParameters(const Emulator& emulator, std::vector<CoefficientLikelihood> exact)
      : emulator_(emulator), exact_(std::move(exact)) {
    const VectorXd variance = emulator.typical_variance().transpose();
    for (const CoefficientLikelihood& likelihood : exact_) typical_.push_back(likelihood.blurred(variance));
  }

  VectorXd log_likelihood(const MatrixXd& x) const override {
    MatrixXd mean, variance;
    emulator_.predict_at(x, mean, variance);
    VectorXd values(x.cols());
    for (Index i = 0; i < x.cols(); ++i)
      values[i] = emulator_.region().contains(x.col(i))
                      ? exact_[static_cast<std::size_t>(i)].log_density(mean.row(i).transpose(),
                                                                        variance.row(i).transpose())
                      : -std::numeric_limits<double>::infinity();
    return values;
  }

  // By the emulator's typical variance, whose own gradient is left out.
  MatrixXd gradient(const MatrixXd& x) const override {
    return emulator_.slopes_at(x, [&](const MatrixXd& mean) {
      MatrixXd by_mean(mean.rows(), mean.cols());
      for (Index i = 0; i < mean.rows(); ++i)
        by_mean.row(i) = typical_[static_cast<std::size_t>(i)].score(mean.row(i).transpose()).transpose();
      return by_mean;
    });
  }

 private:
  const Emulator& emulator_;
  std::vector<CoefficientLikelihood> exact_, typical_;
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

std::unique_ptr<Conditional> CalibrationTarget::along_last_part(const MatrixXd& x) const {
  std::vector<CoefficientLikelihood> given;
  for (Index i = 0; i < x.cols(); ++i) given.push_back(model().given(history(x.col(i))));
  return std::make_unique<AlongParameters>(emulator_, std::move(given));
}

}  // namespace amiss
