#include <gtest/gtest.h>

#include <cmath>

#include "ais/ais_helpers.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {
namespace {

using namespace test;

TEST(LogSumExp, IsSafeForLargeSmallAndInfiniteValues) {
  EXPECT_NEAR(log_sum_exp(Eigen::Vector2d(1000.0, 1000.0)), 1000.0 + std::log(2.0), 1e-12);
  EXPECT_NEAR(log_sum_exp(Eigen::Vector3d(-2000.0, -kInfinity, -2000.0 + std::log(3.0))),
              -2000.0 + std::log(4.0), 1e-12);
  EXPECT_EQ(log_sum_exp(Eigen::Vector2d(-kInfinity, -kInfinity)), -kInfinity);
  EXPECT_NEAR(log_mean_exp(Eigen::Vector2d(std::log(1.0), std::log(3.0))), std::log(2.0), 1e-15);
  const VectorXd share = normalised_exp(Eigen::Vector2d(-800.0, -800.0 + std::log(3.0)));
  EXPECT_NEAR(share[0], 0.25, 1e-12);
  EXPECT_NEAR(share[1], 0.75, 1e-12);
}

TEST(LogSumExpRows, IsThatOfEachRow) {
  MatrixXd x = 300.0 * normal_matrix(5, 3, 91);
  x.row(1).setConstant(-kInfinity);
  x.row(2) << 1000.0, 1000.0, -kInfinity;
  const VectorXd rows = log_sum_exp_rows(x);
  for (Index i = 0; i < 5; ++i) {
    if (i == 1) continue;
    EXPECT_NEAR(rows[i], log_sum_exp(x.row(i).transpose()), 1e-12 * std::abs(rows[i])) << i;
  }
  EXPECT_EQ(rows[1], -kInfinity);
  EXPECT_NEAR(rows[2], 1000.0 + std::log(2.0), 1e-10);
}

}  // namespace
}  // namespace amiss
