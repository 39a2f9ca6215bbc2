#include "engine/ais/spread_draws.hpp"

namespace amiss {

using Eigen::Index;

std::vector<Index> spread_draws(const Eigen::VectorXd& weights, int n) {
  std::vector<Index> picked;
  double cumulative = 0.0;
  Index at = -1;
  for (int i = 0; i < n; ++i) {
    while (cumulative < (i + 0.5) / n && at + 1 < weights.size()) cumulative += weights[++at];
    picked.push_back(at);
  }
  return picked;
}

}  // namespace amiss
