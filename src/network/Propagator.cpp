#include "network/Propagator.hpp"

#include "engine/linalg/MatrixExponential.hpp"

namespace amiss::network {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

// Rows of what is held do not move.
void hold(Balance& balance, int node) {
  if (node < 0) return;
  balance.states.row(node).setZero();
  balance.inputs.row(node).setZero();
}

// M times the step; the inputs in units of `scale`. `base`: with what is the same in all directions.
MatrixXd generator(const Balance& balance, const Row& row, const VectorXd& scale, bool base) {
  const Index n = balance.states.rows(), k = balance.inputs.cols();
  const Index size = n + 1 + (row.linear ? 2 : 1) * k;
  MatrixXd m = MatrixXd::Zero(size, size);
  m.topLeftCorner(n, n) = row.step_h * balance.states;
  m.block(0, n + 1, n, k) = row.step_h * balance.inputs * scale.asDiagonal();
  m.row(n).head(n) = balance.output_states;
  m.row(n).segment(n + 1, k) = balance.output_inputs * scale.asDiagonal();
  if (base && row.linear) m.block(n + 1, n + 1 + k, k, k).setIdentity();
  return m;
}

// The largest entry of each column of the inputs becomes one, so that their units do not count.
VectorXd input_scale(const Balance& balance, const Row& row) {
  VectorXd largest = (row.step_h * balance.inputs).cwiseAbs().colwise().maxCoeff();
  return largest.unaryExpr([](double size) { return size > 0.0 ? 1.0 / size : 1.0; });
}

MatrixXd exponential(const MatrixXd& m) { return m.exp(); }

// The rows of the state and of the output, without the column of z, in the drivers' own units.
MatrixXd wanted(const MatrixXd& whole, Index n, Index k, const VectorXd& scale) {
  const Index further = whole.cols() - n - 1;
  MatrixXd out(n + 1, n + further);
  out.leftCols(n) = whole.topLeftCorner(n + 1, n);
  for (Index j = 0; j < further; ++j) out.col(n + j) = whole.col(n + 1 + j).head(n + 1) / scale[j % k];
  return out;
}

// The output at the end of the row in place of its mean: c x_1 + e (u + d).
RowVectorXd at_end(const Balance& balance, const MatrixXd& p) {
  const Index n = balance.states.rows(), k = balance.inputs.cols();
  RowVectorXd out = balance.output_states * p.topRows(n);
  for (Index from = n; from < p.cols(); from += k) out.segment(from, k) += balance.output_inputs;
  return out;
}

}  // namespace

MatrixXd propagator(const Network& network, const Coefficients& coefficients,
                    const std::vector<Coefficients>& directions, const VectorXd& drivers, const Row& row) {
  const double fastest = 1e5 / row.step_h;
  Balance base = balance(network, coefficients, drivers, fastest);
  hold(base, row.held);
  const VectorXd scale = input_scale(base, row);
  const MatrixXd m = generator(base, row, scale, true);
  const Index n = network.nodes, k = base.inputs.cols(), size = m.rows(), width = size - 1;
  MatrixXd out((n + 1) * static_cast<Index>(1 + directions.size()), width);
  MatrixXd value = wanted(exponential(m), n, k, scale);
  if (!row.mean) value.row(n) = at_end(base, value);
  out.topRows(n + 1) = value;
  for (std::size_t p = 0; p < directions.size(); ++p) {
    Balance change = derivative(network, coefficients, directions[p], drivers, fastest);
    hold(change, row.held);
    MatrixXd both = MatrixXd::Zero(2 * size, 2 * size);
    both.topLeftCorner(size, size) = both.bottomRightCorner(size, size) = m;
    both.topRightCorner(size, size) = generator(change, row, scale, false);
    MatrixXd slope = wanted(exponential(both).topRightCorner(size, size), n, k, scale);
    if (!row.mean) slope.row(n) = base.output_states * slope.topRows(n) + at_end(change, value);
    out.middleRows((n + 1) * static_cast<Index>(p + 1), n + 1) = slope;
  }
  return out;
}

}  // namespace amiss::network
