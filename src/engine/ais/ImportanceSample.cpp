#include "engine/ais/ImportanceSample.hpp"

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

constexpr double kImportanceDof = 8.0;  // of the mixtures
constexpr double kNegligible = 1e-3;    // share of the weight that the draws left out have at most

// A mixture that comes closer to the posterior, fitted to a weighted sample of it and, if it may be skewed,
// to all samples before it.
SkewedMixture refit(const ImportanceSample& sample, DrawPool& pool, const AisOptions& options,
                    Stream& stream) {
  if (!options.skewed)
    return SkewedMixture(SkewMap(), fit_elliptic(sample.x, sample.weights, options, stream));
  if (sample.ess > 0) pool.add(sample.x, sample.weights);  // else the record is impossible at every draw
  return pool.fit(options.max_components, kImportanceDof, stream);
}

}  // namespace

void ImportanceSample::extend(const Target& target, const Distribution& mixture, Index n,
                              const Context& context, Stream& stream) {
  const Index before = size(), total = before + n;
  x.conservativeResize(target.dimension(), total);
  ll.conservativeResize(total);
  log_w.conservativeResize(total);
  for (Index i = before; i < total; ++i) x.col(i) = mixture.draw(stream);
  const MatrixXd drawn = x.rightCols(n);
  VectorXd prior_over(n);
  ll.tail(n) = evaluate(target, drawn, context, [&](Index first, Index count) {
    const MatrixXd block = drawn.middleCols(first, count);
    prior_over.segment(first, count) = StandardNormal::at(block) - mixture.log_densities(block);
  });
  log_w.tail(n) = prior_over + ll.tail(n);
  if (!std::isfinite(log_w.maxCoeff())) return;
  log_evidence = log_mean_exp(log_w);
  weights = normalised_exp(log_w);
  ess = 1.0 / weights.squaredNorm();
  const double count = static_cast<double>(total);
  se = std::sqrt(std::max(0.0, count / ess - 1.0) / (count - 1.0));
}

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

SkewedMixture closer_mixture(const Target& target, SkewedMixture mixture, DrawPool pool,
                             const CloserOptions& options, const Context& context, Stream& stream,
                             long& evaluations) {
  for (int round = 0; round < options.rounds; ++round) {
    ImportanceSample sample;
    sample.extend(target, mixture, options.draws, context, stream);
    evaluations += options.draws;
    if (!(sample.ess > 0)) break;
    pool.add(sample.x, sample.weights);
    mixture = pool.fit(options.max_components, options.dof, stream);
  }
  return mixture;
}

SkewedMixture closer_mixture(const Target& target, const MatrixXd& population, const CloserOptions& options,
                             const Context& context, Stream& stream, long& evaluations) {
  const Index n = population.cols();
  DrawPool pool;
  pool.add(population, VectorXd::Constant(n, 1.0 / static_cast<double>(n)));
  SkewedMixture first = pool.fit(options.max_components, options.dof, stream);
  return closer_mixture(target, std::move(first), std::move(pool), options, context, stream, evaluations);
}

StudentTMixture fit_elliptic(const MatrixXd& x, const VectorXd& weights, const AisOptions& options,
                             Stream& stream) {
  return StudentTMixture::fit(x, weights, options.max_components, kImportanceDof, stream);
}

ImportanceSample importance_sample(const Target& target, const StudentTMixture& first, DrawPool pool,
                                   const AisOptions& options, const Context& context, Stream& stream,
                                   long& evaluations) {
  constexpr int kRounds = 4;
  constexpr double kGood = 0.1;     // effective share of the draws at which refitting stops
  constexpr double kUsable = 20.0;  // effective draws from which a mixture may be fitted
  constexpr Index kMost = 16;       // times the draws asked for, at most, for the sake of precision
  constexpr double kLeastAdded = 100.0;
  const Index n = options.importance_draws;
  SkewedMixture mixture(SkewMap(), first);
  ImportanceSample sample;
  const auto add = [&](Index draws) {
    sample.extend(target, mixture, draws, context, stream);
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
      const double all = static_cast<double>(n);
      add(static_cast<Index>(std::clamp(more, std::min(kLeastAdded, all), all)));
    }
    if (good()) break;
  }
  if (!good()) sample.ess = 0.0;
  return sample;
}

}  // namespace amiss
