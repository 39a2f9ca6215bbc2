#include <gtest/gtest.h>

#include <stdexcept>

#include "calibration_helpers.hpp"
#include "engine/calibration/ResponseEvidence.hpp"

namespace amiss {
namespace {

using namespace test;

// Where the noise is known and no condition drives a discrepancy, the record is normal: with K, the tangent
// and the responses written down as one covariance. Two of the responses say the same, one is in the span of
// K.
TEST(ResponseEvidence, IsThatOfOneNormalDistribution) {
  HistoryData data = make_data();
  HistoryPriors priors = make_priors({VectorXd::Constant(1, 2.0), VectorXd::Zero(1)});
  priors.noise_shape = 1e7;
  priors.inclusion = 1e-9;
  const GaussianSimulator tangent{Eigen::Vector2d(0.012, 21.0),
                                  (MatrixXd(2, 2) << 0.01, 0.0, -0.2, 0.5).finished()};
  MatrixXd responses(kN, 3);
  responses << data.axis.time, data.axis.time, 0.4 * data.basis.col(1);
  data.y += 0.5 * responses.col(0);
  const auto closed = [&](const MatrixXd& r) {
    const MatrixXd moves = data.basis * tangent.root;
    return log_normal_density(
        data.y, data.basis * tangent.mean,
        kNoise * kNoise * MatrixXd::Identity(kN, kN) + moves * moves.transpose() + r * r.transpose());
  };
  AisOptions options;
  options.precision = 0.02;
  for (Index k : {0, 1, 3}) {
    const MatrixXd shown = responses.leftCols(k);
    const AisResult own = response_evidence(data, priors, tangent, shown, options, Context());
    EXPECT_NEAR(own.log_evidence, closed(shown), 0.05) << k;  // sigma varies by 2e-4
  }
  EXPECT_GT(closed(responses), closed(responses.leftCols(0)) + 3.0);  // the record asks for them
  EXPECT_THROW(response_evidence(data, priors, tangent, responses.topRows(3), options, Context()),
               std::invalid_argument);
}

}  // namespace
}  // namespace amiss
