#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>

#include "engine/calibration/Calibration.hpp"
#include "engine/calibration/ParameterModes.hpp"
#include "engine/calibration/ResponseEvidence.hpp"
#include "engine/calibration/TangentPosterior.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

constexpr Index kN = 30;
constexpr double kNoise = 0.9;

// Two coefficients of very different size, smooth in the parameters; hyper-parameters as given.
Emulator make_emulator(Index n_inputs, double log_nugget = -5.0) {
  EmulatorState state;
  state.inputs = uniform_matrix(15, n_inputs, 81);
  state.coefficients.resize(15, 2);
  for (Index m = 0; m < 15; ++m) {
    state.coefficients(m, 0) = 0.02 * std::sin(2.0 * state.inputs(m, 0));
    state.coefficients(m, 1) = 20.0 + 3.0 * state.inputs.row(m).sum();
  }
  state.parameters = MatrixXd::Constant(2, n_inputs + 3, 1.5);
  state.parameters.col(0).setConstant(1.0);
  state.parameters.col(1).setConstant(log_nugget);
  state.parameters.col(2).setConstant(6.0);
  return Emulator(state);
}

HistoryData make_data() {
  HistoryData data;
  data.axis = uneven_axis(kN, {14});
  data.basis.resize(kN, 2);
  data.basis << 60.0 * normal_vector(kN, 82), VectorXd::Ones(kN);
  data.moves = data.basis * Eigen::Vector2d(0.006, 0.9).asDiagonal();
  data.responses = normal_matrix(kN, 3, 83);
  data.condition = {0, 0, 1};
  data.y = data.basis * Eigen::Vector2d(0.015, 21.4) + normal_vector(kN, 84);
  return data;
}

HistoryPriors make_priors(const ErrorOptions& error) {
  HistoryPriors priors;
  priors.noise_sd = kNoise;
  priors.error = error;
  return priors;
}

HistoryModel make_model(const ErrorOptions& error, const HistoryData& data = make_data()) {
  return HistoryModel(data, make_priors(error), Context());
}

const ErrorOptions kError{VectorXd::Constant(1, 2.0), Eigen::Vector2d(0.0, 3.0)};

void predict(const Emulator& emulator, const VectorXd& u, VectorXd& mean, VectorXd& variance) {
  MatrixXd m, v;
  emulator.predict(u.transpose(), m, v);
  mean = m.row(0);
  variance = v.row(0);
}

// log p(y | sigma, t, kappa, z) written down: y = K w + discrepancy + error, w ~ N(w'(z), S(z)).
double dense_density(const HistoryModel& model, const HistoryData& data, const HistoryParameters& p,
                     const Emulator& emulator, const VectorXd& u, double variances = 1.0) {
  const int g = p.setting % 2;
  const double reach = model.priors().reach[static_cast<std::size_t>(p.setting / 2)];
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < 3; ++j)
    phi.col(j) *= std::sqrt(p.t[data.condition[static_cast<std::size_t>(j)]] / (j < 2 ? 2.0 : 1.0) * kN /
                            phi.col(j).squaredNorm());
  if (!std::isinf(reach)) {
    const MatrixXd a = data.moves * data.moves.transpose() / (reach * kNoise * kNoise);
    phi = (MatrixXd::Identity(kN, kN) + a * a).ldlt().solve(phi);
  }
  VectorXd mean, variance;
  predict(emulator, u, mean, variance);
  const MatrixXd covariance =
      p.variance * error_covariance(data.axis, kError.correlation_times, kError.setting(g)) +
      phi * phi.transpose() + variances * data.basis * variance.asDiagonal() * data.basis.transpose();
  return log_normal_density(data.y, data.basis * mean, covariance);
}

struct Joint {
  Emulator emulator = make_emulator(2);
  HistoryModel model;
  explicit Joint(const HistoryData& data = make_data())
      : model([&] {
          HistoryPriors priors = make_priors(kError);
          priors.reach = {20.0, kInfinity};
          return HistoryModel(data, priors, Context());
        }()) {}
  CalibrationTarget target() const { return {model, {0, 1}, emulator}; }
};

TEST(CalibrationTarget, CoordinatesAreTheHistorysThenTheParameters) {
  const Joint joint;
  const CalibrationTarget target = joint.target();
  const HistoryCoordinates history(joint.model, {0, 1});
  ASSERT_EQ(history.dimension(), 1 + 1 + 1 + 2);
  ASSERT_EQ(target.dimension(), 5 + 2);
  const MatrixXd x = normal_matrix(7, 3, 86), u = target.unit(x);
  ASSERT_EQ(u.rows(), 3);
  ASSERT_EQ(u.cols(), 2);
  for (Index i = 0; i < 3; ++i) {
    for (Index p = 0; p < 2; ++p) EXPECT_EQ(u(i, p), normal_cdf(x(5 + p, i)));
    const HistoryParameters own = target.history(x.col(i)), expected = history.parameters(x.col(i).head(5));
    EXPECT_EQ(own.variance, expected.variance);
    EXPECT_EQ(own.setting, expected.setting);
    EXPECT_EQ(own.t, expected.t);
  }
}

TEST(CalibrationTarget, AlongTheParametersItIsTheSameLikelihood) {
  EmulatorState state = make_emulator(2).state();
  const Joint everywhere;
  const CalibrationTarget whole = everywhere.target();
  state.region = Region(VectorXd::Zero(2), MatrixXd::Identity(2, 2), 6.0);
  const Emulator regional(state);
  const CalibrationTarget within(everywhere.model, {0, 1}, regional);
  MatrixXd x = normal_matrix(7, 8, 88), elsewhere = normal_matrix(2, 8, 89);
  for (const CalibrationTarget* target : {&whole, &within}) {
    ASSERT_TRUE(target->has_conditional());
    const std::unique_ptr<Conditional> along = target->along_last_part(x);
    MatrixXd moved = x;
    moved.bottomRows(2) = elsewhere;
    const VectorXd expected = target->log_likelihood(moved);
    EXPECT_LT((along->log_likelihood(elsewhere) - expected).cwiseAbs().maxCoeff(), 1e-8);
  }
  // In a region the emulator's variance is the same at every point, and the gradient the likelihood's own.
  const std::unique_ptr<Conditional> along = within.along_last_part(x);
  const MatrixXd gradient = along->gradient(elsewhere);
  constexpr double kStep = 1e-5;
  for (Index p = 0; p < 2; ++p) {
    MatrixXd above = elsewhere, below = elsewhere;
    above.row(p).array() += kStep;
    below.row(p).array() -= kStep;
    const VectorXd slope = (along->log_likelihood(above) - along->log_likelihood(below)) / (2 * kStep);
    EXPECT_LT((slope - gradient.row(p).transpose()).norm(), 1e-5 * gradient.norm()) << p;
  }
  elsewhere.col(0).setConstant(5.0);  // |x| > 6
  EXPECT_EQ(along->log_likelihood(elsewhere)[0], -kInfinity);
}

TEST(CalibrationTarget, LikelihoodIsTheDenseDensityOfTheMeasurement) {
  const Joint joint;
  const CalibrationTarget target = joint.target();
  const MatrixXd x = 0.9 * normal_matrix(7, 12, 87);
  const VectorXd own = target.log_likelihood(x);
  const MatrixXd u = target.unit(x);
  double most = 0.0;
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters p = target.history(x.col(i));
    const double dense = dense_density(joint.model, make_data(), p, joint.emulator, u.row(i).transpose());
    EXPECT_NEAR(own[i], dense, 1e-8 * (1 + std::abs(dense)));  // eigenvalues from 0.3 to 1e3, values near 100
    most = std::max(most, std::abs(dense - dense_density(joint.model, make_data(), p, joint.emulator,
                                                         u.row(i).transpose(), 0.0)));
  }
  EXPECT_GT(most, 1e-3);  // else the comparison would not see the emulator's variance
}

TEST(CalibrationTarget, UnitsOfTheBasisDoNotMatter) {
  const Joint joint;
  HistoryData scaled = make_data();
  scaled.basis *= 100.0;
  EmulatorState state = joint.emulator.state();
  state.coefficients /= 100.0;
  const Emulator emulator(state);
  const HistoryModel model(scaled, joint.model.priors(), Context());
  const CalibrationTarget other(model, {0, 1}, emulator);
  const MatrixXd x = normal_matrix(7, 5, 89);
  const VectorXd a = joint.target().log_likelihood(x), b = other.log_likelihood(x);
  for (Index i = 0; i < 5; ++i) EXPECT_NEAR(a[i], b[i], 1e-8 * (1 + std::abs(a[i])));  // rounding, as above
}

TEST(CalibrationTarget, RefusesAnEmulatorOfAnotherBasis) {
  HistoryData data = make_data();
  data.basis = normal_matrix(kN, 3, 1);
  data.moves.resize(0, 0);
  const HistoryModel model = make_model({}, data);
  const Emulator emulator = make_emulator(1);
  EXPECT_THROW(CalibrationTarget(model, {}, emulator), std::invalid_argument);
}

TEST(ConditionsBut, AreAllOthers) {
  const HistoryModel model = make_model({});
  EXPECT_EQ(conditions_but(model, {}), (std::vector<int>{0, 1}));
  EXPECT_EQ(conditions_but(model, {0}), (std::vector<int>{1}));
  EXPECT_TRUE(conditions_but(model, {1, 0}).empty());
}

void expect_likelihoods_of(const CalibrationTarget& target, const AisResult& result) {
  const VectorXd again = target.log_likelihood(result.draws.leftCols(20));
  for (Index i = 0; i < 20; ++i)  // in other blocks, so that products round otherwise
    EXPECT_NEAR(result.log_likelihood[i], again[i], 1e-9 * (1 + std::abs(again[i])));
}

// Coordinates: sigma and one parameter; a record near the simulator, and one that no parameter reaches.
TEST(SamplePosterior, EvidenceEqualsQuadrature) {
  const Emulator emulator = make_emulator(1);
  for (double off : {0.0, 8.0}) {
    HistoryData data = make_data();
    data.y.array() += off;
    const HistoryModel model = make_model({}, data);
    const CalibrationTarget target(model, {}, emulator);
    const AisResult result = sample_posterior(target, {}, Context());
    EXPECT_TRUE(result.trusted) << result.verdict;
    // Four reported standard errors, and well below what matters to a Bayes factor.
    EXPECT_LT(std::abs(result.log_evidence - evidence_by_quadrature(target)),
              std::min(std::max(4 * result.standard_error, 0.02), 0.1))
        << off;
    expect_likelihoods_of(target, result);
  }
}

TEST(SamplePosterior, IsTheOneAnnealedFromThePriorForLess) {
  const Joint joint;
  const CalibrationTarget target = joint.target();
  AisOptions options;
  options.precision = 0.05;
  const AisResult plain = sample_ais(target, options, Context());
  const AisResult closer = sample_posterior(target, options, Context());
  EXPECT_TRUE(plain.trusted) << plain.verdict;
  EXPECT_TRUE(closer.trusted) << closer.verdict;
  const double error = std::hypot(plain.standard_error, closer.standard_error);
  EXPECT_LT(error, 0.15);
  EXPECT_LT(std::abs(plain.log_evidence - closer.log_evidence), 4 * error);
  EXPECT_LT(closer.ladder.size(), plain.ladder.size());
  expect_likelihoods_of(target, closer);
  // The means of all coordinates too: four standard errors of both.
  const VectorXd a = plain.draws * plain.weights, b = closer.draws * closer.weights;
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 4 * std::sqrt(1 / plain.ess + 1 / closer.ess));
}

// One parameter: modes and their scales are seen on a fine grid. The record says much of it, or hardly more
// than the prior.
TEST(ParameterModes, AreThoseOfAFineGrid) {
  const Emulator emulator = make_emulator(1);
  HistoryData data = make_data();
  data.y.array() += 1.2;  // else the prior's mode would be the record's
  const HistoryModel model = make_model({}, data);
  const CalibrationTarget target(model, {}, emulator);
  const VectorXd grid = VectorXd::LinSpaced(4001, -4.0, 4.0);
  MatrixXd mean, variance;
  emulator.predict(grid.unaryExpr(&normal_cdf), mean, variance);
  for (double noise_variance : {0.8, 40.0}) {
    const HistoryParameters point{0, noise_variance, VectorXd::Zero(2)};
    Stream stream(1, 2, 3);
    const ParameterModes modes = parameter_modes(target, {point}, {}, Context(), stream);
    EXPECT_GT(modes.evaluations, 192);
    VectorXd exact(4001), fitted(4001);
    for (Index i = 0; i < 4001; ++i) {
      exact[i] = model.log_likelihood(point, mean.row(i), variance.row(i)) - 0.5 * grid[i] * grid[i];
      fitted[i] = modes.mixture.log_density(grid.segment(i, 1));
    }
    const VectorXd p = normalised_exp(exact), q = normalised_exp(fitted);
    // The weights p / q have a second moment of 1 / (effective share): a half at least, of which the widened
    // t gives up some, and the skewness of the posterior some.
    EXPECT_LT((p.array().square() / q.array()).sum(), 2.0) << noise_variance;
    // A search ends at a gain of 0.01 nats: 0.14 standard deviations from the top.
    Index top = 0;
    exact.maxCoeff(&top);
    const double centre = p.dot(grid), sd = std::sqrt(p.dot(grid.cwiseAbs2()) - centre * centre);
    EXPECT_NEAR(modes.best[0], grid[top], 0.15 * sd) << noise_variance;
    ModeOptions one;  // a single search from wherever the prior has it start
    one.starts = one.searches = 1;
    for (std::uint64_t item = 0; item < 10; ++item) {
      Stream other(2, 2, item);
      EXPECT_NEAR(parameter_modes(target, {point}, one, Context(), other).best[0], grid[top], 0.15 * sd);
    }
  }
}

// w'_0 = 0.02 sin(pi u) rises and falls: two values of the parameter give the same coefficient.
TEST(ParameterModes, FindBothOfTwo) {
  EmulatorState state = make_emulator(1).state();
  state.inputs.col(0) = VectorXd::LinSpaced(15, 0.0, 1.0);
  state.coefficients.col(0) = 0.02 * (M_PI * state.inputs.col(0).array()).sin();
  state.coefficients.col(1) = 20.0 + 0.01 * (7.0 * state.inputs.col(0).array()).cos();
  const Emulator emulator(state);
  HistoryData data = make_data();
  data.basis.col(0) *= 10.0;
  data.y = data.basis * Eigen::Vector2d(0.014, 20.0) + 0.9 * normal_vector(kN, 84);
  const HistoryModel model = make_model({}, data);
  const CalibrationTarget target(model, {}, emulator);
  ModeOptions options;
  options.searches = 16;  // the four best of all starts may lie near the same of the two
  Stream stream(1, 2, 3);
  const ParameterModes modes =
      parameter_modes(target, {target.history(VectorXd::Zero(2))}, options, Context(), stream);
  ASSERT_EQ(modes.mixture.size(), 2u);
  // u = 1/4 and 3/4, x = -0.67 and 0.67; between them the simulator is far off.
  const auto density = [&](double x) { return modes.mixture.log_density(VectorXd::Constant(1, x)); };
  EXPECT_GT(density(0.67), density(0.0) + 1.0);
  EXPECT_GT(density(-0.67), density(0.0) + 1.0);
}

TEST(ParameterModes, WithoutAModeThePriorStands) {
  HistoryData data = make_data();
  data.y[3] = kInfinity;
  const HistoryModel model = make_model({}, data);
  const Emulator emulator = make_emulator(2);
  const CalibrationTarget target(model, {}, emulator);
  Stream stream(1, 2, 3);
  const ParameterModes modes = parameter_modes(target, {{0, 1.0, VectorXd::Zero(2)}}, {}, Context(), stream);
  EXPECT_EQ(modes.mixture.size(), 1u);
  EXPECT_EQ(modes.best, VectorXd::Zero(2));
}

// With a large nugget, so that the emulator's own variance is seen.
TEST(Linearisation, OverThePriorsItHasTheEmulatorsMomentsThere) {
  const Emulator emulator = make_emulator(2, 0.0);
  const GaussianSimulator simulator = over_region(emulator);
  constexpr Index n = 150 * 150;  // midpoints of the unit square
  MatrixXd u(n, 2), mean, variance;
  for (Index i = 0; i < n; ++i)
    u.row(i) << (static_cast<double>(i % 150) + 0.5) / 150, (static_cast<double>(i / 150) + 0.5) / 150;
  emulator.predict(u, mean, variance);
  const VectorXd centre = mean.colwise().mean();
  mean.rowwise() -= centre.transpose();
  MatrixXd covariance = mean.transpose() * mean / n;
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  // Four standard errors of 512 points.
  EXPECT_LT((simulator.mean - centre).cwiseQuotient(sd).cwiseAbs().maxCoeff(), 4 / std::sqrt(512.0));
  covariance.diagonal() += variance.colwise().mean().transpose();
  EXPECT_LT((simulator.root * simulator.root.transpose() - covariance)
                .cwiseQuotient(VectorXd(covariance.diagonal().cwiseSqrt()) *
                               covariance.diagonal().cwiseSqrt().transpose())
                .cwiseAbs()
                .maxCoeff(),
            4 * std::sqrt(2.0 / 512));
  EXPECT_GT(variance(0, 0), 0.8 * sd[0] * sd[0]);  // else it would not be seen
}

TEST(Linearisation, TangentTouchesTheEmulator) {
  const Emulator emulator = make_emulator(2, -1.0);
  const VectorXd x0 = Eigen::Vector2d(0.4, -0.8);
  const Expansion at = expand(emulator, x0);
  VectorXd mean, variance;
  predict(emulator, x0.unaryExpr(&normal_cdf), mean, variance);
  EXPECT_LT((at.mean - mean).cwiseQuotient(mean).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((at.variance - variance).cwiseQuotient(variance).cwiseAbs().maxCoeff(), 1e-13);
  for (Index q = 0; q < 2; ++q) {
    const VectorXd slope = numerical_gradient(
        [&](const VectorXd& x) {
          VectorXd m, v;
          predict(emulator, x.unaryExpr(&normal_cdf), m, v);
          return m[q];
        },
        x0);
    // Differences of 3e-3 against those of 1e-5, relative to the larger slope.
    EXPECT_LT((at.slope.row(q).transpose() - slope).cwiseAbs().maxCoeff(),
              1e-5 * slope.cwiseAbs().maxCoeff());
  }
  // w = w'(z0) + W (x - x0) + error, x ~ N(0, I).
  const GaussianSimulator tangent = tangent_at(emulator, x0);
  MatrixXd covariance = at.slope * at.slope.transpose();
  covariance.diagonal() += at.variance;
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  EXPECT_LT((tangent.mean - (at.mean - at.slope * x0)).cwiseQuotient(sd).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((tangent.root * tangent.root.transpose() - covariance)
                .cwiseQuotient(sd * sd.transpose())
                .cwiseAbs()
                .maxCoeff(),
            1e-12);
}

// Coefficients that are linear in x = Phi^-1(u): every tangent is the same Gaussian.
TEST(Linearisation, TangentOfALineIsTheLine) {
  EmulatorState state = make_emulator(1).state();
  const VectorXd x = VectorXd::LinSpaced(40, -1.6, 1.6);
  state.coefficients.resize(40, 2);
  state.inputs = x.unaryExpr(&normal_cdf);
  state.coefficients.col(0) = 0.02 + 0.004 * x.array();
  state.coefficients.col(1) = 20.0 - 1.5 * x.array();
  state.parameters.col(1).setConstant(-12.0);  // nugget
  state.parameters.col(2).setConstant(14.0);   // precision of the noise
  state.parameters.col(3).setConstant(-3.0);   // as rough as Phi^-1 is
  const Emulator emulator(state);
  const VectorXd at_zero = Eigen::Vector2d(0.02, 20.0), line = Eigen::Vector2d(0.004, -1.5);
  for (double x0 : {-0.7, 0.0, 0.5}) {
    const GaussianSimulator tangent = tangent_at(emulator, VectorXd::Constant(1, x0));
    // What the emulator, smooth in u, misses of a function of x: a few hundredths of a standard deviation.
    EXPECT_LT((tangent.mean - at_zero).cwiseQuotient(line).cwiseAbs().maxCoeff(), 0.05);
    EXPECT_LT((tangent.root * tangent.root.transpose() - line * line.transpose())
                  .cwiseQuotient(line.cwiseAbs() * line.cwiseAbs().transpose())
                  .cwiseAbs()
                  .maxCoeff(),
              0.1);
  }
}

constexpr Index kLong = 60;

// The first condition is a response of which four fifths lie along the simulator's first vector, by which it
// moves by a standard deviation of 0.6 at most; the second condition has nothing to do with the record.
struct Reaching {
  VectorXd along, across, response;
  HistoryData data;

  Reaching() {
    const auto centred = [](VectorXd v) {
      v.array() -= v.mean();
      return VectorXd(v * std::sqrt(static_cast<double>(v.size()) / v.squaredNorm()));
    };
    along = centred(normal_vector(kLong, 61));
    across = normal_vector(kLong, 62);
    across -= along * across.dot(along) / along.squaredNorm();
    across = centred(across);
    across -= along * across.dot(along) / along.squaredNorm();
    response = 0.8 * along + 0.6 * across;
    data.axis = even_axis(kLong);
    data.basis.resize(kLong, 2);
    data.basis << 100.0 * along, VectorXd::Ones(kLong);
    data.responses.resize(kLong, 2);
    data.responses << response, normal_vector(kLong, 63);
    data.condition = {0, 1};
  }
  HistoryModel model(const VectorXd& discrepancy, const Emulator& emulator) const {
    HistoryData own = data;
    own.y = data.basis * Eigen::Vector2d(0.012, 22.5) + discrepancy + 0.5 * normal_vector(kLong, 64);
    HistoryPriors priors;
    priors.noise_sd = 0.5;
    priors.error = kError;
    priors.reach = {2.0, kInfinity};
    own.moves = own.basis * over_region(emulator).root;
    return HistoryModel(own, priors, Context());
  }
};

TEST(Calibrate, DiscrepancyWhereTheParametersCouldMoveIsFree) {
  const Reaching record;
  const Emulator emulator = make_emulator(2);
  const VectorXd truth = 4.0 * record.response;
  const HistoryModel model = record.model(truth, emulator);
  const Calibration c = calibrate(model, emulator, {}, Context());
  EXPECT_TRUE(c.posterior.trusted) << c.posterior.verdict;
  EXPECT_GT(c.reach[1], 0.99);
  const MatrixXd seen = model.data().responses * c.coefficients - model.data().moves * c.withheld;
  // The simulator takes its share of what lies along it: a standard deviation of 0.6 of 4.
  for (Index k = 0; k < seen.cols(); ++k) EXPECT_LT((seen.col(k) - truth).norm(), 0.35 * truth.norm()) << k;
}

TEST(Calibrate, DiscrepancyThatKeepsOutOfTheParametersWayDoesNotReachFar) {
  const Reaching record;
  const Emulator emulator = make_emulator(2);
  const VectorXd truth = 2.4 * record.across;
  const HistoryModel model = record.model(truth, emulator);
  const Calibration c = calibrate(model, emulator, {}, Context());
  EXPECT_TRUE(c.posterior.trusted) << c.posterior.verdict;
  EXPECT_GT(c.reach[0], 0.99);
  const MatrixXd seen = model.data().responses * c.coefficients - model.data().moves * c.withheld;
  // Noise of 0.5 leaves one coefficient of 60 values an error of a fortieth of 2.4.
  for (Index k = 0; k < seen.cols(); ++k) EXPECT_LT((seen.col(k) - truth).norm(), 0.2 * truth.norm()) << k;
}

TEST(Calibrate, WhatItReportsFollowsFromItsDraws) {
  const Joint joint;
  CalibrationOptions options;
  options.kept = 20;
  const Calibration c = calibrate(joint.model, joint.emulator, options, Context());
  const CalibrationTarget target = joint.target();
  const Index n = c.posterior.draws.cols();
  EXPECT_EQ(c.posterior.draws.rows(), 7);
  ASSERT_EQ(static_cast<Index>(c.history.size()), n);
  EXPECT_EQ(c.unit, target.unit(c.posterior.draws));
  VectorXd reach = VectorXd::Zero(2);
  for (Index i = 0; i < n; ++i) {
    const HistoryParameters& p = c.history[static_cast<std::size_t>(i)];
    EXPECT_EQ(p.t, target.history(c.posterior.draws.col(i)).t);
    reach[joint.model.reach_of(p.setting) == 20.0 ? 0 : 1] += c.posterior.weights[i];
  }
  EXPECT_LT((c.reach - reach).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(c.reach.sum(), 1.0, 1e-12);
  ASSERT_EQ(c.coefficients.rows(), 3);
  ASSERT_EQ(c.coefficients.cols(), 20);
  ASSERT_EQ(c.withheld.rows(), 2);
  ASSERT_EQ(c.withheld.cols(), 20);
  ASSERT_EQ(c.kept.size(), 20u);
  for (Index k = 0; k < 20; ++k) {
    const Index i = c.kept[static_cast<std::size_t>(k)];
    // Draw i holds the weight at which a (k + 1/2)-th part of 20 is reached.
    const double middle = (static_cast<double>(k) + 0.5) / 20;
    EXPECT_GE(c.posterior.weights.head(i + 1).sum(), middle - 1e-12);
    EXPECT_LE(c.posterior.weights.head(i).sum(), middle + 1e-12);
    const HistoryParameters& p = c.history[static_cast<std::size_t>(i)];
    VectorXd mean, variance;
    predict(joint.emulator, c.unit.row(i), mean, variance);
    const VectorXd expected = joint.model.coefficients(p, mean, variance);
    EXPECT_LT((c.coefficients.col(k) - expected).cwiseAbs().maxCoeff(), 1e-9);  // emulated one by one
    EXPECT_LT((c.withheld.col(k) - joint.model.withheld(p.setting) * expected).cwiseAbs().maxCoeff(), 1e-9);
  }
  const GaussianSimulator tangent =
      tangent_at(joint.emulator, (c.posterior.draws * c.posterior.weights).tail(2));
  EXPECT_LT((c.tangent.mean - tangent.mean).cwiseQuotient(tangent.mean).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Calibrate, OneAndTwoThreadsGiveTheSameBits) {
  const Joint joint;
  Context two;
  two.threads = 2;
  const Calibration a = calibrate(joint.model, joint.emulator, {}, Context()),
                    b = calibrate(joint.model, joint.emulator, {}, two);
  EXPECT_EQ(a.posterior.log_evidence, b.posterior.log_evidence);
  EXPECT_EQ(a.posterior.evaluations, b.posterior.evaluations);
  EXPECT_EQ(a.posterior.draws, b.posterior.draws);
  EXPECT_EQ(a.coefficients, b.coefficients);
  EXPECT_EQ(a.withheld, b.withheld);
  EXPECT_EQ(a.reach, b.reach);
}

TEST(Calibrate, SeedsGiveDifferentRunsOfTheSamePosterior) {
  const Joint joint;
  Context other;
  other.seed = 2;
  const AisResult a = calibrate(joint.model, joint.emulator, {}, Context()).posterior,
                  b = calibrate(joint.model, joint.emulator, {}, other).posterior;
  EXPECT_NE(a.log_evidence, b.log_evidence);
  EXPECT_LT(std::abs(a.log_evidence - b.log_evidence), 4 * std::hypot(a.standard_error, b.standard_error));
}

TEST(Calibrate, NumberingOfTheConditionsLeavesTheEvidenceUnchanged) {
  HistoryData other = make_data();
  other.responses << make_data().responses.col(2), make_data().responses.leftCols(2);
  other.condition = {0, 1, 1};
  const Joint a, b(other);
  const Calibration first = calibrate(a.model, a.emulator, {}, Context()),
                    second = calibrate(b.model, b.emulator, {}, Context());
  // The same chains; only the order of the sums in the likelihood differs.
  EXPECT_NEAR(first.posterior.log_evidence, second.posterior.log_evidence, 1e-8);
  EXPECT_EQ(first.posterior.evaluations, second.posterior.evaluations);
}

TEST(CalibrationTarget, OutsideTheRegionTheRecordIsImpossible) {
  EmulatorState state = make_emulator(2).state();
  state.region = Region(Eigen::Vector2d(0.2, -0.3), 0.5 * MatrixXd::Identity(2, 2), 2.0);
  const Emulator emulator(state);
  const Joint joint;
  const CalibrationTarget target(joint.model, {0, 1}, emulator);
  MatrixXd x = MatrixXd::Zero(target.dimension(), 2);
  x.bottomRows(2) << 0.9, 1.3, -0.3, -0.3;
  const VectorXd values = target.log_likelihood(x);
  EXPECT_TRUE(std::isfinite(values[0]));
  EXPECT_EQ(values[1], -kInfinity);
}

// A linear simulator is its own tangent: the posterior of its parameters at known error and discrepancy, by N
// x N matrices.
TEST(TangentPosterior, OfALinearSimulatorIsExact) {
  HistoryData data = make_data();
  const MatrixXd slopes = normal_matrix(kN, 2, 501);
  const VectorXd x0 = Eigen::Vector2d(0.3, -0.8), run = normal_vector(kN, 502);
  data.y = run + slopes * Eigen::Vector2d(0.9, 0.4) + 0.3 * normal_vector(kN, 503);
  HistoryPriors priors = make_priors(kError);
  AisOptions options;
  const TangentPosterior own = tangent_posterior(data, priors, x0, run, slopes, 12, options, Context());
  VectorXd mean = VectorXd::Zero(2);
  MatrixXd second = MatrixXd::Zero(2, 2);
  for (const HistoryParameters& p : own.history) {
    MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
    for (Index j = 0; j < 3; ++j)
      phi.col(j) *= std::sqrt(p.t[data.condition[static_cast<std::size_t>(j)]] / (j < 2 ? 2.0 : 1.0) * kN /
                              phi.col(j).squaredNorm());
    const MatrixXd v =
        p.variance * error_covariance(data.axis, kError.correlation_times, kError.setting(p.setting)) +
        phi * phi.transpose();
    const MatrixXd solved = v.ldlt().solve(slopes);
    const MatrixXd covariance =
        (slopes.transpose() * solved + MatrixXd::Identity(2, 2)).ldlt().solve(MatrixXd::Identity(2, 2));
    const VectorXd at = covariance * (solved.transpose() * (data.y - run + slopes * x0));
    mean += at / 12;
    second += (covariance + at * at.transpose()) / 12;
  }
  EXPECT_LT((own.mean - mean).norm(), 1e-9);
  EXPECT_LT((own.covariance - (second - mean * mean.transpose())).norm(), 1e-9);
}

TEST(TangentPosterior, AParameterThatChangesNothingKeepsItsPrior) {
  const HistoryData data = make_data();
  MatrixXd slopes = normal_matrix(kN, 3, 504);
  slopes.col(1).setZero();
  const TangentPosterior own = tangent_posterior(data, make_priors(kError), Eigen::Vector3d(0.1, 0.7, 0.2),
                                                 normal_vector(kN, 505), slopes, 6, {}, Context());
  EXPECT_EQ(own.mean[1], 0.0);
  EXPECT_EQ(own.covariance(1, 1), 1.0);
  EXPECT_EQ(own.covariance(0, 1), 0.0);
  EXPECT_THROW(tangent_posterior(data, make_priors(kError), Eigen::Vector2d(0.1, 0.7), normal_vector(kN, 505),
                                 slopes, 6, {}, Context()),
               std::invalid_argument);
}

// Where the noise is known and no condition drives a discrepancy, the record is normal: with K, the tangent
// and the responses written down as one covariance. Two of the responses say the same, one is in the span of
// K.
TEST(ResponseEvidence, IsThatOfOneNormalDistribution) {
  HistoryData data = make_data();
  HistoryPriors priors = make_priors({VectorXd::Constant(1, 2.0), VectorXd::Zero(1)});
  priors.noise_shape = 1e7;
  priors.inclusion = 1e-9;
  const GaussianSimulator tangent{Eigen::Vector2d(0.012, 21.0),
                                  (MatrixXd(2, 2) << 0.01, 0.0, -0.2, 0.5).finished()};
  MatrixXd responses(kN, 3);
  responses << data.axis.time, data.axis.time, 0.4 * data.basis.col(1);
  data.y += 0.5 * responses.col(0);
  const auto closed = [&](const MatrixXd& r) {
    const MatrixXd moves = data.basis * tangent.root;
    return log_normal_density(
        data.y, data.basis * tangent.mean,
        kNoise * kNoise * MatrixXd::Identity(kN, kN) + moves * moves.transpose() + r * r.transpose());
  };
  AisOptions options;
  options.precision = 0.02;
  for (Index k : {0, 1, 3}) {
    const MatrixXd shown = responses.leftCols(k);
    const AisResult own = response_evidence(data, priors, tangent, shown, options, Context());
    EXPECT_NEAR(own.log_evidence, closed(shown), 0.05) << k;  // sigma varies by 2e-4
  }
  EXPECT_GT(closed(responses), closed(responses.leftCols(0)) + 3.0);  // the record asks for them
  EXPECT_THROW(response_evidence(data, priors, tangent, responses.topRows(3), options, Context()),
               std::invalid_argument);
}

}  // namespace
}  // namespace amiss
