#include "engine/ais/SkewedMixture.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace amiss {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Probabilities at which a distribution is matched, and the standard normal quantiles.
const double kProbability[] = {0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98};
const double kNormal[] = {-2.053749, -1.281552, -0.674490, 0.0, 0.674490, 1.281552, 2.053749};
constexpr Index kKnots = 7;
constexpr double kLeastPoints = 100.0;  // effective, from which quantiles can be told

// The piece of a broken line on which v lies: from knot i to knot i + 1, the outer ones without end.
template <class Knots>
Index piece(const Knots& knots, double v) {
  Index i = 0;
  while (i + 2 < kKnots && v > knots[i + 1]) ++i;
  return i;
}

// Quantiles at p (increasing) of weighted values, linear between the middles of their weights.
ArrayXd weighted_quantiles(const VectorXd& values, const VectorXd& weights, const ArrayXd& p) {
  const Index n = values.size();
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return values[a] < values[b]; });
  ArrayXd out(p.size());
  double below = 0.0, middle_before = 0.0, value_before = values[order.front()];
  Index k = 0;
  for (Index i : order) {
    const double middle = below + 0.5 * weights[i];
    for (; k < p.size() && p[k] <= middle; ++k) {
      const double share = middle > middle_before ? (p[k] - middle_before) / (middle - middle_before) : 1.0;
      out[k] = value_before + share * (values[i] - value_before);
    }
    below += weights[i];
    middle_before = middle;
    value_before = values[i];
  }
  for (; k < p.size(); ++k) out[k] = value_before;
  return out;
}

VectorXd steps(const VectorXd& knots) { return knots.tail(kKnots - 1) - knots.head(kKnots - 1); }

// Where the knots of one coordinate lie: at the quantiles of the values or, if these give no reason for that
// (Schwarz criterion), at those of a normal distribution.
VectorXd fitted_knots(const VectorXd& values, const VectorXd& weights) {
  const VectorXd even = Eigen::Map<const VectorXd>(kNormal, kKnots);
  const VectorXd knots =
      weighted_quantiles(values, weights, Eigen::Map<const ArrayXd>(kProbability, kKnots)).matrix();
  if (!(steps(knots).minCoeff() > 0)) return even;
  const double effective = 1.0 / weights.squaredNorm(), mean = weights.dot(values);
  const double sd = std::sqrt(weights.dot(VectorXd((values.array() - mean).square())));
  const VectorXd slopes = steps(even).cwiseQuotient(steps(knots));
  double gain = std::log(sd) + 0.5;  // in log density over a normal one, of a point
  for (Index c = 0; c < values.size(); ++c) {
    const Index i = piece(knots, values[c]);
    const double z = even[i] + (values[c] - knots[i]) * slopes[i];
    gain += weights[c] * (std::log(slopes[i]) - 0.5 * z * z);
  }
  const double more = static_cast<double>(kKnots - 2);  // parameters
  if (effective * gain > 0.5 * more * std::log(effective)) return knots;
  return mean + (sd * even).array();
}

}  // namespace

SkewMap SkewMap::fit(const MatrixXd& x, const VectorXd& weights) {
  SkewMap map;
  map.even_knots_ = Eigen::Map<const VectorXd>(kNormal, kKnots);
  map.knots_.resize(kKnots, x.rows());
  map.slopes_.resize(kKnots - 1, x.rows());
  for (Index j = 0; j < x.rows(); ++j) {
    map.knots_.col(j) = fitted_knots(x.row(j).transpose(), weights);
    map.slopes_.col(j) = steps(map.even_knots_).cwiseQuotient(steps(map.knots_.col(j)));
  }
  return map;
}

MatrixXd SkewMap::even(const MatrixXd& x) const {
  if (knots_.rows() == 0) return x;
  MatrixXd z(x.rows(), x.cols());
  for (Index j = 0; j < x.rows(); ++j) {
    const auto knots = knots_.col(j);
    for (Index c = 0; c < x.cols(); ++c) {
      const Index i = piece(knots, x(j, c));
      z(j, c) = even_knots_[i] + (x(j, c) - knots[i]) * slopes_(i, j);
    }
  }
  return z;
}

VectorXd SkewMap::skewed(const VectorXd& z) const {
  if (knots_.rows() == 0) return z;
  VectorXd x(z.size());
  for (Index j = 0; j < z.size(); ++j) {
    const auto knots = knots_.col(j);
    const Index i = piece(even_knots_, z[j]);
    x[j] = knots[i] + (z[j] - even_knots_[i]) / slopes_(i, j);
  }
  return x;
}

MatrixXd SkewMap::slope(const MatrixXd& x) const {
  MatrixXd slope = MatrixXd::Ones(x.rows(), x.cols());
  if (knots_.rows() == 0) return slope;
  for (Index j = 0; j < x.rows(); ++j) {
    const auto knots = knots_.col(j);
    for (Index c = 0; c < x.cols(); ++c) slope(j, c) = slopes_(piece(knots, x(j, c)), j);
  }
  return slope;
}

SkewedMixture SkewedMixture::fit(const MatrixXd& x, const VectorXd& weights, int max_components, double dof,
                                 Stream& stream) {
  if (1.0 / weights.squaredNorm() < kLeastPoints)
    return SkewedMixture(SkewMap(), StudentTMixture::fit(x, weights, max_components, dof, stream));
  const auto fitted = [&](BentMap bend) {
    const MatrixXd z = bend.straight(x);
    SkewMap map = SkewMap::fit(z, weights);
    const MatrixXd even = map.even(z);
    return SkewedMixture(std::move(bend), std::move(map),
                         StudentTMixture::fit(even, weights, max_components, dof, stream));
  };
  SkewedMixture plain = fitted(BentMap());
  BentMap bend = BentMap::fit(x, weights);
  if (!bend.bends()) return plain;
  // Bending turns the axes, in which each coordinate was made even: whichever comes closer to the points.
  SkewedMixture bent = fitted(std::move(bend));
  const double gain = weights.dot(bent.log_densities(x) - plain.log_densities(x));
  return gain > 0 ? bent : plain;
}

VectorXd SkewedMixture::log_densities(const MatrixXd& x) const {
  const MatrixXd z = bend_.straight(x);
  return mixture_.log_densities(map_.even(z)) +
         map_.slope(z).array().log().colwise().sum().transpose().matrix();
}

VectorXd SkewedMixture::gradient(const VectorXd& x) const {
  const VectorXd z = bend_.straight(x);
  return bend_.gradient(x, VectorXd(map_.slope(z)).cwiseProduct(mixture_.gradient(map_.even(z))));
}

VectorXd SkewedMixture::draw(Stream& stream) const { return bend_.bent(map_.skewed(mixture_.draw(stream))); }

}  // namespace amiss
