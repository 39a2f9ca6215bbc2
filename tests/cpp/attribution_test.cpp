#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>

#include "engine/attribution/ShapleyShares.hpp"
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

// Average over all orders of the players, as Shapley values are defined.
VectorXd over_all_orders(int n, const std::function<double(std::uint64_t)>& value) {
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  VectorXd sum = VectorXd::Zero(n);
  int orders = 0;
  do {
    std::uint64_t before = 0;
    for (int s : order) {
      const std::uint64_t now = before | (std::uint64_t{1} << s);
      sum[s] += value(now) - value(before);
      before = now;
    }
    ++orders;
  } while (std::next_permutation(order.begin(), order.end()));
  return sum / orders;
}

TEST(ShapleyValues, PairOfGloves) {
  // One has a left glove (bit 0), two have right ones; only a pair has a value. Textbook: 2/3, 1/6, 1/6.
  const auto pair = [](std::uint64_t a) { return (a & 1) != 0 && (a & 6) != 0 ? 1.0 : 0.0; };
  const VectorXd values = shapley_values(3, pair, {}, Context());
  EXPECT_NEAR(values[0], 2.0 / 3, 1e-14);
  EXPECT_NEAR(values[1], 1.0 / 6, 1e-14);
  EXPECT_NEAR(values[2], 1.0 / 6, 1e-14);
}

TEST(ShapleyValues, EqualTheAverageOverAllOrders) {
  for (int n : {0, 1, 2, 5, 7}) {
    const VectorXd table = normal_vector(Index{1} << n, 5);
    const auto value = [&](std::uint64_t a) { return table[static_cast<Index>(a)]; };
    const VectorXd own = shapley_values(n, value, {}, Context());
    ASSERT_EQ(own.size(), n);
    if (n == 0) continue;
    EXPECT_LT((own - over_all_orders(n, value)).cwiseAbs().maxCoeff(), 1e-12) << n;
  }
}

TEST(ShapleyValues, RandomOrdersAddUpExactlyAndComeClose) {
  const int n = 8;
  const VectorXd table = uniform_matrix(1 << n, 1, 6);
  const auto value = [&](std::uint64_t a) { return table[static_cast<Index>(a)]; };
  const VectorXd exact = shapley_values(n, value, {}, Context());
  ShapleyOptions options;
  options.exact_players = 0;
  options.orders = 2000;
  const VectorXd sampled = shapley_values(n, value, options, Context());
  EXPECT_NEAR(sampled.sum(), table[(1 << n) - 1] - table[0], 1e-12);
  // A marginal contribution has sd 0.41 (difference of two uniforms); 4000 orders: 0.0065; 5 of it.
  EXPECT_LT((sampled - exact).cwiseAbs().maxCoeff(), 0.033);
  EXPECT_GT((sampled - exact).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_EQ(sampled, shapley_values(n, value, options, Context()));
  EXPECT_THROW(shapley_values(64, value, options, Context()), std::invalid_argument);
}

const ErrorOptions kTwoErrors{VectorXd::Constant(1, 3.0), Eigen::Vector2d(0.0, 2.0)};

std::vector<HistoryParameters> make_history_draws() {
  return {{0, 0.3, Eigen::Vector3d(0.5, 2.0, 0.01)},
          {1, 0.1, Eigen::Vector3d(0.02, 0.7, 3.0)},
          {1, 0.2, Eigen::Vector3d(0.4, 0.0, 0.3)}};
}

// 1 - sigma^2 v'(H'AH)^-1 v / v'(H'CH)^-1 v with N x N matrices and an explicit complement, the conditions in
// the coalition only.
double dense_explained(const HistoryData& data, const HistoryParameters& p, std::uint64_t coalition) {
  const MatrixXd h = Eigen::HouseholderQR<MatrixXd>(data.basis).householderQ() *
                     MatrixXd::Identity(kN, kN).rightCols(kN - data.basis.cols());
  const MatrixXd c = error_covariance(data.axis, kTwoErrors.correlation_times, kTwoErrors.setting(p.setting));
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < phi.cols(); ++j) {
    const int s = data.condition[static_cast<std::size_t>(j)];
    const double columns = static_cast<double>(std::count(data.condition.begin(), data.condition.end(), s));
    phi.col(j) *=
        ((coalition >> s) & 1) != 0 ? std::sqrt(p.t[s] / columns * kN / phi.col(j).squaredNorm()) : 0.0;
  }
  const VectorXd v = h.transpose() * data.y;
  const MatrixXd seen = h.transpose() * (p.variance * c + phi * phi.transpose()) * h;
  return 1.0 - p.variance * v.dot(seen.ldlt().solve(v)) / v.dot((h.transpose() * c * h).ldlt().solve(v));
}

TEST(ShapleyShares, EqualTheDenseOnes) {
  const HistoryData data = make_data(1.0, 3);
  const HistoryModel model = make_model(data, kTwoErrors);
  const std::vector<HistoryParameters> draws = make_history_draws();
  const MatrixXd shares = shapley_shares(model, draws, {}, Context());
  for (Index i = 0; i < 3; ++i) {
    const HistoryParameters& p = draws[static_cast<std::size_t>(i)];
    const auto value = [&](std::uint64_t a) { return dense_explained(data, p, a); };
    EXPECT_LT((shares.row(i).transpose() - over_all_orders(3, value)).cwiseAbs().maxCoeff(), 1e-9) << i;
    // What all explain, exactly; no share is negative; a condition without variance has none.
    EXPECT_NEAR(shares.row(i).sum(), model.explained(model.whitened(p.setting), std::log(p.variance), p.t),
                1e-13);
    EXPECT_GE(shares.row(i).minCoeff(), 0.0);
  }
  EXPECT_EQ(shares(2, 1), 0.0);
  Context two;
  two.threads = 2;
  EXPECT_EQ(shapley_shares(model, draws, {}, two), shares);
}

// Centred columns orthogonal to one another, with white error and K the vector of ones.
HistoryData orthogonal_data() {
  HistoryData data;
  data.axis = even_axis(kN);
  data.basis = VectorXd::Ones(kN);
  MatrixXd x(kN, 4);
  x << VectorXd::Ones(kN), normal_matrix(kN, 3, 71);
  const MatrixXd o = Eigen::HouseholderQR<MatrixXd>(x).householderQ() * MatrixXd::Identity(kN, 4);
  data.responses = o.rightCols(3);
  data.condition = {0, 1, 2};
  data.y = 20.0 + (data.responses * Eigen::Vector3d(3.0, 1.0, 5.0) + 0.3 * normal_vector(kN, 72)).array();
  return data;
}

TEST(ShapleyShares, OfOrthogonalConditionsAreWhatEachExplains) {
  const HistoryData data = orthogonal_data();
  const HistoryModel model = make_model(data);
  const HistoryParameters p{0, 0.04, Eigen::Vector3d(0.3, 0.02, 1.0)};
  const VectorXd shares = shapley_shares(model, {p}, {}, Context()).row(0).transpose();
  const VectorXd centred = data.y.array() - data.y.mean();
  for (Index s = 0; s < 3; ++s) {
    // Simple regression on a column of squared norm N: R^2, shrunk by N t / (N t + sigma^2).
    const double plain = std::pow(centred.dot(data.responses.col(s)), 2) / centred.squaredNorm();
    EXPECT_NEAR(shares[s], plain * kN * p.t[s] / (kN * p.t[s] + p.variance), 1e-12) << s;
  }
}

TEST(ShapleyShares, TwoConditionsThatAreTheSameShareEvenly) {
  HistoryData data = orthogonal_data();
  data.responses.col(2) = 7.0 * data.responses.col(0).array() - 2.0;
  const HistoryModel model = make_model(data);
  const VectorXd t = Eigen::Vector3d(0.3, 0.02, 0.3);
  const VectorXd shares = shapley_shares(model, {{0, 0.04, t}}, {}, Context()).row(0).transpose();
  EXPECT_NEAR(shares[0], shares[2], 1e-12);
  EXPECT_NEAR(shares[0] + shares[2],
              model.explained(model.whitened(0), std::log(0.04), Eigen::Vector3d(0.3, 0.0, 0.3)), 1e-12);
}

TEST(ShapleyShares, NamesOfTheConditionsDoNotMatter) {
  const HistoryData data = make_data(1.0, 3);
  HistoryData other = data;  // 0, 1, 2 become 2, 0, 1
  for (int& s : other.condition) s = (s + 2) % 3;
  const HistoryModel a = make_model(data, kTwoErrors), b = make_model(other, kTwoErrors);
  for (HistoryParameters p : make_history_draws()) {
    HistoryParameters q = p;
    for (int s = 0; s < 3; ++s) q.t[(s + 2) % 3] = p.t[s];
    EXPECT_NEAR(a.log_likelihood(p.setting, std::log(p.variance), p.t),
                b.log_likelihood(q.setting, std::log(q.variance), q.t), 1e-8);
    const MatrixXd first = shapley_shares(a, {p}, {}, Context()),
                   second = shapley_shares(b, {q}, {}, Context());
    for (int s = 0; s < 3; ++s) EXPECT_NEAR(first(0, s), second(0, (s + 2) % 3), 1e-12);
  }
}

TEST(ShapleyShares, SharesOfElevenConditionsAddUp) {
  HistoryData data = make_data(1.0, 3);
  data.responses = normal_matrix(kN, 11, 73);
  data.condition.resize(11);
  std::iota(data.condition.begin(), data.condition.end(), 0);
  const HistoryModel model = make_model(data);
  const HistoryParameters p{0, 0.3, VectorXd::LinSpaced(11, 0.1, 1.0)};
  ShapleyOptions all;
  all.exact_players = 11;
  const MatrixXd sampled = shapley_shares(model, {p}, {}, Context()),
                 exact = shapley_shares(model, {p}, all, Context());
  EXPECT_NEAR(sampled.sum(), model.explained(model.whitened(0), std::log(0.3), p.t), 1e-12);
  // Nearly orthogonal columns: what a condition adds depends little on the order.
  EXPECT_LT((sampled - exact).cwiseAbs().maxCoeff(), 0.003);
}

}  // namespace
}  // namespace amiss
