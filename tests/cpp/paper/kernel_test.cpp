#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/KernelSampling.hpp"
#include "engine/discrepancy/LowRankKernel.hpp"
#include "engine/linalg/GaussianKernel.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

// A record of n steps, smooth conditions of which the first two act.
KernelData smooth_data(Index n) {
  KernelData data;
  const Eigen::ArrayXd hour = Eigen::ArrayXd::LinSpaced(n, 0.0, 96.0);
  data.conditions.resize(n, 3);
  data.conditions.col(0) = 10.0 + 5.0 * (hour * 0.26).sin() + (hour * 0.05).cos();
  data.conditions.col(1) = (300.0 * (hour * 0.26 - 1.0).sin()).max(0.0) * (1.0 + 0.3 * (hour * 0.6).sin());
  data.conditions.col(2) = 3.0 + (hour * 0.7).sin() + (hour * 2.1).cos();
  data.condition = {0, 1, 2};
  data.fictitious = fictitious_condition(n, 7);
  data.basis.resize(n, 3);
  data.basis << VectorXd::Ones(n), (hour * 0.26).cos().matrix(), (hour / 96.0).matrix();
  const Eigen::ArrayXd act =
      (0.25 * data.conditions.col(0).array()).sin() * (data.conditions.col(1).array() / 150.0).cos();
  data.y = 20.0 + act + 2.0 * hour / 96.0;
  data.y += 0.1 * normal_vector(n, 8);
  return data;
}

KernelModel smooth_model(Index n) {
  KernelPriors priors;
  priors.noise.sd = 0.1;
  return KernelModel(smooth_data(n), priors);
}

KernelParameters smooth_point(const Eigen::Vector4d& alpha, double amplitude, double lambda) {
  KernelParameters p;
  p.decay = -4.0 * alpha.array().log();
  p.amplitude = amplitude;
  p.lambda = lambda;
  return p;
}

std::vector<KernelParameters> smooth_points() {
  return {smooth_point({0.4, 0.6, 0.999, 0.9999}, 1.5, 100.0),
          smooth_point({0.8, 0.9, 0.95, 0.99}, 4.0, 90.0), smooth_point({0.99, 0.5, 0.9999, 1.0}, 0.3, 120.0),
          smooth_point({0.7, 0.99, 0.99, 0.999}, 20.0, 40.0)};
}

double relabelled_difference(const Target& a, const Target& b) {
  AisOptions options;
  options.pilot_chains = 64;
  options.groups = 3;
  options.max_groups = 3;
  options.importance_draws = 400;
  return std::abs(sample_ais(a, options, Context()).log_evidence -
                  sample_ais(b, options, Context()).log_evidence);
}

TEST(PivotedCholesky, RemainderIsPositiveAndWhatItsTraceSays) {
  for (Index n : {120, 500}) {  // the whole kernel, and blocks
    const MatrixXd x = 1.3 * uniform_matrix(n, 3, 21);
    PivotedCholesky cholesky(x);
    ASSERT_TRUE(cholesky.extend(1e-3, n));
    const MatrixXd left = gaussian_kernel(x, x) - cholesky.root() * cholesky.root().transpose();
    EXPECT_NEAR(left.trace(), cholesky.trace(), 1e-10);
    EXPECT_LE(cholesky.trace(), 1e-3);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<MatrixXd>(left).eigenvalues()[0], -1e-10);
    for (Index i : cholesky.pivots()) EXPECT_LT(left.col(i).cwiseAbs().maxCoeff(), 1e-8);
    const Index before = cholesky.rank();
    ASSERT_TRUE(cholesky.extend(1e-6, n));
    EXPECT_GT(cholesky.rank(), before);
    EXPECT_FALSE(PivotedCholesky(x).extend(1e-6, before));
  }
}

TEST(PivotedCholesky, MemoryUsedBeforeChangesNothing) {
  PivotedCholesky used;
  for (Index n : {200, 120, 500, 80}) {
    const MatrixXd x = 1.3 * uniform_matrix(n, 3, 23);
    PivotedCholesky fresh(x);
    ASSERT_TRUE(fresh.extend(1e-4, n));
    used.start(x);
    ASSERT_TRUE(used.extend(1e-4, n));
    EXPECT_EQ(used.pivots(), fresh.pivots());
    EXPECT_EQ(used.root(), fresh.root());
    EXPECT_EQ(used.trace(), fresh.trace());
  }
}

TEST(PivotedCholesky, BlocksCostLittleRank) {
  const Index n = 600;
  const MatrixXd x = 2.0 * uniform_matrix(n, 2, 22);
  PivotedCholesky blocks(x);
  blocks.extend(1e-4, n);
  // One pivot at a time, always the worst.
  MatrixXd left = gaussian_kernel(x, x);
  Index rank = 0;
  for (Index pivot = 0; left.trace() > 1e-4; ++rank) {
    left.diagonal().maxCoeff(&pivot);
    const VectorXd column = left.col(pivot) / std::sqrt(left(pivot, pivot));
    left -= column * column.transpose();
  }
  EXPECT_LE(blocks.rank(), 1.15 * static_cast<double>(rank));
}

TEST(PivotedCholesky, EqualRowsEndInRounding) {
  const MatrixXd x = MatrixXd::Ones(300, 2);
  PivotedCholesky cholesky(x);
  EXPECT_TRUE(cholesky.extend(0.0, 300));
  EXPECT_EQ(cholesky.rank(), 1);
}

TEST(LowRankKernel, ExactValueLiesWithinTheBounds) {
  const KernelModel model = smooth_model(420);
  for (const KernelParameters& p : smooth_points()) {
    const double exact = model.log_likelihood(p);
    for (double tolerance : {1.0, 0.01}) {
      for (Certificate certificate : {Certificate::determinant, Certificate::both}) {
        const auto v = low_rank_likelihood(model, p, tolerance, certificate, model.size());
        ASSERT_TRUE(v.has_value());
        EXPECT_GE(exact, v->value - v->below - 1e-7);
        EXPECT_LE(exact, v->value + v->above + 1e-7);
        EXPECT_LE(v->below + (certificate == Certificate::both ? v->above : 0.0), tolerance);
      }
    }
    EXPECT_FALSE(low_rank_likelihood(model, p, 1e-6, Certificate::both, 5).has_value());
    KernelModel::Memory memory;
    EXPECT_EQ(bounded_likelihood(model, p, 0.01, Certificate::both, memory).value, exact);  // short: dense
  }
}

TEST(LowRankKernel, LongRecordsTakeTheLowRank) {
  const KernelModel model = smooth_model(900);
  for (const KernelParameters& p : smooth_points()) {
    KernelModel::Memory memory;
    const BoundedValue v = bounded_likelihood(model, p, 0.01, Certificate::both, memory);
    EXPECT_NEAR(v.value, model.log_likelihood(p), 0.01);
    EXPECT_GT(v.below, 0.0);
  }
}

TEST(KernelSkeleton, ServesSmootherKernelsAtAnyLength) {
  KernelSkeleton::Memory memory;  // of both lengths
  for (Index n : {300, 900}) {
    const KernelModel model = smooth_model(n);
    const KernelParameters rough = smooth_point({0.4, 0.5, 0.95, 0.99}, 20.0, 120.0);
    const auto skeleton = KernelSkeleton::make(model, rough.decay, 20.0 * 120.0, 0.001, n);
    ASSERT_TRUE(skeleton.has_value());
    for (const KernelParameters& p : smooth_points()) {
      const bool inside = (p.decay.array() <= rough.decay.array()).all() && p.amplitude * p.lambda <= 2400.0;
      EXPECT_EQ(skeleton->serves(p), inside);
      // Interpolation is not certified: many times the tolerance where the model fits badly.
      if (inside) {
        EXPECT_NEAR(skeleton->log_likelihood(p, memory), model.log_likelihood(p), 0.05);
      }
    }
    EXPECT_TRUE(skeleton->serves(smooth_points()[2]));
    EXPECT_FALSE(KernelSkeleton::make(model, rough.decay, 2400.0, 0.01, 10).has_value());
  }
}

TEST(KernelModel, ThinnedModelsKeepTheScales) {
  const KernelModel model = smooth_model(240);
  const KernelParameters p = smooth_points()[0];
  EXPECT_NEAR(model.thinned(1).log_likelihood(p), model.log_likelihood(p), 1e-8);
  const KernelModel half = model.thinned(2);
  EXPECT_EQ(half.size(), 120);
  EXPECT_EQ(half.columns().row(7), model.columns().row(14));
  EXPECT_LT((half.orthonormal().transpose() * half.outside()).cwiseAbs().maxCoeff(), 1e-10);
}

// The same posterior annealed from the prior with dense values; four standard errors of the difference.
TEST(KernelSampling, EvidenceIsThatOfTheDenseSampler) {
  const KernelModel model = smooth_model(160);
  AisOptions options;
  const AisResult dense = sample_ais(KernelTarget(model), options, Context());
  const KernelSample fast = sample_kernel(model, options, {}, Context());
  EXPECT_TRUE(trusted(fast.posterior.outcome)) << in_words(fast.posterior.outcome);
  EXPECT_NEAR(fast.posterior.log_evidence, dense.log_evidence,
              4 * std::hypot(fast.posterior.standard_error, dense.standard_error));
  EXPECT_LT(fast.largest_error, 0.1);
  EXPECT_GT(fast.by_skeleton, fast.direct);
  EXPECT_LT(fast.direct + fast.by_skeleton + fast.coarse, dense.evaluations);
  // Likelihoods of the draws are those seen from the prior.
  const VectorXd again = KernelTarget(model).log_likelihood(fast.posterior.draws.leftCols(10));
  EXPECT_LT((again - fast.posterior.log_likelihood.head(10)).cwiseAbs().maxCoeff(), 0.1);
}

TEST(KernelSampling, CrudeValuesAreCorrected) {
  const KernelModel model = smooth_model(240);
  KernelSamplingOptions crude;
  crude.tolerance = 1.0;
  crude.certified = 200;
  const KernelSample fine = sample_kernel(model, {}, {}, Context());
  const KernelSample rough = sample_kernel(model, {}, crude, Context());
  EXPECT_GT(rough.largest_error, 5 * fine.largest_error);
  EXPECT_NEAR(rough.posterior.log_evidence, fine.posterior.log_evidence,
              4 * std::hypot(fine.posterior.standard_error, rough.posterior.standard_error));
}

TEST(KernelSampling, ThreadsDoNotMatter) {
  const KernelModel model = smooth_model(150);
  Context two;
  two.threads = 2;
  const KernelSample a = sample_kernel(model, {}, {}, Context()), b = sample_kernel(model, {}, {}, two);
  EXPECT_EQ(a.posterior.log_evidence, b.posterior.log_evidence);
  EXPECT_EQ(a.posterior.draws, b.posterior.draws);
}

TEST(KernelSampling, ShortRecordsAreAnnealedFromThePrior) {
  const KernelModel model = smooth_model(60);
  const KernelSample sample = sample_kernel(model, {}, {}, Context());
  EXPECT_EQ(sample.posterior.log_evidence, sample_ais(KernelTarget(model), {}, Context()).log_evidence);
  KernelSamplingOptions bad;
  bad.tolerance = 0.0;
  EXPECT_THROW(sample_kernel(model, {}, bad, Context()), std::invalid_argument);
}

TEST(KernelTarget, NumberingAndOrderLeaveTheSampledEvidenceUnchanged) {
  const Index n = 60;
  const KernelData data = smooth_data(n);
  KernelData other = data;
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937_64(3));
  for (Index i = 0; i < n; ++i) {
    const Index from = order[static_cast<std::size_t>(i)];
    other.y[i] = data.y[from];
    other.fictitious[i] = data.fictitious[from];
    other.basis.row(i) = data.basis.row(from);
    other.conditions.row(i) << data.conditions(from, 2), data.conditions(from, 0), data.conditions(from, 1);
  }
  KernelPriors priors;
  priors.noise.sd = 0.1;
  const KernelModel a(data, priors), b(other, priors);
  EXPECT_LT(relabelled_difference(KernelTarget(a), KernelTarget(b)), 1e-8);
}

TEST(LowRankKernel, DiscrepancyIsTheDenseOneWithinItsTolerance) {
  const KernelModel model = smooth_model(700);
  const double tolerance = 1e-3;
  for (const KernelParameters& p : smooth_points()) {
    const KernelDiscrepancy dense = model.discrepancy(p);
    const auto low = low_rank_discrepancy(model, p, tolerance, 700);
    ASSERT_TRUE(low);
    const double left = (model.in_given_order(model.outside()) - dense.mean).norm();  // |w|
    EXPECT_LT((low->mean - dense.mean).norm(), tolerance * left);
    EXPECT_LT((low->variance - dense.variance).cwiseAbs().maxCoeff(), tolerance / p.lambda);
    EXPECT_GT(dense.variance.maxCoeff(), 10 * tolerance / p.lambda);
  }
  EXPECT_FALSE(low_rank_discrepancy(model, smooth_points()[1], 1e-6, 10));
}

TEST(LowRankKernel, DiscrepanciesOfSeveralDrawsDoNotHangOnTheThreads) {
  const KernelModel model = smooth_model(700);
  Context two;
  two.threads = 2;
  const auto one = discrepancies(model, smooth_points(), Context()),
             other = discrepancies(model, smooth_points(), two);
  ASSERT_EQ(one.size(), 4u);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].mean, other[i].mean);
    EXPECT_EQ(one[i].variance, other[i].variance);
    EXPECT_LT((one[i].mean - model.discrepancy(smooth_points()[i]).mean).norm(), 0.01 * one[i].mean.norm());
  }
}

}  // namespace
}  // namespace amiss
