#include <gtest/gtest.h>

#include <stdexcept>

#include "calibration_helpers.hpp"
#include "engine/calibration/TangentPosterior.hpp"

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
