#include <gtest/gtest.h>

#include <boost/math/distributions/gamma.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <set>

#include "engine/random/Stream.hpp"
#include "engine/random/transform.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

// A sample of n values from the stated distribution exceeds 2.23 / sqrt(n) with probability 1e-4
// (Kolmogorov).
constexpr int kDraws = 20000;
const double kDistance = 2.23 / std::sqrt(static_cast<double>(kDraws));

std::vector<double> sample(const std::function<double()>& draw) {
  std::vector<double> values(kDraws);
  for (double& value : values) value = draw();
  return values;
}

TEST(Stream, SameTripleGivesSameBits) {
  Stream a(7, 2, 5), b(7, 2, 5);
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(a.uniform(), b.uniform());
    ASSERT_EQ(a.normal(), b.normal());
    ASSERT_EQ(a.gamma(1.7), b.gamma(1.7));
  }
}

TEST(Stream, EveryTripleGivesAnotherStream) {
  std::set<double> first;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    for (std::uint64_t purpose = 0; purpose < 10; ++purpose) {
      for (std::uint64_t item = 0; item < 10; ++item) first.insert(Stream(seed, purpose, item).uniform());
    }
  }
  EXPECT_EQ(first.size(), 1000u);
}

TEST(Stream, FirstDrawsOfNeighbouringItemsAreUniform) {
  std::uint64_t item = 0;
  EXPECT_LT(
      kolmogorov_distance(sample([&] { return Stream(1, 1, item++).uniform(); }), [](double u) { return u; }),
      kDistance);
}

TEST(Stream, NeighbouringItemsAreUncorrelated) {
  Stream a(3, 1, 0), b(3, 1, 1);
  const VectorXd x = a.normals(kDraws), y = b.normals(kDraws);
  // A correlation of n independent pairs has standard error 1 / sqrt(n); 4 of them.
  EXPECT_LT(std::abs(x.dot(y)) / kDraws, 4 / std::sqrt(static_cast<double>(kDraws)));
}

TEST(Stream, UniformHasItsDistribution) {
  Stream stream(11, 1, 1);
  EXPECT_LT(kolmogorov_distance(sample([&] { return stream.uniform(); }), [](double u) { return u; }),
            kDistance);
}

TEST(Stream, NormalHasItsDistribution) {
  Stream stream(12, 1, 1);
  const boost::math::normal normal;
  EXPECT_LT(
      kolmogorov_distance(sample([&] { return stream.normal(); }), [&](double x) { return cdf(normal, x); }),
      kDistance);
}

TEST(Stream, GammaHasItsDistributionBelowAndAboveShapeOne) {
  for (double shape : {0.4, 1.0, 6.5}) {
    Stream stream(13, 1, 1);
    const boost::math::gamma_distribution<> gamma(shape, 1.0);
    EXPECT_LT(kolmogorov_distance(sample([&] { return stream.gamma(shape); }),
                                  [&](double x) { return cdf(gamma, x); }),
              kDistance)
        << shape;
  }
}

TEST(Stream, IndexHitsEveryValueEquallyOften) {
  Stream stream(14, 1, 1);
  std::vector<int> hits(7, 0);
  for (int i = 0; i < 7000; ++i) ++hits.at(static_cast<std::size_t>(stream.index(7)));
  // Binomial(7000, 1/7): standard deviation 29.3; 4.5 of them for the largest of seven.
  for (int h : hits) EXPECT_NEAR(h, 1000, 132);
}

TEST(Stream, NormalMatrixContinuesTheSameSequence) {
  Stream a(5, 1, 0), b(5, 1, 0);
  const MatrixXd x = a.normals(3, 4);
  ASSERT_EQ(x.rows(), 3);
  ASSERT_EQ(x.cols(), 4);
  for (Index i = 0; i < x.size(); ++i) EXPECT_EQ(x.data()[i], b.normal());
}

TEST(Transform, NormalCdfIsAccurateInBothTails) {
  const boost::math::normal normal;
  for (double x : {-30.0, -8.0, -2.5, -0.1, 0.0, 0.7, 3.0, 8.0}) {
    EXPECT_NEAR(normal_cdf(x) / cdf(normal, x), 1.0, 1e-12) << x;
  }
}

}  // namespace
}  // namespace amiss
