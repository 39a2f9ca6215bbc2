#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "calibration_helpers.hpp"
#include "engine/calibration/CalibrationTarget.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

// log p(y | sigma, t, kappa, z) written down: y = K w + discrepancy + error, w ~ N(w'(z), S(z)).
double dense_density(const HistoryModel& model, const HistoryData& data, const HistoryParameters& p,
                     const Emulator& emulator, const VectorXd& u, double variances = 1.0) {
  const int g = p.setting % 2;
  const double reach = model.priors().reach[static_cast<std::size_t>(p.setting / 2)];
  MatrixXd phi = scaled_responses(data, p.t);
  if (!std::isinf(reach)) {
    const MatrixXd a = data.moves * data.moves.transpose() / (reach * kNoise * kNoise);
    phi = (MatrixXd::Identity(kN, kN) + a * a).ldlt().solve(phi);
  }
  VectorXd mean, variance;
  predict(emulator, u, mean, variance);
  const MatrixXd covariance =
      p.variance * error_covariance(data.axis, kError.correlation_times, kError.setting(g)) +
      phi * phi.transpose() + variances * data.basis * variance.asDiagonal() * data.basis.transpose();
  return log_normal_density(data.y, data.basis * mean, covariance);
}

TEST(CalibrationTarget, CoordinatesAreTheHistorysThenTheParameters) {
  const Joint joint;
  const CalibrationTarget target = joint.target();
  const HistoryCoordinates history(joint.model, {0, 1});
  ASSERT_EQ(history.dimension(), 1 + 1 + 1 + 2);
  ASSERT_EQ(target.dimension(), 5 + 2);
  const MatrixXd x = normal_matrix(7, 3, 86), u = target.unit(x);
  ASSERT_EQ(u.rows(), 3);
  ASSERT_EQ(u.cols(), 2);
  for (Index i = 0; i < 3; ++i) {
    for (Index p = 0; p < 2; ++p) EXPECT_EQ(u(i, p), normal_cdf(x(5 + p, i)));
    const HistoryParameters own = target.history(x.col(i)), expected = history.parameters(x.col(i).head(5));
    EXPECT_EQ(own.variance, expected.variance);
    EXPECT_EQ(own.setting, expected.setting);
    EXPECT_EQ(own.t, expected.t);
  }
}

TEST(CalibrationTarget, AlongTheParametersItIsTheSameLikelihood) {
  EmulatorState state = make_emulator(2).state();
  const Joint everywhere;
  const CalibrationTarget whole = everywhere.target();
  state.region = Region(VectorXd::Zero(2), MatrixXd::Identity(2, 2), 6.0, {false, false});
  const Emulator regional(state);
  const CalibrationTarget within(everywhere.model, {0, 1}, regional);
  MatrixXd x = normal_matrix(7, 8, 88), elsewhere = normal_matrix(2, 8, 89);
  for (const CalibrationTarget* target : {&whole, &within}) {
    ASSERT_TRUE(target->has_conditional());
    const std::unique_ptr<Conditional> along = target->along_last_part(x);
    MatrixXd moved = x;
    moved.bottomRows(2) = elsewhere;
    const VectorXd expected = target->log_likelihood(moved);
    EXPECT_LT((along->log_likelihood(elsewhere) - expected).cwiseAbs().maxCoeff(), 1e-8);
  }
  // In a region the emulator's variance is the same at every point, and the gradient the likelihood's own.
  const std::unique_ptr<Conditional> along = within.along_last_part(x);
  const MatrixXd gradient = along->gradient(elsewhere);
  constexpr double kStep = 1e-5;
  for (Index p = 0; p < 2; ++p) {
    MatrixXd above = elsewhere, below = elsewhere;
    above.row(p).array() += kStep;
    below.row(p).array() -= kStep;
    const VectorXd slope = (along->log_likelihood(above) - along->log_likelihood(below)) / (2 * kStep);
    EXPECT_LT((slope - gradient.row(p).transpose()).norm(), 1e-5 * gradient.norm()) << p;
  }
  elsewhere.col(0).setConstant(5.0);  // |x| > 6
  EXPECT_EQ(along->log_likelihood(elsewhere)[0], -kInfinity);
}

TEST(CalibrationTarget, LikelihoodIsTheDenseDensityOfTheMeasurement) {
  const Joint joint;
  const CalibrationTarget target = joint.target();
  const MatrixXd x = 0.9 * normal_matrix(7, 12, 87);
  const VectorXd own = target.log_likelihood(x);
  const MatrixXd u = target.unit(x);
  double most = 0.0;
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters p = target.history(x.col(i));
    const double dense = dense_density(joint.model, make_data(), p, joint.emulator, u.row(i).transpose());
    EXPECT_NEAR(own[i], dense, 1e-8 * (1 + std::abs(dense)));  // eigenvalues from 0.3 to 1e3, values near 100
    most = std::max(most, std::abs(dense - dense_density(joint.model, make_data(), p, joint.emulator,
                                                         u.row(i).transpose(), 0.0)));
  }
  EXPECT_GT(most, 1e-3);  // else the comparison would not see the emulator's variance
}

TEST(CalibrationTarget, UnitsOfTheBasisDoNotMatter) {
  const Joint joint;
  HistoryData scaled = make_data();
  scaled.basis *= 100.0;
  EmulatorState state = joint.emulator.state();
  state.coefficients /= 100.0;
  const Emulator emulator(state);
  const HistoryModel model(scaled, joint.model.priors(), Context());
  const CalibrationTarget other(model, {0, 1}, emulator);
  const MatrixXd x = normal_matrix(7, 5, 89);
  const VectorXd a = joint.target().log_likelihood(x), b = other.log_likelihood(x);
  for (Index i = 0; i < 5; ++i) EXPECT_NEAR(a[i], b[i], 1e-8 * (1 + std::abs(a[i])));  // rounding, as above
}

TEST(CalibrationTarget, OutsideTheRegionTheRecordIsImpossible) {
  EmulatorState state = make_emulator(2).state();
  state.region = Region(Eigen::Vector2d(0.2, -0.3), 0.5 * MatrixXd::Identity(2, 2), 2.0, {false, false});
  const Emulator emulator(state);
  const Joint joint;
  const CalibrationTarget target(joint.model, {0, 1}, emulator);
  MatrixXd x = MatrixXd::Zero(target.dimension(), 2);
  x.bottomRows(2) << 0.9, 1.3, -0.3, -0.3;
  const VectorXd values = target.log_likelihood(x);
  EXPECT_TRUE(std::isfinite(values[0]));
  EXPECT_EQ(values[1], -kInfinity);
}

TEST(CalibrationTarget, RefusesAnEmulatorOfAnotherBasis) {
  HistoryData data = make_data();
  data.basis = normal_matrix(kN, 3, 1);
  data.moves.resize(0, 0);
  const HistoryModel model = make_model({}, data);
  const Emulator emulator = make_emulator(1);
  EXPECT_THROW(CalibrationTarget(model, {}, emulator), std::invalid_argument);
}

}  // namespace
}  // namespace amiss
