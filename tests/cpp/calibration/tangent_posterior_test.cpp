#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "calibration_helpers.hpp"
#include "engine/calibration/TangentPosterior.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {
namespace {

using namespace test;

// A linear simulator is its own tangent: the posterior of its parameters at known error and discrepancy, by N
// x N matrices.
TEST(TangentPosterior, OfALinearSimulatorIsExact) {
  HistoryData data = make_data();
  const MatrixXd slopes = normal_matrix(kN, 2, 501);
  const VectorXd x0 = Eigen::Vector2d(0.3, -0.8), run = normal_vector(kN, 502);
  data.y = run + slopes * Eigen::Vector2d(0.9, 0.4) + 0.3 * normal_vector(kN, 503);
  HistoryPriors priors = make_priors(kError);
  AisOptions options;
  const TangentPosterior own = tangent_posterior(data, priors, x0, run, slopes, 12, options, Context());
  VectorXd mean = VectorXd::Zero(2);
  MatrixXd second = MatrixXd::Zero(2, 2);
  for (const HistoryParameters& p : own.history) {
    const MatrixXd phi = scaled_responses(data, p.t);
    const MatrixXd v =
        p.variance * error_covariance(data.axis, kError.correlation_times, kError.setting(p.setting)) +
        phi * phi.transpose();
    const MatrixXd solved = v.ldlt().solve(slopes);
    const MatrixXd covariance =
        (slopes.transpose() * solved + MatrixXd::Identity(2, 2)).ldlt().solve(MatrixXd::Identity(2, 2));
    const VectorXd at = covariance * (solved.transpose() * (data.y - run + slopes * x0));
    mean += at / 12;
    second += (covariance + at * at.transpose()) / 12;
  }
  EXPECT_LT((own.mean - mean).norm(), 1e-9);
  EXPECT_LT((own.covariance - (second - mean * mean.transpose())).norm(), 1e-9);
}

// The step is that of Newton with the curvature of each point alone: its score is the gradient of the mean
// density, by differences.
TEST(TangentGiven, ScoreIsTheGradientOfTheMeanDensity) {
  HistoryData data = make_data();
  const MatrixXd slopes = normal_matrix(kN, 2, 511);
  const Eigen::Vector2d x0(0.3, -0.8);
  const VectorXd run = normal_vector(kN, 512);
  data.y = run + slopes * Eigen::Vector2d(0.05, 0.02) + 0.3 * normal_vector(kN, 513);
  const HistoryPriors priors = make_priors(kError);
  const std::vector<HistoryParameters> history =
      tangent_posterior(data, priors, x0, run, slopes, 5, AisOptions(), Context()).history;
  HistoryData line = data;
  line.y += slopes * x0 - run;
  line.basis = slopes;
  const HistoryModel model(line, priors, Context());
  const auto value = [&](const VectorXd& x) {
    VectorXd each(static_cast<Index>(history.size()));
    for (std::size_t k = 0; k < history.size(); ++k)
      each[static_cast<Index>(k)] = model.log_likelihood(history[k], x, VectorXd::Zero(2));
    return log_mean_exp(each) - 0.5 * x.squaredNorm();
  };
  const TangentOptimum step = tangent_given(data, priors, history, x0, run, slopes, Context());
  const VectorXd score = step.covariance.ldlt().solve(step.mean - x0);
  for (Index i = 0; i < 2; ++i) {
    const VectorXd by = 1e-5 * VectorXd::Unit(2, i);
    EXPECT_NEAR(score[i], (value(x0 + by) - value(x0 - by)) / 2e-5, 1e-5 * (1 + std::abs(score[i])));
  }
}

TEST(TangentPosterior, AParameterThatChangesNothingKeepsItsPrior) {
  const HistoryData data = make_data();
  MatrixXd slopes = normal_matrix(kN, 3, 504);
  slopes.col(1).setZero();
  const TangentPosterior own = tangent_posterior(data, make_priors(kError), Eigen::Vector3d(0.1, 0.7, 0.2),
                                                 normal_vector(kN, 505), slopes, 6, {}, Context());
  EXPECT_EQ(own.mean[1], 0.0);
  EXPECT_EQ(own.covariance(1, 1), 1.0);
  EXPECT_EQ(own.covariance(0, 1), 0.0);
  EXPECT_THROW(tangent_posterior(data, make_priors(kError), Eigen::Vector2d(0.1, 0.7), normal_vector(kN, 505),
                                 slopes, 6, {}, Context()),
               std::invalid_argument);
}

}  // namespace
}  // namespace amiss
