#include <gtest/gtest.h>

#include <stdexcept>

#include "engine/attribution/SurrogateTest.hpp"
#include "engine/discrepancy/FilterBank.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

constexpr Index kN = 120;

// AR(1) series with coefficient 0.8.
VectorXd autocorrelated(Index n, unsigned seed) {
  VectorXd x = normal_vector(n, seed);
  for (Index i = 1; i < n; ++i) x[i] = 0.8 * x[i - 1] + 0.6 * x[i];
  return x;
}

HistoryData make_data(double effect, unsigned seed) {
  HistoryData data;
  data.axis = even_axis(kN);
  data.basis.resize(kN, 2);
  data.basis.col(0) = data.axis.time.array().sin();
  data.basis.col(1).setOnes();
  MatrixXd x(kN, 3);
  for (unsigned s = 0; s < 3; ++s) x.col(s) = autocorrelated(kN, 100 * seed + s);
  const FilterBank bank(x, {0, 1, 2}, Eigen::Vector2d(0.0, 4.0), data.axis);
  data.responses = bank.responses;
  data.condition = bank.condition;
  data.y = data.basis * Eigen::Vector2d(1.0, 20.0) + effect * bank.responses.col(1) +
           0.5 * normal_vector(kN, 100 * seed + 9);
  return data;
}

HistoryModel make_model(const HistoryData& data, const ErrorOptions& error = {}) {
  HistoryPriors priors;
  priors.noise_sd = 0.5;
  priors.error = error;
  return HistoryModel(data, priors, Context());
}

SurrogateOptions few_surrogates(int n = 99) {
  SurrogateOptions options;
  options.surrogates = n;
  options.error_settings = {0};
  return options;
}

TEST(Holm, AgreesWithAHandExample) {
  // Ordered 0.005, 0.01, 0.03, 0.04, times 4, 3, 2, 1, never falling.
  const VectorXd adjusted = holm(Eigen::Vector4d(0.01, 0.04, 0.03, 0.005));
  EXPECT_NEAR(adjusted[0], 0.03, 1e-15);
  EXPECT_NEAR(adjusted[1], 0.06, 1e-15);
  EXPECT_NEAR(adjusted[2], 0.06, 1e-15);
  EXPECT_NEAR(adjusted[3], 0.02, 1e-15);
}

TEST(Holm, NeverExceedsOneAndAcceptsTiesAndNothing) {
  EXPECT_EQ(holm(Eigen::Vector3d(0.9, 0.6, 0.9)), VectorXd::Ones(3));
  EXPECT_EQ(holm(Eigen::Vector2d(0.02, 0.02)), VectorXd::Constant(2, 0.04));
  EXPECT_EQ(holm(VectorXd()).size(), 0);
}

TEST(SurrogateTest, StrongPlantedEffectIsNamed) {
  const SurrogateTest test = surrogate_test(make_model(make_data(1.0, 1)), few_surrogates(), Context());
  EXPECT_NEAR(test.p_value[0], 0.01, 1e-12);  // no surrogate of 99 loses as much
  EXPECT_GT(test.statistic[0], 10.0);
  EXPECT_LT(test.p_value[0], test.p_value.tail(2).minCoeff());
  EXPECT_LT(test.adjusted[0], 0.05);
  EXPECT_GT(test.adjusted.tail(2).minCoeff(), 0.05);
  EXPECT_GE(test.statistic.minCoeff(), 0.0);
  EXPECT_GE(test.null_statistics.minCoeff(), 0.0);
}

TEST(SurrogateTest, StatisticIsTheLossOfLogLikelihoodOfFreeFits) {
  // One condition, fitted by an exhaustive search over both variances.
  HistoryData data = make_data(0.3, 2);
  data.responses = MatrixXd(data.responses.leftCols(2));
  data.condition = {0, 0};
  const HistoryModel model = make_model(data);
  double full = -1e300, without = -1e300;
  for (double log_variance = -3.0; log_variance < 1.0; log_variance += 0.004) {
    without = std::max(without, model.log_likelihood(0, log_variance, VectorXd::Zero(1)));
    for (double log_t = -6.0; log_t < 2.0; log_t += 0.04) {
      full = std::max(full, model.log_likelihood(0, log_variance, VectorXd::Constant(1, std::exp(log_t))));
    }
  }
  const SurrogateTest test = surrogate_test(model, few_surrogates(1), Context());
  ASSERT_GT(full - without, 1.0);
  EXPECT_NEAR(test.statistic[0], full - without,
              1e-3);  // the grid is within 0.02 of log t at a smooth maximum
}

TEST(SurrogateTest, PValuesCountTheSurrogatesAndCarryHolmsCorrection) {
  const SurrogateTest test = surrogate_test(make_model(make_data(0.2, 3)), few_surrogates(49), Context());
  ASSERT_EQ(test.null_statistics.rows(), 49);
  for (int s = 0; s < 3; ++s) {
    int as_large = 0;
    for (int b = 0; b < 49; ++b) as_large += test.null_statistics(b, s) >= test.statistic[s] ? 1 : 0;
    EXPECT_NEAR(test.p_value[s], (1 + as_large) / 50.0, 1e-12);
  }
  EXPECT_EQ(test.adjusted, holm(test.p_value));
}

TEST(SurrogateTest, NullStatisticsAreThoseOfShiftedConditions) {
  const HistoryData data = make_data(0.5, 4);
  SurrogateOptions options = few_surrogates(1000);
  options.smallest_shift = 0.4;
  const SurrogateTest test = surrogate_test(make_model(data), options, Context());
  ASSERT_EQ(test.null_statistics.rows(), 120 - 2 * 48 + 1);  // every shift from 48 to 72, once
  // The statistics of a model whose responses were shifted beforehand must be among them, for each allowed
  // shift.
  for (Index lag : {48, 60, 72}) {
    HistoryData moved = data;
    for (Index i = 0; i < kN; ++i) moved.responses.row((i + lag) % kN) = data.responses.row(i);
    const VectorXd expected = surrogate_test(make_model(moved), few_surrogates(1), Context()).statistic;
    const double gap = (test.null_statistics.rowwise() - expected.transpose())
                           .rowwise()
                           .lpNorm<Eigen::Infinity>()
                           .minCoeff();
    EXPECT_LT(gap, 1e-4) << lag;
  }
}

TEST(SurrogateTest, NullDataAreMostlyNotSignificant) {
  int alarms = 0;
  for (unsigned seed = 11; seed <= 30; ++seed) {
    const SurrogateTest test =
        surrogate_test(make_model(make_data(0.0, seed)), few_surrogates(59), Context());
    alarms += test.adjusted.minCoeff() <= 0.05 ? 1 : 0;
  }
  // At 5 % over all conditions together, Binomial(20, 0.05) exceeds 4 with probability 0.003.
  EXPECT_LE(alarms, 4);
}

TEST(SurrogateTest, OneAndTwoThreadsGiveTheSameBits) {
  const HistoryModel model = make_model(make_data(0.3, 5));
  Context one, two;
  two.threads = 2;
  const SurrogateTest a = surrogate_test(model, few_surrogates(20), one),
                      b = surrogate_test(model, few_surrogates(20), two);
  EXPECT_EQ(a.statistic, b.statistic);
  EXPECT_EQ(a.null_statistics, b.null_statistics);
  EXPECT_EQ(a.p_value, b.p_value);
}

TEST(SurrogateTest, SeedChoosesTheShifts) {
  const HistoryModel model = make_model(make_data(0.3, 5));
  Context one, other;
  other.seed = 2;
  EXPECT_NE(surrogate_test(model, few_surrogates(5), one).null_statistics,
            surrogate_test(model, few_surrogates(5), other).null_statistics);
}

TEST(SurrogateTest, RefusesOptionsWithoutMeaning) {
  const HistoryModel model = make_model(make_data(0.0, 6));
  SurrogateOptions none = few_surrogates(0), far = few_surrogates(), without = few_surrogates();
  far.smallest_shift = 0.5;
  without.error_settings.clear();
  for (const auto& options : {none, far, without}) {
    EXPECT_THROW(surrogate_test(model, options, Context()), std::invalid_argument);
  }
}

TEST(NullSetting, PicksWhiteForWhiteNoiseAndMemoryForMemory) {
  const ErrorOptions error{VectorXd::Constant(1, 5.0), Eigen::Vector3d(0.0, 1.0, 10.0)};
  HistoryData data = make_data(0.0, 7);
  EXPECT_EQ(null_setting(make_model(data, error)), 0);
  const MatrixXd root =
      error_covariance(data.axis, error.correlation_times, VectorXd::Constant(1, 10.0)).llt().matrixL();
  data.y = 20.0 + (0.5 * root * normal_vector(kN, 91)).array();
  EXPECT_EQ(null_setting(make_model(data, error)), 2);
}

}  // namespace
}  // namespace amiss
