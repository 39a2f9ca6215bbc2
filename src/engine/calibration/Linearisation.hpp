#pragma once
#include "engine/discrepancy/HistoryTarget.hpp"
#include "engine/emulator/Emulator.hpp"
#include "engine/random/Stream.hpp"

namespace amiss {

/// The simulator as the Gaussian with the mean and the covariance that its emulator has over the priors of
/// the parameters, by 512 points drawn from them.
GaussianSimulator over_priors(const Emulator& emulator, Stream stream);

/// The simulator as the straight line that touches its emulator at x0, coordinates N(0, I) of the parameters:
///     w = w'(z0) + W (x - x0) + (emulator's error at z0),  z = Phi(x), W = dw'/dx by central differences.
GaussianSimulator tangent_at(const Emulator& emulator, const Eigen::VectorXd& x0);

/// Emulated means (Q) and their slopes W (Q x P) at x0; variances (Q) too.
struct Expansion {
  Eigen::VectorXd mean, variance;
  Eigen::MatrixXd slope;
};
Expansion expand(const Emulator& emulator, const Eigen::VectorXd& x0);

}  // namespace amiss
