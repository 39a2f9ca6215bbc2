#include "engine/random/TruncatedNormal.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>

#include "engine/random/transform.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFar = 30.0;
constexpr int kForgotten = 50;

// Draws along lines through a point z = mean + root white.
class Walk {
 public:
  Walk(const VectorXd& mean, const MatrixXd& root, const VectorXd& lower, const VectorXd& upper,
       const VectorXd& start)
      : root_(root), lower_(lower), upper_(upper), z_(start) {
    white_ = root_.triangularView<Eigen::Lower>().solve(start - mean);
  }

  // `direction` has length 1 where the distribution is white.
  void step(const VectorXd& direction, double u) {
    const VectorXd way = root_.triangularView<Eigen::Lower>() * direction;
    double lower = -kInfinity, upper = kInfinity;
    for (Index i = 0; i < way.size(); ++i) {
      if (way[i] == 0.0) continue;
      const double one = (lower_[i] - z_[i]) / way[i], other = (upper_[i] - z_[i]) / way[i];
      lower = std::max(lower, std::min(one, other));
      upper = std::min(upper, std::max(one, other));
    }
    const double length =
        truncated_quantile(u, -white_.dot(direction), std::min(lower, 0.0), std::max(upper, 0.0));
    z_ = (z_ + length * way).cwiseMax(lower_).cwiseMin(upper_);
    white_ += length * direction;
  }

  const VectorXd& z() const { return z_; }

 private:
  const MatrixXd& root_;
  const VectorXd& lower_;
  const VectorXd& upper_;
  VectorXd z_, white_;
};

}  // namespace

double truncated_quantile(double u, double centre, double lower, double upper) {
  const double first = lower - centre, last = upper - centre;
  if (first > 0) return -truncated_quantile(1 - u, -centre, -upper, -lower);
  if (last < -kFar) {
    const double inwards = -std::log1p((1 - u) * std::expm1((upper - lower) * last)) / -last;
    return std::max(upper - inwards, lower);
  }
  const double p = normal_cdf(first) + u * (normal_cdf(last) - normal_cdf(first));
  const double within = std::min(std::max(p, std::numeric_limits<double>::min()), 1 - 1e-16);
  return std::min(std::max(centre + boost::math::quantile(boost::math::normal(), within), lower), upper);
}

MatrixXd draws_within(const VectorXd& mean, const MatrixXd& covariance, const VectorXd& lower,
                      const VectorXd& upper, const VectorXd& start, int n, Stream& stream) {
  const Index p = mean.size();
  const MatrixXd root = covariance.llt().matrixL();
  // Where the distribution is white, these directions move one coordinate each.
  const MatrixXd axes =
      root.triangularView<Eigen::Lower>().solve(MatrixXd::Identity(p, p)).colwise().normalized();
  Walk walk(mean, root, lower, upper, start);
  MatrixXd draws(n, p);
  for (int i = -kForgotten; i < n; ++i) {
    for (Index j = 0; j < p; ++j) {
      walk.step(axes.col(j), stream.uniform());
      walk.step(stream.normals(p).normalized(), stream.uniform());
    }
    if (i >= 0) draws.row(i) = walk.z();
  }
  return draws;
}

}  // namespace amiss
