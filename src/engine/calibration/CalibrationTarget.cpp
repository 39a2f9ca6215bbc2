#include "engine/calibration/CalibrationTarget.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kImpossible = -std::numeric_limits<double>::infinity();

// One record as the parameters see it, error and discrepancy known.
class RecordAlongParameters {
 public:
  // `exact`: of each chain, what the record says about the coefficients.
  RecordAlongParameters(const Record& record, std::vector<CoefficientLikelihood> exact)
      : record_(record), exact_(std::move(exact)) {
    const VectorXd variance = record.emulator->typical_variance().transpose();
    for (const CoefficientLikelihood& likelihood : exact_) typical_.push_back(likelihood.blurred(variance));
  }

  void add_log_likelihood(const MatrixXd& all, VectorXd& values) const {
    const MatrixXd x = record_.inputs(all);
    MatrixXd mean, variance;
    record_.emulator->predict_at(x, mean, variance);
    for (Index i = 0; i < x.cols(); ++i)
      values[i] += record_.emulator->region().contains(x.col(i))
                       ? exact_[static_cast<std::size_t>(i)].log_density(mean.row(i).transpose(),
                                                                         variance.row(i).transpose())
                       : kImpossible;
  }

  // By the emulator's typical variance, whose own gradient is left out.
  void add_gradient(const MatrixXd& all, MatrixXd& gradient) const {
    const MatrixXd slopes = record_.emulator->slopes_at(record_.inputs(all), [&](const MatrixXd& mean) {
      MatrixXd by_mean(mean.rows(), mean.cols());
      for (Index i = 0; i < mean.rows(); ++i)
        by_mean.row(i) = typical_[static_cast<std::size_t>(i)].score(mean.row(i).transpose()).transpose();
      return by_mean;
    });
    for (std::size_t p = 0; p < record_.parameters.size(); ++p)
      gradient.row(record_.parameters[p]) += slopes.row(static_cast<Index>(p));
  }

 private:
  const Record& record_;
  std::vector<CoefficientLikelihood> exact_, typical_;
};

class AlongParameters : public Conditional {
 public:
  explicit AlongParameters(std::vector<RecordAlongParameters> records) : records_(std::move(records)) {}

  VectorXd log_likelihood(const MatrixXd& x) const override {
    VectorXd values = VectorXd::Zero(x.cols());
    for (const RecordAlongParameters& record : records_) record.add_log_likelihood(x, values);
    return values;
  }

  MatrixXd gradient(const MatrixXd& x) const override {
    MatrixXd slopes = MatrixXd::Zero(x.rows(), x.cols());
    for (const RecordAlongParameters& record : records_) record.add_gradient(x, slopes);
    return slopes;
  }

 private:
  std::vector<RecordAlongParameters> records_;
};

}  // namespace

CalibrationTarget::CalibrationTarget(const HistoryModel& model, std::vector<int> active,
                                     const Emulator& emulator)
    : CalibrationTarget({whole_record(model, std::move(active), emulator)}) {}

CalibrationTarget::CalibrationTarget(std::vector<Record> records) : records_(std::move(records)) {
  if (records_.empty()) throw std::invalid_argument("calibration: at least one record is needed");
  for (const Record& record : records_) {
    record.check();
    coordinates_.emplace_back(*record.model, record.active);
    first_.push_back(first_parameter_);
    first_parameter_ += coordinates_.back().dimension();
    for (int p : record.parameters) parameters_ = std::max<Index>(parameters_, p + 1);
  }
}

MatrixXd CalibrationTarget::unit(const MatrixXd& x) const {
  return x.bottomRows(parameters_).transpose().unaryExpr(&normal_cdf);
}

// A record that has no settings is left as it is, which is no leap.
double CalibrationTarget::leap(Eigen::Ref<VectorXd> x, Stream& stream) const {
  const auto k = static_cast<std::size_t>(stream.index(static_cast<int>(records_.size())));
  if (!coordinates_[k].has_leaps()) return kImpossible;
  return coordinates_[k].leap(x.segment(first_[k], coordinates_[k].dimension()), stream);
}

bool CalibrationTarget::has_leaps() const {
  return std::any_of(coordinates_.begin(), coordinates_.end(),
                     [](const HistoryCoordinates& record) { return record.has_leaps(); });
}

HistoryParameters CalibrationTarget::history(const VectorXd& x, std::size_t record) const {
  return coordinates_[record].parameters(x.segment(first_[record], coordinates_[record].dimension()));
}

std::vector<HistoryParameters> CalibrationTarget::histories(const VectorXd& x) const {
  std::vector<HistoryParameters> all;
  for (std::size_t k = 0; k < records_.size(); ++k) all.push_back(history(x, k));
  return all;
}

VectorXd CalibrationTarget::log_likelihood(const MatrixXd& x) const {
  VectorXd values = VectorXd::Zero(x.cols());
  for (std::size_t k = 0; k < records_.size(); ++k) {
    const Record& record = records_[k];
    const MatrixXd parameters = record.inputs(x.bottomRows(parameters_));
    MatrixXd mean, variance;
    record.emulator->predict_at(parameters, mean, variance);
    for (Index i = 0; i < x.cols(); ++i) {
      values[i] += record.emulator->region().contains(parameters.col(i))
                       ? record.model->log_likelihood(history(x.col(i), k), mean.row(i).transpose(),
                                                      variance.row(i).transpose())
                       : kImpossible;
    }
  }
  return values;
}

std::unique_ptr<Conditional> CalibrationTarget::along_last_part(const MatrixXd& x) const {
  std::vector<RecordAlongParameters> along;
  for (std::size_t k = 0; k < records_.size(); ++k) {
    std::vector<CoefficientLikelihood> given;
    for (Index i = 0; i < x.cols(); ++i) given.push_back(records_[k].model->given(history(x.col(i), k)));
    along.emplace_back(records_[k], std::move(given));
  }
  return std::make_unique<AlongParameters>(std::move(along));
}

}  // namespace amiss
