#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/Context.hpp"
#include "engine/discrepancy/HistoryModel.hpp"

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

/// Shares of the discrepancy (draws x S). At each draw of the history posterior the value of a set of
/// conditions is what they explain alone (HistoryModel::explained), the others without a response. A row adds
/// up to what all explain together. Conditions that do not overlap get what each explains alone; what several
/// could explain alike is shared evenly; no share is negative. Cost O(2^S p^3) a draw, whatever N is, S
/// counting the conditions with t_s > 0.
Eigen::MatrixXd shapley_shares(const HistoryModel& model, const std::vector<HistoryParameters>& draws,
                               const ShapleyOptions& options, const Context& context);

}  // namespace amiss
