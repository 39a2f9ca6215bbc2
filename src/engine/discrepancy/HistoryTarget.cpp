#include "engine/discrepancy/HistoryTarget.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/special_functions/beta.hpp>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/linalg/constants.hpp"
#include "engine/linalg/double_policy.hpp"
#include "engine/linalg/precedes.hpp"
#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

double clamp_unit(double u) { return std::min(std::max(u, 1e-12), 1.0 - 1e-12); }

// Which of n equally probable levels a coordinate chooses.
int level(double x, int n) { return std::min(n - 1, static_cast<int>(normal_cdf(x) * n)); }

}  // namespace

HistoryCoordinates::HistoryCoordinates(const HistoryModel& model, std::vector<int> active)
    : model_(&model), active_(std::move(active)) {
  const HistoryData& data = model.data();
  const auto column = [&](int s) {
    return data.responses.col(std::find(data.condition.begin(), data.condition.end(), s) -
                              data.condition.begin());
  };
  std::stable_sort(active_.begin(), active_.end(),
                   [&](int a, int b) { return precedes(column(a), column(b)); });
}

Index HistoryCoordinates::first_condition() const {
  const HistoryPriors& priors = model_->priors();
  return 1 + priors.error.correlation_times.size() + (priors.reach.size() > 1 ? 1 : 0);
}

// sigma^2 = noise_sd^2 b / (1 - b) with b ~ Beta(a*, a*), the distribution F(2a*, 2a*).
double HistoryCoordinates::noise_share(double x) const {
  const double shape = model_->priors().noise_shape;
  return clamp_unit(boost::math::ibeta_inv(shape, shape, clamp_unit(normal_cdf(x)), DoublePolicy()));
}

double HistoryCoordinates::noise_variance(double share) const {
  const double sd = model_->priors().noise_sd;
  return sd * sd * share / (1.0 - share);
}

double HistoryCoordinates::noise_slope(double x, double share) const {
  const double shape = model_->priors().noise_shape;
  return noise_variance(share) * normal_density(x) /
         (share * (1.0 - share) * boost::math::ibeta_derivative(shape, shape, share, DoublePolicy()));
}

bool HistoryCoordinates::has_leaps() const { return first_condition() > 1; }

// With the variance of the whole error, sigma^2 (1 + sum_k ratio_k), kept, sigma^2 falls as a ratio rises:
// the likelihood hardly changes then. The place within a level is kept too, which keeps u = Phi(x_k) uniform.
double HistoryCoordinates::leap(Eigen::Ref<VectorXd> x, Stream& stream) const {
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  const HistoryPriors& priors = model_->priors();
  const VectorXd& ratios = priors.error.ratios;
  const Index components = priors.error.correlation_times.size();
  const Index row = 1 + stream.index(static_cast<int>(first_condition() - 1));
  const bool of_error = row <= components;
  const int levels = static_cast<int>(of_error ? ratios.size() : priors.reach.size());
  const int from = level(x[row], levels), to = from + (stream.uniform() < 0.5 ? -1 : 1);
  if (to < 0 || to >= levels) return kNone;
  const double old = x[row];
  x[row] = boost::math::quantile(boost::math::normal(),
                                 clamp_unit(normal_cdf(old) + static_cast<double>(to - from) / levels));
  const double log_change = 0.5 * (x[row] * x[row] - old * old);
  if (!of_error) return log_change;

  double to_whole = 1.0;
  for (Index k = 1; k <= components; ++k) to_whole += ratios[level(x[k], levels)];
  const double change = (to_whole - ratios[to] + ratios[from]) / to_whole, before = noise_share(x[0]);
  const double variance =
      (noise_variance(before) + priors.discarded_variance) * change - priors.discarded_variance;
  if (!(variance > 0)) return kNone;
  const double after = variance / (variance + priors.noise_sd * priors.noise_sd);
  const double slope = noise_slope(x[0], before);
  const double u = boost::math::ibeta(priors.noise_shape, priors.noise_shape, after, DoublePolicy());
  x[0] = boost::math::quantile(boost::math::normal(), clamp_unit(u));
  return log_change + std::log(change * slope / noise_slope(x[0], after));
}

HistoryParameters HistoryCoordinates::parameters(const Eigen::Ref<const VectorXd>& x) const {
  const HistoryPriors& priors = model_->priors();
  HistoryParameters point;
  point.variance = noise_variance(noise_share(x[0])) + priors.discarded_variance;
  const Index components = priors.error.correlation_times.size();
  const int levels = static_cast<int>(priors.error.ratios.size());
  const int reaches = static_cast<int>(priors.reach.size());
  if (reaches > 1) point.setting = level(x[1 + components], reaches);
  for (Index k = components - 1; k >= 0; --k)
    point.setting = point.setting * levels + level(x[1 + k], levels);
  point.t = VectorXd::Zero(model_->conditions());
  const Index first = first_condition();
  for (std::size_t a = 0; a < active_.size(); ++a) {
    // The lower part of the unit interval is the spike at zero; the likelihood is continuous where the slab
    // begins.
    const double u =
        (normal_cdf(x[first + static_cast<Index>(a)]) - (1.0 - priors.inclusion)) / priors.inclusion;
    if (u > 0) point.t[active_[a]] = std::pow(priors.amplitude * std::tan(0.5 * kPi * clamp_unit(u)), 2);
  }
  return point;
}

// d log sigma^2 / dx and d log t / dx of the maps in parameters(): with u uniform and x = Phi^-1(u), du / dx
// is the normal density.
VectorXd HistoryCoordinates::gradient(const Eigen::Ref<const VectorXd>& x, const HistoryParameters& point,
                                      const VectorXd& natural) const {
  const HistoryPriors& priors = model_->priors();
  VectorXd out = VectorXd::Zero(x.size());
  const double share = noise_share(x[0]);
  out[0] = natural[0] * noise_slope(x[0], share) / point.variance;
  const Index first = first_condition();
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const Index row = first + static_cast<Index>(a);
    if (!(point.t[active_[a]] > 0)) continue;
    const double root = std::sqrt(point.t[active_[a]]) / priors.amplitude;  // tan(pi u / 2)
    out[row] = natural[1 + active_[a]] * normal_density(x[row]) / priors.inclusion * kPi *
               (1.0 + root * root) / root;
  }
  return out;
}

HistoryTarget::HistoryTarget(const HistoryModel& model, std::vector<int> active,
                             const GaussianSimulator& simulator, int reach)
    : coordinates_(model, std::move(active)), reach_(reach) {
  const VectorXd shift = simulator.mean - model.reference();
  for (int g = 0; g < model.settings(); ++g)
    settings_.push_back(model.whitened(g).in_terms_of(shift, simulator.root));
}

HistoryParameters HistoryTarget::parameters(const VectorXd& x) const {
  HistoryParameters point = coordinates_.parameters(x);
  const int errors = coordinates_.model().error_settings();
  if (reach_ >= 0) point.setting = point.setting % errors + reach_ * errors;
  return point;
}

VectorXd HistoryTarget::with_reach(VectorXd x, double u) const {
  const HistoryPriors& priors = coordinates_.model().priors();
  const double reaches = static_cast<double>(priors.reach.size());
  if (reach_ >= 0 && reaches > 1)
    x[1 + priors.error.correlation_times.size()] =
        boost::math::quantile(boost::math::normal(), clamp_unit((reach_ + u) / reaches));
  return x;
}

VectorXd HistoryTarget::log_likelihood(const MatrixXd& x) const {
  VectorXd values(x.cols());
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters point = parameters(x.col(i));
    values[i] = coordinates_.model().log_likelihood(settings_[static_cast<std::size_t>(point.setting)],
                                                    std::log(point.variance), point.t);
  }
  return values;
}

VectorXd HistoryTarget::log_likelihood(const MatrixXd& x, MatrixXd& gradient) const {
  gradient.resize(x.rows(), x.cols());
  VectorXd values(x.cols()), natural;
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters point = parameters(x.col(i));
    values[i] = coordinates_.model().log_likelihood(settings_[static_cast<std::size_t>(point.setting)],
                                                    std::log(point.variance), point.t, &natural);
    gradient.col(i) = coordinates_.gradient(x.col(i), point, natural);
  }
  return values;
}

}  // namespace amiss
