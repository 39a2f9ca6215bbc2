#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ais_helpers.hpp"
#include "engine/ais/SkewedMixture.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

// Draws of two coordinates: minus the logarithm of a uniform one, and a normal one.
MatrixXd exponential_and_normal(Index n) {
  MatrixXd x = normal_matrix(2, n, 81);
  Stream stream(1, 7, 1);
  for (Index i = 0; i < n; ++i) x(0, i) = -std::log(stream.uniform());
  return x;
}

TEST(SkewMap, SendsQuantilesToNormalOnesAndBack) {
  const Index n = 4001;
  const MatrixXd x = exponential_and_normal(n);
  const SkewMap map = SkewMap::fit(x, VectorXd::Constant(n, 1.0 / n));
  for (double p : {0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98}) {
    VectorXd first = x.row(0);
    std::sort(first.data(), first.data() + n);
    // Between neighbours in rank, which lie 0.013 apart at the 98 % quantile, scaled by the slope there.
    const VectorXd at = Eigen::Vector2d(first[static_cast<Index>(p * n)], 0.0);
    EXPECT_NEAR(normal_cdf(map.even(at)(0)), p, 0.002) << p;
  }
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd z = 2.0 * normal_vector(2, 82 + i), at = map.skewed(z);
    EXPECT_LT((map.even(at) - z).norm(), 1e-12);
    // Off the knots a line is its own difference quotient.
    const VectorXd step = VectorXd::Constant(2, 1e-6);
    EXPECT_LT(((map.even(at + step) - map.even(at - step)) / 2e-6 - map.slope(at)).norm(), 1e-8);
  }
}

TEST(SkewMap, IsLinearWherePointsAreNormal) {
  const Index n = 1000;
  const MatrixXd x = exponential_and_normal(n);
  const SkewMap map = SkewMap::fit(x, VectorXd::Constant(n, 1.0 / n));
  const MatrixXd slopes = map.slope(normal_matrix(2, 50, 88));
  EXPECT_GT(slopes.row(0).maxCoeff(), 2.0 * slopes.row(0).minCoeff());
  EXPECT_NEAR(slopes.row(1).maxCoeff(), slopes.row(1).minCoeff(), 1e-12);
  EXPECT_NEAR(slopes(1, 0), 1.0, 0.1);  // four standard errors of a standard deviation
}

TEST(SkewMap, WithoutPointsToTellChangesNothing) {
  const VectorXd at = normal_vector(3, 83);
  EXPECT_EQ(SkewMap().even(at), at);
  EXPECT_EQ(SkewMap().skewed(at), at);
  EXPECT_EQ(SkewMap().slope(at), VectorXd::Ones(3));
  MatrixXd x = normal_matrix(1, 200, 84);
  x.leftCols(100).setConstant(0.3);  // half of a population may be copies of one point
  const SkewMap map = SkewMap::fit(x, VectorXd::Constant(200, 1.0 / 200));
  EXPECT_EQ(map.slope(at.head(1))(0), 1.0);
}

TEST(SkewedMixture, DensityIntegratesToOneAndIsThatOfTheDraws) {
  const Index n = 2000;
  const MatrixXd x = exponential_and_normal(n).topRows(1);
  Stream stream(1, 7, 2);
  const auto mixture = SkewedMixture::fit(x, VectorXd::Constant(n, 1.0 / n), 2, 8.0, stream);
  const auto density = [&](double at) { return std::exp(mixture.log_density(VectorXd::Constant(1, at))); };
  const double step = 0.002;
  std::vector<double> cumulative = {0.0};
  for (double at = -10.0; at < 40.0; at += step)
    cumulative.push_back(cumulative.back() + step * density(at + 0.5 * step));
  // Midpoints see the steps of the density at seven knots to within one step of the grid.
  EXPECT_NEAR(cumulative.back(), 1.0, 0.002);
  std::vector<double> draws;
  for (int i = 0; i < 20000; ++i) draws.push_back(mixture.draw(stream)[0]);
  // Exceeded with probability 1e-4 (Kolmogorov), and the grid's error.
  EXPECT_LT(kolmogorov_distance(draws,
                                [&](double at) {
                                  const double k = std::clamp((at + 10.0) / step, 0.0, 25000.0);
                                  return cumulative[static_cast<std::size_t>(k)];
                                }),
            2.23 / std::sqrt(20000.0) + 0.003);
}

TEST(SkewedMixture, GradientIsThatOfTheDensity) {
  const MatrixXd x = exponential_and_normal(500);
  Stream stream(1, 7, 3);
  const auto mixture = SkewedMixture::fit(x, VectorXd::Constant(500, 1.0 / 500), 2, 8.0, stream);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd at = 2.0 * normal_vector(2, 85 + i);
    const VectorXd expected =
        numerical_gradient([&](const VectorXd& z) { return mixture.log_density(z); }, at);
    EXPECT_LT((mixture.gradient(at) - expected).norm(), 1e-7);
  }
}

}  // namespace
}  // namespace amiss
