#include <gtest/gtest.h>

#include <cmath>

#include "engine/linalg/triangular.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

MatrixXd lower_with_upper(Index n, double above) {
  MatrixXd l = normal_matrix(n, n, 5);
  l.diagonal() = l.diagonal().cwiseAbs().array() + std::sqrt(static_cast<double>(n));
  l.triangularView<Eigen::StrictlyUpper>().setConstant(above);
  return l;
}

// Sizes on both sides of where the recursion ends, even and odd. Entries are of order one, so that rounding
// stays below 1e-12.
class Triangular : public ::testing::TestWithParam<Index> {};
INSTANTIATE_TEST_SUITE_P(Sizes, Triangular, ::testing::Values(1, 2, 24, 25, 49, 120, 333));

TEST_P(Triangular, InverseTimesMatrixIsIdentityAndTheUpperPartIsLeftAlone) {
  const Index n = GetParam();
  const MatrixXd l = lower_with_upper(n, 7.0);
  MatrixXd inverse = l;
  invert_lower(inverse);
  const MatrixXd product =
      MatrixXd(inverse.triangularView<Eigen::Lower>()) * MatrixXd(l.triangularView<Eigen::Lower>());
  EXPECT_LT((product - MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(), 1e-12);
  for (Index j = 1; j < n; ++j) EXPECT_EQ(inverse(0, j), 7.0);
}

TEST_P(Triangular, SquareIsTheProductWithTheTranspose) {
  const Index n = GetParam();
  const MatrixXd l = lower_with_upper(n, -3.0);
  const MatrixXd alone = l.triangularView<Eigen::Lower>();
  const MatrixXd expected = alone.transpose() * alone;
  MatrixXd square = l;
  square_lower(square);
  for (Index j = 1; j < n; ++j) EXPECT_EQ(square(0, j), -3.0);
  symmetrise(square);
  EXPECT_LT((square - expected).cwiseAbs().maxCoeff(), 1e-12 * expected.cwiseAbs().maxCoeff());
}

}  // namespace
}  // namespace amiss
