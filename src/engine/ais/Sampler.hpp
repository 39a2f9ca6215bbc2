#pragma once
#include <string>
#include <vector>

#include "engine/Context.hpp"
#include "engine/ais/StudentT.hpp"
#include "engine/ais/Target.hpp"

namespace amiss {

struct AisOptions {
  int pilot_chains = 0;  ///< of the pilot that adapts ladder and proposals; 0: 16 per dimension, at least 256
  int groups = 8;        ///< independent groups of chains of the run that gives the estimate, at first
  int max_groups = 64;   ///< more are run, at most so many, until ...
  double precision = 0.1;  ///< ... the standard error of the log evidence has come down to this, in nats
  int chains = 0;          ///< in a group; 0: 3 per dimension, at least 32
  int sweeps = 0;          ///< least number of moves of every chain at every temperature; 0: 3
  int max_sweeps = 30;     ///< greatest; the pilot finds how many the likelihood needs to forget where it was
  double ess_drop = 0.7;   ///< the pilot's next temperature leaves this conditional effective size per chain
  bool gradient = true;    ///< Hamiltonian moves too, where the target has a gradient
  bool resample = true;    ///< resample a group when its effective size falls below half; false: plain AIS
  int importance_draws = 1000;  ///< of the second estimator, from a fitted Student-t mixture; 0 leaves it out
  int refit_draws =
      0;  ///< of its first round, which only serves to fit the mixture again; 0: importance_draws
  double effective_draws = 0.0;  ///< more are drawn until so many are effective, and the precision is reached
  int max_components = 3;        ///< of that mixture
  bool skewed = false;           ///< the mixture may be skewed, and is fitted to the draws of all rounds
  int max_temperatures = 400;

  void check() const;
  AisOptions for_dimension(Eigen::Index d) const;  ///< with chains and sweeps filled in
};

/// What happened at one temperature of the ladder.
struct Temperature {
  double beta = 0.0;        ///< inverse temperature, in (0, 1]
  double step = 0.0;        ///< length of the moves
  int sweeps = 0;           ///< moves of every chain
  double acceptance = 0.0;  ///< of the frozen run
  double ess = 0.0;         ///< effective share of the chains after reweighting, mean over groups
};

/// Normalising constant and draws of a posterior.
struct AisResult {
  double log_evidence = 0.0;        ///< of the estimator reported
  double standard_error = 0.0;      ///< of log_evidence
  double lower = 0.0, upper = 0.0;  ///< 95 % interval of log_evidence
  std::string estimator;            ///< "annealed", "importance" or "bridged"

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
  bool trusted = false;
  std::string verdict;  ///< why it can or cannot be trusted, one sentence
};

/// Annealed importance sampling (Neal 2001) of reference x likelihood. A pilot (an adaptive sequential Monte
/// Carlo sampler; Del Moral, Doucet and Jasra 2006) finds the ladder of temperatures and, at each, a
/// Student-t proposal, a step length and how many moves the chains need. All are then frozen, and fresh
/// independent groups of chains are run, so that each group's estimate of the evidence is unbiased. The
/// chains move by preconditioned Crank-Nicolson steps that are reversible in the fitted Student t, corrected
/// by Metropolis and Hastings. An importance sample from a Student-t mixture fitted to the draws is the
/// second estimator; where no mixture comes close, a second annealed run from the mixture to the posterior
/// ("bridged") is. The importance sample is reported where there is one, else the annealed run that reaches a
/// standard error at less cost; more groups or draws are added until the standard error is as asked. The
/// other estimator has to agree.
AisResult sample_ais(const Target& target, const AisOptions& options, const Context& context);

/// Draws of the posterior (dimension x pilot_chains, of equal weight) from the pilot alone: a cheap start for
/// a posterior nearby. Says nothing of the evidence. The likelihood values that it takes are added to
/// `evaluations`.
Eigen::MatrixXd sample_population(const Target& target, const AisOptions& options, const Context& context,
                                  long& evaluations);

}  // namespace amiss
