#include "engine/discrepancy/KernelSampling.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "engine/ais/PopulationMonteCarlo.hpp"
#include "engine/ais/Sampler.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/ais/spread_draws.hpp"
#include "engine/discrepancy/LowRankKernel.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/parallel/MemoryPool.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kRoundDraws = 200;  // that bring a stage's mixture closer to its posterior, each round
// Shares of a distribution's draws, in each direction, that skeletons serve.
constexpr double kBulk = 0.9, kAll = 0.998;
constexpr std::array<double, 3> kWide = {0.95, 0.98, 0.998};
constexpr double kLargestSkeleton = 800.0, kWorthySkeleton = 0.65;  // the latter times N
constexpr Index kReachDraws = 1000;
constexpr double kCoarser = 10.0;               // tolerance while only draws are needed, over the final one
constexpr int kPilotChains = 64, kChains = 16;  // unless asked otherwise
constexpr int kRefitDraws = 300, kEffectiveDraws = 400;  // likewise
constexpr int kRoughSweeps = 1;                          // likewise, while only draws are needed
constexpr double kRoughDrop = 0.4;  // conditional effective size while only draws are needed

// Skeletons from small to large that together serve nearly all draws of a distribution: one for its bulk, one
// for draws that are rough in one direction only, and the largest that is still worth it for the others.
std::vector<KernelSkeleton> make_skeletons(const KernelModel& model, const Distribution& distribution,
                                           double tolerance, const Context& context, Stream& stream) {
  const KernelTarget target(model);
  const Index s = model.conditions() + 1;
  MatrixXd reach(kReachDraws, s + 1);
  for (Index i = 0; i < kReachDraws; ++i) {
    const KernelParameters p = target.parameters(distribution.draw(stream));
    reach.row(i) << p.decay.transpose(), std::min(p.amplitude * p.lambda, KernelModel::largest_ratio);
  }
  for (Index k = 0; k <= s; ++k) std::sort(reach.col(k).data(), reach.col(k).data() + kReachDraws);
  const auto at = [&](double share) -> VectorXd {
    return reach.row(static_cast<Index>(share * (kReachDraws - 1))).transpose();
  };
  std::vector<VectorXd> boxes = {at(kBulk)};
  for (Index k = 0; k <= s; ++k) {
    boxes.push_back(boxes.front());
    boxes.back()[k] = at(kAll)[k];
  }
  for (double share : kWide) boxes.push_back(at(share));
  const auto most =
      static_cast<Index>(std::min(kLargestSkeleton, kWorthySkeleton * static_cast<double>(model.size())));
  std::vector<std::optional<KernelSkeleton>> made(boxes.size());
  parallel_for(static_cast<int>(boxes.size()), context, [&](int i) {
    const VectorXd& box = boxes[static_cast<std::size_t>(i)];
    made[static_cast<std::size_t>(i)] = KernelSkeleton::make(model, box.head(s), box[s], tolerance, most);
  });
  std::vector<KernelSkeleton> skeletons;
  for (auto& skeleton : made) {
    if (skeleton) skeletons.push_back(std::move(*skeleton));
  }
  std::stable_sort(skeletons.begin(), skeletons.end(),
                   [](const KernelSkeleton& a, const KernelSkeleton& b) { return a.rank() < b.rank(); });
  return skeletons;
}

// Posterior (6) with approximate values.
class ApproximateTarget : public Target {
 public:
  ApproximateTarget(const KernelModel& model, const Distribution& near, double tolerance,
                    const Context& context, Stream& stream)
      : exact_(model),
        model_(model),
        skeletons_(make_skeletons(model, near, tolerance, context, stream)),
        tolerance_(tolerance) {}

  Index dimension() const override { return exact_.dimension(); }
  VectorXd log_likelihood(const MatrixXd& x) const override {
    const MemoryPool<Memory>::Loan memory(memory_);
    VectorXd values(x.cols());
    for (Index i = 0; i < x.cols(); ++i) values[i] = value(exact_.parameters(x.col(i)), *memory);
    return values;
  }

  mutable std::atomic<long> direct{0}, by_skeleton{0};

 private:
  struct Memory {
    KernelModel::Memory dense;
    KernelSkeleton::Memory skeleton;
  };

  double value(const KernelParameters& p, Memory& memory) const {
    for (const KernelSkeleton& skeleton : skeletons_) {
      if (!skeleton.serves(p)) continue;
      ++by_skeleton;
      return skeleton.log_likelihood(p, memory.skeleton);
    }
    ++direct;
    return bounded_likelihood(model_, p, tolerance_, Certificate::determinant, memory.dense).value;
  }

  KernelTarget exact_;
  const KernelModel& model_;
  std::vector<KernelSkeleton> skeletons_;
  double tolerance_;
  mutable MemoryPool<Memory> memory_;
};

// Compares approximate values with certified ones at draws spread over the posterior, and mends the evidence:
// Z / Z~ is the posterior mean of exp(exact - approximate).
void certify(const KernelModel& model, const KernelTarget& target, const KernelSamplingOptions& sampling,
             const Context& context, KernelSample& sample) {
  AisResult& posterior = sample.posterior;
  const int n = sampling.certified;
  VectorXd difference(n);
  const std::vector<Index> picked = spread_draws(posterior.weights, n);
  parallel_for(n, context, [&](int i) {
    const Index draw = picked[static_cast<std::size_t>(i)];
    const KernelParameters p = target.parameters(posterior.draws.col(draw));
    KernelModel::Memory memory;
    const double value = bounded_likelihood(model, p, sampling.tolerance, Certificate::both, memory).value;
    difference[i] = value - posterior.log_likelihood[draw];
  });
  sample.largest_error = difference.cwiseAbs().maxCoeff();
  sample.correction = log_mean_exp(difference);
  const double mean = difference.mean();
  const double se = std::sqrt((difference.array() - mean).square().sum() / (n * (n - 1.0)));
  posterior.log_evidence += sample.correction;
  posterior.lower += sample.correction - 1.96 * se;
  posterior.upper += sample.correction + 1.96 * se;
  posterior.standard_error = std::hypot(posterior.standard_error, se);
  if (!(sample.largest_error <= 1.0)) posterior.outcome = Outcome::approximate;
}

// Where the posterior of this record lies, found by way of thinned ones.
SkewedMixture sample_stage(const KernelModel& model, const AisOptions& options,
                           const KernelSamplingOptions& sampling, const Context& context, long& evaluations) {
  const Context thinned = context.fork(kThinned);
  Stream stream(thinned.seed, kStage, 0);
  const auto closer = [&](const Target& target, const MatrixXd& draws) {
    PopulationMonteCarlo population(target, thinned, stream);
    population.add(draws);
    SkewedMixture mixture = population.closer({kRoundDraws});
    evaluations += population.evaluations();
    return mixture;
  };
  if (model.size() <= sampling.coarsest) {
    const KernelTarget target(model);
    const StandardNormal prior(target.dimension());
    return closer(target, sample_population(target, prior, options, thinned, evaluations));
  }
  const SkewedMixture before =
      sample_stage(model.thinned(sampling.thinning), options, sampling, thinned, evaluations);
  const ApproximateTarget approximate(model, before, kCoarser * sampling.tolerance, context, stream);
  return closer(approximate, sample_population(approximate, before, options, thinned, evaluations));
}

}  // namespace

void KernelSamplingOptions::check() const {
  if (!(tolerance > 0 && tolerance <= 1))
    throw std::invalid_argument("kernel sampling: tolerance must lie in (0, 1] nats");
  if (coarsest < 20 || thinning < 2 || certified < 2)
    throw std::invalid_argument("kernel sampling: need coarsest >= 20, thinning >= 2, certified >= 2");
}

KernelSample sample_kernel(const KernelModel& model, const AisOptions& options,
                           const KernelSamplingOptions& sampling, const Context& context) {
  sampling.check();
  KernelSample sample;
  const KernelTarget target(model);
  if (model.size() <= sampling.coarsest) {
    sample.posterior = sample_ais(target, options, context);
    sample.direct = sample.posterior.evaluations;
    return sample;
  }
  AisOptions careful = options;
  if (careful.pilot_chains == 0) careful.pilot_chains = kPilotChains;
  if (careful.chains == 0) careful.chains = kChains;
  if (careful.refit_draws == 0) careful.refit_draws = kRefitDraws;
  if (careful.effective_draws == 0) careful.effective_draws = kEffectiveDraws;
  AisOptions rough = careful;
  rough.ess_drop = std::min(careful.ess_drop, kRoughDrop);
  if (options.sweeps == 0) rough.sweeps = kRoughSweeps;  // and more, while likelihoods remember
  const SkewedMixture before = sample_stage(model, rough, sampling, context, sample.coarse);
  Stream stream(context.seed, kStage, 0);
  const ApproximateTarget approximate(model, before, sampling.tolerance, context, stream);
  AisResult& posterior = sample.posterior = sample_ais(approximate, before, careful, context);
  posterior.evaluations += sample.coarse;
  sample.direct = approximate.direct;
  sample.by_skeleton = approximate.by_skeleton;
  certify(model, target, sampling, context, sample);
  return sample;
}

}  // namespace amiss
