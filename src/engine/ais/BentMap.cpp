#include "engine/ais/BentMap.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kLeading = 4, kDegree = 3;  // axes that others may bend along, and how
constexpr double kPointsPerTerm = 5.0;    // effective, at least
constexpr double kFarthest = 3.5;         // standard deviations beyond which a sheet goes on level
constexpr int kPowers = 6;                // of the first axis alone
constexpr double kClearly = 1.0;  // nats a point by which another first axis is better than the widest

// A product of at most kDegree of the leading coordinates, or a power of the first: an earlier one times one
// more of them.
struct Monomial {
  Index parent;      // -1: the constant
  int last, degree;  // the factor with the highest number
};

std::vector<Monomial> all_monomials(Index leading) {
  std::vector<Monomial> all{{-1, 0, 0}};
  for (std::size_t parent = 0; parent < all.size(); ++parent) {
    const Monomial from = all[parent];
    for (int i = from.last; i < leading && from.degree < kDegree; ++i)
      all.push_back({static_cast<Index>(parent), i, from.degree + 1});
  }
  const auto cube =
      std::find_if(all.begin(), all.end(), [](const Monomial& term) { return term.degree == kDegree; });
  Index power = cube - all.begin();
  for (int degree = kDegree + 1; degree <= kPowers; ++degree) {
    all.push_back({power, 0, degree});
    power = static_cast<Index>(all.size()) - 1;
  }
  return all;
}

Index leading_of(Index dimension) { return std::min<Index>(kLeading, dimension); }

struct Axes {
  MatrixXd vectors;   // columns
  VectorXd variance;  // of the points along each
};

// Principal axes of a covariance, widest first.
Axes principal_axes(const MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance);
  return {eigen.eigenvectors().rowwise().reverse(), eigen.eigenvalues().reverse().cwiseMax(0.0)};
}

// Orthogonal axes whose first is `first`: the others are the principal ones across it.
Axes with_first_axis(const VectorXd& first, const VectorXd& variance) {
  const Index k = first.size();
  const MatrixXd across = MatrixXd::Identity(k, k) - first * first.transpose();
  const Axes rest = principal_axes(across * variance.asDiagonal() * across);
  Axes axes{MatrixXd(k, k), VectorXd(k)};
  axes.vectors << first, rest.vectors.leftCols(k - 1);
  axes.variance << first.cwiseAbs2().dot(variance), rest.variance.head(k - 1);
  return axes;
}

// The direction along which a sheet bends: points of a parabola, however it is turned, lie where a polynomial
// of second degree is nearly constant, that of least variance; its quadratic part is largest along this
// direction. Coordinates t have unit variance.
VectorXd bending_direction(const MatrixXd& t, const VectorXd& weights) {
  const Index k = t.cols();
  MatrixXd terms(t.rows(), k + k * (k + 1) / 2);
  terms.leftCols(k) = t;
  for (Index a = 0, column = k; a < k; ++a) {
    for (Index b = a; b < k; ++b) terms.col(column++) = t.col(a).cwiseProduct(t.col(b));
  }
  const MatrixXd apart = terms.rowwise() - (terms.transpose() * weights).transpose();
  const VectorXd least =
      principal_axes(apart.transpose() * weights.asDiagonal() * apart).vectors.rightCols(1);
  MatrixXd square(k, k);
  for (Index a = 0, column = k; a < k; ++a) {
    for (Index b = a; b < k; ++b) square(a, b) = square(b, a) = least[column++] * (a == b ? 1.0 : 0.5);
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(square);
  const bool negative = -eigen.eigenvalues()[0] > eigen.eigenvalues()[k - 1];
  return eigen.eigenvectors().col(negative ? 0 : k - 1);
}

// How much denser the points are once all coordinates but the first are straightened by powers of it (log
// likelihood less the Schwarz penalty).
double gain_along_first(const MatrixXd& s, const VectorXd& variance, const VectorXd& weights) {
  const double effective = 1.0 / weights.squaredNorm();
  const MatrixXd weighted = weights.cwiseSqrt().asDiagonal() * s;
  MatrixXd design(s.rows(), kPowers + 1);
  design.col(0) = weights.cwiseSqrt();
  for (Index k = 1; k <= kPowers; ++k)
    design.col(k) = design.col(k - 1).cwiseProduct(s.col(0)) / std::sqrt(variance[0]);
  const MatrixXd left = weighted - design * Eigen::HouseholderQR<MatrixXd>(design).solve(weighted);
  double gain = -effective * std::log(variance[0]);
  for (Index j = 1; j < s.cols(); ++j) {
    const double straight = effective * std::log(left.col(j).squaredNorm()) + kPowers * std::log(effective);
    gain -= std::min(straight, effective * std::log(variance[j]));
  }
  return gain;
}

// Turns the leading principal axes so that the first is the one along which the others bend. A parabola may
// be longer along its axis than across it, or as long, but is a curve over the latter alone.
void turn(MatrixXd s, const VectorXd& weights, Axes& axes) {
  const Index k = leading_of(s.cols());
  const VectorXd variance = axes.variance.head(k);
  const double terms = static_cast<double>(std::max<Index>(kPowers, k + k * (k + 1) / 2));
  if (k < 2 || !(axes.variance.tail(1)[0] > 0) || terms * kPointsPerTerm * weights.squaredNorm() > 1.0)
    return;
  const MatrixXd leading = s.leftCols(k);
  const VectorXd per_sd = variance.cwiseSqrt().cwiseInverse();
  std::vector<VectorXd> firsts;
  for (Index j = 1; j < k; ++j) firsts.push_back(VectorXd::Unit(k, j));
  const MatrixXd standard = leading * per_sd.asDiagonal();
  firsts.push_back(bending_direction(standard, weights).cwiseProduct(per_sd).normalized());
  Axes best{MatrixXd::Identity(k, k), variance};
  double most = gain_along_first(s, axes.variance, weights) + kClearly / weights.squaredNorm();
  for (const VectorXd& first : firsts) {
    Axes turned = with_first_axis(first, variance);
    s.leftCols(k) = leading * turned.vectors;
    axes.variance.head(k) = turned.variance;
    const double gain = gain_along_first(s, axes.variance, weights);
    if (!(gain > most)) continue;
    most = gain;
    best = std::move(turned);
  }
  axes.vectors.leftCols(k) = (axes.vectors.leftCols(k) * best.vectors).eval();
  axes.variance.head(k) = best.variance;
}

}  // namespace

MatrixXd BentMap::monomials(const MatrixXd& s) const {
  const Index leading = leading_of(s.rows());
  MatrixXd t = s.topRows(leading).transpose() * per_sd_.head(leading).asDiagonal();
  t = t.unaryExpr([](double v) { return std::clamp(v, -kFarthest, kFarthest); });
  const std::vector<Monomial> all = all_monomials(leading);
  MatrixXd values(s.cols(), static_cast<Index>(all.size()));
  values.col(0).setOnes();
  for (Index k = 1; k < values.cols(); ++k) {
    const Monomial& term = all[static_cast<std::size_t>(k)];
    values.col(k) = values.col(term.parent).cwiseProduct(t.col(term.last));
  }
  return values;
}

BentMap BentMap::fit(const MatrixXd& x, const VectorXd& weights) {
  const Index d = x.rows();
  BentMap map;
  map.centre_ = x * weights;
  const MatrixXd apart = x.colwise() - map.centre_;
  Axes axes = principal_axes(apart * weights.asDiagonal() * apart.transpose());
  turn(apart.transpose() * axes.vectors, weights, axes);
  map.axes_ = axes.vectors;
  for (Index j = 0; j < d; ++j) {  // the sign of an axis is arbitrary
    Index largest = 0;
    map.axes_.col(j).cwiseAbs().maxCoeff(&largest);
    if (map.axes_(largest, j) < 0) map.axes_.col(j) *= -1.0;
  }
  const VectorXd& variance = axes.variance;
  map.per_sd_ = variance.unaryExpr([](double v) { return v > 0 ? 1.0 / std::sqrt(v) : 0.0; });
  const double effective = 1.0 / weights.squaredNorm();
  const MatrixXd s = map.axes_.transpose() * apart;
  const MatrixXd values = map.monomials(s);
  const std::vector<Monomial> all = all_monomials(leading_of(d));
  const VectorXd root = weights.cwiseSqrt();
  const MatrixXd pulled = root.asDiagonal() * MatrixXd(s.transpose());
  map.coefficients_ = MatrixXd::Zero(values.cols(), d);
  VectorXd best = VectorXd::Zero(d);  // gain over what is chosen so far
  for (int leading = 1; leading <= std::min<Index>(kLeading, d - 1); ++leading) {
    for (int degree = 2; degree <= (leading == 1 ? kPowers : kDegree); ++degree) {
      std::vector<Index> terms;
      for (std::size_t k = 0; k < all.size(); ++k) {
        if (all[k].last < leading && all[k].degree <= degree) terms.push_back(static_cast<Index>(k));
      }
      const double m = static_cast<double>(terms.size()) - 1.0;  // besides the constant
      if (m * kPointsPerTerm > effective || !(variance[leading - 1] > 0)) continue;
      MatrixXd design(values.rows(), static_cast<Index>(terms.size()));
      for (Index k = 0; k < design.cols(); ++k)
        design.col(k) = root.cwiseProduct(values.col(terms[static_cast<std::size_t>(k)]));
      const MatrixXd coefficients = Eigen::HouseholderQR<MatrixXd>(design).solve(pulled);
      const VectorXd left = (pulled - design * coefficients).colwise().squaredNorm().transpose();
      for (Index j = leading; j < d; ++j) {
        const double gain = effective * std::log(variance[j] / left[j]) - m * std::log(effective);
        if (!(left[j] > 0) || !(gain > best[j])) continue;
        best[j] = gain;
        map.coefficients_.col(j).setZero();
        for (Index k = 0; k < design.cols(); ++k)
          map.coefficients_(terms[static_cast<std::size_t>(k)], j) = coefficients(k, j);
      }
    }
  }
  return (best.array() > 0).any() ? map : BentMap();
}

MatrixXd BentMap::straight(const MatrixXd& x) const {
  if (!bends()) return x;
  const MatrixXd s = axes_.transpose() * (x.colwise() - centre_);
  return s - (monomials(s) * coefficients_).transpose();
}

MatrixXd BentMap::bent(const MatrixXd& z) const {
  if (!bends()) return z;
  MatrixXd s = z;
  // Leading coordinates may bend along those before them; all others along these alone.
  const Index leading = leading_of(z.rows()), rest = z.rows() - leading;
  for (Index j = 1; j < leading; ++j) {
    if (!coefficients_.col(j).isZero(0)) s.row(j) += (monomials(s) * coefficients_.col(j)).transpose();
  }
  s.bottomRows(rest) += (monomials(s) * coefficients_.rightCols(rest)).transpose();
  return (axes_ * s).colwise() + centre_;
}

VectorXd BentMap::gradient(const VectorXd& x, const VectorXd& by_z) const {
  if (!bends()) return by_z;
  const VectorXd s = axes_.transpose() * (x - centre_);
  const Index leading = leading_of(s.size());
  const VectorXd values = monomials(s).row(0).transpose();
  const std::vector<Monomial> all = all_monomials(leading);
  MatrixXd slopes = MatrixXd::Zero(values.size(), leading);  // of the monomials
  for (Index k = 1; k < values.size(); ++k) {
    const Monomial& term = all[static_cast<std::size_t>(k)];
    const double at = s[term.last] * per_sd_[term.last];
    const bool level = std::abs(at) > kFarthest;
    slopes.row(k) = slopes.row(term.parent) * std::clamp(at, -kFarthest, kFarthest);
    if (!level) slopes(k, term.last) += values[term.parent] * per_sd_[term.last];
  }
  VectorXd by_s = by_z;
  by_s.head(leading) -= slopes.transpose() * (coefficients_ * by_z);
  return axes_ * by_s;
}

}  // namespace amiss
