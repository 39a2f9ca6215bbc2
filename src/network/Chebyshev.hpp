#pragma once

#include <functional>

#include "engine/linalg/Eigen.hpp"

namespace amiss::network {

/// Chebyshev series of a function from [lower, upper] to R^L (Trefethen 2013, Approximation Theory and
/// Approximation Practice, chapters 3 and 4). The degree is doubled from 8 to 256 until the last coefficients
/// are below 1e-12 of the largest; `converged()` says whether they came there.
class Chebyshev {
 public:
  Chebyshev(double lower, double upper, const std::function<Eigen::VectorXd(double)>& f);

  bool converged() const { return converged_; }

  /// Values at points of the interval, one a row: points x L.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> operator()(
      const Eigen::VectorXd& at) const;

 private:
  double middle_, half_;
  Eigen::MatrixXd coefficients_;  // degree + 1 x L
  bool converged_ = false;
};

}  // namespace amiss::network
