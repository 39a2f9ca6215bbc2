#pragma once
#include <utility>
#include <vector>

#include "engine/linalg/Eigen.hpp"
#include "engine/linalg/Scratch.hpp"

namespace amiss {

/// exp(-|a_i - b_j|^2) of the rows of a (m x c) and b (n x c): one matrix product, one exponential.
Eigen::MatrixXd gaussian_kernel(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
/// The same, written to `kernel` (m x n).
void gaussian_kernel(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::Ref<Eigen::MatrixXd> kernel);

/// Pivoted Cholesky factor of C_ij = exp(-|x_i - x_j|^2): C = LL' + E with E positive semi-definite and zero
/// in the rows of the pivots. Of a long record C is never formed; L grows by blocks of pivots, so that matrix
/// products do the work: N r^2 for rank r. In a block, pivots are chosen greedily among the worst rows of
/// each stretch of the record, as long as they are not much better than the worst of all.
class PivotedCholesky {
 public:
  PivotedCholesky() = default;
  explicit PivotedCholesky(Eigen::MatrixXd x) { start(std::move(x)); }

  /// Forgets the factor, keeps its memory.
  void start(Eigen::MatrixXd x);

  /// Adds pivots until the trace of E is at most `tolerance`, or lost in rounding; false if that takes more
  /// than `max_rank` of them.
  bool extend(double tolerance, Eigen::Index max_rank);

  Eigen::Index rank() const { return static_cast<Eigen::Index>(pivots_.size()); }
  Eigen::Map<const Eigen::MatrixXd> root() const { return {root_.data(), x_.rows(), rank()}; }  ///< L, N x r
  Eigen::VectorXd take_root() && { return std::move(root_); }  ///< L without a copy, column by column
  const std::vector<Eigen::Index>& pivots() const { return pivots_; }
  double trace() const { return left_.sum(); }  ///< of E

 private:
  void add_pivot();
  Eigen::Map<Eigen::MatrixXd> root_for(Eigen::Index rank);
  std::vector<Eigen::Index> candidates(Eigen::Index count) const;
  void add_block(Eigen::Index most);

  Eigen::MatrixXd x_;
  Scratch kernel_;        // C of a short record, less what the panels before took off; its lower triangle
  Eigen::VectorXd root_;  // L column by column, and room for more
  Eigen::VectorXd left_;  // diagonal of E
  std::vector<Eigen::Index> pivots_;
};

}  // namespace amiss
