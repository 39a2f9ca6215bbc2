#pragma once
#include <cstdint>

namespace amiss {

/// Random streams of one annealed importance sampling (Stream(seed, purpose, index)).
enum SamplingPurpose : std::uint64_t {
  kPilot = 1,
  kFrozen,
  kBootstrap,
  kImportance,
  kBridged = 16,  ///< added to the others by the second annealed run,
  kThird = 32,    ///< and by the third
};

}  // namespace amiss
