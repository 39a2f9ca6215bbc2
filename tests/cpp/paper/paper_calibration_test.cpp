#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/distributions/gamma.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <stdexcept>

#include "engine/ais/Sampler.hpp"
#include "engine/calibration/PaperCalibration.hpp"
#include "kernel_model_helpers.hpp"

namespace amiss {
namespace {

using namespace test;

Emulator make_emulator(Index n_inputs, double scale = 1.0) {
  EmulatorState state;
  state.inputs = uniform_matrix(20, n_inputs, 91);
  state.coefficients.resize(20, kQ);
  for (Index m = 0; m < 20; ++m) {
    state.coefficients(m, 0) = 0.02 * std::sin(2.0 * state.inputs(m, 0)) / scale;
    state.coefficients(m, 1) = (3.0 + state.inputs(m, 0)) / scale;
    state.coefficients(m, 2) = (20.5 + state.inputs.row(m).sum()) / scale;
  }
  state.parameters = MatrixXd::Constant(kQ, n_inputs + 3, 1.0);
  state.parameters.col(0).setConstant(1.0);
  state.parameters.col(1).setConstant(-3.0);
  state.parameters.col(2).setConstant(6.0);
  return Emulator(state);
}

TEST(PaperCalibration, InsideTimesOutsideIsTheDensityOfTheMeasurement) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  const PaperCalibration inside(data.y, data.basis);
  const VectorXd mean = Eigen::Vector3d(0.015, 3.4, 20.6), variance = Eigen::Vector3d(1e-6, 0.04, 0.2);
  const MatrixXd h = complement(data.basis);
  for (const KernelParameters& p : make_points()) {
    const MatrixXd& k = data.basis;
    const MatrixXd covariance = h * h.transpose() * dense_kernel(data, p) * h * h.transpose() +
                                k * variance.asDiagonal() * k.transpose() +
                                MatrixXd::Identity(kN, kN) / p.lambda;
    const double own =
        inside.log_density(mean, variance, VectorXd::Constant(1, p.lambda)) + model.log_likelihood(p);
    EXPECT_NEAR(own, log_normal_density(data.y, k * mean, covariance), 1e-8);
  }
}

TEST(PaperCalibration, UnitOfTheBasisDoesNotMatter) {
  const KernelData data = make_data();
  const NoisePrior noise{0.3, 6.0};
  for (double scale : {100.0, 1e-3}) {
    KernelData other = data;
    other.basis *= scale;
    const PaperCalibration a(data.y, data.basis), b(other.y, other.basis);
    const Emulator first = make_emulator(2), second = make_emulator(2, scale);
    const KernelModel outside_a = make_model(data), outside_b = make_model(other);
    for (bool shared : {false, true}) {
      const PaperCalibrationTarget one(a, first, noise, shared), two(b, second, noise, shared);
      const MatrixXd x = normal_matrix(one.dimension(), 6, 92), x6 = normal_matrix(6, 6, 93);
      const VectorXd v = one.log_likelihood(x) + KernelTarget(outside_a).log_likelihood(x6);
      const VectorXd w = two.log_likelihood(x) + KernelTarget(outside_b).log_likelihood(x6);
      for (Index i = 0; i < 6; ++i) EXPECT_NEAR(v[i], w[i], 1e-8 * (1 + std::abs(v[i])));
    }
  }
}

TEST(PaperCalibration, OrderOfTheTimeStepsDoesNotMatter) {
  const KernelData data = make_data();
  const PaperCalibration a(data.y, data.basis), b(data.y.reverse(), data.basis.colwise().reverse());
  const VectorXd mean = Eigen::Vector3d(0.015, 3.4, 20.6), variance = Eigen::Vector3d(1e-6, 0.04, 0.2);
  const VectorXd lambda = Eigen::Vector3d(9.0, 11.0, 30.0);
  EXPECT_NEAR(a.log_density(mean, variance, lambda), b.log_density(mean, variance, lambda), 1e-8);
}

// Without emulator variance lambda*_q can be integrated: w*_q is a Student t of 2 a* degrees of freedom with
// scale sqrt(b* / (a* k_q'k_q)). That scale is the scaling of the prior.
TEST(PaperCalibration, PrecisionIntegratesToAStudentT) {
  const KernelData data = make_data();
  const PaperCalibration inside(data.y, data.basis);
  const NoisePrior noise{0.3, 2.5};
  const VectorXd scale = (noise.sd * noise.sd / inside.norms().array()).sqrt();
  VectorXd mean = inside.estimate() + 1.7 * scale;
  double expected = inside.log_jacobian(), own = inside.log_jacobian();
  for (Index q = 0; q < kQ; ++q) {
    const boost::math::students_t t(2 * noise.shape);
    expected += std::log(pdf(t, 1.7) / scale[q]);
    // All other terms are constant in lambda*_q: their value at lambda = 1 is taken off.
    const VectorXd others =
        inside.log_density(mean, VectorXd::Zero(kQ), VectorXd::Ones(kQ)) * VectorXd::Ones(1);
    const double term = -0.5 * (kLogTwoPi - std::log(inside.norms()[q]) +
                                std::pow(mean[q] - inside.estimate()[q], 2) * inside.norms()[q]);
    own += quadrature([&](double x) {
      VectorXd lambda = VectorXd::Ones(kQ);
      lambda[q] = noise.precision(x);
      return inside.log_density(mean, VectorXd::Zero(kQ), lambda) - (others[0] - term);
    });
  }
  EXPECT_NEAR(own, expected, 1e-6);
}

TEST(PaperCalibration, ColumnsMustBeOrthogonal) {
  const KernelData data = make_data();
  MatrixXd skew = data.basis;
  skew.col(0).array() += 0.1;
  EXPECT_THROW(PaperCalibration(data.y, skew), std::invalid_argument);
  EXPECT_THROW(PaperCalibration(data.y.head(kN - 1), data.basis), std::invalid_argument);
  skew = data.basis;
  skew.col(1).setZero();
  EXPECT_THROW(PaperCalibration(data.y, skew), std::invalid_argument);
}

TEST(PaperCalibrationTarget, CoordinatesAreTheParametersThenThePrecisions) {
  const KernelData data = make_data();
  const PaperCalibration inside(data.y, data.basis);
  const Emulator emulator = make_emulator(2);
  const NoisePrior noise{0.3, 6.0};
  const PaperCalibrationTarget own(inside, emulator, noise, false), shared(inside, emulator, noise, true);
  ASSERT_EQ(own.dimension(), 2 + kQ);
  ASSERT_EQ(shared.dimension(), 2 + 1);
  const boost::math::gamma_distribution<> prior(6.0, 1 / (6.0 * 0.09));
  const MatrixXd x = normal_matrix(2 + kQ, 4, 94), u = own.unit(x), lambda = own.lambda(x);
  for (Index i = 0; i < 4; ++i) {
    for (Index p = 0; p < 2; ++p) EXPECT_NEAR(u(i, p), cdf_normal(x(p, i)), 1e-14);
    for (Index q = 0; q < kQ; ++q) EXPECT_NEAR(cdf(prior, lambda(i, q)), cdf_normal(x(2 + q, i)), 1e-12);
    MatrixXd mean, variance;
    emulator.predict(u.row(i), mean, variance);
    EXPECT_NEAR(
        own.log_likelihood(x.col(i))[0],
        inside.log_density(mean.row(0).transpose(), variance.row(0).transpose(), lambda.row(i).transpose()),
        1e-10);
  }
  MatrixXd same = x;
  same.bottomRows(kQ).rowwise() = x.row(2);
  const VectorXd a = own.log_likelihood(same), b = shared.log_likelihood(x.topRows(3));
  for (Index i = 0; i < 4; ++i) EXPECT_NEAR(a[i], b[i], 1e-10);
}

TEST(PaperCalibrationTarget, EvidenceEqualsQuadrature) {
  const KernelData data = make_data();
  const PaperCalibration inside(data.y, data.basis);
  const Emulator emulator = make_emulator(1);
  const PaperCalibrationTarget target(inside, emulator, {0.3, 6.0}, true);
  const double truth = evidence_by_quadrature(target);
  const AisResult result = sample_ais(target, {}, Context());
  EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
  EXPECT_LT(std::abs(result.log_evidence - truth), std::min(4 * result.standard_error, 0.1));
}

}  // namespace
}  // namespace amiss
