#include "engine/ais/Chains.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/ais/StandardNormal.hpp"
#include "engine/ais/evaluate.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kLeaps = 1.0 / 3.0;       // share of chains that leap
constexpr int kLeapfrogs = 4;              // of one Hamiltonian move
constexpr int kConditionalLeapfrogs = 12;  // which are cheap

// What the path needs to know of points: log-likelihood and log density of the reference, in blocks that the
// threads share, and the rise.
struct Heights {
  VectorXd ll, reference, rise;

  explicit Heights(Index n) : reference(n), rise(n) {}

  // Of points from first on, whose log-likelihoods come last.
  void prepare(const AnnealingPath& path, const MatrixXd& points, Index first) {
    const Index n = points.cols();
    reference.segment(first, n) = path.reference.log_densities(points);
    rise.segment(first, n) = StandardNormal::at(points) - reference.segment(first, n);
  }
};

Heights heights(const AnnealingPath& path, const MatrixXd& x, const Context& context) {
  Heights at(x.cols());
  at.ll = evaluate(path.target, x, context,
                   [&](Index first, Index n) { at.prepare(path, x.middleCols(first, n), first); });
  at.rise += at.ll;
  return at;
}

// Moves each chain with probability min(1, exp(log_ratio)), never to where the likelihood is zero; returns
// the share that moved of those that `count`.
double accept(Chains& chains, const MatrixXd& proposed, const Heights& at, const VectorXd& log_ratio,
              Stream& stream, const std::vector<bool>& count = {}) {
  int accepted = 0, counted = 0;
  for (Index i = 0; i < chains.size(); ++i) {
    const double log_u = std::log(stream.uniform());
    const int counts = count.empty() || count[static_cast<std::size_t>(i)];
    counted += counts;
    if (!std::isfinite(at.ll[i]) || !(log_u < log_ratio[i])) continue;
    chains.x.col(i) = proposed.col(i);
    chains.ll[i] = at.ll[i];
    chains.reference[i] = at.reference[i];
    chains.rise[i] = at.rise[i];
    accepted += counts;
  }
  return static_cast<double>(accepted) / static_cast<double>(std::max(1, counted));
}

}  // namespace

Chains Chains::start(const AnnealingPath& path, int n, Stream& stream, const Context& context) {
  Chains chains;
  chains.x.resize(path.target.dimension(), n);
  for (int i = 0; i < n; ++i) chains.x.col(i) = path.reference.draw(stream);
  Heights at = heights(path, chains.x, context);
  chains.ll = std::move(at.ll);
  chains.reference = std::move(at.reference);
  chains.rise = std::move(at.rise);
  chains.log_w = VectorXd::Zero(n);
  return chains;
}

double Chains::effective_size() const { return 1.0 / normalised_exp(log_w).squaredNorm(); }

void Chains::resample(Stream& stream) {
  const Index n = size();
  const VectorXd w = normalised_exp(log_w);
  MatrixXd kept_x(x.rows(), n);
  VectorXd kept_ll(n), kept_reference(n), kept_rise(n);
  double cumulative = w[0];
  const double offset = stream.uniform();
  for (Index i = 0, from = 0; i < n; ++i) {
    while (cumulative < (static_cast<double>(i) + offset) / static_cast<double>(n) && from < n - 1)
      cumulative += w[++from];
    kept_x.col(i) = x.col(from);
    kept_ll[i] = ll[from];
    kept_reference[i] = reference[from];
    kept_rise[i] = rise[from];
  }
  x = std::move(kept_x);
  ll = std::move(kept_ll);
  reference = std::move(kept_reference);
  rise = std::move(kept_rise);
  log_w.setZero();
}

double crank_nicolson_move(const AnnealingPath& path, Chains& chains, double beta, const PartMove& part,
                           Stream& stream, const Context& context) {
  MatrixXd proposed = chains.x;
  StudentT::Step step =
      part.proposal.step(part.bend.straight(chains.x.middleRows(part.first, part.size)), part.step, stream);
  proposed.middleRows(part.first, part.size) = part.bend.bent(step.to);
  std::vector<bool> steps(static_cast<std::size_t>(chains.size()), true);
  for (Index i = 0; part.first == 0 && path.target.has_leaps() && i < chains.size(); ++i) {
    if (!(stream.uniform() < kLeaps)) continue;
    steps[static_cast<std::size_t>(i)] = false;
    proposed.col(i) = chains.x.col(i);
    step.back[i] = path.target.leap(proposed.col(i), stream);
  }
  const Heights at = heights(path, proposed, context);
  const VectorXd log_ratio = beta * (at.rise - chains.rise) + at.reference - chains.reference + step.back;
  return accept(chains, proposed, at, log_ratio, stream, steps);
}

bool hamiltonian(const Target& target, const AisOptions& options) {
  return options.gradient && target.has_gradient();
}

double hamiltonian_move(const AnnealingPath& path, Chains& chains, const Level& level, Stream& stream,
                        const Context& context) {
  const Index n = chains.size(), d = chains.x.rows();
  const auto root = level.metric.root().triangularView<Eigen::Lower>();
  MatrixXd x = chains.x, slope(d, n), momentum = stream.normals(d, n);
  Heights at(n);
  const auto force = [&] {  // L' gradient of the log density at this temperature
    at.ll = evaluate(path.target, x, slope, context, [&](Index first, Index count) {
      at.prepare(path, x.middleCols(first, count), first);
      for (Index i = first; i < first + count; ++i) {
        const VectorXd reference = path.reference.gradient(x.col(i));
        slope.col(i) = reference + level.beta * (slope.col(i) - x.col(i) - reference);
      }
    });
    at.rise += at.ll;
    slope = root.transpose() * slope;
    slope = slope.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; });
  };
  VectorXd log_ratio =
      0.5 * momentum.colwise().squaredNorm().transpose() - level.beta * chains.rise - chains.reference;
  const double step = level.hamiltonian_step;
  force();
  for (int k = 0; k < kLeapfrogs; ++k) {
    momentum += 0.5 * step * slope;
    x += root * MatrixXd(step * momentum);
    force();
    momentum += 0.5 * step * slope;
  }
  log_ratio += level.beta * at.rise + at.reference - 0.5 * momentum.colwise().squaredNorm().transpose();
  return accept(chains, x, at, log_ratio, stream);
}

// The blocks of chains go their whole ways one after the other, so that what is known of the others of a
// chain's coordinates is worked out once.
double conditional_move(const AnnealingPath& path, Chains& chains, const ConditionalMove& move,
                        Stream& stream, const Context& context) {
  const Index n = chains.size(), p = move.root.rows();
  const auto root = move.root.triangularView<Eigen::Lower>();
  const double step = move.step * (0.8 + 0.4 * stream.uniform());  // no two moves in resonance
  MatrixXd proposed = chains.x, momentum = stream.normals(p, n);
  VectorXd log_ratio = 0.5 * momentum.colwise().squaredNorm().transpose() - chains.rise - chains.reference;
  Heights at(n);
  at.ll.resize(n);
  for_blocks(path.target, n, context, [&](Index first, Index count) {
    const std::unique_ptr<Conditional> along = path.target.along_last_part(chains.x.middleCols(first, count));
    MatrixXd x = chains.x.bottomRows(p).middleCols(first, count), m = momentum.middleCols(first, count);
    const auto force = [&] {  // L' gradient of the log posterior
      const MatrixXd slope = root.transpose() * MatrixXd(along->gradient(x) - x);
      return MatrixXd(slope.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; }));
    };
    m += 0.5 * step * force();
    for (int k = 0; k < kConditionalLeapfrogs; ++k) {
      x += root * MatrixXd(step * m);
      m += (k + 1 < kConditionalLeapfrogs ? step : 0.5 * step) * force();
    }
    at.ll.segment(first, count) = along->log_likelihood(x).unaryExpr(&finite_or_zero);
    auto block = proposed.middleCols(first, count);
    block.bottomRows(p) = x;
    at.prepare(path, block, first);
    log_ratio.segment(first, count) -= 0.5 * m.colwise().squaredNorm().transpose();
  });
  at.rise += at.ll;
  log_ratio += at.rise + at.reference;
  return accept(chains, proposed, at, log_ratio, stream);
}

int sweep_cost(const Target& target, const Level& level, const AisOptions& options) {
  const int parts = static_cast<int>(target.parts().size()) + (level.conditional ? 1 : 0);
  return hamiltonian(target, options) ? parts + 1 + kLeapfrogs : parts;
}

}  // namespace amiss
