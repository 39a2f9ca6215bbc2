#include "engine/ais/BentMap.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kLeading = 4, kDegree = 3;  // axes that others may bend along, and how
constexpr double kPointsPerTerm = 5.0;    // effective, at least
constexpr double kFarthest = 3.5;         // standard deviations beyond which a sheet goes on level

// A product of at most kDegree of the leading coordinates: an earlier one times one more of them.
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
  return all;
}

Index leading_of(Index dimension) { return std::min<Index>(kLeading, dimension); }

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
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(apart * weights.asDiagonal() * apart.transpose());
  map.axes_ = eigen.eigenvectors().rowwise().reverse();
  for (Index j = 0; j < d; ++j) {  // the sign of an axis is arbitrary
    Index largest = 0;
    map.axes_.col(j).cwiseAbs().maxCoeff(&largest);
    if (map.axes_(largest, j) < 0) map.axes_.col(j) *= -1.0;
  }
  const VectorXd variance = eigen.eigenvalues().reverse().cwiseMax(0.0);
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
    for (int degree = 2; degree <= kDegree; ++degree) {
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
