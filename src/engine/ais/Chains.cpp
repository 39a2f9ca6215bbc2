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

Chains Chains::start(const Target& target, int n, Stream& stream, const Context& context) {
  Chains chains;
  chains.x.resize(target.dimension(), n);
  for (int i = 0; i < n; ++i) chains.x.col(i) = target.draw_reference(stream);
  chains.ll = evaluate(target, chains.x, context);
  chains.log_w = VectorXd::Zero(n);
  return chains;
}

double Chains::effective_size() const { return 1.0 / normalised_exp(log_w).squaredNorm(); }

void Chains::resample(Stream& stream) {
  const Index n = size();
  const VectorXd w = normalised_exp(log_w);
  MatrixXd kept_x(x.rows(), n);
  VectorXd kept_ll(n);
  double cumulative = w[0];
  const double offset = stream.uniform();
  for (Index i = 0, from = 0; i < n; ++i) {
    while (cumulative < (static_cast<double>(i) + offset) / static_cast<double>(n) && from < n - 1)
      cumulative += w[++from];
    kept_x.col(i) = x.col(from);
    kept_ll[i] = ll[from];
  }
  x = std::move(kept_x);
  ll = std::move(kept_ll);
  log_w.setZero();
}

double crank_nicolson_move(const Target& target, Chains& chains, const Level& level, Stream& stream,
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

int sweep_cost(const Target& target, const AisOptions& options) {
  return hamiltonian(target, options) ? 2 + kLeapfrogs : 1;
}

}  // namespace amiss
