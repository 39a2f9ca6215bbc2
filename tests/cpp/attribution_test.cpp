#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "engine/attribution/Attribution.hpp"
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

HistoryModel make_model(const HistoryData& data, const ErrorOptions& error = {},
                        const std::vector<double>& reach = {kInfinity}) {
  HistoryPriors priors;
  priors.noise_sd = 0.5;
  priors.error = error;
  priors.reach = reach;
  return HistoryModel(data, priors, Context());
}

// w ~ N(mean, root root'): both coefficients uncertain, and together.
GaussianSimulator make_simulator() {
  return {Eigen::Vector2d(0.8, 20.5), (MatrixXd(2, 2) << 0.4, 0.0, 0.3, 1.0).finished()};
}

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

// Both variances found by exhaustive search, under each of two settings.
TEST(SurrogateTest, StatisticIsTheLossOfLogLikelihoodOfFreeFits) {
  HistoryData data = make_data(0.3, 2);
  data.responses = MatrixXd(data.responses.leftCols(4));
  data.condition = {0, 0, 1, 1};
  const HistoryModel model = make_model(data, {VectorXd::Constant(1, 3.0), Eigen::Vector2d(0.0, 2.0)});
  const GaussianSimulator simulator = make_simulator();
  double full = -kInfinity, without_first = -kInfinity, without_both = -kInfinity;
  for (int g : {0, 1}) {
    const WhitenedData seen =
        model.whitened(g).in_terms_of(simulator.mean - model.reference(), simulator.root);
    const auto f = [&](const VectorXd& x) {
      VectorXd t = VectorXd::Zero(2);
      for (Index k = 1; k < x.size(); ++k) t[2 - k] = std::exp(x[k]);  // the second condition first
      return model.log_likelihood(seen, x[0], t);
    };
    full = std::max(full, largest(f, Eigen::Vector3d(-1.5, -4.0, -4.0), Eigen::Vector3d(1.5, 6.0, 6.0)));
    without_first =
        std::max(without_first, largest(f, Eigen::Vector2d(-1.5, -4.0), Eigen::Vector2d(1.5, 6.0)));
    without_both =
        std::max(without_both, largest(f, VectorXd::Constant(1, -1.5), VectorXd::Constant(1, 1.5)));
  }
  SurrogateOptions options = few_surrogates(1);
  options.settings = {0, 1};
  const SurrogateTest test = surrogate_test(model, simulator, {{0}, {0, 1}, {1, 0}}, options, Context());
  ASSERT_GT(full - without_first, 1.0);
  // A fit ends at 1e-5 of its value, near -100; a loss is the difference of two.
  EXPECT_NEAR(test.statistic[0], full - without_first, 3e-3);
  EXPECT_NEAR(test.statistic[1], full - without_both, 3e-3);
  EXPECT_EQ(test.statistic[1], test.statistic[2]);
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
          {3, 0.2, Eigen::Vector3d(0.4, 0.0, 0.3)}};
}

const std::vector<double> kReaches{30.0, kInfinity};

HistoryData data_with_moves() {
  HistoryData data = make_data(1.0, 3);
  data.moves = data.basis * make_simulator().root;
  return data;
}

// 1 - r'V_A^-1 r / r'V_0^-1 r with N x N matrices, the conditions in the coalition only.
double dense_explained(const HistoryData& data, const HistoryParameters& p, std::uint64_t coalition) {
  const GaussianSimulator simulator = make_simulator();
  const MatrixXd& moves = data.moves;
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < phi.cols(); ++j) {
    const int s = data.condition[static_cast<std::size_t>(j)];
    const double columns = static_cast<double>(std::count(data.condition.begin(), data.condition.end(), s));
    phi.col(j) *=
        ((coalition >> s) & 1) != 0 ? std::sqrt(p.t[s] / columns * kN / phi.col(j).squaredNorm()) : 0.0;
  }
  if (p.setting < 2) {
    const MatrixXd a = moves * moves.transpose() / (kReaches[0] * 0.25);
    phi = (MatrixXd::Identity(kN, kN) + a * a).ldlt().solve(phi);
  }
  const MatrixXd alone = p.variance * error_covariance(data.axis, kTwoErrors.correlation_times,
                                                       kTwoErrors.setting(p.setting % 2)) +
                         moves * moves.transpose();
  const VectorXd r = data.y - data.basis * simulator.mean;
  return 1.0 - r.dot((alone + phi * phi.transpose()).ldlt().solve(r)) / r.dot(alone.ldlt().solve(r));
}

TEST(ShapleyShares, EqualTheDenseOnes) {
  const HistoryData data = data_with_moves();
  const HistoryModel model = make_model(data, kTwoErrors, kReaches);
  const std::vector<HistoryParameters> draws = make_history_draws();
  const MatrixXd shares = shapley_shares(model, make_simulator(), draws, {}, Context());
  for (Index i = 0; i < 3; ++i) {
    const HistoryParameters& p = draws[static_cast<std::size_t>(i)];
    const auto value = [&](std::uint64_t a) { return dense_explained(data, p, a); };
    // Shares of the order of 1; covariances with eigenvalues from 0.1 to 1e3.
    EXPECT_LT((shares.row(i).transpose() - over_all_orders(3, value)).cwiseAbs().maxCoeff(), 1e-9) << i;
    EXPECT_NEAR(shares.row(i).sum(), value(7), 1e-9);
    EXPECT_GE(shares.row(i).minCoeff(), 0.0);
    EXPECT_GT(shares.row(i).sum(), 0.3);
  }
  EXPECT_EQ(shares(2, 1), 0.0);  // a condition without variance has none
  Context two;
  two.threads = 2;
  EXPECT_EQ(shapley_shares(model, make_simulator(), draws, {}, two), shares);
}

// Centred columns orthogonal to one another and to K, the vector of ones; white error.
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

// Of one coefficient about which nearly nothing is known.
GaussianSimulator free_mean() { return {VectorXd::Constant(1, 20.0), MatrixXd::Constant(1, 1, 1e5)}; }

TEST(ShapleyShares, OfOrthogonalConditionsAreWhatEachExplains) {
  const HistoryData data = orthogonal_data();
  const HistoryModel model = make_model(data);
  const HistoryParameters p{0, 0.04, Eigen::Vector3d(0.3, 0.02, 1.0)};
  const VectorXd shares = shapley_shares(model, free_mean(), {p}, {}, Context()).row(0).transpose();
  const VectorXd centred = data.y.array() - data.y.mean();
  for (Index s = 0; s < 3; ++s) {
    // Simple regression on a column of squared norm N: R^2, shrunk by N t / (N t + sigma^2).
    const double plain = std::pow(centred.dot(data.responses.col(s)), 2) / centred.squaredNorm();
    EXPECT_NEAR(shares[s], plain * kN * p.t[s] / (kN * p.t[s] + p.variance), 1e-9) << s;
  }
}

TEST(ShapleyShares, TwoConditionsThatAreTheSameShareEvenly) {
  HistoryData data = orthogonal_data();
  data.responses.col(2) = 7.0 * data.responses.col(0).array() - 2.0;
  const HistoryModel model = make_model(data);
  const VectorXd t = Eigen::Vector3d(0.3, 0.02, 0.3);
  const VectorXd shares =
      shapley_shares(model, free_mean(), {{0, 0.04, t}}, {}, Context()).row(0).transpose();
  EXPECT_NEAR(shares[0], shares[2], 1e-9);
  EXPECT_GT(shares[0], 0.05);
}

TEST(ShapleyShares, NamesOfTheConditionsDoNotMatter) {
  const HistoryData data = data_with_moves();
  HistoryData other = data;  // 0, 1, 2 become 2, 0, 1
  for (int& s : other.condition) s = (s + 2) % 3;
  const HistoryModel a = make_model(data, kTwoErrors, kReaches), b = make_model(other, kTwoErrors, kReaches);
  for (HistoryParameters p : make_history_draws()) {
    HistoryParameters q = p;
    for (int s = 0; s < 3; ++s) q.t[(s + 2) % 3] = p.t[s];
    const MatrixXd first = shapley_shares(a, make_simulator(), {p}, {}, Context()),
                   second = shapley_shares(b, make_simulator(), {q}, {}, Context());
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
  const MatrixXd sampled = shapley_shares(model, make_simulator(), {p}, {}, Context()),
                 exact = shapley_shares(model, make_simulator(), {p}, all, Context());
  EXPECT_NEAR(sampled.sum(), exact.sum(), 1e-12);  // both what all explain together
  // Nearly orthogonal columns: what a condition adds depends little on the order.
  EXPECT_LT((sampled - exact).cwiseAbs().maxCoeff(), 0.003);
}

// A posterior of draws with the conditions that are on in each (a bit for each) and their weights.
Calibration by_hand(const std::vector<std::pair<unsigned, double>>& draws, Index conditions) {
  Calibration c;
  c.posterior.weights.resize(static_cast<Index>(draws.size()));
  for (std::size_t i = 0; i < draws.size(); ++i) {
    HistoryParameters p{0, 1.0, VectorXd::Zero(conditions)};
    for (Index s = 0; s < conditions; ++s) p.t[s] = ((draws[i].first >> s) & 1) != 0 ? 0.7 : 0.0;
    c.history.push_back(p);
    c.posterior.weights[static_cast<Index>(i)] = draws[i].second;
  }
  c.posterior.ess = 400.0;
  c.posterior.trusted = true;
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
  EXPECT_EQ(both.conditions, (std::vector<int>{1, 0}));
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
  const Calibration calibration = calibrate(record.model, record.emulator, {}, Context());
  AttributionOptions options;
  options.surrogates.surrogates = 59;
  const Attribution own = attribute(record.model, record.emulator, calibration, options, Context());
  ASSERT_EQ(own.sets.size(), 4u);
  for (std::size_t s = 0; s < 3; ++s) {
    EXPECT_EQ(own.sets[s].conditions, std::vector<int>{static_cast<int>(s)});
    EXPECT_LT(own.sets[s].lost, options.least) << s;
    EXPECT_LT(own.sets[s].standard_error, 0.2) << s;
  }
  const DroppedSet& pair = own.sets[3];
  EXPECT_EQ(pair.conditions, (std::vector<int>{0, 1}));
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

TEST(Attribute, WhereNothingActsNothingIsNamedAndFewSurrogatesSuffice) {
  const Copied record(0.0);
  const Calibration calibration = calibrate(record.model, record.emulator, {}, Context());
  const Attribution own = attribute(record.model, record.emulator, calibration, {}, Context());
  ASSERT_EQ(own.sets.size(), 3u);
  for (const DroppedSet& set : own.sets) EXPECT_LT(set.lost, 1.15);
  EXPECT_EQ(own.test.null_statistics.rows(), 39);
}

TEST(Attribute, OneAndTwoThreadsGiveTheSameBits) {
  const Copied record(0.4);
  const Calibration calibration = calibrate(record.model, record.emulator, {}, Context());
  AttributionOptions options;
  options.surrogates.surrogates = 19;
  Context two;
  two.threads = 2;
  const Attribution a = attribute(record.model, record.emulator, calibration, options, Context()),
                    b = attribute(record.model, record.emulator, calibration, options, two);
  ASSERT_EQ(a.sets.size(), b.sets.size());
  for (std::size_t k = 0; k < a.sets.size(); ++k) EXPECT_EQ(a.sets[k].lost, b.sets[k].lost);
  EXPECT_EQ(a.test.null_statistics, b.test.null_statistics);
  EXPECT_EQ(a.shares, b.shares);
}

}  // namespace
}  // namespace amiss
