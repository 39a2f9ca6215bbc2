#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ais_helpers.hpp"
#include "engine/ais/PopulationMonteCarlo.hpp"
#include "engine/ais/Sampler.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

// A likelihood that cuts every coordinate off on one side, some softly: by symmetry the evidence is 2^-d.
FunctionTarget one_sided(Index d) {
  return {d, [](const VectorXd& x) {
            double sum = 0.0;
            for (Index j = 0; j < x.size(); ++j)
              sum += std::log(std::max(normal_cdf((2.0 + 4.0 * static_cast<double>(j)) * x[j]), 1e-300));
            return sum;
          }};
}

// Elliptic mixtures reach an effective share of 0.2.
TEST(SampleAis, SkewedMixturesComeCloseToOneSidedPosteriors) {
  const Index d = 6;
  const AisResult result = sample_ais(one_sided(d), {}, seeded(4));
  ASSERT_EQ(result.estimator, Estimator::importance);
  expect_evidence(result, -static_cast<double>(d) * std::log(2.0));
  EXPECT_GT(result.ess, 0.35 * static_cast<double>(result.draws.cols()));
}

// Eight coordinates: a ridge bent into a parabola, a thirtieth as wide as long.
TEST(SampleAis, MixturesFollowABentRidge) {
  const Index d = 8;
  const double width = 0.03;
  const FunctionTarget bent{d, [=](const VectorXd& x) {
                              const double across = (x[1] - 0.5 * (x[0] * x[0] - 1.0)) / width;
                              const double others = x.tail(d - 2).squaredNorm() / (width * width);
                              return 0.5 * x.tail(d - 1).squaredNorm() - 0.5 * (across * across + others) -
                                     static_cast<double>(d - 1) * std::log(width);
                            }};
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const AisResult result = sample_ais(bent, {}, seeded(seed));
    EXPECT_EQ(result.estimator, Estimator::importance);
    expect_evidence(result, 0.0);
  }
}

TEST(SampleAis, ImportanceSampleGrowsUntilEnoughDrawsAreEffective) {
  AisOptions options;
  options.refit_draws = 200;
  options.effective_draws = 1500;
  const AisResult result = sample_ais(one_sided(6), options, seeded(5));
  ASSERT_EQ(result.estimator, Estimator::importance);
  EXPECT_GE(result.ess, 1500);
  EXPECT_LT(result.draws.cols(), 8000);  // no more than are needed at an effective share of a fifth
  expect_evidence(result, -6.0 * std::log(2.0));
  options.refit_draws = -1;
  EXPECT_THROW(sample_ais(one_sided(6), options, seeded(5)), std::invalid_argument);
}

// Draws that know only a part of the posterior: the mixture fitted to them has no estimate, those after it
// do.
TEST(PopulationMonteCarlo, RoundsReachWhatTheFirstDrawsMiss) {
  const Index d = 4;
  const double sd = 0.2;
  const FunctionTarget target{d, [=](const VectorXd& x) {
                                return 0.5 * x.squaredNorm() - 0.5 * x.squaredNorm() / (sd * sd) -
                                       static_cast<double>(d) * std::log(sd);
                              }};
  const Context context = seeded(3);
  Stream stream(3, 0, 0);
  PopulationMonteCarlo population(target, context, stream);
  population.add((0.3 * sd * stream.normals(d, 400)).colwise() + VectorXd::Constant(d, sd));
  const ImportanceSample sample = population.sample({});
  EXPECT_GT(sample.ess, 500);
  EXPECT_LT(std::abs(sample.log_evidence), 4 * sample.se);
}

// A mixture that gives a fiftieth of its mass to a lobe that holds a fifth of the posterior.
TEST(PopulationMonteCarlo, ALobeGainsItsShareOfThePosterior) {
  const VectorXd here = Eigen::Vector2d(-0.5, 0.0), there = Eigen::Vector2d(1.2, 0.0);
  const double scale = 0.5;
  const auto log_lobe = [&](const VectorXd& x, const VectorXd& at) {
    return log_normal_density(x, at, scale * scale * MatrixXd::Identity(2, 2));
  };
  const FunctionTarget target(2, [&](const VectorXd& x) {
    const double log_prior = -0.5 * x.squaredNorm() - kLogTwoPi;
    return log_mean_exp(
               Eigen::Vector2d(std::log(1.6) + log_lobe(x, here), std::log(0.4) + log_lobe(x, there))) -
           log_prior;
  });
  const MatrixXd root = scale * MatrixXd::Identity(2, 2);
  const SkewedMixture poor(
      SkewMap(), StudentTMixture({StudentT(here, root, 5.0), StudentT(there, root, 5.0)}, {0.98, 0.02}));
  Stream stream(11, 7, 5);
  const Context context = seeded(11);
  PopulationMonteCarlo population(target, context, stream);
  const SkewedMixture close = population.closer(poor, {200});
  EXPECT_EQ(population.evaluations(), 800);
  int in_lobe = 0;
  const int n = 4000;
  for (int i = 0; i < n; ++i) in_lobe += close.draw(stream)[0] > 0.25;
  // Three standard deviations of a share of a quarter among 300 effective draws, and of that of the 4000. The
  // mixture that it starts from has 0.11 there.
  const double share =
      0.8 * normal_cdf((here[0] - 0.25) / scale) + 0.2 * normal_cdf((there[0] - 0.25) / scale);
  EXPECT_NEAR(in_lobe / static_cast<double>(n), share, 3.0 * 0.43 * std::sqrt(1.0 / 300 + 1.0 / n));
  ImportanceSample before, after;
  before.extend(target, poor, 2000, seeded(11), stream);
  after.extend(target, close, 2000, seeded(11), stream);
  EXPECT_LT(before.ess, 0.6 * 2000);
  EXPECT_GT(after.ess, 0.75 * 2000);
  EXPECT_LT(std::abs(after.log_evidence), 4.0 * after.se);  // the posterior above is normalised
}

TEST(PopulationMonteCarlo, StaysWhereTheLikelihoodIsZero) {
  const FunctionTarget nothing(2, [](const VectorXd&) { return -kInfinity; });
  const SkewedMixture mixture(
      SkewMap(), StudentTMixture({StudentT(VectorXd::Zero(2), MatrixXd::Identity(2, 2), 5.0)}, {1.0}));
  Stream stream(12, 7, 5);
  const Context context = seeded(12);
  PopulationMonteCarlo population(nothing, context, stream);
  const SkewedMixture same = population.closer(mixture, {100});
  EXPECT_EQ(population.evaluations(), 100);
  EXPECT_EQ(same.log_density(VectorXd::Ones(2)), mixture.log_density(VectorXd::Ones(2)));
}

}  // namespace
}  // namespace amiss
