#pragma once
#include <cstdint>

namespace amiss {

/// Every purpose that random numbers are drawn for: Stream(seed, purpose, item).
enum StreamPurpose : std::uint64_t {
  kPilot = 1,  ///< four of one annealed importance sampling
  kFrozen = 2,
  kBootstrap = 3,
  kImportance = 4,
  kBridged = 16,  ///< added to these by its second annealed run,
  kThird = 32,    ///< and by the third
  kShifts = 11,   ///< of surrogates
  kOrders = 31,   ///< of conditions, for their shares
  kModes = 62,    ///< where a calibration starts
  kMixture = 63,
  kCloser = 64,
  kTangentPoints = 61,  ///< these two with a constant seed: they are no part of the chance
  kRegionPoints = 63,
  kWithinLimits = 65,
  kFictitious = 64,  ///< condition of the paper, a seed of its own
  kStage = 128,      ///< of the paper's kernel on a thinned record
};

/// Every part of a computation that draws from streams of its own: Context::fork(purpose).
enum ForkPurpose : std::uint64_t {
  kFirstHistory,
  kSecondHistory,
  kPopulation,
  kPosterior,
  kAgain,
  kParameters,     ///< of the paper, apart from its discrepancy
  kThinned,        ///< record before the one it was thinned from
  kRecord = 50,    ///< of several, numbered from here
  kWithout = 100,  ///< sets of conditions, numbered from here
};

}  // namespace amiss
