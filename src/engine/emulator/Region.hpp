#pragma once
#include <Eigen/Dense>
#include <vector>

namespace amiss {

/// Where in the space of the parameters an emulator holds, and what the inputs of its processes are there.
/// Points are in the coordinates in which the prior of the parameters is N(0, I): x = Phi^-1(z), z in the
/// unit cube.
///
/// Everywhere, the inputs are z. In an ellipsoid |R^-1 (x - c)| <= rho, the inputs are
/// 1/2 + R^-1 (s - c) / (2 rho): its axes are those of the posterior that it was drawn about, so that the
/// processes, one lengthscale an input, find few inputs that matter and little curvature. Here s is x made
/// straight: a parameter of uniform prior is linear in z and not in x, which bends most where a record
/// presses it against an end of the prior; there
///   s_i = c_i + (Phi(x_i) - E Phi(x_i)) / E phi(x_i),   x ~ N(c, RR'),
/// by which s_i - c_i is to z_i what the line of regression says. Any other is s_i = x_i.
class Region {
 public:
  Region() = default;  ///< everywhere
  /// @param uniform  which parameters have uniform priors
  /// @throws std::invalid_argument if sizes differ, the root is singular, the radius is not positive, or a
  ///   parameter of uniform prior is where that prior has no mass.
  Region(Eigen::VectorXd centre, Eigen::MatrixXd root, double radius, std::vector<bool> uniform);

  bool everywhere() const { return centre_.size() == 0; }
  bool contains(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  Eigen::MatrixXd inputs(const Eigen::MatrixXd& x) const;  ///< n x P, of points P x n
  /// Gradients with respect to points x (P x n) of functions whose gradients with respect to the inputs are
  /// given (n x P).
  Eigen::MatrixXd pulled_back(const Eigen::MatrixXd& x, const Eigen::MatrixXd& by_input) const;
  /// Points of the region for draws from N(0, I), both P x n: themselves, or c + R x, drawn in where the
  /// ellipsoid ends.
  Eigen::MatrixXd place(const Eigen::MatrixXd& normal) const;

  const Eigen::VectorXd& centre() const { return centre_; }
  const Eigen::MatrixXd& root() const { return root_; }
  double radius() const { return radius_; }
  const std::vector<bool>& uniform() const { return uniform_; }

 private:
  Eigen::MatrixXd standardised(const Eigen::MatrixXd& x) const;
  Eigen::MatrixXd straightened(const Eigen::MatrixXd& x) const;

  Eigen::VectorXd centre_;
  Eigen::MatrixXd root_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factor_;
  double radius_ = 0.0;
  std::vector<bool> uniform_;
  Eigen::VectorXd middle_, slope_;  // of Phi(x), for uniform priors: as for -x where the centre is positive
};

}  // namespace amiss
