#include <gtest/gtest.h>

#include <stdexcept>

#include "engine/emulator/Emulator.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

Region make_region() {
  MatrixXd root = MatrixXd::Zero(3, 3);
  root.triangularView<Eigen::Lower>() = 0.3 * normal_matrix(3, 3, 401);
  root.diagonal().array() += 0.5;
  return Region(Eigen::Vector3d(0.4, -0.7, 1.1), root, 2.5);
}

TEST(Region, InputsFillTheUnitCubeAlongItsAxes) {
  const Region region = make_region();
  EXPECT_FALSE(region.everywhere());
  EXPECT_LT((region.inputs(region.centre()).array() - 0.5).abs().maxCoeff(), 1e-14);
  for (Index j = 0; j < 3; ++j) {
    const VectorXd end = region.centre() + 2.5 * region.root().col(j);
    EXPECT_NEAR(region.inputs(end)(0, j), 1.0, 1e-12);
    EXPECT_TRUE(region.contains(region.centre() + 0.999 * (end - region.centre())));
    EXPECT_FALSE(region.contains(region.centre() + 1.001 * (end - region.centre())));
  }
}

TEST(Region, PointsArePlacedInside) {
  const Region region = make_region();
  const MatrixXd normal = 3.0 * normal_matrix(3, 200, 402), placed = region.place(normal);
  for (Index i = 0; i < 200; ++i) EXPECT_TRUE(region.contains(placed.col(i))) << i;
  EXPECT_EQ(Region().place(normal), normal);
}

TEST(Region, EverywhereTheInputsAreProbabilities) {
  EXPECT_TRUE(Region().everywhere());
  EXPECT_TRUE(Region().contains(Eigen::Vector2d(9.0, -9.0)));
  EXPECT_NEAR(Region().inputs(Eigen::Vector2d(0.0, 1.959964))(0, 1), 0.975, 1e-7);
}

TEST(Region, RefusesWhatIsNoEllipsoid) {
  const VectorXd centre = VectorXd::Zero(2);
  EXPECT_THROW(Region(centre, MatrixXd::Identity(3, 3), 1.0), std::invalid_argument);
  EXPECT_THROW(Region(centre, MatrixXd::Zero(2, 2), 1.0), std::invalid_argument);
  EXPECT_THROW(Region(centre, MatrixXd::Identity(2, 2), 0.0), std::invalid_argument);
}

TEST(Emulator, InARegionItsVarianceIsTheMedianThere) {
  EmulatorState state;
  state.region = make_region();
  state.inputs = uniform_matrix(12, 3, 403);
  state.coefficients = normal_matrix(12, 2, 404);
  state.parameters = MatrixXd::Constant(2, 6, 1.0);
  state.parameters.col(1).setConstant(-6.0);
  const Emulator emulator(state);
  const MatrixXd x = state.region.place(normal_matrix(3, 4001, 405));
  MatrixXd mean, variance, same, varying;
  emulator.predict_at(x, mean, variance);
  emulator.predict(state.region.inputs(x), same, varying);
  EXPECT_LT((mean - same).cwiseAbs().maxCoeff(), 1e-12);
  for (Index q = 0; q < 2; ++q) {
    EXPECT_EQ(variance.col(q).minCoeff(), variance.col(q).maxCoeff());
    // The median of 512 points: half of the others lie below it, within four standard errors.
    const double below = (varying.col(q).array() < variance(0, q)).cast<double>().mean();
    EXPECT_NEAR(below, 0.5, 4 * 0.5 / std::sqrt(512.0));
  }
  EXPECT_EQ(emulator.state().region.radius(), 2.5);
}

}  // namespace
}  // namespace amiss
