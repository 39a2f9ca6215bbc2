#include <gtest/gtest.h>

#include <algorithm>

#include "emulator_helpers.hpp"
#include "engine/emulator/ModeSearch.hpp"
#include "engine/optimise/maximise.hpp"

namespace amiss {
namespace {

using namespace test;

// Six inputs, of which the second and the fifth act, the fifth on a shorter scale.
struct TwoOfSix {
  MatrixXd inputs = uniform_matrix(60, 6, 41);
  VectorXd values = VectorXd(60);
  TwoOfSix() {
    for (Index i = 0; i < 60; ++i) values[i] = respond(inputs.row(i));
  }
  static double respond(const VectorXd& u) { return 2 * u[1] * u[1] - 1 + std::sin(7 * u[4]); }
  static GaussianProcess fit(const MatrixXd& inputs, const VectorXd& values, bool forward) {
    SearchOptions options;
    options.forward = forward;
    return GaussianProcess::fit(inputs, values, {}, options);
  }
  double rmse(const GaussianProcess& process) const {
    const MatrixXd points = uniform_matrix(200, 6, 42);
    VectorXd mean(200), variance(200);
    process.predict(points, mean, variance);
    for (Index i = 0; i < 200; ++i) mean[i] -= respond(points.row(i));
    return std::sqrt(mean.squaredNorm() / 200);
  }
};

TEST(ForwardSelection, FindsTheInputsThatAct) {
  const TwoOfSix two;
  const GaussianProcess forward = TwoOfSix::fit(two.inputs, two.values, true);
  ASSERT_GE(forward.selection.size(), 2u);
  EXPECT_EQ(forward.selection[0].parameter, 4);
  EXPECT_EQ(forward.selection[1].parameter, 1);
  const VectorXd& logit_beta = forward.parameters().logit_beta;
  for (Index p : {0, 2, 3, 5}) EXPECT_GT(logit_beta[p], std::max(logit_beta[1], logit_beta[4]) + 3) << p;
  // Both fits find the response (its standard deviation is 0.9) and the fit with fewer betas is as good.
  const GaussianProcess ard = TwoOfSix::fit(two.inputs, two.values, false);
  EXPECT_LT(two.rmse(ard), 0.01);
  EXPECT_LT(two.rmse(forward), 1.5 * two.rmse(ard));
  EXPECT_TRUE(ard.selection.empty());
}

TEST(ForwardSelection, FirstStepIsTheBestOfAllByBruteForce) {
  const TwoOfSix two;
  const VectorXd noisy = two.values + 0.3 * normal_vector(60, 43);
  SearchOptions options;
  options.forward = true;
  const Mode mode = find_mode(two.inputs, noisy, {}, options);
  ASSERT_FALSE(mode.selection.empty());
  // Greatest density with beta number beta_of[p], from three starts of its own.
  const auto highest = [&](const std::vector<int>& beta_of, Index betas) {
    double best = -1e300;
    for (double start : {-1.0, 1.0, 3.0}) {
      VectorXd x = VectorXd::Constant(3 + betas, start), range = VectorXd::Constant(3 + betas, 12.0);
      x.head(3) << 0.5, -2.0, 40.0;
      range[2] = 40.0;
      GaussianProcess::Memory memory;
      const Objective density = [&](const VectorXd& at, Eigen::Ref<VectorXd> gradient) {
        return GaussianProcess::log_density(two.inputs, noisy, {}, beta_of, at, gradient, memory);
      };
      best = std::max(best, maximise(density, x, -range, range, 1e-10, 500).value);
    }
    return best;
  };
  const double shared = highest({0, 0, 0, 0, 0, 0}, 1);
  int winner = -1;
  double best = shared;
  for (int p = 0; p < 6; ++p) {
    std::vector<int> beta_of(6, 0);
    beta_of[static_cast<std::size_t>(p)] = 1;
    const double value = highest(beta_of, 2);
    if (value > best) {
      best = value;
      winner = p;
    }
  }
  EXPECT_EQ(mode.selection[0].parameter, winner);
  // The search ends when a step changes the density, of size 50, by less than 1e-7 of it.
  EXPECT_NEAR(mode.selection[0].gain, best - shared, 1e-3);
  double rises = 0.0;
  for (std::size_t k = 0; k < mode.selection.size(); ++k) {
    rises += mode.selection[k].gain;
    EXPECT_GE(mode.selection[k].gain, selection_threshold(0.05, 6 - static_cast<int>(k)));
  }
  EXPECT_NEAR(mode.value, shared + rises, 1e-3);
}

// Equal betas are the truth: a step is a false alarm, at the stated rate of 5 %.
TEST(ForwardSelection, InputsAlikeAreKeptTogether) {
  SearchOptions options;
  options.forward = true;
  int alarms = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    const MatrixXd inputs = uniform_matrix(30, 4, 500 + seed);
    const MatrixXd covariance = smooth_covariance(inputs, inputs, 1.0, VectorXd::Constant(4, 0.3)) +
                                0.01 * MatrixXd::Identity(30, 30);
    const VectorXd values = covariance.llt().matrixL() * normal_vector(30, 600 + seed);
    if (!find_mode(inputs, values, {}, options).selection.empty()) ++alarms;
  }
  // Binomial(40, 0.05) exceeds 7 with probability 0.0007.
  EXPECT_LE(alarms, 7);
}

TEST(ForwardSelection, ThresholdIsHalfTheQuantileOfChiSquared) {
  EXPECT_NEAR(selection_threshold(0.05, 1), 0.5 * 3.841458820694124, 1e-12);  // published table
  EXPECT_NEAR(selection_threshold(0.05, 5), 0.5 * 6.634896601021214, 1e-12);  // level 0.01
}

}  // namespace
}  // namespace amiss
