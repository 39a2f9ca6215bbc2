#pragma once
#include <cstdint>
#include <vector>

#include "engine/ais/Pilot.hpp"
#include "engine/ais/Temperature.hpp"

namespace amiss {

/// Standard error and 95 % interval of an estimate.
struct Spread {
  double se, lower, upper;
};

/// A pilot, and fresh independent groups of chains that follow what it found, frozen: each group's estimate
/// of the evidence is unbiased (Neal 2001).
class AnnealedRun {
 public:
  AnnealedRun(const AnnealingPath& path, const AisOptions& options, const Context& context,
              std::uint64_t purpose);

  /// Runs more groups, at most twice as many at a time, until the standard error is as asked.
  void refine();

  double log_evidence() const { return log_evidence_; }
  const Spread& spread() const { return spread_; }
  double variance() const;  ///< of the log evidences of the groups or, without resampling, of the chains
  long evaluations() const { return evaluations_; }
  /// Likelihood values that one unit of precision (1 / se^2) costs.
  double price() const { return spread_.se * spread_.se * static_cast<double>(moves()) * size(); }

  /// Draws, their log-likelihoods and weights (sum 1) of all groups.
  void gather(Eigen::MatrixXd& x, Eigen::VectorXd& ll, Eigen::VectorXd& weights) const;
  std::vector<Temperature> ladder() const;

 private:
  struct Group {
    Chains chains;
    double log_evidence = 0.0;
    Eigen::VectorXd acceptance, ess;
  };

  int size() const { return static_cast<int>(groups_.size()); }
  long moves() const;  // likelihood values of one group
  Eigen::VectorXd estimates() const;
  Group run_group(Stream stream, const Context& context) const;
  void add_groups(int n);

  AnnealingPath path_;
  const AisOptions& options_;
  const Context& context_;
  std::uint64_t purpose_;
  std::vector<Level> levels_;
  std::vector<Group> groups_;
  double log_evidence_ = 0.0;
  Spread spread_{};
  long evaluations_ = 0;
};

}  // namespace amiss
