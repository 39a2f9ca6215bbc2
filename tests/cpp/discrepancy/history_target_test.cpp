#include <gtest/gtest.h>

#include <boost/math/distributions/cauchy.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>

#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"
#include "engine/linalg/constants.hpp"
#include "engine/linalg/log_sum_exp.hpp"
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

TEST(HistoryCoordinates, LeapsKeepTheVarianceOfTheErrorAndKnowTheirJacobian) {
  HistoryPriors priors = make_priors();
  priors.discarded_variance = 0.01;
  const HistoryModel model(make_data(), priors, Context());
  const HistoryCoordinates coordinates(model, {0});
  const auto whole = [&](const VectorXd& x) {
    const HistoryParameters point = coordinates.parameters(x);
    return point.variance * (1 + priors.error.setting(model.error_of(point.setting)).sum());
  };
  int leaps = 0;
  for (unsigned item = 0; item < 40; ++item) {
    const VectorXd from = normal_vector(coordinates.dimension(), 200 + item);
    const auto leap = [&](VectorXd x, double& log_jacobian) {
      Stream stream(1, 2, item);  // each time the same leap
      log_jacobian = coordinates.leap(x, stream);
      return x;
    };
    double log_jacobian = 0, other = 0;
    const VectorXd to = leap(from, log_jacobian);
    if (!std::isfinite(log_jacobian)) continue;
    ++leaps;
    EXPECT_NEAR(whole(to), whole(from), 1e-9 * whole(from));
    EXPECT_NE(coordinates.parameters(to).setting, coordinates.parameters(from).setting);
    MatrixXd jacobian(from.size(), from.size());
    for (Index i = 0; i < from.size(); ++i) {
      const VectorXd step = 1e-5 * VectorXd::Unit(from.size(), i);
      jacobian.col(i) = (leap(from + step, other) - leap(from - step, other)) / 2e-5;
    }
    EXPECT_NEAR(std::log(std::abs(jacobian.determinant())), log_jacobian, 1e-6) << item;
    // One of the leaps from there is the way back.
    bool back = false;
    for (unsigned k = 0; k < 60 && !back; ++k) {
      Stream stream(1, 3, k);
      VectorXd x = to;
      const double again = coordinates.leap(x, stream);
      back = std::isfinite(again) && (x - from).norm() < 1e-8 && std::abs(again + log_jacobian) < 1e-8;
    }
    EXPECT_TRUE(back) << item;
  }
  EXPECT_GT(leaps, 15);
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

// A slow error with hardly any white noise, of which far more is stated: settings next to one another fit,
// each with a noise of its own, and no single coordinate leads from one to the other.
TEST(HistoryTarget, EvidenceOfErrorsThatJumpEqualsQuadrature) {
  constexpr Index kRows = 1000;
  HistoryData data;
  data.axis = even_axis(kRows);
  data.basis = VectorXd::Ones(kRows);
  data.responses = normal_matrix(kRows, 1, 3);
  data.condition = {0};
  data.y = normal_vector(kRows, 7);  // innovations
  for (Index i = 1; i < kRows; ++i) data.y[i] = std::exp(-1.0 / 8) * data.y[i - 1] + 0.48 * data.y[i];
  data.y += 0.1 * normal_vector(kRows, 8);
  HistoryPriors priors;
  priors.noise_sd = 1.0;
  priors.noise_shape = 2.0;
  priors.error = {VectorXd::Constant(1, 8.0), Eigen::Vector4d(10.0, 30.0, 100.0, 300.0)};
  const HistoryModel model(data, priors, Context());
  const HistoryTarget target(model, {}, {VectorXd::Zero(1), MatrixXd::Identity(1, 1)});
  // Over sigma by steps, over the settings as a mean.
  const VectorXd sigma = VectorXd::LinSpaced(4001, -9.0, 3.0);
  VectorXd settings(4);
  for (int k = 0; k < 4; ++k) {
    MatrixXd x(2, sigma.size());
    x.row(0) = sigma.transpose();
    x.row(1).setConstant(quantile(boost::math::normal(), (k + 0.5) / 4));
    settings[k] = log_sum_exp(target.log_likelihood(x) - 0.5 * sigma.cwiseAbs2()) +
                  std::log((sigma[1] - sigma[0]) / std::sqrt(2 * kPi) / 4);
  }
  const double truth = log_sum_exp(settings);
  EXPECT_GT(normalised_exp(settings)[3], 0.2);  // two settings count
  EXPECT_GT(normalised_exp(settings)[2], 0.2);
  AisOptions options;
  options.pilot_chains = 200;
  options.groups = 6;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Context context;
    context.seed = seed;
    const AisResult result = sample_ais(target, options, context);
    EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
    EXPECT_LT(std::abs(result.log_evidence - truth), std::min(4 * result.standard_error, 0.15)) << seed;
  }
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
