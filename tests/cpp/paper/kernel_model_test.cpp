#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/distributions/beta.hpp>
#include <boost/math/distributions/gamma.hpp>
#include <limits>
#include <numeric>
#include <random>
#include <stdexcept>

#include "engine/ais/Sampler.hpp"
#include "engine/attribution/VarianceIndex.hpp"
#include "engine/discrepancy/KernelModel.hpp"
#include "kernel_model_helpers.hpp"

namespace amiss {
namespace {

using namespace test;

double dense_density(const KernelData& data, const KernelParameters& p) {
  const MatrixXd h = complement(data.basis);
  const MatrixXd a = dense_kernel(data, p) + MatrixXd::Identity(kN, kN) / p.lambda;
  return log_normal_density(h.transpose() * data.y, VectorXd::Zero(h.cols()), h.transpose() * a * h);
}

TEST(KernelModel, ValueEqualsTheDenseOneWithAnExplicitComplement) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  for (const KernelParameters& p : make_points()) {
    const double dense = dense_density(data, p);
    EXPECT_NEAR(model.log_likelihood(p), dense, 1e-8);
  }
}

TEST(KernelModel, ValueEqualsTheDenseOneOverMoreThanOneBlock) {
  const Index n = 230;
  KernelData data;
  data.basis.resize(n, 2);
  data.basis << normal_matrix(n, 1, 21), VectorXd::Ones(n);
  data.conditions = uniform_matrix(n, 2, 22);
  data.condition = {0, 1};
  data.fictitious = fictitious_condition(n, 1);
  data.y = normal_vector(n, 23);
  const KernelParameters p = make_point(Eigen::Vector3d(0.3, 0.7, 0.9), 0.3, 4.0);
  const MatrixXd h = complement(data.basis);
  const MatrixXd a = dense_kernel(data, p) + MatrixXd::Identity(n, n) / p.lambda;
  EXPECT_NEAR(make_model(data).log_likelihood(p),
              log_normal_density(h.transpose() * data.y, VectorXd::Zero(n - 2), h.transpose() * a * h), 1e-8);
}

TEST(KernelModel, MemoryUsedBeforeChangesNothing) {
  const KernelModel model = make_model();
  KernelModel::Memory memory;
  for (const KernelParameters& p : make_points()) {
    EXPECT_EQ(model.log_likelihood(p, memory), model.log_likelihood(p));
  }
}

TEST(KernelModel, DiscrepancyIsTheDenseConditional) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  const MatrixXd h = complement(data.basis);
  for (const KernelParameters& p : make_points()) {
    const MatrixXd zeta = h.transpose() * dense_kernel(data, p) * h;
    const MatrixXd seen = zeta + MatrixXd::Identity(h.cols(), h.cols()) / p.lambda;
    const MatrixXd covariance = h * (zeta - zeta * seen.ldlt().solve(zeta)) * h.transpose();
    const KernelDiscrepancy own = model.discrepancy(p);
    EXPECT_LT((own.mean - h * zeta * seen.ldlt().solve(h.transpose() * data.y)).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((own.variance - covariance.diagonal()).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(KernelModel, OrderOfTheTimeStepsDoesNotMatter) {
  const KernelData data = make_data();
  std::vector<int> order(kN);
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937_64(3));
  KernelData other = data;
  for (Index i = 0; i < kN; ++i) {
    const Index from = order[static_cast<std::size_t>(i)];
    other.y[i] = data.y[from];
    other.fictitious[i] = data.fictitious[from];
    other.basis.row(i) = data.basis.row(from);
    other.conditions.row(i) = data.conditions.row(from);
  }
  const KernelModel a = make_model(data), b = make_model(other);
  for (const KernelParameters& p : make_points()) {
    EXPECT_NEAR(a.log_likelihood(p), b.log_likelihood(p), 1e-8);
    EXPECT_LT((variance_shares(a, p) - variance_shares(b, p)).cwiseAbs().maxCoeff(), 1e-6);
  }
  // It does matter that all of them move together.
  other.fictitious = data.fictitious;
  EXPECT_GT(std::abs(make_model(other).log_likelihood(make_points()[1]) - a.log_likelihood(make_points()[1])),
            0.1);
}

TEST(KernelModel, NamesAndUnitsOfTheConditionsDoNotMatter) {
  const KernelData data = make_data();
  KernelData other = data;  // order 2, 0, 1 of the conditions; columns in another unit
  other.conditions << 1.8 * data.conditions.col(3).array() + 32, data.conditions.col(0) / 1000,
      data.conditions.col(1), data.conditions.col(2);
  other.condition = {0, 1, 2, 2};
  other.fictitious = 7.0 * data.fictitious.array() - 1.0;
  const KernelModel a = make_model(data), b = make_model(other);
  for (const KernelParameters& p : make_points()) {
    KernelParameters q = p;
    q.decay << p.decay[2], p.decay[0], p.decay[1], p.decay[3];
    EXPECT_NEAR(a.log_likelihood(p), b.log_likelihood(q), 1e-8);
    const VectorXd first = variance_shares(a, p), second = variance_shares(b, q);
    EXPECT_NEAR(first[2], second[0], 1e-6);
    EXPECT_NEAR(first[0], second[1], 1e-6);
    EXPECT_NEAR(first[1], second[2], 1e-6);
    EXPECT_NEAR(first[3], second[3], 1e-6);
  }
}

TEST(KernelModel, ZeroOfACircularConditionDoesNotMatterMuch) {
  // Directions all round the circle: another zero leaves distances as they are, but for the ranges of sine
  // and cosine.
  KernelData data = make_data();
  const VectorXd angle = VectorXd::LinSpaced(kN, 0.0, 6.28318530717958648 * (kN - 1) / kN);
  const auto turn = [&](double by) {
    data.conditions.col(1) = (angle.array() + by).sin();
    data.conditions.col(2) = (angle.array() + by).cos();
    return make_model(data).log_likelihood(make_points()[1]);
  };
  EXPECT_NEAR(turn(0.0), turn(6.28318530717958648 / 12), 1e-8);
}

TEST(KernelModel, FictitiousConditionIsWhiteNoiseOfItsSeed) {
  const VectorXd x = fictitious_condition(2000, 9);
  EXPECT_EQ(x, fictitious_condition(2000, 9));
  EXPECT_GT((x - fictitious_condition(2000, 10)).norm(), 1.0);
  // 4.5 standard errors of a mean, a standard deviation and a lag-one correlation of 2000 values.
  EXPECT_NEAR(x.mean(), 0.0, 0.1);
  EXPECT_NEAR(x.squaredNorm() / 2000, 1.0, 0.15);
  EXPECT_NEAR(x.head(1999).dot(x.tail(1999)) / 2000, 0.0, 0.1);
}

TEST(KernelModel, FictitiousConditionActsThroughItsOwnAlphaOnly) {
  KernelData data = make_data(), other = data;
  other.fictitious = fictitious_condition(kN, 6);
  KernelParameters p = make_points()[0];
  p.decay[3] = 0.0;
  EXPECT_EQ(make_model(data).log_likelihood(p), make_model(other).log_likelihood(p));
  p.decay[3] = 5.0;
  EXPECT_GT(std::abs(make_model(data).log_likelihood(p) - make_model(other).log_likelihood(p)), 0.1);
}

TEST(KernelModel, WhatCannotBeUsedIsRefused) {
  const auto refused = [](const std::function<void(KernelData&)>& spoil) {
    KernelData data = make_data();
    spoil(data);
    EXPECT_THROW(make_model(data), std::invalid_argument);
  };
  refused([](KernelData& d) { d.fictitious.conservativeResize(kN - 1); });
  refused([](KernelData& d) { d.condition.pop_back(); });
  refused([](KernelData& d) { d.condition = {0, 1, 1, 3}; });
  refused([](KernelData& d) { d.condition[0] = -1; });
  refused([](KernelData& d) { d.conditions(3, 1) = std::nan(""); });
  refused([](KernelData& d) { d.basis.col(1) = 2.0 * d.basis.col(2); });
  refused([](KernelData& d) { d.basis = normal_matrix(kN, kN, 1); });
  KernelPriors priors = make_priors();
  priors.alpha.b = 0.0;
  EXPECT_THROW(KernelModel(make_data(), priors), std::invalid_argument);
  priors = make_priors();
  priors.t2.a = -1.0;
  EXPECT_THROW(KernelModel(make_data(), priors), std::invalid_argument);
  priors = make_priors();
  priors.noise.sd = 0.0;
  EXPECT_THROW(KernelModel(make_data(), priors), std::invalid_argument);
  priors = make_priors();
  priors.unit = 0.0;
  EXPECT_THROW(KernelModel(make_data(), priors), std::invalid_argument);
  KernelParameters p = make_points()[0];
  p.amplitude = 1e12;
  EXPECT_EQ(make_model().log_likelihood(p), -std::numeric_limits<double>::infinity());
}

TEST(KernelTarget, CoordinatesAreQuantilesOfThePriors) {
  KernelPriors priors = make_priors();
  for (int variant = 0; variant < 3; ++variant) {
    if (variant == 1) priors.alpha = {2.0, 0.7}, priors.t2 = {3.0, 2.0};
    if (variant == 2) priors.alpha = {2.5, 1.0}, priors.unit = 1e3;
    const KernelModel model(make_data(), priors);
    const KernelTarget target(model);
    ASSERT_EQ(target.dimension(), 6);
    const boost::math::beta_distribution<> alpha(priors.alpha.a, priors.alpha.b),
        t2(priors.t2.a, priors.t2.b);
    const double b = 6.0 * 0.3 * 0.3;  // b* = noise_sd^2 N c
    const boost::math::gamma_distribution<> lambda(6.0, 1 / b);
    for (unsigned seed = 70; seed < 75; ++seed) {
      const VectorXd x = normal_vector(6, seed);
      const KernelParameters p = target.parameters(x);
      for (Index s = 0; s < 4; ++s) {
        // 1 - alpha keeps its digits where alpha does not.
        const double complement = -std::expm1(-0.25 * p.decay[model.order()[static_cast<std::size_t>(s)]]);
        const boost::math::beta_distribution<> mirror(priors.alpha.b, priors.alpha.a);
        EXPECT_NEAR(cdf(mirror, complement), cdf_normal(-x[s]), 1e-10) << variant;
      }
      EXPECT_NEAR(cdf(t2, p.t2(priors.unit)), cdf_normal(x[4]), 1e-12) << variant;
      EXPECT_NEAR(cdf(lambda, p.lambda), cdf_normal(x[5]), 1e-12) << variant;
    }
  }
}

TEST(KernelTarget, HalfThePriorOfAlphaLiesAbove0999) {
  const KernelModel model = make_model();
  const KernelTarget target(model);
  VectorXd x = VectorXd::Zero(6);
  // Beta(1, 0.1): P(1 - alpha < c) = c^0.1, so the median of 1 - alpha is 2^-10.
  EXPECT_NEAR(1 - target.parameters(x).alpha()[0], std::pow(2.0, -10), 1e-12);
  for (double far : {-30.0, -8.0, 8.0, 30.0}) {  // the ends stay usable numbers
    x.setConstant(far);
    const KernelParameters p = target.parameters(x);
    EXPECT_TRUE(p.decay.allFinite() && std::isfinite(p.amplitude) && std::isfinite(p.lambda)) << far;
    EXPECT_GE(p.decay.minCoeff(), 0.0);
    EXPECT_GT(p.amplitude, 0.0);
    EXPECT_GT(p.lambda, 0.0);
  }
}

TEST(KernelTarget, LikelihoodIsTheModelsAtTheParameters) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  const KernelTarget target(model);
  const MatrixXd x = normal_matrix(6, 4, 76);
  const VectorXd values = target.log_likelihood(x);
  for (Index i = 0; i < 4; ++i)
    EXPECT_NEAR(values[i], dense_density(data, target.parameters(x.col(i))), 1e-7);
}

TEST(KernelTarget, EvidenceOverOneFreeParameterEqualsQuadrature) {
  const KernelModel model = make_model();
  const KernelTarget target(model);
  VectorXd fixed(6);
  fixed << -1.0, 0.3, 0.5, 1.0, 0.2, 0.1;
  for (Index free : {0, 4, 5}) {
    const auto at = [&](double v) {
      VectorXd x = fixed;
      x[free] = v;
      return target.log_likelihood(x)[0];
    };
    const double truth = quadrature(at);
    const FunctionTarget one(1, [&](const VectorXd& x) { return at(x[0]); });
    const AisResult result = sample_ais(one, {}, Context());
    EXPECT_TRUE(trusted(result.outcome)) << in_words(result.outcome);
    EXPECT_LT(std::abs(result.log_evidence - truth), std::min(4 * result.standard_error, 0.1)) << free;
  }
}

// The prior's density written down: an integral over alpha itself, without the sampler's coordinates.
TEST(KernelTarget, PriorOfAlphaIsNormalised) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  const KernelTarget target(model);
  VectorXd x(6);
  x << 0.3, 0.3, 0.5, 1.0, 0.2, 0.1;
  const std::vector<int>& order = model.order();
  const Index first = std::find(order.begin(), order.end(), 0) - order.begin();
  const double truth = quadrature([&](double v) {
    x[first] = v;
    return target.log_likelihood(x)[0];
  });
  // Beta(1, 0.1): density 0.1 (1 - alpha)^-0.9; alpha = 1 - exp(-g), d alpha = exp(-g) dg.
  // Beyond g = 45 alpha is 1 to the last digit, and the rest of the prior is exp(-4.5).
  const int m = 9000;
  const double h = 45.0 / m;
  KernelParameters p = target.parameters(x);
  double& decay = p.decay[0];
  VectorXd terms(m + 1);
  for (int i = 0; i < m; ++i) {
    const double g = h * (i + 0.5);
    decay = -4.0 * std::log1p(-std::exp(-g));
    terms[i] = model.log_likelihood(p) + std::log(0.1 * h) - 0.1 * g;
  }
  decay = 0.0;
  terms[m] = model.log_likelihood(p) - 4.5;
  const double top = terms.maxCoeff();
  // Middle points of 0.005 beside the slope of the likelihood where alpha is small.
  EXPECT_NEAR(top + std::log((terms.array() - top).exp().sum()), truth, 1e-4);
}

}  // namespace
}  // namespace amiss
