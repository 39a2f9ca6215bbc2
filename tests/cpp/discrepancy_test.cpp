#include <gtest/gtest.h>

#include <boost/math/distributions/cauchy.hpp>
#include <boost/math/distributions/gamma.hpp>
#include <boost/math/distributions/normal.hpp>
#include <stdexcept>

#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/FilterBank.hpp"
#include "engine/discrepancy/HistoryModel.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

constexpr Index kN = 40, kQ = 3;
const VectorXd kTimes = Eigen::Vector2d(0.6, 4.0);

HistoryData make_data() {
  HistoryData data;
  data.axis = uneven_axis(kN, {22});
  data.basis = normal_matrix(kN, kQ, 41);
  data.basis.col(0) *= 50.0;
  data.basis.col(2).setOnes();
  data.responses = 3.0 * normal_matrix(kN, 5, 42);
  data.responses.col(1).array() += 10.0;
  data.condition = {0, 0, 1, 2, 2};
  data.y = data.basis * Eigen::Vector3d(0.2, 1.0, 20.0) + 0.4 * data.responses.col(2) + normal_vector(kN, 43);
  return data;
}

HistoryPriors make_priors() {
  HistoryPriors priors;
  priors.noise_sd = 0.7;
  priors.noise_shape = 5.0;
  priors.amplitude = 1.4;
  priors.error = {kTimes, Eigen::Vector3d(0.0, 0.5, 3.0)};
  return priors;
}

HistoryModel make_model(const HistoryData& data = make_data()) {
  return HistoryModel(data, make_priors(), Context());
}

// Columns centred and scaled to unit population variance, weighted by sqrt(t_s / p_s).
MatrixXd weighted_responses(const HistoryData& data, const VectorXd& t) {
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < phi.cols(); ++j) {
    const int s = data.condition[j];
    const double columns = static_cast<double>(std::count(data.condition.begin(), data.condition.end(), s));
    phi.col(j) *= std::sqrt(t[s] / columns / (phi.col(j).squaredNorm() / static_cast<double>(phi.rows())));
  }
  return phi;
}

// Density of H'y, the part of y outside the simulation space, with an explicit complement H of the basis: one
// statistic for all error settings, so that these may be compared.
double dense_outside(const HistoryData& data, const VectorXd& ratios, double variance, const VectorXd& t) {
  const Eigen::JacobiSVD<MatrixXd> svd(data.basis, Eigen::ComputeFullU);
  const MatrixXd h = svd.matrixU().rightCols(kN - data.basis.cols());
  const MatrixXd phi = weighted_responses(data, t);
  const MatrixXd covariance = variance * error_covariance(data.axis, kTimes, ratios) + phi * phi.transpose();
  return log_normal_density(h.transpose() * data.y, VectorXd::Zero(h.cols()), h.transpose() * covariance * h);
}

const VectorXd kT = Eigen::Vector3d(0.8, 2.5, 0.1);
constexpr double kVariance = 0.6;

TEST(HistoryModel, LikelihoodEqualsTheDenseOneWithAnExplicitComplement) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  ASSERT_EQ(model.settings(), 9);
  for (int g = 0; g < 9; ++g) {
    const VectorXd ratios = model.priors().error.setting(g);
    EXPECT_NEAR(model.log_likelihood(g, std::log(kVariance), kT), dense_outside(data, ratios, kVariance, kT),
                1e-8)
        << g;
    EXPECT_NEAR(model.log_likelihood(g, std::log(kVariance), VectorXd::Zero(3)),
                dense_outside(data, ratios, kVariance, VectorXd::Zero(3)), 1e-8)
        << g;
  }
}

TEST(HistoryModel, GradientIsTheDerivative) {
  const HistoryModel model = make_model();
  const VectorXd x = (VectorXd(4) << std::log(kVariance), kT.array().log()).finished();
  for (int g : {0, 4, 8}) {
    const auto f = [&](const VectorXd& at) {
      return model.log_likelihood(g, at[0], at.tail(3).array().exp());
    };
    VectorXd gradient;
    const VectorXd t = x.tail(3).array().exp();
    EXPECT_EQ(model.log_likelihood(g, x[0], t, &gradient), f(x));
    const VectorXd expected = numerical_gradient(f, x);
    for (Index i = 0; i < 4; ++i) {
      ASSERT_GT(std::abs(expected[i]), 1e-3);
      EXPECT_NEAR(gradient[i] / expected[i], 1.0, 1e-5) << "setting " << g << ", coordinate " << i;
    }
  }
}

TEST(HistoryModel, GradientHoldsWhereAConditionIsLeftOut) {
  const HistoryModel model = make_model();
  VectorXd t = kT, gradient, none;
  t[1] = 0.0;
  model.log_likelihood(4, std::log(kVariance), t, &gradient);
  const auto f = [&](const VectorXd& at) {
    return model.log_likelihood(4, at[0], Eigen::Vector3d(std::exp(at[1]), 0.0, std::exp(at[2])));
  };
  const VectorXd expected =
      numerical_gradient(f, Eigen::Vector3d(std::log(kVariance), std::log(kT[0]), std::log(kT[2])));
  EXPECT_NEAR(gradient[0] / expected[0], 1.0, 1e-5);
  EXPECT_NEAR(gradient[1] / expected[1], 1.0, 1e-5);
  EXPECT_EQ(gradient[2], 0.0);  // d / d log t = t d / d t
  EXPECT_NEAR(gradient[3] / expected[2], 1.0, 1e-5);

  model.log_likelihood(4, std::log(kVariance), VectorXd::Zero(3), &none);
  const VectorXd at_none = numerical_gradient(
      [&](const VectorXd& at) { return model.log_likelihood(4, at[0], VectorXd::Zero(3)); },
      VectorXd::Constant(1, std::log(kVariance)));
  EXPECT_NEAR(none[0] / at_none[0], 1.0, 1e-5);
  EXPECT_EQ(none.tail(3), VectorXd::Zero(3));
}

TEST(HistoryModel, ConditionWithoutVarianceIsAModelWithoutItsColumns) {
  const HistoryData data = make_data();
  HistoryData less = data;
  less.responses.resize(kN, 4);
  less.responses << data.responses.leftCols(2), data.responses.rightCols(2);
  less.condition = {0, 0, 1, 1};
  const HistoryModel full = make_model(data), reduced = make_model(less);
  for (int g : {0, 5}) {
    EXPECT_NEAR(full.log_likelihood(g, -0.3, Eigen::Vector3d(0.8, 0.0, 0.1)),
                reduced.log_likelihood(g, -0.3, Eigen::Vector2d(0.8, 0.1)), 1e-10);
  }
}

TEST(HistoryModel, InsideTimesOutsideIsTheDensityOfTheMeasurement) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  const VectorXd w = Eigen::Vector3d(0.21, 0.7, 19.5);
  for (int g : {0, 1, 5, 8}) {
    const MatrixXd s = error_covariance(data.axis, kTimes, model.priors().error.setting(g));
    const MatrixXd inverse = s.inverse();
    const MatrixXd& k = data.basis;
    const MatrixXd gls = (k.transpose() * inverse * k).inverse() * k.transpose() * inverse;
    const MatrixXd phi = (MatrixXd::Identity(kN, kN) - k * gls) * weighted_responses(data, kT);
    const double dense = log_normal_density(data.y, k * w, kVariance * s + phi * phi.transpose());

    const WhitenedData& own = model.whitened(g);
    const MatrixXd covariance = kVariance * (own.root.transpose() * own.root).inverse();
    const double inside = log_normal_density(own.estimate, w, covariance);
    const double log_jacobian = -0.5 * std::log((k.transpose() * k).determinant());
    EXPECT_NEAR(model.log_likelihood(g, std::log(kVariance), kT) + inside + log_jacobian, dense, 1e-8) << g;
    EXPECT_LT((own.estimate - gls * data.y).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((own.root.transpose() * own.root - k.transpose() * inverse * k).cwiseAbs().maxCoeff(),
              1e-9 * own.root.squaredNorm());
  }
}

TEST(HistoryModel, UnitsOfTheBasisDoNotMatter) {
  const double factor = 250.0;
  const HistoryData data = make_data();
  HistoryData scaled = data;
  scaled.basis *= factor;
  const HistoryModel a = make_model(data), b = make_model(scaled);
  const VectorXd w = Eigen::Vector3d(0.2, 1.0, 20.0);
  const auto inside = [](const WhitenedData& own, const VectorXd& coefficients) {
    const MatrixXd covariance = kVariance * (own.root.transpose() * own.root).inverse();
    return log_normal_density(own.estimate, coefficients, covariance);
  };
  for (int g : {0, 7}) {
    const WhitenedData &plain = a.whitened(g), &other = b.whitened(g);
    EXPECT_NEAR(a.log_likelihood(g, -0.5, kT), b.log_likelihood(g, -0.5, kT), 1e-9);
    EXPECT_LT((plain.estimate - factor * other.estimate).cwiseAbs().maxCoeff(), 1e-9);
    const double log_volumes = log_volume(scaled.basis) - log_volume(data.basis);
    EXPECT_NEAR(log_volumes, kQ * std::log(factor), 1e-10);
    EXPECT_NEAR(inside(other, w / factor) - log_volumes, inside(plain, w), 1e-8);
  }
}

TEST(HistoryModel, UnitsOfTheConditionsDoNotMatter) {
  HistoryData scaled = make_data();
  scaled.responses = (scaled.responses * 1000.0).array() - 273.15;
  EXPECT_NEAR(make_model().log_likelihood(5, -0.5, kT), make_model(scaled).log_likelihood(5, -0.5, kT), 1e-9);
}

TEST(HistoryModel, ConditionThatNeverChangesHasNoEffect) {
  HistoryData data = make_data();
  data.responses.col(2).setConstant(17.0);
  const HistoryModel model = make_model(data);
  EXPECT_NEAR(model.log_likelihood(4, -0.5, kT),
              model.log_likelihood(4, -0.5, Eigen::Vector3d(kT[0], 0.0, kT[2])), 1e-9);
}

TEST(HistoryModel, CoefficientsAreThePosteriorMean) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  const MatrixXd s = error_covariance(data.axis, kTimes, model.priors().error.setting(5));
  const MatrixXd& k = data.basis;
  const MatrixXd inverse = s.inverse();
  const MatrixXd outside =
      MatrixXd::Identity(kN, kN) - k * (k.transpose() * inverse * k).inverse() * k.transpose() * inverse;
  // With coefficients sqrt(t_s / p_s) a, a ~ N(0, I): normal equations under the metric of the error.
  const VectorXd root = (VectorXd(5) << std::sqrt(kT[0] / 2), std::sqrt(kT[0] / 2), std::sqrt(kT[1]),
                         std::sqrt(kT[2] / 2), std::sqrt(kT[2] / 2))
                            .finished();
  const MatrixXd phi = outside * weighted_responses(data, kT);
  const MatrixXd normal = phi.transpose() * inverse * phi + kVariance * MatrixXd::Identity(5, 5);
  const VectorXd expected =
      root.cwiseProduct(normal.inverse() * phi.transpose() * inverse * outside * data.y);
  const VectorXd own = model.coefficients(model.whitened(5), std::log(kVariance), kT);
  EXPECT_LT((own - expected).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(HistoryModel, OneAndTwoThreadsGiveTheSameBits) {
  Context two;
  two.threads = 2;
  const HistoryModel a = make_model(), b(make_data(), make_priors(), two);
  for (int g = 0; g < 9; ++g) EXPECT_EQ(a.log_likelihood(g, -0.5, kT), b.log_likelihood(g, -0.5, kT));
}

// More rows than are whitened at once; a segment begins within the second block.
TEST(HistoryModel, LongRecordsAreWhitenedInBlocksWithTheSameResult) {
  constexpr Index n = 2600;
  HistoryData data;
  data.axis = uneven_axis(n, {2300});
  data.basis = normal_matrix(n, 3, 45);
  data.basis.col(0) *= 1e4;
  data.responses = normal_matrix(n, 4, 46);
  data.condition = {0, 0, 1, 1};
  data.y = data.basis * Eigen::Vector3d(1e-3, 2.0, 20.0) + data.responses.col(1) + normal_vector(n, 47);
  const VectorXd ratios = Eigen::Vector2d(0.5, 3.0);
  const WhitenedData own = whiten(data, kTimes, ratios);
  // All rows at once, by a complete orthogonal decomposition.
  const Whitener whitener(data.axis, kTimes, ratios);
  const MatrixXd k = whitener(data.basis), phi = whitener(data.responses), y = whitener(data.y);
  const Eigen::HouseholderQR<MatrixXd> qr(k);
  const MatrixXd o = qr.householderQ() * MatrixXd::Identity(n, 3);
  const MatrixXd phi_outside = phi - o * (o.transpose() * phi), y_outside = y - o * (o.transpose() * y);
  EXPECT_LT((own.gram - phi_outside.transpose() * phi_outside).cwiseAbs().maxCoeff(), 1e-9 * n);
  EXPECT_LT((own.cross - phi_outside.transpose() * y_outside).cwiseAbs().maxCoeff(), 1e-9 * n);
  EXPECT_NEAR(own.square, y_outside.squaredNorm(), 1e-9 * n);
  EXPECT_LT((own.estimate - MatrixXd(qr.solve(y))).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((own.root.transpose() * own.root - k.transpose() * k).cwiseAbs().maxCoeff(),
            1e-9 * k.squaredNorm());
  EXPECT_EQ(own.residual_dimension, n - 3);
}

TEST(HistoryModel, RefusesDataThatDoNotFit) {
  HistoryData data = make_data();
  data.y.conservativeResize(kN - 1);
  EXPECT_THROW(make_model(data), std::invalid_argument);
  data = make_data();
  data.condition.pop_back();
  EXPECT_THROW(make_model(data), std::invalid_argument);
  data = make_data();
  data.basis = normal_matrix(kN, kN, 1);
  EXPECT_THROW(make_model(data), std::invalid_argument);
  HistoryPriors priors = make_priors();
  priors.noise_sd = 0.0;
  EXPECT_THROW(HistoryModel(make_data(), priors, Context()), std::invalid_argument);
  priors = make_priors();
  priors.inclusion = 0.0;
  EXPECT_THROW(HistoryModel(make_data(), priors, Context()), std::invalid_argument);
}

TEST(HistoryTarget, CoordinatesMapToThePriorsQuantiles) {
  const HistoryModel model = make_model();
  const HistoryTarget target(model, {0, 2});
  ASSERT_EQ(target.dimension(), 1 + 2 + 2);
  const HistoryPriors priors = make_priors();
  // lambda* ~ Gamma(a*, rate a* sd^2); sqrt(t) ~ half-Cauchy(amplitude).
  const boost::math::gamma_distribution<> precision(
      priors.noise_shape, 1 / (priors.noise_shape * priors.noise_sd * priors.noise_sd));
  const boost::math::cauchy cauchy(0.0, priors.amplitude);
  const boost::math::normal normal;
  for (double u : {0.03, 0.5, 0.9, 0.99}) {
    const HistoryParameters point = target.parameters(VectorXd::Constant(5, quantile(normal, u)));
    EXPECT_NEAR(cdf(precision, 1.0 / point.variance), u, 1e-9);
    // With probability 1 - inclusion t = 0; else the half-Cauchy distribution.
    const double in_slab = (u - (1 - priors.inclusion)) / priors.inclusion;
    for (int s : {0, 2})
      EXPECT_NEAR(2 * cdf(cauchy, std::sqrt(point.t[s])) - 1, std::max(0.0, in_slab), 1e-9) << s;
    EXPECT_EQ(point.t[1], 0.0);
  }
  // The likelihood is continuous where the slab begins: t rises from zero.
  const double edge = quantile(normal, 1 - priors.inclusion);
  EXPECT_LT(target.parameters(VectorXd::Constant(5, edge + 1e-6)).t[0], 1e-8);
}

TEST(HistoryTarget, ErrorComponentsChooseTheirOwnRatio) {
  const HistoryModel model = make_model();
  const HistoryTarget target(model, {});
  const double third[] = {-1.0, 0.0, 1.0};  // within the lower, middle and upper third of N(0, 1)
  const VectorXd ratios = model.priors().error.ratios;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      const HistoryParameters point = target.parameters(Eigen::Vector3d(0.2, third[a], third[b]));
      EXPECT_EQ(model.priors().error.setting(point.setting), Eigen::Vector2d(ratios[a], ratios[b]));
    }
  }
  EXPECT_EQ(target.parameters(Eigen::Vector3d(0.0, 40.0, 40.0)).setting, 8);  // Phi rounds to 1
}

TEST(HistoryTarget, LikelihoodIsTheModelsAtTheMappedPoint) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  const HistoryTarget target(model, {1});
  const MatrixXd x = normal_matrix(4, 6, 44);
  const VectorXd values = target.log_likelihood(x);
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters p = target.parameters(x.col(i));
    EXPECT_NEAR(values[i], dense_outside(data, model.priors().error.setting(p.setting), p.variance, p.t),
                1e-8 * (1 + std::abs(values[i])));
  }
}

TEST(HistoryTarget, GradientIsTheDerivative) {
  const HistoryModel model = make_model();
  const HistoryTarget target(model, {0, 2});
  const Index d = target.dimension();
  for (unsigned seed = 1; seed <= 6; ++seed) {
    // The first condition in its slab, the second in the slab or the spike; away from the jumps of the grid.
    VectorXd x = 0.7 * normal_vector(d, 90 + seed);
    x[d - 2] = 1.2 + 0.1 * seed;
    MatrixXd gradient;
    const VectorXd value = target.log_likelihood(x, gradient);
    EXPECT_DOUBLE_EQ(value[0], target.log_likelihood(MatrixXd(x))[0]);
    const VectorXd expected = numerical_gradient(
        [&](const VectorXd& at) { return target.log_likelihood(MatrixXd(at))[0]; }, x, 1e-6);
    for (Index i = 0; i < d; ++i)
      EXPECT_NEAR(gradient(i, 0), expected[i], 1e-5 * (1 + std::abs(expected[i]))) << i;
  }
}

TEST(HistoryTarget, ExtremeCoordinatesStayUsable) {
  const HistoryModel model = make_model();
  const HistoryTarget target(model, {0, 1, 2});
  for (double x : {-40.0, 40.0}) {
    EXPECT_FALSE(std::isnan(target.log_likelihood(MatrixXd::Constant(6, 1, x))[0])) << x;
  }
}

TEST(HistoryTarget, EvidenceOfTheNoiseAloneEqualsQuadrature) {
  HistoryPriors priors = make_priors();
  priors.error = {};
  const HistoryModel model(make_data(), priors, Context());
  const HistoryTarget target(model, {1});
  // Trapezoidal rule over the prior N(0, I) in two coordinates; accurate to rounding for a smooth integrand.
  double sum = 0.0;
  const int m = 400;
  const double h = 16.0 / m;
  MatrixXd row(2, m + 1);
  for (int i = 0; i <= m; ++i) {
    for (int j = 0; j <= m; ++j) row.col(j) = Eigen::Vector2d(-8 + h * i, -8 + h * j);
    const VectorXd ll = target.log_likelihood(row);
    for (int j = 0; j <= m; ++j)
      sum += std::exp(ll[j] + 60.0 - 0.5 * row.col(j).squaredNorm() - kLogTwoPi) * h * h;
  }
  const AisResult result = sample_ais(target, {}, Context());
  EXPECT_TRUE(result.trusted) << result.verdict;
  // Four reported standard errors, and in any case less than matters to a Bayes factor.
  EXPECT_LT(std::abs(result.log_evidence - (std::log(sum) - 60.0)),
            std::min(4 * result.standard_error, 0.15));
}

TEST(HistoryTarget, NumberingOfTheConditionsLeavesTheSampledEvidenceUnchanged) {
  const HistoryData data = make_data();
  HistoryData other = data;  // order 2, 0, 1
  other.responses << data.responses.rightCols(2), data.responses.leftCols(3);
  other.condition = {0, 0, 1, 1, 2};
  const HistoryModel a = make_model(data), b = make_model(other);
  const HistoryTarget first(a, {0, 1, 2}), second(b, {0, 1, 2});
  const VectorXd x = normal_vector(first.dimension(), 44);
  const VectorXd t = first.parameters(x).t, u = second.parameters(x).t;
  EXPECT_EQ(t[0], u[1]);
  EXPECT_EQ(t[1], u[2]);
  EXPECT_EQ(t[2], u[0]);
  AisOptions options;
  options.pilot_chains = 64;
  options.groups = options.max_groups = 3;
  EXPECT_NEAR(sample_ais(first, options, Context()).log_evidence,
              sample_ais(second, options, Context()).log_evidence, 1e-8);
}

TEST(FilterBank, RespondsToAStepExactly) {
  const TimeAxis axis = uneven_axis(20, {});
  VectorXd x = VectorXd::Zero(20);
  x.tail(15).setConstant(2.0);
  const FilterBank bank(x, {0}, Eigen::Vector3d(0.0, 0.7, 6.0), axis);
  EXPECT_EQ(bank.responses.col(0), x);
  // The value of step i holds since the step before.
  for (Index i = 5; i < 20; ++i) {
    const double since = axis.time[i] - axis.time[4];
    EXPECT_NEAR(bank.responses(i, 1), 2 * (1 - std::exp(-since / 0.7)), 1e-12);
    EXPECT_NEAR(bank.responses(i, 2), 2 * (1 - std::exp(-since / 6.0)), 1e-12);
  }
  EXPECT_EQ(bank.responses.topRows(5).cwiseAbs().maxCoeff(), 0.0);
}

TEST(FilterBank, StartsEverySegmentInEquilibrium) {
  const TimeAxis axis = uneven_axis(20, {9});
  VectorXd x = VectorXd::Constant(20, 5.0);
  x.tail(11).setConstant(-3.0);
  const FilterBank bank(x, {0}, VectorXd::Constant(1, 50.0), axis);
  EXPECT_LT((bank.responses.col(0) - x).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(FilterBank, SegmentsAreIndependent) {
  const TimeAxis axis = uneven_axis(20, {9});
  const VectorXd x = normal_vector(20, 45);
  VectorXd other = x;
  other.head(9) = normal_vector(9, 46);
  const VectorXd times = Eigen::Vector2d(1.0, 8.0);
  const MatrixXd a = FilterBank(x, {0}, times, axis).responses,
                 b = FilterBank(other, {0}, times, axis).responses;
  EXPECT_EQ(a.bottomRows(11), b.bottomRows(11));
  EXPECT_NE(a.topRows(9), b.topRows(9));
}

TEST(FilterBank, ColumnsRunByBoundaryColumnThenTimeConstant) {
  const TimeAxis axis = even_axis(10);
  const MatrixXd x = normal_matrix(10, 3, 47);
  const FilterBank bank(x, {0, 1, 1}, Eigen::Vector2d(0.0, 2.0), axis);
  EXPECT_EQ(bank.condition, (std::vector<int>{0, 0, 1, 1, 1, 1}));
  for (Index c = 0; c < 3; ++c) EXPECT_EQ(bank.responses.col(2 * c), x.col(c));
}

TEST(FilterBank, RefusesWrongLengthsAndNegativeTimes) {
  const TimeAxis axis = even_axis(10);
  EXPECT_THROW(FilterBank(VectorXd::Zero(9), {0}, VectorXd::Ones(1), axis), std::invalid_argument);
  EXPECT_THROW(FilterBank(VectorXd::Zero(10), {0}, -VectorXd::Ones(1), axis), std::invalid_argument);
}

}  // namespace
}  // namespace amiss
