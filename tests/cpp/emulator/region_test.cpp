#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "engine/emulator/Emulator.hpp"
#include "engine/random/transform.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

Region make_region(const std::vector<bool>& uniform = {false, false, false}) {
  MatrixXd root = MatrixXd::Zero(3, 3);
  root.triangularView<Eigen::Lower>() = 0.3 * normal_matrix(3, 3, 401);
  root.diagonal().array() += 0.5;
  return Region(Eigen::Vector3d(0.4, -0.7, 1.1), root, 2.5, uniform);
}

const std::vector<bool> kMixed = {true, false, true};  // priors that are uniform

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

// What is linear in the probabilities of uniform priors is linear in the inputs, however far out the region
// lies.
TEST(Region, InputsAreLinearInWhatAUniformPriorIsLinearIn) {
  for (const double far : {0.0, -3.0, 3.0, -7.5, 7.5}) {
    const MatrixXd root = Eigen::Vector2d(0.6, 0.4).asDiagonal();
    const Region region(Eigen::Vector2d(far, 0.3), root, 3.0, {true, false});
    const MatrixXd x = region.place(normal_matrix(2, 50, 412)), inputs = region.inputs(x);
    const double side = far > 0 ? -1.0 : 1.0;
    MatrixXd terms(50, 3);
    terms << VectorXd::Ones(50), (side * x.row(0).transpose()).unaryExpr(&normal_cdf), x.row(1).transpose();
    terms.col(1) /= terms.col(1).cwiseAbs().maxCoeff();
    const MatrixXd left = inputs - terms * terms.colPivHouseholderQr().solve(inputs);
    EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-9) << far;
  }
}

// s - c has the mean 0 and the slope 1 on x - c, both over the normal distribution of the region.
TEST(Region, StraightenedCoordinatesAgreeWithTheOthersOnTheWhole) {
  const double centre = -1.4, sd = 0.7;
  const Region region(VectorXd::Constant(1, centre), MatrixXd::Constant(1, 1, sd), 8.0, {true});
  double mean = 0.0, slope = 0.0;
  constexpr int kSteps = 4000;  // of the trapezium rule, exact to rounding where a smooth integrand vanishes
  for (int k = 0; k <= kSteps; ++k) {
    const double t = -8.0 + 16.0 * k / kSteps, weight = normal_density(t) * 16.0 / kSteps;
    const double s = (region.inputs(VectorXd::Constant(1, centre + sd * t))(0, 0) - 0.5) * 2.0 * 8.0;
    mean += weight * s;
    slope += weight * s * t;
  }
  EXPECT_NEAR(mean, 0.0, 1e-10);
  EXPECT_NEAR(slope, 1.0, 1e-10);
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
  const std::vector<bool> neither = {false, false}, first = {true, false};
  EXPECT_THROW(Region(centre, MatrixXd::Identity(3, 3), 1.0, neither), std::invalid_argument);
  EXPECT_THROW(Region(centre, MatrixXd::Zero(2, 2), 1.0, neither), std::invalid_argument);
  EXPECT_THROW(Region(centre, Eigen::Vector2d(1.0, 1e-310).asDiagonal(), 1.0, neither),
               std::invalid_argument);
  EXPECT_THROW(Region(centre, MatrixXd::Identity(2, 2), 0.0, neither), std::invalid_argument);
  EXPECT_THROW(Region(centre, MatrixXd::Identity(2, 2), 1.0, {true}), std::invalid_argument);
  const VectorXd far = Eigen::Vector2d(60.0, 0.0);  // a normal density of exp(-900) is 0
  EXPECT_THROW(Region(far, MatrixXd::Identity(2, 2), 1.0, first), std::invalid_argument);
  EXPECT_NO_THROW(Region(far, MatrixXd::Identity(2, 2), 1.0, neither));
}

TEST(Emulator, InARegionItsVarianceIsTheMedianThere) {
  EmulatorState state;
  state.region = make_region(kMixed);
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

TEST(Region, GradientsArePulledBackToThePoints) {
  const MatrixXd by_input = normal_matrix(4, 3, 406);
  for (const Region& region : {make_region(), make_region(kMixed), Region()}) {
    const MatrixXd x = 0.5 * normal_matrix(3, 4, 407);
    const MatrixXd gradient = region.pulled_back(x, by_input);
    ASSERT_EQ(gradient.rows(), 3);
    ASSERT_EQ(gradient.cols(), 4);
    constexpr double kStep = 1e-6;  // differences are good to its square
    for (Index p = 0; p < 3; ++p) {
      MatrixXd above = x, below = x;
      above.row(p).array() += kStep;
      below.row(p).array() -= kStep;
      const MatrixXd slope = (region.inputs(above) - region.inputs(below)) / (2 * kStep);
      EXPECT_LT((slope.cwiseProduct(by_input).rowwise().sum() - gradient.row(p).transpose()).norm(), 1e-8);
    }
  }
}

// Of sum_q b_q(j) mean_q(j), b that of each point.
TEST(Emulator, SlopesAreThoseOfTheMean) {
  EmulatorState state;
  state.inputs = uniform_matrix(20, 3, 408);
  state.coefficients = normal_matrix(20, 2, 409);
  state.coefficients.col(1) *= 30.0;
  state.parameters = MatrixXd::Constant(2, 6, 1.0);
  state.parameters.col(1).setConstant(-6.0);
  const MatrixXd b = normal_matrix(5, 2, 410);
  for (const Region& region : {make_region(), make_region(kMixed), Region()}) {
    state.region = region;
    const Emulator emulator(state);
    const MatrixXd x = region.place(0.5 * normal_matrix(3, 5, 411));
    MatrixXd seen, mean, variance;
    const MatrixXd gradient = emulator.slopes_at(x, [&](const MatrixXd& at) {
      seen = at;
      return b;
    });
    emulator.predict_at(x, mean, variance);
    EXPECT_LT((seen - mean).norm(), 1e-10 * mean.norm());
    constexpr double kStep = 1e-5;
    for (Index p = 0; p < 3; ++p) {
      MatrixXd above = x, below = x, higher, lower;
      above.row(p).array() += kStep;
      below.row(p).array() -= kStep;
      emulator.predict_at(above, higher, variance);
      emulator.predict_at(below, lower, variance);
      const VectorXd slope = ((higher - lower).cwiseProduct(b) / (2 * kStep)).rowwise().sum();
      EXPECT_LT((slope - gradient.row(p).transpose()).norm(), 1e-6 * gradient.norm());
    }
  }
}

}  // namespace
}  // namespace amiss
