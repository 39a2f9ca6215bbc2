#include "engine/ais/Chains.hpp"

#include <cmath>
#include <utility>

#include "engine/ais/evaluate.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kLeapfrogs = 4;  // of one Hamiltonian move

}  // namespace

Chains Chains::start(const AnnealingPath& path, int n, Stream& stream, const Context& context) {
  Chains chains;
  chains.x.resize(path.target.dimension(), n);
  for (int i = 0; i < n; ++i) chains.x.col(i) = path.reference.draw(stream);
  chains.ll = evaluate(path.target, chains.x, context);
  chains.rise.resize(n);
  for (int i = 0; i < n; ++i) chains.rise[i] = path.rise(chains.x.col(i), chains.ll[i]);
  chains.log_w = VectorXd::Zero(n);
  return chains;
}

double Chains::effective_size() const { return 1.0 / normalised_exp(log_w).squaredNorm(); }

void Chains::resample(Stream& stream) {
  const Index n = size();
  const VectorXd w = normalised_exp(log_w);
  MatrixXd kept_x(x.rows(), n);
  VectorXd kept_ll(n), kept_rise(n);
  double cumulative = w[0];
  const double offset = stream.uniform();
  for (Index i = 0, from = 0; i < n; ++i) {
    while (cumulative < (static_cast<double>(i) + offset) / static_cast<double>(n) && from < n - 1)
      cumulative += w[++from];
    kept_x.col(i) = x.col(from);
    kept_ll[i] = ll[from];
    kept_rise[i] = rise[from];
  }
  x = std::move(kept_x);
  ll = std::move(kept_ll);
  rise = std::move(kept_rise);
  log_w.setZero();
}

double crank_nicolson_move(const AnnealingPath& path, Chains& chains, double beta, const PartMove& part,
                           Stream& stream, const Context& context) {
  const Index n = chains.size();
  MatrixXd proposed = chains.x;
  VectorXd back(n);  // log density of the proposal at the chain over that at the point proposed
  for (Index i = 0; i < n; ++i) {
    const VectorXd from = part.bend.straight(chains.x.col(i).segment(part.first, part.size));
    const VectorXd to = part.proposal.step(from, part.step, stream);
    proposed.col(i).segment(part.first, part.size) = part.bend.bent(to);
    back[i] = part.proposal.log_density(from) - part.proposal.log_density(to);
  }
  VectorXd at_chain(n), at_proposed(n), prior_over(n);
  const VectorXd ll = evaluate(path.target, proposed, context, [&](Index i) {
    const VectorXd to = proposed.col(i);
    at_chain[i] = path.reference.log_density(chains.x.col(i));
    at_proposed[i] = path.reference.log_density(to);
    prior_over[i] = StandardNormal::log_density_at(to) - at_proposed[i];
  });
  int accepted = 0;
  for (Index i = 0; i < n; ++i) {
    const double log_u = std::log(stream.uniform());
    if (!std::isfinite(ll[i])) continue;
    const double rise = ll[i] + prior_over[i];
    if (log_u < beta * (rise - chains.rise[i]) + at_proposed[i] - at_chain[i] + back[i]) {
      chains.x.col(i) = proposed.col(i);
      chains.ll[i] = ll[i];
      chains.rise[i] = rise;
      ++accepted;
    }
  }
  return static_cast<double>(accepted) / static_cast<double>(n);
}

bool hamiltonian(const Target& target, const AisOptions& options) {
  return options.gradient && target.has_gradient();
}

double hamiltonian_move(const AnnealingPath& path, Chains& chains, const Level& level, Stream& stream,
                        const Context& context) {
  const Index n = chains.size(), d = chains.x.rows();
  const auto root = level.metric.root().triangularView<Eigen::Lower>();
  MatrixXd x = chains.x, slope(d, n), momentum = stream.normals(d, n);
  VectorXd ll, prior_over(n), rise(n);
  const auto force = [&] {  // L' gradient of the log density at this temperature
    ll = evaluate(path.target, x, slope, context, [&](Index i) {
      const VectorXd at = x.col(i);
      prior_over[i] = StandardNormal::log_density_at(at) - path.reference.log_density(at);
      const VectorXd reference = path.reference.gradient(at);
      slope.col(i) = reference + level.beta * (slope.col(i) - at - reference);
    });
    rise = ll + prior_over;
    slope = root.transpose() * slope;
    slope = slope.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; });
  };
  VectorXd log_ratio = 0.5 * momentum.colwise().squaredNorm().transpose() - level.beta * chains.rise;
  for (Index i = 0; i < n; ++i) log_ratio[i] -= path.reference.log_density(chains.x.col(i));
  const double step = level.hamiltonian_step;
  force();
  for (int k = 0; k < kLeapfrogs; ++k) {
    momentum += 0.5 * step * slope;
    x += root * MatrixXd(step * momentum);
    force();
    momentum += 0.5 * step * slope;
  }
  log_ratio += level.beta * rise - 0.5 * momentum.colwise().squaredNorm().transpose();
  int accepted = 0;
  for (Index i = 0; i < n; ++i) {
    const double log_u = std::log(stream.uniform());
    if (!std::isfinite(ll[i]) || !(log_u < log_ratio[i] + path.reference.log_density(x.col(i)))) continue;
    chains.x.col(i) = x.col(i);
    chains.ll[i] = ll[i];
    chains.rise[i] = rise[i];
    ++accepted;
  }
  return static_cast<double>(accepted) / static_cast<double>(n);
}

int sweep_cost(const Target& target, const AisOptions& options) {
  const int parts = static_cast<int>(target.parts().size());
  return hamiltonian(target, options) ? parts + 1 + kLeapfrogs : parts;
}

}  // namespace amiss
