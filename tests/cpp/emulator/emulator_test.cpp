#include <gtest/gtest.h>

#include <stdexcept>

#include "emulator_helpers.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss {
namespace {

using namespace test;

// A simulator with three parameters, of which the last does nothing.
VectorXd simulate(const VectorXd& u) {
  VectorXd y(50);
  for (Index i = 0; i < y.size(); ++i) {
    const double t = 0.1 * static_cast<double>(i);
    y[i] = 20 + 4 * u[0] * std::exp(-t * (0.2 + u[1])) + std::sin(3 * u[1] + t);
  }
  return y;
}

struct Trained {
  MatrixXd inputs = uniform_matrix(40, 3, 31);
  MatrixXd outputs = MatrixXd(50, 40);
  Basis basis;
  Trained() {
    for (Index m = 0; m < 40; ++m) outputs.col(m) = simulate(inputs.row(m));
    BasisOptions options;
    options.explained = 0.9999;
    basis = make_basis(outputs, options);
  }
  Emulator emulator(int threads = 1, bool forward = false) const {
    Context context;
    context.threads = threads;
    EmulatorOptions options;
    options.search.forward = forward;
    return Emulator::train(inputs, basis, options, context);
  }
};

TEST(Emulator, PredictsRunsItHasNotSeenAndKnowsHowWell) {
  const Trained trained;
  const MatrixXd points = uniform_matrix(300, 3, 32);
  MatrixXd mean, variance, truth(300, 50);
  trained.emulator().predict(points, mean, variance);
  for (Index i = 0; i < 300; ++i) truth.row(i) = simulate(points.row(i)).transpose();
  const MatrixXd error = mean * trained.basis.vectors.transpose() - truth;
  const double spread = (truth.rowwise() - truth.colwise().mean()).norm();
  EXPECT_LT(error.norm() / spread, 0.03);  // R2 above 0.999 for a smooth response

  // The first and the last coefficient (the mean) against their own 95 % intervals. A process fitted by its
  // mode is somewhat over-confident, and errors of neighbouring points are alike: 80 % of 300 points is
  // demanded.
  const MatrixXd own = trained.basis.vectors.colPivHouseholderQr().solve(truth.transpose()).transpose();
  for (Index q : {Index(0), mean.cols() - 1}) {
    const Eigen::ArrayXd z = (own.col(q) - mean.col(q)).array() / variance.col(q).array().sqrt();
    EXPECT_GT((z.abs() < 1.96).count(), 240) << "coefficient " << q;
    EXPECT_GT(std::sqrt(z.square().mean()), 0.1) << "intervals of coefficient " << q << " are far too wide";
  }
}

TEST(Emulator, RunsOnTheDesignAreReproduced) {
  const Trained trained;
  MatrixXd mean, variance;
  trained.emulator().predict(trained.inputs, mean, variance);
  const MatrixXd& truth = trained.basis.coefficients;
  const VectorXd spread = (truth.rowwise() - truth.colwise().mean()).colwise().norm();
  EXPECT_LT((mean.col(0) - truth.col(0)).norm() / spread[0], 0.01);
  EXPECT_LT((mean.rightCols(1) - truth.rightCols(1)).norm() / spread.tail(1)[0], 0.01);
}

TEST(Emulator, TrainsEachCoefficientWithTheStatedNoisePrior) {
  const Trained trained;
  const Basis& basis = trained.basis;
  const double discarded = (trained.outputs - basis.vectors * basis.coefficients.transpose()).squaredNorm();
  const double default_rate = std::sqrt(2.220446049250313e-16) * basis.vectors.col(0).squaredNorm();
  EmulatorOptions given;
  given.priors.lambda = {500.0, 0.3};
  given.priors.beta = {2.0, 1.5};
  for (const EmulatorOptions& options : {EmulatorOptions(), given}) {
    const bool is_default = std::isnan(options.priors.lambda.rate);
    const EmulatorState state = Emulator::train(trained.inputs, basis, options, Context()).state();
    const double shape = (is_default ? 2.0 : 500.0) + 40.0 * static_cast<double>(50 - basis.size()) / 2.0;
    // The first vector is scaled by the largest singular value.
    const double rate = (is_default ? default_rate : 0.3) + 0.5 * discarded;
    for (Index q = 0; q < basis.size(); ++q) {
      const VectorXd w = basis.coefficients.col(q);
      const double centre = w.mean(), sd = std::sqrt((w.array() - centre).square().sum() / 39.0);
      const VectorXd standard = (w.array() - centre) / sd;
      // In units of sd, lambda is larger by sd^2.
      const HyperPriors prior{
          {shape, rate / (basis.vectors.col(q).squaredNorm() * sd * sd)}, {}, {}, options.priors.beta};
      const VectorXd own = state.parameters.row(q).transpose();
      VectorXd none(0);
      GaussianProcess process = GaussianProcess::fit(trained.inputs, standard, prior, {});
      process.widen(prior);
      const double fitted =
          GaussianProcess::log_density(trained.inputs, standard, prior, process.parameters().pack(), none);
      EXPECT_NEAR(GaussianProcess::log_density(trained.inputs, standard, prior, own, none), fitted,
                  1e-4 * std::abs(fitted))
          << "coefficient " << q;
      EXPECT_NEAR(own[2], std::log((prior.lambda.shape - 1) / prior.lambda.rate), 1.0) << "coefficient " << q;
    }
  }
}

// Steep at one edge and flat elsewhere, which no covariance that is the same everywhere expects.
TEST(Emulator, VariancesAreWidenedToTheLeaveOneOutErrors) {
  const MatrixXd inputs = uniform_matrix(60, 2, 35);
  Basis basis;
  basis.vectors = MatrixXd::Ones(3, 1);
  basis.coefficients = (0.05 + inputs.col(0).array()).inverse() + inputs.col(1).array();
  basis.singular_values = VectorXd::Ones(1);
  const Emulator emulator = Emulator::train(inputs, basis, {}, Context());
  MatrixXd mean, variance;
  emulator.leave_one_out(mean, variance);
  EXPECT_GT(emulator.widened()[0], 1.1);
  EXPECT_NEAR(mean_square(basis.coefficients - mean, variance), 1.0, 1e-9);
  EXPECT_THROW(Emulator(emulator.state()).leave_one_out(mean, variance), std::logic_error);
}

// Means and standard deviations of the series at new points.
void predict_series(const MatrixXd& outputs, MatrixXd& mean, MatrixXd& sd) {
  BasisOptions options;
  options.explained = 0.9999;
  const Basis basis = make_basis(outputs, options);
  MatrixXd m, v;
  Emulator::train(Trained().inputs, basis, {}, Context()).predict(uniform_matrix(20, 3, 36), m, v);
  mean = m * basis.vectors.transpose();
  sd = (v * basis.vectors.cwiseAbs2().transpose()).cwiseSqrt();
}

TEST(Emulator, UnitAndOriginOfTheOutputsChangeNothingElse) {
  const MatrixXd outputs = Trained().outputs;
  MatrixXd mean, sd, m, s;
  predict_series(outputs, mean, sd);
  const auto compare = [&](double unit, double shift) {
    predict_series((unit * outputs).array() + shift, m, s);
    // The search ends where the density, of size 100, changes by 1e-7 of it, on slightly other paths. A shift
    // of 1e6 leaves 10 digits of the outputs.
    EXPECT_LT(((m.array() - shift) / unit - mean.array()).abs().maxCoeff(), 1e-6) << unit << ", " << shift;
    EXPECT_LT((s.array() / (unit * sd.array()) - 1.0).abs().maxCoeff(), 1e-6) << unit << ", " << shift;
  };
  for (double unit : {1e-12, 1e-9, 1e9, 1e12}) compare(unit, 0.0);
  compare(1.0, 1e6);
  compare(1e6, 1e6);
}

TEST(Emulator, StateMakesTheSameEmulatorAgain) {
  const Emulator emulator = Trained().emulator();
  const Emulator again(emulator.state());
  const MatrixXd points = uniform_matrix(20, 3, 33);
  MatrixXd mean, variance, mean2, variance2;
  emulator.predict(points, mean, variance);
  again.predict(points, mean2, variance2);
  EXPECT_EQ(mean, mean2);
  EXPECT_EQ(variance, variance2);
}

TEST(Emulator, OneAndTwoThreadsGiveTheSameBits) {
  const Trained trained;
  for (bool forward : {false, true})
    EXPECT_EQ(trained.emulator(1, forward).state().parameters,
              trained.emulator(2, forward).state().parameters);
}

TEST(Emulator, LeaveOneOutIsInTheCoefficientsOwnScale) {
  const Trained trained;
  const Emulator emulator = trained.emulator();
  MatrixXd mean, variance;
  emulator.leave_one_out(mean, variance);
  const Basis& basis = trained.basis;
  const double first = basis.singular_values[0];
  const double rate = std::sqrt(2.220446049250313e-16) * first * first + 0.5 * basis.discarded_ss;
  for (Index q : {Index(0), basis.size() - 1}) {
    const VectorXd w = basis.coefficients.col(q);
    const double centre = w.mean(), sd = std::sqrt((w.array() - centre).square().sum() / 39.0);
    const HyperPriors priors{{2.0 + 20.0 * static_cast<double>(50 - basis.size()),
                              rate / (basis.vectors.col(q).squaredNorm() * sd * sd)},
                             {},
                             {},
                             {}};
    GaussianProcess process = GaussianProcess::fit(trained.inputs, (w.array() - centre) / sd, priors, {});
    VectorXd m, v;
    process.leave_one_out(priors, m, v);
    process.widen(priors);
    EXPECT_EQ(process.widened, emulator.widened()[q]);
    EXPECT_LT((mean.col(q) - centre * VectorXd::Ones(40) - sd * m).cwiseAbs().maxCoeff(), 1e-12 * sd);
    EXPECT_LT((variance.col(q).array() / (process.widened * sd * sd * v.array()) - 1.0).abs().maxCoeff(),
              1e-12);
  }
}

TEST(Emulator, PredictionIsInTheCoefficientsOwnScale) {
  const Emulator emulator = Trained().emulator();
  const EmulatorState state = emulator.state();
  const MatrixXd points = uniform_matrix(8, 3, 35);
  MatrixXd mean, variance;
  emulator.predict(points, mean, variance);
  VectorXd m(8), v(8);
  for (Index q = 0; q < mean.cols(); ++q) {
    const VectorXd w = state.coefficients.col(q);
    const double centre = w.mean(), sd = std::sqrt((w.array() - centre).square().sum() / 39.0);
    const auto p = GaussianProcessParameters::unpack(state.parameters.row(q).transpose());
    GaussianProcess(state.inputs, (w.array() - centre) / sd, p).predict(points, m, v);
    // Rounding of centre and scale, enlarged by the condition number of a nearly interpolating covariance.
    EXPECT_LT((mean.col(q).array() - centre - sd * m.array()).abs().maxCoeff(), 1e-5 * sd) << q;
    const double noise =
        std::exp(p.log_nugget) + std::exp(-p.log_lambda);  // a run varies about the smooth part
    EXPECT_LT((variance.col(q).array() / (sd * sd * (v.array() + noise)) - 1.0).abs().maxCoeff(), 1e-5) << q;
  }
}

TEST(Emulator, CoefficientThatNeverChangesIsPredictedByItsValue) {
  Basis basis = Trained().basis;
  basis.coefficients.col(basis.size() - 1).setConstant(4.5);
  const Emulator emulator = Emulator::train(Trained().inputs, basis, {}, Context());
  MatrixXd mean, variance;
  emulator.predict(uniform_matrix(5, 3, 34), mean, variance);
  EXPECT_LT((mean.rightCols(1).array() - 4.5).abs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace amiss
