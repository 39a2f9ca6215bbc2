#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/optimise/maximise.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

double rosenbrock(const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
  const double a = 1 - x[0], b = x[1] - x[0] * x[0];
  if (gradient.size() > 0) gradient << 2 * a + 400 * b * x[0], -200 * b;
  return -a * a - 100 * b * b;
}

const VectorXd kWide = VectorXd::Constant(2, 10.0);

TEST(Maximise, FindsTheBoundedMaximumOfACoupledQuadratic) {
  const Eigen::Matrix2d a = (Eigen::Matrix2d() << 2, 1, 1, 3).finished();
  const Eigen::Vector2d centre(2.0, 0.5);
  const Objective f = [&](const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
    gradient = -a * (x - centre);
    return -0.5 * (x - centre).dot(a * (x - centre));
  };
  const Maximum found =
      maximise(f, Eigen::Vector2d(0, 0), Eigen::Vector2d(-5, -5), Eigen::Vector2d(1, 5), 1e-12);
  // With x0 held at its bound 1, the derivative in x1 vanishes at 1/2 + 1/3.
  EXPECT_NEAR(found.x[0], 1.0, 1e-9);
  EXPECT_NEAR(found.x[1], 5.0 / 6.0, 1e-5);
  EXPECT_NEAR(found.value, -0.5 * (2.0 - 2.0 / 3.0 + 3.0 / 9.0), 1e-9);
  EXPECT_TRUE(found.converged);
}

TEST(Maximise, FollowsTheRosenbrockValley) {
  const Maximum found = maximise(rosenbrock, Eigen::Vector2d(-1.2, 1.0), -kWide, kWide, 1e-14, 500);
  EXPECT_NEAR(found.x[0], 1.0, 1e-4);
  EXPECT_NEAR(found.x[1], 1.0, 1e-4);
  EXPECT_NEAR(found.value, 0.0, 1e-8);
}

TEST(Maximise, SaysWhenEvaluationsRanOutAndKeepsTheBestPoint) {
  const Maximum found = maximise(rosenbrock, Eigen::Vector2d(-1.2, 1.0), -kWide, kWide, 1e-14, 8);
  EXPECT_FALSE(found.converged);
  EXPECT_EQ(found.evaluations, 8);
  VectorXd none(0);
  EXPECT_EQ(found.value, rosenbrock(found.x, none));
  EXPECT_GT(found.value, rosenbrock(Eigen::Vector2d(-1.2, 1.0), none));
}

TEST(Maximise, BacksOffWhereTheValueIsNotFinite) {
  const Objective f = [](const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
    if (x[0] <= 0) return -std::numeric_limits<double>::infinity();
    gradient[0] = 2.0 / x[0] - 1.0;
    return 2.0 * std::log(x[0]) - x[0];
  };
  const VectorXd bound = VectorXd::Constant(1, 50.0);
  const Maximum found = maximise(f, VectorXd::Constant(1, 20.0), -bound, bound, 1e-12);
  EXPECT_NEAR(found.x[0], 2.0, 1e-4);
}

TEST(Maximise, StartOutsideTheBoxIsMovedInside) {
  const Objective f = [](const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
    EXPECT_LE(x[0], 1.0);
    EXPECT_GE(x[0], 0.0);
    gradient[0] = 1.0;
    return x[0];
  };
  EXPECT_EQ(maximise(f, VectorXd::Constant(1, 7.0), VectorXd::Zero(1), VectorXd::Ones(1)).x[0], 1.0);
}

TEST(Maximise, ExceptionOfTheObjectiveArrives) {
  const Objective f = [](const VectorXd&, Eigen::Ref<VectorXd>) -> double { throw std::domain_error("no"); };
  EXPECT_THROW(maximise(f, VectorXd::Zero(2), -kWide, kWide), std::domain_error);
}

}  // namespace
}  // namespace amiss
