#include <gtest/gtest.h>

#include <boost/math/distributions/normal.hpp>
#include <cmath>

#include "engine/random/TruncatedNormal.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

// P(X <= x | lower <= X <= upper) of N(centre, 1), from whichever end loses no digits.
double probability(double x, double centre, double lower, double upper) {
  const boost::math::normal normal(centre, 1.0);
  if (upper <= centre)
    return (cdf(normal, x) - cdf(normal, lower)) / (cdf(normal, upper) - cdf(normal, lower));
  const auto above = [&](double at) { return cdf(complement(normal, at)); };
  return (above(lower) - above(x)) / (above(lower) - above(upper));
}

TEST(TruncatedQuantile, IsTheInverseOfTheProbability) {
  for (double centre : {-25.0, -9.0, -3.0, -0.5, 0.0, 0.7, 4.0, 9.0, 25.0})
    for (double u : {0.001, 0.01, 0.3, 0.9, 0.999})
      EXPECT_NEAR(probability(truncated_quantile(u, centre, -1, 1), centre, -1, 1), u, 1e-9);
}

TEST(TruncatedQuantile, FarOutsideIsExponential) {
  // Of the exponential the second order is missing: 1 / distance^2.
  for (double distance : {31.0, 35.0})
    for (double u : {0.01, 0.3, 0.9}) {
      EXPECT_NEAR(probability(truncated_quantile(u, 1 + distance, -1, 1), 1 + distance, -1, 1), u,
                  2 / (distance * distance));
      EXPECT_NEAR(probability(truncated_quantile(u, -1 - distance, -1, 1), -1 - distance, -1, 1), u,
                  2 / (distance * distance));
    }
  // Where the distribution function has underflowed.
  EXPECT_NEAR(truncated_quantile(0.5, 1001, -1, 1), 1 - std::log(2.0) / 1000, 1e-6);
  EXPECT_NEAR(truncated_quantile(0.5, -1001, -1, 1), -1 + std::log(2.0) / 1000, 1e-6);
}

TEST(TruncatedQuantile, StaysWithinItsEnds) {
  for (double centre : {-1000.0, -40.0, 0.0, 40.0, 1000.0})
    for (double u : {0.0, 1e-300, 0.5, 1.0}) {
      const double x = truncated_quantile(u, centre, -1, 1);
      EXPECT_GE(x, -1);
      EXPECT_LE(x, 1);
    }
  EXPECT_EQ(truncated_quantile(0.3, 0.0, 0.5, 0.5), 0.5);
}

}  // namespace
}  // namespace amiss
