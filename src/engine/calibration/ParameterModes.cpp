#include "engine/calibration/ParameterModes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/calibration/Linearisation.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/parallel/parallel_for.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kSettled = 1e-2;     // gain in nats at which a search ends
constexpr double kRegionShare = 0.1;  // of the mixture
constexpr double kSame = 1.0;         // distance between modes, in standard deviations, that counts as none

struct Mode {
  VectorXd location;
  MatrixXd precision;
  double value = 0.0;     // log density at the mode
  double log_mass = 0.0;  // of the Gaussian that touches the density there
};

// What one record says of the parameters, for one point of its history posterior.
class GivenHistory {
 public:
  GivenHistory(const Record& record, const HistoryParameters& point)
      : record_(record), likelihood_(record.model->given(point)) {}

  void add_log_likelihood(const MatrixXd& all, VectorXd& values) const {
    const MatrixXd x = record_.inputs(all);
    MatrixXd mean, variance;
    record_.emulator->predict_at(x, mean, variance);
    for (Index i = 0; i < x.cols(); ++i) {
      values[i] += record_.emulator->region().contains(x.col(i))
                       ? likelihood_.log_density(mean.row(i), variance.row(i))
                       : -std::numeric_limits<double>::infinity();
    }
  }

  // Value; adds gradient (central differences) and Gauss-Newton precision at the parameters `all`.
  double expand(const VectorXd& all, VectorXd& gradient, MatrixXd& precision) const {
    const VectorXd x = record_.inputs(all);
    const Expansion at = amiss::expand(*record_.emulator, x);
    const MatrixXd information = at.slope.transpose() * likelihood_.information(at.variance) * at.slope;
    // Of the emulated mean alone: the variance changes slowly.
    for (Index i = 0; i < x.size(); ++i) {
      const VectorXd step = kStep * at.slope.col(i);
      gradient[parameter(i)] += (likelihood_.log_density(at.mean + step, at.variance) -
                                 likelihood_.log_density(at.mean - step, at.variance)) /
                                (2.0 * kStep);
      for (Index j = 0; j < x.size(); ++j) precision(parameter(i), parameter(j)) += information(i, j);
    }
    return likelihood_.log_density(at.mean, at.variance);
  }

 private:
  static constexpr double kStep = 1e-4;  // of the gradient, in standard deviations of the prior

  Index parameter(Index input) const { return record_.parameters[static_cast<std::size_t>(input)]; }

  const Record& record_;
  CoefficientLikelihood likelihood_;
};

// The density of the parameters for one point of the history posteriors.
class Conditional {
 public:
  Conditional(const CalibrationTarget& target, const std::vector<HistoryParameters>& point, long& evaluations)
      : evaluations_(evaluations) {
    for (std::size_t k = 0; k < point.size(); ++k) records_.emplace_back(target.records()[k], point[k]);
  }

  VectorXd log_density(const MatrixXd& x) const {
    evaluations_ += x.cols();
    VectorXd values = VectorXd::Zero(x.cols());
    for (const GivenHistory& record : records_) record.add_log_likelihood(x, values);
    for (Index i = 0; i < x.cols(); ++i) values[i] -= 0.5 * x.col(i).squaredNorm();
    return values;
  }

  double expand(const VectorXd& x, VectorXd& gradient, MatrixXd& precision) const {
    evaluations_ += 2 * x.size() + 1;
    gradient = VectorXd::Zero(x.size());
    precision = MatrixXd::Zero(x.size(), x.size());
    double value = 0.0;
    for (const GivenHistory& record : records_) value += record.expand(x, gradient, precision);
    gradient -= x;
    precision.diagonal().array() += 1.0;
    return value - 0.5 * x.squaredNorm();
  }

  Mode climb(VectorXd x, int max_iterations) const {
    VectorXd gradient;
    MatrixXd precision;
    double damping = 1e-2, value = expand(x, gradient, precision);
    for (int iteration = 0; iteration < max_iterations && damping < 1e8; ++iteration) {
      MatrixXd damped = precision;
      damped.diagonal() *= 1.0 + damping;
      const VectorXd moved = (x + damped.llt().solve(gradient)).cwiseMax(-kFarthest).cwiseMin(kFarthest);
      const double there = log_density(moved)[0];
      if (!(there > value)) {
        damping *= 10.0;
        continue;
      }
      const bool settled = there - value < kSettled;
      x = moved;
      damping = std::max(1e-6, 0.1 * damping);
      value = expand(x, gradient, precision);
      if (settled) break;
    }
    const Eigen::LLT<MatrixXd> factor(precision);
    return {x, precision, value, value - factor.matrixLLT().diagonal().array().log().sum()};
  }

 private:
  static constexpr double kFarthest = 6.0;  // in standard deviations of the prior

  std::vector<GivenHistory> records_;
  long& evaluations_;
};

// Rows rounded to about 20 bits of their scales. The last bits of a mode hang on the unit of the basis, by
// way of differences and of where a search ends; chains that start from it would carry them on.
MatrixXd rounded(const MatrixXd& x, const VectorXd& scale) {
  const VectorXd unit = scale.unaryExpr([](double s) { return std::exp2(std::ceil(std::log2(s)) - 20.0); });
  return unit.asDiagonal() * MatrixXd((unit.cwiseInverse().asDiagonal() * x).array().round());
}

bool same(const Mode& a, const Mode& b) {
  const VectorXd apart = a.location - b.location;
  return apart.dot(a.precision * apart) < kSame * kSame;
}

// Where the regions of the emulators lie: that of the first record that has a parameter for input says where
// this one lies. Parameters of emulators that hold everywhere lie as their priors do.
struct Middle {
  bool everywhere = true;
  VectorXd centre;
  MatrixXd root;
};

Middle middle_of_regions(const CalibrationTarget& target) {
  const Index p = target.parameters();
  Middle middle{true, VectorXd::Zero(p), MatrixXd::Identity(p, p)};
  std::vector<bool> placed(static_cast<std::size_t>(p), false);
  for (const Record& record : target.records()) {
    const Region& region = record.emulator->region();
    std::vector<int> to;
    std::vector<Index> from;
    for (std::size_t i = 0; i < record.parameters.size(); ++i) {
      if (placed[static_cast<std::size_t>(record.parameters[i])]) continue;
      placed[static_cast<std::size_t>(record.parameters[i])] = true;
      to.push_back(record.parameters[i]);
      from.push_back(static_cast<Index>(i));
    }
    if (region.everywhere()) continue;
    middle.everywhere = false;
    const auto n = static_cast<Index>(to.size());
    MatrixXd root = region.root();
    if (n < root.rows()) {
      MatrixXd rows(n, root.cols());
      for (Index i = 0; i < n; ++i) rows.row(i) = root.row(from[static_cast<std::size_t>(i)]);
      root = (rows * rows.transpose()).llt().matrixL();
    }
    for (Index i = 0; i < n; ++i) {
      middle.centre[to[static_cast<std::size_t>(i)]] = region.centre()[from[static_cast<std::size_t>(i)]];
      for (Index j = 0; j < n; ++j)
        middle.root(to[static_cast<std::size_t>(i)], to[static_cast<std::size_t>(j)]) = root(i, j);
    }
  }
  return middle;
}

// Draws from N(0, I) (P x n) placed in the regions of the emulators. Where these differ, each record has the
// last word for some of the draws.
MatrixXd placed(const CalibrationTarget& target, const MatrixXd& normal) {
  const std::vector<Record>& records = target.records();
  MatrixXd points = normal;
  for (std::size_t last = 0; last < records.size(); ++last) {
    for (std::size_t k = 1; k <= records.size(); ++k) {
      const Record& record = records[(last + k) % records.size()];
      const MatrixXd own = record.emulator->region().place(record.inputs(normal));
      for (std::size_t p = 0; p < record.parameters.size(); ++p)
        for (auto i = static_cast<Index>(last); i < normal.cols(); i += static_cast<Index>(records.size()))
          points(record.parameters[p], i) = own(static_cast<Index>(p), i);
    }
  }
  return points;
}

// The distinct modes that searches from the best of the starts find for one point of the history posteriors.
std::vector<Mode> find_modes(const CalibrationTarget& target, const std::vector<HistoryParameters>& point,
                             const MatrixXd& starts, const ModeOptions& options, long& evaluations) {
  const Conditional conditional(target, point, evaluations);
  const VectorXd values = conditional.log_density(starts);
  std::vector<Index> order(static_cast<std::size_t>(options.starts));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return values[a] > values[b]; });
  std::vector<Mode> found;
  for (int k = 0; k < options.searches; ++k) {
    Mode mode = conditional.climb(starts.col(order[static_cast<std::size_t>(k)]), options.max_iterations);
    if (!std::isfinite(mode.log_mass)) continue;
    if (std::none_of(found.begin(), found.end(), [&](const Mode& other) { return same(other, mode); }))
      found.push_back(std::move(mode));
  }
  return found;
}

}  // namespace

ParameterModes parameter_modes(const CalibrationTarget& target,
                               const std::vector<std::vector<HistoryParameters>>& points,
                               const ModeOptions& options, const Context& context, Stream& stream) {
  const MatrixXd starts = placed(target, stream.normals(target.parameters(), options.starts));
  std::vector<std::vector<Mode>> at_point(points.size());
  std::vector<long> spent(points.size(), 0);
  parallel_for(static_cast<int>(points.size()), context, [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    at_point[k] = find_modes(target, points[k], starts, options, spent[k]);
  });
  std::vector<Mode> modes;
  std::vector<double> shares;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::vector<Mode>& found = at_point[i];
    VectorXd log_mass(static_cast<Index>(found.size()));
    for (std::size_t k = 0; k < found.size(); ++k) log_mass[static_cast<Index>(k)] = found[k].log_mass;
    for (std::size_t k = 0; k < found.size(); ++k) {
      const double share =
          normalised_exp(log_mass)[static_cast<Index>(k)] / static_cast<double>(points.size());
      const auto known =
          std::find_if(modes.begin(), modes.end(), [&](const Mode& m) { return same(m, found[k]); });
      if (known != modes.end()) {
        shares[static_cast<std::size_t>(known - modes.begin())] += share;
      } else {
        modes.push_back(found[k]);
        shares.push_back(share);
      }
    }
  }
  std::vector<StudentT> components;
  std::vector<double> weights;
  const double total = std::accumulate(shares.begin(), shares.end(), 0.0);
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const Eigen::LLT<MatrixXd> covariance(
        options.inflation * modes[k].precision.llt().solve(MatrixXd::Identity(starts.rows(), starts.rows())));
    const MatrixXd root = covariance.matrixL();
    const VectorXd sd = root.rowwise().norm();
    components.emplace_back(rounded(modes[k].location, sd), rounded(root, sd), options.dof);
    weights.push_back(0.5 * shares[k] / total + 0.5 / static_cast<double>(modes.size()));
  }
  VectorXd best = VectorXd::Zero(starts.rows());
  const auto highest = std::max_element(modes.begin(), modes.end(),
                                        [](const Mode& a, const Mode& b) { return a.log_mass < b.log_mass; });
  if (highest != modes.end()) best = highest->location;
  const Middle middle = middle_of_regions(target);
  if (!middle.everywhere) {  // which holds the posterior, whatever the searches found of it
    for (double& weight : weights) weight *= 1.0 - kRegionShare;
    components.emplace_back(middle.centre, middle.root, options.dof);
    weights.push_back(weights.empty() ? 1.0 : kRegionShare);
    if (highest == modes.end()) best = middle.centre;
  }
  if (components.empty()) {  // nowhere is the record possible: the prior stands
    components.emplace_back(VectorXd::Zero(starts.rows()), MatrixXd::Identity(starts.rows(), starts.rows()),
                            options.dof);
    weights.push_back(1.0);
  }
  return {StudentTMixture(std::move(components), std::move(weights)), std::move(best),
          std::accumulate(spent.begin(), spent.end(), 0L)};
}

}  // namespace amiss
