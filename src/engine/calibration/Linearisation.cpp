#include "engine/calibration/Linearisation.hpp"

#include <cmath>

#include "engine/random/Stream.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kPoints = 512;
constexpr std::uint64_t kSeed = 20;
constexpr double kDifference = 3e-3;  // in standard deviations of the prior

// A square root R R' = covariance. The coefficients differ by orders of magnitude: that of the correlation is
// found.
MatrixXd root_of(const MatrixXd& covariance) {
  const VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseMax(1e-300);
  const VectorXd inverse = scale.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(inverse.asDiagonal() * covariance *
                                                      inverse.asDiagonal());
  return scale.asDiagonal() * eigen.eigenvectors() *
         eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

}  // namespace

GaussianSimulator over_region(const Emulator& emulator) {
  Stream stream(kSeed, kTangentPoints, 0);
  MatrixXd mean, variance;
  emulator.predict_at(emulator.region().place(stream.normals(emulator.n_inputs(), kPoints)), mean, variance);
  GaussianSimulator simulator;
  simulator.mean = mean.colwise().mean().transpose();
  mean.rowwise() -= simulator.mean.transpose();
  MatrixXd covariance = mean.transpose() * mean / static_cast<double>(kPoints - 1);
  covariance.diagonal() += variance.colwise().mean().transpose();
  simulator.root = root_of(covariance);
  return simulator;
}

Expansion expand(const Emulator& emulator, const VectorXd& x0) {
  const Index d = x0.size();
  MatrixXd points(d, 2 * d + 1), mean, variance;
  points.colwise() = x0;
  points.leftCols(d).diagonal().array() += kDifference;
  points.middleCols(d, d).diagonal().array() -= kDifference;
  emulator.predict_at(points, mean, variance);
  return {mean.row(2 * d).transpose(), variance.row(2 * d).transpose(),
          (mean.topRows(d) - mean.middleRows(d, d)).transpose() / (2.0 * kDifference)};
}

GaussianSimulator tangent_at(const Emulator& emulator, const VectorXd& x0) {
  const Expansion at = expand(emulator, x0);
  GaussianSimulator simulator;
  simulator.mean = at.mean - at.slope * x0;
  MatrixXd covariance = at.slope * at.slope.transpose();
  covariance.diagonal() += at.variance;
  simulator.root = root_of(covariance);
  return simulator;
}

}  // namespace amiss
