#pragma once
#include <cmath>

#include "helpers.hpp"

/// What the tests of one Gaussian process, of the search for its mode and of the emulator share.
namespace amiss::test {

/// Equation (2) as it stands in the paper, without noise.
inline MatrixXd smooth_covariance(const MatrixXd& a, const MatrixXd& b, double amplitude,
                                  const VectorXd& beta) {
  MatrixXd c(a.rows(), b.rows());
  for (Index i = 0; i < a.rows(); ++i) {
    for (Index j = 0; j < b.rows(); ++j) {
      c(i, j) = amplitude;
      for (Index p = 0; p < beta.size(); ++p)
        c(i, j) *= std::pow(beta[p], 4 * std::pow(a(i, p) - b(j, p), 2));
    }
  }
  return c;
}

/// Of errors in units of their own standard deviations.
inline double mean_square(const VectorXd& error, const VectorXd& variance) {
  return (error.array().square() / variance.array()).mean();
}

}  // namespace amiss::test
