#pragma once
#include "engine/linalg/Eigen.hpp"
#include "engine/linalg/constants.hpp"
#include "engine/random/Stream.hpp"

namespace amiss {

/// A posterior to be sampled and normalised: a reference distribution, normalised and easy to draw from,
/// times a likelihood. By default the reference is the prior in coordinates x ~ N(0, I): u = Phi(x) is
/// uniform on the unit cube, and a prior's quantile function maps u onto the parameters.
class Target {
 public:
  virtual ~Target() = default;
  virtual Eigen::Index dimension() const = 0;
  /// Log-likelihood of each column of x (dimension x n). Called from several threads at once. A value that is
  /// not finite counts as likelihood zero.
  virtual Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const = 0;

  /// How many points are asked for at once, at most; several such blocks share the threads.
  virtual Eigen::Index block() const { return 16; }

  virtual Eigen::VectorXd draw_reference(Stream& stream) const { return stream.normals(dimension()); }
  virtual double log_reference(const Eigen::VectorXd& x) const {
    return -0.5 * (x.squaredNorm() + kLogTwoPi * static_cast<double>(x.size()));
  }

  /// A target that has the gradient of its likelihood says so and overrides the next function; its chains
  /// then make Hamiltonian moves too.
  virtual bool has_gradient() const { return false; }
  /// Log-likelihood of each column of x, and its gradient with respect to x (dimension x n).
  virtual Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient) const {
    gradient.setZero(x.rows(), x.cols());
    return log_likelihood(x);
  }
  virtual Eigen::VectorXd reference_gradient(const Eigen::VectorXd& x) const { return -x; }
};

}  // namespace amiss
