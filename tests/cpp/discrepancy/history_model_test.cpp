#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "engine/discrepancy/HistoryModel.hpp"
#include "history_helpers.hpp"

namespace amiss {
namespace {

using namespace test;

const VectorXd kT = Eigen::Vector3d(0.8, 2.5, 0.1);
constexpr double kVariance = 0.6;

HistoryParameters at(int setting, const VectorXd& t = kT) { return {setting, kVariance, t}; }

double log_likelihood(const HistoryModel& model, const HistoryParameters& p) {
  return model.log_likelihood(p, kMean, kSpread);
}

WhitenedData seen_by(const HistoryModel& model, int setting, const GaussianSimulator& simulator) {
  return model.whitened(setting).in_terms_of(simulator.mean - model.reference(), simulator.root);
}

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

TEST(HistoryModel, CoefficientsHaveThePosteriorMeanAndCovariance) {
  const HistoryData data = make_data();
  const HistoryModel model = make_model(data);
  for (int g : {5, 14, 26}) {
    for (const VectorXd& t : {kT, VectorXd(Eigen::Vector3d(0.8, 0.0, 0.1))}) {
      const MatrixXd seen =
          dense_covariance(data, at(g, t)) + data.basis * kSpread.asDiagonal() * data.basis.transpose();
      const MatrixXd prior = prior_variances(data, t).asDiagonal();
      const MatrixXd across = prior * dense_psi(data, g).transpose();
      const VectorXd mean = across * seen.ldlt().solve(data.y - data.basis * kMean);
      const MatrixXd covariance = prior - across * seen.ldlt().solve(MatrixXd(across.transpose()));
      const HistoryModel::Coefficients found = model.coefficients(at(g, t), kMean, kSpread);
      // Coefficients of the order of 1, rounded as above.
      EXPECT_LT((found.mean - mean).cwiseAbs().maxCoeff(), 1e-9) << g;
      EXPECT_LT((found.root * found.root.transpose() - covariance).cwiseAbs().maxCoeff(), 1e-9) << g;
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
  // One run at all points is that run once for each.
  EXPECT_EQ(model.log_likelihood_of_runs(points, runs.leftCols(1), two),
            model.log_likelihood_of_runs(points, runs.leftCols(1).replicate(1, 5), two));
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
  refuses([](HistoryData& data) { data.responses(3, 1) = 1e156; });  // its square is no number
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
  refuses([](HistoryPriors& priors) { priors.noise_sd = 1e-124; });  // of values of 1
  refuses([](HistoryPriors& priors) { priors.noise_shape = kInfinity; });
  refuses([](HistoryPriors& priors) { priors.discarded_variance = kInfinity; });
  refuses([](HistoryPriors& priors) { priors.amplitude = kInfinity; });
  refuses([](HistoryPriors& priors) { priors.noise_shape = 0.0; });
  refuses([](HistoryPriors& priors) { priors.noise_shape = 1e-173; });
  refuses([](HistoryPriors& priors) { priors.discarded_variance = -1.0; });
  refuses([](HistoryPriors& priors) { priors.inclusion = 0.0; });
  refuses([](HistoryPriors& priors) { priors.amplitude = 0.0; });
  refuses([](HistoryPriors& priors) { priors.reach = {}; });
  refuses([](HistoryPriors& priors) { priors.reach = {1.0, 0.0}; });
  refuses([](HistoryPriors& priors) { priors.reach = {std::numeric_limits<double>::quiet_NaN()}; });
}

}  // namespace
}  // namespace amiss
