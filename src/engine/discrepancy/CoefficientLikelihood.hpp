#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// What the record says about the simulator's coefficients w at one point of the history posterior, its
/// covariance V = sigma^2 C + discrepancy known: with r = y - K w0,
///     A = K'V^-1 K,  c = K'V^-1 r,  log N(y; K w0, V),
/// from which the density of y for any w ~ N(m, diag(S)) costs O(Q^3):
///     log N(y; K m, V + K S K') = log N(y; K w0, V) + d'c - 1/2 d'A d
///                                 - 1/2 log|F| + 1/2 |F^-1/2 S^1/2 (c - A d)|^2,
/// d = m - w0, F = I + S^1/2 A S^1/2.
class CoefficientLikelihood {
 public:
  CoefficientLikelihood(Eigen::VectorXd reference, Eigen::MatrixXd information, Eigen::VectorXd score,
                        double log_density);

  double log_density(const Eigen::VectorXd& mean, const Eigen::VectorXd& variance) const;
  /// Gradient of log N(y; K w, V) with respect to w: c - A (w - w0).
  Eigen::VectorXd score(const Eigen::VectorXd& w) const;
  /// The same record for coefficients that vary about w with these variances: of N(y; K w, V + K S K').
  CoefficientLikelihood blurred(const Eigen::VectorXd& variance) const;
  /// K' (V + K S K')^-1 K: how firmly the coefficients' mean is seen.
  Eigen::MatrixXd information(const Eigen::VectorXd& variance) const;
  /// Of w given the record, if w ~ N(0, I) before: covariance (I + A)^-1, mean (I + A)^-1 (c + A w0).
  struct Posterior {
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
  };
  Posterior posterior() const;

 private:
  Eigen::LLT<Eigen::MatrixXd> factor(const Eigen::VectorXd& root) const;  // of F

  Eigen::VectorXd reference_;    // w0
  Eigen::MatrixXd information_;  // A
  Eigen::VectorXd score_;        // c
  double log_density_;
};

}  // namespace amiss
