#include "engine/attribution/Attribution.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/parallel/parallel_for.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr Index kLeastGroup = 2;
constexpr int kFewSurrogates = 39;
constexpr double kAbove = 1e-6;  // nats by which a group must lose more than its members

// Conditions of one record, none of the others.
ConditionSet only_of(const std::vector<Record>& records, std::size_t which, std::vector<int> conditions) {
  ConditionSet set(records.size());
  set[which] = std::move(conditions);
  return set;
}

bool all_off(const Calibration& calibration, const ConditionSet& set, std::size_t draw) {
  for (std::size_t r = 0; r < set.size(); ++r) {
    for (int s : set[r]) {
      if (calibration.records[r].history[draw].t[s] != 0.0) return false;
    }
  }
  return true;
}

std::vector<Record> without(std::vector<Record> records, const ConditionSet& set) {
  for (std::size_t r = 0; r < set.size(); ++r) records[r].active = conditions_but(*records[r].model, set[r]);
  return records;
}

}  // namespace

DroppedSet dropped_by_draws(const std::vector<Record>& records, const Calibration& calibration,
                            ConditionSet set) {
  const AisResult& posterior = calibration.posterior;
  double off = 0.0, log_prior_off = 0.0;
  for (Index i = 0; i < posterior.weights.size(); ++i) {
    if (all_off(calibration, set, static_cast<std::size_t>(i))) off += posterior.weights[i];
  }
  for (std::size_t r = 0; r < set.size(); ++r) {
    if (!set[r].empty())
      log_prior_off +=
          static_cast<double>(set[r].size()) * std::log(1.0 - records[r].model->priors().inclusion);
  }
  DroppedSet out;
  out.trusted = trusted(posterior.outcome);
  out.standard_error = std::numeric_limits<double>::infinity();
  out.lost = std::numeric_limits<double>::infinity();
  if (std::isfinite(log_prior_off)) {
    out.lost = log_prior_off - std::log(off);
    // The error of a share among as many independent draws as the effective size; a share of none has none.
    if (off > 0) out.standard_error = std::sqrt(std::max(0.0, 1.0 - off) / (off * posterior.ess));
  }
  out.conditions = std::move(set);
  return out;
}

DroppedSet drop(const std::vector<Record>& records, const Calibration& calibration, ConditionSet set,
                const AisOptions& options, const Context& context, std::uint64_t item) {
  DroppedSet dropped = dropped_by_draws(records, calibration, std::move(set));
  if (!(dropped.standard_error > options.precision)) return dropped;
  const AisResult& posterior = calibration.posterior;
  const AisResult again = sample_posterior(CalibrationTarget(without(records, dropped.conditions)), options,
                                           context.fork(kWithout + item));
  dropped.lost = posterior.log_evidence - again.log_evidence;
  dropped.standard_error = std::hypot(posterior.standard_error, again.standard_error);
  dropped.trusted = trusted(posterior.outcome) && trusted(again.outcome);
  return dropped;
}

std::vector<std::vector<int>> find_groups(const std::vector<Record>& records, std::size_t which,
                                          const Calibration& calibration,
                                          const std::vector<DroppedSet>& singles, double least) {
  const auto lost = [&](const std::vector<int>& set) {
    if (set.size() == 1) return singles[static_cast<std::size_t>(set.front())].lost;
    return dropped_by_draws(records, calibration, only_of(records, which, set)).lost;
  };
  std::vector<int> left;
  for (int s = 0; s < records[which].model->conditions(); ++s) {
    if (lost({s}) < least) left.push_back(s);
  }
  // Those that act least leave the group first.
  std::stable_sort(left.begin(), left.end(), [&](int a, int b) { return lost({a}) < lost({b}); });
  std::vector<std::vector<int>> groups;
  while (static_cast<Index>(left.size()) >= kLeastGroup && lost(left) >= least) {
    std::vector<int> group = left;
    for (int s : left) {
      std::vector<int> smaller;
      std::copy_if(group.begin(), group.end(), std::back_inserter(smaller),
                   [&](int other) { return other != s; });
      if (!smaller.empty() && lost(smaller) >= least) group = std::move(smaller);
    }
    if (static_cast<Index>(group.size()) < kLeastGroup) break;
    left.erase(std::remove_if(left.begin(), left.end(),
                              [&](int s) { return std::find(group.begin(), group.end(), s) != group.end(); }),
               left.end());
    std::sort(group.begin(), group.end());
    groups.push_back(std::move(group));
  }
  return groups;
}

namespace {

// The sets of an attribution, tested.
void test_sets(const std::vector<Record>& records, std::size_t which, const Calibration& calibration,
               const AttributionOptions& options, const Context& context, Attribution& out) {
  const HistoryModel& model = *records[which].model;
  const RecordPosterior& own = calibration.records[which];
  std::vector<std::vector<int>> sets;
  for (const DroppedSet& dropped : out.sets) sets.push_back(dropped.conditions[which]);
  Index best = 0;
  calibration.posterior.log_likelihood.maxCoeff(&best);
  SurrogateOptions surrogates = options.surrogates;
  surrogates.settings = {own.history[static_cast<std::size_t>(best)].setting,
                         null_setting(model, own.tangent)};
  if (surrogates.settings[0] == surrogates.settings[1]) surrogates.settings.pop_back();
  // Where no set matters, none can be significant.
  if (std::none_of(out.sets.begin(), out.sets.end(),
                   [&](const DroppedSet& s) { return s.lost >= options.least; }))
    surrogates.surrogates = std::min(surrogates.surrogates, kFewSurrogates);
  out.test = surrogate_test(model, own.tangent, sets, surrogates, context);
  for (std::size_t s = 0; s < sets.size(); ++s)
    out.significant.push_back(
        options.significant(out.sets[s].lost, out.test.adjusted[static_cast<Index>(s)]));
}

// What the single condition loses that loses most among those that earn some evidence but no p-value;
// -infinity where there is none.
double most_hidden(const Attribution& attribution, int conditions, double least) {
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < static_cast<std::size_t>(conditions); ++s) {
    if (attribution.sets[s].lost >= least && !attribution.significant[s])
      most = std::max(most, attribution.sets[s].lost);
  }
  return most;
}

}  // namespace

Attribution attribute(const std::vector<Record>& records, std::size_t which, const Calibration& calibration,
                      const AttributionOptions& options, const Context& context) {
  const HistoryModel& model = *records[which].model;
  const RecordPosterior& own = calibration.records[which];
  const auto drop_own = [&](std::vector<DroppedSet>& sets, std::vector<int> set) {
    sets.push_back(drop(records, calibration, only_of(records, which, std::move(set)), options.ais, context,
                        sets.size()));
  };
  std::vector<DroppedSet> singles;
  for (int s = 0; s < model.conditions(); ++s) drop_own(singles, {s});
  // By what the singles lose in truth: chains that stick may never drop one of two that say the same.
  const auto groups_by = [&](double least) {
    return find_groups(records, which, calibration, singles, least);
  };
  const auto with_groups = [&](std::vector<std::vector<int>> groups) {
    Attribution out;
    out.sets = singles;
    for (std::vector<int>& group : groups) drop_own(out.sets, std::move(group));
    test_sets(records, which, calibration, options, context, out);
    return out;
  };
  Attribution out = with_groups(groups_by(options.least));
  const double hidden = most_hidden(out, model.conditions(), options.least);
  if (std::isfinite(hidden)) {
    std::vector<std::vector<int>> groups = groups_by(hidden + kAbove);
    const bool told = std::any_of(groups.begin(), groups.end(), [&](const std::vector<int>& group) {
      return std::any_of(group.begin(), group.end(),
                         [&](int s) { return out.significant[static_cast<std::size_t>(s)]; });
    });
    if (!groups.empty() && !told) out = with_groups(std::move(groups));
  }

  std::vector<HistoryParameters> kept;
  for (Index i : calibration.kept) kept.push_back(own.history[static_cast<std::size_t>(i)]);
  out.shares = shapley_shares(model, own.tangent, kept, ShapleyOptions(), context);
  return out;
}

}  // namespace amiss
