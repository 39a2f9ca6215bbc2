#include "engine/ais/CloserReference.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "engine/ais/StandardNormal.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::VectorXd;

CloserReference::CloserReference(std::vector<StudentTMixture> blocks, double prior_share)
    : blocks_(std::move(blocks)), prior_share_(prior_share) {
  if (!(prior_share > 0 && prior_share < 1))
    throw std::invalid_argument("closer reference: prior_share must lie in (0, 1)");
  for (const StudentTMixture& block : blocks_) dimension_ += block.dimension();
}

double CloserReference::log_close(const VectorXd& x) const {
  double value = 0.0;
  Index first = 0;
  for (const StudentTMixture& block : blocks_) {
    value += block.log_density(x.segment(first, block.dimension()));
    first += block.dimension();
  }
  return value;
}

double CloserReference::log_density(const VectorXd& x) const {
  return log_sum_exp(Eigen::Vector2d(std::log(prior_share_) + StandardNormal::log_density_at(x),
                                     std::log1p(-prior_share_) + log_close(x)));
}

VectorXd CloserReference::gradient(const VectorXd& x) const {
  const double close = std::exp(std::log1p(-prior_share_) + log_close(x) - log_density(x));  // its share at x
  VectorXd slope(x.size());
  Index first = 0;
  for (const StudentTMixture& block : blocks_) {
    slope.segment(first, block.dimension()) = block.gradient(x.segment(first, block.dimension()));
    first += block.dimension();
  }
  return close * slope - (1.0 - close) * x;
}

VectorXd CloserReference::draw(Stream& stream) const {
  if (stream.uniform() < prior_share_) return stream.normals(dimension_);
  VectorXd x(dimension_);
  Index first = 0;
  for (const StudentTMixture& block : blocks_) {
    x.segment(first, block.dimension()) = block.draw(stream);
    first += block.dimension();
  }
  return x;
}

}  // namespace amiss
