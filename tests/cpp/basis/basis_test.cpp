#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/basis/Basis.hpp"
#include "helpers.hpp"

namespace amiss {
namespace {

using namespace test;

// Runs made of smooth patterns whose sizes fall by three each, on different levels.
MatrixXd runs(Index n = 60, Index m = 20) {
  MatrixXd patterns(n, 8);
  for (Index k = 0; k < 8; ++k) {
    for (Index i = 0; i < n; ++i) patterns(i, k) = std::pow(3.0, -k) * std::sin((k + 1.3) * 0.07 * i + k);
  }
  const MatrixXd levels = VectorXd::Ones(n) * (20 + normal_vector(m, 2).array()).matrix().transpose();
  return levels + patterns * normal_matrix(8, m, 1);
}

MatrixXd centred(const MatrixXd& y) { return y.rowwise() - y.colwise().mean(); }

VectorXd singular_values(const MatrixXd& y) {
  return Eigen::JacobiSVD<MatrixXd>(centred(y)).singularValues();
}

double actual_discarded_rms(const MatrixXd& y, const Basis& basis) {
  const MatrixXd rest = y - basis.vectors * basis.coefficients.transpose();
  return std::sqrt(rest.squaredNorm() / static_cast<double>(rest.size()));
}

BasisOptions explaining(double share) {
  BasisOptions options;
  options.explained = share;
  return options;
}

TEST(Basis, ColumnsAreOrthogonalAndScaledByTheSingularValues) {
  const MatrixXd y = runs();
  const Basis basis = make_basis(y, explaining(0.9999));
  ASSERT_GE(basis.size(), 5);
  const Index kept = basis.size() - 1;
  const VectorXd s = singular_values(y);
  const VectorXd norms = basis.vectors.colwise().norm();
  MatrixXd cosine = basis.vectors.transpose() * basis.vectors;
  cosine.array() /= (norms * norms.transpose()).array();
  EXPECT_LT((cosine - MatrixXd::Identity(kept + 1, kept + 1)).cwiseAbs().maxCoeff(), 1e-10);
  for (Index k = 0; k < kept; ++k) EXPECT_NEAR(norms[k] / s[k], 1.0, 1e-9) << k;
  EXPECT_EQ(basis.vectors.col(kept), VectorXd::Ones(60));
  EXPECT_LT((basis.singular_values.head(8) - s.head(8)).cwiseAbs().maxCoeff(), 1e-9 * s[0]);
}

TEST(Basis, ReportsTheDiscardedPartAsItIs) {
  const MatrixXd y = runs();
  for (double share : {0.5, 0.9, 0.99, 0.9999}) {
    const Basis basis = make_basis(y, explaining(share));
    const double rms = actual_discarded_rms(y, basis);
    ASSERT_GT(rms, 0.0);
    EXPECT_NEAR(basis.discarded_rms / rms, 1.0, 1e-8) << share;
    EXPECT_NEAR(basis.discarded_ss / (rms * rms * static_cast<double>(y.size())), 1.0, 1e-8) << share;
    EXPECT_NEAR(1.0 - basis.explained, rms * rms * static_cast<double>(y.size()) / centred(y).squaredNorm(),
                1e-12);
  }
}

TEST(Basis, CoefficientsAreTheLeastSquaresProjection) {
  const MatrixXd y = runs();
  const Basis basis = make_basis(y, explaining(0.95));
  const MatrixXd projected = basis.vectors.colPivHouseholderQr().solve(y).transpose();
  EXPECT_LT((projected - basis.coefficients).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(Basis, LastCoefficientIsTheMeanOfTheRun) {
  const MatrixXd y = runs();
  const Basis basis = make_basis(y, {});
  for (Index m = 0; m < y.cols(); ++m)
    EXPECT_NEAR(basis.coefficients(m, basis.size() - 1), y.col(m).mean(), 1e-12);
}

TEST(Basis, KeepsTheFewestVectorsThatExplainTheShare) {
  const MatrixXd y = runs();
  const VectorXd energy = singular_values(y).cwiseAbs2();
  for (double share : {0.3, 0.9, 0.99, 0.9999}) {
    Index needed = 0;
    while (energy.head(needed).sum() < share * energy.sum()) ++needed;
    EXPECT_EQ(make_basis(y, explaining(share)).size(), needed + 1) << share;
  }
}

TEST(Basis, NoiseRuleKeepsTheFewestVectorsBelowTheNoise) {
  const MatrixXd y = runs();
  const VectorXd energy = singular_values(y).cwiseAbs2();
  for (Index k = 2; k <= 6; ++k) {
    const double left_by_k = std::sqrt((energy.sum() - energy.head(k).sum()) / static_cast<double>(y.size()));
    BasisOptions options = explaining(0.3);
    options.noise_fraction = 0.4;
    options.noise_sd = 1.001 * left_by_k / 0.4;  // k vectors just suffice
    EXPECT_EQ(make_basis(y, options).size(), k + 1);
    options.noise_sd = 0.999 * left_by_k / 0.4;  // and now just do not
    const Basis basis = make_basis(y, options);
    EXPECT_EQ(basis.size(), k + 2);
    EXPECT_LE(actual_discarded_rms(y, basis), 0.4 * options.noise_sd);
  }
}

TEST(Basis, TheLargerOfBothRulesIsKept) {
  const MatrixXd y = runs();
  BasisOptions both = explaining(0.9999);
  both.noise_sd = 100.0;
  EXPECT_EQ(make_basis(y, both).size(), make_basis(y, explaining(0.9999)).size());
}

TEST(Basis, MaxVectorsCountsTheVectorOfOnes) {
  BasisOptions options = explaining(1.0);
  options.max_vectors = 4;
  const Basis basis = make_basis(runs(), options);
  EXPECT_EQ(basis.size(), 4);
  EXPECT_NEAR(actual_discarded_rms(runs(), basis) / basis.discarded_rms, 1.0, 1e-8);
}

TEST(Basis, PermutedTimeStepsPermuteTheVectors) {
  const MatrixXd y = runs();
  Eigen::PermutationMatrix<Eigen::Dynamic> shuffle(y.rows());
  for (Index i = 0; i < y.rows(); ++i) shuffle.indices()[i] = static_cast<int>((i * 23 + 7) % y.rows());
  const Basis plain = make_basis(y, {}), moved = make_basis(shuffle * y, {});
  ASSERT_EQ(plain.size(), moved.size());
  for (Index k = 0; k < plain.size(); ++k) {
    const VectorXd expected = shuffle * plain.vectors.col(k);
    const double sign = expected.dot(moved.vectors.col(k)) > 0 ? 1.0 : -1.0;
    EXPECT_LT((expected - sign * moved.vectors.col(k)).cwiseAbs().maxCoeff(), 1e-9) << k;
  }
}

TEST(Basis, MoreRunsThanTimeStepsWorks) {
  const MatrixXd y = runs(9, 25);
  const Basis basis = make_basis(y, explaining(0.999));
  EXPECT_LE(basis.size(), 9);
  EXPECT_EQ(basis.singular_values.size(), 9);
  EXPECT_NEAR(actual_discarded_rms(y, basis) / basis.discarded_rms, 1.0, 1e-6);
}

TEST(Basis, RefusesRunsWithoutVariationAndBadOptions) {
  EXPECT_THROW(make_basis(MatrixXd::Constant(10, 5, 3.0), {}), std::invalid_argument);
  MatrixXd broken = runs();
  broken(3, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(make_basis(broken, {}), std::invalid_argument);
  EXPECT_THROW(make_basis(runs().leftCols(2), {}), std::invalid_argument);
  for (double share : {0.0, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(make_basis(runs(), explaining(share)), std::invalid_argument) << share;
  }
  BasisOptions one_vector;
  one_vector.max_vectors = 1;
  EXPECT_THROW(make_basis(runs(), one_vector), std::invalid_argument);
}

}  // namespace
}  // namespace amiss
