#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "ais_helpers.hpp"
#include "engine/ais/CloserReference.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using namespace test;

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
  EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
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
      ASSERT_EQ(result.estimator, Estimator::annealed);
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

}  // namespace
}  // namespace amiss
