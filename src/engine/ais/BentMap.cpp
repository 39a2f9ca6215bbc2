#include "engine/ais/BentMap.hpp"

#include <algorithm>
#include <cmath>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kLeading = 4;             // axes that others may bend along
constexpr double kPointsPerTerm = 5.0;  // effective, at least
constexpr double kFarthest = 3.5;       // standard deviations beyond which a sheet goes on level

}  // namespace

Index BentMap::Terms::count() const {
  // Monomials in `leading` variables of total degree 1 ... degree: C(leading + degree, degree) - 1.
  Index n = 1;
  for (int k = 1; k <= degree; ++k) n = n * (leading + k) / k;
  return n - 1;
}

VectorXd BentMap::Terms::values(const VectorXd& t, MatrixXd* slopes) const {
  VectorXd out(count());
  if (slopes) slopes->setZero(count(), leading);
  Index at = 0;
  for (int i = 0; i < leading; ++i) {
    if (slopes) (*slopes)(at, i) = 1.0;
    out[at++] = t[i];
  }
  for (int i = 0; i < leading && degree >= 2; ++i) {
    for (int j = i; j < leading; ++j) {
      if (slopes) {
        (*slopes)(at, i) += t[j];
        (*slopes)(at, j) += t[i];
      }
      out[at++] = t[i] * t[j];
    }
  }
  for (int i = 0; i < leading && degree >= 3; ++i) {
    for (int j = i; j < leading; ++j) {
      for (int k = j; k < leading; ++k) {
        if (slopes) {
          (*slopes)(at, i) += t[j] * t[k];
          (*slopes)(at, j) += t[i] * t[k];
          (*slopes)(at, k) += t[i] * t[j];
        }
        out[at++] = t[i] * t[j] * t[k];
      }
    }
  }
  return out;
}

VectorXd BentMap::standard(const VectorXd& s, VectorXd* slope) const {
  const Index n = std::min<Index>(kLeading, s.size());
  VectorXd t(n);
  if (slope) slope->resize(n);
  for (Index i = 0; i < n; ++i) {
    const double v = s[i] / sd_[i];
    t[i] = std::clamp(v, -kFarthest, kFarthest);
    if (slope) (*slope)[i] = t[i] == v ? 1.0 / sd_[i] : 0.0;
  }
  return t;
}

double BentMap::shift(Index j, const VectorXd& s) const {
  const auto k = static_cast<std::size_t>(j);
  if (terms_[k].degree == 0) return 0.0;
  const VectorXd& c = coefficients_[k];
  return c[0] + c.tail(c.size() - 1).dot(terms_[k].values(standard(s)));
}

BentMap BentMap::fit(const MatrixXd& x, const VectorXd& weights) {
  const Index d = x.rows(), n = x.cols();
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
  map.sd_ = eigen.eigenvalues().reverse().cwiseMax(0.0).cwiseSqrt();
  map.terms_.resize(static_cast<std::size_t>(d));
  map.coefficients_.resize(static_cast<std::size_t>(d));
  const double effective = 1.0 / weights.squaredNorm();
  const MatrixXd s = map.axes_.transpose() * apart;
  const VectorXd root = weights.cwiseSqrt();
  bool bent_at_all = false;
  for (int leading = 1; leading <= std::min<Index>(kLeading, d - 1); ++leading) {
    for (int degree = 2; degree <= 3; ++degree) {
      const Terms terms{leading, degree};
      const Index m = terms.count();
      if (static_cast<double>(m) * kPointsPerTerm > effective || !(map.sd_[leading - 1] > 0)) continue;
      MatrixXd design(n, m + 1);
      for (Index i = 0; i < n; ++i) design.row(i) << 1.0, terms.values(map.standard(s.col(i))).transpose();
      const Eigen::HouseholderQR<MatrixXd> qr(root.asDiagonal() * design);
      const MatrixXd coefficients = qr.solve(root.asDiagonal() * MatrixXd(s.transpose()));
      const MatrixXd left = s.transpose() - design * coefficients;
      for (Index j = leading; j < d; ++j) {
        const auto k = static_cast<std::size_t>(j);
        const double before = map.sd_[j] * map.sd_[j];
        const double after = (weights.array() * left.col(j).array().square()).sum();
        const auto gain = [&](double variance, Index terms_used) {
          return effective * std::log(before / variance) -
                 static_cast<double>(terms_used) * std::log(effective);
        };
        double best = 0.0;
        if (map.terms_[k].degree > 0) {
          const VectorXd old = map.coefficients_[k];
          double variance = 0.0;
          for (Index i = 0; i < n; ++i) {
            const double r = s(j, i) - map.shift(j, s.col(i));
            variance += weights[i] * r * r;
          }
          best = gain(variance, old.size() - 1);
        }
        if (!(after > 0) || !(gain(after, m) > best)) continue;
        map.terms_[k] = terms;
        map.coefficients_[k] = coefficients.col(j);
        bent_at_all = true;
      }
    }
  }
  return bent_at_all ? map : BentMap();
}

VectorXd BentMap::straight(const VectorXd& x) const {
  if (!bends()) return x;
  const VectorXd s = axes_.transpose() * (x - centre_);
  VectorXd z = s;
  for (Index j = 0; j < z.size(); ++j) z[j] -= shift(j, s);
  return z;
}

VectorXd BentMap::bent(const VectorXd& z) const {
  if (!bends()) return z;
  VectorXd s = z;
  for (Index j = 0; j < s.size(); ++j) s[j] += shift(j, s);  // of coordinates before it alone
  return axes_ * s + centre_;
}

VectorXd BentMap::gradient(const VectorXd& x, const VectorXd& by_z) const {
  if (!bends()) return by_z;
  const VectorXd s = axes_.transpose() * (x - centre_);
  VectorXd by_s = by_z, inner;
  const VectorXd t = standard(s, &inner);
  for (Index j = 0; j < s.size(); ++j) {
    const auto k = static_cast<std::size_t>(j);
    if (terms_[k].degree == 0) continue;
    MatrixXd slopes;
    terms_[k].values(t, &slopes);
    const VectorXd c = coefficients_[k].tail(coefficients_[k].size() - 1);
    const VectorXd own = slopes.transpose() * c;
    for (int i = 0; i < terms_[k].leading; ++i) by_s[i] -= by_z[j] * own[i] * inner[i];
  }
  return axes_ * by_s;
}

}  // namespace amiss
