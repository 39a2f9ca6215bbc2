#include <gtest/gtest.h>

#include "calibration_helpers.hpp"
#include "engine/attribution/Attribution.hpp"
#include "engine/calibration/Calibration.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

// Two records of the same shape: the second louder, and off from the first by what no shared parameter does
// to both.
struct Two {
  Emulator first, second;
  HistoryModel quiet, loud;

  explicit Two(Index inputs, const Region& region = {}, const ErrorOptions& error = kError)
      : first(make(inputs, region)),
        second(make(inputs, region)),
        quiet(make_model(error)),
        loud(louder(error)) {}

  static Emulator make(Index inputs, const Region& region) {
    EmulatorState state = make_emulator(inputs).state();
    state.region = region;
    return Emulator(state);
  }
  static HistoryModel louder(const ErrorOptions& error) {
    HistoryData data = make_data();
    data.y = data.basis * Eigen::Vector2d(0.01, 21.0) + 1.5 * normal_vector(kN, 95);
    HistoryPriors priors = make_priors(error);
    priors.noise_sd = 1.5;
    return HistoryModel(data, priors, Context());
  }
  // The records with these parameters for inputs and conditions `active` in both.
  std::vector<Record> records(std::vector<int> of_first, std::vector<int> of_second,
                              const std::vector<int>& active = {0, 1}) const {
    return {{&quiet, active, &first, std::move(of_first)}, {&loud, active, &second, std::move(of_second)}};
  }
};

// The rows of x that are the coordinates of a record by itself.
MatrixXd own_rows(const MatrixXd& x, Index from, Index history, const std::vector<Index>& parameters) {
  MatrixXd own(history + static_cast<Index>(parameters.size()), x.cols());
  own.topRows(history) = x.middleRows(from, history);
  for (std::size_t p = 0; p < parameters.size(); ++p)
    own.row(history + static_cast<Index>(p)) = x.row(x.rows() - 3 + parameters[p]);
  return own;
}

TEST(SeveralRecords, LikelihoodIsTheProductOfThoseOfEach) {
  const Two two(2);
  // Three parameters; the records share number 1, which is the second's first input.
  const CalibrationTarget joint(two.records({0, 1}, {1, 2}));
  const CalibrationTarget quiet(two.quiet, {0, 1}, two.first), loud(two.loud, {0, 1}, two.second);
  const Index history = quiet.dimension() - 2;
  ASSERT_EQ(joint.dimension(), 2 * history + 3);
  EXPECT_EQ(joint.parts(), (std::vector<Index>{2 * history, 3}));
  const MatrixXd x = normal_matrix(joint.dimension(), 6, 96);
  const MatrixXd of_quiet = own_rows(x, 0, history, {0, 1}), of_loud = own_rows(x, history, history, {1, 2});
  const VectorXd expected = quiet.log_likelihood(of_quiet) + loud.log_likelihood(of_loud);
  EXPECT_LT((joint.log_likelihood(x) - expected).cwiseAbs().maxCoeff(), 1e-9);

  const auto along = joint.along_last_part(x);
  EXPECT_LT((along->log_likelihood(x.bottomRows(3)) - expected).cwiseAbs().maxCoeff(), 1e-9);
  const MatrixXd gradient = along->gradient(x.bottomRows(3)),
                 a = quiet.along_last_part(of_quiet)->gradient(of_quiet.bottomRows(2)),
                 b = loud.along_last_part(of_loud)->gradient(of_loud.bottomRows(2));
  EXPECT_LT((gradient.row(0) - a.row(0)).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((gradient.row(1) - a.row(1) - b.row(0)).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((gradient.row(2) - b.row(1)).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(SeveralRecords, WithoutASharedParameterTheEvidenceIsTheProduct) {
  const Two two(2);
  const AisResult joint = calibrate(two.records({0, 1}, {2, 3}), {}, Context()).posterior,
                  quiet = calibrate({whole_record(two.quiet, two.first)}, {}, Context()).posterior,
                  loud = calibrate({whole_record(two.loud, two.second)}, {}, Context()).posterior;
  EXPECT_TRUE(trusted(joint.outcome)) << in_words(joint.outcome);
  const double error =
      std::sqrt(joint.standard_error * joint.standard_error + quiet.standard_error * quiet.standard_error +
                loud.standard_error * loud.standard_error);
  EXPECT_LT(std::abs(joint.log_evidence - quiet.log_evidence - loud.log_evidence), 4 * error);
}

// log of the integral of exp(f) N(x; 0, 1) over an even grid.
double log_integral(const VectorXd& grid, const VectorXd& f) {
  const double step = grid[1] - grid[0];
  return log_sum_exp(f.array() - 0.5 * grid.array().square()) + std::log(step / std::sqrt(2 * M_PI));
}

// log L of one record at each value of the shared parameter, its noise integrated out.
VectorXd over_noise(const CalibrationTarget& target, const VectorXd& grid) {
  VectorXd values(grid.size());
  for (Index i = 0; i < grid.size(); ++i) {
    MatrixXd x(2, grid.size());
    x.row(0) = grid.transpose();
    x.row(1).setConstant(grid[i]);
    values[i] = log_integral(grid, target.log_likelihood(x));
  }
  return values;
}

TEST(SeveralRecords, EvidenceAndPosteriorAreThoseOfQuadrature) {
  const VectorXd grid = VectorXd::LinSpaced(401, -6.0, 6.0);
  for (const Region& region : {Region(), Region(VectorXd::Zero(1), MatrixXd::Identity(1, 1), 5.0, {false})}) {
    const Two two(1, region, {});
    const std::vector<Record> records = two.records({0}, {0}, {});
    const VectorXd value = over_noise(CalibrationTarget(two.quiet, {}, two.first), grid) +
                           over_noise(CalibrationTarget(two.loud, {}, two.second), grid);
    const AisResult joint = calibrate(records, {}, Context()).posterior;
    EXPECT_TRUE(trusted(joint.outcome)) << in_words(joint.outcome);
    EXPECT_LT(std::abs(joint.log_evidence - log_integral(grid, value)), 4 * joint.standard_error + 0.01);
    const VectorXd mass = normalised_exp(value - 0.5 * grid.cwiseAbs2());
    const double mean = mass.dot(grid), sd = std::sqrt(mass.dot(grid.cwiseAbs2()) - mean * mean);
    const VectorXd drawn = joint.draws.bottomRows(1).transpose();
    EXPECT_NEAR(drawn.dot(joint.weights), mean, 4 * sd / std::sqrt(joint.ess));
  }
}

TEST(SeveralRecords, WhatItReportsOfEachFollowsFromItsDraws) {
  const Two two(2);
  const std::vector<Record> records = two.records({0, 1}, {1, 2});
  const CalibrationTarget target(records);
  const Calibration c = calibrate(records, {}, Context());
  ASSERT_EQ(c.records.size(), 2u);
  ASSERT_EQ(c.unit.cols(), 3);
  for (std::size_t r = 0; r < 2; ++r) {
    const Index last = c.kept.back();
    const HistoryParameters& point = c.records[r].history[static_cast<std::size_t>(last)];
    EXPECT_EQ(point.t, target.history(c.posterior.draws.col(last), r).t);
    VectorXd mean, variance;
    predict(*records[r].emulator, c.unit.row(last).segment(static_cast<Index>(r), 2), mean, variance);
    const VectorXd expected = records[r].model->coefficients(point, mean, variance).mean;
    EXPECT_LT((c.records[r].coefficients.rightCols(1) - expected).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_NEAR(c.records[r].reach.sum(), 1.0, 1e-12);
  }
}

TEST(SeveralRecords, OneAndTwoThreadsGiveTheSameBits) {
  const Two two(2);
  Context threads;
  threads.threads = 2;
  const Calibration a = calibrate(two.records({0, 1}, {1, 2}), {}, Context()),
                    b = calibrate(two.records({0, 1}, {1, 2}), {}, threads);
  EXPECT_EQ(a.posterior.log_evidence, b.posterior.log_evidence);
  EXPECT_EQ(a.posterior.draws, b.posterior.draws);
}

// Draws with the first condition on in both records, in one, in none.
TEST(SeveralRecords, ConditionsAreDroppedInOneOrInAll) {
  const Two two(1);
  const std::vector<Record> records = two.records({0}, {0});
  Calibration c;
  c.records.resize(2);
  c.posterior.weights = Eigen::Vector4d(0.4, 0.3, 0.2, 0.1);
  c.posterior.ess = 400.0;
  const double on[4][2] = {{1, 1}, {1, 0}, {0, 1}, {0, 0}};
  for (const auto& draw : on) {
    for (std::size_t r = 0; r < 2; ++r)
      c.records[r].history.push_back({0, 1.0, Eigen::Vector2d(draw[r], 0.0)});
  }
  EXPECT_NEAR(dropped_by_draws(records, c, {{0}, {}}).lost, std::log(0.8 / 0.3), 1e-12);
  EXPECT_NEAR(dropped_by_draws(records, c, {{}, {0}}).lost, std::log(0.8 / 0.4), 1e-12);
  EXPECT_NEAR(dropped_by_draws(records, c, {{0}, {0}}).lost, std::log(0.64 / 0.1), 1e-12);
}

TEST(SeveralRecords, SharedEffectIsFoundInEachAndInBoth) {
  HistoryData data = make_data();
  data.y += 3.0 * data.responses.col(0);
  const HistoryModel first = make_model(kError, data), second = make_model(kError, data);
  const Emulator emulator = make_emulator(1);
  const std::vector<Record> records = {whole_record(first, emulator), whole_record(second, emulator)};
  const Calibration c = calibrate(records, {}, Context());
  for (std::size_t which : {0u, 1u}) {
    const Attribution own = attribute(records, which, c, {}, Context());
    EXPECT_GT(own.sets[0].lost, 5.0) << which;
    EXPECT_LT(own.sets[1].lost, 1.15) << which;
  }
  // Each record tells of it by itself, and nothing is known of one from the other but by the parameter.
  const DroppedSet both = drop(records, c, {{0}, {0}}, {}, Context());
  EXPECT_GT(both.lost, 1.5 * attribute(records, 0, c, {}, Context()).sets[0].lost);
  EXPECT_TRUE(both.trusted);
}

TEST(SeveralRecords, RefusesParametersThatAreNotTheEmulatorsInputs) {
  const Two two(2);
  EXPECT_THROW(CalibrationTarget(two.records({0}, {0, 1})), std::invalid_argument);
  EXPECT_THROW(CalibrationTarget(std::vector<Record>()), std::invalid_argument);
}

}  // namespace
}  // namespace amiss
