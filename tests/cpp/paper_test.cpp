#include <gtest/gtest.h>

#include <boost/math/distributions/beta.hpp>
#include <boost/math/distributions/gamma.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <numeric>
#include <stdexcept>

#include "engine/ais/Sampler.hpp"
#include "engine/attribution/VarianceIndex.hpp"
#include "engine/calibration/PaperCalibration.hpp"
#include "engine/discrepancy/KernelModel.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

constexpr Index kN = 48, kQ = 3;

// Orthogonal columns of very different size; the last is the vector of ones.
MatrixXd make_basis_columns() {
  MatrixXd k(kN, kQ);
  k << normal_matrix(kN, 2, 61), VectorXd::Ones(kN);
  const Eigen::HouseholderQR<MatrixXd> qr(k.rowwise().reverse());
  MatrixXd o = qr.householderQ() * MatrixXd::Identity(kN, kQ);
  k.col(0) = 70.0 * o.col(1);
  k.col(1) = 0.4 * o.col(2);
  return k;
}

// Three conditions, the second circular; y answers to the first.
KernelData make_data() {
  KernelData data;
  data.basis = make_basis_columns();
  data.conditions.resize(kN, 4);
  const VectorXd angle = 6.3 * uniform_matrix(kN, 1, 62);
  data.conditions << 30.0 * uniform_matrix(kN, 1, 63), angle.array().sin(), angle.array().cos(),
      normal_matrix(kN, 1, 64).array() + 500.0;
  data.condition = {0, 1, 1, 2};
  data.fictitious = fictitious_condition(kN, 5);
  data.y = data.basis * Eigen::Vector3d(0.02, 3.0, 21.0) + 0.3 * normal_vector(kN, 65);
  data.y.array() += (0.2 * data.conditions.col(0).array()).sin();
  return data;
}

KernelPriors make_priors() {
  KernelPriors priors;
  priors.noise.sd = 0.3;
  priors.noise.shape = 6.0;
  return priors;
}

KernelModel make_model(const KernelData& data = make_data()) { return KernelModel(data, make_priors()); }

KernelParameters make_point(const VectorXd& alpha, double t2, double lambda) {
  KernelParameters p;
  p.decay = -4.0 * alpha.array().log();
  p.amplitude = (1 - t2) / t2;
  p.lambda = lambda;
  return p;
}

std::vector<KernelParameters> make_points() {
  return {make_point(Eigen::Vector4d(0.2, 0.9, 0.99, 0.999), 0.5, 9.0),
          make_point(Eigen::Vector4d(0.9, 0.05, 1.0, 0.3), 0.02, 30.0),
          make_point(Eigen::Vector4d(0.999, 0.99, 0.6, 1 - 1e-9), 0.97, 3.0),
          make_point(Eigen::Vector4d(1.0, 1.0, 1.0, 1.0), 0.4, 11.0)};
}

// zeta of (6) as it is written: powers of alpha, one pair of time steps after the other. `only` keeps one
// condition.
MatrixXd dense_kernel(const KernelData& data, const KernelParameters& p, int only = -1) {
  const Index n = data.y.size(), columns = data.conditions.cols();
  const VectorXd alpha = p.alpha();
  MatrixXd x(n, columns + 1);
  x << data.conditions, data.fictitious;
  std::vector<int> condition = data.condition;
  condition.push_back(data.count());
  const VectorXd low = x.colwise().minCoeff(), high = x.colwise().maxCoeff();
  MatrixXd zeta(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      double product = (1 - p.t2()) / p.t2();
      for (Index c = 0; c <= columns; ++c) {
        double width = 0.0;
        for (Index d = 0; d <= columns; ++d) {
          if (condition[d] == condition[c]) width = std::max(width, high[d] - low[d]);
        }
        const double dx = (x(i, c) - x(j, c)) / width;
        if (only < 0 || condition[c] == only) product *= std::pow(alpha[condition[c]], 4 * dx * dx);
      }
      zeta(i, j) = product;
    }
  }
  return zeta;
}

// H from a full decomposition of K.
MatrixXd complement(const MatrixXd& basis) {
  const Eigen::HouseholderQR<MatrixXd> qr(basis);
  const MatrixXd q = qr.householderQ();
  return q.rightCols(basis.rows() - basis.cols());
}

double dense_density(const KernelData& data, const KernelParameters& p) {
  const MatrixXd h = complement(data.basis);
  const MatrixXd a = dense_kernel(data, p) + MatrixXd::Identity(kN, kN) / p.lambda;
  return log_normal_density(h.transpose() * data.y, VectorXd::Zero(h.cols()), h.transpose() * a * h);
}

double cdf_normal(double x) { return cdf(boost::math::normal(), x); }

// log of the integral of exp(f) times the standard normal density; trapezoidal rule, accurate to rounding.
double quadrature(const std::function<double(double)>& f) {
  const int m = 600;
  const double h = 18.0 / m;
  VectorXd terms(m + 1);
  for (int i = 0; i <= m; ++i) {
    const double x = -9 + h * i;
    terms[i] = f(x) - 0.5 * (x * x + kLogTwoPi);
  }
  const double top = terms.maxCoeff();
  return top + std::log((terms.array() - top).exp().sum() * h);
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

TEST(KernelModel, DiscrepancyIsTheDenseConditionalMean) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  const MatrixXd h = complement(data.basis);
  for (const KernelParameters& p : make_points()) {
    const MatrixXd zeta = h.transpose() * dense_kernel(data, p) * h;
    const MatrixXd seen = zeta + MatrixXd::Identity(h.cols(), h.cols()) / p.lambda;
    const VectorXd expected = h * zeta * seen.ldlt().solve(h.transpose() * data.y);
    EXPECT_LT((model.discrepancy(p) - expected).cwiseAbs().maxCoeff(), 1e-9);
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
    EXPECT_TRUE(result.trusted) << result.verdict;
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

Emulator make_emulator(Index n_inputs, double scale = 1.0) {
  EmulatorState state;
  state.inputs = uniform_matrix(20, n_inputs, 91);
  state.coefficients.resize(20, kQ);
  for (Index m = 0; m < 20; ++m) {
    state.coefficients(m, 0) = 0.02 * std::sin(2.0 * state.inputs(m, 0)) / scale;
    state.coefficients(m, 1) = (3.0 + state.inputs(m, 0)) / scale;
    state.coefficients(m, 2) = (20.5 + state.inputs.row(m).sum()) / scale;
  }
  state.parameters = MatrixXd::Constant(kQ, n_inputs + 3, 1.0);
  state.parameters.col(0).setConstant(1.0);
  state.parameters.col(1).setConstant(-3.0);
  state.parameters.col(2).setConstant(6.0);
  return Emulator(state);
}

TEST(PaperCalibration, InsideTimesOutsideIsTheDensityOfTheMeasurement) {
  const KernelData data = make_data();
  const KernelModel model = make_model(data);
  const PaperCalibration inside(data.y, data.basis);
  const VectorXd mean = Eigen::Vector3d(0.015, 3.4, 20.6), variance = Eigen::Vector3d(1e-6, 0.04, 0.2);
  const MatrixXd h = complement(data.basis);
  for (const KernelParameters& p : make_points()) {
    const MatrixXd& k = data.basis;
    const MatrixXd covariance = h * h.transpose() * dense_kernel(data, p) * h * h.transpose() +
                                k * variance.asDiagonal() * k.transpose() +
                                MatrixXd::Identity(kN, kN) / p.lambda;
    const double own =
        inside.log_density(mean, variance, VectorXd::Constant(1, p.lambda)) + model.log_likelihood(p);
    EXPECT_NEAR(own, log_normal_density(data.y, k * mean, covariance), 1e-8);
  }
}

TEST(PaperCalibration, UnitOfTheBasisDoesNotMatter) {
  const KernelData data = make_data();
  const NoisePrior noise{0.3, 6.0};
  for (double scale : {100.0, 1e-3}) {
    KernelData other = data;
    other.basis *= scale;
    const PaperCalibration a(data.y, data.basis), b(other.y, other.basis);
    const Emulator first = make_emulator(2), second = make_emulator(2, scale);
    const KernelModel outside_a = make_model(data), outside_b = make_model(other);
    for (bool shared : {false, true}) {
      const PaperCalibrationTarget one(a, first, noise, shared), two(b, second, noise, shared);
      const MatrixXd x = normal_matrix(one.dimension(), 6, 92), x6 = normal_matrix(6, 6, 93);
      const VectorXd v = one.log_likelihood(x) + KernelTarget(outside_a).log_likelihood(x6);
      const VectorXd w = two.log_likelihood(x) + KernelTarget(outside_b).log_likelihood(x6);
      for (Index i = 0; i < 6; ++i) EXPECT_NEAR(v[i], w[i], 1e-8 * (1 + std::abs(v[i])));
    }
  }
}

TEST(PaperCalibration, OrderOfTheTimeStepsDoesNotMatter) {
  const KernelData data = make_data();
  const PaperCalibration a(data.y, data.basis), b(data.y.reverse(), data.basis.colwise().reverse());
  const VectorXd mean = Eigen::Vector3d(0.015, 3.4, 20.6), variance = Eigen::Vector3d(1e-6, 0.04, 0.2);
  const VectorXd lambda = Eigen::Vector3d(9.0, 11.0, 30.0);
  EXPECT_NEAR(a.log_density(mean, variance, lambda), b.log_density(mean, variance, lambda), 1e-8);
}

// Without emulator variance lambda*_q can be integrated: w*_q is a Student t of 2 a* degrees of freedom with
// scale sqrt(b* / (a* k_q'k_q)). That scale is the scaling of the prior.
TEST(PaperCalibration, PrecisionIntegratesToAStudentT) {
  const KernelData data = make_data();
  const PaperCalibration inside(data.y, data.basis);
  const NoisePrior noise{0.3, 2.5};
  const VectorXd scale = (noise.sd * noise.sd / inside.norms().array()).sqrt();
  VectorXd mean = inside.estimate() + 1.7 * scale;
  double expected = inside.log_jacobian(), own = inside.log_jacobian();
  for (Index q = 0; q < kQ; ++q) {
    const boost::math::students_t t(2 * noise.shape);
    expected += std::log(pdf(t, 1.7) / scale[q]);
    // All other terms are constant in lambda*_q: their value at lambda = 1 is taken off.
    const VectorXd others =
        inside.log_density(mean, VectorXd::Zero(kQ), VectorXd::Ones(kQ)) * VectorXd::Ones(1);
    const double term = -0.5 * (kLogTwoPi - std::log(inside.norms()[q]) +
                                std::pow(mean[q] - inside.estimate()[q], 2) * inside.norms()[q]);
    own += quadrature([&](double x) {
      VectorXd lambda = VectorXd::Ones(kQ);
      lambda[q] = noise.precision(x);
      return inside.log_density(mean, VectorXd::Zero(kQ), lambda) - (others[0] - term);
    });
  }
  EXPECT_NEAR(own, expected, 1e-6);
}

TEST(PaperCalibration, ColumnsMustBeOrthogonal) {
  const KernelData data = make_data();
  MatrixXd skew = data.basis;
  skew.col(0).array() += 0.1;
  EXPECT_THROW(PaperCalibration(data.y, skew), std::invalid_argument);
  EXPECT_THROW(PaperCalibration(data.y.head(kN - 1), data.basis), std::invalid_argument);
  skew = data.basis;
  skew.col(1).setZero();
  EXPECT_THROW(PaperCalibration(data.y, skew), std::invalid_argument);
}

TEST(PaperCalibrationTarget, CoordinatesAreTheParametersThenThePrecisions) {
  const KernelData data = make_data();
  const PaperCalibration inside(data.y, data.basis);
  const Emulator emulator = make_emulator(2);
  const NoisePrior noise{0.3, 6.0};
  const PaperCalibrationTarget own(inside, emulator, noise, false), shared(inside, emulator, noise, true);
  ASSERT_EQ(own.dimension(), 2 + kQ);
  ASSERT_EQ(shared.dimension(), 2 + 1);
  const boost::math::gamma_distribution<> prior(6.0, 1 / (6.0 * 0.09));
  const MatrixXd x = normal_matrix(2 + kQ, 4, 94), u = own.unit(x), lambda = own.lambda(x);
  for (Index i = 0; i < 4; ++i) {
    for (Index p = 0; p < 2; ++p) EXPECT_NEAR(u(i, p), cdf_normal(x(p, i)), 1e-14);
    for (Index q = 0; q < kQ; ++q) EXPECT_NEAR(cdf(prior, lambda(i, q)), cdf_normal(x(2 + q, i)), 1e-12);
    MatrixXd mean, variance;
    emulator.predict(u.row(i), mean, variance);
    EXPECT_NEAR(
        own.log_likelihood(x.col(i))[0],
        inside.log_density(mean.row(0).transpose(), variance.row(0).transpose(), lambda.row(i).transpose()),
        1e-10);
  }
  MatrixXd same = x;
  same.bottomRows(kQ).rowwise() = x.row(2);
  const VectorXd a = own.log_likelihood(same), b = shared.log_likelihood(x.topRows(3));
  for (Index i = 0; i < 4; ++i) EXPECT_NEAR(a[i], b[i], 1e-10);
}

TEST(PaperCalibrationTarget, EvidenceEqualsQuadrature) {
  const KernelData data = make_data();
  const PaperCalibration inside(data.y, data.basis);
  const Emulator emulator = make_emulator(1);
  const PaperCalibrationTarget target(inside, emulator, {0.3, 6.0}, true);
  const double truth = evidence_by_quadrature(target);
  const AisResult result = sample_ais(target, {}, Context());
  EXPECT_TRUE(result.trusted) << result.verdict;
  EXPECT_LT(std::abs(result.log_evidence - truth), std::min(4 * result.standard_error, 0.1));
}

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
  EXPECT_TRUE(result.trusted) << result.verdict;
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
