#include <gtest/gtest.h>

#include "calibration_helpers.hpp"
#include "engine/calibration/Linearisation.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

// With a large nugget, so that the emulator's own variance is seen.
TEST(Linearisation, OverThePriorsItHasTheEmulatorsMomentsThere) {
  const Emulator emulator = make_emulator(2, 0.0);
  const GaussianSimulator simulator = over_region(emulator);
  constexpr Index n = 150 * 150;  // midpoints of the unit square
  MatrixXd u(n, 2), mean, variance;
  for (Index i = 0; i < n; ++i)
    u.row(i) << (static_cast<double>(i % 150) + 0.5) / 150, (static_cast<double>(i / 150) + 0.5) / 150;
  emulator.predict(u, mean, variance);
  const VectorXd centre = mean.colwise().mean();
  mean.rowwise() -= centre.transpose();
  MatrixXd covariance = mean.transpose() * mean / n;
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  // Four standard errors of 512 points.
  EXPECT_LT((simulator.mean - centre).cwiseQuotient(sd).cwiseAbs().maxCoeff(), 4 / std::sqrt(512.0));
  covariance.diagonal() += variance.colwise().mean().transpose();
  EXPECT_LT((simulator.root * simulator.root.transpose() - covariance)
                .cwiseQuotient(VectorXd(covariance.diagonal().cwiseSqrt()) *
                               covariance.diagonal().cwiseSqrt().transpose())
                .cwiseAbs()
                .maxCoeff(),
            4 * std::sqrt(2.0 / 512));
  EXPECT_GT(variance(0, 0), 0.8 * sd[0] * sd[0]);  // else it would not be seen
}

TEST(Linearisation, TangentTouchesTheEmulator) {
  const Emulator emulator = make_emulator(2, -1.0);
  const VectorXd x0 = Eigen::Vector2d(0.4, -0.8);
  const Expansion at = expand(emulator, x0);
  VectorXd mean, variance;
  predict(emulator, x0.unaryExpr(&normal_cdf), mean, variance);
  EXPECT_LT((at.mean - mean).cwiseQuotient(mean).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((at.variance - variance).cwiseQuotient(variance).cwiseAbs().maxCoeff(), 1e-13);
  for (Index q = 0; q < 2; ++q) {
    const VectorXd slope = numerical_gradient(
        [&](const VectorXd& x) {
          VectorXd m, v;
          predict(emulator, x.unaryExpr(&normal_cdf), m, v);
          return m[q];
        },
        x0);
    // Differences of 3e-3 against those of 1e-5, relative to the larger slope.
    EXPECT_LT((at.slope.row(q).transpose() - slope).cwiseAbs().maxCoeff(),
              1e-5 * slope.cwiseAbs().maxCoeff());
  }
  // w = w'(z0) + W (x - x0) + error, x ~ N(0, I).
  const GaussianSimulator tangent = tangent_at(emulator, x0);
  MatrixXd covariance = at.slope * at.slope.transpose();
  covariance.diagonal() += at.variance;
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  EXPECT_LT((tangent.mean - (at.mean - at.slope * x0)).cwiseQuotient(sd).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((tangent.root * tangent.root.transpose() - covariance)
                .cwiseQuotient(sd * sd.transpose())
                .cwiseAbs()
                .maxCoeff(),
            1e-12);
}

// Coefficients that are linear in x = Phi^-1(u): every tangent is the same Gaussian.
TEST(Linearisation, TangentOfALineIsTheLine) {
  EmulatorState state = make_emulator(1).state();
  const VectorXd x = VectorXd::LinSpaced(40, -1.6, 1.6);
  state.coefficients.resize(40, 2);
  state.inputs = x.unaryExpr(&normal_cdf);
  state.coefficients.col(0) = 0.02 + 0.004 * x.array();
  state.coefficients.col(1) = 20.0 - 1.5 * x.array();
  state.parameters.col(1).setConstant(-12.0);  // nugget
  state.parameters.col(2).setConstant(14.0);   // precision of the noise
  state.parameters.col(3).setConstant(-3.0);   // as rough as Phi^-1 is
  const Emulator emulator(state);
  const VectorXd at_zero = Eigen::Vector2d(0.02, 20.0), line = Eigen::Vector2d(0.004, -1.5);
  for (double x0 : {-0.7, 0.0, 0.5}) {
    const GaussianSimulator tangent = tangent_at(emulator, VectorXd::Constant(1, x0));
    // What the emulator, smooth in u, misses of a function of x: a few hundredths of a standard deviation.
    EXPECT_LT((tangent.mean - at_zero).cwiseQuotient(line).cwiseAbs().maxCoeff(), 0.05);
    EXPECT_LT((tangent.root * tangent.root.transpose() - line * line.transpose())
                  .cwiseQuotient(line.cwiseAbs() * line.cwiseAbs().transpose())
                  .cwiseAbs()
                  .maxCoeff(),
              0.1);
  }
}

}  // namespace
}  // namespace amiss
