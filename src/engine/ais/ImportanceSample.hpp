#pragma once
#include <limits>

#include "engine/Context.hpp"
#include "engine/ais/Distribution.hpp"
#include "engine/ais/Target.hpp"

namespace amiss {

/// Weighted draws of a posterior from a distribution that comes close to it.
struct ImportanceSample {
  Eigen::MatrixXd x;          ///< dimension x n
  Eigen::VectorXd ll, log_w;  ///< log-likelihoods, log weights
  Eigen::VectorXd weights;    ///< sum 1
  double log_evidence = -std::numeric_limits<double>::infinity();
  double se = std::numeric_limits<double>::infinity();
  double ess = 0.0;

  Eigen::Index size() const { return ll.size(); }

  /// Adds n draws.
  void extend(const Target& target, const Distribution& mixture, Eigen::Index n, const Context& context,
              Stream& stream);
};

}  // namespace amiss
