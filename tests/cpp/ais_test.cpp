#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <limits>
#include <set>
#include <stdexcept>

#include "engine/ais/AnnealingPath.hpp"
#include "engine/ais/CloserReference.hpp"
#include "engine/ais/ImportanceSample.hpp"
#include "engine/ais/Sampler.hpp"
#include "engine/ais/SkewedMixture.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Context seeded(std::uint64_t seed, int threads = 1) {
  Context context;
  context.seed = seed;
  context.threads = threads;
  return context;
}

// y = A x + error of standard deviation s: evidence and posterior are known.
struct LinearGaussian {
  MatrixXd a;
  VectorXd y;
  double s;
  LinearGaussian(Index d, double sd) : a(normal_matrix(d + 4, d, 51)), s(sd) {
    y = a * normal_vector(d, 52) + s * normal_vector(d + 4, 53);
  }
  FunctionTarget target() const {
    return {a.cols(), [this](const VectorXd& x) {
              return -0.5 * (y - a * x).squaredNorm() / (s * s) -
                     static_cast<double>(y.size()) * (0.5 * kLogTwoPi + std::log(s));
            }};
  }
  double log_evidence() const {
    const MatrixXd noise = s * s * MatrixXd::Identity(y.size(), y.size());
    return log_normal_density(y, VectorXd::Zero(y.size()), a * a.transpose() + noise);
  }
  MatrixXd covariance() const {
    return (a.transpose() * a / (s * s) + MatrixXd::Identity(a.cols(), a.cols())).inverse();
  }
  VectorXd mean() const { return covariance() * a.transpose() * y / (s * s); }
};

// Four reported standard errors hold with certainty for practical purposes, and the error itself has to be
// far below a factor of two in a Bayes factor (0.69 nat).
void expect_evidence(const AisResult& result, double truth, double most = 0.15) {
  EXPECT_LT(std::abs(result.log_evidence - truth), 4 * result.standard_error);
  EXPECT_LT(std::abs(result.log_evidence - truth), most);
}

TEST(SampleAis, EvidenceOfLinearGaussianModels) {
  for (Index d : {3, 10}) {
    const LinearGaussian model(d, 0.3);
    const AisResult result = sample_ais(model.target(), {}, seeded(1));
    EXPECT_TRUE(result.trusted) << result.verdict;
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
  EXPECT_EQ(result.estimator, "annealed");
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
  int trusted = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const AisResult result = sample_ais(target, {}, seeded(seed));
    if (!result.trusted) continue;
    ++trusted;
    EXPECT_LT(std::abs(result.log_evidence - truth), 4 * result.standard_error + 0.05) << "seed " << seed;
  }
  EXPECT_GE(trusted, 5);  // this case is not hard enough to be refused most of the time
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
    if (result.trusted) {
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
      if (result.trusted) {
        EXPECT_TRUE(std::isfinite(result.standard_error)) << "seed " << seed << ": " << result.verdict;
        EXPECT_TRUE(std::isfinite(result.ess)) << "seed " << seed << ": " << result.verdict;
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

// The same posterior with its gradient.
class GradientTarget : public FunctionTarget {
 public:
  GradientTarget(const LinearGaussian& model, double slope)
      : FunctionTarget(model.target()), model_(model), slope_(slope) {}
  bool has_gradient() const override { return true; }
  using FunctionTarget::log_likelihood;
  VectorXd log_likelihood(const MatrixXd& x, MatrixXd& gradient) const override {
    gradient = slope_ * model_.a.transpose() * ((-model_.a * x).colwise() + model_.y) / (model_.s * model_.s);
    return log_likelihood(x);
  }

 private:
  const LinearGaussian& model_;
  double slope_;
};

TEST(SampleAis, HamiltonianMovesLeaveThePosteriorAsItIs) {
  const LinearGaussian model(6, 0.3);
  AisOptions options;
  options.importance_draws = 0;
  options.groups = 32;
  // A wrong gradient makes poor moves, but none that Metropolis' rule does not correct.
  for (double slope : {1.0, 0.7}) {
    const AisResult result = sample_ais(GradientTarget(model, slope), options, seeded(24));
    expect_evidence(result, model.log_evidence(), 0.4);
    // 1000 draws of some hundred effective ones: four of their standard errors, the posterior standardised.
    const Eigen::LLT<MatrixXd> factor(model.covariance());
    const VectorXd z = factor.matrixL().solve(result.draws * result.weights - model.mean());
    EXPECT_LT(z.cwiseAbs().maxCoeff(), 4 / std::sqrt(result.ess / 4)) << slope;
  }
}

TEST(SampleAis, HamiltonianMovesReachFurther) {
  // 30 parameters: fitted proposals of 256 chains are rough, and short steps are needed without a gradient.
  const LinearGaussian model(30, 0.3);
  AisOptions options;
  options.importance_draws = 0;
  options.max_groups = options.groups;
  double with = 0.0, without = 0.0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    options.gradient = true;
    with += std::pow(
        sample_ais(GradientTarget(model, 1.0), options, seeded(seed)).annealed - model.log_evidence(), 2);
    options.gradient = false;
    without += std::pow(
        sample_ais(GradientTarget(model, 1.0), options, seeded(seed)).annealed - model.log_evidence(), 2);
  }
  EXPECT_LT(with, without);
}

TEST(SampleAis, CountsEveryEvaluationWithGradients) {
  const LinearGaussian model(3, 0.3);
  long count = 0;
  class Counting : public GradientTarget {
   public:
    Counting(const LinearGaussian& m, long& n) : GradientTarget(m, 1.0), n_(n) {}
    VectorXd log_likelihood(const MatrixXd& x) const override {
      n_ += x.cols();
      return GradientTarget::log_likelihood(x);
    }
    VectorXd log_likelihood(const MatrixXd& x, MatrixXd& gradient) const override {
      return GradientTarget::log_likelihood(x, gradient);  // counted by the value it asks for
    }

   private:
    long& n_;
  };
  const Counting target(model, count);
  EXPECT_EQ(sample_ais(target, {}, seeded(25)).evaluations, count);
}

// Two blocks of one posterior, the second a mixture of two.
CloserReference two_blocks(double prior_share) {
  const VectorXd low = Eigen::Vector2d(-1.0, 0.4), high = Eigen::Vector2d(0.8, 0.0);
  const MatrixXd root = (MatrixXd(2, 2) << 0.5, 0.0, 0.2, 0.3).finished();
  return {{StudentTMixture({StudentT(VectorXd::Constant(1, 0.6), MatrixXd::Constant(1, 1, 0.4), 8.0)}, {1.0}),
           StudentTMixture({StudentT(low, root, 5.0), StudentT(high, 2.0 * root, 5.0)}, {0.3, 0.7})},
          prior_share};
}

TEST(StandardNormal, HasTheDensityGradientAndDrawsOfThePrior) {
  const StandardNormal prior(3);
  const VectorXd x = normal_vector(3, 70);
  EXPECT_NEAR(prior.log_density(x), log_normal_density(x, VectorXd::Zero(3), MatrixXd::Identity(3, 3)),
              1e-13);
  EXPECT_EQ(prior.gradient(x), -x);
  Stream stream(1, 2, 3);
  std::vector<double> draws;
  for (int i = 0; i < 3000; ++i) {
    const VectorXd x = prior.draw(stream);
    draws.insert(draws.end(), x.data(), x.data() + 3);
  }
  // Kolmogorov's statistic exceeds 1.95 / sqrt(n) with probability 0.001.
  EXPECT_LT(kolmogorov_distance(draws, &normal_cdf), 1.95 / std::sqrt(9000.0));
}

TEST(CloserReference, DensityIsThePriorsMixedWithTheProductOfTheBlocks) {
  const CloserReference closer = two_blocks(0.2);
  const VectorXd low = Eigen::Vector2d(-1.0, 0.4), high = Eigen::Vector2d(0.8, 0.0);
  const MatrixXd root = (MatrixXd(2, 2) << 0.5, 0.0, 0.2, 0.3).finished();
  const MatrixXd x = normal_matrix(3, 6, 71);
  for (Index i = 0; i < 6; ++i) {
    const VectorXd at = x.col(i), second = at.tail(2);
    const double prior = std::exp(-0.5 * at.squaredNorm() - 1.5 * kLogTwoPi);
    const double one = std::exp(
        StudentT(VectorXd::Constant(1, 0.6), MatrixXd::Constant(1, 1, 0.4), 8.0).log_density(at.head(1)));
    const double two = 0.3 * std::exp(StudentT(low, root, 5.0).log_density(second)) +
                       0.7 * std::exp(StudentT(high, 2.0 * root, 5.0).log_density(second));
    EXPECT_NEAR(closer.log_density(at), std::log(0.2 * prior + 0.8 * one * two), 1e-12);
    const VectorXd slope = numerical_gradient([&](const VectorXd& v) { return closer.log_density(v); }, at);
    EXPECT_LT((closer.gradient(at) - slope).cwiseAbs().maxCoeff(), 1e-7);  // differences of 1e-5, squared
  }
  // Far out only the heavier tail is left, and nothing overflows.
  const VectorXd far = VectorXd::Constant(3, 300.0);
  EXPECT_TRUE(std::isfinite(closer.log_density(far)));
  EXPECT_TRUE(closer.gradient(far).allFinite());
}

// Independent draws of the reference, weighted by posterior over reference: their mean is the evidence.
TEST(CloserReference, DrawsHaveTheStatedDensity) {
  const LinearGaussian model(3, 1.0);
  const FunctionTarget target = model.target();
  for (double share : {0.1, 0.6}) {
    const CloserReference closer(
        {StudentTMixture({StudentT(model.mean().head(1), MatrixXd::Constant(1, 1, 0.5), 8.0)}, {1.0}),
         StudentTMixture({StudentT(model.mean().tail(2), 0.4 * MatrixXd::Identity(2, 2), 8.0)}, {1.0})},
        share);
    Stream stream(1, 2, 3);
    VectorXd log_w(20000);
    for (Index i = 0; i < log_w.size(); ++i) {
      const VectorXd x = closer.draw(stream);
      log_w[i] = target.log_likelihood(MatrixXd(x))[0] + StandardNormal::at(x)[0] - closer.log_density(x);
    }
    const double se = std::sqrt(normalised_exp(log_w).squaredNorm() - 1.0 / 20000);
    EXPECT_LT(se, 0.05);
    EXPECT_NEAR(log_mean_exp(log_w), model.log_evidence(), 4 * se);
  }
}

TEST(CloserReference, RefusesAShareThatIsNone) {
  EXPECT_THROW(two_blocks(0.0), std::invalid_argument);
  EXPECT_THROW(two_blocks(1.0), std::invalid_argument);
  EXPECT_THROW(two_blocks(std::nan("")), std::invalid_argument);
  EXPECT_THROW(StudentTMixture({}, {}), std::invalid_argument);
}

// Where the close distribution is wrong, the share of the prior is what the annealing lives on.
TEST(SampleAis, AWrongReferenceDoesNotMoveTheEvidence) {
  const LinearGaussian model(3, 0.3);
  const CloserReference wrong(
      {StudentTMixture({StudentT(model.mean().array() + 2.0, 0.1 * MatrixXd::Identity(3, 3), 8.0)}, {1.0})});
  const AisResult result = sample_ais(model.target(), wrong, {}, seeded(26));
  EXPECT_TRUE(result.trusted) << result.verdict;
  expect_evidence(result, model.log_evidence());
}

TEST(SampleAis, AGoodReferenceSavesEvaluations) {
  const LinearGaussian model(10, 0.1);
  const FunctionTarget target = model.target();
  const Eigen::LLT<MatrixXd> root(model.covariance());
  const CloserReference close({StudentTMixture({StudentT(model.mean(), root.matrixL(), 8.0)}, {1.0})});
  const AisResult from_prior = sample_ais(target, {}, seeded(27));
  const AisResult result = sample_ais(target, close, {}, seeded(27));
  expect_evidence(result, model.log_evidence());
  EXPECT_LT(4 * result.ladder.size(), from_prior.ladder.size());
  EXPECT_LT(2 * result.evaluations, from_prior.evaluations);
}

// The annealed run alone, whose chains go from the reference to the posterior.
TEST(SampleAis, EvidenceAndLikelihoodsAreTheTargetsWhateverTheReference) {
  const LinearGaussian model(4, 0.3);
  const GradientTarget target(model, 1.0);
  const auto around = [&](double width) {
    return StudentTMixture({StudentT(model.mean(), width * MatrixXd::Identity(4, 4), 8.0)}, {1.0});
  };
  const StudentTMixture near = around(0.2);
  const CloserReference mixed({around(0.05)}, 0.3);
  const StandardNormal prior(4);
  AisOptions options;
  options.importance_draws = 0;
  options.groups = 24;
  for (const Distribution* reference : std::vector<const Distribution*>{&near, &mixed, &prior}) {
    for (bool gradient : {true, false}) {
      options.gradient = gradient;
      const AisResult result = sample_ais(target, *reference, options, seeded(28));
      ASSERT_EQ(result.estimator, "annealed");
      expect_evidence(result, model.log_evidence(), 0.4);
      EXPECT_EQ(result.log_likelihood, target.log_likelihood(result.draws));
      // Some hundred effective draws: four of their standard errors, the posterior standardised.
      const Eigen::LLT<MatrixXd> factor(model.covariance());
      const VectorXd z = factor.matrixL().solve(result.draws * result.weights - model.mean());
      EXPECT_LT(z.cwiseAbs().maxCoeff(), 4 / std::sqrt(result.ess / 4)) << gradient;
    }
  }
}

TEST(SampleAis, WithoutAReferenceItStartsFromThePrior) {
  const LinearGaussian model(3, 0.3);
  const FunctionTarget target = model.target();
  EXPECT_EQ(sample_ais(target, {}, seeded(29)).log_evidence,
            sample_ais(target, StandardNormal(3), {}, seeded(29)).log_evidence);
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

TEST(Context, ForksOfAllSeedsAndPurposesAreUnrelated) {
  std::set<std::uint64_t> seeds;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const Context context = seeded(seed);
    seeds.insert(seed);
    for (std::uint64_t purpose = 0; purpose < 60; ++purpose) {
      seeds.insert(context.fork(purpose).seed);
      seeds.insert(context.fork(purpose).fork(purpose / 2).seed);
    }
  }
  EXPECT_EQ(seeds.size(), 60u * (1 + 2 * 60));  // none twice: seed 2 forked is not seed 1's second purpose
  EXPECT_NE(Stream(seeded(2).fork(0).seed, 1, 0).uniform(), Stream(seeded(1).fork(1).seed, 1, 0).uniform());
}

TEST(Context, AForkKeepsThreadsAndPolls) {
  int polled = 0;
  Context context = seeded(3, 2);
  context.poll = [&] { ++polled; };
  const Context fork = context.fork(5);
  EXPECT_EQ(fork.threads, 2);
  fork.poll();
  EXPECT_EQ(polled, 1);
  EXPECT_EQ(context.alone().threads, 1);
  EXPECT_EQ(context.alone().seed, 3u);
}

// Two thin shells: no Student-t mixture comes close, and the chains move slowly at the cold end.
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
  EXPECT_EQ(result.estimator, "importance");
  EXPECT_LE(result.standard_error, 0.01);
  EXPECT_GE(sample_ais(model.target(), {}, seeded(22)).standard_error, result.standard_error);
  EXPECT_LT(std::abs(result.log_evidence - model.log_evidence()), 0.04);  // four standard errors
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

TEST(AisOptions, NumbersOfChainsFollowTheDimension) {
  const AisOptions few = AisOptions().for_dimension(2), many = AisOptions().for_dimension(40);
  EXPECT_EQ(few.chains, 32);
  EXPECT_EQ(few.pilot_chains, 256);
  EXPECT_EQ(many.chains, 120);
  EXPECT_EQ(many.pilot_chains, 640);
  EXPECT_EQ(few.sweeps, 3);
  AisOptions own;
  own.chains = 5;
  own.sweeps = 0;
  own.max_sweeps = 2;
  EXPECT_EQ(own.for_dimension(40).chains, 5);
  EXPECT_EQ(own.for_dimension(40).sweeps, 2);
}

TEST(AisOptions, RefusesImpossibleValues) {
  const FunctionTarget flat(1, [](const VectorXd&) { return 0.0; });
  for (auto spoil :
       {+[](AisOptions& o) { o.groups = 1; }, +[](AisOptions& o) { o.chains = 3; },
        +[](AisOptions& o) { o.sweeps = -1; }, +[](AisOptions& o) { o.sweeps = 31; },
        +[](AisOptions& o) { o.max_sweeps = 0; }, +[](AisOptions& o) { o.max_groups = 7; },
        +[](AisOptions& o) { o.precision = 0.0; }, +[](AisOptions& o) { o.pilot_chains = 7; },
        +[](AisOptions& o) { o.ess_drop = 1.0; }, +[](AisOptions& o) { o.importance_draws = -1; },
        +[](AisOptions& o) { o.importance_draws = 1; }, +[](AisOptions& o) { o.max_components = 0; }}) {
    AisOptions options;
    spoil(options);
    EXPECT_THROW(sample_ais(flat, options, Context()), std::invalid_argument);
  }
}

// -- Student t
// ---------------------------------------------------------------------------------------------------

const VectorXd kLocation = Eigen::Vector2d(1.0, -2.0);
const MatrixXd kRoot = (Eigen::Matrix2d() << 1.5, 0.0, -0.8, 0.6).finished();
constexpr double kDof = 4.0;

// Draws of two coordinates: minus the logarithm of a uniform one, and a normal one.
MatrixXd exponential_and_normal(Index n) {
  MatrixXd x = normal_matrix(2, n, 81);
  Stream stream(1, 7, 1);
  for (Index i = 0; i < n; ++i) x(0, i) = -std::log(stream.uniform());
  return x;
}

TEST(SkewMap, SendsQuantilesToNormalOnesAndBack) {
  const Index n = 4001;
  const MatrixXd x = exponential_and_normal(n);
  const SkewMap map = SkewMap::fit(x, VectorXd::Constant(n, 1.0 / n));
  for (double p : {0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98}) {
    VectorXd first = x.row(0);
    std::sort(first.data(), first.data() + n);
    // Between neighbours in rank, which lie 0.013 apart at the 98 % quantile, scaled by the slope there.
    const VectorXd at = Eigen::Vector2d(first[static_cast<Index>(p * n)], 0.0);
    EXPECT_NEAR(normal_cdf(map.even(at)(0)), p, 0.002) << p;
  }
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd z = 2.0 * normal_vector(2, 82 + i), at = map.skewed(z);
    EXPECT_LT((map.even(at) - z).norm(), 1e-12);
    // Off the knots a line is its own difference quotient.
    const VectorXd step = VectorXd::Constant(2, 1e-6);
    EXPECT_LT(((map.even(at + step) - map.even(at - step)) / 2e-6 - map.slope(at)).norm(), 1e-8);
  }
}

TEST(SkewMap, WithoutPointsToTellChangesNothing) {
  const VectorXd at = normal_vector(3, 83);
  EXPECT_EQ(SkewMap().even(at), at);
  EXPECT_EQ(SkewMap().skewed(at), at);
  EXPECT_EQ(SkewMap().slope(at), VectorXd::Ones(3));
  MatrixXd x = normal_matrix(1, 200, 84);
  x.leftCols(100).setConstant(0.3);  // half of a population may be copies of one point
  const SkewMap map = SkewMap::fit(x, VectorXd::Constant(200, 1.0 / 200));
  EXPECT_EQ(map.slope(at.head(1))(0), 1.0);
}

TEST(SkewedMixture, DensityIntegratesToOneAndIsThatOfTheDraws) {
  const Index n = 2000;
  const MatrixXd x = exponential_and_normal(n).topRows(1);
  Stream stream(1, 7, 2);
  const auto mixture = SkewedMixture::fit(x, VectorXd::Constant(n, 1.0 / n), 2, 8.0, stream);
  const auto density = [&](double at) { return std::exp(mixture.log_density(VectorXd::Constant(1, at))); };
  const double step = 0.002;
  std::vector<double> cumulative = {0.0};
  for (double at = -10.0; at < 40.0; at += step)
    cumulative.push_back(cumulative.back() + step * density(at + 0.5 * step));
  // Midpoints see the steps of the density at seven knots to within one step of the grid.
  EXPECT_NEAR(cumulative.back(), 1.0, 0.002);
  std::vector<double> draws;
  for (int i = 0; i < 20000; ++i) draws.push_back(mixture.draw(stream)[0]);
  // Exceeded with probability 1e-4 (Kolmogorov), and the grid's error.
  EXPECT_LT(kolmogorov_distance(draws,
                                [&](double at) {
                                  const double k = std::clamp((at + 10.0) / step, 0.0, 25000.0);
                                  return cumulative[static_cast<std::size_t>(k)];
                                }),
            2.23 / std::sqrt(20000.0) + 0.003);
}

TEST(SkewedMixture, GradientIsThatOfTheDensity) {
  const MatrixXd x = exponential_and_normal(500);
  Stream stream(1, 7, 3);
  const auto mixture = SkewedMixture::fit(x, VectorXd::Constant(500, 1.0 / 500), 2, 8.0, stream);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd at = 2.0 * normal_vector(2, 85 + i);
    const VectorXd expected =
        numerical_gradient([&](const VectorXd& z) { return mixture.log_density(z); }, at);
    EXPECT_LT((mixture.gradient(at) - expected).norm(), 1e-7);
  }
}

// A likelihood that cuts every coordinate off on one side, some softly: by symmetry the evidence is 2^-d.
FunctionTarget one_sided(Index d) {
  return {d, [](const VectorXd& x) {
            double sum = 0.0;
            for (Index j = 0; j < x.size(); ++j)
              sum += std::log(std::max(normal_cdf((2.0 + 4.0 * static_cast<double>(j)) * x[j]), 1e-300));
            return sum;
          }};
}

TEST(SampleAis, SkewedMixturesComeCloserToOneSidedPosteriors) {
  const Index d = 6;
  AisOptions plain, skewed;
  skewed.skewed = true;
  double share[2];
  for (int k = 0; k < 2; ++k) {
    const AisResult result = sample_ais(one_sided(d), k == 0 ? plain : skewed, seeded(4));
    ASSERT_EQ(result.estimator, "importance");
    expect_evidence(result, -static_cast<double>(d) * std::log(2.0));
    share[k] = result.ess / static_cast<double>(result.draws.cols());
  }
  EXPECT_GT(share[1], 1.3 * share[0]);
}

TEST(SampleAis, ImportanceSampleGrowsUntilEnoughDrawsAreEffective) {
  AisOptions options;
  options.skewed = true;
  options.refit_draws = 200;
  options.effective_draws = 1500;
  const AisResult result = sample_ais(one_sided(6), options, seeded(5));
  ASSERT_EQ(result.estimator, "importance");
  EXPECT_GE(result.ess, 1500);
  EXPECT_LT(result.draws.cols(), 8000);  // no more than are needed at an effective share of a fifth
  expect_evidence(result, -6.0 * std::log(2.0));
  options.refit_draws = -1;
  EXPECT_THROW(sample_ais(one_sided(6), options, seeded(5)), std::invalid_argument);
}

// A mixture that gives a fiftieth of its mass to a lobe that holds a fifth of the posterior.
TEST(CloserMixture, ALobeGainsItsShareOfThePosterior) {
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
  long evaluations = 5;
  const SkewedMixture close = closer_mixture(target, poor, {}, {200}, seeded(11), stream, evaluations);
  EXPECT_EQ(evaluations, 805);
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

TEST(CloserMixture, StaysWhereTheLikelihoodIsZero) {
  const FunctionTarget nothing(2, [](const VectorXd&) { return -kInfinity; });
  const SkewedMixture mixture(
      SkewMap(), StudentTMixture({StudentT(VectorXd::Zero(2), MatrixXd::Identity(2, 2), 5.0)}, {1.0}));
  Stream stream(12, 7, 5);
  long evaluations = 0;
  const SkewedMixture same = closer_mixture(nothing, mixture, {}, {100}, seeded(12), stream, evaluations);
  EXPECT_EQ(evaluations, 100);
  EXPECT_EQ(same.log_density(VectorXd::Ones(2)), mixture.log_density(VectorXd::Ones(2)));
}

TEST(StudentT, DensityInOneDimensionIsStudents) {
  const boost::math::students_t t(5.0);
  const StudentT own(VectorXd::Constant(1, 2.0), MatrixXd::Constant(1, 1, 3.0), 5.0);
  for (double x : {-20.0, 0.0, 2.0, 5.5}) {
    EXPECT_NEAR(own.log_density(VectorXd::Constant(1, x)), std::log(pdf(t, (x - 2.0) / 3.0) / 3.0), 1e-12)
        << x;
  }
}

TEST(StudentT, DensityInTwoDimensionsIsMarginalTimesConditional) {
  const MatrixXd scale = kRoot * kRoot.transpose();
  const StudentT own(kLocation, kRoot, kDof);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd x = 2.0 * normal_vector(2, 60 + i);
    const double d = (x[0] - kLocation[0]) / std::sqrt(scale(0, 0));
    const double marginal = pdf(boost::math::students_t(kDof), d) / std::sqrt(scale(0, 0));
    // Roth (2013): the conditional is a t with one more degree of freedom.
    const double centre = kLocation[1] + scale(1, 0) / scale(0, 0) * (x[0] - kLocation[0]);
    const double width =
        std::sqrt((kDof + d * d) / (kDof + 1) * (scale(1, 1) - scale(1, 0) * scale(1, 0) / scale(0, 0)));
    const double conditional = pdf(boost::math::students_t(kDof + 1), (x[1] - centre) / width) / width;
    EXPECT_NEAR(own.log_density(x), std::log(marginal * conditional), 1e-12);
  }
}

// Kolmogorov distances of both coordinates and of a slanted one, each in units in which it is a standard t.
void expect_student(const std::vector<VectorXd>& points) {
  const boost::math::students_t t(kDof);
  for (const VectorXd& direction :
       {VectorXd(Eigen::Vector2d(1, 0)), VectorXd(Eigen::Vector2d(0, 1)), VectorXd(Eigen::Vector2d(1, 2))}) {
    const double width = (kRoot.transpose() * direction).norm();
    std::vector<double> z;
    for (const VectorXd& x : points) z.push_back(direction.dot(x - kLocation) / width);
    // Exceeded with probability 1e-4 (Kolmogorov).
    EXPECT_LT(kolmogorov_distance(z, [&](double x) { return cdf(t, x); }),
              2.23 / std::sqrt(static_cast<double>(z.size())));
  }
}

TEST(StudentT, GradientIsThatOfTheDensity) {
  const StudentT own(kLocation, kRoot, kDof);
  MatrixXd x = 0.5 * normal_matrix(2, 400, 75);
  x.leftCols(100).row(0).array() += 3.0;
  Stream stream(1, 1, 5);
  const auto mixture = StudentTMixture::fit(x, VectorXd::Constant(400, 1.0 / 400), 3, 8.0, stream);
  ASSERT_EQ(mixture.size(), 2u);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd at = 2.0 * normal_vector(2, 76 + i);
    // Central differences of step 1e-5 are right to about 1e-9 here.
    const auto check = [&](const auto& density) {
      const VectorXd expected =
          numerical_gradient([&](const VectorXd& z) { return density.log_density(z); }, at);
      EXPECT_LT((density.gradient(at) - expected).norm(), 1e-7);
    };
    check(own);
    check(mixture);
  }
}

TEST(StudentT, DrawsHaveTheDistribution) {
  const StudentT own(kLocation, kRoot, kDof);
  Stream stream(1, 2, 3);
  std::vector<VectorXd> points;
  for (int i = 0; i < 40000; ++i) points.push_back(own.draw(stream));
  expect_student(points);
}

TEST(StudentT, StepLeavesTheDistributionAsItIs) {
  const StudentT own(kLocation, kRoot, kDof);
  for (double s : {0.2, 0.7, 1.0}) {
    Stream stream(1, 2, 4);
    std::vector<VectorXd> points;
    for (int i = 0; i < 40000; ++i) {
      VectorXd x = own.draw(stream);
      for (int k = 0; k < 3; ++k) x = own.step(x, s, stream).to;
      points.push_back(x);
    }
    expect_student(points);
  }
}

TEST(StudentT, StepIsReversible) {
  const StudentT own(kLocation, kRoot, kDof);
  Stream stream(1, 2, 5);
  const auto radius = [&](const VectorXd& x) {
    return kRoot.triangularView<Eigen::Lower>().solve(x - kLocation).norm();
  };
  int outwards = 0, inwards = 0;
  for (int i = 0; i < 200000; ++i) {
    const VectorXd x = own.draw(stream), y = own.step(x, 0.6, stream).to;
    outwards += radius(x) < 1.0 && radius(y) > 2.0 ? 1 : 0;
    inwards += radius(x) > 2.0 && radius(y) < 1.0 ? 1 : 0;
  }
  ASSERT_GT(outwards, 1000);
  // Given their sum, one of both counts is Binomial(sum, 1/2): 4 standard deviations of the difference.
  EXPECT_LT(std::abs(outwards - inwards), 4 * std::sqrt(static_cast<double>(outwards + inwards)));
}

TEST(StudentT, ShortStepsStayClose) {
  const StudentT own(kLocation, kRoot, kDof);
  Stream stream(1, 2, 6);
  for (int i = 0; i < 100; ++i) EXPECT_LT((own.step(kLocation, 1e-6, stream).to - kLocation).norm(), 1e-3);
}

TEST(StudentT, FitMatchesWeightedMomentsShrunkTowardsTheDiagonal) {
  const MatrixXd x = kRoot * normal_matrix(2, 9, 61);
  const VectorXd raw = uniform_matrix(9, 1, 62), weights = raw / raw.sum();
  const VectorXd mean = x * weights;
  MatrixXd scale = (x.colwise() - mean) * weights.asDiagonal() * (x.colwise() - mean).transpose();
  const double points = 1 / weights.squaredNorm(), shrink = points / (points + 2);
  scale(0, 1) *= shrink;
  scale(1, 0) *= shrink;
  const StudentT expected(mean, scale.llt().matrixL(), 6.0), own = StudentT::fit(x, weights, 6.0);
  for (unsigned i = 0; i < 5; ++i) {
    const VectorXd at = normal_vector(2, 63 + i);
    EXPECT_NEAR(own.log_density(at), expected.log_density(at), 1e-10);
  }
}

TEST(StudentTMixture, FindsTwoSeparateComponents) {
  MatrixXd x = 0.5 * normal_matrix(2, 400, 71);
  x.leftCols(100).row(0).array() += 6.0;
  Stream stream(1, 1, 1);
  const auto mixture = StudentTMixture::fit(x, VectorXd::Constant(400, 1.0 / 400), 3, 8.0, stream);
  ASSERT_EQ(mixture.size(), 2u);
  // A quarter of the mass lies in the component on the right; Binomial(4000, 1/4), 4 standard deviations.
  int right = 0;
  for (int i = 0; i < 4000; ++i) right += mixture.draw(stream)[0] > 3.0 ? 1 : 0;
  EXPECT_NEAR(right, 1000, 110);
}

TEST(StudentTMixture, OneComponentServesOneCluster) {
  Stream stream(1, 1, 2);
  EXPECT_EQ(
      StudentTMixture::fit(normal_matrix(3, 400, 72), VectorXd::Constant(400, 1.0 / 400), 3, 8.0, stream)
          .size(),
      1u);
}

TEST(StudentTMixture, WeightsOfThePointsCount) {
  MatrixXd x = 0.5 * normal_matrix(1, 400, 73);
  x.leftCols(200).array() += 6.0;
  VectorXd weights = VectorXd::Constant(400, 1.0);
  weights.head(200).setConstant(9.0);
  weights /= weights.sum();
  Stream stream(1, 1, 3);
  const auto mixture = StudentTMixture::fit(x, weights, 2, 8.0, stream);
  ASSERT_EQ(mixture.size(), 2u);
  const VectorXd left = VectorXd::Zero(1), right = VectorXd::Constant(1, 6.0);
  // Densities at the centres stand as 9 to 1; scales of clusters estimated from 200 points differ by 10 % or
  // less.
  EXPECT_NEAR(mixture.log_density(right) - mixture.log_density(left), std::log(9.0), 0.25);
}

TEST(StudentTMixture, DensityIsNormalised) {
  MatrixXd x = 0.5 * normal_matrix(1, 300, 74);
  x.leftCols(100).array() += 5.0;
  Stream stream(1, 1, 4);
  const auto mixture = StudentTMixture::fit(x, VectorXd::Constant(300, 1.0 / 300), 3, 8.0, stream);
  // Substitution x = tan(a) maps the line onto (-pi/2, pi/2).
  const int n = 200000;
  const double pi = std::acos(-1.0), h = pi / n;
  double total = 0.0;
  for (int i = 1; i < n; ++i) {
    const double a = -pi / 2 + h * i;
    total += std::exp(mixture.log_density(VectorXd::Constant(1, std::tan(a)))) / std::pow(std::cos(a), 2) * h;
  }
  EXPECT_NEAR(total, 1.0, 1e-6);
}

TEST(LogSumExp, IsSafeForLargeSmallAndInfiniteValues) {
  EXPECT_NEAR(log_sum_exp(Eigen::Vector2d(1000.0, 1000.0)), 1000.0 + std::log(2.0), 1e-12);
  EXPECT_NEAR(log_sum_exp(Eigen::Vector3d(-2000.0, -kInfinity, -2000.0 + std::log(3.0))),
              -2000.0 + std::log(4.0), 1e-12);
  EXPECT_EQ(log_sum_exp(Eigen::Vector2d(-kInfinity, -kInfinity)), -kInfinity);
  EXPECT_NEAR(log_mean_exp(Eigen::Vector2d(std::log(1.0), std::log(3.0))), std::log(2.0), 1e-15);
  const VectorXd share = normalised_exp(Eigen::Vector2d(-800.0, -800.0 + std::log(3.0)));
  EXPECT_NEAR(share[0], 0.25, 1e-12);
  EXPECT_NEAR(share[1], 0.75, 1e-12);
}

}  // namespace
}  // namespace amiss
