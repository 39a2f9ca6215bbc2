#include "engine/calibration/Calibration.hpp"

#include <cmath>
#include <limits>

#include "engine/ais/DefensiveTarget.hpp"
#include "engine/calibration/ParameterModes.hpp"
#include "engine/linalg/constants.hpp"
#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

double log_standard_normal(const VectorXd& x) {
  return -0.5 * (x.squaredNorm() + kLogTwoPi * static_cast<double>(x.size()));
}

}  // namespace

CalibrationTarget::CalibrationTarget(const HistoryTarget& history, StudentTMixture reference,
                                     const Emulator& emulator)
    : history_(history),
      reference_(std::move(reference)),
      emulator_(emulator),
      log_jacobian_(-log_volume(history.model().data().basis)) {
  const HistoryModel& model = history.model();
  for (int g = 0; g < model.settings(); ++g) {
    const MatrixXd& root = model.whitened(g).root;
    const MatrixXd inverse =
        root.triangularView<Eigen::Upper>().solve(MatrixXd::Identity(root.rows(), root.cols()));
    unit_covariance_.push_back(inverse * inverse.transpose());
  }
}

CalibrationTarget CalibrationTarget::from_prior() const {
  const Index d = history_.dimension();
  StudentT wide(VectorXd::Zero(d), MatrixXd::Identity(d, d), 30.0);
  return CalibrationTarget(history_, StudentTMixture({std::move(wide)}, {1.0}), emulator_);
}

MatrixXd CalibrationTarget::unit(const MatrixXd& x) const {
  return x.bottomRows(emulator_.n_inputs()).transpose().unaryExpr(&normal_cdf);
}

VectorXd CalibrationTarget::draw_reference(Stream& stream) const {
  VectorXd x(dimension());
  x << reference_.draw(stream), stream.normals(emulator_.n_inputs());
  return x;
}

double CalibrationTarget::log_reference(const VectorXd& x) const {
  return reference_.log_density(x.head(history_.dimension())) +
         log_standard_normal(x.tail(emulator_.n_inputs()));
}

MatrixXd CalibrationTarget::covariance_inside(const HistoryParameters& point,
                                              const VectorXd& variance) const {
  MatrixXd covariance = point.variance * unit_covariance_[point.setting];
  covariance.diagonal() += variance;
  return covariance;
}

double CalibrationTarget::log_density_inside(const HistoryParameters& point, const VectorXd& mean,
                                             const VectorXd& variance) const {
  MatrixXd covariance = covariance_inside(point, variance);
  // The coefficients differ by orders of magnitude: factorise the correlation.
  const VectorXd scale = covariance.diagonal().cwiseSqrt();
  covariance.array() /= (scale * scale.transpose()).array();
  const Eigen::LLT<MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  const VectorXd z = factor.matrixL().solve((estimate(point) - mean).cwiseQuotient(scale));
  const double half_log_det = factor.matrixLLT().diagonal().array().log().sum() + scale.array().log().sum();
  return log_jacobian_ - half_log_det -
         0.5 * (static_cast<double>(mean.size()) * kLogTwoPi + z.squaredNorm());
}

VectorXd CalibrationTarget::log_likelihood(const MatrixXd& x) const {
  MatrixXd mean, variance;
  emulator_.predict(unit(x), mean, variance);
  const MatrixXd history_x = x.topRows(history_.dimension());
  VectorXd values = history_.log_likelihood(history_x);
  for (Index i = 0; i < x.cols(); ++i) {
    // The history posterior is in the target, not in the reference.
    values[i] += log_standard_normal(history_x.col(i)) - reference_.log_density(history_x.col(i));
    values[i] += log_density_inside(history(x.col(i)), mean.row(i).transpose(), variance.row(i).transpose());
  }
  return values;
}

namespace {

constexpr std::uint64_t kReference = 64;  // purpose of the streams below; the sampler's are smaller
constexpr int kHistoryPoints = 4;         // at which the modes of the parameters are sought
constexpr double kContradiction = 3.0;    // misfit per basis vector from which the modes mislead

// n points of equal weight, evenly spread over weighted ones.
std::vector<HistoryParameters> spread_points(const HistoryTarget& target, const AisResult& result, int n) {
  std::vector<HistoryParameters> points;
  double cumulative = 0.0;
  for (Index i = 0; i < result.weights.size(); ++i) {
    cumulative += result.weights[i];
    while (static_cast<int>(points.size()) < n && cumulative * n > static_cast<double>(points.size()) + 0.5)
      points.push_back(target.parameters(result.draws.col(i)));
  }
  return points;
}

}  // namespace

CalibrationSample sample_calibration(const CalibrationTarget& target, const AisResult& history,
                                     const AisOptions& options, const Context& context) {
  Stream stream(context.seed, kReference, 0);
  const ParameterModes modes =
      parameter_modes(target, spread_points(target.history_target(), history, kHistoryPoints), ModeOptions(),
                      context, stream);
  CalibrationSample sample;
  sample.misfits = modes.misfits;
  AisResult& posterior = sample.posterior;
  // Log-likelihoods are told as seen from the target's own reference.
  if (!(modes.misfits.mean() < kContradiction * static_cast<double>(target.emulator().n_outputs()))) {
    const CalibrationTarget wide = target.from_prior();
    posterior = sample_ais(wide, options, context);
    for (Index i = 0; i < posterior.log_likelihood.size(); ++i)
      posterior.log_likelihood[i] +=
          wide.log_reference(posterior.draws.col(i)) - target.log_reference(posterior.draws.col(i));
  } else {
    const DefensiveTarget closer(target, modes.mixture, target.history_target().dimension());
    posterior = sample_ais(closer, options, context);
    for (Index i = 0; i < posterior.log_likelihood.size(); ++i)
      posterior.log_likelihood[i] += closer.log_ratio(posterior.draws.col(i));
  }
  posterior.evaluations += modes.evaluations;
  return sample;
}

}  // namespace amiss
