#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "ais_helpers.hpp"
#include "engine/ais/Chains.hpp"
#include "engine/ais/Pilot.hpp"
#include "engine/ais/StandardNormal.hpp"

namespace amiss {
namespace {

using namespace test;

// A winding ridge, x_2 about 2 sin 2 x_1 with a precision that x_0 decides; x_1 and x_2 are the last part.
// `slope` multiplies the gradient that is told.
class Ridge : public Target {
 public:
  explicit Ridge(double slope = 1.0, bool conditional = true) : slope_(slope), conditional_(conditional) {}
  Index dimension() const override { return 3; }
  std::vector<Index> parts() const override { return {1, 2}; }
  VectorXd log_likelihood(const MatrixXd& x) const override {
    return along(x.topRows(1)).log_likelihood(x.bottomRows(2));
  }
  bool has_conditional() const override { return conditional_; }
  std::unique_ptr<Conditional> along_last_part(const MatrixXd& x) const override {
    return std::make_unique<Along>(along(x.topRows(1)));
  }

 private:
  struct Along : Conditional {
    VectorXd precision;
    double slope;
    static Eigen::ArrayXd off(const MatrixXd& x) {
      return x.row(1).array() - 2.0 * (2.0 * x.row(0).array()).sin();
    }
    VectorXd log_likelihood(const MatrixXd& x) const override {
      return 0.5 * precision.array().log() - 0.5 * precision.array() * off(x).square();
    }
    MatrixXd gradient(const MatrixXd& x) const override {
      const Eigen::ArrayXd pull = slope * precision.array() * off(x);
      MatrixXd out(2, x.cols());
      out.row(0) = (4.0 * (2.0 * x.row(0).transpose().array()).cos() * pull).transpose();
      out.row(1) = -pull.transpose();
      return out;
    }
  };
  Along along(const MatrixXd& first) const {
    Along own;
    own.precision = (4.0 + first.row(0).transpose().array()).exp();
    own.slope = slope_;
    return own;
  }
  double slope_;
  bool conditional_;
};

// Evidence and variance of x_1, by the trapezoidal rule.
struct Truth {
  double log_evidence, variance;
  Truth() {
    constexpr int kSteps = 240;
    const double h = 12.0 / kSteps;
    double sum = 0.0, square = 0.0;
    MatrixXd x(3, kSteps + 1);
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; j <= kSteps; ++j) {
        const double x0 = -6 + i * h, x1 = -6 + j * h, sd = std::exp(-0.5 * (4.0 + x0));
        for (int k = 0; k <= kSteps; ++k) x.col(k) << x0, x1, 2.0 * std::sin(2.0 * x1) + sd * (-6 + k * h);
        const VectorXd density = (Ridge().log_likelihood(x) - 0.5 * x.colwise().squaredNorm().transpose() -
                                  VectorXd::Constant(kSteps + 1, 1.5 * kLogTwoPi))
                                     .array()
                                     .exp();
        sum += density.sum() * h * h * h * sd;
        square += x1 * x1 * density.sum() * h * h * h * sd;
      }
    }
    log_evidence = std::log(sum);
    variance = square / sum;
  }
};

double variance_of_second(const AisResult& result) {
  const VectorXd x = result.draws.row(1).transpose();
  const double mean = x.dot(result.weights);
  return (x.array() - mean).square().matrix().dot(result.weights);
}

TEST(ConditionalMove, LeavesThePosteriorAsItIs) {
  const Truth truth;
  AisOptions options;
  options.importance_draws = 0;
  options.groups = 64;
  // Too flat a gradient makes poor moves, but none that Metropolis' rule does not correct.
  for (double slope : {1.0, 0.6}) {
    const AisResult result = sample_ais(Ridge(slope), options, seeded(61));
    expect_evidence(result, truth.log_evidence);
    // Four standard errors of a variance of a quarter of the effective draws, of kurtosis three.
    EXPECT_NEAR(variance_of_second(result) / truth.variance, 1.0, 4 * std::sqrt(2.0 / (result.ess / 4)))
        << slope;
  }
}

TEST(ConditionalMove, KnowsTheOthersAndMovesOnlyTheLastPart) {
  const Ridge target;
  const StandardNormal reference(3);
  const AnnealingPath path{target, reference};
  Stream stream(62, 1, 0);
  Chains chains = Chains::start(path, 40, stream, Context());
  const MatrixXd before = chains.x;
  double moved = 0.0;
  for (int i = 0; i < 20; ++i)
    moved += conditional_move(path, chains, {0.3 * MatrixXd::Identity(2, 2), 0.1}, stream, Context()) / 20;
  EXPECT_GT(moved, 0.3);
  EXPECT_EQ(chains.x.row(0), before.row(0));
  EXPECT_GT((chains.x.bottomRows(2) - before.bottomRows(2)).cwiseAbs().maxCoeff(), 0.5);
  // What chains carry with them is that of where they are.
  EXPECT_LT((chains.ll - target.log_likelihood(chains.x)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((chains.reference - reference.log_densities(chains.x)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((chains.rise - chains.ll).cwiseAbs().maxCoeff(), 1e-12);  // from the prior
}

TEST(ConditionalMove, GoesAlongCurves) {
  const Ridge target;
  const StandardNormal reference(3);
  const AnnealingPath path{target, reference};
  Stream stream(64, 1, 0);
  Chains chains = Chains::start(path, 400, stream, Context());
  chains.x.setZero();  // all in the middle of the ridge
  chains.ll = target.log_likelihood(chains.x);
  chains.reference = reference.log_densities(chains.x);
  chains.rise = chains.ll;
  for (int i = 0; i < 400; ++i)
    conditional_move(path, chains, {MatrixXd::Identity(2, 2), 0.05}, stream, Context());
  // With x_0 = 0 the density of x_1 is phi(x_1) N(2 sin 2 x_1; 0, 1 + exp(-4)): a sum over a grid.
  const Eigen::ArrayXd grid = Eigen::ArrayXd::LinSpaced(2401, -6.0, 6.0);
  const Eigen::ArrayXd density =
      (-0.5 * grid.square() - 2.0 * (2.0 * grid).sin().square() / (1.0 + std::exp(-4.0))).exp();
  const double variance = (density * grid.square()).sum() / density.sum();
  const Eigen::ArrayXd x1 = chains.x.row(1).transpose().array();
  // Four standard errors of the variance of 400 draws, whose kurtosis is below four.
  EXPECT_NEAR((x1 - x1.mean()).square().mean() / variance, 1.0, 4 * std::sqrt(3.0 / 400));
}

TEST(ConditionalMove, OneAndTwoThreadsGiveTheSameBits) {
  const AisResult one = sample_ais(Ridge(), {}, seeded(63, 1)), two = sample_ais(Ridge(), {}, seeded(63, 2));
  EXPECT_EQ(one.log_evidence, two.log_evidence);
  EXPECT_EQ(one.draws, two.draws);
}

}  // namespace
}  // namespace amiss
