#include <gtest/gtest.h>

#include <boost/math/distributions/normal.hpp>
#include <stdexcept>

#include "engine/ais/Sampler.hpp"
#include "engine/calibration/Calibration.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

// Two coefficients of very different size, smooth in the parameters; hyper-parameters as given.
Emulator make_emulator(Index n_inputs) {
  EmulatorState state;
  state.inputs = uniform_matrix(15, n_inputs, 81);
  state.coefficients.resize(15, 2);
  for (Index m = 0; m < 15; ++m) {
    state.coefficients(m, 0) = 0.02 * std::sin(2.0 * state.inputs(m, 0));
    state.coefficients(m, 1) = 20.0 + 3.0 * state.inputs.row(m).sum();
  }
  state.parameters = MatrixXd::Constant(2, n_inputs + 3, 1.5);
  state.parameters.col(0).setConstant(1.0);
  state.parameters.col(1).setConstant(-5.0);
  state.parameters.col(2).setConstant(6.0);
  return Emulator(state);
}

std::vector<CoefficientData> make_data() {
  std::vector<CoefficientData> data;
  for (int j = 0; j < 3; ++j) {
    CoefficientData own;
    own.estimate = Eigen::Vector2d(0.015 + 0.001 * j, 21.4 - 0.2 * j);
    const double a = 0.002 + 0.001 * j, b = 0.3 + 0.1 * j;
    own.covariance = (Eigen::Matrix2d() << a * a, 0.6 * a * b, 0.6 * a * b, b * b).finished();
    own.log_jacobian = -4.0 + 0.7 * j;
    data.push_back(own);
  }
  return data;
}

double cdf_normal(double x) { return cdf(boost::math::normal(), x); }

TEST(CalibrationTarget, UnitIsTheNormalDistributionFunctionPointByPoint) {
  const MatrixXd x = normal_matrix(2, 4, 82), u = CalibrationTarget::unit(x);
  ASSERT_EQ(u.rows(), 4);
  ASSERT_EQ(u.cols(), 2);
  for (Index i = 0; i < 4; ++i) {
    for (Index p = 0; p < 2; ++p) EXPECT_NEAR(u(i, p), cdf_normal(x(p, i)), 1e-14);
  }
}

TEST(CalibrationTarget, DensitiesEqualTheDenseGaussianOnes) {
  const Emulator emulator = make_emulator(2);
  const std::vector<CoefficientData> data = make_data();
  const CalibrationTarget target(emulator, data);
  ASSERT_EQ(target.dimension(), 2);
  const MatrixXd x = normal_matrix(2, 5, 83);
  const MatrixXd own = target.log_densities(x);
  ASSERT_EQ(own.rows(), 3);
  ASSERT_EQ(own.cols(), 5);
  for (Index i = 0; i < 5; ++i) {
    MatrixXd mean, variance;
    emulator.predict(x.col(i).transpose().unaryExpr(&cdf_normal), mean, variance);
    for (std::size_t j = 0; j < data.size(); ++j) {
      // The density of two variables written out: condition numbers do not matter here.
      const Eigen::Matrix2d c = data[j].covariance + MatrixXd(variance.row(0).asDiagonal());
      const Eigen::Vector2d d = data[j].estimate - mean.row(0).transpose();
      const double det = c(0, 0) * c(1, 1) - c(0, 1) * c(0, 1);
      const double square = (c(1, 1) * d[0] * d[0] - 2 * c(0, 1) * d[0] * d[1] + c(0, 0) * d[1] * d[1]) / det;
      EXPECT_NEAR(own(static_cast<Index>(j), i), data[j].log_jacobian - kLogTwoPi - 0.5 * (std::log(det) + square),
                  1e-9 * (1 + square));
    }
  }
}

TEST(CalibrationTarget, EmulatorVarianceMatters) {
  const Emulator emulator = make_emulator(2);
  MatrixXd mean, variance;
  emulator.predict(MatrixXd::Constant(1, 2, 0.5), mean, variance);
  EXPECT_GT(variance(0, 0), 1e-3 * make_data()[0].covariance(0, 0));  // else the dense comparison tests less
}

TEST(CalibrationTarget, LikelihoodIsTheMeanOverErrorDraws) {
  const Emulator emulator = make_emulator(2);
  const CalibrationTarget target(emulator, make_data());
  const MatrixXd x = 0.3 * normal_matrix(2, 5, 84);
  const MatrixXd parts = target.log_densities(x);
  const VectorXd own = target.log_likelihood(x);
  for (Index i = 0; i < 5; ++i) {
    const double top = parts.col(i).maxCoeff();
    EXPECT_NEAR(own[i], top + std::log((parts.col(i).array() - top).exp().sum() / 3.0), 1e-12);
  }
}

TEST(CalibrationTarget, EvidenceOfOneParameterEqualsQuadrature) {
  const Emulator emulator = make_emulator(1);
  const CalibrationTarget target(emulator, make_data());
  // Uniform prior of u: midpoint rule on the unit interval, through the quantile function.
  const boost::math::normal normal;
  const int n = 4000;
  MatrixXd x(1, n);
  for (int i = 0; i < n; ++i) x(0, i) = quantile(normal, (i + 0.5) / n);
  const double truth = std::log(target.log_likelihood(x).array().exp().mean());
  Context context;
  const AisResult result = sample_ais(target, {}, context);
  EXPECT_TRUE(result.trusted) << result.verdict;
  // Four reported standard errors, and well below what matters to a Bayes factor.
  EXPECT_LT(std::abs(result.log_evidence - truth), std::min(4 * result.standard_error, 0.1));
}

TEST(CalibrationTarget, CovarianceThatIsNoneGivesLikelihoodZero) {
  const Emulator emulator = make_emulator(2);
  std::vector<CoefficientData> data = make_data();
  data.resize(1);
  data[0].covariance(0, 1) = data[0].covariance(1, 0) = 100.0;
  EXPECT_EQ(CalibrationTarget(emulator, data).log_likelihood(MatrixXd::Zero(2, 1))[0],
            -std::numeric_limits<double>::infinity());
}

TEST(CalibrationTarget, NeedsErrorDraws) {
  const Emulator emulator = make_emulator(1);
  EXPECT_THROW(CalibrationTarget(emulator, {}), std::invalid_argument);
}

}  // namespace
}  // namespace amiss
