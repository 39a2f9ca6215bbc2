#pragma once
#include <limits>

#include "engine/Context.hpp"
#include "engine/ais/AisOptions.hpp"
#include "engine/ais/SkewedMixture.hpp"
#include "engine/ais/Target.hpp"

namespace amiss {

/// Weighted draws of a posterior from a distribution that comes close to it.
struct ImportanceSample {
  Eigen::MatrixXd x;          ///< dimension x n
  Eigen::VectorXd ll, log_w;  ///< log-likelihoods, log weights
  Eigen::VectorXd weights;    ///< sum 1
  double log_evidence = -std::numeric_limits<double>::infinity();
  double se = std::numeric_limits<double>::infinity();
  double ess = 0.0;

  Eigen::Index size() const { return ll.size(); }

  /// Adds n draws.
  void extend(const Target& target, const Distribution& mixture, Eigen::Index n, const Context& context,
              Stream& stream);
};

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

/// A mixture close to a posterior of which `population` are draws of equal weight: fitted to them and then,
/// in rounds, to them, to weighted draws from itself and to those of the rounds before (population Monte
/// Carlo; Cappe, Guillin, Marin and Robert 2004). Parts of the posterior in which the mixture has too little
/// mass gain what their weights say, which chains that have to move there do slowly. The likelihood values
/// that it takes are added to `evaluations`.
SkewedMixture closer_mixture(const Target& target, const Eigen::MatrixXd& population,
                             const CloserOptions& options, const Context& context, Stream& stream,
                             long& evaluations);
/// From a mixture, and draws that it is fitted to besides its own.
SkewedMixture closer_mixture(const Target& target, SkewedMixture mixture, DrawPool pool,
                             const CloserOptions& options, const Context& context, Stream& stream,
                             long& evaluations);

/// Importance sample from `first`, then from mixtures fitted to its own weighted draws and, if they may be
/// skewed, to those of `pool`; the last mixture's draws alone are the estimator. Its effective size is 0
/// where no mixture comes close.
ImportanceSample importance_sample(const Target& target, const StudentTMixture& first, DrawPool pool,
                                   const AisOptions& options, const Context& context, Stream& stream,
                                   long& evaluations);

/// The mixture fitted to weighted draws of a posterior from which such a sample starts.
StudentTMixture fit_elliptic(const Eigen::MatrixXd& x, const Eigen::VectorXd& weights,
                             const AisOptions& options, Stream& stream);

}  // namespace amiss
