#pragma once
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "engine/ais/Target.hpp"
#include "engine/error/ErrorModel.hpp"
#include "engine/linalg/Eigen.hpp"
#include "engine/linalg/constants.hpp"

/// Independent, dense and slow computations that the tests compare the engine with. In a file of their own,
/// as the compiler takes seconds for what they need of Eigen.
namespace amiss::test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Standard normal numbers that do not come from the engine's own streams.
MatrixXd normal_matrix(Index rows, Index columns, unsigned seed);

VectorXd normal_vector(Index n, unsigned seed);

MatrixXd uniform_matrix(Index rows, Index columns, unsigned seed);

/// log N(y; mean, covariance) by a dense eigen-decomposition.
double log_normal_density(const VectorXd& y, const VectorXd& mean, const MatrixXd& covariance);

/// Covariance of the error with sigma = 1, from its definition; independent across segments.
MatrixXd error_covariance(const TimeAxis& axis, const VectorXd& correlation_times, const VectorXd& ratios);

/// n values at unequal steps between 0.2 and 1.2, broken at `breaks`; time restarts at a break.
TimeAxis uneven_axis(Index n, const std::vector<Index>& breaks, unsigned seed = 4);

TimeAxis even_axis(Index n);

/// Derivative of f at x by central differences.
VectorXd numerical_gradient(const std::function<double(const VectorXd&)>& f, const VectorXd& x,
                            double h = 1e-5);

/// Largest distance between the empirical distribution of a sample and `cdf`.
double kolmogorov_distance(std::vector<double> sample, const std::function<double(double)>& cdf);

/// A target given by a function of one point.
class FunctionTarget : public Target {
 public:
  FunctionTarget(Index dimension, std::function<double(const VectorXd&)> f)
      : dimension_(dimension), f_(std::move(f)) {}
  Index dimension() const override { return dimension_; }
  VectorXd log_likelihood(const MatrixXd& x) const override;

 private:
  Index dimension_;
  std::function<double(const VectorXd&)> f_;
};

/// Log evidence of a target of two coordinates: trapezoidal rule over prior times likelihood, accurate to
/// rounding for a smooth integrand.
double evidence_by_quadrature(const Target& target);

}  // namespace amiss::test
