#include <gtest/gtest.h>

#include "calibration_helpers.hpp"
#include "engine/calibration/ParameterModes.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

// One parameter: modes and their scales are seen on a fine grid. The record says much of it, or hardly more
// than the prior.
TEST(ParameterModes, AreThoseOfAFineGrid) {
  const Emulator emulator = make_emulator(1);
  HistoryData data = make_data();
  data.y.array() += 1.2;  // else the prior's mode would be the record's
  const HistoryModel model = make_model({}, data);
  const CalibrationTarget target(model, {}, emulator);
  const VectorXd grid = VectorXd::LinSpaced(4001, -4.0, 4.0);
  MatrixXd mean, variance;
  emulator.predict(grid.unaryExpr(&normal_cdf), mean, variance);
  for (double noise_variance : {0.8, 40.0}) {
    const HistoryParameters point{0, noise_variance, VectorXd::Zero(2)};
    Stream stream(1, 2, 3);
    const ParameterModes modes = parameter_modes(target, {{point}}, {}, Context(), stream);
    EXPECT_GT(modes.evaluations, 192);
    VectorXd exact(4001), fitted(4001);
    for (Index i = 0; i < 4001; ++i) {
      exact[i] = model.log_likelihood(point, mean.row(i), variance.row(i)) - 0.5 * grid[i] * grid[i];
      fitted[i] = modes.mixture.log_density(grid.segment(i, 1));
    }
    const VectorXd p = normalised_exp(exact), q = normalised_exp(fitted);
    // The weights p / q have a second moment of 1 / (effective share): a half at least, of which the widened
    // t gives up some, and the skewness of the posterior some.
    EXPECT_LT((p.array().square() / q.array()).sum(), 2.0) << noise_variance;
    // A search ends at a gain of 0.01 nats: 0.14 standard deviations from the top.
    Index top = 0;
    exact.maxCoeff(&top);
    const double centre = p.dot(grid), sd = std::sqrt(p.dot(grid.cwiseAbs2()) - centre * centre);
    EXPECT_NEAR(modes.best[0], grid[top], 0.15 * sd) << noise_variance;
    ModeOptions one;  // a single search from wherever the prior has it start
    one.starts = one.searches = 1;
    for (std::uint64_t item = 0; item < 10; ++item) {
      Stream other(2, 2, item);
      EXPECT_NEAR(parameter_modes(target, {{point}}, one, Context(), other).best[0], grid[top], 0.15 * sd);
    }
  }
}

// w'_0 = 0.02 sin(pi u) rises and falls: two values of the parameter give the same coefficient.
TEST(ParameterModes, FindBothOfTwo) {
  EmulatorState state = make_emulator(1).state();
  state.inputs.col(0) = VectorXd::LinSpaced(15, 0.0, 1.0);
  state.coefficients.col(0) = 0.02 * (M_PI * state.inputs.col(0).array()).sin();
  state.coefficients.col(1) = 20.0 + 0.01 * (7.0 * state.inputs.col(0).array()).cos();
  const Emulator emulator(state);
  HistoryData data = make_data();
  data.basis.col(0) *= 10.0;
  data.y = data.basis * Eigen::Vector2d(0.014, 20.0) + 0.9 * normal_vector(kN, 84);
  const HistoryModel model = make_model({}, data);
  const CalibrationTarget target(model, {}, emulator);
  ModeOptions options;
  options.searches = 16;  // the four best of all starts may lie near the same of the two
  Stream stream(1, 2, 3);
  const ParameterModes modes =
      parameter_modes(target, {{target.history(VectorXd::Zero(2))}}, options, Context(), stream);
  ASSERT_EQ(modes.mixture.size(), 2u);
  // u = 1/4 and 3/4, x = -0.67 and 0.67; between them the simulator is far off.
  const auto density = [&](double x) { return modes.mixture.log_density(VectorXd::Constant(1, x)); };
  EXPECT_GT(density(0.67), density(0.0) + 1.0);
  EXPECT_GT(density(-0.67), density(0.0) + 1.0);
}

TEST(ParameterModes, WithoutAModeThePriorStands) {
  const HistoryModel model = make_model({}, make_data());
  EmulatorState state = make_emulator(2).state();
  state.coefficients.array() += 1e200;  // the square of the error is not finite
  const Emulator emulator(state);
  const CalibrationTarget target(model, {}, emulator);
  Stream stream(1, 2, 3);
  const ParameterModes modes =
      parameter_modes(target, {{{0, 1.0, VectorXd::Zero(2)}}}, {}, Context(), stream);
  EXPECT_EQ(modes.mixture.size(), 1u);
  EXPECT_EQ(modes.best, VectorXd::Zero(2));
}

}  // namespace
}  // namespace amiss
