#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "engine/discrepancy/FilterBank.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

TEST(FilterBank, RespondsToAStepExactly) {
  const TimeAxis axis = uneven_axis(20, {});
  VectorXd x = VectorXd::Zero(20);
  x.tail(15).setConstant(2.0);
  const FilterBank bank(x, {0}, Eigen::Vector3d(0.0, 0.7, 6.0), axis);
  EXPECT_EQ(bank.responses.col(0), x);
  // The value of step i holds since the step before.
  for (Index i = 5; i < 20; ++i) {
    const double since = axis.time[i] - axis.time[4];
    EXPECT_NEAR(bank.responses(i, 1), 2 * (1 - std::exp(-since / 0.7)), 1e-12);
    EXPECT_NEAR(bank.responses(i, 2), 2 * (1 - std::exp(-since / 6.0)), 1e-12);
  }
  EXPECT_EQ(bank.responses.topRows(5).cwiseAbs().maxCoeff(), 0.0);
}

TEST(FilterBank, StartsEverySegmentInEquilibrium) {
  const TimeAxis axis = uneven_axis(20, {9});
  VectorXd x = VectorXd::Constant(20, 5.0);
  x.tail(11).setConstant(-3.0);
  const FilterBank bank(x, {0}, VectorXd::Constant(1, 50.0), axis);
  EXPECT_LT((bank.responses.col(0) - x).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(FilterBank, SegmentsAreIndependent) {
  const TimeAxis axis = uneven_axis(20, {9});
  const VectorXd x = normal_vector(20, 45);
  VectorXd other = x;
  other.head(9) = normal_vector(9, 46);
  const VectorXd times = Eigen::Vector2d(1.0, 8.0);
  const MatrixXd a = FilterBank(x, {0}, times, axis).responses,
                 b = FilterBank(other, {0}, times, axis).responses;
  EXPECT_EQ(a.bottomRows(11), b.bottomRows(11));
  EXPECT_NE(a.topRows(9), b.topRows(9));
}

TEST(FilterBank, ColumnsRunByBoundaryColumnThenTimeConstant) {
  const TimeAxis axis = even_axis(10);
  const MatrixXd x = normal_matrix(10, 3, 47);
  const FilterBank bank(x, {0, 1, 1}, Eigen::Vector2d(0.0, 2.0), axis);
  EXPECT_EQ(bank.condition, (std::vector<int>{0, 0, 1, 1, 1, 1}));
  for (Index c = 0; c < 3; ++c) EXPECT_EQ(bank.responses.col(2 * c), x.col(c));
}

TEST(FilterBank, RefusesWrongLengthsAndImpossibleTimes) {
  const TimeAxis axis = even_axis(10);
  EXPECT_THROW(FilterBank(VectorXd::Zero(9), {0}, VectorXd::Ones(1), axis), std::invalid_argument);
  EXPECT_THROW(FilterBank(VectorXd::Zero(10), {0}, -VectorXd::Ones(1), axis), std::invalid_argument);
  for (double constant : {std::numeric_limits<double>::quiet_NaN(), kInfinity}) {
    const VectorXd constants = VectorXd::Constant(1, constant);
    EXPECT_THROW(FilterBank(VectorXd::Zero(10), {0}, constants, axis), std::invalid_argument);
  }
}

}  // namespace
}  // namespace amiss
