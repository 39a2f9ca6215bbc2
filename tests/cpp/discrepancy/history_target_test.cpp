#include <gtest/gtest.h>

#include <boost/math/distributions/cauchy.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>

#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"
#include "history_helpers.hpp"

namespace amiss {
namespace {

using namespace test;

TEST(HistoryCoordinates, MapToThePriorsQuantiles) {
  HistoryPriors priors = make_priors();
  priors.discarded_variance = 0.03;
  const HistoryModel model(make_data(), priors, Context());
  const HistoryCoordinates coordinates(model, {0, 2});
  ASSERT_EQ(coordinates.dimension(), 1 + 2 + 1 + 2);
  // sigma^2 / sd^2 ~ F(2a*, 2a*); sqrt(t) ~ half-Cauchy(amplitude).
  const boost::math::fisher_f noise(2 * priors.noise_shape, 2 * priors.noise_shape);
  const double stated = priors.noise_sd * priors.noise_sd;
  const boost::math::cauchy cauchy(0.0, priors.amplitude);
  const boost::math::normal normal;
  for (double u : {0.03, 0.5, 0.9, 0.99}) {
    const HistoryParameters point = coordinates.parameters(VectorXd::Constant(6, quantile(normal, u)));
    EXPECT_NEAR(cdf(noise, (point.variance - 0.03) / stated), u, 1e-9);  // iterations of the quantile
    // With probability 1 - inclusion t = 0; else the half-Cauchy distribution.
    const double in_slab = (u - (1 - priors.inclusion)) / priors.inclusion;
    for (int s : {0, 2})
      EXPECT_NEAR(2 * cdf(cauchy, std::sqrt(point.t[s])) - 1, std::max(0.0, in_slab), 1e-9) << s;
    EXPECT_EQ(point.t[1], 0.0);
  }
  // The likelihood is continuous where the slab begins: t rises from zero.
  const double edge = quantile(normal, 1 - priors.inclusion);
  EXPECT_LT(coordinates.parameters(VectorXd::Constant(6, edge + 1e-6)).t[0], 1e-8);
}

TEST(HistoryCoordinates, ErrorComponentsAndReachChooseTheirOwnLevels) {
  const HistoryModel model = make_model();
  const HistoryCoordinates coordinates(model, {});
  const double third[] = {-1.0, 0.0, 1.0};  // within the lower, middle and upper third of N(0, 1)
  const HistoryPriors priors = make_priors();
  const VectorXd& ratios = priors.error.ratios;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      for (int k = 0; k < 3; ++k) {
        const int setting =
            coordinates.parameters(Eigen::Vector4d(0.2, third[a], third[b], third[k])).setting;
        EXPECT_EQ(priors.error.setting(model.error_of(setting)), Eigen::Vector2d(ratios[a], ratios[b]));
        EXPECT_EQ(model.reach_of(setting), priors.reach[static_cast<std::size_t>(k)]);
      }
    }
  }
  // Phi rounds to 1.
  EXPECT_EQ(coordinates.parameters(Eigen::Vector4d(0.0, 40.0, 40.0, 40.0)).setting, kSettings - 1);
}

TEST(HistoryCoordinates, OneReachHasNoCoordinate) {
  HistoryPriors priors = make_priors();
  priors.reach = {60.0};
  const HistoryModel model(make_data(), priors, Context());
  EXPECT_EQ(HistoryCoordinates(model, {1}).dimension(), 1 + 2 + 1);
}

TEST(HistoryTarget, LikelihoodIsTheDenseOneAtTheMappedPoint) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  const GaussianSimulator simulator = make_simulator();
  const HistoryTarget target(model, {1}, simulator);
  const MatrixXd x = normal_matrix(target.dimension(), 6, 44);
  const VectorXd values = target.log_likelihood(x);
  for (Index i = 0; i < x.cols(); ++i)
    EXPECT_NEAR(values[i],
                dense_density(data, target.parameters(x.col(i)), simulator.mean,
                              simulator.root * simulator.root.transpose()),
                kRounding * (1 + std::abs(values[i])));
}

TEST(HistoryTarget, GradientIsTheDerivative) {
  HistoryPriors priors = make_priors();
  priors.discarded_variance = 0.2;  // some of the noise, so that its part in the variance is seen
  const HistoryModel model(make_data(), priors, Context());
  const HistoryTarget target(model, {0, 2}, make_simulator());
  const Index d = target.dimension();
  for (unsigned seed = 1; seed <= 6; ++seed) {
    // The first condition in its slab, the second in the slab or the spike; away from the jumps of the grid.
    VectorXd x = 0.7 * normal_vector(d, 90 + seed);
    x[d - 2] = 1.2 + 0.1 * seed;
    MatrixXd gradient;
    const VectorXd value = target.log_likelihood(x, gradient);
    EXPECT_DOUBLE_EQ(value[0], target.log_likelihood(MatrixXd(x))[0]);
    const VectorXd expected =
        numerical_gradient([&](const VectorXd& v) { return target.log_likelihood(MatrixXd(v))[0]; }, x, 1e-6);
    // Differences of 1e-6 of values near 100 carry 1e-8 of rounding.
    for (Index i = 0; i < d; ++i)
      EXPECT_NEAR(gradient(i, 0), expected[i], 1e-5 * (1 + std::abs(expected[i]))) << i;
  }
}

TEST(HistoryTarget, ExtremeCoordinatesStayUsable) {
  const HistoryModel model = make_model();
  const HistoryTarget target(model, {0, 1, 2}, make_simulator());
  for (double x : {-40.0, 40.0}) {
    MatrixXd gradient;
    EXPECT_FALSE(std::isnan(target.log_likelihood(MatrixXd::Constant(7, 1, x), gradient)[0])) << x;
    EXPECT_FALSE(gradient.hasNaN()) << x;
  }
}

// Coordinates: sigma and one condition.
TEST(HistoryTarget, EvidenceEqualsQuadrature) {
  HistoryPriors priors = make_priors();
  priors.error = {};
  priors.reach = {60.0};
  const HistoryModel model(make_data(), priors, Context());
  const HistoryTarget target(model, {1}, make_simulator());
  const double truth = evidence_by_quadrature(target);
  const AisResult result = sample_ais(target, {}, Context());
  EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
  // Four reported standard errors, and in any case less than matters to a Bayes factor.
  EXPECT_LT(std::abs(result.log_evidence - truth), std::min(4 * result.standard_error, 0.15));
}

TEST(HistoryTarget, NumberingOfTheConditionsLeavesTheSampledEvidenceUnchanged) {
  const HistoryData data = make_data();
  HistoryData other = data;  // order 2, 0, 1
  other.responses << data.responses.rightCols(2), data.responses.leftCols(3);
  other.condition = {0, 0, 1, 1, 2};
  const HistoryModel a = make_model(data), b = make_model(other);
  const HistoryTarget first(a, {0, 1, 2}, make_simulator()), second(b, {0, 1, 2}, make_simulator());
  const VectorXd x = normal_vector(first.dimension(), 44);
  const VectorXd t = first.parameters(x).t, u = second.parameters(x).t;
  EXPECT_EQ(t[0], u[1]);
  EXPECT_EQ(t[1], u[2]);
  EXPECT_EQ(t[2], u[0]);
  AisOptions options;
  options.pilot_chains = 64;
  options.groups = options.max_groups = 3;
  // The same chains; only the order of the sums in the likelihood differs.
  EXPECT_NEAR(sample_ais(first, options, Context()).log_evidence,
              sample_ais(second, options, Context()).log_evidence, 1e-8);
}

}  // namespace
}  // namespace amiss
