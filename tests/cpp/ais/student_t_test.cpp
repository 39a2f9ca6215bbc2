#include <gtest/gtest.h>

#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <vector>

#include "ais_helpers.hpp"
#include "engine/ais/StudentT.hpp"

namespace amiss {
namespace {

using namespace test;

const VectorXd kLocation = Eigen::Vector2d(1.0, -2.0);
const MatrixXd kRoot = (Eigen::Matrix2d() << 1.5, 0.0, -0.8, 0.6).finished();
constexpr double kDof = 4.0;

TEST(StudentT, DensityInOneDimensionIsStudents) {
  const boost::math::students_t t(5.0);
  const StudentT own(VectorXd::Constant(1, 2.0), MatrixXd::Constant(1, 1, 3.0), 5.0);
  for (double x : {-20.0, 0.0, 2.0, 5.5}) {
    EXPECT_NEAR(own.log_density(VectorXd::Constant(1, x)), std::log(pdf(t, (x - 2.0) / 3.0) / 3.0), 1e-12)
        << x;
  }
}

TEST(StudentT, DensityInTwoDimensionsIsMarginalTimesConditional) {
  const MatrixXd scale = kRoot * kRoot.transpose();
  const StudentT own(kLocation, kRoot, kDof);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd x = 2.0 * normal_vector(2, 60 + i);
    const double d = (x[0] - kLocation[0]) / std::sqrt(scale(0, 0));
    const double marginal = pdf(boost::math::students_t(kDof), d) / std::sqrt(scale(0, 0));
    // Roth (2013): the conditional is a t with one more degree of freedom.
    const double centre = kLocation[1] + scale(1, 0) / scale(0, 0) * (x[0] - kLocation[0]);
    const double width =
        std::sqrt((kDof + d * d) / (kDof + 1) * (scale(1, 1) - scale(1, 0) * scale(1, 0) / scale(0, 0)));
    const double conditional = pdf(boost::math::students_t(kDof + 1), (x[1] - centre) / width) / width;
    EXPECT_NEAR(own.log_density(x), std::log(marginal * conditional), 1e-12);
  }
}

// Kolmogorov distances of both coordinates and of a slanted one, each in units in which it is a standard t.
void expect_student(const std::vector<VectorXd>& points) {
  const boost::math::students_t t(kDof);
  for (const VectorXd& direction :
       {VectorXd(Eigen::Vector2d(1, 0)), VectorXd(Eigen::Vector2d(0, 1)), VectorXd(Eigen::Vector2d(1, 2))}) {
    const double width = (kRoot.transpose() * direction).norm();
    std::vector<double> z;
    for (const VectorXd& x : points) z.push_back(direction.dot(x - kLocation) / width);
    // Exceeded with probability 1e-4 (Kolmogorov).
    EXPECT_LT(kolmogorov_distance(z, [&](double x) { return cdf(t, x); }),
              2.23 / std::sqrt(static_cast<double>(z.size())));
  }
}

TEST(StudentT, GradientIsThatOfTheDensity) {
  const StudentT own(kLocation, kRoot, kDof);
  MatrixXd x = 0.5 * normal_matrix(2, 400, 75);
  x.leftCols(100).row(0).array() += 3.0;
  Stream stream(1, 1, 5);
  const auto mixture = StudentTMixture::fit(x, VectorXd::Constant(400, 1.0 / 400), 3, 8.0, stream);
  ASSERT_EQ(mixture.size(), 2u);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd at = 2.0 * normal_vector(2, 76 + i);
    // Central differences of step 1e-5 are right to about 1e-9 here.
    const auto check = [&](const auto& density) {
      const VectorXd expected =
          numerical_gradient([&](const VectorXd& z) { return density.log_density(z); }, at);
      EXPECT_LT((density.gradient(at) - expected).norm(), 1e-7);
    };
    check(own);
    check(mixture);
  }
}

TEST(StudentT, DrawsHaveTheDistribution) {
  const StudentT own(kLocation, kRoot, kDof);
  Stream stream(1, 2, 3);
  std::vector<VectorXd> points;
  for (int i = 0; i < 40000; ++i) points.push_back(own.draw(stream));
  expect_student(points);
}

TEST(StudentT, StepLeavesTheDistributionAsItIs) {
  const StudentT own(kLocation, kRoot, kDof);
  for (double s : {0.2, 0.7, 1.0}) {
    Stream stream(1, 2, 4);
    std::vector<VectorXd> points;
    for (int i = 0; i < 40000; ++i) {
      VectorXd x = own.draw(stream);
      for (int k = 0; k < 3; ++k) x = own.step(x, s, stream).to;
      points.push_back(x);
    }
    expect_student(points);
  }
}

TEST(StudentT, StepIsReversible) {
  const StudentT own(kLocation, kRoot, kDof);
  Stream stream(1, 2, 5);
  const auto radius = [&](const VectorXd& x) {
    return kRoot.triangularView<Eigen::Lower>().solve(x - kLocation).norm();
  };
  int outwards = 0, inwards = 0;
  for (int i = 0; i < 200000; ++i) {
    const VectorXd x = own.draw(stream), y = own.step(x, 0.6, stream).to;
    outwards += radius(x) < 1.0 && radius(y) > 2.0 ? 1 : 0;
    inwards += radius(x) > 2.0 && radius(y) < 1.0 ? 1 : 0;
  }
  ASSERT_GT(outwards, 1000);
  // Given their sum, one of both counts is Binomial(sum, 1/2): 4 standard deviations of the difference.
  EXPECT_LT(std::abs(outwards - inwards), 4 * std::sqrt(static_cast<double>(outwards + inwards)));
}

TEST(StudentT, ShortStepsStayClose) {
  const StudentT own(kLocation, kRoot, kDof);
  Stream stream(1, 2, 6);
  for (int i = 0; i < 100; ++i) EXPECT_LT((own.step(kLocation, 1e-6, stream).to - kLocation).norm(), 1e-3);
}

TEST(StudentT, FitMatchesWeightedMomentsShrunkTowardsTheDiagonal) {
  const MatrixXd x = kRoot * normal_matrix(2, 9, 61);
  const VectorXd raw = uniform_matrix(9, 1, 62), weights = raw / raw.sum();
  const VectorXd mean = x * weights;
  MatrixXd scale = (x.colwise() - mean) * weights.asDiagonal() * (x.colwise() - mean).transpose();
  const double points = 1 / weights.squaredNorm(), shrink = points / (points + 2);
  scale(0, 1) *= shrink;
  scale(1, 0) *= shrink;
  const StudentT expected(mean, scale.llt().matrixL(), 6.0), own = StudentT::fit(x, weights, 6.0);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd at = normal_vector(2, 63 + i);
    EXPECT_NEAR(own.log_density(at), expected.log_density(at), 1e-10);
  }
}

TEST(StudentTMixture, FindsTwoSeparateComponents) {
  MatrixXd x = 0.5 * normal_matrix(2, 400, 71);
  x.leftCols(100).row(0).array() += 6.0;
  Stream stream(1, 1, 1);
  const auto mixture = StudentTMixture::fit(x, VectorXd::Constant(400, 1.0 / 400), 3, 8.0, stream);
  ASSERT_EQ(mixture.size(), 2u);
  // A quarter of the mass lies in the component on the right; Binomial(4000, 1/4), 4 standard deviations.
  int right = 0;
  for (int i = 0; i < 4000; ++i) right += mixture.draw(stream)[0] > 3.0 ? 1 : 0;
  EXPECT_NEAR(right, 1000, 110);
}

TEST(StudentTMixture, OneComponentServesOneCluster) {
  Stream stream(1, 1, 2);
  EXPECT_EQ(
      StudentTMixture::fit(normal_matrix(3, 400, 72), VectorXd::Constant(400, 1.0 / 400), 3, 8.0, stream)
          .size(),
      1u);
}

TEST(StudentTMixture, WeightsOfThePointsCount) {
  MatrixXd x = 0.5 * normal_matrix(1, 400, 73);
  x.leftCols(200).array() += 6.0;
  VectorXd weights = VectorXd::Constant(400, 1.0);
  weights.head(200).setConstant(9.0);
  weights /= weights.sum();
  Stream stream(1, 1, 3);
  const auto mixture = StudentTMixture::fit(x, weights, 2, 8.0, stream);
  ASSERT_EQ(mixture.size(), 2u);
  const VectorXd left = VectorXd::Zero(1), right = VectorXd::Constant(1, 6.0);
  // Densities at the centres stand as 9 to 1; scales of clusters estimated from 200 points differ by 10 % or
  // less.
  EXPECT_NEAR(mixture.log_density(right) - mixture.log_density(left), std::log(9.0), 0.25);
}

TEST(StudentTMixture, DensityIsNormalised) {
  MatrixXd x = 0.5 * normal_matrix(1, 300, 74);
  x.leftCols(100).array() += 5.0;
  Stream stream(1, 1, 4);
  const auto mixture = StudentTMixture::fit(x, VectorXd::Constant(300, 1.0 / 300), 3, 8.0, stream);
  // Substitution x = tan(a) maps the line onto (-pi/2, pi/2).
  const int n = 200000;
  const double pi = std::acos(-1.0), h = pi / n;
  double total = 0.0;
  for (int i = 1; i < n; ++i) {
    const double a = -pi / 2 + h * i;
    total += std::exp(mixture.log_density(VectorXd::Constant(1, std::tan(a)))) / std::pow(std::cos(a), 2) * h;
  }
  EXPECT_NEAR(total, 1.0, 1e-6);
}

}  // namespace
}  // namespace amiss
