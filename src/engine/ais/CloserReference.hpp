#pragma once
#include <vector>

#include "engine/ais/Distribution.hpp"
#include "engine/ais/StudentT.hpp"

namespace amiss {

/// A distribution that comes closer to a posterior than its prior does, to anneal from: coordinates in
/// blocks, one mixture g_b for each, mixed defensively (Hesterberg 1995) with the prior,
///     a N(x; 0, I) + (1 - a) prod_b g_b(x_b).
/// The prior's share bounds the weights: where the mixtures have missed something, annealing from the prior
/// finds it.
class CloserReference : public Distribution {
 public:
  /// Blocks follow one another; their dimensions add up to that of the posterior.
  /// @throws std::invalid_argument unless prior_share lies in (0, 1).
  CloserReference(std::vector<StudentTMixture> blocks, double prior_share = 0.1);

  Eigen::VectorXd log_densities(const Eigen::MatrixXd& x) const override;
  Eigen::VectorXd gradient(const Eigen::VectorXd& x) const override;
  Eigen::VectorXd draw(Stream& stream) const override;

 private:
  Eigen::VectorXd log_close(const Eigen::MatrixXd& x) const;

  std::vector<StudentTMixture> blocks_;
  Eigen::Index dimension_ = 0;
  double prior_share_;
};

}  // namespace amiss
