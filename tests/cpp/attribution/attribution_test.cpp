#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "attribution_helpers.hpp"
#include "engine/attribution/Attribution.hpp"

namespace amiss {
namespace {

using namespace test;

// A posterior of draws with the conditions that are on in each (a bit for each) and their weights.
Calibration by_hand(const std::vector<std::pair<unsigned, double>>& draws, Index conditions) {
  Calibration c;
  c.records.resize(1);
  c.posterior.weights.resize(static_cast<Index>(draws.size()));
  for (std::size_t i = 0; i < draws.size(); ++i) {
    HistoryParameters p{0, 1.0, VectorXd::Zero(conditions)};
    for (Index s = 0; s < conditions; ++s) p.t[s] = ((draws[i].first >> s) & 1) != 0 ? 0.7 : 0.0;
    c.records[0].history.push_back(p);
    c.posterior.weights[static_cast<Index>(i)] = draws[i].second;
  }
  c.posterior.ess = 400.0;
  c.posterior.outcome = Outcome::consistent;
  return c;
}

// A model of so many conditions; their responses do not matter to what the draws alone say.
HistoryModel model_of(Index conditions, double inclusion = 0.2) {
  HistoryData data;
  data.axis = even_axis(20);
  data.basis = VectorXd::Ones(20);
  data.responses = normal_matrix(20, conditions, 74);
  data.condition.resize(static_cast<std::size_t>(conditions));
  std::iota(data.condition.begin(), data.condition.end(), 0);
  data.y = normal_vector(20, 75);
  HistoryPriors priors;
  priors.inclusion = inclusion;
  return HistoryModel(data, priors, Context());
}

// The same where there is one record.
DroppedSet dropped_by_draws(const HistoryModel& model, const Calibration& calibration, std::vector<int> set) {
  return amiss::dropped_by_draws({Record{&model, {}, nullptr, {}}}, calibration, {std::move(set)});
}

std::vector<std::vector<int>> find_groups(const HistoryModel& model, const Calibration& calibration,
                                          const std::vector<DroppedSet>& singles, double least) {
  return amiss::find_groups({Record{&model, {}, nullptr, {}}}, 0, calibration, singles, least);
}

TEST(DroppedByDraws, IsTheRatioOfSavageAndDickey) {
  const HistoryModel model = model_of(3);
  const Calibration c = by_hand({{0b001, 0.5}, {0b011, 0.3}, {0b010, 0.15}, {0b000, 0.05}}, 3);
  // P(off) = 0.8 of each before; after, 0.2 of the first, 0.55 of the second, 1 of the third, 0.05 of both.
  const DroppedSet first = dropped_by_draws(model, c, {0}), second = dropped_by_draws(model, c, {1}),
                   third = dropped_by_draws(model, c, {2}), both = dropped_by_draws(model, c, {1, 0});
  EXPECT_NEAR(first.lost, std::log(0.8 / 0.2), 1e-12);
  EXPECT_NEAR(second.lost, std::log(0.8 / 0.55), 1e-12);
  EXPECT_NEAR(third.lost, std::log(0.8), 1e-12);  // a condition that says nothing costs its prior
  EXPECT_NEAR(both.lost, std::log(0.64 / 0.05), 1e-12);
  EXPECT_EQ(both.conditions, (ConditionSet{{1, 0}}));
  // d log p = sd(p) / p, sd(p) = sqrt(p (1 - p) / 400).
  EXPECT_NEAR(first.standard_error, std::sqrt(0.2 * 0.8 / 400) / 0.2, 1e-12);
  EXPECT_NEAR(third.standard_error, 0.0, 1e-7);  // the weights add up to 1 within rounding
  EXPECT_TRUE(first.trusted);
}

TEST(DroppedByDraws, SaysSoWhereTheDrawsCannot) {
  const Calibration c = by_hand({{0b1, 0.6}, {0b1, 0.4}}, 1);
  const DroppedSet never = dropped_by_draws(model_of(1), c, {0});  // no draw has it off
  EXPECT_EQ(never.lost, kInfinity);
  EXPECT_EQ(never.standard_error, kInfinity);
  EXPECT_EQ(dropped_by_draws(model_of(1, 1.0), c, {0}).standard_error, kInfinity);  // nor has the prior
}

using Groups = std::vector<std::vector<int>>;
constexpr double kLeast = 1.15;

Groups groups_of(int conditions, const Calibration& c) {
  const HistoryModel model = model_of(conditions);
  std::vector<DroppedSet> singles;
  for (int s = 0; s < conditions; ++s) singles.push_back(dropped_by_draws(model, c, {s}));
  return find_groups(model, c, singles, kLeast);
}

// Chains that stick never drop the first of two that say the same; sampled again without it, nothing is lost.
TEST(FindGroups, ByWhatASingleLosesInTruth) {
  const Calibration c = by_hand({{0b001, 0.99}, {0b100, 0.01}}, 3);
  const HistoryModel model = model_of(3);
  std::vector<DroppedSet> singles;
  for (int s = 0; s < 3; ++s) singles.push_back(dropped_by_draws(model, c, {s}));
  ASSERT_GT(singles[0].lost, kLeast);
  EXPECT_TRUE(find_groups(model, c, singles, kLeast).empty());
  singles[0].lost = 0.0;
  EXPECT_EQ(find_groups(model, c, singles, kLeast).size(), 1u);
}

TEST(FindGroups, AConditionAndItsCopyAreOne) {
  const Calibration c = by_hand({{0b001, 0.5}, {0b010, 0.49}, {0b100, 0.01}}, 3);
  EXPECT_LT(dropped_by_draws(model_of(3), c, {0}).lost, kLeast);
  EXPECT_EQ(groups_of(3, c), (Groups{{0, 1}}));
}

TEST(FindGroups, ThreeCopiesAreOne) {
  const Calibration c = by_hand({{0b0001, 0.33}, {0b0010, 0.33}, {0b1000, 0.33}, {0b0000, 0.01}}, 4);
  EXPECT_EQ(groups_of(4, c), (Groups{{0, 1, 3}}));
}

TEST(FindGroups, NoEffectMakesNone) {
  const Calibration c = by_hand({{0b000, 0.7}, {0b001, 0.1}, {0b010, 0.1}, {0b100, 0.1}}, 3);
  EXPECT_TRUE(groups_of(3, c).empty());
}

TEST(FindGroups, AConditionThatMattersAloneIsInNone) {
  EXPECT_TRUE(groups_of(3, by_hand({{0b001, 0.9}, {0b011, 0.08}, {0b000, 0.02}}, 3)).empty());
  // Beside it a pair that cannot be told apart.
  const Calibration c = by_hand({{0b0011, 0.5}, {0b0101, 0.49}, {0b1000, 0.01}}, 4);
  EXPECT_EQ(groups_of(4, c), (Groups{{1, 2}}));
}

TEST(FindGroups, TwoPairsAreTwo) {
  const Calibration c =
      by_hand({{0b0101, 0.25}, {0b0110, 0.24}, {0b1001, 0.25}, {0b1010, 0.24}, {0b0000, 0.02}}, 4);
  Groups groups = groups_of(4, c);
  std::sort(groups.begin(), groups.end());
  EXPECT_EQ(groups, (Groups{{0, 1}, {2, 3}}));
}

// One parameter that moves the level; a record with `effect` of the first condition, of which the second is a
// copy in another unit, the third its own.
struct Copied {
  Emulator emulator;
  HistoryModel model;

  explicit Copied(double effect) : emulator(make_emulator()), model(make(effect, emulator)) {}

  std::vector<Record> records() const { return {whole_record(model, emulator)}; }

  static Emulator make_emulator() {
    EmulatorState state;
    state.inputs = VectorXd::LinSpaced(12, 0.0, 1.0);
    state.coefficients.resize(12, 2);
    state.coefficients.col(0) = 0.5 + state.inputs.col(0).array();
    state.coefficients.col(1) = 18.0 + 4.0 * state.inputs.col(0).array().square();
    state.parameters = MatrixXd::Constant(2, 4, 1.5);
    state.parameters.col(0).setConstant(1.0);
    state.parameters.col(1).setConstant(-8.0);
    state.parameters.col(2).setConstant(9.0);
    return Emulator(state);
  }
  static HistoryModel make(double effect, const Emulator& emulator) {
    HistoryData data = make_data(0.0, 8);
    const MatrixXd own = data.responses.leftCols(2), third = data.responses.rightCols(2);
    data.responses << own, (32.0 + 1.8 * own.array()).matrix(), third;
    data.y = data.basis * Eigen::Vector2d(1.0, 19.0) + effect * own.col(1) + 0.5 * normal_vector(kN, 76);
    HistoryPriors priors;
    priors.noise_sd = 0.5;
    priors.error = kTwoErrors;
    priors.reach = kReaches;
    data.moves = data.basis * over_region(emulator).root;
    return HistoryModel(data, priors, Context());
  }
};

TEST(Attribute, ATrueConditionAndItsCopyAreNamedTogether) {
  const Copied record(1.0);
  const Calibration calibration = calibrate(record.records(), {}, Context());
  AttributionOptions options;
  options.surrogates.surrogates = 59;
  const Attribution own = attribute(record.records(), 0, calibration, options, Context());
  ASSERT_EQ(own.sets.size(), 4u);
  for (std::size_t s = 0; s < 3; ++s) {
    EXPECT_EQ(own.sets[s].conditions, (ConditionSet{{static_cast<int>(s)}}));
    EXPECT_LT(own.sets[s].lost, options.least) << s;
    EXPECT_LT(own.sets[s].standard_error, 0.2) << s;
  }
  const DroppedSet& pair = own.sets[3];
  EXPECT_EQ(pair.conditions, (ConditionSet{{0, 1}}));
  EXPECT_TRUE(pair.trusted);
  EXPECT_GT(pair.lost, 10.0);
  // Hardly a draw has both off: the evidence is that of a posterior sampled without them.
  EXPECT_LT(pair.standard_error, 0.2);
  const CalibrationTarget without(record.model, {2}, record.emulator);
  Context other;
  other.seed = 5;
  const AisResult again = sample_posterior(without, {}, other);
  EXPECT_LT(std::abs(pair.lost - (calibration.posterior.log_evidence - again.log_evidence)),
            4 * std::hypot(pair.standard_error, again.standard_error));
  // The test is of the same sets: a copy stands in for its like, so that only the pair is significant.
  ASSERT_EQ(own.test.statistic.size(), 4);
  EXPECT_EQ(own.test.adjusted[3], 1.0 / 60);
  EXPECT_GT(own.test.adjusted.head(3).minCoeff(), 0.05);
  ASSERT_EQ(own.shares.rows(), static_cast<Index>(calibration.kept.size()));
  ASSERT_EQ(own.shares.cols(), 3);
  const VectorXd mean = own.shares.colwise().mean();
  EXPECT_GT(mean[0] + mean[1], 0.5);
  EXPECT_LT(mean[2], 0.05);
}

// A copy that earns just enough to stay out of the search for groups hides the pair, until groups are sought
// with it: `least` lies below what the driver's copy loses, above which no surrogate misses it.
TEST(Attribute, AConditionThatEarnsItsEvidenceButNoPValueIsSoughtOnceMoreInGroups) {
  const Copied record(1.0);
  const Calibration calibration = calibrate(record.records(), {}, Context());
  AttributionOptions options;
  options.surrogates.surrogates = 59;
  const Attribution found = attribute(record.records(), 0, calibration, options, Context());
  ASSERT_EQ(found.sets.size(), 4u);
  options.least = std::min(found.sets[0].lost, found.sets[1].lost) - 0.01;
  ASSERT_EQ(find_groups(record.records(), 0, calibration, {found.sets.begin(), found.sets.begin() + 3},
                        options.least)
                .size(),
            0u);
  const Attribution own = attribute(record.records(), 0, calibration, options, Context());
  ASSERT_EQ(own.sets.size(), 4u);
  EXPECT_EQ(own.sets[3].conditions, (ConditionSet{{0, 1}}));
  EXPECT_EQ(own.significant, (std::vector<bool>{false, false, false, true}));
  // What is significant by itself keeps its own name.
  options.level = 1.0;
  EXPECT_EQ(attribute(record.records(), 0, calibration, options, Context()).sets.size(), 3u);
}

// In a short record a shifted one does nearly as well as the record itself.
TEST(Attribute, DecisiveEvidenceNeedsNoPValue) {
  AttributionOptions options;
  EXPECT_TRUE(options.significant(options.decisive, 1.0));
  EXPECT_FALSE(options.significant(options.decisive - 0.01, 0.06));
  EXPECT_TRUE(options.significant(options.least, 0.05));
  EXPECT_FALSE(options.significant(options.least - 0.01, 0.01));
}

TEST(Attribute, WhereNothingActsNothingIsNamedAndFewSurrogatesSuffice) {
  const Copied record(0.0);
  const Calibration calibration = calibrate(record.records(), {}, Context());
  const Attribution own = attribute(record.records(), 0, calibration, {}, Context());
  ASSERT_EQ(own.sets.size(), 3u);
  for (const DroppedSet& set : own.sets) EXPECT_LT(set.lost, 1.15);
  EXPECT_EQ(own.test.null_statistics.rows(), 39);
}

TEST(Attribute, OneAndTwoThreadsGiveTheSameBits) {
  const Copied record(0.4);
  const Calibration calibration = calibrate(record.records(), {}, Context());
  AttributionOptions options;
  options.surrogates.surrogates = 19;
  Context two;
  two.threads = 2;
  const Attribution a = attribute(record.records(), 0, calibration, options, Context()),
                    b = attribute(record.records(), 0, calibration, options, two);
  ASSERT_EQ(a.sets.size(), b.sets.size());
  for (std::size_t k = 0; k < a.sets.size(); ++k) EXPECT_EQ(a.sets[k].lost, b.sets[k].lost);
  EXPECT_EQ(a.test.null_statistics, b.test.null_statistics);
  EXPECT_EQ(a.shares, b.shares);
}

}  // namespace
}  // namespace amiss
