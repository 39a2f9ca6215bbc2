#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <thread>

#include "ais_helpers.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

TEST(SampleAis, EvidenceOfLinearGaussianModels) {
  for (Index d : {3, 10}) {
    const LinearGaussian model(d, 0.3);
    const AisResult result = sample_ais(model.target(), {}, seeded(1));
    EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
    expect_evidence(result, model.log_evidence());
    EXPECT_LT(std::abs(result.annealed - model.log_evidence()), 4 * result.annealed_se + 0.05) << d;
    EXPECT_LT(std::abs(result.second - model.log_evidence()), 4 * result.second_se + 0.02) << d;
  }
}

TEST(SampleAis, DrawsHaveThePosteriorsMomentsAndLikelihoods) {
  const LinearGaussian model(3, 0.3);
  AisOptions options;
  options.chains = 250;
  options.importance_draws = 2000;
  const FunctionTarget target = model.target();
  const AisResult result = sample_ais(target, options, seeded(2));
  EXPECT_NEAR(result.weights.sum(), 1.0, 1e-12);
  const VectorXd mean = result.draws * result.weights;
  const MatrixXd centred = result.draws.colwise() - mean;
  const MatrixXd covariance = centred * result.weights.asDiagonal() * centred.transpose();
  // Monte Carlo errors of 1000 effective draws: 1 / sqrt(1000) of a standard deviation for means, sqrt(2 /
  // 1000) for variances; 4.5 of them, the posterior standardised.
  ASSERT_GT(result.ess, 1000);
  const Eigen::LLT<MatrixXd> factor(model.covariance());
  const VectorXd z = factor.matrixL().solve(mean - model.mean());
  EXPECT_LT(z.cwiseAbs().maxCoeff(), 0.142);
  const MatrixXd half = factor.matrixL().solve(covariance);
  const MatrixXd standard = factor.matrixL().solve(half.transpose());
  EXPECT_LT((standard - MatrixXd::Identity(3, 3)).cwiseAbs().maxCoeff(), 0.2);
  EXPECT_EQ(result.log_likelihood, target.log_likelihood(result.draws));
}

TEST(SampleAis, OneAndTwoThreadsGiveTheSameBits) {
  const LinearGaussian model(4, 0.5);
  const AisResult a = sample_ais(model.target(), {}, seeded(3, 1)),
                  b = sample_ais(model.target(), {}, seeded(3, 2));
  EXPECT_EQ(a.log_evidence, b.log_evidence);
  EXPECT_EQ(a.lower, b.lower);
  EXPECT_EQ(a.upper, b.upper);
  EXPECT_EQ(a.draws, b.draws);
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(a.evaluations, b.evaluations);
}

TEST(SampleAis, PollsOnTheCallingThreadOnly) {
  const LinearGaussian model(4, 0.5);
  AisOptions options;
  options.chains = 16;  // one block, so that a group of chains evaluates it on its own thread
  for (int threads : {1, 2}) {
    Context context = seeded(3, threads);
    const auto caller = std::this_thread::get_id();
    std::atomic<int> polls{0}, elsewhere{0};
    context.poll = [&] { ++(std::this_thread::get_id() == caller ? polls : elsewhere); };
    sample_ais(model.target(), options, context);
    EXPECT_GT(polls, 0);
    EXPECT_EQ(elsewhere, 0);
  }
}

// A target that counts how often it is asked, and for how many points at most.
class CountingTarget : public Target {
 public:
  explicit CountingTarget(Index block) : block_(block) {}
  Index dimension() const override { return 2; }
  Index block() const override { return block_; }
  VectorXd log_likelihood(const MatrixXd& x) const override {
    ++calls;
    largest = std::max(largest, x.cols());
    return -5 * (x.array() - 1).matrix().colwise().squaredNorm();
  }
  mutable long calls = 0;
  mutable Index largest = 0;

 private:
  Index block_;
};

TEST(SampleAis, ATargetIsAskedForAsManyPointsAsItWants) {
  AisOptions options;
  options.pilot_chains = 256;
  const CountingTarget few(16), all(100000);
  const AisResult a = sample_ais(few, options, seeded(3)), b = sample_ais(all, options, seeded(3));
  EXPECT_EQ(a.evaluations, b.evaluations);
  EXPECT_EQ(few.largest, 16);
  EXPECT_GE(all.largest, 256);
  EXPECT_LT(3 * all.calls, few.calls);
}

TEST(SampleAis, SeedsGiveDifferentRuns) {
  const LinearGaussian model(4, 0.5);
  EXPECT_NE(sample_ais(model.target(), {}, seeded(4)).annealed,
            sample_ais(model.target(), {}, seeded(5)).annealed);
}

TEST(SampleAis, CountsEveryEvaluation) {
  long count = 0;
  const FunctionTarget target(2, [&](const VectorXd& x) {
    ++count;
    return -5 * (x.array() - 1).matrix().squaredNorm();
  });
  EXPECT_EQ(sample_ais(target, {}, seeded(6)).evaluations, count);
}

TEST(SampleAis, LadderRisesToOneAndFlatLikelihoodNeedsOneStep) {
  const AisResult result = sample_ais(LinearGaussian(5, 0.1).target(), {}, seeded(7));
  double beta = 0.0;
  for (const Temperature& level : result.ladder) {
    EXPECT_GT(level.beta, beta);
    beta = level.beta;
    EXPECT_GT(level.acceptance, 0.1);
    EXPECT_LT(level.acceptance, 0.9);
    EXPECT_GT(level.ess, 0.2);
  }
  EXPECT_EQ(beta, 1.0);
  AisOptions annealed_only;
  annealed_only.importance_draws = 0;
  const AisResult flat =
      sample_ais(FunctionTarget(3, [](const VectorXd&) { return -2.5; }), annealed_only, seeded(7));
  EXPECT_EQ(flat.ladder.size(), 1u);
  EXPECT_NEAR(flat.annealed, -2.5, 1e-12);
  EXPECT_NEAR(flat.ess, static_cast<double>(flat.weights.size()), 1e-6);
}

TEST(SampleAis, PlainAisWithoutResamplingIsRightOnAnEasyTarget) {
  const LinearGaussian model(3, 0.8);
  AisOptions options;
  options.resample = false;
  options.ess_drop = 0.95;
  options.importance_draws = 0;
  const AisResult result = sample_ais(model.target(), options, seeded(8));
  EXPECT_EQ(result.estimator, Estimator::annealed);
  EXPECT_TRUE(std::isnan(result.second));
  expect_evidence(result, model.log_evidence(), 0.3);
  EXPECT_GT(result.weights.maxCoeff(), result.weights.minCoeff());
  EXPECT_LT((result.draws * result.weights - model.mean()).cwiseAbs().maxCoeff(), 0.3);
}

TEST(SampleAis, TwoModesAreRightOrNotTrusted) {
  // Modes of unequal mass at 6 and more of their own standard deviations from one another.
  const Eigen::Vector2d first(2.0, 1.0), second(-2.0, 0.0);
  const double s = 0.35, v = s * s;
  const FunctionTarget target(2, [=](const VectorXd& x) {
    return log_sum_exp(Eigen::Vector2d(std::log(0.3) - 0.5 * (x - first).squaredNorm() / v,
                                       std::log(0.7) - 0.5 * (x - second).squaredNorm() / v)) -
           kLogTwoPi - std::log(v);
  });
  const MatrixXd wide = (1 + v) * MatrixXd::Identity(2, 2);
  const double truth = std::log(0.3 * std::exp(log_normal_density(first, VectorXd::Zero(2), wide)) +
                                0.7 * std::exp(log_normal_density(second, VectorXd::Zero(2), wide)));
  int reliable = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const AisResult result = sample_ais(target, {}, seeded(seed));
    if (!trusted(result.outcome)) continue;
    ++reliable;
    EXPECT_LT(std::abs(result.log_evidence - truth), 4 * result.standard_error + 0.05) << "seed " << seed;
  }
  EXPECT_GE(reliable, 5);  // this case is not hard enough to be refused most of the time
}

TEST(SampleAis, LikelihoodOfZeroOnHalfTheSpace) {
  for (double nothing : {-kInfinity, std::numeric_limits<double>::quiet_NaN()}) {
    const FunctionTarget half(2, [=](const VectorXd& x) { return x[0] > 0 ? 0.0 : nothing; });
    const AisResult plain = sample_ais(half, {}, seeded(9));
    expect_evidence(plain, std::log(0.5));
    const double dead = (plain.draws.row(0).transpose().array() <= 0.0).select(plain.weights, 0.0).sum();
    EXPECT_LT(dead, 1e-300);  // Eigen's exp(-infinity) is the smallest normal number, not zero
    // The same with a normal likelihood, symmetric about the border.
    const double s = 0.4;
    const FunctionTarget narrow(
        2, [=](const VectorXd& x) { return x[0] > 0 ? -0.5 * x.squaredNorm() / (s * s) : nothing; });
    expect_evidence(sample_ais(narrow, {}, seeded(9)), std::log(0.5) - std::log1p(1 / (s * s)));
  }
}

// Likelihood 1 on 3 % of the prior: many a group of four chains starts with no chain alive.
FunctionTarget small_region() {
  return {1, [](const VectorXd& x) { return x[0] > 1.8808 ? 0.0 : -kInfinity; }};
}

TEST(SampleAis, GroupsWithoutAChainAliveLeaveTheResultUsable) {
  for (bool resampled : {true, false}) {
    AisOptions options;
    options.groups = 40;
    options.chains = 4;
    options.resample = resampled;
    const AisResult result = sample_ais(small_region(), options, seeded(10));
    EXPECT_TRUE(result.weights.allFinite()) << "resampling " << resampled;
    EXPECT_NEAR(result.weights.sum(), 1.0, 1e-9);
    EXPECT_TRUE(std::isfinite(result.ess));
    EXPECT_FALSE(std::isnan(result.standard_error));
    for (const Temperature& level : result.ladder) {
      EXPECT_GE(level.acceptance, 0.0);
      EXPECT_LE(level.acceptance, 1.0);
      EXPECT_GE(level.ess, 0.0);
      EXPECT_LE(level.ess, 1.0);
    }
    const double dead = (result.draws.row(0).transpose().array() < 1.88).select(result.weights, 0.0).sum();
    EXPECT_LT(dead, 1e-300);  // Eigen's exp(-infinity) is the smallest normal number, not zero
    if (trusted(result.outcome)) {
      EXPECT_LT(std::abs(result.log_evidence - std::log(0.03)), 4 * result.standard_error);
    }
  }
}

// What is said about a run in which most groups died must not be that it can be trusted.
TEST(SampleAis, NotANumberIsNeverTrusted) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    AisOptions options;
    options.groups = 4;
    options.chains = 4;
    options.importance_draws = 0;
    try {
      const AisResult result = sample_ais(small_region(), options, seeded(seed));
      if (trusted(result.outcome)) {
        EXPECT_TRUE(std::isfinite(result.standard_error))
            << "seed " << seed << ": " << in_words(result.outcome);
        EXPECT_TRUE(std::isfinite(result.ess)) << "seed " << seed << ": " << in_words(result.outcome);
      }
    } catch (const std::runtime_error&) {  // every group died: said plainly
    }
  }
}

TEST(SampleAis, NothingButZeroLikelihoodIsAnError) {
  const FunctionTarget never(2, [](const VectorXd&) { return -kInfinity; });
  EXPECT_THROW(sample_ais(never, {}, seeded(1)), std::runtime_error);
}

int seeds_covered(const AisOptions& options) {
  const LinearGaussian model(2, 0.4);
  const double truth = model.log_evidence();
  int covered = 0;
  for (std::uint64_t seed = 101; seed <= 140; ++seed) {
    const AisResult result = sample_ais(model.target(), options, seeded(seed));
    EXPECT_LT(result.lower, result.upper);
    covered += result.lower <= truth && truth <= result.upper ? 1 : 0;
  }
  return covered;
}

TEST(SampleAis, StatedIntervalCoversTheTruth) {
  // Binomial(40, 0.95) falls below 33 with probability 0.003.
  EXPECT_GE(seeds_covered({}), 33);
}

TEST(SampleAis, BootstrapIntervalCoversTheTruth) {
  AisOptions options;
  options.importance_draws = 0;
  options.groups = 16;
  // A percentile interval of 16 values covers about 0.93; Binomial(40, 0.93) falls below 31 with probability
  // 0.002.
  EXPECT_GE(seeds_covered(options), 31);
}

TEST(SampleAis, StatedStandardErrorIsThatOfRepeatedRuns) {
  const LinearGaussian model(2, 0.4);
  AisOptions options;
  options.importance_draws = 0;
  VectorXd values(40), stated(40);
  for (int i = 0; i < 40; ++i) {
    const AisResult result = sample_ais(model.target(), options, seeded(200 + static_cast<std::uint64_t>(i)));
    values[i] = result.annealed;
    stated[i] = result.annealed_se;
  }
  const double actual = std::sqrt((values.array() - values.mean()).square().sum() / 39);
  // A standard deviation of 40 values is known to 11 %, the mean stated one to 5 %; 4 of both together.
  EXPECT_NEAR(std::sqrt(stated.squaredNorm() / 40) / actual, 1.0, 0.5);
}

TEST(SamplePopulation, DrawsHaveThePosteriorsMoments) {
  const LinearGaussian model(4, 0.3);
  AisOptions options;
  options.pilot_chains = 1000;
  long evaluations = 7;
  const MatrixXd draws =
      sample_population(model.target(), StandardNormal(4), options, seeded(30), evaluations);
  ASSERT_EQ(draws.cols(), 1000);
  EXPECT_GE(evaluations, 7 + 1000);
  const Eigen::LLT<MatrixXd> factor(model.covariance());
  const MatrixXd z = factor.matrixL().solve(draws.colwise() - model.mean());
  // Chains that share ancestors: four standard errors of 250 independent draws.
  EXPECT_LT(z.rowwise().mean().cwiseAbs().maxCoeff(), 4 / std::sqrt(250.0));
  EXPECT_LT((z * z.transpose() / 1000.0 - MatrixXd::Identity(4, 4)).cwiseAbs().maxCoeff(),
            4 * std::sqrt(2.0 / 250.0));
}

// Two thin shells: no mixture comes close, and the chains move slowly at the cold end.
FunctionTarget shells(Index d) {
  return {d, [d](const VectorXd& x) {
            const VectorXd z = 6.0 * x;
            const double beyond = z.tail(d - 1).squaredNorm();
            const auto shell = [&](double centre) {
              const double r = std::sqrt(beyond + std::pow(z[0] - centre, 2)) - 2.0;
              return -0.5 * r * r / 0.01;
            };
            return log_sum_exp(Eigen::Vector2d(shell(-3.5), shell(3.5)));
          }};
}

TEST(SampleAis, GroupsAreAddedUntilTheStandardErrorIsAsAsked) {
  AisOptions options;
  options.importance_draws = 0;
  options.precision = 10.0;
  const AisResult once = sample_ais(shells(3), options, seeded(21));
  options.precision = 0.08;
  const AisResult refined = sample_ais(shells(3), options, seeded(21));
  ASSERT_GT(once.standard_error, 0.08);
  EXPECT_LE(refined.standard_error, 0.08);
  EXPECT_GT(refined.draws.cols(), once.draws.cols());
  EXPECT_EQ(refined.draws.leftCols(once.draws.cols()), once.draws);  // what was run is kept
  options.max_groups = 16;
  EXPECT_LE(sample_ais(shells(3), options, seeded(21)).draws.cols(), 16 * 32);
}

TEST(SampleAis, MoreImportanceDrawsAreAddedUntilTheStandardErrorIsAsAsked) {
  AisOptions options;
  options.precision = 0.01;
  const LinearGaussian model(3, 0.3);
  const AisResult result = sample_ais(model.target(), options, seeded(22));
  EXPECT_EQ(result.estimator, Estimator::importance);
  EXPECT_LE(result.standard_error, 0.01);
  EXPECT_GE(sample_ais(model.target(), {}, seeded(22)).standard_error, result.standard_error);
  EXPECT_LT(std::abs(result.log_evidence - model.log_evidence()), 0.04);  // four standard errors
}

TEST(SampleAis, NoMoreImportanceDrawsAreAddedAtOnceThanWereAsked) {
  AisOptions options;
  options.importance_draws = 50;
  options.effective_draws = 1e300;  // never reached: sixteen times those asked for are the most
  const LinearGaussian model(3, 0.3);
  const AisResult result = sample_ais(model.target(), options, seeded(22));
  EXPECT_EQ(result.estimator, Estimator::importance);
  EXPECT_EQ(result.draws.cols(), 16 * 50);
}

TEST(SampleAis, ThePilotFindsHowManyMovesAreNeeded) {
  AisOptions options;
  options.importance_draws = 0;
  const auto most = [&](const Target& target) {
    int sweeps = 0;
    for (const Temperature& level : sample_ais(target, options, seeded(23)).ladder)
      sweeps = std::max(sweeps, level.sweeps);
    return sweeps;
  };
  EXPECT_EQ(most(LinearGaussian(3, 0.5).target()), 3);
  // A narrow mode at every whole number: proposals fitted to all of them are far too wide for one.
  const int many = most(FunctionTarget(
      2, [](const VectorXd& x) { return 100.0 * (std::cos(2 * kPi * x[0]) + std::cos(2 * kPi * x[1])); }));
  EXPECT_GT(many, 5);
  EXPECT_LE(many, 30);
}

}  // namespace
}  // namespace amiss
