#include "engine/error/ErrorModel.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <stdexcept>

#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

const VectorXd kTimes = Eigen::Vector2d(0.5, 3.0);
const VectorXd kRatios = Eigen::Vector2d(0.7, 4.0);

MatrixXd matrix_of(const Whitener& whitener, Index n) { return whitener(MatrixXd::Identity(n, n)); }

TEST(Whitener, WhitensTwoComponentsOverUnevenStepsAndABreak) {
  const Index n = 40;
  const TimeAxis axis = uneven_axis(n, {17});
  const Whitener whitener(axis, kTimes, kRatios);
  const MatrixXd c = error_covariance(axis, kTimes, kRatios);
  const MatrixXd w = matrix_of(whitener, n);
  EXPECT_LT((w * c * w.transpose() - MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(), 1e-10);
  const double log_det = Eigen::SelfAdjointEigenSolver<MatrixXd>(c).eigenvalues().array().log().sum();
  EXPECT_NEAR(whitener.log_det(), -0.5 * log_det, 1e-10);
}

TEST(Whitener, IsTheInverseOfTheCholeskyFactor) {
  const TimeAxis axis = uneven_axis(25, {10, 11});
  const MatrixXd c = error_covariance(axis, kTimes, kRatios);
  const MatrixXd inverse = c.llt().matrixL().solve(MatrixXd::Identity(25, 25));
  EXPECT_LT((matrix_of(Whitener(axis, kTimes, kRatios), 25) - inverse).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(Whitener, CarriesNothingAcrossABreak) {
  const TimeAxis axis = uneven_axis(30, {12});
  const MatrixXd w = matrix_of(Whitener(axis, kTimes, kRatios), 30);
  EXPECT_EQ(w.block(12, 0, 18, 12).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_GT(w.block(1, 0, 11, 11).cwiseAbs().maxCoeff(), 0.0);
}

TEST(Whitener, LeavesWhiteErrorAsItIs) {
  const TimeAxis axis = even_axis(12);
  const MatrixXd x = normal_matrix(12, 3, 1);
  const Whitener none(axis, VectorXd(), VectorXd());
  EXPECT_EQ(none(x), x);
  EXPECT_EQ(none.log_det(), 0.0);
  const Whitener zero(axis, kTimes, VectorXd::Zero(2));
  EXPECT_LT((zero(x) - x).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(Whitener, StaysAccurateForStrongLongMemory) {
  const TimeAxis axis = uneven_axis(60, {});
  const VectorXd times = Eigen::Vector2d(0.2, 500.0), ratios = Eigen::Vector2d(1.0, 1e4);
  const MatrixXd c = error_covariance(axis, times, ratios);
  const MatrixXd w = matrix_of(Whitener(axis, times, ratios), 60);
  EXPECT_LT((w * c * w.transpose() - MatrixXd::Identity(60, 60)).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(ErrorOptions, GridHoldsEveryPairOfRatiosOnce) {
  const ErrorOptions options{kTimes, Eigen::Vector3d(0.0, 1.0, 5.0)};
  ASSERT_EQ(options.settings(), 9);
  std::set<std::pair<double, double>> pairs;
  for (int g = 0; g < 9; ++g) pairs.insert({options.setting(g)[0], options.setting(g)[1]});
  EXPECT_EQ(pairs.size(), 9u);
  for (double a : {0.0, 1.0, 5.0}) {
    for (double b : {0.0, 1.0, 5.0}) EXPECT_EQ(pairs.count({a, b}), 1u);
  }
  EXPECT_EQ(ErrorOptions{}.settings(), 1);
  EXPECT_EQ(ErrorOptions{}.setting(0).size(), 0);
}

TEST(ErrorOptions, RefusesImpossibleValues) {
  EXPECT_THROW((ErrorOptions{VectorXd::Zero(1), VectorXd::Ones(1)}.check()), std::invalid_argument);
  EXPECT_THROW((ErrorOptions{VectorXd::Ones(1), VectorXd::Constant(1, -1.0)}.check()), std::invalid_argument);
  EXPECT_THROW((ErrorOptions{VectorXd::Ones(1), VectorXd()}.check()), std::invalid_argument);
  const VectorXd nan = VectorXd::Constant(1, std::numeric_limits<double>::quiet_NaN());
  EXPECT_THROW((ErrorOptions{nan, VectorXd::Ones(1)}.check()), std::invalid_argument);
  EXPECT_THROW((ErrorOptions{VectorXd::Ones(1), nan}.check()), std::invalid_argument);
  EXPECT_NO_THROW((ErrorOptions{kTimes, VectorXd::Zero(1)}.check()));
}

TEST(TimeAxis, TimeMustIncreaseWithinASegmentOnly) {
  TimeAxis axis = even_axis(5);
  axis.time[3] = axis.time[2];
  EXPECT_THROW(axis.check(), std::invalid_argument);
  axis.new_segment[3] = true;
  EXPECT_NO_THROW(axis.check());
  axis.new_segment.pop_back();
  EXPECT_THROW(axis.check(), std::invalid_argument);
}

TEST(TimeAxis, FirstValueMustStartASegment) {
  TimeAxis axis = even_axis(5);
  axis.new_segment[0] = false;  // whitener and filter bank would read the value before the first
  EXPECT_THROW(axis.check(), std::invalid_argument);
}

TEST(TimeAxis, TimeMustBeANumber) {
  TimeAxis axis = even_axis(5);
  axis.time[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(axis.check(), std::invalid_argument);
}

}  // namespace
}  // namespace amiss
