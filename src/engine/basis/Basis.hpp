#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// How many basis vectors to keep. Both rules are worked out; the larger number is kept.
struct BasisOptions {
  double explained = 0.99;      ///< share of the variance of the centred runs, in (0, 1]
  double noise_sd = 0.0;        ///< standard deviation of the measurement noise; 0 leaves the second rule out
  double noise_fraction = 0.2;  ///< discarded RMS per output at most this share of the noise
  int max_vectors = 30;         ///< upper limit, the vector of ones included

  void check() const;
};

/// Basis of the simulation space (method: section 1 of the paper). Every run is centred on its own mean over
/// time; the left singular vectors of the centred runs, scaled by their singular values, and a last column of
/// ones are the basis K (N x Q), whose columns are orthogonal. Run m is approximated by K w_m; the last
/// coefficient is the mean of the run.
struct Basis {
  Eigen::MatrixXd vectors;          ///< K, N x Q
  Eigen::MatrixXd coefficients;     ///< M x Q, row m is w_m
  Eigen::VectorXd singular_values;  ///< of the centred runs, all min(N, M)
  double explained = 0.0;           ///< share of the variance of the centred runs that is kept
  double discarded_rms = 0.0;       ///< RMS per output of the part of the runs outside the basis
  double discarded_ss = 0.0;        ///< sum_m y_m'(I - P_K) y_m

  Eigen::Index size() const { return vectors.cols(); }
};

/// @param outputs N x M, one run per column, all finite; M >= 3.
/// @throws std::invalid_argument if the runs do not differ.
Basis make_basis(const Eigen::Ref<const Eigen::MatrixXd>& outputs, const BasisOptions& options);

}  // namespace amiss
