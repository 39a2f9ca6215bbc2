#pragma once
#include "engine/ais/Distribution.hpp"
#include "engine/ais/Target.hpp"

namespace amiss {

/// The same posterior seen from a reference fitted to its draws, or to those of a posterior nearby: little is
/// left to anneal. Unlike with DefensiveTarget, what the reference has missed is not found: its tails should
/// be heavy.
class BridgedTarget : public Target {
 public:
  BridgedTarget(const Target& target, const Distribution& reference)
      : target_(target), reference_(reference) {}

  Eigen::Index dimension() const override { return target_.dimension(); }
  Eigen::VectorXd draw_reference(Stream& stream) const override { return reference_.draw(stream); }
  double log_reference(const Eigen::VectorXd& x) const override { return reference_.log_density(x); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override {
    Eigen::VectorXd values = target_.log_likelihood(x);
    for (Eigen::Index i = 0; i < x.cols(); ++i) values[i] += log_ratio(x.col(i));
    return values;
  }
  bool has_gradient() const override { return target_.has_gradient(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient) const override {
    Eigen::VectorXd values = target_.log_likelihood(x, gradient);
    for (Eigen::Index i = 0; i < x.cols(); ++i) {
      values[i] += log_ratio(x.col(i));
      gradient.col(i) += target_.reference_gradient(x.col(i)) - reference_.gradient(x.col(i));
    }
    return values;
  }
  Eigen::VectorXd reference_gradient(const Eigen::VectorXd& x) const override {
    return reference_.gradient(x);
  }
  /// log density of the target's own reference less that of this one.
  double log_ratio(const Eigen::VectorXd& x) const {
    return target_.log_reference(x) - reference_.log_density(x);
  }

 private:
  const Target& target_;
  const Distribution& reference_;
};

}  // namespace amiss
