#include "engine/attribution/ShapleyShares.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "engine/linalg/log_gamma.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/Stream.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Coalition = std::uint64_t;

Coalition bit(int player) { return Coalition{1} << player; }

// A coalition of c others comes before a player in c! (n - c - 1)! of the n! orders.
VectorXd over_coalitions(int n, const std::function<double(Coalition)>& value) {
  std::vector<double> weight(static_cast<std::size_t>(n)), known(std::size_t{1} << n);
  for (int c = 0; c < n; ++c)
    weight[c] = std::exp(log_gamma(c + 1.0) + log_gamma(n - c) - log_gamma(n + 1.0));
  for (Coalition a = 0; a < known.size(); ++a) known[a] = value(a);
  VectorXd values = VectorXd::Zero(n);
  for (Coalition a = 0; a < known.size(); ++a) {
    int others = 0;
    for (int s = 0; s < n; ++s) others += (a & bit(s)) != 0 ? 1 : 0;
    for (int s = 0; s < n; ++s) {
      if ((a & bit(s)) == 0) values[s] += weight[others] * (known[a | bit(s)] - known[a]);
    }
  }
  return values;
}

VectorXd over_orders(int n, const std::function<double(Coalition)>& value, int orders, Stream stream) {
  VectorXd values = VectorXd::Zero(n);
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  const double none = value(0);
  for (int k = 0; k < 2 * orders; ++k) {
    if (k % 2 == 1) {
      std::reverse(order.begin(), order.end());
    } else {
      for (int i = n - 1; i > 0; --i) std::swap(order[i], order[stream.index(i + 1)]);
    }
    Coalition before = 0;
    double last = none;
    for (int s : order) {
      before |= bit(s);
      const double now = value(before);
      values[s] += now - last;
      last = now;
    }
  }
  return values / (2.0 * orders);
}

}  // namespace

void ShapleyOptions::check() const {
  if (exact_players < 0 || exact_players > 20)
    throw std::invalid_argument("shapley: exact_players must lie in [0, 20]");
  if (orders < 1) throw std::invalid_argument("shapley: at least one order is needed");
}

VectorXd shapley_values(int players, const std::function<double(Coalition)>& value,
                        const ShapleyOptions& options, const Context& context) {
  options.check();
  if (players < 0 || players > 63) throw std::invalid_argument("shapley: between 0 and 63 players");
  if (players <= options.exact_players) return over_coalitions(players, value);
  return over_orders(players, value, options.orders, Stream(context.seed, kOrders, 0));
}

MatrixXd shapley_shares(const HistoryModel& model, const GaussianSimulator& simulator,
                        const std::vector<HistoryParameters>& draws, const ShapleyOptions& options,
                        const Context& context) {
  MatrixXd shares = MatrixXd::Zero(static_cast<Index>(draws.size()), model.conditions());
  parallel_for(static_cast<int>(draws.size()), context, [&](int i) {
    const HistoryParameters& draw = draws[static_cast<std::size_t>(i)];
    const WhitenedData seen =
        model.whitened(draw.setting).in_terms_of(simulator.mean - model.reference(), simulator.root);
    const double log_variance = std::log(draw.variance);
    const double alone = model.quadratic(seen, log_variance, VectorXd::Zero(draw.t.size()));
    std::vector<int> acting;
    for (int s = 0; s < model.conditions(); ++s) {
      if (draw.t[s] > 0) acting.push_back(s);
    }
    const auto value = [&](Coalition coalition) {
      VectorXd t = VectorXd::Zero(draw.t.size());
      for (std::size_t a = 0; a < acting.size(); ++a) {
        if ((coalition & bit(static_cast<int>(a))) != 0) t[acting[a]] = draw.t[acting[a]];
      }
      return alone > 0 ? 1.0 - model.quadratic(seen, log_variance, t) / alone : 0.0;
    };
    const VectorXd values = shapley_values(static_cast<int>(acting.size()), value, options, context);
    for (std::size_t a = 0; a < acting.size(); ++a) shares(i, acting[a]) = values[static_cast<Index>(a)];
  });
  return shares;
}

}  // namespace amiss
