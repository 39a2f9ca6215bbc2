#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/Context.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"

namespace amiss {

struct ShapleyOptions {
  int exact_players = 10;  ///< up to so many, over all coalitions; beyond, over random orders
  int orders = 200;        ///< random orders, each with its reverse

  void check() const;
};

/// Shapley values (1953) of a game: what each player adds to the value of those before it, averaged over all
/// orders of the players. They add up to value(all) - value(none); over random orders they still do.
/// @param players At most 63. @param value Of a coalition, player s at bit s; called 2^players times, or
/// 2 orders players times.
Eigen::VectorXd shapley_values(int players, const std::function<double(std::uint64_t)>& value,
                               const ShapleyOptions& options, const Context& context);

/// Shares of what the simulator leaves unexplained (draws x S). With the simulator seen as a Gaussian, r = y
/// less its mean and V_A the covariance of y at a draw of the history posterior if only the conditions of the
/// set A act, the value of A is
///     1 - r' V_A^-1 r / r' V_0^-1 r,
/// the part of the misfit, in the metric of error and simulator, that the responses to A take away: between 0
/// and 1, and never less for more conditions. A row adds up to what all explain together. What several could
/// explain alike is shared evenly; no share is negative. Cost O(2^S p^3) a draw, whatever N is, S counting
/// the conditions with t_s > 0.
Eigen::MatrixXd shapley_shares(const HistoryModel& model, const GaussianSimulator& simulator,
                               const std::vector<HistoryParameters>& draws, const ShapleyOptions& options,
                               const Context& context);

}  // namespace amiss
