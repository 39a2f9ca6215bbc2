#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// A likelihood along the last part of the coordinates, the others known: one for each of several chains,
/// chain i in column i.
class Conditional {
 public:
  virtual ~Conditional() = default;
  /// Log-likelihood where the chains have these last parts.
  virtual Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& part) const = 0;
  /// Its gradient with respect to them. It may be approximate: it only leads to where a move is proposed.
  virtual Eigen::MatrixXd gradient(const Eigen::MatrixXd& part) const = 0;
};

}  // namespace amiss
