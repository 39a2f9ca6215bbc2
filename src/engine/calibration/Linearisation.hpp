#pragma once
#include "engine/discrepancy/HistoryTarget.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss {

/// The simulator as the Gaussian with the mean and the covariance that its emulator has over its region, by
/// 512 points of it (Region::place()) that are always the same: how far a simulator can move is part of the
/// model, not of a run.
GaussianSimulator over_region(const Emulator& emulator);

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
