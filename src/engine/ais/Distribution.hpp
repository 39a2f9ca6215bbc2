#pragma once
#include "engine/linalg/Eigen.hpp"
#include "engine/random/Stream.hpp"

namespace amiss {

/// A normalised distribution in the sampler's coordinates that is easy to draw from.
class Distribution {
 public:
  virtual ~Distribution() = default;
  virtual Eigen::VectorXd log_densities(const Eigen::MatrixXd& x) const = 0;  ///< of each column of x
  virtual Eigen::VectorXd gradient(const Eigen::VectorXd& x) const = 0;       ///< of log_density
  virtual Eigen::VectorXd draw(Stream& stream) const = 0;

  double log_density(const Eigen::VectorXd& x) const { return log_densities(x)[0]; }
};

}  // namespace amiss
