#pragma once
#include <vector>

#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Straightens a cloud of points that lies about a curved sheet: in the principal axes s of the cloud, the
/// later (narrower) coordinates are polynomials of the first few (widest), plus what is left,
///     z_j = s_j - g_j(s_1 ... s_k),  k < j.
/// A shear after a rotation: volumes stay as they are, and densities with them. Where the points give no
/// reason to bend, g_j = 0 (Schwarz criterion).
class BentMap {
 public:
  /// The map that changes nothing.
  BentMap() = default;

  /// Least squares on weighted points (columns of x; weights sum to 1).
  static BentMap fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& weights);

  bool bends() const { return axes_.cols() > 0; }
  Eigen::VectorXd straight(const Eigen::VectorXd& x) const;  ///< z of x
  Eigen::VectorXd bent(const Eigen::VectorXd& z) const;      ///< x of z
  /// Gradient by x of a function with gradient `by_z` at z(x).
  Eigen::VectorXd gradient(const Eigen::VectorXd& x, const Eigen::VectorXd& by_z) const;

 private:
  struct Terms {
    int leading = 0, degree = 0;
    Eigen::Index count() const;
    /// Values of the monomials of total degree 1 ... degree, and if asked their slopes (count x leading).
    Eigen::VectorXd values(const Eigen::VectorXd& t, Eigen::MatrixXd* slopes = nullptr) const;
  };
  Eigen::VectorXd standard(const Eigen::VectorXd& s, Eigen::VectorXd* slope = nullptr) const;
  double shift(Eigen::Index j, const Eigen::VectorXd& s) const;

  Eigen::VectorXd centre_;
  Eigen::MatrixXd axes_;                       // columns, widest first; none: the identity
  Eigen::VectorXd sd_;                         // of the points along each
  std::vector<Terms> terms_;                   // of each coordinate
  std::vector<Eigen::VectorXd> coefficients_;  // intercept, then those of the terms
};

}  // namespace amiss
