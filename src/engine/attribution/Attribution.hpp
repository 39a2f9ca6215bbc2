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
  double decisive = 4.6;        ///< nats that need no test
  double level = 0.05;          ///< of the test

  /// Whether a set is significant that earns `lost` nats and has the adjusted p-value `p`.
  bool significant(double lost, double p) const { return lost >= decisive || (lost >= least && p <= level); }
};

/// Conditions that are dropped from the discrepancies together: of each record those that are.
using ConditionSet = std::vector<std::vector<int>>;

struct DroppedSet {
  ConditionSet conditions;
  double lost = 0.0;            ///< log evidence of the model less that without them
  double standard_error = 0.0;  ///< of it
  bool trusted = false;
};

/// Which conditions drive the discrepancy of a record.
struct Attribution {
  std::vector<DroppedSet> sets;   ///< the S single conditions, then groups that cannot be told apart
  SurrogateTest test;             ///< of the same sets
  std::vector<bool> significant;  ///< those of which AttributionOptions::significant() holds
  Eigen::MatrixXd shares;         ///< kept draws x S
};

/// The evidence lost without a set comes from the posterior's own draws: with independent priors the model
/// without it is the one with t_s = 0 for all its conditions, so that Z_without / Z = P(off | y) / P(off)
/// (Savage and Dickey). Where too few draws have it off, the posterior is sampled again without it.
///
/// Conditions that say the same hide one another: each can be dropped alone. Among those that are dropped
/// alone without harm a set is sought that cannot be dropped together, nor be made smaller: a group. As many
/// groups as there are, each from the conditions that the groups before it have left. Of two that say the
/// same, one may earn just enough to stay out of that search, and yet no surrogate misses it, as the other
/// takes its place: where a condition earns some evidence but no p-value, groups are sought once more with
/// it. What was significant by itself keeps its own name.
///
/// @param which  the record whose conditions are dropped; the others keep theirs. Surrogates and shares take
/// the
///   parameters as this record alone leaves them.
Attribution attribute(const std::vector<Record>& records, std::size_t which, const Calibration& calibration,
                      const AttributionOptions& options, const Context& context);

/// One set dropped. @param item  of the random numbers, if the posterior is sampled again.
DroppedSet drop(const std::vector<Record>& records, const Calibration& calibration, ConditionSet set,
                const AisOptions& options, const Context& context, std::uint64_t item = 0);

/// The part of it that needs the draws alone.
DroppedSet dropped_by_draws(const std::vector<Record>& records, const Calibration& calibration,
                            ConditionSet set);
/// Groups of conditions of record `which`, by what its single ones lose.
std::vector<std::vector<int>> find_groups(const std::vector<Record>& records, std::size_t which,
                                          const Calibration& calibration,
                                          const std::vector<DroppedSet>& singles, double least);

}  // namespace amiss
