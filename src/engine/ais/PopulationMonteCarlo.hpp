#pragma once
#include "engine/ais/AisOptions.hpp"
#include "engine/ais/ImportanceSample.hpp"
#include "engine/ais/SkewedMixture.hpp"

namespace amiss {

/// Draws to which mixtures are fitted: weighted draws of one posterior from several samples, each of which
/// counts by its effective size. Draws that together weigh next to nothing are not kept.
class DrawPool {
 public:
  void add(const Eigen::MatrixXd& draws, const Eigen::VectorXd& weights);
  SkewedMixture fit(int max_components, double dof, Stream& stream) const;

 private:
  Eigen::MatrixXd x_;
  Eigen::VectorXd weights_;  // sum of each sample's: its effective size
};

/// How a mixture is brought closer to a posterior.
struct CloserOptions {
  Eigen::Index draws;  ///< of each round
  int rounds = 4;
  int max_components = 3;
  double dof = 5.0;  ///< heavy tails: a reference to anneal from
};

/// Population Monte Carlo (Cappe, Guillin, Marin and Robert 2004) on one posterior: mixtures are fitted in
/// rounds to weighted draws from those before. Parts of the posterior in which a mixture has too little mass
/// gain what their weights say, which chains that have to move there do slowly.
class PopulationMonteCarlo {
 public:
  /// Target, context and stream must outlive it.
  PopulationMonteCarlo(const Target& target, const Context& context, Stream& stream)
      : target_(target), context_(context), stream_(stream) {}

  /// Draws of the posterior from elsewhere, to which mixtures are fitted besides those made here.
  void add(const Eigen::MatrixXd& draws, const Eigen::VectorXd& weights) { pool_.add(draws, weights); }
  void add(const Eigen::MatrixXd& draws);  ///< of equal weight
  /// The mixture fitted to all draws there are.
  SkewedMixture fit(int max_components, double dof) { return pool_.fit(max_components, dof, stream_); }

  /// A mixture close to the posterior: from `mixture`, or from the one fitted to the draws there are.
  SkewedMixture closer(SkewedMixture mixture, const CloserOptions& options);
  SkewedMixture closer(const CloserOptions& options);

  /// Importance sample from mixtures fitted, in rounds, to the draws there are and to those of the rounds
  /// before; the last mixture's draws alone are the estimator. Its effective size is 0 if no mixture comes
  /// close.
  ImportanceSample sample(const AisOptions& options);

  long evaluations() const { return evaluations_; }  ///< of the likelihood, so far

 private:
  void extend(ImportanceSample& sample, const SkewedMixture& mixture, Eigen::Index draws);

  const Target& target_;
  const Context& context_;
  Stream& stream_;
  DrawPool pool_;
  long evaluations_ = 0;
};

}  // namespace amiss
