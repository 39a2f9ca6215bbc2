#include "engine/ais/Sampler.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/linalg/log_sum_exp.hpp"
#include "engine/parallel/parallel_for.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMoveDof = 6.0;        // of the proposals while annealing
constexpr double kImportanceDof = 8.0;  // of the final mixture
constexpr double kAcceptance = 0.35;    // aimed at by the step length
enum Purpose : std::uint64_t { kPilot = 1, kFrozen, kBootstrap, kImportance };
constexpr std::uint64_t kBridged = 16;  // added to the purposes of the second annealed run

struct Chains {
  MatrixXd x;      // dimension x n
  VectorXd ll;     // log-likelihood
  VectorXd log_w;  // log weights since the last resampling

  Index size() const { return x.cols(); }
};

struct Level {
  double beta;
  StudentT proposal;
  double step;
};

VectorXd evaluate(const Target& target, const MatrixXd& x) {
  return target.log_likelihood(x).unaryExpr(
      [](double v) { return std::isfinite(v) ? v : -std::numeric_limits<double>::infinity(); });
}

Chains start(const Target& target, int n, Stream& stream) {
  Chains chains;
  chains.x.resize(target.dimension(), n);
  for (int i = 0; i < n; ++i) chains.x.col(i) = target.draw_reference(stream);
  chains.ll = evaluate(target, chains.x);
  chains.log_w = VectorXd::Zero(n);
  return chains;
}

double effective_size(const VectorXd& log_w) { return 1.0 / normalised_exp(log_w).squaredNorm(); }

// Conditional effective size per chain of a step d in inverse temperature (Zhou, Johansen and Aston 2016).
double conditional_ess(const Chains& chains, double d) {
  const VectorXd w = normalised_exp(chains.log_w);
  const VectorXd v = chains.ll * d;
  const double top = v.maxCoeff();
  if (!std::isfinite(top)) return 0.0;
  const Eigen::ArrayXd e = (v.array() - top).exp();
  const double mean = (w.array() * e).sum();
  return mean * mean / (w.array() * e.square()).sum();
}

double next_beta(const Chains& chains, double beta, double target_ess) {
  if (conditional_ess(chains, 1.0 - beta) >= target_ess) return 1.0;
  double low = std::log(1e-14), high = std::log(1.0 - beta);
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (conditional_ess(chains, std::exp(middle)) >= target_ess ? low : high) = middle;
  }
  return std::min(1.0, beta + std::exp(low));
}

// Systematic resampling; all weights become equal.
void resample(Chains& chains, Stream& stream) {
  const Index n = chains.size();
  const VectorXd w = normalised_exp(chains.log_w);
  MatrixXd x(chains.x.rows(), n);
  VectorXd ll(n);
  double cumulative = w[0];
  const double offset = stream.uniform();
  for (Index i = 0, from = 0; i < n; ++i) {
    while (cumulative < (static_cast<double>(i) + offset) / static_cast<double>(n) && from < n - 1)
      cumulative += w[++from];
    x.col(i) = chains.x.col(from);
    ll[i] = chains.ll[from];
  }
  chains.x = std::move(x);
  chains.ll = std::move(ll);
  chains.log_w.setZero();
}

// One move of every chain at inverse temperature beta; returns the share accepted.
double move(const Target& target, Chains& chains, const Level& level, Stream& stream) {
  const Index n = chains.size();
  MatrixXd proposed(chains.x.rows(), n);
  for (Index i = 0; i < n; ++i) proposed.col(i) = level.proposal.step(chains.x.col(i), level.step, stream);
  const VectorXd ll = evaluate(target, proposed);
  int accepted = 0;
  for (Index i = 0; i < n; ++i) {
    const double log_u = std::log(stream.uniform());
    if (!std::isfinite(ll[i])) continue;
    const double log_ratio = level.beta * (ll[i] - chains.ll[i]) - target.log_reference(chains.x.col(i)) +
                             target.log_reference(proposed.col(i)) +
                             level.proposal.log_density(chains.x.col(i)) -
                             level.proposal.log_density(proposed.col(i));
    if (log_u < log_ratio) {
      chains.x.col(i) = proposed.col(i);
      chains.ll[i] = ll[i];
      ++accepted;
    }
  }
  return static_cast<double>(accepted) / static_cast<double>(n);
}

std::vector<Level> pilot(const Target& target, const AisOptions& options, const Context& context,
                         std::uint64_t purpose, long& evaluations) {
  Stream stream(context.seed, kPilot + purpose, 0);
  Chains chains = start(target, options.pilot_chains, stream);
  evaluations += options.pilot_chains;
  if (!std::isfinite(chains.ll.maxCoeff()))
    throw std::runtime_error("ais: the likelihood is zero at every draw from the reference");
  std::vector<Level> levels;
  double beta = 0.0, step = 0.8;
  while (beta < 1.0) {
    if (context.poll) context.poll();
    if (static_cast<int>(levels.size()) >= options.max_temperatures)
      throw std::runtime_error("ais: too many temperatures");
    const double next = next_beta(chains, beta, options.ess_drop);
    chains.log_w += chains.ll * (next - beta);
    beta = next;
    levels.push_back({beta, StudentT::fit(chains.x, normalised_exp(chains.log_w), kMoveDof), step});
    resample(chains, stream);
    for (int sweep = 0; sweep < options.sweeps + 1; ++sweep) {
      const double accepted = move(target, chains, levels.back(), stream);
      evaluations += chains.size();
      step = std::min(1.0, std::max(0.01, levels.back().step * std::exp(accepted - kAcceptance)));
      levels.back().step = step;
    }
  }
  return levels;
}

struct Group {
  Chains chains;
  double log_evidence = 0.0;
  VectorXd acceptance, ess;
};

Group frozen_run(const Target& target, const std::vector<Level>& levels, const AisOptions& options,
                 Stream stream) {
  Group group;
  group.chains = start(target, options.chains, stream);
  group.acceptance = VectorXd::Zero(static_cast<Index>(levels.size()));
  group.ess = VectorXd::Zero(static_cast<Index>(levels.size()));
  double beta = 0.0;
  for (std::size_t k = 0; k < levels.size(); ++k) {
    group.chains.log_w += group.chains.ll * (levels[k].beta - beta);
    beta = levels[k].beta;
    const double top = group.chains.log_w.maxCoeff();
    group.ess[k] = std::isfinite(top) ? effective_size(group.chains.log_w) / options.chains : 0.0;
    if (!std::isfinite(top)) {
      group.log_evidence = -std::numeric_limits<double>::infinity();
      return group;
    }
    if (options.resample && group.ess[k] < 0.5) {
      group.log_evidence += log_mean_exp(group.chains.log_w);
      resample(group.chains, stream);
    }
    double accepted = 0.0;
    for (int sweep = 0; sweep < options.sweeps; ++sweep)
      accepted += move(target, group.chains, levels[k], stream);
    group.acceptance[k] = accepted / options.sweeps;
  }
  group.log_evidence += log_mean_exp(group.chains.log_w);
  return group;
}

// Without resampling every chain is an estimate of its own; with it, every group is.
VectorXd independent_estimates(const std::vector<Group>& groups, const AisOptions& options) {
  if (options.resample) {
    VectorXd values(static_cast<Index>(groups.size()));
    for (std::size_t g = 0; g < groups.size(); ++g) values[g] = groups[g].log_evidence;
    return values;
  }
  VectorXd values(static_cast<Index>(groups.size()) * options.chains);
  for (std::size_t g = 0; g < groups.size(); ++g)
    values.segment(g * options.chains, options.chains) = groups[g].chains.log_w;
  return values;
}

struct Spread {
  double se, lower, upper;
};

// Bootstrap of log mean exp. Deviations are widened by sqrt(n / (n - 1)), the bias of a bootstrap of n
// values, and the interval by Student's t against the normal.
Spread bootstrap(const VectorXd& values, double estimate, Stream stream) {
  constexpr int kReplicates = 1000;
  const Index n = values.size();
  std::vector<double> replicates(kReplicates);
  VectorXd sample(n);
  for (double& replicate : replicates) {
    for (Index i = 0; i < n; ++i) sample[i] = values[stream.index(static_cast<int>(n))];
    replicate = log_mean_exp(sample);
  }
  std::sort(replicates.begin(), replicates.end());
  const double widen = std::sqrt(static_cast<double>(n) / static_cast<double>(n - 1));
  const double infinity = std::numeric_limits<double>::infinity();
  if (n < 2 || !std::isfinite(replicates.front())) return {infinity, -infinity, replicates[974]};
  const Eigen::Map<const VectorXd> all(replicates.data(), kReplicates);
  const double sd = std::sqrt((all.array() - all.mean()).square().sum() / (kReplicates - 1));
  const boost::math::students_t student(static_cast<double>(n) - 1.0);
  const double wider = widen * boost::math::quantile(student, 0.975) / 1.959964;
  return {sd * widen, estimate + wider * (replicates[24] - estimate),
          estimate + wider * (replicates[974] - estimate)};
}

// A pilot and the frozen run that follows it.
struct AnnealedRun {
  double log_evidence = 0.0, variance = 0.0;
  Spread spread{};
  MatrixXd x;
  VectorXd ll, weights;
  std::vector<Temperature> ladder;
  long evaluations = 0;

  double ess() const { return 1.0 / weights.squaredNorm(); }
};

AnnealedRun run_annealed(const Target& target, const AisOptions& options, const Context& context,
                         std::uint64_t purpose) {
  AnnealedRun run;
  const std::vector<Level> levels = pilot(target, options, context, purpose, run.evaluations);
  std::vector<Group> groups(options.groups);
  parallel_for(options.groups, context, [&](int g) {
    groups[g] = frozen_run(target, levels, options,
                           Stream(context.seed, kFrozen + purpose, static_cast<std::uint64_t>(g)));
  });
  run.evaluations += static_cast<long>(options.groups) * options.chains *
                     (1 + static_cast<long>(levels.size()) * options.sweeps);

  const VectorXd estimates = independent_estimates(groups, options);
  run.log_evidence = log_mean_exp(estimates);
  if (!std::isfinite(run.log_evidence))
    throw std::runtime_error("ais: every group of chains ended with likelihood zero");
  run.spread = bootstrap(estimates, run.log_evidence, Stream(context.seed, kBootstrap + purpose, 0));
  run.variance = (estimates.array() - estimates.mean()).square().sum() /
                 std::max<double>(1.0, static_cast<double>(estimates.size()) - 1.0);

  const Index n = options.chains;
  run.x.resize(target.dimension(), n * options.groups);
  run.ll.resize(n * options.groups);
  VectorXd log_w(n * options.groups);
  for (int g = 0; g < options.groups; ++g) {
    run.x.middleCols(g * n, n) = groups[g].chains.x;
    run.ll.segment(g * n, n) = groups[g].chains.ll;
    const VectorXd& own = groups[g].chains.log_w;
    const bool dead = !std::isfinite(groups[g].log_evidence);
    log_w.segment(g * n, n).setConstant(-std::numeric_limits<double>::infinity());
    if (!dead)
      log_w.segment(g * n, n) =
          own.array() + (options.resample ? groups[g].log_evidence - log_mean_exp(own) : 0.0);
  }
  run.weights = normalised_exp(log_w);
  for (std::size_t k = 0; k < levels.size(); ++k) {
    Temperature temperature{levels[k].beta, levels[k].step, 0.0, 0.0};
    for (const auto& group : groups) {
      temperature.acceptance += group.acceptance[k] / options.groups;
      temperature.ess += group.ess[k] / options.groups;
    }
    run.ladder.push_back(temperature);
  }
  return run;
}

// The same posterior seen from a reference fitted to its draws: little is left to anneal.
class BridgedTarget : public Target {
 public:
  BridgedTarget(const Target& target, const StudentTMixture& mixture) : target_(target), mixture_(mixture) {}

  Index dimension() const override { return target_.dimension(); }
  VectorXd draw_reference(Stream& stream) const override { return mixture_.draw(stream); }
  double log_reference(const VectorXd& x) const override { return mixture_.log_density(x); }
  VectorXd log_likelihood(const MatrixXd& x) const override {
    VectorXd values = target_.log_likelihood(x);
    for (Index i = 0; i < x.cols(); ++i)
      values[i] += target_.log_reference(x.col(i)) - mixture_.log_density(x.col(i));
    return values;
  }

 private:
  const Target& target_;
  const StudentTMixture& mixture_;
};

struct ImportanceSample {
  MatrixXd x;
  VectorXd ll;
  double log_evidence = -std::numeric_limits<double>::infinity();
  double se = std::numeric_limits<double>::infinity();
  double ess = 0.0;
  VectorXd weights;
};

ImportanceSample importance_sample(const Target& target, const StudentTMixture& mixture, int n,
                                   const Context& context, Stream& stream) {
  ImportanceSample sample;
  sample.x.resize(target.dimension(), n);
  sample.ll.resize(n);
  VectorXd log_w(n);
  for (int i = 0; i < n; ++i) {
    sample.x.col(i) = mixture.draw(stream);
    log_w[i] = target.log_reference(sample.x.col(i)) - mixture.log_density(sample.x.col(i));
  }
  // Blocks of fixed size, so that the result does not depend on how many threads share them.
  constexpr int kBlock = 64;
  parallel_for((n + kBlock - 1) / kBlock, context, [&](int b) {
    const int first = b * kBlock, count = std::min(kBlock, n - first);
    sample.ll.segment(first, count) = evaluate(target, sample.x.middleCols(first, count));
  });
  log_w += sample.ll;
  if (!std::isfinite(log_w.maxCoeff())) return sample;
  sample.log_evidence = log_mean_exp(log_w);
  sample.weights = normalised_exp(log_w);
  sample.ess = 1.0 / sample.weights.squaredNorm();
  sample.se = std::sqrt(std::max(0.0, n / sample.ess - 1.0) / (n - 1.0));
  return sample;
}

// Makes an estimator the one that the result reports.
void report_estimator(AisResult& result, const std::string& name, double log_evidence, const Spread& spread,
                      MatrixXd x, VectorXd ll, VectorXd weights) {
  result.estimator = name;
  result.log_evidence = log_evidence;
  result.standard_error = spread.se;
  result.lower = spread.lower;
  result.upper = spread.upper;
  result.draws = std::move(x);
  result.log_likelihood = std::move(ll);
  result.weights = std::move(weights);
  result.ess = 1.0 / result.weights.squaredNorm();
}

// Importance sample from a mixture fitted to the annealed draws, then from mixtures fitted to its own
// weighted draws; the last round alone is the estimator. Where no mixture comes close to the posterior, a
// second annealed run goes the short way from the mixture to the posterior.
void second_estimator(const Target& target, const AisOptions& options, const Context& context,
                      AisResult& result) {
  constexpr int kRounds = 4;
  constexpr double kGood = 0.1;     // effective share of the draws at which refitting stops
  constexpr double kUsable = 20.0;  // effective draws from which a mixture may be fitted
  Stream stream(context.seed, kImportance, 0);
  const int n = options.importance_draws;
  const auto fit = [&](const MatrixXd& x, const VectorXd& w) {
    return StudentTMixture::fit(x, w, options.max_components, kImportanceDof, stream);
  };
  const StudentTMixture first = fit(result.draws, result.weights);
  ImportanceSample sample = importance_sample(target, first, n, context, stream);
  result.evaluations += n;
  for (int round = 1; round < kRounds && sample.ess > kUsable && (round < 2 || sample.ess < kGood * n);
       ++round) {
    sample = importance_sample(target, fit(sample.x, sample.weights), n, context, stream);
    result.evaluations += n;
  }
  if (sample.ess >= kGood * n) {
    result.second = sample.log_evidence;
    result.second_se = sample.se;
    result.second_ess = sample.ess;
    const Spread spread{sample.se, sample.log_evidence - 1.96 * sample.se,
                        sample.log_evidence + 1.96 * sample.se};
    report_estimator(result, "importance", sample.log_evidence, spread, std::move(sample.x),
                     std::move(sample.ll), std::move(sample.weights));
    return;
  }
  AnnealedRun run = run_annealed(BridgedTarget(target, first), options, context, kBridged);
  result.evaluations += run.evaluations;
  result.second = run.log_evidence;
  result.second_se = run.spread.se;
  result.second_ess = run.ess();
  // The likelihood of a draw, as seen from the target's own reference.
  for (Index i = 0; i < run.ll.size(); ++i)
    run.ll[i] += first.log_density(run.x.col(i)) - target.log_reference(run.x.col(i));
  report_estimator(result, "bridged", run.log_evidence, run.spread, std::move(run.x), std::move(run.ll),
                   std::move(run.weights));
}

// Both estimates of Z are unbiased, so each is seldom too large (Markov: Z_hat > k Z with probability below 1
// / k) and easily too small. An annealed estimate below the second one is no objection to it; one above says
// that the second misses part of the posterior.
bool consistent(const AisResult& result) {
  return result.annealed - result.second < 3.5 * std::hypot(result.annealed_se, result.second_se) + 0.1;
}

void judge(AisResult& result, const AisOptions& options) {
  double least = 1.0;
  for (const auto& level : result.ladder) least = std::min(least, level.acceptance);
  result.trusted = false;
  if (!(least >= 0.02)) {
    result.verdict = "not trusted: the chains hardly move at some temperature";
  } else if (!(result.ess >= 0.02 * static_cast<double>(result.draws.cols()))) {
    result.verdict = "not trusted: a few chains carry all the weight";
  } else if (!(result.standard_error <= 1.0)) {
    result.verdict = "not trusted: the standard error exceeds one nat";
  } else if (options.importance_draws > 0 && !consistent(result)) {
    result.verdict = "not trusted: the second estimator misses part of the posterior that the first has seen";
  } else {
    result.trusted = true;
    result.verdict = options.importance_draws > 0
                         ? "trusted: chains move, weights are even and the two estimators are consistent"
                         : "trusted: chains move and weights are even";
  }
}

}  // namespace

void AisOptions::check() const {
  if (pilot_chains < 8 || groups < 2 || chains < 4)
    throw std::invalid_argument("ais: need pilot_chains >= 8, groups >= 2, chains >= 4");
  if (sweeps < 1) throw std::invalid_argument("ais: sweeps must be positive");
  if (!(ess_drop > 0 && ess_drop < 1)) throw std::invalid_argument("ais: ess_drop must lie in (0, 1)");
  if (importance_draws != 0 && importance_draws < 50) {
    throw std::invalid_argument("ais: importance_draws must be 0 (none) or at least 50");
  }
  if (max_components < 1 || max_temperatures < 1) throw std::invalid_argument("ais: negative size");
}

AisResult sample_ais(const Target& target, const AisOptions& options, const Context& context) {
  options.check();
  AisResult result;
  AnnealedRun run = run_annealed(target, options, context, 0);
  result.evaluations = run.evaluations;
  result.annealed = run.log_evidence;
  result.annealed_se = run.spread.se;
  result.log_weight_variance = run.variance;
  result.ladder = std::move(run.ladder);
  report_estimator(result, "annealed", run.log_evidence, run.spread, std::move(run.x), std::move(run.ll),
                   std::move(run.weights));
  result.second = result.second_se = std::numeric_limits<double>::quiet_NaN();
  if (options.importance_draws > 0) second_estimator(target, options, context, result);
  judge(result, options);
  return result;
}

}  // namespace amiss
