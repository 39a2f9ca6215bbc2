#pragma once
#include <vector>

#include "engine/ais/Distribution.hpp"

namespace amiss {

/// Multivariate Student t: location m, scale L L', degrees of freedom nu.
class StudentT {
 public:
  StudentT(Eigen::VectorXd location, Eigen::MatrixXd root, double dof);

  /// Fitted by moments to weighted points (columns of x; weights sum to 1), the covariance shrunk towards its
  /// diagonal by d / (d + number of points), so that few points in many dimensions give a usable one.
  static StudentT fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& weights, double dof);

  Eigen::VectorXd log_densities(const Eigen::MatrixXd& x) const;  ///< of each column of x
  double log_density(const Eigen::VectorXd& x) const { return log_densities(x)[0]; }
  Eigen::VectorXd gradient(const Eigen::VectorXd& x) const;  ///< of log_density
  Eigen::VectorXd draw(Stream& stream) const;
  const Eigen::MatrixXd& root() const { return root_; }  ///< L
  Eigen::Index dimension() const { return location_.size(); }

  /// A step of length s in (0, 1] from each column of x that leaves this distribution invariant and is
  /// reversible in it: with d = L^-1 (x - m), draw w ~ InvGamma((nu + dim) / 2, (nu + d'd) / 2), then
  /// d' = sqrt(1 - s^2) d + s sqrt(w) N(0, I) (the preconditioned Crank-Nicolson step of a scale mixture).
  struct Step {
    Eigen::MatrixXd to;
    Eigen::VectorXd back;  ///< log density where it came from less that where it leads
  };
  Step step(const Eigen::MatrixXd& x, double s, Stream& stream) const;

 private:
  Eigen::MatrixXd whiten(const Eigen::MatrixXd& x) const;
  Eigen::ArrayXd log_kernel(const Eigen::MatrixXd& white) const;  // log density but for its constant

  Eigen::VectorXd location_;
  Eigen::MatrixXd root_, inverse_root_;
  double dof_;
  double log_constant_;
};

/// Mixture of Student t's; for importance sampling of posteriors with more than one mode.
class StudentTMixture : public Distribution {
 public:
  /// Weights sum to 1, one for each component.
  StudentTMixture(std::vector<StudentT> components, std::vector<double> weights);

  /// Gaussian mixtures of 1 ... max_components components are fitted by expectation-maximisation, until one
  /// more does not lower the BIC; that with the least gives locations and scales.
  static StudentTMixture fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& weights, int max_components,
                             double dof, Stream& stream);

  /// Several mixtures as one, with equal shares.
  static StudentTMixture together(const std::vector<StudentTMixture>& mixtures);

  Eigen::VectorXd log_densities(const Eigen::MatrixXd& x) const override;
  Eigen::VectorXd gradient(const Eigen::VectorXd& x) const override;
  Eigen::VectorXd draw(Stream& stream) const override;
  std::size_t size() const { return components_.size(); }
  Eigen::Index dimension() const { return components_.front().dimension(); }

 private:
  Eigen::MatrixXd log_parts(const Eigen::MatrixXd& x) const;  // one row for each point

  std::vector<double> weights_;
  std::vector<StudentT> components_;
};

}  // namespace amiss
