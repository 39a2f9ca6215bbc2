#pragma once
#include <vector>

#include "engine/attribution/ShapleyShares.hpp"
#include "engine/attribution/SurrogateTest.hpp"
#include "engine/calibration/Calibration.hpp"

namespace amiss {

struct AttributionOptions {
  AisOptions ais;               ///< of posteriors that are sampled again without a set of conditions
  SurrogateOptions surrogates;  ///< its settings are chosen here
  double least = 1.15;          ///< nats that a set of conditions must earn to matter
};

/// Conditions that are dropped from the discrepancy together.
struct DroppedSet {
  std::vector<int> conditions;
  double lost = 0.0;            ///< log evidence of the model less that without them
  double standard_error = 0.0;  ///< of it
  bool trusted = false;
};

/// Which conditions drive the discrepancy.
struct Attribution {
  std::vector<DroppedSet> sets;  ///< the S single conditions, then groups that cannot be told apart
  SurrogateTest test;            ///< of the same sets
  Eigen::MatrixXd shares;        ///< kept draws x S
};

/// The evidence lost without a set comes from the posterior's own draws: with independent priors the model
/// without it is the one with t_s = 0 for all its conditions, so that Z_without / Z = P(off | y) / P(off)
/// (Savage and Dickey). Where too few draws have it off, the posterior is sampled again without it.
///
/// Conditions that say the same hide one another: each can be dropped alone. Among those that are dropped
/// alone without harm a set is sought that cannot be dropped together, nor be made smaller: a group. As many
/// groups as there are, each from the conditions that the groups before it have left.
Attribution attribute(const HistoryModel& model, const Emulator& emulator, const Calibration& calibration,
                      const AttributionOptions& options, const Context& context);

/// The part of it that needs the draws alone.
DroppedSet dropped_by_draws(const HistoryModel& model, const Calibration& calibration, std::vector<int> set);
std::vector<std::vector<int>> find_groups(const HistoryModel& model, const Calibration& calibration,
                                          const std::vector<DroppedSet>& singles, double least);

}  // namespace amiss
