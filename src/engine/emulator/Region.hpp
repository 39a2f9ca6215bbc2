#pragma once
#include <Eigen/Dense>

namespace amiss {

/// Where in the space of the parameters an emulator holds, and what the inputs of its processes are there.
/// Points are in the coordinates in which the prior of the parameters is N(0, I): x = Phi^-1(z), z in the
/// unit cube.
///
/// Everywhere, the inputs are z. In an ellipsoid |R^-1 (x - c)| <= rho, the inputs are
/// 1/2 + R^-1 (x - c) / (2 rho): its axes are those of the posterior that it was drawn about, so that the
/// processes, one lengthscale an input, find few inputs that matter and little curvature.
class Region {
 public:
  Region() = default;  ///< everywhere
  /// @throws std::invalid_argument if sizes differ, the root is singular or the radius is not positive.
  Region(Eigen::VectorXd centre, Eigen::MatrixXd root, double radius);

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

 private:
  Eigen::MatrixXd standardised(const Eigen::MatrixXd& x) const;

  Eigen::VectorXd centre_;
  Eigen::MatrixXd root_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factor_;
  double radius_ = 0.0;
};

}  // namespace amiss
