#pragma once
#include "engine/ais/Distribution.hpp"
#include "engine/linalg/constants.hpp"

namespace amiss {

/// N(0, I): the prior of every target, in the sampler's coordinates.
class StandardNormal : public Distribution {
 public:
  explicit StandardNormal(Eigen::Index dimension) : dimension_(dimension) {}

  static double log_density_at(const Eigen::VectorXd& x) {
    return -0.5 * (x.squaredNorm() + kLogTwoPi * static_cast<double>(x.size()));
  }
  double log_density(const Eigen::VectorXd& x) const override { return log_density_at(x); }
  Eigen::VectorXd gradient(const Eigen::VectorXd& x) const override { return -x; }
  Eigen::VectorXd draw(Stream& stream) const override { return stream.normals(dimension_); }

 private:
  Eigen::Index dimension_;
};

}  // namespace amiss
