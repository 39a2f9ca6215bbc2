#pragma once
#include <vector>

#include "engine/Context.hpp"
#include "engine/ais/AisOptions.hpp"
#include "engine/ais/Distribution.hpp"
#include "engine/ais/Target.hpp"
#include "engine/ais/Temperature.hpp"

namespace amiss {

/// What an evidence comes from.
enum class Estimator { annealed, importance, bridged };

/// What the sampler says of its own work. Only the last two can be trusted.
enum class Outcome {
  hardly_moves,  ///< the chains do, at some temperature
  few_chains,    ///< carry all the weight
  imprecise,     ///< standard error above one nat
  inconsistent,  ///< the other estimator has seen part of the posterior that this one misses
  approximate,   ///< the likelihood was approximated, and is off by more than a nat at some draws
  uncompared,    ///< chains move and weights are even; no second estimator was asked for
  consistent     ///< and so are the two estimators
};
inline bool trusted(Outcome outcome) { return outcome >= Outcome::uncompared; }
/// Too little was seen of the posterior for its draws to say anything.
inline bool stuck(Outcome outcome) { return outcome <= Outcome::few_chains; }
const char* in_words(Estimator estimator);
const char* in_words(Outcome outcome);  ///< one sentence

/// Normalising constant and draws of a posterior.
struct AisResult {
  double log_evidence = 0.0;        ///< of the estimator reported
  double standard_error = 0.0;      ///< of log_evidence
  double lower = 0.0, upper = 0.0;  ///< 95 % interval of log_evidence
  Estimator estimator = Estimator::annealed;

  double annealed = 0.0, annealed_se = 0.0;  ///< frozen annealed run; interval by bootstrap over groups
  double second = 0.0, second_se = 0.0;      ///< importance sample, or bridged run; NaN if left out
  double second_ess = 0.0;                   ///< effective size of its draws
  double ess = 0.0;                          ///< effective size of the draws below
  double log_weight_variance = 0.0;          ///< of the log evidences of the annealed groups

  Eigen::MatrixXd draws;           ///< dimension x draws of the chosen estimator, in the target's coordinates
  Eigen::VectorXd weights;         ///< of the draws, sum 1
  Eigen::VectorXd log_likelihood;  ///< of the draws
  std::vector<Temperature> ladder;
  long evaluations = 0;  ///< of the likelihood, all stages
  Outcome outcome = Outcome::few_chains;
};

/// Annealed importance sampling (Neal 2001) from a reference to prior x likelihood; without one, from the
/// prior. The evidence and the log-likelihoods are the target's, whatever the reference. A pilot (an adaptive
/// sequential Monte Carlo sampler; Del Moral, Doucet and Jasra 2006) finds the ladder of temperatures and, at
/// each, a Student-t proposal, a step length and how many moves the chains need. All are then frozen, and
/// fresh independent groups of chains are run, so that each group's estimate of the evidence is unbiased. The
/// chains move by preconditioned Crank-Nicolson steps that are reversible in the fitted Student t, corrected
/// by Metropolis and Hastings. An importance sample from a mixture fitted in rounds to the draws is the
/// second estimator; where no mixture comes close, a second annealed run from the mixture to the posterior
/// ("bridged") is. The importance sample is reported where there is one, else the annealed run that reaches a
/// standard error at less cost; more groups or draws are added until the standard error is as asked. Where
/// the other annealed run lies well above, a third, from a mixture fitted to the draws of both, is reported.
/// The other estimator may lie below the one reported, not above.
AisResult sample_ais(const Target& target, const Distribution& reference, const AisOptions& options,
                     const Context& context);
AisResult sample_ais(const Target& target, const AisOptions& options, const Context& context);

/// Draws of the posterior (dimension x pilot_chains, of equal weight) from the pilot alone: a cheap start for
/// a posterior nearby. Says nothing of the evidence. The likelihood values that it takes are added to
/// `evaluations`.
Eigen::MatrixXd sample_population(const Target& target, const Distribution& reference,
                                  const AisOptions& options, const Context& context, long& evaluations);

}  // namespace amiss
