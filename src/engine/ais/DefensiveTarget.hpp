#pragma once
#include "engine/ais/Distribution.hpp"
#include "engine/ais/Target.hpp"

namespace amiss {

/// The same posterior from a reference that is closer to it, so that less is left to anneal. Coordinates
/// `first` ... of the target have prior N(0, I) in its own reference r, independent of the others; with a
/// distribution g over them, the new reference is the defensive mixture (Hesterberg 1995)
///     r(x) [ a + (1 - a) g(x_first...) / N(x_first...; 0, I) ],
/// whose share a of the target's own reference bounds the weights: where g has missed something, annealing
/// from the prior finds it.
class DefensiveTarget : public Target {
 public:
  DefensiveTarget(const Target& target, const Distribution& close, Eigen::Index first = 0,
                  double own_share = 0.1);

  Eigen::Index dimension() const override { return target_.dimension(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;
  Eigen::VectorXd draw_reference(Stream& stream) const override;
  double log_reference(const Eigen::VectorXd& x) const override;
  bool has_gradient() const override { return target_.has_gradient(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient) const override;
  Eigen::VectorXd reference_gradient(const Eigen::VectorXd& x) const override;

  /// log of the bracket above: log density of this reference less that of the target's own.
  double log_ratio(const Eigen::VectorXd& x) const;

 private:
  Eigen::VectorXd ratio_gradient(const Eigen::VectorXd& x) const;

  const Target& target_;
  const Distribution& close_;
  Eigen::Index first_;
  double own_share_;
};

}  // namespace amiss
