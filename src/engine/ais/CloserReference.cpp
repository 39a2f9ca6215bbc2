#include "engine/ais/CloserReference.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "engine/ais/StandardNormal.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

CloserReference::CloserReference(std::vector<StudentTMixture> blocks, double prior_share)
    : blocks_(std::move(blocks)), prior_share_(prior_share) {
  if (!(prior_share > 0 && prior_share < 1))
    throw std::invalid_argument("closer reference: prior_share must lie in (0, 1)");
  for (const StudentTMixture& block : blocks_) dimension_ += block.dimension();
}

VectorXd CloserReference::log_close(const MatrixXd& x) const {
  VectorXd value = VectorXd::Zero(x.cols());
  Index first = 0;
  for (const StudentTMixture& block : blocks_) {
    value += block.log_densities(x.middleRows(first, block.dimension()));
    first += block.dimension();
  }
  return value;
}

VectorXd CloserReference::log_densities(const MatrixXd& x) const {
  MatrixXd parts(x.cols(), 2);
  parts.col(0) = StandardNormal::at(x).array() + std::log(prior_share_);
  parts.col(1) = log_close(x).array() + std::log1p(-prior_share_);
  return log_sum_exp_rows(parts);
}

VectorXd CloserReference::gradient(const VectorXd& x) const {
  const double close =
      std::exp(std::log1p(-prior_share_) + log_close(x)[0] - log_density(x));  // its share at x
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
