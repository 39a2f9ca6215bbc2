#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "attribution_helpers.hpp"
#include "engine/attribution/SurrogateTest.hpp"

namespace amiss {
namespace {

using namespace test;

const std::vector<std::vector<int>> kSingles{{0}, {1}, {2}};

SurrogateOptions few_surrogates(int n = 99) {
  SurrogateOptions options;
  options.surrogates = n;
  options.settings = {0};
  return options;
}

SurrogateTest singles_test(const HistoryModel& model, const SurrogateOptions& options,
                           const Context& context = Context()) {
  return surrogate_test(model, make_simulator(), kSingles, options, context);
}

TEST(AdjustedPValues, AgreeWithAHandExample) {
  MatrixXd null(4, 2);
  null << 1.0, 4.0,  //
      6.0, 0.0,      //
      2.0, 2.0,      //
      0.0, 3.5;
  // In units of 10 for both. The largest, 5, against the largest of each surrogate, 4, 6, 2, 3.5: one of four
  // is as high. Then 3 against 4, 0, 2, 3.5 of its own: two are.
  const VectorXd adjusted = adjusted_p_values(Eigen::Vector2d(5.0, 3.0), null, 10.0);
  EXPECT_NEAR(adjusted[0], 2.0 / 5, 1e-15);
  EXPECT_NEAR(adjusted[1], 3.0 / 5, 1e-15);
  // 0.2 for the second alone would fall below that of the first: it may not.
  null.col(1).setZero();
  const VectorXd rising = adjusted_p_values(Eigen::Vector2d(5.0, 3.0), null, 10.0);
  EXPECT_NEAR(rising[0], 2.0 / 5, 1e-15);
  EXPECT_NEAR(rising[1], 2.0 / 5, 1e-15);
  EXPECT_EQ(adjusted_p_values(VectorXd(), MatrixXd(5, 0)).size(), 0);
}

// Step-down p-values of Westfall and Young, from their definition.
VectorXd westfall_young(const VectorXd& statistic, const MatrixXd& null, double least) {
  const Index n = null.rows(), sets = statistic.size();
  VectorXd unit(sets), adjusted(sets);
  for (Index s = 0; s < sets; ++s) {
    std::vector<double> own(null.col(s).data(), null.col(s).data() + n);
    std::sort(own.begin(), own.end());
    unit[s] = std::max(least, own[static_cast<std::size_t>(0.95 * static_cast<double>(n - 1))]);
  }
  const auto scaled = [&](Index s) { return statistic[s] / unit[s]; };
  const auto step = [&](Index s) {  // against all that are not larger
    double as_high = 0.0;
    for (Index b = 0; b < n; ++b) {
      double most = -kInfinity;
      for (Index k = 0; k < sets; ++k) {
        if (scaled(k) <= scaled(s)) most = std::max(most, null(b, k) / unit[k]);
      }
      as_high += most >= scaled(s) ? 1.0 : 0.0;
    }
    return (1.0 + as_high) / (1.0 + static_cast<double>(n));
  };
  for (Index s = 0; s < sets; ++s) {  // no smaller than that of any larger one
    adjusted[s] = 0.0;
    for (Index k = 0; k < sets; ++k) {
      if (scaled(k) >= scaled(s)) adjusted[s] = std::max(adjusted[s], step(k));
    }
  }
  return adjusted;
}

TEST(AdjustedPValues, EqualTheirDefinition) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const VectorXd scale = Eigen::Vector4d(0.1, 1.0, 10.0, 3.0);
    const MatrixXd null = normal_matrix(60, 4, seed).cwiseAbs2() * scale.asDiagonal();
    const VectorXd statistic = 2.0 * scale.cwiseProduct(normal_vector(4, 100 + seed).cwiseAbs2());
    const VectorXd own = adjusted_p_values(statistic, null, 0.5);
    EXPECT_LT((own - westfall_young(statistic, null, 0.5)).cwiseAbs().maxCoeff(), 1e-14) << seed;
  }
}

TEST(AdjustedPValues, NoStatisticSetsTheMeasureForTheOthers) {
  MatrixXd null = normal_matrix(99, 3, 5).cwiseAbs2();
  VectorXd statistic = Eigen::Vector3d(0.7, 9.0, 1.5);
  const VectorXd before = adjusted_p_values(statistic, null);
  null.col(0) *= 100.0;
  statistic[0] *= 100.0;
  EXPECT_EQ(adjusted_p_values(statistic, null), before);
  EXPECT_LT(before[1], 0.05);
}

TEST(AdjustedPValues, LeastDoesNotGrowWithTheNumberOfSets) {
  for (Index sets : {1, 4, 40}) {
    VectorXd statistic = VectorXd::Constant(sets, 0.1);
    statistic[0] = 50.0;
    const MatrixXd null = normal_matrix(99, sets, 6).cwiseAbs2();
    EXPECT_EQ(adjusted_p_values(statistic, null)[0], 1.0 / 100) << sets;
  }
}

TEST(AdjustedPValues, FamilyWiseErrorIsAsStated) {
  int alarms = 0;
  for (unsigned seed = 1; seed <= 2000; ++seed) {
    // Eight correlated statistics of very different size; the observed ones are drawn as the others are.
    const MatrixXd z = normal_matrix(100, 9, 1000 + seed);
    MatrixXd all = (z.leftCols(8).colwise() + z.col(8)).cwiseAbs2();
    all = all * Eigen::VectorXd::LinSpaced(8, 1.0, 30.0).asDiagonal();
    alarms += adjusted_p_values(all.row(0).transpose(), all.bottomRows(99)).minCoeff() <= 0.05 ? 1 : 0;
  }
  // 0.05, a little more as the units are not made of the observed ones too; sd of 2000 of them: 0.005; 4 of
  // it.
  EXPECT_NEAR(alarms / 2000.0, 0.05, 0.02);
}

TEST(SurrogateTest, StrongPlantedEffectIsNamed) {
  const SurrogateTest test = singles_test(make_model(make_data(1.0, 1)), few_surrogates());
  EXPECT_NEAR(test.p_value[0], 0.01, 1e-12);  // no surrogate of 99 loses as much
  EXPECT_GT(test.statistic[0], 10.0);
  EXPECT_LT(test.p_value[0], test.p_value.tail(2).minCoeff());
  EXPECT_NEAR(test.adjusted[0], 0.01, 1e-12);
  EXPECT_GT(test.adjusted.tail(2).minCoeff(), 0.05);
  EXPECT_GE(test.statistic.minCoeff(), 0.0);
  EXPECT_GE(test.null_statistics.minCoeff(), 0.0);
}

// The largest value of f in a box, by ever finer grids about the best point so far.
double largest(const std::function<double(const VectorXd&)>& f, VectorXd centre, VectorXd half_width) {
  constexpr Index m = 15;
  double best = -kInfinity;
  const Index d = centre.size();
  for (int round = 0; round < 7; ++round) {
    VectorXd found = centre;
    const Index points = static_cast<Index>(std::lround(std::pow(m, d)));
    for (Index i = 0; i < points; ++i) {
      VectorXd x(d);
      Index rest = i;
      for (Index k = 0; k < d; ++k, rest /= m)
        x[k] = centre[k] + half_width[k] * (2.0 * static_cast<double>(rest % m) / (m - 1) - 1.0);
      const double value = f(x);
      if (value > best) {
        best = value;
        found = x;
      }
    }
    centre = found;
    half_width *= 0.4;
  }
  return best;
}

// The statistics of {0} and {0, 1} of a model of two conditions with both variances found by exhaustive
// search about log sigma^2 = centre, under each setting.
VectorXd exhaustive_losses(const HistoryModel& model, double centre) {
  const GaussianSimulator simulator = make_simulator();
  double full = -kInfinity, without_first = -kInfinity, without_both = -kInfinity;
  for (int g = 0; g < model.settings(); ++g) {
    const WhitenedData seen =
        model.whitened(g).in_terms_of(simulator.mean - model.reference(), simulator.root);
    const auto f = [&](const VectorXd& x) {
      VectorXd t = VectorXd::Zero(2);
      for (Index k = 1; k < x.size(); ++k) t[2 - k] = std::exp(x[k]);  // the second condition first
      return model.log_likelihood(seen, x[0], t);
    };
    full = std::max(full, largest(f, Eigen::Vector3d(centre, -4.0, -4.0), Eigen::Vector3d(1.5, 6.0, 6.0)));
    without_first =
        std::max(without_first, largest(f, Eigen::Vector2d(centre, -4.0), Eigen::Vector2d(1.5, 6.0)));
    without_both =
        std::max(without_both, largest(f, VectorXd::Constant(1, centre), VectorXd::Constant(1, 1.5)));
  }
  return Eigen::Vector2d(full - without_first, full - without_both);
}

HistoryData two_conditions(HistoryData data) {
  data.responses = MatrixXd(data.responses.leftCols(4));
  data.condition = {0, 0, 1, 1};
  return data;
}

TEST(SurrogateTest, StatisticIsTheLossOfLogLikelihoodOfFreeFits) {
  const HistoryModel model =
      make_model(two_conditions(make_data(0.3, 2)), {VectorXd::Constant(1, 3.0), Eigen::Vector2d(0.0, 2.0)});
  SurrogateOptions options = few_surrogates(1);
  options.settings = {0, 1};
  const SurrogateTest test =
      surrogate_test(model, make_simulator(), {{0}, {0, 1}, {1, 0}}, options, Context());
  const VectorXd losses = exhaustive_losses(model, -1.5);
  ASSERT_GT(losses[0], 1.0);
  // A fit ends at 1e-5 of its value, near -100; a loss is the difference of two.
  EXPECT_NEAR(test.statistic[0], losses[0], 3e-3);
  EXPECT_NEAR(test.statistic[1], losses[1], 3e-3);
  EXPECT_EQ(test.statistic[1], test.statistic[2]);
}

// An error without white noise can do what the responses do: the likelihood has a maximum at t = 0 as well.
TEST(SurrogateTest, ASmoothErrorDoesNotHideAnEffect) {
  for (unsigned seed : {2u, 3u, 4u, 5u}) {
    HistoryData data = two_conditions(make_data(0.0, seed));
    VectorXd smooth = 0.2 * normal_vector(kN, 70 + seed);
    for (Index i = 1; i < kN; ++i) smooth[i] += 0.9 * smooth[i - 1];
    data.y += -0.45 * normal_vector(kN, 100 * seed + 9) + smooth + 0.6 * data.responses.col(3);
    const HistoryModel model = make_model(data, {VectorXd::Constant(1, 8.0), VectorXd::Constant(1, 100.0)});
    const SurrogateTest test =
        surrogate_test(model, make_simulator(), {{0}, {0, 1}}, few_surrogates(1), Context());
    const VectorXd losses = exhaustive_losses(model, -5.0);
    EXPECT_GT(losses[1], 5.0) << seed;
    EXPECT_NEAR(test.statistic[1], losses[1], 3e-3) << seed;
    EXPECT_NEAR(test.statistic[0], losses[0], 3e-3) << seed;
  }
}

// Powers of two round nothing but logarithms of the unit, by which a search ends a little elsewhere.
TEST(SurrogateTest, UnitOfTheTargetDoesNotMatter) {
  const HistoryData data = make_data(0.2, 3);
  const SurrogateTest in_one = singles_test(make_model(data), few_surrogates(19));
  const auto in_unit = [&](double unit) {
    HistoryData scaled = data;
    scaled.y *= unit;
    scaled.basis *= unit;
    HistoryPriors priors;
    priors.noise_sd = priors.amplitude = 0.5 * unit;
    priors.reach = {kInfinity};
    return singles_test(HistoryModel(scaled, priors, Context()), few_surrogates(19));
  };
  for (double unit : {std::exp2(-40.0), std::exp2(40.0)}) {
    const SurrogateTest test = in_unit(unit);
    EXPECT_LT((test.statistic - in_one.statistic).cwiseAbs().maxCoeff(), 3e-3);
    EXPECT_LT((test.null_statistics - in_one.null_statistics).cwiseAbs().maxCoeff(), 3e-3);
  }
}

TEST(SurrogateTest, PValuesCountTheSurrogates) {
  const SurrogateTest test = singles_test(make_model(make_data(0.2, 3)), few_surrogates(49));
  ASSERT_EQ(test.null_statistics.rows(), 49);
  for (int s = 0; s < 3; ++s) {
    int as_large = 0;
    for (int b = 0; b < 49; ++b) as_large += test.null_statistics(b, s) >= test.statistic[s] ? 1 : 0;
    EXPECT_NEAR(test.p_value[s], (1 + as_large) / 50.0, 1e-12);
  }
  EXPECT_EQ(test.adjusted, adjusted_p_values(test.statistic, test.null_statistics));
}

TEST(SurrogateTest, NullStatisticsAreThoseOfShiftedConditions) {
  HistoryData data = make_data(0.5, 4);
  data.moves = data.basis * make_simulator().root;
  SurrogateOptions options = few_surrogates(1000);
  options.smallest_shift = 0.4;
  const SurrogateTest test = singles_test(make_model(data, {}, {20.0}), options);
  ASSERT_EQ(test.null_statistics.rows(), 120 - 2 * 48 + 1);  // every shift from 48 to 72, once
  // The statistics of a model whose responses were shifted beforehand must be among them, for each allowed
  // shift.
  for (Index lag : {48, 60, 72}) {
    HistoryData moved = data;
    for (Index i = 0; i < kN; ++i) moved.responses.row((i + lag) % kN) = data.responses.row(i);
    const VectorXd expected = singles_test(make_model(moved, {}, {20.0}), few_surrogates(1)).statistic;
    const double gap = (test.null_statistics.rowwise() - expected.transpose())
                           .rowwise()
                           .lpNorm<Eigen::Infinity>()
                           .minCoeff();
    EXPECT_LT(gap, 3e-3) << lag;  // as above: rounding may end a search elsewhere
  }
}

TEST(SurrogateTest, NullDataAreMostlyNotSignificant) {
  int alarms = 0;
  for (unsigned seed = 11; seed <= 30; ++seed) {
    const SurrogateTest test = singles_test(make_model(make_data(0.0, seed)), few_surrogates(59));
    alarms += test.adjusted.minCoeff() <= 0.05 ? 1 : 0;
  }
  // At 5 % over all conditions together, Binomial(20, 0.05) exceeds 4 with probability 0.003.
  EXPECT_LE(alarms, 4);
}

TEST(SurrogateTest, OneAndTwoThreadsGiveTheSameBits) {
  const HistoryModel model = make_model(make_data(0.3, 5));
  Context two;
  two.threads = 2;
  const SurrogateTest a = singles_test(model, few_surrogates(20)),
                      b = singles_test(model, few_surrogates(20), two);
  EXPECT_EQ(a.statistic, b.statistic);
  EXPECT_EQ(a.null_statistics, b.null_statistics);
  EXPECT_EQ(a.p_value, b.p_value);
}

TEST(SurrogateTest, SeedChoosesTheShifts) {
  const HistoryModel model = make_model(make_data(0.3, 5));
  Context other;
  other.seed = 2;
  EXPECT_NE(singles_test(model, few_surrogates(5)).null_statistics,
            singles_test(model, few_surrogates(5), other).null_statistics);
}

TEST(SurrogateTest, RefusesOptionsWithoutMeaning) {
  const HistoryModel model = make_model(make_data(0.0, 6));
  SurrogateOptions none = few_surrogates(0), far = few_surrogates(), without = few_surrogates();
  far.smallest_shift = 0.5;
  without.settings.clear();
  for (const auto& options : {none, far, without}) {
    EXPECT_THROW(singles_test(model, options), std::invalid_argument);
  }
}

TEST(NullSetting, PicksWhiteForWhiteNoiseAndMemoryForMemory) {
  const ErrorOptions error{VectorXd::Constant(1, 5.0), Eigen::Vector3d(0.0, 1.0, 10.0)};
  HistoryData data = make_data(0.0, 7);
  EXPECT_EQ(null_setting(make_model(data, error), make_simulator()), 0);
  const MatrixXd root =
      error_covariance(data.axis, error.correlation_times, VectorXd::Constant(1, 10.0)).llt().matrixL();
  data.y = 20.0 + (0.5 * root * normal_vector(kN, 91)).array();
  EXPECT_EQ(null_setting(make_model(data, error), make_simulator()), 2);
  EXPECT_EQ(null_setting(make_model(data, error, {5.0, kInfinity}), make_simulator()), 2);
}

}  // namespace
}  // namespace amiss
