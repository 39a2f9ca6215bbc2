#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// A posterior to be sampled and normalised. Its coordinates x have the prior N(0, I): u = Phi(x) is uniform on
/// the unit cube, and a prior's quantile function maps u onto the parameters.
class Target {
 public:
  virtual ~Target() = default;
  virtual Eigen::Index dimension() const = 0;
  /// Log-likelihood of each column of x (dimension x n). Called from several threads at once. A value that is not
  /// finite counts as likelihood zero.
  virtual Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const = 0;
};

}  // namespace amiss
