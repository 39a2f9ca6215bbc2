#pragma once
#include <cmath>

#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// log(sum(exp(x))) without overflow; -infinity if all of x is.
inline double log_sum_exp(const Eigen::VectorXd& x) {
  const double largest = x.maxCoeff();
  if (!std::isfinite(largest)) return largest;
  return largest + std::log((x.array() - largest).exp().sum());
}

/// The same of each row; -infinity where all of it is.
inline Eigen::VectorXd log_sum_exp_rows(const Eigen::MatrixXd& x) {
  Eigen::ArrayXd largest = x.rowwise().maxCoeff();
  const Eigen::ArrayXd shift = largest.isFinite().select(largest, 0.0);
  return shift + (x.array().colwise() - shift).exp().rowwise().sum().log();
}

inline double log_mean_exp(const Eigen::VectorXd& x) {
  return log_sum_exp(x) - std::log(static_cast<double>(x.size()));
}

/// exp(x) scaled to sum 1.
inline Eigen::VectorXd normalised_exp(const Eigen::VectorXd& x) { return (x.array() - log_sum_exp(x)).exp(); }

}  // namespace amiss
