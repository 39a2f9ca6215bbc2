#include "engine/ais/AnnealedRun.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "engine/linalg/log_sum_exp.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

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

}  // namespace

AnnealedRun::AnnealedRun(const AnnealingPath& path, const AisOptions& options, const Context& context,
                         std::uint64_t purpose)
    : path_(path), options_(options), context_(context), purpose_(purpose) {
  Pilot pilot(path, options, context, purpose);
  levels_ = std::move(pilot.levels);
  evaluations_ = pilot.evaluations;
  add_groups(options.groups);
}

void AnnealedRun::add_groups(int n) {
  const int first = size();
  groups_.resize(static_cast<std::size_t>(first + n));
  parallel_for(n, context_, [&](int i) {
    const int g = first + i;
    groups_[g] =
        run_group(Stream(context_.seed, kFrozen + purpose_, static_cast<std::uint64_t>(g)), context_.alone());
  });
  evaluations_ += n * moves();
  const VectorXd values = estimates();
  log_evidence_ = log_mean_exp(values);
  if (!std::isfinite(log_evidence_))
    throw std::runtime_error("ais: every group of chains ended with likelihood zero");
  spread_ = bootstrap(values, log_evidence_, Stream(context_.seed, kBootstrap + purpose_, 0));
}

AnnealedRun::Group AnnealedRun::run_group(Stream stream, const Context& context) const {
  Group group;
  group.chains = Chains::start(path_, options_.chains, stream, context);
  group.acceptance = VectorXd::Zero(static_cast<Index>(levels_.size()));
  group.ess = VectorXd::Zero(static_cast<Index>(levels_.size()));
  double beta = 0.0;
  for (std::size_t k = 0; k < levels_.size(); ++k) {
    group.chains.log_w += group.chains.rise * (levels_[k].beta - beta);
    beta = levels_[k].beta;
    const double top = group.chains.log_w.maxCoeff();
    group.ess[k] = std::isfinite(top) ? group.chains.effective_size() / options_.chains : 0.0;
    if (!std::isfinite(top)) {
      group.log_evidence = -std::numeric_limits<double>::infinity();
      return group;
    }
    if (options_.resample && group.ess[k] < 0.5) {
      group.log_evidence += log_mean_exp(group.chains.log_w);
      group.chains.resample(stream);
    }
    const std::vector<PartMove>& parts = levels_[k].parts;
    VectorXd accepted = VectorXd::Zero(static_cast<Index>(parts.size()));
    for (int sweep = 0; sweep < levels_[k].sweeps; ++sweep) {
      for (std::size_t p = 0; p < parts.size(); ++p)
        accepted[static_cast<Index>(p)] +=
            crank_nicolson_move(path_, group.chains, levels_[k].beta, parts[p], stream, context);
      if (levels_[k].conditional)
        conditional_move(path_, group.chains, *levels_[k].conditional, stream, context);
      if (hamiltonian(path_.target, options_))
        hamiltonian_move(path_, group.chains, levels_[k], stream, context);
    }
    group.acceptance[k] = accepted.minCoeff() / levels_[k].sweeps;
  }
  group.log_evidence += log_mean_exp(group.chains.log_w);
  return group;
}

void AnnealedRun::refine() {
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

double AnnealedRun::variance() const {
  const VectorXd values = estimates();
  return (values.array() - values.mean()).square().sum() / static_cast<double>(values.size() - 1);
}

long AnnealedRun::moves() const {
  long values = 1;
  for (const Level& level : levels_) values += level.sweeps * sweep_cost(path_.target, level, options_);
  return values * options_.chains;
}

// Without resampling every chain is an estimate of its own; with it, every group is.
VectorXd AnnealedRun::estimates() const {
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

void AnnealedRun::gather(MatrixXd& x, VectorXd& ll, VectorXd& weights) const {
  const Index n = options_.chains;
  x.resize(path_.target.dimension(), n * size());
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

std::vector<Temperature> AnnealedRun::ladder() const {
  std::vector<Temperature> ladder;
  for (std::size_t k = 0; k < levels_.size(); ++k) {
    Temperature temperature{levels_[k].beta, levels_[k].parts.back().step, levels_[k].sweeps, 0.0, 0.0};
    for (const Group& group : groups_) {
      temperature.acceptance += group.acceptance[static_cast<Index>(k)] / size();
      temperature.ess += group.ess[static_cast<Index>(k)] / size();
    }
    ladder.push_back(temperature);
  }
  return ladder;
}

}  // namespace amiss
