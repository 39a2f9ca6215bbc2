#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "attribution_helpers.hpp"
#include "engine/attribution/ShapleyShares.hpp"

namespace amiss {
namespace {

using namespace test;

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

std::vector<HistoryParameters> make_history_draws() {
  return {{0, 0.3, Eigen::Vector3d(0.5, 2.0, 0.01)},
          {1, 0.1, Eigen::Vector3d(0.02, 0.7, 3.0)},
          {3, 0.2, Eigen::Vector3d(0.4, 0.0, 0.3)}};
}

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

}  // namespace
}  // namespace amiss
