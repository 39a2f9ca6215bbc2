#pragma once
#include "engine/linalg/Eigen.hpp"
#include "engine/random/Stream.hpp"

namespace amiss {

/// A normalised distribution in the sampler's coordinates that is easy to draw from.
class Distribution {
 public:
  virtual ~Distribution() = default;
  virtual double log_density(const Eigen::VectorXd& x) const = 0;
  virtual Eigen::VectorXd gradient(const Eigen::VectorXd& x) const = 0;  ///< of log_density
  virtual Eigen::VectorXd draw(Stream& stream) const = 0;
};

}  // namespace amiss
