#include "engine/ais/Sampler.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "engine/ais/BridgedTarget.hpp"
#include "engine/ais/SkewedMixture.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/parallel/parallel_for.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMoveDof = 6.0;        // of the proposals while annealing
constexpr double kImportanceDof = 8.0;  // of the final mixture
constexpr int kSweeps = 3;              // unless asked otherwise
constexpr double kAcceptance = 0.35;    // aimed at by the step length
constexpr double kHamiltonianAcceptance = 0.75;
constexpr int kLeapfrogs = 4;    // of one Hamiltonian move
constexpr double kMemory = 0.5;  // rank correlation of the likelihoods at which a chain has moved on
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
  double hamiltonian_step;
  int sweeps;
};

// Not a number, and infinity, count as likelihood zero.
double finite_or_zero(double v) { return std::isfinite(v) ? v : -std::numeric_limits<double>::infinity(); }

// Columns 0 ... n-1 in blocks that the threads share: task(first, count). Their size is fixed, so that no
// result depends on the number of threads.
template <class Task>
void for_blocks(const Target& target, Index n, const Context& context, const Task& task) {
  const Index block = std::min(n, target.block());
  parallel_for(static_cast<int>((n + block - 1) / block), context, [&](int b) {
    const Index first = b * block;
    task(first, std::min(block, n - first));
  });
}

// Likelihoods of the columns; also(i) is what else the threads can do for column i.
template <class Task>
VectorXd evaluate(const Target& target, const MatrixXd& x, const Context& context, const Task& also) {
  VectorXd ll(x.cols());
  for_blocks(target, x.cols(), context, [&](Index first, Index count) {
    ll.segment(first, count) = target.log_likelihood(x.middleCols(first, count)).unaryExpr(&finite_or_zero);
    for (Index i = first; i < first + count; ++i) also(i);
  });
  return ll;
}

VectorXd evaluate(const Target& target, const MatrixXd& x, const Context& context) {
  return evaluate(target, x, context, [](Index) {});
}

VectorXd evaluate(const Target& target, const MatrixXd& x, MatrixXd& gradient, const Context& context) {
  VectorXd ll(x.cols());
  for_blocks(target, x.cols(), context, [&](Index first, Index count) {
    MatrixXd slope(x.rows(), count);
    ll.segment(first, count) =
        target.log_likelihood(x.middleCols(first, count), slope).unaryExpr(&finite_or_zero);
    gradient.middleCols(first, count) = slope;
  });
  return ll;
}

Chains start(const Target& target, int n, Stream& stream, const Context& context) {
  Chains chains;
  chains.x.resize(target.dimension(), n);
  for (int i = 0; i < n; ++i) chains.x.col(i) = target.draw_reference(stream);
  chains.ll = evaluate(target, chains.x, context);
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

// One Crank-Nicolson move of every chain; returns the share accepted.
double move(const Target& target, Chains& chains, const Level& level, Stream& stream,
            const Context& context) {
  const Index n = chains.size();
  MatrixXd proposed(chains.x.rows(), n);
  for (Index i = 0; i < n; ++i) proposed.col(i) = level.proposal.step(chains.x.col(i), level.step, stream);
  VectorXd at_chain(n), at_proposed(n);  // log density of the reference over that of the proposal
  const VectorXd ll = evaluate(target, proposed, context, [&](Index i) {
    at_chain[i] = target.log_reference(chains.x.col(i)) - level.proposal.log_density(chains.x.col(i));
    at_proposed[i] = target.log_reference(proposed.col(i)) - level.proposal.log_density(proposed.col(i));
  });
  int accepted = 0;
  for (Index i = 0; i < n; ++i) {
    const double log_u = std::log(stream.uniform());
    if (!std::isfinite(ll[i])) continue;
    if (log_u < level.beta * (ll[i] - chains.ll[i]) + at_proposed[i] - at_chain[i]) {
      chains.x.col(i) = proposed.col(i);
      chains.ll[i] = ll[i];
      ++accepted;
    }
  }
  return static_cast<double>(accepted) / static_cast<double>(n);
}

bool hamiltonian(const Target& target, const AisOptions& options) {
  return options.gradient && target.has_gradient();
}

// One Hamiltonian move of every chain: leapfrog steps in the coordinates in which the proposal's scale is the
// identity (Neal 2011); returns the share accepted.
double hamiltonian_move(const Target& target, Chains& chains, const Level& level, Stream& stream,
                        const Context& context) {
  const Index n = chains.size(), d = chains.x.rows();
  const auto root = level.proposal.root().triangularView<Eigen::Lower>();
  MatrixXd x = chains.x, slope(d, n), momentum = stream.normals(d, n);
  VectorXd ll;
  const auto force = [&] {  // L' gradient of the log density at this temperature
    ll = evaluate(target, x, slope, context);
    slope *= level.beta;
    for (Index i = 0; i < n; ++i) slope.col(i) += target.reference_gradient(x.col(i));
    slope = root.transpose() * slope;
    slope = slope.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; });
  };
  VectorXd log_ratio = 0.5 * momentum.colwise().squaredNorm().transpose() - level.beta * chains.ll;
  for (Index i = 0; i < n; ++i) log_ratio[i] -= target.log_reference(chains.x.col(i));
  const double step = level.hamiltonian_step;
  force();
  for (int k = 0; k < kLeapfrogs; ++k) {
    momentum += 0.5 * step * slope;
    x += root * MatrixXd(step * momentum);
    force();
    momentum += 0.5 * step * slope;
  }
  log_ratio += level.beta * ll - 0.5 * momentum.colwise().squaredNorm().transpose();
  int accepted = 0;
  for (Index i = 0; i < n; ++i) {
    const double log_u = std::log(stream.uniform());
    if (!std::isfinite(ll[i]) || !(log_u < log_ratio[i] + target.log_reference(x.col(i)))) continue;
    chains.x.col(i) = x.col(i);
    chains.ll[i] = ll[i];
    ++accepted;
  }
  return static_cast<double>(accepted) / static_cast<double>(n);
}

// Likelihood values that a sweep of one chain costs: a Crank-Nicolson move and, where there is a gradient, a
// Hamiltonian one.
int sweep_cost(const Target& target, const AisOptions& options) {
  return hamiltonian(target, options) ? 2 + kLeapfrogs : 1;
}

// Ranks of the values, centred and scaled: their inner product is Spearman's correlation.
VectorXd ranks(const VectorXd& values) {
  const Index n = values.size();
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return values[a] < values[b]; });
  VectorXd rank(n);
  for (Index i = 0; i < n; ++i) rank[order[static_cast<std::size_t>(i)]] = static_cast<double>(i);
  rank.array() -= rank.mean();
  return rank / rank.norm();
}

// Moves the chains, tuning the step, until their likelihoods have forgotten where they began. The first sweep
// is still far from the right step and is not counted.
void tune(const Target& target, const AisOptions& options, Chains& chains, Level& level, Stream& stream,
          const Context& context) {
  const VectorXd before = ranks(chains.ll);
  for (level.sweeps = 0; level.sweeps < options.max_sweeps; ++level.sweeps) {
    if (level.sweeps >= options.sweeps && before.dot(ranks(chains.ll)) < kMemory) return;
    const int repeats = level.sweeps == 0 ? 2 : 1;
    for (int i = 0; i < repeats; ++i) {
      const double accepted = move(target, chains, level, stream, context);
      level.step = std::min(1.0, std::max(0.003, level.step * std::exp(accepted - kAcceptance)));
      if (!hamiltonian(target, options)) continue;
      const double moved = hamiltonian_move(target, chains, level, stream, context);
      level.hamiltonian_step =
          std::min(1.5, std::max(0.001, level.hamiltonian_step * std::exp(moved - kHamiltonianAcceptance)));
    }
  }
}

std::vector<Level> pilot(const Target& target, const AisOptions& options, const Context& context,
                         std::uint64_t purpose, Chains& chains, long& evaluations) {
  Stream stream(context.seed, kPilot + purpose, 0);
  chains = start(target, options.pilot_chains, stream, context);
  evaluations += options.pilot_chains;
  if (!std::isfinite(chains.ll.maxCoeff()))
    throw std::runtime_error("ais: the likelihood is zero at every draw from the reference");
  std::vector<Level> levels;
  double beta = 0.0, step = 0.8, hamiltonian_step = 0.5;
  while (beta < 1.0) {
    if (context.poll) context.poll();
    if (static_cast<int>(levels.size()) >= options.max_temperatures)
      throw std::runtime_error("ais: too many temperatures");
    const double next = next_beta(chains, beta, options.ess_drop);
    chains.log_w += chains.ll * (next - beta);
    beta = next;
    levels.push_back(
        {beta, StudentT::fit(chains.x, normalised_exp(chains.log_w), kMoveDof), step, hamiltonian_step, 0});
    resample(chains, stream);
    tune(target, options, chains, levels.back(), stream, context);
    evaluations += chains.size() * (levels.back().sweeps + 1) * sweep_cost(target, options);
    step = levels.back().step;
    hamiltonian_step = levels.back().hamiltonian_step;
  }
  return levels;
}

struct Group {
  Chains chains;
  double log_evidence = 0.0;
  VectorXd acceptance, ess;
};

Group frozen_run(const Target& target, const std::vector<Level>& levels, const AisOptions& options,
                 Stream stream, const Context& context) {
  Group group;
  group.chains = start(target, options.chains, stream, context);
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
    for (int sweep = 0; sweep < levels[k].sweeps; ++sweep) {
      accepted += move(target, group.chains, levels[k], stream, context);
      if (hamiltonian(target, options)) hamiltonian_move(target, group.chains, levels[k], stream, context);
    }
    group.acceptance[k] = accepted / levels[k].sweeps;
  }
  group.log_evidence += log_mean_exp(group.chains.log_w);
  return group;
}

struct Spread {
  double se, lower, upper;
};

// Bootstrap of log mean exp. Deviations are widened by sqrt(n / (n - 1)), the bias of a bootstrap of n
// values, and the interval by Student's t against the normal.
Spread bootstrap(const VectorXd& values, double estimate, Stream stream) {
  constexpr int kReplicates = 1000;
  const Index n = values.size();
  VectorXd replicates(kReplicates);
  VectorXd sample(n);
  for (int k = 0; k < kReplicates; ++k) {
    for (Index i = 0; i < n; ++i) sample[i] = values[stream.index(static_cast<int>(n))];
    replicates[k] = log_mean_exp(sample);
  }
  std::sort(replicates.data(), replicates.data() + kReplicates);
  const double widen = std::sqrt(static_cast<double>(n) / static_cast<double>(n - 1));
  const double infinity = std::numeric_limits<double>::infinity();
  if (n < 2 || !std::isfinite(replicates[0])) return {infinity, -infinity, replicates[974]};
  const double sd = std::sqrt((replicates.array() - replicates.mean()).square().sum() / (kReplicates - 1));
  const boost::math::students_t student(static_cast<double>(n) - 1.0);
  const double wider = widen * boost::math::quantile(student, 0.975) / 1.959964;
  return {sd * widen, estimate + wider * (replicates[24] - estimate),
          estimate + wider * (replicates[974] - estimate)};
}

// A pilot and the frozen run that follows it.
class AnnealedRun {
 public:
  AnnealedRun(const Target& target, const AisOptions& options, const Context& context, std::uint64_t purpose)
      : target_(target), options_(options), context_(context), purpose_(purpose) {
    Chains chains;
    levels_ = pilot(target, options, context, purpose, chains, evaluations_);
    add_groups(options.groups);
  }

  /// Runs more groups, at most twice as many at a time, until the standard error is as asked.
  void refine() {
    // The standard error of few groups is uncertain itself: one standard deviation is added, so that a run
    // does not stop because it happened to look precise.
    const auto cautious = [&] {
      return spread_.se * (1.0 + std::sqrt(0.5 / (static_cast<double>(estimates().size()) - 1.0)));
    };
    while (size() < options_.max_groups && !(cautious() <= options_.precision)) {
      const double excess = std::isfinite(spread_.se) ? std::pow(cautious() / options_.precision, 2) : 2.0;
      const int wanted = static_cast<int>(std::ceil(size() * std::min(2.0, excess)));
      add_groups(std::min(wanted, options_.max_groups) - size());
    }
  }

  double log_evidence() const { return log_evidence_; }
  double variance() const {
    const VectorXd values = estimates();
    return (values.array() - values.mean()).square().sum() / static_cast<double>(values.size() - 1);
  }
  const Spread& spread() const { return spread_; }
  long evaluations() const { return evaluations_; }
  /// Likelihood values that one unit of precision (1 / se^2) costs.
  double price() const { return spread_.se * spread_.se * static_cast<double>(moves()) * size(); }

  // Without resampling every chain is an estimate of its own; with it, every group is.
  VectorXd estimates() const {
    const Index n = options_.resample ? 1 : options_.chains;
    VectorXd values(size() * n);
    for (int g = 0; g < size(); ++g) {
      if (options_.resample) {
        values[g] = groups_[g].log_evidence;
      } else {
        values.segment(g * n, n) = groups_[g].chains.log_w;
      }
    }
    return values;
  }

  // Draws, their log-likelihoods and weights (sum 1) of all groups.
  void gather(MatrixXd& x, VectorXd& ll, VectorXd& weights) const {
    const Index n = options_.chains;
    x.resize(target_.dimension(), n * size());
    ll.resize(n * size());
    VectorXd log_w = VectorXd::Constant(n * size(), -std::numeric_limits<double>::infinity());
    for (int g = 0; g < size(); ++g) {
      const Group& group = groups_[g];
      x.middleCols(g * n, n) = group.chains.x;
      ll.segment(g * n, n) = group.chains.ll;
      if (!std::isfinite(group.log_evidence)) continue;
      const double shift = options_.resample ? group.log_evidence - log_mean_exp(group.chains.log_w) : 0.0;
      log_w.segment(g * n, n) = group.chains.log_w.array() + shift;
    }
    weights = normalised_exp(log_w);
  }

  std::vector<Temperature> ladder() const {
    std::vector<Temperature> ladder;
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      Temperature temperature{levels_[k].beta, levels_[k].step, levels_[k].sweeps, 0.0, 0.0};
      for (const Group& group : groups_) {
        temperature.acceptance += group.acceptance[static_cast<Index>(k)] / size();
        temperature.ess += group.ess[static_cast<Index>(k)] / size();
      }
      ladder.push_back(temperature);
    }
    return ladder;
  }

 private:
  int size() const { return static_cast<int>(groups_.size()); }

  long moves() const {
    long values = 1;
    for (const Level& level : levels_) values += level.sweeps * sweep_cost(target_, options_);
    return values * options_.chains;
  }

  void add_groups(int n) {
    const int first = size();
    groups_.resize(static_cast<std::size_t>(first + n));
    parallel_for(n, context_, [&](int i) {
      const int g = first + i;
      groups_[g] = frozen_run(target_, levels_, options_,
                              Stream(context_.seed, kFrozen + purpose_, static_cast<std::uint64_t>(g)),
                              context_.alone());
    });
    evaluations_ += n * moves();
    const VectorXd values = estimates();
    log_evidence_ = log_mean_exp(values);
    if (!std::isfinite(log_evidence_))
      throw std::runtime_error("ais: every group of chains ended with likelihood zero");
    spread_ = bootstrap(values, log_evidence_, Stream(context_.seed, kBootstrap + purpose_, 0));
  }

  const Target& target_;
  const AisOptions& options_;
  const Context& context_;
  std::uint64_t purpose_;
  std::vector<Level> levels_;
  std::vector<Group> groups_;
  double log_evidence_ = 0.0;
  Spread spread_{};
  long evaluations_ = 0;
};

struct ImportanceSample {
  MatrixXd x;
  VectorXd ll, log_w;
  double log_evidence = -std::numeric_limits<double>::infinity();
  double se = std::numeric_limits<double>::infinity();
  double ess = 0.0;
  VectorXd weights;

  Index size() const { return ll.size(); }
};

// Adds n draws.
void extend(ImportanceSample& sample, const Target& target, const Distribution& mixture, Index n,
            const Context& context, Stream& stream) {
  const Index before = sample.size(), total = before + n;
  sample.x.conservativeResize(target.dimension(), total);
  sample.ll.conservativeResize(total);
  sample.log_w.conservativeResize(total);
  for (Index i = before; i < total; ++i) sample.x.col(i) = mixture.draw(stream);
  const MatrixXd drawn = sample.x.rightCols(n);
  VectorXd over_mixture(n);
  sample.ll.tail(n) = evaluate(target, drawn, context, [&](Index i) {
    over_mixture[i] = target.log_reference(drawn.col(i)) - mixture.log_density(drawn.col(i));
  });
  sample.log_w.tail(n) = over_mixture + sample.ll.tail(n);
  if (!std::isfinite(sample.log_w.maxCoeff())) return;
  sample.log_evidence = log_mean_exp(sample.log_w);
  sample.weights = normalised_exp(sample.log_w);
  sample.ess = 1.0 / sample.weights.squaredNorm();
  const double size = static_cast<double>(total);
  sample.se = std::sqrt(std::max(0.0, size / sample.ess - 1.0) / (size - 1.0));
}

// Draws to which a mixture is fitted: weighted draws of one posterior from several samples, each of which
// counts by its effective size.
struct Pool {
  MatrixXd x;
  VectorXd weights;  // sum of each sample's: its effective size

  void add(const MatrixXd& draws, const VectorXd& own) {
    const Index before = x.cols();
    x.conservativeResize(draws.rows(), before + draws.cols());
    weights.conservativeResize(before + draws.cols());
    x.rightCols(draws.cols()) = draws;
    // Truncated (Ionides 2008), so that no single draw decides on the mixture.
    const VectorXd kept = own.cwiseMin(1.0 / std::sqrt(static_cast<double>(own.size())));
    weights.tail(draws.cols()) = kept * kept.sum() / kept.squaredNorm();
  }
};

StudentTMixture fit_elliptic(const MatrixXd& x, const VectorXd& weights, const AisOptions& options,
                             Stream& stream) {
  return StudentTMixture::fit(x, weights, options.max_components, kImportanceDof, stream);
}

// A mixture that comes closer to the posterior, fitted to a weighted sample of it and, if it may be skewed,
// to all samples before it.
SkewedMixture refit(const ImportanceSample& sample, Pool& pool, const AisOptions& options, Stream& stream) {
  if (!options.skewed)
    return SkewedMixture(SkewMap(), fit_elliptic(sample.x, sample.weights, options, stream));
  pool.add(sample.x, sample.weights);
  return SkewedMixture::fit(pool.x, pool.weights / pool.weights.sum(), options.max_components, kImportanceDof,
                            stream);
}

// Importance sample from a mixture fitted to the annealed draws, then from mixtures fitted to its own
// weighted draws; the last mixture's draws alone are the estimator. Its effective size is 0 where no mixture
// comes close.
ImportanceSample importance_sample(const Target& target, const StudentTMixture& first, Pool pool,
                                   const AisOptions& options, const Context& context, Stream& stream,
                                   long& evaluations) {
  constexpr int kRounds = 4;
  constexpr double kGood = 0.1;     // effective share of the draws at which refitting stops
  constexpr double kUsable = 20.0;  // effective draws from which a mixture may be fitted
  constexpr Index kMost = 16;       // times the draws asked for, at most, for the sake of precision
  constexpr Index kLeastAdded = 100;
  const Index n = options.importance_draws;
  SkewedMixture mixture(SkewMap(), first);
  ImportanceSample sample;
  const auto add = [&](Index draws) {
    extend(sample, target, mixture, draws, context, stream);
    evaluations += draws;
  };
  const auto good = [&] { return sample.ess >= kGood * static_cast<double>(sample.size()); };
  const Index few = options.refit_draws > 0 ? std::min<Index>(options.refit_draws, n) : n;
  add(few);
  if (few < n && !(sample.ess > kUsable)) add(n - few);
  const auto lacking = [&] {  // draws needed over those there are
    return std::max(std::pow(sample.se / options.precision, 2), options.effective_draws / sample.ess);
  };
  for (int round = 1; round < kRounds && (options.skewed || sample.ess > kUsable); ++round) {
    mixture = refit(sample, pool, options, stream);
    sample = ImportanceSample();
    add(n);
    while (good() && lacking() > 1.0 && sample.size() < kMost * n) {
      const double more = 1.1 * (lacking() - 1.0) * static_cast<double>(sample.size());
      add(std::clamp<Index>(static_cast<Index>(more), kLeastAdded, n));
    }
    if (good()) break;
  }
  if (!good()) sample.ess = 0.0;
  return sample;
}

void report(AisResult& result, const std::string& name, double log_evidence, const Spread& spread) {
  result.estimator = name;
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
  report(result, "importance", sample.log_evidence,
         {sample.se, sample.log_evidence - 1.96 * sample.se, sample.log_evidence + 1.96 * sample.se});
}

void report(AisResult& result, const std::string& name, const AnnealedRun& run) {
  run.gather(result.draws, result.log_likelihood, result.weights);
  report(result, name, run.log_evidence(), run.spread());
}

// The second estimator, and the report of the better one: the importance sample or, where no mixture comes
// close to the posterior, the annealed run from the prior or the one that goes the short way from the
// mixture.
void second_estimator(const Target& target, const AisOptions& options, const Context& context,
                      AnnealedRun& annealed, AisResult& result) {
  Stream stream(context.seed, kImportance, 0);
  annealed.gather(result.draws, result.log_likelihood, result.weights);
  const StudentTMixture mixture = fit_elliptic(result.draws, result.weights, options, stream);
  Pool pool;
  pool.add(result.draws, result.weights);
  ImportanceSample sample =
      importance_sample(target, mixture, std::move(pool), options, context, stream, result.evaluations);
  if (sample.ess > 0) {
    result.second = sample.log_evidence;
    result.second_se = sample.se;
    result.second_ess = sample.ess;
    report(result, std::move(sample));
    return;
  }
  const BridgedTarget bridge(target, mixture);
  AnnealedRun bridged(bridge, options, context, kBridged);
  const bool shorter = bridged.price() < annealed.price();
  (shorter ? bridged : annealed).refine();
  result.evaluations += bridged.evaluations();
  result.second = bridged.log_evidence();
  result.second_se = bridged.spread().se;
  report(result, "bridged", bridged);
  result.second_ess = result.ess;
  // The likelihood of a draw, as seen from the target's own reference.
  for (Index i = 0; i < result.log_likelihood.size(); ++i)
    result.log_likelihood[i] -= bridge.log_ratio(result.draws.col(i));
  if (!shorter) report(result, "annealed", annealed);
}

// Both estimates of Z are unbiased, so each is seldom too large (Markov: Z_hat > k Z with probability below 1
// / k) and easily too small. Another estimate below the one reported is no objection to it; one above says
// that the one reported misses part of the posterior.
bool consistent(const AisResult& result) {
  const double other = result.estimator == "annealed" ? result.second : result.annealed;
  return other - result.log_evidence < 3.5 * std::hypot(result.annealed_se, result.second_se) + 0.1;
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
    result.verdict = "not trusted: the other estimator has seen part of the posterior that this one misses";
  } else {
    result.trusted = true;
    result.verdict = options.importance_draws > 0
                         ? "trusted: chains move, weights are even and the two estimators are consistent"
                         : "trusted: chains move and weights are even";
  }
}

}  // namespace

void AisOptions::check() const {
  if ((pilot_chains != 0 && pilot_chains < 8) || groups < 2 || (chains != 0 && chains < 4))
    throw std::invalid_argument("ais: need pilot_chains >= 8, groups >= 2, chains >= 4");
  if (max_groups < groups) throw std::invalid_argument("ais: max_groups must not be below groups");
  if (!(precision > 0)) throw std::invalid_argument("ais: precision must be positive");
  if (sweeps < 0 || max_sweeps < 1 || max_sweeps < sweeps)
    throw std::invalid_argument("ais: sweeps must not be negative, max_sweeps positive and not below them");

  if (!(ess_drop > 0 && ess_drop < 1)) throw std::invalid_argument("ais: ess_drop must lie in (0, 1)");
  if (importance_draws != 0 && importance_draws < 50) {
    throw std::invalid_argument("ais: importance_draws must be 0 (none) or at least 50");
  }
  if (refit_draws < 0 || !(effective_draws >= 0))
    throw std::invalid_argument("ais: refit_draws and effective_draws must not be negative");
  if (max_components < 1 || max_temperatures < 1) throw std::invalid_argument("ais: negative size");
}

AisOptions AisOptions::for_dimension(Index d) const {
  AisOptions filled = *this;
  if (pilot_chains == 0) filled.pilot_chains = static_cast<int>(std::max<Index>(256, 16 * d));
  if (sweeps == 0) filled.sweeps = std::min(kSweeps, max_sweeps);
  if (chains == 0) filled.chains = static_cast<int>(std::max<Index>(32, 3 * d));
  return filled;
}

MatrixXd sample_population(const Target& target, const AisOptions& asked, const Context& context,
                           long& evaluations) {
  asked.check();
  Chains chains;
  pilot(target, asked.for_dimension(target.dimension()), context, 0, chains, evaluations);
  return chains.x;
}

AisResult sample_ais(const Target& target, const AisOptions& asked, const Context& context) {
  asked.check();
  const AisOptions options = asked.for_dimension(target.dimension());
  AisResult result;
  AnnealedRun annealed(target, options, context, 0);
  result.second = result.second_se = std::numeric_limits<double>::quiet_NaN();
  if (options.importance_draws == 0) {
    annealed.refine();
    report(result, "annealed", annealed);
  } else {
    second_estimator(target, options, context, annealed, result);
  }
  result.evaluations += annealed.evaluations();
  result.annealed = annealed.log_evidence();
  result.annealed_se = annealed.spread().se;
  result.log_weight_variance = annealed.variance();
  result.ladder = annealed.ladder();
  judge(result, options);
  return result;
}

}  // namespace amiss
