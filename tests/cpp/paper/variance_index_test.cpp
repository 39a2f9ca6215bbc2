#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>

#include "engine/ais/Sampler.hpp"
#include "engine/attribution/VarianceIndex.hpp"
#include "kernel_model_helpers.hpp"

namespace amiss {
namespace {

using namespace test;

TEST(HighestDensityInterval, ShortestIntervalOfKnownDraws) {
  const Index n = 100;
  // Exponential quantiles: the densest 95 % are the 95 smallest.
  const VectorXd u = VectorXd::LinSpaced(n, 0.005, 0.995);
  const VectorXd x = -(1.0 - u.array()).log();
  const Interval one = highest_density_interval(x, VectorXd::Ones(n), 0.95);
  EXPECT_EQ(one.lower, x[0]);
  EXPECT_EQ(one.upper, x[94]);
  const Interval mirror = highest_density_interval(-x.reverse(), VectorXd::Constant(n, 0.2), 0.95);
  EXPECT_EQ(mirror.lower, -x[94]);
  EXPECT_EQ(mirror.upper, -x[0]);
  const Interval half = highest_density_interval(x, VectorXd::Ones(n), 0.5);
  EXPECT_EQ(half.lower, x[0]);
  EXPECT_EQ(half.upper, x[49]);
}

TEST(HighestDensityInterval, WeightsCount) {
  VectorXd x(6), w(6);
  x << 9.0, 1.0, 2.0, 2.1, 2.2, -50.0;
  w << 0.02, 0.4, 0.3, 0.2, 0.08, 0.0;
  const Interval own = highest_density_interval(x, w, 0.95);
  EXPECT_EQ(own.lower, 1.0);
  EXPECT_EQ(own.upper, 2.2);
  const Interval all = highest_density_interval(x, w, 0.99);
  EXPECT_EQ(all.lower, 1.0);  // the draw without weight stays out
  EXPECT_EQ(all.upper, 9.0);
  EXPECT_THROW(highest_density_interval(x, VectorXd::Zero(6), 0.95), std::invalid_argument);
  EXPECT_THROW(highest_density_interval(x, w, 1.0), std::invalid_argument);
  EXPECT_THROW(highest_density_interval(x, w.head(5), 0.95), std::invalid_argument);
}

// v_s = H'zeta_s H (H'(zeta_s + I / lambda*) H)^-1 v with an explicit complement.
VectorXd dense_shares(const KernelData& data, const KernelParameters& p) {
  const MatrixXd h = complement(data.basis);
  const VectorXd v = h.transpose() * data.y;
  VectorXd shares(data.count() + 1);
  for (int s = 0; s <= data.count(); ++s) {
    const MatrixXd zeta = h.transpose() * dense_kernel(data, p, s) * h;
    const MatrixXd seen = zeta + MatrixXd::Identity(h.cols(), h.cols()) / p.lambda;
    shares[s] = (zeta * seen.ldlt().solve(v)).squaredNorm() / v.squaredNorm();
  }
  return shares;
}

TEST(VarianceIndex, SharesEqualTheDenseOnes) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  for (const KernelParameters& p : make_points()) {
    const VectorXd own = variance_shares(model, p), dense = dense_shares(data, p);
    EXPECT_LT((own - dense).cwiseAbs().maxCoeff(), 1e-7) << own.transpose() << " and " << dense.transpose();
  }
}

TEST(VarianceIndex, ShareGrowsWithThePrecisionOfTheNoise) {
  // A record without noise is explained in full by the condition that drives it, one of all noise not at all.
  KernelData data = make_data();
  const KernelModel model = make_model(data);
  double before = -1.0;
  for (double lambda : {1e-8, 0.1, 10.0, 1e8}) {
    const double share =
        variance_shares(model, make_point(Eigen::Vector4d(1e-12, 0.9, 0.9, 0.9), 0.5, lambda))[0];
    EXPECT_GT(share, before);
    before = share;
    if (lambda < 1e-7) {
      EXPECT_LT(share, 1e-6);
    }
  }
  EXPECT_GT(before, 0.9);
}

TEST(VarianceIndex, ConditionThatActsNotAtAllHasNoShare) {
  const VectorXd shares = variance_shares(make_model(), make_points()[3]);
  EXPECT_LT(shares.maxCoeff(), 1e-12);
}

TEST(VarianceIndex, PlantedEffectIsSignificantAndFirst) {
  const Index n = 90;
  KernelData data;
  data.basis = VectorXd::Ones(n);
  data.conditions = uniform_matrix(n, 3, 55);
  data.condition = {0, 1, 2};
  data.fictitious = fictitious_condition(n, 4);
  data.y = 20.0 + (3.0 * data.conditions.col(1).array()).sin() + 0.1 * normal_vector(n, 56).array();
  KernelPriors priors;
  priors.noise = {0.1, 9.0};
  const KernelModel model(data, priors);
  const KernelTarget target(model);
  AisOptions options;
  options.importance_draws = 400;
  const AisResult result = sample_ais(target, options, Context());
  EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
  std::vector<KernelParameters> draws;
  for (Index i = 0; i < result.draws.cols(); ++i) draws.push_back(target.parameters(result.draws.col(i)));
  const VarianceIndex index = variance_index(model, draws, result.weights, 0.95, Context());
  // The planted part is the variance of the sine over that of y outside the mean.
  const double planted = 1.0 - 0.01 * n / model.outside().squaredNorm();
  EXPECT_NEAR(index.median[1], planted, 0.04);
  EXPECT_EQ(index.rank[1], 1);
  EXPECT_TRUE(index.significant[1]);
  EXPECT_GT(index.hdi[1].lower, 0.8);
  for (Index s : {0, 2}) {
    EXPECT_FALSE(index.significant[static_cast<std::size_t>(s)]) << s;
    EXPECT_LT(std::abs(index.median[s]), 0.05);
  }
  EXPECT_EQ(std::accumulate(index.rank.begin(), index.rank.end(), 0), 6);

  Context two;
  two.threads = 2;
  EXPECT_EQ(variance_index(model, draws, result.weights, 0.95, two).share, index.share);
}

TEST(VarianceIndex, DifferencesSummaryAndRankAreThoseOfTheDraws) {
  const KernelModel model = make_model();
  const std::vector<KernelParameters> draws = make_points();
  const VectorXd weights = Eigen::Vector4d(0.5, 0.3, 0.2, 0.0);
  const VarianceIndex index = variance_index(model, draws, weights, 0.9, Context());
  for (Index i = 0; i < 4; ++i) {
    const VectorXd shares = variance_shares(model, draws[static_cast<std::size_t>(i)]);
    for (Index s = 0; s < 3; ++s) EXPECT_EQ(index.difference(i, s), shares[s] - shares[3]);
  }
  for (Index s = 0; s < 3; ++s) {
    EXPECT_NEAR(index.mean[s], index.difference.col(s).dot(weights), 1e-14);
    const Interval hdi = highest_density_interval(index.difference.col(s), weights, 0.9);
    EXPECT_EQ(index.hdi[s].lower, hdi.lower);
    EXPECT_EQ(index.hdi[s].upper, hdi.upper);
    EXPECT_EQ(index.significant[s], hdi.lower > 0 || hdi.upper < 0);
    int larger = 0;
    for (Index r = 0; r < 3; ++r) larger += index.median[r] > index.median[s] ? 1 : 0;
    EXPECT_EQ(index.rank[s], larger + 1);
  }
}

}  // namespace
}  // namespace amiss
