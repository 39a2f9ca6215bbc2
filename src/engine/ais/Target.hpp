#pragma once
#include <limits>
#include <memory>
#include <vector>

#include "engine/ais/Conditional.hpp"
#include "engine/linalg/Eigen.hpp"
#include "engine/random/Stream.hpp"

namespace amiss {

/// A posterior to be sampled and normalised: prior times likelihood. The prior is x ~ N(0, I): u = Phi(x) is
/// uniform on the unit cube, and a prior's quantile function maps u onto the parameters. From which
/// distribution it is annealed is the sampler's business (Distribution); log-likelihoods are always these.
class Target {
 public:
  virtual ~Target() = default;
  virtual Eigen::Index dimension() const = 0;
  /// Log-likelihood of each column of x (dimension x n). Called from several threads at once. A value that is
  /// not finite counts as likelihood zero.
  virtual Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const = 0;

  /// Sizes of the parts, one after the other, in which the coordinates are moved: those of a part together,
  /// the parts in turn.
  virtual std::vector<Eigen::Index> parts() const { return {dimension()}; }

  /// A target whose likelihood is cheap to follow along its last part, the others staying as they are in the
  /// columns of x, says so and overrides the next function; the chains of the posterior itself then make
  /// Hamiltonian moves along that part.
  virtual bool has_conditional() const { return false; }
  virtual std::unique_ptr<Conditional> along_last_part(const Eigen::MatrixXd& /*x*/) const { return nullptr; }

  /// A target with coordinates that choose between settings, between which its likelihood jumps, says so and
  /// overrides the next function; chains then leap from setting to setting too. Those coordinates belong to
  /// the first part.
  virtual bool has_leaps() const { return false; }
  /// Takes x to a setting next to its own, the other coordinates to where it fits as well. A leap and its way
  /// back are equally probable. Returns log |dx' / dx|; -infinity if there is no such setting.
  virtual double leap(Eigen::Ref<Eigen::VectorXd> /*x*/, Stream& /*stream*/) const {
    return -std::numeric_limits<double>::infinity();
  }

  /// How many points are asked for at once, at most; several such blocks share the threads.
  virtual Eigen::Index block() const { return 16; }

  /// A target that has the gradient of its likelihood says so and overrides the next function; its chains
  /// then make Hamiltonian moves too.
  virtual bool has_gradient() const { return false; }
  /// Log-likelihood of each column of x, and its gradient with respect to x (dimension x n).
  virtual Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient) const {
    gradient.setZero(x.rows(), x.cols());
    return log_likelihood(x);
  }
};

}  // namespace amiss
