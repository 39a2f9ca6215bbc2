#include "engine/attribution/VarianceIndex.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "engine/linalg/GaussianKernel.hpp"
#include "engine/parallel/parallel_for.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kTrace = 1e-8;  // of the noise: what the low rank may leave out

std::vector<Index> sorted_order(const VectorXd& values) {
  std::vector<Index> order(static_cast<std::size_t>(values.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return values[a] < values[b]; });
  return order;
}

double weighted_median(const VectorXd& values, const VectorXd& weights) {
  const double half = 0.5 * weights.sum();
  double cumulative = 0.0;
  for (Index i : sorted_order(values)) {
    cumulative += weights[i];
    if (cumulative >= half) return values[i];
  }
  return values.maxCoeff();
}

}  // namespace

Interval highest_density_interval(const VectorXd& values, const VectorXd& weights, double probability) {
  if (values.size() != weights.size() || values.size() == 0)
    throw std::invalid_argument("interval: as many weights as values are needed");
  if (!(probability > 0 && probability < 1))
    throw std::invalid_argument("interval: the probability lies in (0, 1)");
  const double total = weights.sum();
  if (!(weights.minCoeff() >= 0) || !(total > 0) || !std::isfinite(total))
    throw std::invalid_argument("interval: weights must not be negative, nor all zero");
  std::vector<double> v, w;
  for (Index i : sorted_order(values)) {
    v.push_back(values[i]);
    w.push_back(weights[i] / total);
  }
  const double needed = probability - 1e-12;  // rounding of the sum
  Interval best{v.front(), v.back()};
  double inside = 0.0;
  for (std::size_t from = 0, to = 0; from < v.size(); inside -= w[from], ++from) {
    while (to < v.size() && inside < needed) inside += w[to++];
    if (inside < needed) break;
    if (v[to - 1] - v[from] < best.upper - best.lower) best = {v[from], v[to - 1]};
  }
  return best;
}

// With F = PL, P = I - OO', and c = 1 / (amplitude lambda*): H v_s = F (F'F + c I)^-1 F' Hv.
VectorXd variance_shares(const KernelModel& model, const KernelParameters& p) {
  const MatrixXd& basis = model.orthonormal();
  const double noise = 1.0 / (p.amplitude * p.lambda);
  const double total = model.outside().squaredNorm();
  VectorXd shares = VectorXd::Zero(model.conditions() + 1);
  if (!(total > 0)) return shares;
  for (int s = 0; s <= model.conditions(); ++s) {
    std::vector<Index> columns;
    for (std::size_t j = 0; j < model.condition().size(); ++j) {
      if (model.condition()[j] == s) columns.push_back(static_cast<Index>(j));
    }
    MatrixXd x(model.size(), static_cast<Index>(columns.size()));
    for (std::size_t j = 0; j < columns.size(); ++j) {
      x.col(static_cast<Index>(j)) = std::sqrt(p.decay[s]) * model.columns().col(columns[j]);
    }
    PivotedCholesky cholesky(std::move(x));
    cholesky.extend(kTrace * noise, model.size());
    MatrixXd factor = cholesky.root();
    factor -= basis * (basis.transpose() * factor);
    MatrixXd gram = factor.transpose() * factor;
    gram.diagonal().array() += noise;
    const VectorXd weights = gram.llt().solve(factor.transpose() * model.outside());
    shares[s] = std::min(1.0, (factor * weights).squaredNorm() / total);
  }
  return shares;
}

VarianceIndex variance_index(const KernelModel& model, const std::vector<KernelParameters>& draws,
                             const VectorXd& weights, double probability, const Context& context) {
  if (static_cast<Index>(draws.size()) != weights.size())
    throw std::invalid_argument("variance index: as many weights as draws are needed");
  const Index s = model.conditions();
  VarianceIndex index;
  index.share.resize(static_cast<Index>(draws.size()), s + 1);
  parallel_for(static_cast<int>(draws.size()), context, [&](int i) {
    index.share.row(i) = variance_shares(model, draws[static_cast<std::size_t>(i)]).transpose();
  });
  index.difference = index.share.leftCols(s).colwise() - index.share.col(s);
  index.mean = index.difference.transpose() * weights / weights.sum();
  index.median.resize(s);
  for (Index k = 0; k < s; ++k) {
    const VectorXd difference = index.difference.col(k);
    index.median[k] = weighted_median(difference, weights);
    index.hdi.push_back(highest_density_interval(difference, weights, probability));
    index.significant.push_back(index.hdi.back().lower > 0 || index.hdi.back().upper < 0);
  }
  index.rank.resize(static_cast<std::size_t>(s));
  const std::vector<Index> order = sorted_order(-index.median);
  for (std::size_t k = 0; k < order.size(); ++k) {
    index.rank[static_cast<std::size_t>(order[k])] = static_cast<int>(k) + 1;
  }
  return index;
}

}  // namespace amiss
