#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Straightens a cloud of points that lies about a curved sheet: in orthogonal coordinates s, the later ones
/// are polynomials of the first few, plus what is left,
///     z_j = s_j - g_j(s_1 ... s_k),  k < j.
/// The axes are the principal ones of the cloud, widest first; if the others bend along another direction,
/// that is the first. A shear after a rotation: volumes stay as they are, and densities with them. Where the
/// points give no reason to bend, g_j = 0 (Schwarz criterion). Points are columns.
class BentMap {
 public:
  /// The map that changes nothing.
  BentMap() = default;

  /// Least squares on weighted points; weights sum to 1.
  static BentMap fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& weights);

  bool bends() const { return axes_.cols() > 0; }
  Eigen::MatrixXd straight(const Eigen::MatrixXd& x) const;  ///< z of x
  Eigen::MatrixXd bent(const Eigen::MatrixXd& z) const;      ///< x of z
  /// Gradient by x, one point, of a function with gradient `by_z` at z(x).
  Eigen::VectorXd gradient(const Eigen::VectorXd& x, const Eigen::VectorXd& by_z) const;

 private:
  Eigen::MatrixXd monomials(const Eigen::MatrixXd& s) const;  ///< one row for each point

  Eigen::VectorXd centre_;
  Eigen::MatrixXd axes_;          // columns; none: the identity
  Eigen::VectorXd per_sd_;        // of the points along each: 1 / standard deviation, 0 where there is none
  Eigen::MatrixXd coefficients_;  // g_j in column j: one row for each monomial
};

}  // namespace amiss
