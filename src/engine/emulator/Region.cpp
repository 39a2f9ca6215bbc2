#include "engine/emulator/Region.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Region::Region(VectorXd centre, MatrixXd root, double radius, std::vector<bool> uniform)
    : centre_(std::move(centre)), root_(std::move(root)), radius_(radius), uniform_(std::move(uniform)) {
  if (centre_.size() == 0 || root_.rows() != centre_.size() || root_.cols() != centre_.size() ||
      static_cast<Index>(uniform_.size()) != centre_.size())
    throw std::invalid_argument("region: the root needs one row and column for each parameter");
  if (!(radius > 0) || !std::isfinite(radius) || !centre_.allFinite() || !root_.allFinite())
    throw std::invalid_argument("region: centre, root and radius must be finite, the radius positive");
  factor_.compute(root_);
  if (!(factor_.matrixLU().diagonal().cwiseAbs().minCoeff() > 0) || !factor_.inverse().allFinite())
    throw std::invalid_argument("region: the root is singular");
  middle_.resize(centre_.size());
  slope_.resize(centre_.size());
  for (Index i = 0; i < centre_.size(); ++i) {
    const double spread = std::sqrt(1.0 + root_.row(i).squaredNorm()), h = -std::abs(centre_[i]) / spread;
    middle_[i] = normal_cdf(h);
    slope_[i] = normal_density(h) / spread;
    if (uniform_[static_cast<std::size_t>(i)] && !(slope_[i] > 0))
      throw std::invalid_argument("region: it lies where a uniform prior has no mass");
  }
}

MatrixXd Region::standardised(const MatrixXd& x) const { return factor_.solve(x.colwise() - centre_); }

MatrixXd Region::straightened(const MatrixXd& x) const {
  MatrixXd s = x;
  for (Index i = 0; i < x.rows(); ++i) {
    if (!uniform_[static_cast<std::size_t>(i)]) continue;
    // By the side on which Phi is small, where it is exact.
    const double side = centre_[i] > 0 ? -1.0 : 1.0;
    s.row(i) = x.row(i).unaryExpr([&](double value) {
      return centre_[i] + side * (normal_cdf(side * value) - middle_[i]) / slope_[i];
    });
  }
  return s;
}

bool Region::contains(const Eigen::Ref<const VectorXd>& x) const {
  return everywhere() || standardised(x).norm() <= radius_;
}

MatrixXd Region::inputs(const MatrixXd& x) const {
  if (everywhere()) return x.transpose().unaryExpr(&normal_cdf);
  return (standardised(straightened(x)).transpose().array() / (2.0 * radius_) + 0.5).matrix();
}

MatrixXd Region::pulled_back(const MatrixXd& x, const MatrixXd& by_input) const {
  if (everywhere()) return by_input.transpose().cwiseProduct(x.unaryExpr(&normal_density));
  MatrixXd gradient = (by_input * factor_.inverse()).transpose() / (2.0 * radius_);
  for (Index i = 0; i < x.rows(); ++i) {
    if (uniform_[static_cast<std::size_t>(i)])
      gradient.row(i).array() *= x.row(i).unaryExpr(&normal_density).array() / slope_[i];
  }
  return gradient;
}

MatrixXd Region::place(const MatrixXd& normal) const {
  if (everywhere()) return normal;
  MatrixXd inside = normal;
  for (Index i = 0; i < inside.cols(); ++i) {
    const double length = inside.col(i).norm();
    if (length > 0.99 * radius_) inside.col(i) *= 0.99 * radius_ / length;
  }
  return (root_ * inside).colwise() + centre_;
}

}  // namespace amiss
