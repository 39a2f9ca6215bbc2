#include <gtest/gtest.h>

#include <cmath>

#include "ais_helpers.hpp"

namespace amiss {
namespace {

using namespace test;

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

}  // namespace
}  // namespace amiss
