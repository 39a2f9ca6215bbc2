#include <gtest/gtest.h>

#include <cmath>

#include "engine/ais/BentMap.hpp"
#include "engine/ais/SkewedMixture.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

// A thin sheet about a parabola, turned.
MatrixXd bent_cloud(Index n, double thickness) {
  MatrixXd x = normal_matrix(3, n, 301);
  x.row(2) = 0.4 * x.row(0).array().square() + 0.3 * x.row(0).array() * x.row(1).array() +
             thickness * x.row(2).array();
  const MatrixXd turn = Eigen::HouseholderQR<MatrixXd>(normal_matrix(3, 3, 302)).householderQ();
  return turn * x;
}

TEST(BentMap, StraightensACurvedSheet) {
  const Index n = 600;
  const double thickness = 0.02;
  const MatrixXd x = bent_cloud(n, thickness);
  const BentMap map = BentMap::fit(x, VectorXd::Constant(n, 1.0 / n));
  ASSERT_TRUE(map.bends());
  const MatrixXd z = map.straight(x);
  EXPECT_LT((map.bent(z) - x).cwiseAbs().maxCoeff(), 1e-12);
  // The axes of the cloud are not quite those of the sheet: cubic terms leave a tenth of what quadratic ones
  // did.
  const auto thinnest = [](const MatrixXd& points) {
    const MatrixXd apart = points.colwise() - points.rowwise().mean();
    return std::sqrt(Eigen::SelfAdjointEigenSolver<MatrixXd>(apart * apart.transpose()).eigenvalues()[0] / n);
  };
  EXPECT_GT(thinnest(x), 10 * thickness);
  EXPECT_LT(thinnest(z), 0.4 * thinnest(x));
}

// Across its axis a parabola is a curve, along it two: at a bend of 0.7 it is as long as wide, and has no
// widest axis; at 2 that is the wrong one.
TEST(BentMap, StraightensAParabolaLongerThanWide) {
  const Index n = 600;
  const double thickness = 0.02;
  for (double bend : {0.3, 0.7, 2.0}) {
    MatrixXd x = normal_matrix(2, n, 305);
    x.row(1) = bend * x.row(0).array().square() + thickness * x.row(1).array();
    const MatrixXd turned = Eigen::Rotation2Dd(0.4).toRotationMatrix() * x;
    const BentMap map = BentMap::fit(turned, VectorXd::Constant(n, 1.0 / n));
    ASSERT_TRUE(map.bends());
    const MatrixXd z = map.straight(turned);
    const auto sd = [&](Index j) { return std::sqrt((z.row(j).array() - z.row(j).mean()).square().mean()); };
    // The direction across is estimated; what is left of the bend is a part of the thickness.
    EXPECT_LT(sd(1), 1.5 * thickness) << bend;
    EXPECT_NEAR(sd(0), 1.0, 0.2) << bend;
  }
}

TEST(BentMap, KeepsVolumesAndItsGradientIsTheDerivative) {
  const Index n = 600;
  const MatrixXd x = bent_cloud(n, 0.02);
  const BentMap map = BentMap::fit(x, VectorXd::Constant(n, 1.0 / n));
  const VectorXd direction = Eigen::Vector3d(0.3, -1.2, 0.7);
  for (Index i = 0; i < 5; ++i) {
    MatrixXd slope(3, 3);  // dz / dx by central differences
    for (Index j = 0; j < 3; ++j) {
      const VectorXd step = 1e-5 * VectorXd::Unit(3, j);
      slope.col(j) = (map.straight(x.col(i) + step) - map.straight(x.col(i) - step)) / 2e-5;
    }
    EXPECT_NEAR(std::abs(slope.determinant()), 1.0, 1e-6);
    EXPECT_LT((map.gradient(x.col(i), direction) - slope.transpose() * direction).norm(), 1e-6);
  }
}

TEST(BentMap, LeavesAnEllipticCloudAsItIs) {
  const Index n = 800;
  const MatrixXd x = normal_matrix(4, 4, 303) * normal_matrix(4, n, 304);
  EXPECT_FALSE(BentMap::fit(x, VectorXd::Constant(n, 1.0 / n)).bends());
}

TEST(SkewedMixture, ComesCloserToACurvedSheetThanAnEllipticMixture) {
  const Index n = 2000;
  const MatrixXd x = bent_cloud(n, 0.02);
  const VectorXd weights = VectorXd::Constant(n, 1.0 / n);
  Stream stream(1, 2, 3), other(1, 2, 3);
  const SkewedMixture bent = SkewedMixture::fit(x, weights, 3, 8.0, stream);
  const StudentTMixture elliptic = StudentTMixture::fit(x, weights, 3, 8.0, other);
  EXPECT_GT((bent.log_densities(x) - elliptic.log_densities(x)).mean(), 0.3);
}

}  // namespace
}  // namespace amiss
