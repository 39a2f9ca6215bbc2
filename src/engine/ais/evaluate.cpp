#include "engine/ais/evaluate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/parallel/parallel_for.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double finite_or_zero(double v) { return std::isfinite(v) ? v : -std::numeric_limits<double>::infinity(); }

void for_blocks(const Target& target, Index n, const Context& context,
                const std::function<void(Index, Index)>& task) {
  const Index block = std::min(n, target.block());
  parallel_for(static_cast<int>((n + block - 1) / block), context, [&](int b) {
    const Index first = b * block;
    task(first, std::min(block, n - first));
  });
}

VectorXd evaluate(const Target& target, const MatrixXd& x, const Context& context,
                  const std::function<void(Index, Index)>& also) {
  VectorXd ll(x.cols());
  for_blocks(target, x.cols(), context, [&](Index first, Index count) {
    ll.segment(first, count) = target.log_likelihood(x.middleCols(first, count)).unaryExpr(&finite_or_zero);
    if (also) also(first, count);
  });
  return ll;
}

VectorXd evaluate(const Target& target, const MatrixXd& x, MatrixXd& gradient, const Context& context,
                  const std::function<void(Index, Index)>& also) {
  VectorXd ll(x.cols());
  for_blocks(target, x.cols(), context, [&](Index first, Index count) {
    MatrixXd slope(x.rows(), count);
    ll.segment(first, count) =
        target.log_likelihood(x.middleCols(first, count), slope).unaryExpr(&finite_or_zero);
    gradient.middleCols(first, count) = slope;
    if (also) also(first, count);
  });
  return ll;
}

}  // namespace amiss
