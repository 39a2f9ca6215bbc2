#include "engine/ais/PopulationMonteCarlo.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kImportanceDof = 8.0;  // of the mixtures of importance samples
constexpr double kNegligible = 1e-3;    // share of the weight that the draws left out have at most

}  // namespace

void DrawPool::add(const MatrixXd& draws, const VectorXd& weights) {
  // Truncated (Ionides 2008), so that no single draw decides on the mixture; those that together weigh next
  // to nothing are left out.
  VectorXd kept = weights.cwiseMin(1.0 / std::sqrt(static_cast<double>(weights.size())));
  kept *= kept.sum() / kept.squaredNorm();
  const double least = kNegligible * kept.sum() / static_cast<double>(kept.size());
  const Index before = x_.cols(), added = (kept.array() > least).count();
  x_.conservativeResize(draws.rows(), before + added);
  weights_.conservativeResize(before + added);
  for (Index i = 0, at = before; i < draws.cols(); ++i) {
    if (!(kept[i] > least)) continue;
    x_.col(at) = draws.col(i);
    weights_[at++] = kept[i];
  }
}

SkewedMixture DrawPool::fit(int max_components, double dof, Stream& stream) const {
  return SkewedMixture::fit(x_, weights_ / weights_.sum(), max_components, dof, stream);
}

void PopulationMonteCarlo::add(const MatrixXd& draws) {
  const Index n = draws.cols();
  add(draws, VectorXd::Constant(n, 1.0 / static_cast<double>(n)));
}

void PopulationMonteCarlo::extend(ImportanceSample& sample, const SkewedMixture& mixture, Index draws) {
  sample.extend(target_, mixture, draws, context_, stream_);
  evaluations_ += draws;
}

SkewedMixture PopulationMonteCarlo::closer(SkewedMixture mixture, const CloserOptions& options) {
  for (int round = 0; round < options.rounds; ++round) {
    ImportanceSample sample;
    extend(sample, mixture, options.draws);
    if (!(sample.ess > 0)) break;
    pool_.add(sample.x, sample.weights);
    mixture = fit(options.max_components, options.dof);
  }
  return mixture;
}

SkewedMixture PopulationMonteCarlo::closer(const CloserOptions& options) {
  return closer(fit(options.max_components, options.dof), options);
}

ImportanceSample PopulationMonteCarlo::sample(const AisOptions& options) {
  constexpr int kRounds = 12;
  constexpr double kClose = 0.5;     // effective share of the draws at which refitting stops
  constexpr double kProgress = 1.1;  // times the best effective size; after two rounds without, they end
  constexpr double kGood = 0.1;      // effective share below which there is no estimate
  constexpr double kUsable = 20.0;   // effective draws below which the first round gets the rest of its draws
  constexpr Index kMost = 16;        // times the draws asked for, at most, for the sake of precision
  constexpr double kLeastAdded = 100.0;
  const Index n = options.importance_draws;
  SkewedMixture mixture = fit(options.max_components, kImportanceDof), closest = mixture;
  ImportanceSample sample;
  const auto reaches = [&](double share) { return sample.ess >= share * static_cast<double>(sample.size()); };
  const Index few = options.refit_draws > 0 ? std::min<Index>(options.refit_draws, n) : n;
  extend(sample, mixture, few);
  if (few < n && !(sample.ess > kUsable)) extend(sample, mixture, n - few);
  double best = 0.0;  // effective size, of the rounds
  for (int round = 1, vain = 0; round < kRounds && vain < 2; ++round) {
    if (sample.ess > 0) pool_.add(sample.x, sample.weights);  // else the record is impossible at every draw
    mixture = fit(options.max_components, kImportanceDof);
    sample = ImportanceSample();
    extend(sample, mixture, n);
    if (reaches(kClose)) break;
    vain = sample.ess > kProgress * best ? 0 : vain + 1;
    if (sample.ess > best) {
      best = sample.ess;
      closest = mixture;
    }
  }
  if (!reaches(kGood) && best >= kGood * static_cast<double>(n)) {  // the last round is worse than one before
    mixture = closest;
    sample = ImportanceSample();
    extend(sample, mixture, n);
  }
  const auto lacking = [&] {  // draws needed over those there are
    return std::max(std::pow(sample.se / options.precision, 2), options.effective_draws / sample.ess);
  };
  while (reaches(kGood) && lacking() > 1.0 && sample.size() < kMost * n) {
    const double more = 1.1 * (lacking() - 1.0) * static_cast<double>(sample.size());
    const double all = static_cast<double>(n);
    extend(sample, mixture, static_cast<Index>(std::clamp(more, std::min(kLeastAdded, all), all)));
  }
  if (!reaches(kGood)) sample.ess = 0.0;
  return sample;
}

}  // namespace amiss
