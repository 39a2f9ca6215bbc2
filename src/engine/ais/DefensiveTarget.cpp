#include "engine/ais/DefensiveTarget.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

double log_standard_normal(const VectorXd& x) {
  return -0.5 * (x.squaredNorm() + kLogTwoPi * static_cast<double>(x.size()));
}

}  // namespace

DefensiveTarget::DefensiveTarget(const Target& target, const Distribution& close, Index first,
                                 double own_share)
    : target_(target), close_(close), first_(first), own_share_(own_share) {
  if (!(own_share > 0 && own_share < 1))
    throw std::invalid_argument("defensive reference: own_share must lie in (0, 1)");
}

double DefensiveTarget::log_ratio(const VectorXd& x) const {
  const VectorXd own = x.tail(x.size() - first_);
  const double close = std::log1p(-own_share_) + close_.log_density(own) - log_standard_normal(own);
  const double prior = std::log(own_share_);
  const double top = std::max(close, prior);
  return top + std::log(std::exp(close - top) + std::exp(prior - top));
}

// d log(a + (1 - a) g / n) = w (d log g - d log n), w the share of the second term.
VectorXd DefensiveTarget::ratio_gradient(const VectorXd& x) const {
  const VectorXd own = x.tail(x.size() - first_);
  const double share = 1.0 - own_share_ * std::exp(-log_ratio(x));
  VectorXd gradient = VectorXd::Zero(x.size());
  gradient.tail(own.size()) = share * (close_.gradient(own) + own);
  return gradient;
}

VectorXd DefensiveTarget::log_likelihood(const MatrixXd& x) const {
  VectorXd values = target_.log_likelihood(x);
  for (Index i = 0; i < x.cols(); ++i) values[i] -= log_ratio(x.col(i));
  return values;
}

VectorXd DefensiveTarget::log_likelihood(const MatrixXd& x, MatrixXd& gradient) const {
  VectorXd values = target_.log_likelihood(x, gradient);
  for (Index i = 0; i < x.cols(); ++i) {
    values[i] -= log_ratio(x.col(i));
    gradient.col(i) -= ratio_gradient(x.col(i));
  }
  return values;
}

VectorXd DefensiveTarget::draw_reference(Stream& stream) const {
  VectorXd x = target_.draw_reference(stream);
  if (stream.uniform() >= own_share_) x.tail(x.size() - first_) = close_.draw(stream);
  return x;
}

double DefensiveTarget::log_reference(const VectorXd& x) const {
  return target_.log_reference(x) + log_ratio(x);
}

VectorXd DefensiveTarget::reference_gradient(const VectorXd& x) const {
  return target_.reference_gradient(x) + ratio_gradient(x);
}

}  // namespace amiss
