#include <gtest/gtest.h>

#include <boost/math/distributions/normal.hpp>

#include "engine/ais/Sampler.hpp"
#include "engine/calibration/Calibration.hpp"
#include "engine/calibration/ParameterModes.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

constexpr Index kN = 30;

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

HistoryData make_data() {
  HistoryData data;
  data.axis = uneven_axis(kN, {14});
  data.basis.resize(kN, 2);
  data.basis << 60.0 * normal_vector(kN, 82), VectorXd::Ones(kN);
  data.responses = normal_matrix(kN, 3, 83);
  data.condition = {0, 0, 1};
  data.y = data.basis * Eigen::Vector2d(0.015, 21.4) + normal_vector(kN, 84);
  return data;
}

HistoryModel make_model(const ErrorOptions& error) {
  HistoryPriors priors;
  priors.noise_sd = 0.9;
  priors.error = error;
  return HistoryModel(make_data(), priors, Context());
}

const ErrorOptions kError{VectorXd::Constant(1, 2.0), Eigen::Vector2d(0.0, 3.0)};

StudentTMixture make_reference(Index dimension, double width) {
  Stream stream(1, 1, 1);
  const MatrixXd points = width * normal_matrix(dimension, 300, 85);
  return StudentTMixture::fit(points, VectorXd::Constant(300, 1.0 / 300), 1, 8.0, stream);
}

double log_prior(const VectorXd& x) {
  return -0.5 * (x.squaredNorm() + kLogTwoPi * static_cast<double>(x.size()));
}

double cdf_normal(double x) { return cdf(boost::math::normal(), x); }

// log p(y | sigma, t, z) written down for y itself: y = K w + discrepancy + error, w ~ N(w'(z), S(z)), the
// discrepancy in the complement of K under the metric of the error.
double dense_density(const HistoryData& data, const HistoryParameters& p, const VectorXd& ratios,
                     const Emulator& emulator, const VectorXd& u) {
  const MatrixXd error = error_covariance(data.axis, kError.correlation_times, ratios);
  const MatrixXd inverse = error.inverse();
  const MatrixXd& k = data.basis;
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < 3; ++j) {
    phi.col(j) *= std::sqrt(p.t[data.condition[j]] / (j < 2 ? 2.0 : 1.0) * kN / phi.col(j).squaredNorm());
  }
  phi -= MatrixXd(k * (k.transpose() * inverse * k).inverse() * k.transpose() * inverse * phi);
  MatrixXd mean, variance;
  emulator.predict(u.transpose(), mean, variance);
  const MatrixXd covariance =
      p.variance * error + phi * phi.transpose() + k * MatrixXd(variance.row(0).asDiagonal()) * k.transpose();
  return log_normal_density(data.y, k * mean.row(0).transpose(), covariance);
}

struct Joint {
  Emulator emulator = make_emulator(2);
  HistoryModel model = make_model(kError);
  HistoryTarget history{model, {0, 1}};
  CalibrationTarget target(double width = 1.0) const {
    return {history, make_reference(history.dimension(), width), emulator};
  }
};

TEST(CalibrationTarget, CoordinatesAreTheHistorysThenTheParameters) {
  const Joint joint;
  const CalibrationTarget target = joint.target();
  ASSERT_EQ(target.dimension(), 4 + 2);
  const MatrixXd x = normal_matrix(6, 3, 86), u = target.unit(x);
  ASSERT_EQ(u.rows(), 3);
  ASSERT_EQ(u.cols(), 2);
  for (Index i = 0; i < 3; ++i) {
    for (Index p = 0; p < 2; ++p) EXPECT_NEAR(u(i, p), cdf_normal(x(4 + p, i)), 1e-14);
    const HistoryParameters own = target.history(x.col(i)),
                            expected = joint.history.parameters(x.col(i).head(4));
    EXPECT_EQ(own.variance, expected.variance);
    EXPECT_EQ(own.setting, expected.setting);
    EXPECT_EQ(own.t, expected.t);
  }
}

TEST(CalibrationTarget, ReferenceTimesLikelihoodIsPriorTimesTheDenseDensityOfTheMeasurement) {
  const Joint joint;
  const CalibrationTarget target = joint.target();
  const MatrixXd x = 0.7 * normal_matrix(6, 8, 87);
  const VectorXd own = target.log_likelihood(x);
  const MatrixXd u = target.unit(x);
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters p = target.history(x.col(i));
    const double dense =
        dense_density(make_data(), p, kError.setting(p.setting), joint.emulator, u.row(i).transpose());
    EXPECT_NEAR(own[i] + target.log_reference(x.col(i)), log_prior(x.col(i)) + dense,
                1e-8 * (1 + std::abs(dense)));
  }
}

TEST(CalibrationTarget, EmulatorVarianceMatters) {
  const Joint joint;
  MatrixXd mean, variance;
  joint.emulator.predict(MatrixXd::Constant(1, 2, 0.5), mean, variance);
  const MatrixXd root = joint.model.whitened(0).root;
  const MatrixXd noise = (root.transpose() * root).inverse();
  // Else the dense comparison would not see it.
  EXPECT_GT(variance(0, 0) / noise(0, 0), 1e-3);
  EXPECT_GT(variance(0, 1) / noise(1, 1), 1e-3);
}

TEST(CalibrationTarget, ReferenceIsTheMixtureTimesThePriorOfTheParameters) {
  const Joint joint;
  const CalibrationTarget target = joint.target(0.5);
  const StudentTMixture mixture = make_reference(4, 0.5);
  const VectorXd x = normal_vector(6, 88);
  EXPECT_NEAR(target.log_reference(x), mixture.log_density(x.head(4)) + log_prior(x.tail(2)), 1e-12);
  Stream stream(1, 2, 3);
  MatrixXd draws(6, 4000);
  for (Index i = 0; i < draws.cols(); ++i) draws.col(i) = target.draw_reference(stream);
  const VectorXd sd = (draws.rowwise().squaredNorm() / 4000).cwiseSqrt();
  // A t of 8 degrees of freedom with scale 0.5 has sd 0.577; scale of 300 points 4 %, sd of 4000 draws 2 %: 4
  // of both.
  for (Index d = 0; d < 4; ++d) EXPECT_NEAR(sd[d], 0.577, 0.18 * 0.577);
  // Standard normal: sd of 4000 draws is known to 1.1 %; 4.5 of them.
  for (Index d = 4; d < 6; ++d) EXPECT_NEAR(sd[d], 1.0, 0.05);
}

// Log evidence of a target of two coordinates: trapezoidal rule over prior times likelihood, accurate to
// rounding for a smooth integrand.
double evidence_by_quadrature(const CalibrationTarget& target) {
  const int m = 400;
  const double h = 16.0 / m;
  VectorXd log_terms((m + 1) * (m + 1));
  MatrixXd row(2, m + 1);
  for (int i = 0; i <= m; ++i) {
    for (int j = 0; j <= m; ++j) row.col(j) = Eigen::Vector2d(-8 + h * i, -8 + h * j);
    const VectorXd ll = target.log_likelihood(row);
    for (int j = 0; j <= m; ++j) log_terms[i * (m + 1) + j] = ll[j] + target.log_reference(row.col(j));
  }
  const double top = log_terms.maxCoeff();
  return top + std::log((log_terms.array() - top).exp().sum() * h * h);
}

TEST(CalibrationTarget, EvidenceEqualsQuadratureWhateverTheReference) {
  const Emulator emulator = make_emulator(1);
  const HistoryModel model = make_model({});
  const HistoryTarget history(model, {});  // coordinates: sigma and one parameter
  const CalibrationTarget exact(history, make_reference(1, 1.0), emulator);
  const double truth = evidence_by_quadrature(exact);
  for (double width : {0.6, 1.0, 1.5}) {
    const CalibrationTarget target(history, make_reference(1, width), emulator);
    const AisResult result = sample_ais(target, {}, Context());
    EXPECT_TRUE(result.trusted) << result.verdict;
    // Four reported standard errors, and well below what matters to a Bayes factor.
    EXPECT_LT(std::abs(result.log_evidence - truth), std::min(4 * result.standard_error, 0.1)) << width;
  }
}

TEST(CalibrationTarget, UnitsOfTheBasisDoNotMatter) {
  const Joint joint;
  HistoryData scaled = make_data();
  scaled.basis *= 100.0;
  EmulatorState state = joint.emulator.state();
  state.coefficients /= 100.0;
  const Emulator emulator(state);
  HistoryPriors priors = joint.model.priors();
  const HistoryModel model(scaled, priors, Context());
  const HistoryTarget history(model, {0, 1});
  const CalibrationTarget other(history, make_reference(4, 1.0), emulator);
  const MatrixXd x = normal_matrix(6, 5, 89);
  const VectorXd a = joint.target().log_likelihood(x), b = other.log_likelihood(x);
  for (Index i = 0; i < 5; ++i) EXPECT_NEAR(a[i], b[i], 1e-7 * (1 + std::abs(a[i])));
}

// One parameter: modes and their scales are seen on a fine grid.
TEST(ParameterModes, AreThoseOfAFineGrid) {
  const Emulator emulator = make_emulator(1);
  const HistoryModel model = make_model({});
  const HistoryTarget history(model, {});
  const CalibrationTarget target(history, make_reference(1, 1.0), emulator);
  const HistoryParameters point = history.parameters(VectorXd::Zero(1));
  const MatrixXd grid = Eigen::RowVectorXd::LinSpaced(4001, -4.0, 4.0);
  MatrixXd mean, variance;
  emulator.predict(target.unit((MatrixXd(2, 4001) << MatrixXd::Zero(1, 4001), grid).finished()), mean,
                   variance);
  VectorXd exact(4001), fitted(4001);
  Stream stream(1, 2, 3);
  const ParameterModes modes = parameter_modes(target, {point}, {}, Context(), stream);
  EXPECT_GT(modes.evaluations, 256);
  for (Index i = 0; i < 4001; ++i) {
    exact[i] = target.log_density_inside(point, mean.row(i), variance.row(i)) - 0.5 * grid(0, i) * grid(0, i);
    fitted[i] = modes.mixture.log_density(grid.col(i));
  }
  const VectorXd p = normalised_exp(exact), q = normalised_exp(fitted);
  // The weights p / q have a second moment of 1 / (effective share); the widened t gives up a few tenths.
  EXPECT_LT((p.array().square() / q.array()).sum(), 1.6);
}

TEST(ParameterModes, TellWhereTheRecordContradictsTheHistoryPosterior) {
  const Emulator emulator = make_emulator(1);
  const HistoryModel model = make_model({});
  const HistoryTarget history(model, {});
  const CalibrationTarget target(history, make_reference(1, 1.0), emulator);
  const HistoryParameters point = history.parameters(VectorXd::Zero(1));
  Stream stream(1, 2, 3);
  const ParameterModes near = parameter_modes(target, {point}, {}, Context(), stream);
  ASSERT_EQ(near.misfits.size(), 1);
  EXPECT_LT(near.misfits[0], 6.0);
  // Misfit at the mode, written down: one parameter, two coefficients.
  MatrixXd mean, variance;
  double least = 0.0, best = -1e300;
  for (double x = -4.0; x <= 4.0; x += 0.002) {
    emulator.predict(MatrixXd::Constant(1, 1, cdf_normal(x)), mean, variance);
    const double density = target.log_density_inside(point, mean.row(0), variance.row(0)) - 0.5 * x * x;
    if (density <= best) continue;
    best = density;
    const VectorXd apart = target.estimate(point) - mean.row(0).transpose();
    least = apart.dot(target.covariance_inside(point, variance.row(0)).llt().solve(apart));
  }
  EXPECT_NEAR(near.misfits[0], least, 0.05 * (1.0 + least));
  HistoryData far = make_data();
  far.y.array() += 100.0;  // no parameter reaches there
  const HistoryModel other(far, model.priors(), Context());
  const HistoryTarget elsewhere(other, {});
  const CalibrationTarget lost(elsewhere, make_reference(1, 1.0), emulator);
  EXPECT_GT(parameter_modes(lost, {point}, {}, Context(), stream).misfits[0], 200.0);
}

TEST(CalibrationTarget, AnnealingFromTheModesGivesTheSameEvidenceForLess) {
  const Joint joint;
  const AisResult outside = sample_ais(joint.history, {}, Context());
  Stream stream(1, 1, 1);
  const CalibrationTarget target(
      joint.history, StudentTMixture::fit(outside.draws, outside.weights, 3, 8.0, stream), joint.emulator);
  const AisResult plain = sample_ais(target, {}, Context());
  const CalibrationSample sample = sample_calibration(target, outside, {}, Context());
  const AisResult& closer = sample.posterior;
  EXPECT_GT(sample.misfits.minCoeff(), 0.0);
  EXPECT_LT(sample.misfits.mean(), 10.0);  // chi-squared with two degrees of freedom exceeds it in 1 of 150
  const double error = std::hypot(plain.standard_error, closer.standard_error);
  EXPECT_LT(std::abs(plain.log_evidence - closer.log_evidence), 4 * error);
  EXPECT_LT(error, 0.15);
  EXPECT_LT(closer.ladder.size(), plain.ladder.size());
  // Likelihoods are told as seen from the target's own reference.
  const VectorXd again = target.log_likelihood(closer.draws.leftCols(20));
  for (Index i = 0; i < 20; ++i)
    EXPECT_NEAR(closer.log_likelihood[i], again[i], 1e-9 * (1 + std::abs(again[i])));
}

TEST(CalibrationTarget, FromThePriorItIsTheSamePosterior) {
  const Joint joint;
  const CalibrationTarget target = joint.target(0.5), wide = target.from_prior();
  const MatrixXd x = normal_matrix(6, 5, 90);
  const VectorXd a = target.log_likelihood(x), b = wide.log_likelihood(x);
  for (Index i = 0; i < 5; ++i) {
    EXPECT_NEAR(a[i] + target.log_reference(x.col(i)), b[i] + wide.log_reference(x.col(i)),
                1e-9 * std::abs(a[i]));
    EXPECT_NEAR(wide.log_reference(x.col(i)), log_prior(x.col(i)), 1.0);  // nearly the prior
  }
}

// The record lies where no parameter reaches: the evidence is found all the same, from another start than the
// history's.
TEST(CalibrationTarget, AContradictedHistoryPosteriorDoesNotMislead) {
  const Emulator emulator = make_emulator(1);
  HistoryData far = make_data();
  far.y.array() += 8.0;
  const HistoryModel model(far, make_model({}).priors(), Context());
  const HistoryTarget history(model, {});
  const AisResult outside = sample_ais(history, {}, Context());
  Stream stream(1, 1, 1);
  const CalibrationTarget target(
      history, StudentTMixture::fit(outside.draws, outside.weights, 3, 8.0, stream), emulator);
  const CalibrationSample sample = sample_calibration(target, outside, {}, Context());
  const AisResult& result = sample.posterior;
  EXPECT_GT(sample.misfits.minCoeff(), 100.0);
  const CalibrationTarget exact = target.from_prior();
  const double truth = evidence_by_quadrature(exact);
  EXPECT_TRUE(result.trusted) << result.verdict;
  EXPECT_LT(std::abs(result.log_evidence - truth), std::max(4 * result.standard_error, 0.02));
  EXPECT_LT(result.standard_error, 0.12);
  const VectorXd again = target.log_likelihood(result.draws.leftCols(20));
  for (Index i = 0; i < 20; ++i)
    EXPECT_NEAR(result.log_likelihood[i], again[i], 1e-9 * (1 + std::abs(again[i])));
}

}  // namespace
}  // namespace amiss
