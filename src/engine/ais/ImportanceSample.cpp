#include "engine/ais/ImportanceSample.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/ais/StandardNormal.hpp"
#include "engine/ais/evaluate.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void ImportanceSample::extend(const Target& target, const Distribution& mixture, Index n,
                              const Context& context, Stream& stream) {
  const Index before = size(), total = before + n;
  x.conservativeResize(target.dimension(), total);
  ll.conservativeResize(total);
  log_w.conservativeResize(total);
  for (Index i = before; i < total; ++i) x.col(i) = mixture.draw(stream);
  const MatrixXd drawn = x.rightCols(n);
  VectorXd prior_over(n);
  ll.tail(n) = evaluate(target, drawn, context, [&](Index first, Index count) {
    const MatrixXd block = drawn.middleCols(first, count);
    prior_over.segment(first, count) = StandardNormal::at(block) - mixture.log_densities(block);
  });
  log_w.tail(n) = prior_over + ll.tail(n);
  if (!std::isfinite(log_w.maxCoeff())) return;
  log_evidence = log_mean_exp(log_w);
  weights = normalised_exp(log_w);
  ess = 1.0 / weights.squaredNorm();
  const double count = static_cast<double>(total);
  se = std::sqrt(std::max(0.0, count / ess - 1.0) / (count - 1.0));
}

}  // namespace amiss
