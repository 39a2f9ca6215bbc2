#pragma once
#include <cstdint>
#include <vector>

#include "engine/ais/Chains.hpp"

namespace amiss {

/// An adaptive sequential Monte Carlo sampler (Del Moral, Doucet and Jasra 2006) that finds the ladder of
/// temperatures and, at each, a proposal, a step length and how many moves the chains need.
struct Pilot {
  std::vector<Level> levels;
  Chains chains;         ///< of equal weight, at the last level: draws of the posterior
  long evaluations = 0;  ///< of the likelihood

  /// @throws std::runtime_error if the likelihood is zero at every draw from the reference.
  Pilot(const AnnealingPath& path, const AisOptions& options, const Context& context, std::uint64_t purpose);
};

}  // namespace amiss
