#include "engine/ais/Sampler.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "engine/ais/AnnealedRun.hpp"
#include "engine/ais/PopulationMonteCarlo.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

constexpr double kDoubt = 2.0;                       // standard errors by which another estimate lies above
constexpr double kBridgeDof = 8.0, kThirdDof = 5.0;  // of the mixtures that further runs start from

void report(AisResult& result, Estimator estimator, double log_evidence, const Spread& spread) {
  result.estimator = estimator;
  result.log_evidence = log_evidence;
  result.standard_error = spread.se;
  result.lower = spread.lower;
  result.upper = spread.upper;
  result.ess = 1.0 / result.weights.squaredNorm();
}

void report(AisResult& result, ImportanceSample sample) {
  result.draws = std::move(sample.x);
  result.log_likelihood = std::move(sample.ll);
  result.weights = std::move(sample.weights);
  report(result, Estimator::importance, sample.log_evidence,
         {sample.se, sample.log_evidence - 1.96 * sample.se, sample.log_evidence + 1.96 * sample.se});
}

void report(AisResult& result, Estimator estimator, const AnnealedRun& run) {
  run.gather(result.draws, result.log_likelihood, result.weights);
  report(result, estimator, run.log_evidence(), run.spread());
}

// The second estimator, and the report of the better one: the importance sample or, where no mixture comes
// close to the posterior, the annealed run from the prior or the one that goes the short way from the
// mixture.
void second_estimator(const Target& target, const AisOptions& options, const Context& context,
                      AnnealedRun& annealed, AisResult& result) {
  Stream stream(context.seed, kImportance, 0);
  annealed.gather(result.draws, result.log_likelihood, result.weights);
  PopulationMonteCarlo population(target, context, stream);
  population.add(result.draws, result.weights);
  ImportanceSample sample = population.sample(options);
  result.evaluations += population.evaluations();
  if (sample.ess > 0) {
    result.second = sample.log_evidence;
    result.second_se = sample.se;
    result.second_ess = sample.ess;
    report(result, std::move(sample));
    return;
  }
  const SkewedMixture close = population.fit(options.max_components, kBridgeDof);
  std::unique_ptr<AnnealedRun> from_close;
  try {
    from_close = std::make_unique<AnnealedRun>(AnnealingPath{target, close}, options, context, kBridged);
  } catch (const std::runtime_error&) {  // the record is impossible wherever the mixture has its mass
    annealed.refine();
    report(result, Estimator::annealed, annealed);
    result.second = -std::numeric_limits<double>::infinity();
    return;
  }
  AnnealedRun& bridged = *from_close;
  const bool shorter = bridged.price() < annealed.price();
  (shorter ? bridged : annealed).refine();
  result.evaluations += bridged.evaluations();
  result.second = bridged.log_evidence();
  result.second_se = bridged.spread().se;
  report(result, Estimator::bridged, bridged);
  result.second_ess = result.ess;
  if (!shorter) report(result, Estimator::annealed, annealed);

  // The estimate that is not reported lies above the other: it has seen what that one missed, or is loose. A
  // third run, from a mixture fitted to the draws of both, decides.
  const AnnealedRun& reported = shorter ? bridged : annealed;
  const AnnealedRun& other = shorter ? annealed : bridged;
  if (!(other.log_evidence() >
        reported.log_evidence() + kDoubt * std::max(reported.spread().se, options.precision)))
    return;
  DrawPool both;
  for (const AnnealedRun* run : {&annealed, &bridged}) {
    MatrixXd x;
    Eigen::VectorXd ll, weights;
    run->gather(x, ll, weights);
    both.add(x, weights);
  }
  const SkewedMixture joined = both.fit(options.max_components, kThirdDof, stream);
  AnnealedRun third({target, joined}, options, context, kThird);
  third.refine();
  result.evaluations += third.evaluations();
  report(result, Estimator::bridged, third);
  result.second_ess = result.ess;
}

// Both estimates of Z are unbiased, so each is seldom too large (Markov: Z_hat > k Z with probability below 1
// / k) and easily too small. Another estimate below the one reported is no objection to it; one above says
// that the one reported misses part of the posterior.
bool consistent(const AisResult& result) {
  const double other = result.estimator == Estimator::annealed ? result.second : result.annealed;
  return other - result.log_evidence < 3.5 * std::hypot(result.annealed_se, result.second_se) + 0.1;
}

Outcome judge(const AisResult& result, const AisOptions& options) {
  double least = 1.0;
  for (const auto& level : result.ladder) least = std::min(least, level.acceptance);
  if (!(least >= 0.02)) return Outcome::hardly_moves;
  if (!(result.ess >= 0.02 * static_cast<double>(result.draws.cols()))) return Outcome::few_chains;
  if (!(result.standard_error <= 1.0)) return Outcome::imprecise;
  if (options.importance_draws == 0) return Outcome::uncompared;
  return consistent(result) ? Outcome::consistent : Outcome::inconsistent;
}

}  // namespace

const char* in_words(Estimator estimator) {
  switch (estimator) {
    case Estimator::annealed:
      return "annealed";
    case Estimator::importance:
      return "importance";
    case Estimator::bridged:
      return "bridged";
  }
  return "";
}

const char* in_words(Outcome outcome) {
  switch (outcome) {
    case Outcome::hardly_moves:
      return "the chains hardly move at some temperature";
    case Outcome::few_chains:
      return "a few chains carry all the weight";
    case Outcome::imprecise:
      return "the standard error exceeds one nat";
    case Outcome::inconsistent:
      return "the other estimator has seen part of the posterior that this one misses";
    case Outcome::approximate:
      return "the approximate kernel is off by more than a nat at some draws";
    case Outcome::uncompared:
      return "chains move and weights are even";
    case Outcome::consistent:
      return "chains move, weights are even and the two estimators are consistent";
  }
  return "";
}

MatrixXd sample_population(const Target& target, const Distribution& reference, const AisOptions& asked,
                           const Context& context, long& evaluations) {
  asked.check();
  Pilot pilot({target, reference}, asked.for_dimension(target.dimension()), context, 0);
  evaluations += pilot.evaluations;
  return std::move(pilot.chains.x);
}

AisResult sample_ais(const Target& target, const AisOptions& options, const Context& context) {
  return sample_ais(target, StandardNormal(target.dimension()), options, context);
}

AisResult sample_ais(const Target& target, const Distribution& reference, const AisOptions& asked,
                     const Context& context) {
  asked.check();
  const AisOptions options = asked.for_dimension(target.dimension());
  AisResult result;
  AnnealedRun annealed({target, reference}, options, context, 0);
  result.second = result.second_se = std::numeric_limits<double>::quiet_NaN();
  if (options.importance_draws == 0) {
    annealed.refine();
    report(result, Estimator::annealed, annealed);
  } else {
    second_estimator(target, options, context, annealed, result);
  }
  result.evaluations += annealed.evaluations();
  result.annealed = annealed.log_evidence();
  result.annealed_se = annealed.spread().se;
  result.log_weight_variance = annealed.variance();
  result.ladder = annealed.ladder();
  result.outcome = judge(result, options);
  return result;
}

}  // namespace amiss
