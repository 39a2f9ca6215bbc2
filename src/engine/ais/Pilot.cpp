#include "engine/ais/Pilot.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kMoveDof = 6.0;      // of the proposals
constexpr double kAcceptance = 0.35;  // aimed at by the step length
constexpr double kHamiltonianAcceptance = 0.75;
constexpr double kMemory = 0.5;  // rank correlation of the likelihoods at which a chain has moved on

// Conditional effective size per chain of a step d in inverse temperature (Zhou, Johansen and Aston 2016).
double conditional_ess(const Chains& chains, double d) {
  const VectorXd w = normalised_exp(chains.log_w);
  const VectorXd v = chains.rise * d;
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

PartMove part_move(const MatrixXd& x, const VectorXd& weights, Index first, double step) {
  const BentMap bend = BentMap::fit(x, weights);
  return {first, x.rows(), bend, StudentT::fit(bend.straight(x), weights, kMoveDof), step};
}

// Moves the chains, tuning the step, until their likelihoods have forgotten where they began. The first sweep
// is still far from the right step and is not counted.
void tune(const AnnealingPath& path, const AisOptions& options, Chains& chains, Level& level, Stream& stream,
          const Context& context) {
  const VectorXd before = ranks(chains.ll);
  for (level.sweeps = 0; level.sweeps < options.max_sweeps; ++level.sweeps) {
    if (level.sweeps >= options.sweeps && before.dot(ranks(chains.ll)) < kMemory) return;
    const int repeats = level.sweeps == 0 ? 2 : 1;
    for (int i = 0; i < repeats; ++i) {
      for (PartMove& part : level.parts) {
        const double accepted = crank_nicolson_move(path, chains, level.beta, part, stream, context);
        part.step = std::min(1.0, std::max(0.003, part.step * std::exp(accepted - kAcceptance)));
      }
      if (level.conditional) {
        ConditionalMove& move = *level.conditional;
        const double moved = conditional_move(path, chains, move, stream, context);
        move.step = std::min(1.5, std::max(0.001, move.step * std::exp(moved - kHamiltonianAcceptance)));
      }
      if (!hamiltonian(path.target, options)) continue;
      const double moved = hamiltonian_move(path, chains, level, stream, context);
      level.hamiltonian_step =
          std::min(1.5, std::max(0.001, level.hamiltonian_step * std::exp(moved - kHamiltonianAcceptance)));
    }
  }
}

}  // namespace

Pilot::Pilot(const AnnealingPath& path, const AisOptions& options, const Context& context,
             std::uint64_t purpose) {
  Stream stream(context.seed, kPilot + purpose, 0);
  chains = Chains::start(path, options.pilot_chains, stream, context);
  evaluations = options.pilot_chains;
  if (!std::isfinite(chains.ll.maxCoeff()))
    throw std::runtime_error("ais: the likelihood is zero at every draw from the reference");
  double beta = 0.0, hamiltonian_step = 0.5;
  const std::vector<Index> parts = path.target.parts();
  std::vector<double> steps(parts.size(), 0.8);
  while (beta < 1.0) {
    if (context.poll) context.poll();
    if (static_cast<int>(levels.size()) >= options.max_temperatures)
      throw std::runtime_error("ais: too many temperatures");
    const double next = next_beta(chains, beta, options.ess_drop);
    chains.log_w += chains.rise * (next - beta);
    beta = next;
    const VectorXd weights = normalised_exp(chains.log_w);
    Level level{beta, {}, StudentT::fit(chains.x, weights, kMoveDof), hamiltonian_step, std::nullopt, 0};
    if (beta == 1.0 && options.gradient && path.target.has_conditional()) {
      const MatrixXd last = chains.x.bottomRows(parts.back());
      level.conditional = ConditionalMove{StudentT::fit(last, weights, kMoveDof).root(), 0.5};
    }
    Index first = 0;
    for (std::size_t k = 0; k < parts.size(); ++k) {
      level.parts.push_back(part_move(chains.x.middleRows(first, parts[k]), weights, first, steps[k]));
      first += parts[k];
    }
    levels.push_back(std::move(level));
    chains.resample(stream);
    tune(path, options, chains, levels.back(), stream, context);
    evaluations +=
        chains.size() * (levels.back().sweeps + 1) * sweep_cost(path.target, levels.back(), options);
    for (std::size_t k = 0; k < parts.size(); ++k) steps[k] = levels.back().parts[k].step;
    hamiltonian_step = levels.back().hamiltonian_step;
  }
}

}  // namespace amiss
