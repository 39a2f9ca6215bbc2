#include <gtest/gtest.h>

#include <algorithm>

#include "calibration_helpers.hpp"
#include "engine/calibration/Calibration.hpp"

namespace amiss {
namespace {

using namespace test;

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
    EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
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
  EXPECT_TRUE(trusted(plain.outcome)) << in_words(plain.outcome);
  EXPECT_TRUE(trusted(closer.outcome)) << in_words(closer.outcome);
  const double error = std::hypot(plain.standard_error, closer.standard_error);
  EXPECT_LT(error, 0.15);
  EXPECT_LT(std::abs(plain.log_evidence - closer.log_evidence), 4 * error);
  EXPECT_LT(closer.ladder.size(), plain.ladder.size());
  expect_likelihoods_of(target, closer);
  // The means of all coordinates too: four standard errors of both.
  const VectorXd a = plain.draws * plain.weights, b = closer.draws * closer.weights;
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 4 * std::sqrt(1 / plain.ess + 1 / closer.ess));
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
  const Calibration all = calibrate({whole_record(model, emulator)}, {}, Context());
  const RecordPosterior& c = all.records[0];
  EXPECT_TRUE(trusted(all.posterior.outcome)) << in_words(all.posterior.outcome);
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
  const Calibration all = calibrate({whole_record(model, emulator)}, {}, Context());
  const RecordPosterior& c = all.records[0];
  EXPECT_TRUE(trusted(all.posterior.outcome)) << in_words(all.posterior.outcome);
  EXPECT_GT(c.reach[0], 0.99);
  const MatrixXd seen = model.data().responses * c.coefficients - model.data().moves * c.withheld;
  // Noise of 0.5 leaves one coefficient of 60 values an error of a fortieth of 2.4.
  for (Index k = 0; k < seen.cols(); ++k) EXPECT_LT((seen.col(k) - truth).norm(), 0.2 * truth.norm()) << k;
}

TEST(Calibrate, WhatItReportsFollowsFromItsDraws) {
  const Joint joint;
  CalibrationOptions options;
  options.kept = 20;
  const Calibration c = calibrate({whole_record(joint.model, joint.emulator)}, options, Context());
  const RecordPosterior& own = c.records[0];
  const CalibrationTarget target = joint.target();
  const Index n = c.posterior.draws.cols();
  EXPECT_EQ(c.posterior.draws.rows(), 7);
  ASSERT_EQ(static_cast<Index>(own.history.size()), n);
  EXPECT_EQ(c.unit, target.unit(c.posterior.draws));
  VectorXd reach = VectorXd::Zero(2);
  for (Index i = 0; i < n; ++i) {
    const HistoryParameters& p = own.history[static_cast<std::size_t>(i)];
    EXPECT_EQ(p.t, target.history(c.posterior.draws.col(i)).t);
    reach[joint.model.reach_of(p.setting) == 20.0 ? 0 : 1] += c.posterior.weights[i];
  }
  EXPECT_LT((own.reach - reach).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(own.reach.sum(), 1.0, 1e-12);
  ASSERT_EQ(own.coefficients.rows(), 3);
  ASSERT_EQ(own.coefficients.cols(), 20);
  ASSERT_EQ(own.withheld.rows(), 2);
  ASSERT_EQ(own.withheld.cols(), 20);
  ASSERT_EQ(c.kept.size(), 20u);
  MatrixXd of_condition = MatrixXd::Zero(2, joint.model.conditions());
  for (Index k = 0; k < 20; ++k) {
    const Index i = c.kept[static_cast<std::size_t>(k)];
    // Draw i holds the weight at which a (k + 1/2)-th part of 20 is reached.
    const double middle = (static_cast<double>(k) + 0.5) / 20;
    EXPECT_GE(c.posterior.weights.head(i + 1).sum(), middle - 1e-12);
    EXPECT_LE(c.posterior.weights.head(i).sum(), middle + 1e-12);
    const HistoryParameters& p = own.history[static_cast<std::size_t>(i)];
    VectorXd mean, variance;
    predict(joint.emulator, c.unit.row(i), mean, variance);
    const HistoryModel::Coefficients expected = joint.model.coefficients(p, mean, variance);
    const MatrixXd withheld = joint.model.withheld(p.setting);
    EXPECT_LT((own.coefficients.col(k) - expected.mean).cwiseAbs().maxCoeff(), 1e-9);  // emulated one by one
    EXPECT_LT((own.withheld.col(k) - withheld * expected.mean).cwiseAbs().maxCoeff(), 1e-9);
    const MatrixXd root = withheld * expected.root;
    const MatrixXd covariance = root * root.transpose();
    const VectorXd columns = VectorXd::Map(covariance.data(), 4);
    EXPECT_LT((own.withheld_covariance.col(k) - columns).cwiseAbs().maxCoeff(), 1e-9);
    for (Index j = 0; j < 3; ++j) {
      of_condition.col(joint.model.data().condition[static_cast<std::size_t>(j)]) +=
          withheld.col(j) * expected.mean[j] / 20;
    }
  }
  EXPECT_LT((own.withheld_of_condition - of_condition).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((own.withheld_of_condition.rowwise().sum() - own.withheld.rowwise().mean()).cwiseAbs().maxCoeff(),
            1e-9);
  const GaussianSimulator tangent =
      tangent_at(joint.emulator, (c.posterior.draws * c.posterior.weights).tail(2));
  EXPECT_LT((own.tangent.mean - tangent.mean).cwiseQuotient(tangent.mean).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Calibrate, OneAndTwoThreadsGiveTheSameBits) {
  const Joint joint;
  Context two;
  two.threads = 2;
  const Calibration a = calibrate({whole_record(joint.model, joint.emulator)}, {}, Context()),
                    b = calibrate({whole_record(joint.model, joint.emulator)}, {}, two);
  EXPECT_EQ(a.posterior.log_evidence, b.posterior.log_evidence);
  EXPECT_EQ(a.posterior.evaluations, b.posterior.evaluations);
  EXPECT_EQ(a.posterior.draws, b.posterior.draws);
  EXPECT_EQ(a.records[0].coefficients, b.records[0].coefficients);
  EXPECT_EQ(a.records[0].withheld, b.records[0].withheld);
  EXPECT_EQ(a.records[0].reach, b.records[0].reach);
}

TEST(Calibrate, SeedsGiveDifferentRunsOfTheSamePosterior) {
  const Joint joint;
  Context other;
  other.seed = 2;
  const AisResult a = calibrate({whole_record(joint.model, joint.emulator)}, {}, Context()).posterior,
                  b = calibrate({whole_record(joint.model, joint.emulator)}, {}, other).posterior;
  EXPECT_NE(a.log_evidence, b.log_evidence);
  EXPECT_LT(std::abs(a.log_evidence - b.log_evidence), 4 * std::hypot(a.standard_error, b.standard_error));
}

TEST(Calibrate, NumberingOfTheConditionsLeavesTheEvidenceUnchanged) {
  HistoryData other = make_data();
  other.responses << make_data().responses.col(2), make_data().responses.leftCols(2);
  other.condition = {0, 1, 1};
  const Joint a, b(other);
  const Calibration first = calibrate({whole_record(a.model, a.emulator)}, {}, Context()),
                    second = calibrate({whole_record(b.model, b.emulator)}, {}, Context());
  // The same chains; only the order of the sums in the likelihood differs.
  EXPECT_NEAR(first.posterior.log_evidence, second.posterior.log_evidence, 1e-8);
  EXPECT_EQ(first.posterior.evaluations, second.posterior.evaluations);
}

}  // namespace
}  // namespace amiss
