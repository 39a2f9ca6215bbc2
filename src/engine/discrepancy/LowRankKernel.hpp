#pragma once
#include <optional>
#include <vector>

#include "engine/Context.hpp"
#include "engine/discrepancy/KernelModel.hpp"
#include "engine/linalg/GaussianKernel.hpp"
#include "engine/linalg/Scratch.hpp"

namespace amiss {

/// A value that is not exact: the exact one lies in [value - below, value + above].
struct BoundedValue {
  double value = 0.0;
  double below = 0.0, above = 0.0;
};

/// What has to lie within the tolerance: the error of the determinant alone, or that of the quadratic form
/// too. The bound of the latter is wide (it lets the residual w lie in the worst direction of E; where the
/// model fits, w is noise and the error N times smaller), so that it is asked of the draws that certify, not
/// of every value.
enum class Certificate { determinant, both };

/// Log density (6) from a low rank C ~ LL' of the kernel's correlations C = zeta / amplitude, by pivoted
/// Cholesky. With r = amplitude * lambda* and F = PL, P = I - OO',
///     log|H'AH| = -(N-Q) log lambda* + log|I + r F'F|,
///     v'(H'AH)^-1 v = lambda* [y'Py - r b'(I + r F'F)^-1 b],  b = F'y.
/// What is left out, E = C - LL', is positive semi-definite. So log|H'AH| is too small by 0 ... r tr(E), and
/// the quadratic form too large by 0 ... lambda* r tr(E) |w|^2, w = (H'(I + r LL')H)^-1 v. The factor is
/// extended until what the certificate asks for lies within `tolerance` (nats); nothing is returned if that
/// takes a rank above `max_rank`. Cost N r^2.
std::optional<BoundedValue> low_rank_likelihood(const KernelModel& model, const KernelParameters& parameters,
                                                double tolerance, Certificate certificate,
                                                Eigen::Index max_rank);

/// The same, or the dense value where the rank is so high that it costs less.
BoundedValue bounded_likelihood(const KernelModel& model, const KernelParameters& parameters,
                                double tolerance, Certificate certificate, KernelModel::Memory& memory);

/// The discrepancy from the same factor: with F = PL and I + r F'F = MM',
///     mean r F (MM')^-1 F'y,  variance amplitude * (sums of squares of the rows of F M^-T).
/// What is left out makes the mean wrong by a vector of length at most r tr(E) |w|, and the variance by at
/// most r tr(E) / lambda*: shares of what noise does, and at most `tolerance`.
std::optional<KernelDiscrepancy> low_rank_discrepancy(const KernelModel& model,
                                                      const KernelParameters& parameters, double tolerance,
                                                      Eigen::Index max_rank);

/// The discrepancy at each of several draws, by low rank or, where that costs more, dense.
std::vector<KernelDiscrepancy> discrepancies(const KernelModel& model,
                                             const std::vector<KernelParameters>& draws,
                                             const Context& context);

/// Log density (6) for many parameters at a cost that does not grow with N. Pivots I and the interpolation
/// U = C_:I C_II^-1 are those of one rough kernel; for every smoother one C ~ U C_II U', and with G = (PU)'PU
/// and g = U'Py, both made once, a value takes a factor of C_II and products of its size (m x m) alone. The
/// error of this interpolation has no bound: certify draws against bounded_likelihood().
class KernelSkeleton {
 public:
  /// @param decay  the greatest decay of every condition (S+1) that it shall serve
  /// @param ratio  the greatest amplitude * lambda*
  /// @return       nothing if that takes more than `max_rank` pivots
  static std::optional<KernelSkeleton> make(const KernelModel& model, const Eigen::VectorXd& decay,
                                            double ratio, double tolerance, Eigen::Index max_rank);

  /// What a value works in, for skeletons of any size.
  struct Memory {
    PivotedCholesky cholesky;
    Scratch product, gram;
  };

  bool serves(const KernelParameters& parameters) const;
  /// @pre serves(parameters)
  double log_likelihood(const KernelParameters& parameters, Memory& memory) const;
  Eigen::Index rank() const { return pivots_.rows(); }  ///< m

 private:
  KernelSkeleton(const KernelModel& model, Eigen::VectorXd decay, double ratio, double tolerance,
                 PivotedCholesky cholesky);

  Eigen::VectorXd decay_;
  double ratio_, tolerance_;
  std::vector<int> condition_;
  Eigen::MatrixXd pivots_;     // m x columns: the conditions at I
  Eigen::MatrixXd root_;       // G
  Eigen::VectorXd projected_;  // g
  double square_ = 0.0;        // y'Py
  double dimension_ = 0.0;     // N - Q
};

}  // namespace amiss
