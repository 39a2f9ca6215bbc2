#include <gtest/gtest.h>

#include <boost/math/distributions/cauchy.hpp>
#include <boost/math/distributions/gamma.hpp>
#include <boost/math/distributions/normal.hpp>
#include <limits>
#include <stdexcept>

#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/FilterBank.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"
#include "engine/linalg/log_sum_exp.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

constexpr Index kN = 40, kQ = 3;
constexpr double kNoise = 0.7, kInfinity = std::numeric_limits<double>::infinity();
const VectorXd kTimes = Eigen::Vector2d(0.6, 4.0);

// Columns of the basis of sizes 1 to 5000; the simulator moves by |K L| between 2 and 40, which the reaches
// below take for much, little or nothing.
HistoryData make_data() {
  HistoryData data;
  data.axis = uneven_axis(kN, {22});
  data.basis = normal_matrix(kN, kQ, 41);
  data.basis.col(0) *= 5000.0;
  data.basis.col(2).setOnes();
  data.moves = data.basis * (Eigen::Vector3d(1e-3, 0.4, 2.0).asDiagonal() * normal_matrix(kQ, 2, 49));
  data.responses = 3.0 * normal_matrix(kN, 5, 42);
  data.responses.col(1).array() += 10.0;
  data.condition = {0, 0, 1, 2, 2};
  data.y =
      data.basis * Eigen::Vector3d(0.002, 1.0, 20.0) + 0.4 * data.responses.col(2) + normal_vector(kN, 43);
  return data;
}

HistoryPriors make_priors() {
  HistoryPriors priors;
  priors.noise_sd = kNoise;
  priors.noise_shape = 5.0;
  priors.amplitude = 1.4;
  priors.error = {kTimes, Eigen::Vector3d(0.0, 0.5, 3.0)};
  priors.reach = {0.5, 60.0, kInfinity};
  return priors;
}

HistoryModel make_model(const HistoryData& data = make_data()) {
  return HistoryModel(data, make_priors(), Context());
}

constexpr int kSettings = 27;  // nine errors for each of three reaches
const VectorXd kT = Eigen::Vector3d(0.8, 2.5, 0.1);
constexpr double kVariance = 0.6;
const VectorXd kMean = Eigen::Vector3d(0.0015, 1.1, 19.0), kSpread = Eigen::Vector3d(1e-7, 0.4, 0.0);

HistoryParameters at(int setting, const VectorXd& t = kT) { return {setting, kVariance, t}; }

// Columns centred and scaled to unit population variance.
MatrixXd standardised(const HistoryData& data) {
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < phi.cols(); ++j) phi.col(j) *= std::sqrt(kN / phi.col(j).squaredNorm());
  return phi;
}

// (I + (E E' / (kappa sigma_0^2))^2)^-1 phi, E = K L, with N x N matrices. Its condition is 1e8: in double
// precision this side would be the less accurate one.
MatrixXd out_of_reach(const HistoryData& data, double reach, const MatrixXd& phi) {
  if (std::isinf(reach)) return phi;
  using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const LongMatrix moves = data.moves.cast<long double>();
  const LongMatrix a = moves * moves.transpose() / static_cast<long double>(reach * kNoise * kNoise);
  const LongMatrix inverted = LongMatrix::Identity(kN, kN) + a * a;
  return inverted.ldlt().solve(phi.cast<long double>()).cast<double>();
}

MatrixXd dense_psi(const HistoryData& data, int setting) {
  return out_of_reach(data, make_priors().reach[static_cast<std::size_t>(setting / 9)], standardised(data));
}

// Variances t_s / p_s of the coefficients of the filter columns.
VectorXd prior_variances(const HistoryData& data, const VectorXd& t) {
  VectorXd variances(data.responses.cols());
  for (Index j = 0; j < variances.size(); ++j) {
    const int s = data.condition[static_cast<std::size_t>(j)];
    variances[j] = t[s] / static_cast<double>(std::count(data.condition.begin(), data.condition.end(), s));
  }
  return variances;
}

// Of error and discrepancy.
MatrixXd dense_covariance(const HistoryData& data, const HistoryParameters& p) {
  const MatrixXd psi = dense_psi(data, p.setting);
  return p.variance * error_covariance(data.axis, kTimes, make_priors().error.setting(p.setting % 9)) +
         psi * prior_variances(data, p.t).asDiagonal() * psi.transpose();
}

// log density of y for coefficients N(mean, covariance).
double dense_density(const HistoryData& data, const HistoryParameters& p, const VectorXd& mean,
                     const MatrixXd& covariance) {
  return log_normal_density(data.y, data.basis * mean,
                            dense_covariance(data, p) + data.basis * covariance * data.basis.transpose());
}

double dense_density(const HistoryData& data, const HistoryParameters& p) {
  return dense_density(data, p, kMean, kSpread.asDiagonal());
}

double log_likelihood(const HistoryModel& model, const HistoryParameters& p) {
  return model.log_likelihood(p, kMean, kSpread);
}

// A covariance of coefficients that are far from independent.
GaussianSimulator make_simulator() {
  return {kMean, Eigen::Vector3d(3e-4, 0.6, 0.3).asDiagonal() * normal_matrix(kQ, 2, 48)};
}

WhitenedData seen_by(const HistoryModel& model, int setting, const GaussianSimulator& simulator) {
  return model.whitened(setting).in_terms_of(simulator.mean - model.reference(), simulator.root);
}

// The densities here lie between -40 and -200; 1e-8 is what rounding in covariances with eigenvalues from 0.1
// to 1e5 leaves of them.
constexpr double kRounding = 1e-8;

TEST(HistoryModel, LikelihoodIsTheDenseNormalDensityOfTheMeasurement) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  ASSERT_EQ(model.settings(), kSettings);
  for (int g = 0; g < kSettings; ++g) {
    for (const VectorXd& t : {kT, VectorXd(Eigen::Vector3d(0.8, 0.0, 0.1)), VectorXd(VectorXd::Zero(3))})
      EXPECT_NEAR(log_likelihood(model, at(g, t)), dense_density(data, at(g, t)), kRounding) << g;
  }
  // Else the comparison would not see the reach, or the simulator's variance.
  EXPECT_GT(std::abs(log_likelihood(model, at(4)) - log_likelihood(model, at(13))), 0.01);
  EXPECT_GT(std::abs(log_likelihood(model, at(13)) - log_likelihood(model, at(22))), 0.1);
  EXPECT_GT(std::abs(log_likelihood(model, at(4)) - model.log_likelihood(at(4), kMean, VectorXd::Zero(3))),
            0.1);
}

TEST(HistoryModel, SettingsRunByReachThenError) {
  const HistoryModel model = make_model();
  EXPECT_EQ(model.error_settings(), 9);
  EXPECT_EQ(model.error_of(14), 5);
  EXPECT_EQ(model.reach_of(8), 0.5);
  EXPECT_EQ(model.reach_of(9), 60.0);
  EXPECT_EQ(model.reach_of(26), kInfinity);
}

TEST(HistoryModel, OnlyTheSettingsAskedForAreWorkedOut) {
  const HistoryModel all = make_model(), few(make_data(), make_priors(), Context(), {13});
  EXPECT_EQ(log_likelihood(few, at(13)), log_likelihood(all, at(13)));
  EXPECT_EQ(few.whitened(12).gram.size(), 0);
}

TEST(HistoryModel, FullCovarianceOfTheCoefficientsEqualsTheDenseOne) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  const GaussianSimulator simulator = make_simulator();
  const MatrixXd covariance = simulator.root * simulator.root.transpose();
  for (int g = 0; g < kSettings; g += 4)
    EXPECT_NEAR(model.log_likelihood(seen_by(model, g, simulator), std::log(kVariance), kT),
                dense_density(data, at(g), kMean, covariance), kRounding)
        << g;
}

// Units and order of the basis vectors.
TEST(HistoryModel, NamesAndUnitsOfTheBasisDoNotMatter) {
  const HistoryData data = make_data();
  const VectorXd scale = Eigen::Vector3d(1e-5, 300.0, 7.0);
  const Eigen::PermutationMatrix<3> order(Eigen::Vector3i(2, 0, 1));
  HistoryData other = data;
  other.basis = data.basis * scale.cwiseInverse().asDiagonal() * order;
  const VectorXd mean = order.transpose() * VectorXd(scale.cwiseProduct(kMean)),
                 variance = order.transpose() * VectorXd(scale.cwiseAbs2().cwiseProduct(kSpread));
  const HistoryModel a = make_model(data), b = make_model(other);
  for (int g : {0, 7, 12, 26})
    EXPECT_NEAR(b.log_likelihood(at(g), mean, variance), log_likelihood(a, at(g)), kRounding) << g;
}

TEST(HistoryModel, AnotherBasisOfTheSameSpaceGivesTheSameDensity) {
  const HistoryData data = make_data();
  const MatrixXd r = MatrixXd(normal_matrix(3, 3, 50) * Eigen::Vector3d(5000.0, 1.0, 1.0).asDiagonal());
  HistoryData other = data;
  other.basis = data.basis * r.inverse();
  const HistoryModel a = make_model(data), b = make_model(other);
  const GaussianSimulator simulator = make_simulator(), moved{r * simulator.mean, r * simulator.root};
  for (int g : {0, 7, 12, 26})
    EXPECT_NEAR(b.log_likelihood(seen_by(b, g, moved), -0.5, kT),
                a.log_likelihood(seen_by(a, g, simulator), -0.5, kT), kRounding)
        << g;
}

// The data with a fourth vector of the basis, by whose coefficient the simulator moves by `sd`.
HistoryData with_another_vector(double sd) {
  const HistoryData data = make_data();
  HistoryData more = data;
  more.basis.resize(kN, 4);
  more.basis << data.basis, normal_vector(kN, 51);
  more.moves.resize(kN, 3);
  more.moves << data.moves, sd * more.basis.col(3);
  return more;
}

double with_another_coefficient(int setting, double sd) {
  const VectorXd mean = (VectorXd(4) << kMean, 0.0).finished(),
                 variance = (VectorXd(4) << kSpread, sd * sd).finished();
  return make_model(with_another_vector(sd)).log_likelihood(at(setting), mean, variance);
}

TEST(HistoryModel, VectorByWhichNothingMovesChangesNothing) {
  const HistoryModel model = make_model();
  for (int g : {0, 7, 12, 26})
    EXPECT_NEAR(with_another_coefficient(g, 0.0), log_likelihood(model, at(g)), kRounding) << g;
}

// What a basis leaves out costs as much as it moves, squared: the number of vectors is a matter of accuracy.
TEST(HistoryModel, NumberOfVectorsIsAMatterOfAccuracyAlone) {
  const HistoryModel model = make_model();
  for (int g : {0, 7, 12, 26}) {
    const double without = log_likelihood(model, at(g));
    const double much = with_another_coefficient(g, 2e-3) - without,
                 little = with_another_coefficient(g, 2e-4) - without;
    EXPECT_LT(std::abs(much), 0.05) << g;
    EXPECT_GT(std::abs(much), 1e-6) << g;
    // The next order is below 1 % of the first, which rounding leaves to 1 %.
    EXPECT_NEAR(much / little, 100.0, 2.0) << g;
  }
}

TEST(HistoryModel, GradientIsTheDerivative) {
  const HistoryModel model = make_model();
  const VectorXd x = (VectorXd(4) << std::log(kVariance), kT.array().log()).finished();
  for (int g : {0, 4, 13, 26}) {
    const WhitenedData seen = seen_by(model, g, make_simulator());
    const auto f = [&](const VectorXd& v) {
      return model.log_likelihood(seen, v[0], v.tail(3).array().exp());
    };
    VectorXd gradient;
    const VectorXd t = x.tail(3).array().exp();
    EXPECT_EQ(model.log_likelihood(seen, x[0], t, &gradient), f(x));
    const VectorXd expected = numerical_gradient(f, x);
    for (Index i = 0; i < 4; ++i) {
      ASSERT_GT(std::abs(expected[i]), 1e-3);
      // Central differences of 1e-5 of values near 100 carry 1e-9 of rounding and of curvature.
      EXPECT_NEAR(gradient[i] / expected[i], 1.0, 1e-5) << "setting " << g << ", coordinate " << i;
    }
  }
}

TEST(HistoryModel, GradientHoldsWhereAConditionIsLeftOut) {
  const HistoryModel model = make_model();
  const WhitenedData seen = seen_by(model, 4, make_simulator());
  VectorXd t = kT, gradient, none;
  t[1] = 0.0;
  model.log_likelihood(seen, std::log(kVariance), t, &gradient);
  const auto f = [&](const VectorXd& v) {
    return model.log_likelihood(seen, v[0], Eigen::Vector3d(std::exp(v[1]), 0.0, std::exp(v[2])));
  };
  const VectorXd expected =
      numerical_gradient(f, Eigen::Vector3d(std::log(kVariance), std::log(kT[0]), std::log(kT[2])));
  EXPECT_NEAR(gradient[0] / expected[0], 1.0, 1e-5);
  EXPECT_NEAR(gradient[1] / expected[1], 1.0, 1e-5);
  EXPECT_EQ(gradient[2], 0.0);  // d / d log t = t d / d t
  EXPECT_NEAR(gradient[3] / expected[2], 1.0, 1e-5);

  model.log_likelihood(seen, std::log(kVariance), VectorXd::Zero(3), &none);
  const VectorXd at_none = numerical_gradient(
      [&](const VectorXd& v) { return model.log_likelihood(seen, v[0], VectorXd::Zero(3)); },
      VectorXd::Constant(1, std::log(kVariance)));
  EXPECT_NEAR(none[0] / at_none[0], 1.0, 1e-5);
  EXPECT_EQ(none.tail(3), VectorXd::Zero(3));
}

TEST(HistoryModel, GivenAPointItIsTheSameFunctionOfTheCoefficients) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  for (int g : {0, 7, 12, 26}) {
    for (const VectorXd& t : {kT, VectorXd(Eigen::Vector3d(0.8, 0.0, 0.1)), VectorXd(VectorXd::Zero(3))}) {
      const CoefficientLikelihood given = model.given(at(g, t));
      EXPECT_NEAR(given.log_density(kMean, kSpread), log_likelihood(model, at(g, t)), kRounding) << g;
      const MatrixXd seen =
          dense_covariance(data, at(g, t)) + data.basis * kSpread.asDiagonal() * data.basis.transpose();
      const MatrixXd expected = data.basis.transpose() * seen.ldlt().solve(data.basis);
      const VectorXd size = expected.diagonal().cwiseSqrt();
      // Relative to what each coefficient is known to: they differ by orders of magnitude.
      EXPECT_LT(((given.information(kSpread) - expected).array() / (size * size.transpose()).array())
                    .abs()
                    .maxCoeff(),
                1e-9)
          << g;
    }
  }
}

TEST(HistoryModel, CoefficientsAreThePosteriorMean) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  for (int g : {5, 14, 26}) {
    for (const VectorXd& t : {kT, VectorXd(Eigen::Vector3d(0.8, 0.0, 0.1))}) {
      const MatrixXd seen =
          dense_covariance(data, at(g, t)) + data.basis * kSpread.asDiagonal() * data.basis.transpose();
      const VectorXd expected = prior_variances(data, t).asDiagonal() * dense_psi(data, g).transpose() *
                                seen.ldlt().solve(data.y - data.basis * kMean);
      // Coefficients of the order of 1, rounded as above.
      EXPECT_LT((model.coefficients(at(g, t), kMean, kSpread) - expected).cwiseAbs().maxCoeff(), 1e-9) << g;
    }
  }
}

TEST(HistoryModel, QuadraticFormIsTheDenseOne) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  const GaussianSimulator simulator = make_simulator();
  const VectorXd r = data.y - data.basis * kMean;
  for (int g : {0, 14, 26}) {
    const MatrixXd moves = data.basis * simulator.root;
    const double expected =
        r.dot((dense_covariance(data, at(g)) + moves * moves.transpose()).ldlt().solve(r));
    EXPECT_NEAR(model.quadratic(seen_by(model, g, simulator), std::log(kVariance), kT), expected,
                1e-9 * expected);
  }
}

TEST(HistoryModel, WithheldIsWhatTheReachTakesOutOfTheResponses) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  EXPECT_LT((model.data().responses - standardised(data)).cwiseAbs().maxCoeff(), 1e-13);
  for (int g : {0, 13, 26}) {
    const MatrixXd psi = standardised(data) - data.moves * model.withheld(g);
    EXPECT_LT((psi - dense_psi(data, g)).cwiseAbs().maxCoeff(), 1e-10) << g;
  }
  EXPECT_EQ(model.withheld(26).cwiseAbs().maxCoeff(), 0.0);  // free
  EXPECT_GT((data.moves * model.withheld(13)).cwiseAbs().maxCoeff(), 0.05);
}

TEST(HistoryModel, ReachRunsFromNothingOfTheSimulatorsSpaceToFree) {
  const HistoryData data = make_data();
  HistoryPriors priors = make_priors();
  priors.reach = {1e-6, 1e9, kInfinity};
  const HistoryModel model(data, priors, Context());
  const MatrixXd phi = standardised(data);
  const MatrixXd o = data.moves.householderQr().householderQ() * MatrixXd::Identity(kN, 2);
  const MatrixXd psi = phi - data.moves * model.withheld(0);
  // What is left of a direction is (c / s^2)^2, s^2 at least 1 and c = 5e-7.
  EXPECT_LT((o.transpose() * psi).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((psi - (phi - o * (o.transpose() * phi))).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_NEAR(log_likelihood(model, at(9)), log_likelihood(model, at(18)), kRounding);
}

TEST(HistoryModel, ReachIsFreeWhereTheSimulatorDoesNotMove) {
  HistoryData data = make_data();
  data.moves.resize(0, 0);
  const HistoryModel model = make_model(data);
  EXPECT_EQ(log_likelihood(model, at(4)), log_likelihood(model, at(22)));
}

TEST(HistoryModel, OtherResponsesAreSeenAsAModelMadeOfThemSeesThem) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  HistoryData other = data;
  other.responses << data.responses.bottomRows(15), data.responses.topRows(kN - 15);
  const HistoryModel expected = make_model(other);
  for (int g : {0, 14, 26}) {
    const WhitenedData own = model.whiten(g, standardised(other)), &direct = expected.whitened(g);
    // Entries that belong to the large vector of the basis are of the order of 1e9.
    const VectorXd size = direct.gram.diagonal().cwiseSqrt();
    EXPECT_LT(((own.gram - direct.gram).array() / (size * size.transpose()).array()).abs().maxCoeff(), 1e-12);
    EXPECT_LT(
        ((own.cross - direct.cross).array() / (size * std::sqrt(direct.square)).array()).abs().maxCoeff(),
        1e-12);
    EXPECT_EQ(own.square, direct.square);
    EXPECT_EQ(own.log_det, direct.log_det);
    EXPECT_EQ(own.size, kN);
    EXPECT_EQ(own.coefficients, kQ);
  }
}

TEST(HistoryModel, LikelihoodOfRunsIsTheDenseOneOfTheirResiduals) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  const MatrixXd runs = (data.basis * kMean).replicate(1, 5) + normal_matrix(kN, 5, 52);
  const std::vector<HistoryParameters> points{
      at(13), {2, 0.3, kT}, at(13, VectorXd::Zero(3)), at(26), {13, 1.7, Eigen::Vector3d(0.0, 1.0, 2.0)}};
  Context two;
  two.threads = 2;
  const VectorXd own = model.log_likelihood_of_runs(points, runs, Context());
  for (Index i = 0; i < 5; ++i)
    EXPECT_NEAR(
        own[i],
        log_normal_density(data.y, runs.col(i), dense_covariance(data, points[static_cast<std::size_t>(i)])),
        kRounding)
        << i;
  EXPECT_EQ(model.log_likelihood_of_runs(points, runs, two), own);
}

TEST(HistoryModel, ConditionWithoutVarianceIsAModelWithoutItsColumns) {
  const HistoryData data = make_data();
  HistoryData less = data;
  less.responses.resize(kN, 4);
  less.responses << data.responses.leftCols(2), data.responses.rightCols(2);
  less.condition = {0, 0, 1, 1};
  const HistoryModel full = make_model(data), reduced = make_model(less);
  for (int g : {0, 14, 26}) {
    EXPECT_NEAR(log_likelihood(full, at(g, Eigen::Vector3d(0.8, 0.0, 0.1))),
                log_likelihood(reduced, at(g, Eigen::Vector2d(0.8, 0.1))), 1e-10);
  }
}

TEST(HistoryModel, UnitsOfTheConditionsDoNotMatter) {
  HistoryData scaled = make_data();
  scaled.responses = (scaled.responses * 1000.0).array() - 273.15;
  EXPECT_NEAR(log_likelihood(make_model(), at(5)), log_likelihood(make_model(scaled), at(5)), 1e-9);
  scaled = make_data();
  scaled.responses *= 1e-15;
  EXPECT_NEAR(log_likelihood(make_model(), at(5)), log_likelihood(make_model(scaled), at(5)), 1e-9);
}

// The sine of whole turns, beside its cosine.
TEST(HistoryModel, RoundingIsNoResponse) {
  HistoryData data = make_data(), zero = data;
  data.responses.col(3) = 1e-16 * normal_vector(kN, 7);
  zero.responses.col(3).setZero();
  EXPECT_NEAR(log_likelihood(make_model(data), at(5)), log_likelihood(make_model(zero), at(5)), 1e-9);
}

TEST(HistoryModel, ConditionThatNeverChangesHasNoEffect) {
  HistoryData data = make_data();
  data.responses.col(2).setConstant(17.0);
  const HistoryModel model = make_model(data);
  EXPECT_NEAR(log_likelihood(model, at(4)), log_likelihood(model, at(4, Eigen::Vector3d(kT[0], 0.0, kT[2]))),
              1e-9);
}

TEST(HistoryModel, OneAndTwoThreadsGiveTheSameBits) {
  Context two;
  two.threads = 2;
  const HistoryModel a = make_model(), b(make_data(), make_priors(), two);
  for (int g = 0; g < kSettings; ++g) EXPECT_EQ(log_likelihood(a, at(g)), log_likelihood(b, at(g)));
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
  HistoryPriors priors = make_priors();
  priors.reach = {kInfinity};
  const HistoryModel model(data, priors, Context(), {5});
  const WhitenedData& own = model.whitened(5);
  // All rows at once.
  const Whitener whitener(data.axis, kTimes, priors.error.setting(5));
  const VectorXd r = data.y - data.basis * MatrixXd(data.basis.householderQr().solve(data.y));
  MatrixXd columns(n, 7);
  columns << data.basis, model.data().responses;
  const MatrixXd b = whitener(columns);
  const VectorXd left = whitener(r), size = b.colwise().norm().transpose();
  // Sums of 2600 terms, relative to the sizes of the columns.
  EXPECT_LT(((own.gram - b.transpose() * b).array() / (size * size.transpose()).array()).abs().maxCoeff(),
            1e-13);
  EXPECT_LT(((own.cross - b.transpose() * left).array() / (size * left.norm()).array()).abs().maxCoeff(),
            1e-12);
  EXPECT_NEAR(own.square / left.squaredNorm(), 1.0, 1e-12);
  EXPECT_EQ(own.size, n);
}

TEST(HistoryModel, RefusesDataThatDoNotFit) {
  const auto refuses = [](const std::function<void(HistoryData&)>& spoil) {
    HistoryData data = make_data();
    spoil(data);
    EXPECT_THROW(make_model(data), std::invalid_argument);
  };
  refuses([](HistoryData& data) { data.y.conservativeResize(kN - 1); });
  refuses([](HistoryData& data) { data.condition.pop_back(); });
  refuses([](HistoryData& data) { data.condition[2] = -1; });
  refuses([](HistoryData& data) { data.basis = normal_matrix(kN, kN, 1); });
  refuses([](HistoryData& data) { data.basis.col(1).setZero(); });
  refuses([](HistoryData& data) { data.moves = MatrixXd::Ones(2, 2); });
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refuses([=](HistoryData& data) { data.y[3] = nan; });
  refuses([](HistoryData& data) { data.basis(3, 1) = kInfinity; });
  refuses([=](HistoryData& data) { data.responses(3, 1) = nan; });
  refuses([=](HistoryData& data) { data.moves(3, 1) = nan; });
}

TEST(HistoryModel, RefusesPriorsWithoutMeaning) {
  const auto refuses = [](const std::function<void(HistoryPriors&)>& spoil) {
    HistoryPriors priors = make_priors();
    spoil(priors);
    EXPECT_THROW(HistoryModel(make_data(), priors, Context()), std::invalid_argument);
  };
  refuses([](HistoryPriors& priors) { priors.noise_sd = 0.0; });
  refuses([](HistoryPriors& priors) { priors.noise_sd = kInfinity; });
  refuses([](HistoryPriors& priors) { priors.noise_sd = 1e-200; });
  refuses([](HistoryPriors& priors) { priors.noise_shape = kInfinity; });
  refuses([](HistoryPriors& priors) { priors.discarded_variance = kInfinity; });
  refuses([](HistoryPriors& priors) { priors.amplitude = kInfinity; });
  refuses([](HistoryPriors& priors) { priors.noise_shape = 0.0; });
  refuses([](HistoryPriors& priors) { priors.discarded_variance = -1.0; });
  refuses([](HistoryPriors& priors) { priors.inclusion = 0.0; });
  refuses([](HistoryPriors& priors) { priors.amplitude = 0.0; });
  refuses([](HistoryPriors& priors) { priors.reach = {}; });
  refuses([](HistoryPriors& priors) { priors.reach = {1.0, 0.0}; });
  refuses([](HistoryPriors& priors) { priors.reach = {std::numeric_limits<double>::quiet_NaN()}; });
}

TEST(HistoryCoordinates, MapToThePriorsQuantiles) {
  HistoryPriors priors = make_priors();
  priors.discarded_variance = 0.03;
  const HistoryModel model(make_data(), priors, Context());
  const HistoryCoordinates coordinates(model, {0, 2});
  ASSERT_EQ(coordinates.dimension(), 1 + 2 + 1 + 2);
  // lambda* ~ Gamma(a*, rate a* sd^2); sqrt(t) ~ half-Cauchy(amplitude).
  const boost::math::gamma_distribution<> precision(
      priors.noise_shape, 1 / (priors.noise_shape * priors.noise_sd * priors.noise_sd));
  const boost::math::cauchy cauchy(0.0, priors.amplitude);
  const boost::math::normal normal;
  for (double u : {0.03, 0.5, 0.9, 0.99}) {
    const HistoryParameters point = coordinates.parameters(VectorXd::Constant(6, quantile(normal, u)));
    EXPECT_NEAR(cdf(precision, 1.0 / (point.variance - 0.03)), u, 1e-9);  // iterations of the quantile
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
  // Trapezoidal rule over the prior N(0, I): accurate to rounding for a smooth integrand.
  const int m = 400;
  const double h = 16.0 / m;
  VectorXd log_terms((m + 1) * (m + 1));
  MatrixXd row(2, m + 1);
  for (int i = 0; i <= m; ++i) {
    for (int j = 0; j <= m; ++j) row.col(j) = Eigen::Vector2d(-8 + h * i, -8 + h * j);
    log_terms.segment(i * (m + 1), m + 1) =
        target.log_likelihood(row) - 0.5 * row.colwise().squaredNorm().transpose();
  }
  const double truth = log_sum_exp(log_terms) - kLogTwoPi + 2.0 * std::log(h);
  const AisResult result = sample_ais(target, {}, Context());
  EXPECT_TRUE(result.trusted) << result.verdict;
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

TEST(FilterBank, RefusesWrongLengthsAndImpossibleTimes) {
  const TimeAxis axis = even_axis(10);
  EXPECT_THROW(FilterBank(VectorXd::Zero(9), {0}, VectorXd::Ones(1), axis), std::invalid_argument);
  EXPECT_THROW(FilterBank(VectorXd::Zero(10), {0}, -VectorXd::Ones(1), axis), std::invalid_argument);
  for (double constant : {std::numeric_limits<double>::quiet_NaN(), kInfinity}) {
    const VectorXd constants = VectorXd::Constant(1, constant);
    EXPECT_THROW(FilterBank(VectorXd::Zero(10), {0}, constants, axis), std::invalid_argument);
  }
}

}  // namespace
}  // namespace amiss
