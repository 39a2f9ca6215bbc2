#pragma once
#include "engine/ais/Distribution.hpp"
#include "engine/linalg/constants.hpp"

namespace amiss {

/// N(0, I): the prior of every target, in the sampler's coordinates.
class StandardNormal : public Distribution {
 public:
  explicit StandardNormal(Eigen::Index dimension) : dimension_(dimension) {}

  static Eigen::VectorXd at(const Eigen::MatrixXd& x) {  ///< log density of each column of x
    return -0.5 * (x.colwise().squaredNorm().transpose().array() + kLogTwoPi * static_cast<double>(x.rows()));
  }
  Eigen::VectorXd log_densities(const Eigen::MatrixXd& x) const override { return at(x); }
  Eigen::VectorXd gradient(const Eigen::VectorXd& x) const override { return -x; }
  Eigen::VectorXd draw(Stream& stream) const override { return stream.normals(dimension_); }

 private:
  Eigen::Index dimension_;
};

}  // namespace amiss
