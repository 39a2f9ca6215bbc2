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

}  // namespace

DroppedSet dropped_by_draws(const HistoryModel& model, const Calibration& calibration, std::vector<int> set) {
  const AisResult& posterior = calibration.posterior;
  double off = 0.0;
  for (std::size_t i = 0; i < calibration.history.size(); ++i) {
    const VectorXd& t = calibration.history[i].t;
    if (std::all_of(set.begin(), set.end(), [&](int s) { return t[s] == 0.0; }))
      off += posterior.weights[static_cast<Index>(i)];
  }
  DroppedSet out;
  const double prior_off = 1.0 - model.priors().inclusion;
  out.trusted = trusted(posterior.outcome);
  out.standard_error = std::numeric_limits<double>::infinity();
  out.lost = std::numeric_limits<double>::infinity();
  if (prior_off > 0) {
    out.lost = static_cast<double>(set.size()) * std::log(prior_off) - std::log(off);
    // The error of a share among as many independent draws as the effective size; a share of none has none.
    if (off > 0) out.standard_error = std::sqrt(std::max(0.0, 1.0 - off) / (off * posterior.ess));
  }
  out.conditions = std::move(set);
  return out;
}

std::vector<std::vector<int>> find_groups(const HistoryModel& model, const Calibration& calibration,
                                          const std::vector<DroppedSet>& singles, double least) {
  const auto lost = [&](const std::vector<int>& set) {
    if (set.size() == 1) return singles[static_cast<std::size_t>(set.front())].lost;
    return dropped_by_draws(model, calibration, set).lost;
  };
  std::vector<int> left;
  for (int s = 0; s < model.conditions(); ++s) {
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

Attribution attribute(const HistoryModel& model, const Emulator& emulator, const Calibration& calibration,
                      const AttributionOptions& options, const Context& context) {
  Attribution out;
  const AisResult& posterior = calibration.posterior;
  const auto drop = [&](std::vector<int> set) {
    DroppedSet dropped = dropped_by_draws(model, calibration, std::move(set));
    if (dropped.standard_error > options.ais.precision) {
      const CalibrationTarget without(model, conditions_but(model, dropped.conditions), emulator);
      const AisResult again =
          sample_posterior(without, options.ais, context.fork(kWithout + out.sets.size()));
      dropped.lost = posterior.log_evidence - again.log_evidence;
      dropped.standard_error = std::hypot(posterior.standard_error, again.standard_error);
      dropped.trusted = trusted(posterior.outcome) && trusted(again.outcome);
    }
    out.sets.push_back(std::move(dropped));
  };
  for (int s = 0; s < model.conditions(); ++s) drop({s});
  // By what the singles lose in truth: chains that stick may never drop one of two that say the same.
  for (std::vector<int>& group : find_groups(model, calibration, out.sets, options.least))
    drop(std::move(group));
  std::vector<std::vector<int>> sets;
  for (const DroppedSet& dropped : out.sets) sets.push_back(dropped.conditions);

  Index best = 0;
  posterior.log_likelihood.maxCoeff(&best);
  SurrogateOptions surrogates = options.surrogates;
  surrogates.settings = {calibration.history[static_cast<std::size_t>(best)].setting,
                         null_setting(model, calibration.tangent)};
  if (surrogates.settings[0] == surrogates.settings[1]) surrogates.settings.pop_back();
  // Where no set matters, none can be significant.
  if (std::none_of(out.sets.begin(), out.sets.end(),
                   [&](const DroppedSet& s) { return s.lost >= options.least; }))
    surrogates.surrogates = std::min(surrogates.surrogates, kFewSurrogates);
  out.test = surrogate_test(model, calibration.tangent, sets, surrogates, context);

  std::vector<HistoryParameters> kept;
  for (Index i : calibration.kept) kept.push_back(calibration.history[static_cast<std::size_t>(i)]);
  out.shares = shapley_shares(model, calibration.tangent, kept, ShapleyOptions(), context);
  return out;
}

}  // namespace amiss
