#include "engine/linalg/GaussianKernel.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kBlock = 32;       // pivots added at once, at most
constexpr Index kStretches = 128;  // candidates, one from each stretch of the record
constexpr double kWorthy = 0.2;    // of the largest remainder: what a pivot of the same block must still have
constexpr Index kShort = 256;  // records up to which the whole kernel is formed and pivots are added singly
constexpr double kRounding = 1e-14;  // a remainder that is none

}  // namespace

// -|a - b|^2 = [2a, -|a|^2, -1] [b, 1, |b|^2]': the squares ride along in the product.
void gaussian_kernel(const MatrixXd& a, const MatrixXd& b, Eigen::Ref<MatrixXd> kernel) {
  const Index c = a.cols();
  MatrixXd left(a.rows(), c + 2), right(b.rows(), c + 2);
  left << 2.0 * a, -a.rowwise().squaredNorm(), VectorXd::Constant(a.rows(), -1.0);
  right << b, VectorXd::Ones(b.rows()), b.rowwise().squaredNorm();
  kernel.noalias() = left * right.transpose();
  kernel = kernel.array().min(0.0).exp();
}

MatrixXd gaussian_kernel(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd kernel(a.rows(), b.rows());
  gaussian_kernel(a, b, kernel);
  return kernel;
}

void PivotedCholesky::start(MatrixXd x) {
  x_ = std::move(x);
  left_.setOnes(x_.rows());
  pivots_.clear();
  if (x_.rows() <= kShort) gaussian_kernel(x_, x_, kernel_.matrix(x_.rows(), x_.rows()));
}

// The memory of L with so many columns at least; those it has are kept.
Eigen::Map<MatrixXd> PivotedCholesky::root_for(Index rank) {
  const Index n = x_.rows(), have = root_.size() / n;
  if (rank > have) root_.conservativeResize(n * std::min(n, std::max(have * 3 / 2, rank + kBlock)));
  return {root_.data(), n, rank};
}

bool PivotedCholesky::extend(double tolerance, Index max_rank) {
  const Index most = std::min(max_rank, x_.rows());
  while (trace() > tolerance && left_.maxCoeff() > kRounding) {
    if (rank() >= most) return rank() == x_.rows();
    if (x_.rows() <= kShort) {
      add_pivot();
    } else {
      add_block(std::min(kBlock, most - rank()));
    }
  }
  return true;
}

// Column by column in panels (LAPACK's dpstrf): what the panels before this one took off is already missing
// from kernel_, in one symmetric product for each.
void PivotedCholesky::add_pivot() {
  const Index r = rank(), n = x_.rows(), panel = r - r % kBlock, width = r - panel;
  auto root = root_for(r + 1);
  auto kernel = kernel_.matrix(n, n);
  if (width == 0 && r > 0)
    kernel.selfadjointView<Eigen::Lower>().rankUpdate(root.middleCols(r - kBlock, kBlock), -1.0);
  Index pivot = 0;
  const double largest = left_.maxCoeff(&pivot);
  auto column = root.col(r);
  column.head(pivot) = kernel.row(pivot).head(pivot).transpose();
  column.tail(n - pivot) = kernel.col(pivot).tail(n - pivot);
  column.noalias() -= root.middleCols(panel, width) * root.row(pivot).segment(panel, width).transpose();
  column /= std::sqrt(largest);
  left_ = (left_ - column.cwiseAbs2()).cwiseMax(0.0);
  left_[pivot] = 0.0;
  pivots_.push_back(pivot);
}

std::vector<Index> PivotedCholesky::candidates(Index count) const {
  const Index n = x_.rows(), stretches = std::min(count, n);
  std::vector<Index> rows;
  for (Index k = 0; k < stretches; ++k) {
    const Index first = k * n / stretches, end = (k + 1) * n / stretches;
    Index worst = 0;
    if (left_.segment(first, end - first).maxCoeff(&worst) > kRounding) rows.push_back(first + worst);
  }
  return rows;
}

void PivotedCholesky::add_block(Index most) {
  const Index r = rank();
  const std::vector<Index> rows = candidates(kStretches);
  const Index c = static_cast<Index>(rows.size());
  MatrixXd there(c, x_.cols()), root_there(c, r);
  for (Index i = 0; i < c; ++i) {
    there.row(i) = x_.row(rows[static_cast<std::size_t>(i)]);
    root_there.row(i) = root().row(rows[static_cast<std::size_t>(i)]);
  }
  // E among the candidates, and its own pivoted Cholesky factor.
  MatrixXd small = gaussian_kernel(there, there);
  small.noalias() -= root_there * root_there.transpose();
  VectorXd left(c);  // not the diagonal of `small`, in which rounding may leave nothing of a pivot
  for (Index i = 0; i < c; ++i) left[i] = left_[rows[static_cast<std::size_t>(i)]];
  const double worthy = kWorthy * left.maxCoeff();
  MatrixXd factor(c, most);
  std::vector<Index> chosen;
  while (static_cast<Index>(chosen.size()) < most) {
    Index worst = 0;
    const double largest = left.maxCoeff(&worst);
    if (!(largest >= worthy) || !(largest > kRounding)) break;
    const Index k = static_cast<Index>(chosen.size());
    VectorXd column = small.col(worst);
    column.noalias() -= factor.leftCols(k) * factor.row(worst).head(k).transpose();
    factor.col(k) = column / std::sqrt(largest);
    left -= factor.col(k).cwiseAbs2();
    left[worst] = 0.0;
    chosen.push_back(worst);
  }

  const Index k = static_cast<Index>(chosen.size());
  MatrixXd pivots(k, x_.cols()), pivot_root(k, r), triangle(k, k);
  for (Index i = 0; i < k; ++i) {
    const Index row = chosen[static_cast<std::size_t>(i)];
    pivots.row(i) = there.row(row);
    pivot_root.row(i) = root_there.row(row);
    triangle.row(i) = factor.row(row).head(k);
    pivots_.push_back(rows[static_cast<std::size_t>(row)]);
  }
  auto root = root_for(r + k);
  auto columns = root.rightCols(k);
  gaussian_kernel(x_, pivots, columns);
  if (r > 0) columns.noalias() -= root.leftCols(r) * pivot_root.transpose();
  triangle.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(columns);
  left_ = (left_ - columns.rowwise().squaredNorm()).cwiseMax(0.0);
  for (Index i = r; i < r + k; ++i) left_[pivots_[static_cast<std::size_t>(i)]] = 0.0;
}

}  // namespace amiss
